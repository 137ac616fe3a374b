"""Solutions of the exercises: each found in two ways."""

from __future__ import annotations

import numpy as np

from acx4book.chapters.beyond.stability.history import CAMERA, HISTORY
from acx4book.notebooks.solution import Solution
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.least_squares.statistical import distributions
from acx4lib.least_squares.statistical.many_tests import holm
from acx4lib.results.campaigns.estimates import fit
from acx4lib.results.campaigns.ground import ground_effects


def pooled() -> Solution:
    """Pool two focal lengths, 2 µm apart, with standard deviations of 1 and 2 µm."""
    values, sigma = np.array([[0.0], [2.0]]), np.array([1.0, 2.0])
    found = fit(values, (sigma**2)[:, None, None], np.ones((2, 1)))
    weight = 1 / sigma**2
    by_hand = float(weight @ values[:, 0] / weight.sum())
    return Solution(
        text=(
            f"The weights are as 4 to 1. The pooled value lies {by_hand:.1f} µm from the first, "
            f"with σ = {weight.sum() ** -0.5:.2f} µm. χ² = 2²/(1² + 2²) = {found.chi_square:.1f} "
            "with one degree of freedom: nothing has changed that could be seen."
        ),
        value=by_hand,
        again=float(found.coefficients[0, 0]),
    )


def most_parameters(level: float = 0.05) -> Solution:
    """Return among how many tests a difference of three sigma is still significant."""
    p = 2 * distributions.norm_sf(3.0)
    by_hand = int(np.floor(level / p))
    n = next(n for n in range(1, 1000) if holm(np.append(p, np.ones(n - 1)))[0] >= level) - 1
    return Solution(
        text=(
            f"Three standard deviations have p = {p:.4f}. Times {by_hand} this is below "
            f"{level:g}, times {by_hand + 1} it is not. With more parameters, three standard "
            "deviations in one of them are what chance makes."
        ),
        value=float(by_hand),
        again=float(n),
    )


def corner(height_m: float = 1000.0, change_um: float = 10.0) -> Solution:
    """Return what a change of f moves at the corner of a format, from a height, m."""
    camera = Camera(
        name=CAMERA,
        width_px=11608,
        height_px=8708,
        pixel_mm=0.0046,
        interior=Interior(f=50.0),
    )
    half_mm = camera.pixel_mm / 2 * np.array([camera.width_px - 1, camera.height_px - 1])
    r, f = float(np.hypot(*half_mm)), camera.interior.f
    by_hand = height_m * r / f**2 * change_um / 1000
    effects = ground_effects(camera, ["f_mm"], np.array([1e-3]), height_m=height_m)
    found = np.hypot(*effects.moved(np.array([change_um / 1000])).T).max()
    return Solution(
        text=(
            f"The corner lies r = {r:.1f} mm from the principal point, on the ground "
            f"h r / f = {height_m * r / f:.0f} m. The derivative by f is h r / f², so that "
            f"{change_um:g} µm move it by {by_hand:.3f} m."
        ),
        value=by_hand,
        again=float(found),
    )


def temperatures() -> Solution:
    """Return how much better a slope is if half of the campaigns are cold and half hot."""
    at = np.array([flown.temperature_c for flown in HISTORY])
    cold_and_hot = np.repeat([at.min(), at.max()], len(at) // 2)
    by_hand = float(np.sqrt(np.sum((cold_and_hot - cold_and_hot.mean()) ** 2)))
    by_hand /= float(np.sqrt(np.sum((at - at.mean()) ** 2)))
    sigma = []
    for t in (at, cold_and_hot):
        X = np.column_stack([np.ones(len(t)), t - t.mean()])
        sigma.append(fit(np.zeros((len(t), 1)), np.ones((len(t), 1, 1)), X).cov[1, 0, 1, 0] ** 0.5)
    return Solution(
        text=(
            "The standard deviation of a slope is σ over the root of the sum of squares of "
            f"T − mean(T). Half cold and half hot make it {by_hand:.2f} times smaller. But with "
            "two temperatures alone no campaign shows whether the line is straight."
        ),
        value=by_hand,
        again=float(sigma[0] / sigma[1]),
    )
