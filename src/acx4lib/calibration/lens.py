"""The distortion of a calibrated camera over its image (section 4.1, eqs 7-11)."""

from __future__ import annotations

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.estimates import from_bundle, reported_covariance
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, distortion, xy_from_colrow

RADIAL = ("k1", "k2", "k3")


def corner_radius(camera: Camera) -> float:
    """Return half the image diagonal, mm."""
    return 0.5 * camera.pixel_mm * camera.diagonal_px


def radial_profile(fit: Bundle, *, n: int = 200) -> tuple[Array, Array, Array]:
    """Compute the radial distortion of a calibrated camera from its middle to its corner.

    Parameters
    ----------
    fit : Bundle
        An adjustment of one camera.
    n : int
        Number of radii.

    Returns
    -------
    r, px, sigma_px : ndarray, shape (n,)
        Radius, mm; distortion of eqs (7)-(8) and its a posteriori standard deviation, px.
    """
    camera, calibration = fit.cameras[0], from_bundle(fit)
    r = np.linspace(0.0, corner_radius(camera), n)
    powers = np.stack([r**3, r**5, r**7], axis=1) / camera.pixel_mm
    values = np.array([getattr(camera.interior, name) for name in RADIAL])
    columns = calibration.layout.interior[0][[INTERIOR.index(name) for name in RADIAL]]
    padded = np.pad(reported_covariance(calibration), (0, 1))  # column -1: held, no variance
    cov = padded[np.ix_(columns, columns)]
    return r, powers @ values, np.sqrt(np.einsum("ni,ij,nj->n", powers, cov, powers))


def largest_at_corners(camera: Camera) -> float:
    """Return the length of the whole distortion, eqs (7)-(10), at the worst corner, px."""
    w, h = camera.width_px - 0.5, camera.height_px - 0.5
    corners = np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])
    dxy = distortion(camera.interior, xy_from_colrow(camera, corners))
    return float(np.hypot(*dxy.T).max() / camera.pixel_mm)
