"""A camera: pixels and millimetres, interior orientation, distortion (eqs 7-11)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.expected import Array, Mask
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import MOUNT, SHOWN, Prior

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True)
class Interior:
    """Interior orientation of one camera.

    Attributes
    ----------
    f, xp, yp : float
        Focal length and principal point, mm.
    k1, k2, k3 : float
        Radial coefficients, mm^-2, mm^-4, mm^-6.
    p1, p2 : float
        Decentring coefficients, mm^-1.
    b1, b2 : float
        Affinity: x becomes (1 + b1) x + b2 y before all else, dimensionless.

    Raises
    ------
    ValueError
        Where f is not positive, or a number is not finite.
    """

    f: float
    xp: float = 0.0
    yp: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    b1: float = 0.0
    b2: float = 0.0

    def __post_init__(self) -> None:
        for name in INTERIOR:
            expected.finite(name, getattr(self, name))
        if not self.f > 0:
            msg = f"focal length must be positive, got f={self.f} mm"
            raise ValueError(msg)

    def __repr__(self) -> str:
        """Return the values that are not zero in a line."""
        values = (f"{name} {getattr(self, name):.6g}" for name in INTERIOR if getattr(self, name))
        return shown.line("Interior", *values)

    def table(self) -> pd.DataFrame:
        """Return the values that are not zero with their units."""
        return shown.parameter_table(_interior_rows("", self, {}))

    def to_array(self) -> Array:
        """Return the ten values in the order of `INTERIOR`."""
        return np.array([getattr(self, name) for name in INTERIOR])

    @classmethod
    def from_array(cls, values: Array) -> Interior:
        """Make an interior orientation from ten values in the order of `INTERIOR`."""
        values = expected.numbers("values", values, (len(INTERIOR),))
        return cls(**dict(zip(INTERIOR, map(float, values), strict=True)))


INTERIOR = tuple(f.name for f in fields(Interior))
"""Names of the interior parameters, in the order of every column block."""

LARGEST_FORMAT_MM = 1000.0
"""Longest side of a sensor; a pixel size given in micrometres leads to a longer one."""

SMALLEST_F_MM = 1.0
"""No camera of a flight has a smaller focal length."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Camera:
    """One camera as a flight declares it.

    Attributes
    ----------
    name : str
    width_px, height_px : int
    pixel_mm : float
        Pixel size.
    interior : Interior
        Known values, or approximate values for an adjustment.
    T_b_c : Pose
        Mounting: boresight ``R_b_c`` and lever arm ``r_b_c`` (m), known or approximate.
    prior : Prior
        Which parts of the mounting are declared, and how well they are known.

    Raises
    ------
    ValueError
        Where a size is not positive, or the mounting is not one finite pose.
    """

    name: str
    width_px: int
    height_px: int
    pixel_mm: float
    interior: Interior
    T_b_c: Pose = field(default_factory=lambda: Pose(R=np.eye(3), r=np.zeros(3)))
    prior: Prior = field(default_factory=Prior)

    def __post_init__(self) -> None:
        expected.whole("width_px", self.width_px)
        expected.whole("height_px", self.height_px)
        expected.positive("pixel_mm", self.pixel_mm)
        side_mm = max(self.width_px, self.height_px) * self.pixel_mm
        if not (self.pixel_mm <= 1 or side_mm <= LARGEST_FORMAT_MM):
            msg = (
                f"pixel_mm: expected mm, got {self.pixel_mm}, which makes a sensor of "
                f"{side_mm / 1000:.1f} m (micrometres?)"
            )
            raise ValueError(msg)
        expected.shape("T_b_c.R", self.T_b_c.R, (3, 3))
        expected.finite("T_b_c.R", self.T_b_c.R)
        expected.finite("T_b_c.r", self.T_b_c.r)
        expected.rotations("T_b_c.R", self.T_b_c.R)

    def __repr__(self) -> str:
        """Say in a line how large it is."""
        size = f"{self.width_px} × {self.height_px} px of {1000 * self.pixel_mm:.6g} µm"
        return shown.line(f"Camera {self.name}", size, f"f {self.interior.f:.6g} mm")

    def table(self) -> pd.DataFrame:
        """Return interior orientation and mounting with their units."""
        return shown.parameter_table(parameter_rows(self, {}))

    @property
    def diagonal_px(self) -> float:
        """Length of the image diagonal, px."""
        return float(np.hypot(self.width_px, self.height_px))

    def with_interior(self, interior: Interior) -> Camera:
        """Return this camera with another interior orientation."""
        camera = copy(self)  # its other fields were checked before
        object.__setattr__(camera, "interior", interior)
        return camera


def parameter_rows(
    camera: Camera, sigma: Mapping[str, float], *, mounted: bool = True
) -> Iterator[shown.Row]:
    """Yield the parameters of a camera as tables show them.

    Parameters
    ----------
    camera : Camera
    sigma : mapping of str to float
        Of those that are estimated, by their names, in the units that are shown; the others are
        held, and those of the interior orientation are left out where they are zero.
    mounted : bool
        Whether the mounting is shown.
    """
    yield from _interior_rows(camera.name, camera.interior, sigma)
    values = np.concatenate([camera.T_b_c.r, np.degrees(camera.T_b_c.opk)]).tolist()
    for key, value in zip(MOUNT, values, strict=True):
        if mounted:
            yield shown.Row(camera.name, *SHOWN[key], value, sigma.get(key, np.nan))


def _interior_rows(
    name: str, interior: Interior, sigma: Mapping[str, float]
) -> Iterator[shown.Row]:
    for key, value in zip(INTERIOR, interior.to_array().tolist(), strict=True):
        if key in sigma or value != 0:
            yield shown.Row(name, *SHOWN[key], value, sigma.get(key, np.nan))


def mountings(cameras: Sequence[Camera]) -> Pose:
    """Return the mountings T_b_c of cameras, one after the other."""
    return Pose(
        R=np.stack([camera.T_b_c.R for camera in cameras]),
        r=np.stack([camera.T_b_c.r for camera in cameras]),
    )


def xy_from_colrow(camera: Camera, colrow: Array) -> Array:
    """Convert pixel coordinates to image coordinates.

    Parameters
    ----------
    camera : Camera
    colrow : ndarray, shape (..., 2)
        col, row; (0, 0) is the centre of the top-left pixel.

    Returns
    -------
    xy : ndarray, shape (..., 2)
        mm from the middle of the image, x right, y up.
    """
    colrow = expected.numbers("colrow", colrow, (..., 2))
    centre = 0.5 * np.array([camera.width_px - 1, camera.height_px - 1])
    xy: Array = colrow - centre
    return np.multiply(xy, [camera.pixel_mm, -camera.pixel_mm], out=xy)


def colrow_from_xy(camera: Camera, xy: Array) -> Array:
    """Convert image coordinates (mm) to pixels, shape (..., 2); inverse of `xy_from_colrow`."""
    xy = expected.numbers("xy", xy, (..., 2))
    centre = 0.5 * np.array([camera.width_px - 1, camera.height_px - 1])
    return xy / np.array([camera.pixel_mm, -camera.pixel_mm]) + centre


def inside(camera: Camera, colrow: Array) -> np.ndarray:
    """Tell which pixel coordinates lie on the sensor or its outer edges, shape (...)."""
    return border_distance(camera, colrow) >= 0


def border_distance(camera: Camera, colrow: Array) -> Array:
    """Return the distances of pixels from the sensor's outer edges, px, shape (...).

    Negative outside; NaN where a pixel is.
    """
    upper = np.array([camera.width_px, camera.height_px]) - 0.5
    nearest: Array = np.minimum(colrow + 0.5, upper - colrow).min(axis=-1)
    return nearest


def distortion(interior: Interior, xy: Array) -> Array:
    """Compute the lens distortion at measured image points.

    Valid inside the format on which the coefficients were estimated.

    Parameters
    ----------
    interior : Interior
    xy : ndarray, shape (..., 2)
        Measured image coordinates, mm.

    Returns
    -------
    dxy : ndarray, shape (..., 2)
        mm; subtract it from the point reduced to the principal point.

    Notes
    -----
    Paper, eqs (7)-(11), after Brown [1]_.

    References
    ----------
    .. [1] D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37(8),
       1971.
    """
    xy = expected.numbers("xy", xy, (..., 2))
    return np.stack(_shifts(interior, *_reduced(interior, *_columns(xy))), axis=-1)


# Where the time goes, x and y are arrays of their own: in pairs they take twice as long.


def _columns(xy: Array) -> tuple[Array, Array]:
    """Return x and y of points (..., 2)."""
    return xy[..., 0], xy[..., 1]


def _shifts(interior: Interior, x: Array, y: Array) -> tuple[Array, Array]:
    """Return the distortion at reduced points in x and in y, eqs (7)-(11)."""
    r2 = x * x + y * y
    radial = r2 * (interior.k1 + r2 * (interior.k2 + r2 * interior.k3))
    dx = x * radial + interior.p1 * (r2 + 2 * x * x) + 2 * interior.p2 * x * y
    dy = y * radial + interior.p2 * (r2 + 2 * y * y) + 2 * interior.p1 * x * y
    return dx, dy


def _reduced(interior: Interior, x: Array, y: Array) -> tuple[Array, Array]:
    """Return x and y relative to the principal point, mm, after the affinity of x."""
    return x * (1 + interior.b1) + interior.b2 * y - interior.xp, y - interior.yp


def _unsheared(interior: Interior, x: Array, y: Array) -> tuple[Array, Array]:
    """Return the x and y from which the affinity of x makes these."""
    return x * (1 / (1 + interior.b1)) - interior.b2 / (1 + interior.b1) * y, y


def reduced(interior: Interior, xy: Array) -> Array:
    """Return points (..., 2) relative to the principal point, mm, after the affinity of x."""
    return np.stack(_reduced(interior, *_columns(xy)), axis=-1)


def correct(interior: Interior, xy: Array) -> Array:
    """Return the ideal image points of measured points: the left sides of eqs (1)-(2).

    Parameters
    ----------
    interior : Interior
    xy : ndarray, shape (..., 2)
        Measured, mm from the middle of the image.

    Returns
    -------
    ndarray, shape (..., 2)
        mm from the principal point, free of distortion.
    """
    x, y = _reduced(interior, *_columns(expected.numbers("xy", xy, (..., 2))))
    dx, dy = _shifts(interior, x, y)
    return np.stack([x - dx, y - dy], axis=-1)


def correct_jacobian(interior: Interior, xy: Array) -> Array:
    """Return d(correct) / d(f, xp, yp, k1, k2, k3, p1, p2, b1, b2).

    Parameters
    ----------
    interior : Interior
    xy : ndarray, shape (n, 2)
        Measured, mm.

    Returns
    -------
    ndarray, shape (n, 2, 10)
        Columns in the order of `INTERIOR`.
    """
    bar = reduced(interior, xy)
    x, y = bar[:, 0], bar[:, 1]
    r2 = x * x + y * y
    by_point = _by_reduced_point(interior, bar)
    out = np.zeros((len(xy), 2, len(INTERIOR)))
    out[:, :, 1:3] = -by_point
    for j in range(3):
        out[:, :, 3 + j] = -bar * (r2 ** (j + 1))[:, None]
    out[:, 0, 6], out[:, 1, 6] = -(r2 + 2 * x * x), -2 * x * y
    out[:, 0, 7], out[:, 1, 7] = -2 * x * y, -(r2 + 2 * y * y)
    out[:, :, 8:] = by_point[:, :, :1] * xy[:, None, :]
    return out


def correct_by_point(interior: Interior, xy: Array) -> Array:
    """Return d(correct) / d(measured point) at measured points (n, 2), mm; shape (n, 2, 2)."""
    by_reduced = _by_reduced_point(interior, reduced(interior, xy))
    out: Array = by_reduced * np.array([1 + interior.b1, 1.0])
    out[:, :, 1] += by_reduced[:, :, 0] * interior.b2
    return out


def _by_reduced_point(interior: Interior, bar: Array) -> Array:
    """Return d(correct) / d(reduced point), shape (n, 2, 2)."""
    out = np.empty((len(bar), 2, 2))
    out[:, 0, 0], out[:, 0, 1], out[:, 1, 1] = _slopes(interior, *_columns(bar))
    out[:, 1, 0] = out[:, 0, 1]
    return out


def _slopes(interior: Interior, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return d(correct) / d(reduced point): of x by x, of x by y, which is y by x, of y by y."""
    r2 = x * x + y * y
    k1, k2, k3, p1, p2 = (getattr(interior, name) for name in ("k1", "k2", "k3", "p1", "p2"))
    radial = r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))  # d(radial)/d(r^2), times two
    return (
        1 - radial - x * x * slope - 6 * p1 * x - 2 * p2 * y,
        -x * y * slope - 2 * p1 * y - 2 * p2 * x,
        1 - radial - y * y * slope - 6 * p2 * y - 2 * p1 * x,
    )


def distort(interior: Interior, ideal: Array, *, steps: int = 50) -> Array:
    """Return the measured image points of ideal points; inverse of `correct`.

    Newton's method. It is valid where the measured radius grows with the ideal radius; points
    for which no such solution is found are NaN.

    Parameters
    ----------
    interior : Interior
    ideal : ndarray, shape (n, 2)
        mm from the principal point.
    steps : int
        Largest number of iterations.

    Returns
    -------
    xy : ndarray, shape (n, 2)
        Measured, mm from the middle of the image.
    """
    ideal = expected.numbers("ideal", ideal, ("n", 2))
    expected.whole("steps", steps)
    u, v = (np.ascontiguousarray(column) for column in _columns(ideal))
    x, y = _unsheared(interior, u + interior.xp, v + interior.yp)
    misfit, valid = np.full(len(x), np.inf), np.zeros(len(x), dtype=bool)
    moving = np.arange(len(x))  # a point without a solution moves until the last step
    for _ in range(steps):
        (by_x, by_y), (dx, dy), valid[moving] = _newton(
            interior, x[moving], y[moving], u[moving], v[moving]
        )
        misfit[moving] = off = np.maximum(np.abs(dx), np.abs(dy))
        moves = off > 1e-13
        if not moves.any():
            break
        moving = moving[moves]
        x[moving] -= by_x[moves]
        y[moving] -= by_y[moves]
    # beyond the largest valid radius there are other roots, on the opposite side of the image
    xy = np.stack([x, y], axis=-1)
    return np.where(((misfit < 1e-9) & valid)[:, None], xy, np.nan)


def newton_step(interior: Interior, xy: Array, ideal: Array) -> tuple[Array, Array, Mask]:
    """Return Newton's step in `distort`, to be subtracted, the error before it, and the valid ones.

    Arrays as those of `distort`, `xy` as its result.
    """
    step, error, valid = _newton(interior, *_columns(xy), *_columns(ideal))
    return np.stack(step, axis=-1), np.stack(error, axis=-1), valid


def _newton(
    interior: Interior, x: Array, y: Array, u: Array, v: Array
) -> tuple[tuple[Array, Array], tuple[Array, Array], Mask]:
    """Return the same in columns: of measured points x and y, and ideal points u and v."""
    x, y = _reduced(interior, x, y)
    dx, dy = _shifts(interior, x, y)
    dx, dy = x - dx - u, y - dy - v
    J_xx, J_xy, J_yy = _slopes(interior, x, y)
    det = J_xx * J_yy - J_xy**2
    solvable = np.where(det == 0, np.nan, det)
    by_x, by_y = (J_yy * dx - J_xy * dy) / solvable, (J_xx * dy - J_xy * dx) / solvable
    return _unsheared(interior, by_x, by_y), (dx, dy), (det > 0) & (J_xx + J_yy > 0)
