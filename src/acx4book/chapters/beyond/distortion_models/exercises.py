"""Solutions of the exercises: each found in two ways."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from acx4book.chapters.beyond.distortion_models.cases import DENT_AT, dent_px
from acx4book.chapters.beyond.distortion_models.families import WAVES, ebner
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy


@dataclass(frozen=True, kw_only=True)
class Solution:
    """An answer with its number, and the same number found in another way.

    Attributes
    ----------
    text : str
    value, again : float
    """

    text: str
    value: float
    again: float


def nine_points() -> Array:
    """Return Ebner's 3 x 3 points in units of the base, shape (9, 2)."""
    return np.array(list(product((-1.0, 0.0, 1.0), repeat=2)))


def orthogonal() -> Solution:
    """Return the largest product of two of Ebner's terms over the 3 x 3 points."""
    A = ebner(nine_points()).reshape(-1, 12)
    products = A.T @ A
    off = float(np.abs(products - np.diag(np.diagonal(products))).max())
    return Solution(
        text=(
            "The sums over the nine points of the products of two different terms are all zero "
            f"(largest {off:.0e}), so the normal matrix is diagonal. k = x² − 2/3 has the mean "
            "zero over −1, 0, 1: this is what the 2/3 is for."
        ),
        value=0.0,
        again=off,
    )


def number_of_waves(order: int = 2) -> Solution:
    """Return how many coefficients a Fourier series of an order has."""
    by_hand = 2 * ((2 * order + 1) ** 2 - 1)
    pairs = {
        max((m, n), (-m, -n))
        for m, n in product(range(-order, order + 1), repeat=2)
        if (m, n) != (0, 0)
    }
    return Solution(
        text=(
            "There are (2N + 1)² pairs (m, n) with |m|, |n| ≤ N. One is the constant, and of "
            "(m, n) and (−m, −n) one is enough. Each has a cosine and a sine, in x and in y: "
            f"2 ((2N + 1)² − 1). This is {4 * len(WAVES)} for N = 1, {by_hand} for N = {order}."
        ),
        value=float(by_hand),
        again=float(4 * len(pairs)),
    )


def price(observations: int = 7000, parameters: int = 16) -> Solution:
    """Return by how much the weighted squares must fall for more parameters to lower BIC."""
    by_hand = parameters * float(np.log(observations))
    falls = np.arange(0.0, 1000.0, 0.001)
    bic = -falls + parameters * np.log(observations)
    return Solution(
        text=(
            f"By k ln n = {parameters} · {np.log(observations):.2f} = {by_hand:.0f}. If the "
            f"parameters are all zero, the squares fall by about {parameters}, their number, and "
            "BIC rises. Akaike's criterion asks for 2k only, and so prefers more parameters."
        ),
        value=by_hand,
        again=float(falls[np.argmax(bic < 0)]),
    )


def shift_of_a_dent(depth_um: float = 10.0) -> Solution:
    """Return what the middle of a dent shifts, px."""
    camera = Camera(
        name="CAM",
        width_px=11608,
        height_px=8708,
        pixel_mm=0.0046,
        interior=Interior(f=50.0),
    )
    half_mm = camera.pixel_mm / 2 * np.array([camera.width_px, camera.height_px])
    xy = half_mm * DENT_AT
    by_hand = depth_um / 1000 * float(np.hypot(*xy)) / camera.interior.f / camera.pixel_mm
    shift = dent_px(camera, colrow_from_xy(camera, xy[None]), depth_um)
    return Solution(
        text=(
            f"The middle of the dent lies r = {np.hypot(*xy):.1f} mm from the middle of the image. "
            f"The ray meets the sensor farther out by h r / f = {depth_um:g} µm · "
            f"{np.hypot(*xy) / camera.interior.f:.2f}, which is {by_hand:.2f} px."
        ),
        value=by_hand,
        again=float(np.hypot(*shift[0])),
    )
