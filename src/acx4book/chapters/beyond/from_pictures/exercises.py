"""Solutions of the exercises: each found in two ways."""

from __future__ import annotations

import numpy as np

from acx4book.notebooks.solution import Solution
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.measuring.pictures.pairs import Found
from acx4lib.measuring.points import joined

CAMERA = Camera(
    name="CAM", width_px=1658, height_px=1244, pixel_mm=0.0322, interior=Interior(f=50.0)
)
"""The camera of the flight, with pictures of a seventh of the size."""

HEIGHT_M, BASE_M = 600.0, 192.0


def _seen(east_m: float, height_m: float, opk: tuple[float, float, float], x: float) -> np.ndarray:
    turned = rotation_from_opk(np.array([0, 0, opk[2]]))  # the aircraft's, then the boresight's
    R = turned @ rotation_from_opk(np.array([opk[0], opk[1], 0]))
    T = Pose(R=R[None], r=np.array([[east_m, 0.0, height_m]]))
    out: np.ndarray = project(CAMERA, T, np.array([[x, 0.0, 0.0]]))[0]
    return out


def search(relief_m: float = 25.0) -> Solution:
    """Return how far a point moves between two pictures if the ground is higher than believed."""
    f_px = CAMERA.interior.f / CAMERA.pixel_mm
    by_hand = f_px * BASE_M * (1 / (HEIGHT_M - relief_m) - 1 / HEIGHT_M)

    def parallax(height_m: float) -> float:
        places = [_seen(east, height_m, (0, 0, 0), 100.0) for east in (0.0, BASE_M)]
        return float(places[0][0] - places[1][0])

    return Solution(
        text=(
            f"The parallax is $f B / h$. With $f$ = {f_px:.0f} px, $B$ = {BASE_M:g} m and "
            f"$h$ = {HEIGHT_M:g} m, ground that is {relief_m:g} m higher changes it by "
            f"{by_hand:.0f} px. The search of the first level covers 14 px of pictures that are "
            "about three times smaller, so it is found there; later levels know the ground."
        ),
        value=float(by_hand),
        again=parallax(HEIGHT_M - relief_m) - parallax(HEIGHT_M),
    )


def turned(angle_deg: float = 0.3) -> Solution:
    """Return by how much two opposite pictures disagree if the boresight is off."""
    f_px = CAMERA.interior.f / CAMERA.pixel_mm
    by_hand = 2 * f_px * float(np.tan(np.radians(angle_deg)))
    off = np.radians(angle_deg)
    moved = [
        _seen(0.0, HEIGHT_M, (0, off, kappa), 0.0) - _seen(0.0, HEIGHT_M, (0, 0, kappa), 0.0)
        for kappa in (0.0, np.pi)
    ]
    # the second picture is turned by 180 degrees: in the first one's pixels its shift is reversed
    apart = moved[0] - -moved[1]
    return Solution(
        text=(
            f"Each picture is off by $f \\tan$ {angle_deg:g}° = {by_hand / 2:.1f} px, always to "
            "the same side of the camera. In opposite strips these are opposite sides on the "
            f"ground: the pictures disagree by {by_hand:.0f} px. In the same direction they would "
            "agree, and nothing would be seen of it."
        ),
        value=by_hand,
        again=float(np.hypot(*apart)),
    )


def shares(sigma_px: float = 0.06) -> Solution:
    """Return the sigma of a ray if matching says how well the difference of two is known."""
    by_hand = sigma_px / np.sqrt(2)
    none = Found(which=np.zeros(0, np.intp), colrow=np.zeros((0, 2)), sigma_px=np.zeros((0, 2)))
    both = Found(
        which=np.zeros(1, np.intp),
        colrow=np.array([[10.0, 10.0]]),
        sigma_px=np.full((1, 2), sigma_px),
    )
    corners = [np.array([[5, 5]]), np.zeros((0, 2), np.intp)]
    rays = joined(corners, {(0, 1): (both, none)})
    return Solution(
        text=(
            f"The variance of a difference is the sum of both variances. If both pictures have "
            f"an equal part, each ray has {sigma_px:g} / √2 = {by_hand:.3f} px. Written as "
            f"{sigma_px:g} px for each, the adjustment would give the matching half its weight."
        ),
        value=float(by_hand),
        again=float(rays.sigma_px[1]),
    )
