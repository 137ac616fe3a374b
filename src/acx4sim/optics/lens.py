"""The simulator's own cameras: from a point in the camera frame to a pixel.

Brown's correction is a function of the measured point. Therefore the way from the object to the
image is the root of an equation, found by Newton's method.
"""

from dataclasses import dataclass

import numpy as np

from acx4sim.earth import Array, BoolArray

_TOLERANCE = 1e-13  # mm
_MAX_STEPS = 20
_REACH = 1.5  # mm; largest shift by distortion and principal point onto the sensor


@dataclass(frozen=True, kw_only=True)
class Camera:
    """The true parameters of a camera and of its mounting on the IMU.

    Attributes
    ----------
    width_px, height_px : int
        Size of the sensor.
    pixel_um : float
        Pixel size, micrometres.
    f_mm, xp_mm, yp_mm : float
        Focal length and principal point.
    k1, k2, k3, p1, p2 : float
        Brown's coefficients, mm^-2, mm^-4, mm^-6, mm^-1, mm^-1.
    boresight_deg : tuple of float
        Omega, phi, kappa of the boresight, camera to body.
    lever_m : tuple of float
        From the IMU to the perspective centre, forward, left, up.
    """

    width_px: int
    height_px: int
    pixel_um: float
    f_mm: float
    xp_mm: float = 0.0
    yp_mm: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    boresight_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lever_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


def correction(camera: Camera, xy: Array) -> tuple[Array, Array]:
    """Compute the correction to subtract from a measured point, and its derivatives.

    Parameters
    ----------
    camera : Camera
        The camera.
    xy : ndarray, shape (n, 2)
        Measured point minus principal point, mm.

    Returns
    -------
    dxy : ndarray, shape (n, 2)
        Correction, mm.
    slope : ndarray, shape (n, 2, 2)
        Derivatives of `dxy` with respect to `xy`.
    """
    x, y = xy.T
    rr = x * x + y * y
    radial = rr * (camera.k1 + rr * (camera.k2 + rr * camera.k3))
    growth = 2 * (camera.k1 + rr * (2 * camera.k2 + rr * 3 * camera.k3))
    p1, p2 = camera.p1, camera.p2
    dxy = np.column_stack(
        [
            x * radial + p1 * (rr + 2 * x * x) + 2 * p2 * x * y,
            y * radial + p2 * (rr + 2 * y * y) + 2 * p1 * x * y,
        ]
    )
    cross = growth * x * y + 2 * p1 * y + 2 * p2 * x
    slope = np.empty((len(xy), 2, 2))
    slope[:, 0, 0] = radial + growth * x * x + 6 * p1 * x + 2 * p2 * y
    slope[:, 0, 1] = cross
    slope[:, 1, 0] = cross
    slope[:, 1, 1] = radial + growth * y * y + 6 * p2 * y + 2 * p1 * x
    return dxy, slope


def measured_from_ideal(camera: Camera, ideal: Array) -> Array:
    """Find the measured points of given corrected points.

    Valid where the correction grows more slowly than the radius.

    Parameters
    ----------
    camera : Camera
        The camera.
    ideal : ndarray, shape (n, 2)
        Right-hand sides of eqs (1) and (2) without distortion, mm.

    Returns
    -------
    xy : ndarray, shape (n, 2)
        Measured points minus principal point, mm.

    Raises
    ------
    ValueError
        Where the root is not found to about 1e-13 mm.
    """
    xy = ideal.copy()
    for _ in range(_MAX_STEPS):
        dxy, slope = correction(camera, xy)
        step = np.linalg.solve(np.eye(2) - slope, (ideal + dxy - xy)[:, :, None])[:, :, 0]
        xy += step
        if np.abs(step).max(initial=0.0) < _TOLERANCE:
            return xy
    msg = f"distortion of {camera} cannot be inverted, last step {np.abs(step).max()} mm"
    raise ValueError(msg)


def colrow_from_image(camera: Camera, xy: Array) -> Array:
    """Compute pixel coordinates of image coordinates in mm, principal point included."""
    pixel = camera.pixel_um / 1000
    return np.column_stack(
        [
            xy[:, 0] / pixel + (camera.width_px - 1) / 2,
            (camera.height_px - 1) / 2 - xy[:, 1] / pixel,
        ]
    )


def inside(camera: Camera, colrow: Array, margin_px: float) -> BoolArray:
    """Tell which pixel coordinates lie on the sensor, at least `margin_px` from its edge."""
    low = margin_px - 0.5
    high = np.array([camera.width_px, camera.height_px]) - 0.5 - margin_px
    on_sensor: BoolArray = np.all((colrow >= low) & (colrow <= high), axis=-1)
    return on_sensor


def project(camera: Camera, x_c: Array) -> Array:
    """Project points of the camera frame.

    Parameters
    ----------
    camera : Camera
        The camera.
    x_c : ndarray, shape (..., 3)
        Points in the camera frame, z away from the ground, m.

    Returns
    -------
    colrow : ndarray, shape (..., 2)
        Pixel coordinates; NaN behind the camera and far outside the sensor.
    """
    colrow = np.full((*x_c.shape[:-1], 2), np.nan)
    ahead = x_c[..., 2] < 0
    scale = np.where(ahead, -camera.f_mm / np.where(ahead, x_c[..., 2], -1.0), np.nan)
    ideal = scale[..., None] * x_c[..., :2]
    half = camera.pixel_um / 2000 * np.array([camera.width_px, camera.height_px])
    near = np.all(np.abs(ideal) <= half + _REACH, axis=-1)
    xy = measured_from_ideal(camera, ideal[near])
    colrow[near] = colrow_from_image(camera, xy + np.array([camera.xp_mm, camera.yp_mm]))
    return colrow
