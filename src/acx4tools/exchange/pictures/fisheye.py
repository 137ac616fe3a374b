"""Fisheye lenses as Pix4D documents them and Parrot writes them, rewritten as perspective ones.

With theta = 2/pi arctan(r) of an ideal point at the distance r from the axis, rho = p0 + p1 theta +
p2 theta^2 + …; the point at rho in the same direction, times the matrix (C D; E F), plus
the principal point, is the pixel.
"""

from __future__ import annotations

import numpy as np

from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4tools.exchange.lens import Left, Pinhole, camera_of, off_fisheye

STEPS = 50
"""Of Newton's method, from where the polynomial is the identity."""


def fisheye_camera(
    polynomial: Array,
    matrix: Array,
    centre: Array,
    *,
    name: str,
    width_px: int,
    height_px: int,
    pixel_mm: float,
) -> tuple[Camera, Left]:
    """Return the camera that is nearest to a fisheye lens, in the whole image.

    Parameters
    ----------
    polynomial : ndarray, shape (4,) or (5,)
        p0, p1, p2, p3 and, where it is there, p4.
    matrix : ndarray, shape (2, 2)
        C, D; E, F, px.
    centre : ndarray, shape (2,)
        col, row of the principal point.
    name, width_px, height_px, pixel_mm
        As `Camera` has them.

    Raises
    ------
    ValueError
        Where a pixel has no ray ahead, or for values that no lens has.
    """
    (fx, fy), back = 2 * np.abs(np.diag(matrix)) / np.pi, np.linalg.inv(matrix)
    return camera_of(
        lambda colrow: _ideal(polynomial, (colrow - centre) @ back.T),
        Pinhole(fx=float(fx), fy=float(fy), cx=float(centre[0]), cy=float(centre[1])),
        name=name,
        width_px=width_px,
        height_px=height_px,
        pixel_mm=pixel_mm,
    )


def _ideal(polynomial: Array, at: Array) -> Array:
    """Return the ideal points of points of the circular image, shape (n, 2)."""
    rho = np.hypot(*at.T)
    theta, value = rho.copy(), np.polynomial.Polynomial(polynomial)
    with np.errstate(all="ignore"):  # what has no solution ends as NaN
        for _ in range(STEPS):
            theta = theta - (value(theta) - rho) / value.deriv()(theta)
        solved = np.abs(value(theta) - rho) < 1e-12
    angle = np.where(solved & (theta >= 0), theta, np.nan) * (np.pi / 2)
    unit = np.divide(at, rho[:, None], out=np.zeros_like(at), where=rho[:, None] > 0)
    return off_fisheye(unit * angle[:, None])
