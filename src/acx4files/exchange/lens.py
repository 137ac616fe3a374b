"""Lenses of other programs: each refitted over the whole format as a camera, and back.

No two programs have the same polynomials, so something is always left, and told. Ideal points
are x/z and y/z of a ray, x right, y down, z ahead of the camera, as most programs have them; the
library's own axes are turned by 180 degrees about x. Pixels are the library's: (0, 0) is the
centre of the top-left one. Nearly all models are the formula of `effects`: a row of the table at
the end says which of its values each parameter of a program is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from acx4files.exchange.coordinates import AHEAD
from acx4files.flight import settings
from acx4files.flight.problems import RANGES
from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose

FLIP = np.array([1.0, -1.0])
"""From the library's image axes to those with y down."""

NODES = (61, 46)
"""Points along and across the image through which a lens is fitted."""

NOTHING = 1e-13
"""Largest effect of rounding at the image's border, in focal lengths."""

STEEPEST = 1000.0
"""Tangent of an angle from the axis that no lens of a flight reaches."""

HELD_PX, WORTH = 0.1, 0.9
"""A program's focal lengths and principal point are held if that leaves at most this, px; others
must leave at most this share of it."""

WARNED_PX, WORST_PX = 0.3, 2.0
"""Largest distances to another program's lens above which a user is warned, and it is refused."""

MOVED_PX = 1e-4
"""Largest change of a principal point, or by scale at the border, that counts as none."""

STEPS = 100
"""Largest number of iterations of `inverse`."""

BROWN = ("k1", "k2", "u", "v", "k3")
"""OpenCV's first coefficients, by what they are in `effects`."""

Model = Callable[[Array], Array]
"""From points (n, 2) to points (n, 2)."""


@dataclass(frozen=True, kw_only=True)
class Left:
    """Differences between a lens and its refit, over the whole image.

    Attributes
    ----------
    largest_px, rms_px : float
    """

    largest_px: float
    rms_px: float

    @classmethod
    def of(cls, off: Array, scale: float = 1.0) -> Left:
        """Return the distances of points of differences, first all along and then all across."""
        apart = scale * np.hypot(*off.reshape(2, -1))
        return cls(largest_px=float(apart.max()), rms_px=float(np.sqrt(np.mean(apart**2))))

    def __str__(self) -> str:
        return f"{self.largest_px:.2g} px at most, {self.rms_px:.2g} px rms"


@dataclass(frozen=True, kw_only=True)
class Pinhole:
    """A camera without its distortion.

    Attributes
    ----------
    fx, fy : float
        Focal lengths, px.
    cx, cy : float
        Principal point, px.
    skew : float
        What is added to the column of y, px.

    Raises
    ------
    ValueError
        Where a focal length is not positive, or a number is not finite.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0

    def __post_init__(self) -> None:
        expected.positive("fx", self.fx)
        expected.positive("fy", self.fy)
        expected.finite("cx, cy, skew", np.array([self.cx, self.cy, self.skew]))

    def colrow(self, distorted: Array) -> Array:
        """Return the pixels of points (n, 2) in units of the focal length."""
        colrow = distorted * [self.fx, self.fy] + [self.cx, self.cy]
        colrow[:, 0] += self.skew * distorted[:, 1]
        return colrow

    def points(self, colrow: Array) -> Array:
        """Return the points of pixels (n, 2), in units of the focal length."""
        points = (colrow - [self.cx, self.cy]) / [self.fx, self.fy]
        points[:, 0] -= self.skew / self.fx * points[:, 1]
        return points


def nodes(width_px: int, height_px: int) -> Array:
    """Return pixels all over an image, its outer edges included, shape (n, 2)."""
    cols, rows = (
        np.linspace(-0.5, size - 0.5, n)
        for size, n in zip((width_px, height_px), NODES, strict=True)
    )
    return np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)


def camera_of(
    ideal: Model, hole: Pinhole, *, name: str, width_px: int, height_px: int, pixel_mm: float
) -> tuple[Camera, Left]:
    """Return the camera that is nearest to a lens, in the whole image.

    Focal lengths and principal point stay what they are; k1, k2, k3, p1, p2 are fitted. Where that
    leaves more than `HELD_PX`, f, xp, yp, b1, b2 are fitted, too, by distances in the image, as
    where a lens has terms that no camera has, or a focal length that is not its centre's scale.

    Parameters
    ----------
    ideal : callable
        From pixels, shape (n, 2), to ideal points, shape (n, 2); NaN where the lens has no ray.
    hole : Pinhole
    name, width_px, height_px, pixel_mm
        As `Camera` has them.

    Returns
    -------
    camera : Camera
    left : Left
        Distances of its rays from those of the lens, in the image.

    Raises
    ------
    ValueError
        Where a pixel has no ray ahead, or for values that no Camera has.
    """
    colrow = nodes(width_px, height_px)
    with np.errstate(over="ignore", invalid="ignore"):  # a ray beyond all numbers is none
        measured, rays = hole.points(colrow), ideal(colrow)
    lost = ~(np.abs(np.hstack([rays, measured])) < STEEPEST).all(axis=1)
    if lost.any():
        col, row = colrow[lost][0]
        msg = f"lens: expected a ray for every pixel, got none at col {col:.1f}, row {row:.1f}"
        raise ValueError(msg)
    hole, shorter, c, left = _fitted(measured, rays, ideal, colrow, hole)
    f, scale, shear = hole.fy * pixel_mm, hole.fy / hole.fx, hole.skew / hole.fx
    yp = ((height_px - 1) / 2 - hole.cy) * pixel_mm
    interior = Interior(
        f=f / shorter,
        xp=(hole.cx - (width_px - 1) / 2) * pixel_mm * scale + shear * yp,
        yp=yp,
        k1=-c[0] / f**2,
        k2=-c[1] / f**4,
        k3=-c[4] / f**6,
        p1=-c[3] / f,
        p2=c[2] / f,
        b1=scale - 1,
        b2=shear,
    )
    camera = Camera(
        name=name, width_px=width_px, height_px=height_px, pixel_mm=pixel_mm, interior=interior
    )
    return camera, left


def too_far(left: Left, allowed_px: float) -> tuple[str, str] | None:
    """Return problem and cure of a lens that differs too much from its refit, else None."""
    if left.largest_px <= allowed_px:
        return None
    return (
        f"its refit as a camera of a flight differs by {left}",
        f"must be at most {allowed_px:g} px; --allow {above(left.largest_px)} takes it so",
    )


def above(value: float) -> str:
    """Return a number of two digits that is not below a value."""
    text = f"{value:.2g}"
    return text if float(text) > value else f"{value * 1.05:.2g}"


def inverse(forward: Model, wanted: Array, start: Array) -> Array:
    """Return the points that a smooth map takes to wanted points, by Newton's method.

    Parameters
    ----------
    forward : callable
        The map, in units in which points are of about the size 1.
    wanted, start : ndarray, shape (n, 2)
        Points, and approximations of the result.

    Returns
    -------
    ndarray, shape (n, 2)
        NaN where no point maps to a wanted one, or the map turns back before it.
    """
    points, step = start.copy(), 1e-6
    with np.errstate(all="ignore"):  # what diverges ends as NaN
        for _ in range(STEPS):
            off = forward(points) - wanted
            if not np.any(np.abs(off) > 1e-14):
                break
            J = _slopes(forward, points, step)
            points = points - _solved(J, off)
        J = _slopes(forward, points, step)
        off = np.abs(forward(points) - wanted).max(axis=1, initial=0.0)
        good = (off < 1e-10) & (_det(J) > 0) & (J[:, 0, 0] + J[:, 1, 1] > 0)
    return np.where(good[:, None], points, np.nan)


def off_fisheye(points: Array) -> Array:
    """Return the ideal points of points whose length is the angle; NaN from 90 degrees on."""
    angle = np.hypot(*points.T)
    ahead = np.where(angle < np.pi / 2, angle, np.nan)
    scale: Array = np.divide(np.tan(ahead), angle, out=np.ones_like(angle), where=angle != 0)
    return points * scale[:, None]


def effects(points: Array, values: Mapping[str, float]) -> Array:
    """Return the distortion of points, by the formula that nearly all programs share.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Ideal points x, y, in any unit.
    values : mapping of str to float
        k1 to k6, d1 to d3, u and v, m1, m2, s0 to s3, in powers of the same unit; absent is zero.

    Returns
    -------
    ndarray, shape (n, 2)
        With r² = x² + y², R = (1 + k1 r² + k2 r⁴ + ...) / (1 + d1 r² + ...), M = 1 + m1 r² + m2 r⁴:
        x (R - 1) + (2 u x y + v (r² + 2 x²)) M + s0 r² + s1 r⁴ and
        y (R - 1) + (2 v x y + u (r² + 2 y²)) M + s2 r² + s3 r⁴; u, v are OpenCV's p1, p2.
    """
    x, y = points.T
    r2 = x * x + y * y
    radial = _power_series(r2, values, "k", 6)
    if any(role[0] == "d" for role in values):
        below = _power_series(r2, values, "d", 3)
        radial = (radial - below) / (1 + below)
    u, v = values.get("u", 0.0), values.get("v", 0.0)
    more = 1 + _power_series(r2, values, "m", 2)
    s0, s1, s2, s3 = (values.get(f"s{i}", 0.0) for i in range(4))
    dx = x * radial + (2 * u * x * y + v * (r2 + 2 * x * x)) * more + r2 * (s0 + s1 * r2)
    dy = y * radial + (2 * v * x * y + u * (r2 + 2 * y * y)) * more + r2 * (s2 + s3 * r2)
    return np.stack([dx, dy], axis=1)


def _power_series(r2: Array, values: Mapping[str, float], letter: str, most: int) -> Array:
    """Return c1 r² + c2 r⁴ + ... of the values of a letter."""
    powers = ((i, values.get(f"{letter}{i}", 0.0)) for i in range(1, most + 1))
    return sum((c * r2**i for i, c in powers if c), np.zeros_like(r2))


def brown(at: Array, off: Array, f_px: float) -> tuple[Array, Left]:
    """Return OpenCV's k1, k2, p1, p2, k3 by linear least squares, and the differences left.

    Parameters
    ----------
    at, off : ndarray, shape (n, 2)
        Points and what is to be added to them, in units of the focal length.
    f_px : float
        Focal length.
    """
    A = _terms(at)
    coefficients = _nearest(A, off.T.ravel())
    return coefficients, Left.of(A @ coefficients - off.T.ravel(), f_px)


def _fitted(
    measured: Array, rays: Array, ideal: Model, colrow: Array, hole: Pinhole
) -> tuple[Pinhole, float, Array, Left]:
    """Return the pinhole, its fy over the focal length, `brown`'s coefficients, differences left.

    Of a pinhole the others follow by linear least squares, so that its cx, cy, fx and skew alone
    are searched for.
    """
    coefficients, left = brown(measured, rays - measured, hole.fy)
    in_px = _pixels_by_ray(ideal, colrow, rays)
    if not np.isfinite(in_px).all():
        return hole, 1.0, coefficients, left
    b = np.einsum("nij,nj->in", in_px, rays).ravel()

    def linear(values: Array) -> tuple[Pinhole, Array, Array]:
        """Return the pinhole of values, its effects at the nodes and their coefficients, px."""
        cx, cy, stretch, shear = values.tolist()
        pinhole = Pinhole(
            fx=hole.fx * (1 + stretch),
            fy=hole.fy,
            cx=hole.cx + cx,
            cy=hole.cy + cy,
            skew=hole.skew + hole.fx * shear,
        )
        points = pinhole.points(colrow)
        A = np.column_stack([points.T.ravel(), _terms(points)]).reshape(2, len(rays), -1)
        A = np.einsum("nij,jnk->ink", in_px, A).reshape(2 * len(rays), -1)
        return pinhole, A, _nearest(A, b)

    _, A, _ = linear(np.zeros(4))
    held = Left.of(A @ [1.0, *coefficients] - b)
    if held.largest_px <= HELD_PX:
        return hole, 1.0, coefficients, held

    def off(values: Array) -> Array:
        _, A, free = linear(values)
        return np.asarray(A @ free - b)

    far = np.array([0.1 * hole.fx, 0.1 * hole.fy, 0.1, 0.1])
    a_pixel = np.array([1.0, 1.0, 1 / hole.fx, 1 / hole.fx])
    changes = least_squares(off, np.zeros(4), bounds=(-far, far), x_scale=a_pixel).x
    pinhole, A, free = linear(np.where(np.abs(changes) > MOVED_PX * a_pixel, changes, 0.0))
    freed = Left.of(A @ free - b)
    if freed.rms_px > WORTH * held.rms_px:
        return hole, 1.0, coefficients, held
    return pinhole, float(free[0]), free[1:] / free[0], freed


def _pixels_by_ray(ideal: Model, colrow: Array, rays: Array) -> Array:
    """Return d(pixel) / d(ideal point), shape (n, 2, 2), by differences towards the middle."""
    axes, inward = np.eye(2), np.where(colrow < colrow.mean(axis=0), 0.5, -0.5)
    with np.errstate(all="ignore"):  # the caller looks at what is not finite
        slopes = [(ideal(colrow + inward * e) - rays) / (inward @ e)[:, None] for e in axes]
        columns = [_solved(np.stack(slopes, axis=2), np.tile(e, (len(rays), 1))) for e in axes]
    return np.stack(columns, axis=2)


def _terms(points: Array) -> Array:
    """Return the effects of `brown`'s coefficients at points (n, 2), first along, then across."""
    return np.stack([effects(points, {role: 1.0}).T.ravel() for role in BROWN], axis=1)


def _nearest(A: Array, off: Array) -> Array:
    """Return the solution of A x = off by least squares; effects of rounding are zero."""
    size = np.abs(A).max(axis=0)  # so that high powers count as much as low ones
    effects = np.linalg.lstsq(A / size, off, rcond=None)[0]
    return np.asarray(np.where(np.abs(effects) > NOTHING, effects, 0.0) / size)


def _slopes(forward: Model, points: Array, step: float) -> Array:
    """Return the derivatives of a map by central differences, shape (n, 2, 2)."""
    columns = [(forward(points + d) - forward(points - d)) / (2 * step) for d in step * np.eye(2)]
    return np.stack(columns, axis=2)


def _det(J: Array) -> Array:
    return J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0]


def _solved(J: Array, off: Array) -> Array:
    """Return the solutions of J step = off; not finite where J is singular."""
    (a, b), (c, d) = J.transpose(1, 2, 0)
    u, v = off.T
    return np.stack([d * u - b * v, a * v - c * u], axis=1) / _det(J)[:, None]


# --- Models of other programs: one table of their parameters, one formula, and lenses by them
#
# In a fisheye the length of the ideal point is the angle from the axis, not its tangent. Points
# are in units of the focal length.


Wrong = Callable[[str, str], FlightError]
"""From the wrong value and the expected one to the error, which names the place."""

FISHEYE = ">"
"""Mark of a fisheye in a row of the table."""

ONE, TWO = "f cx cy", "fx fy cx cy"

NOMINAL_UM = 5.0
"""Pixel size where none is known: nothing in px depends on it, and f in mm is nominal."""

PITCH = "pixel_um"
NEEDED = ("width_px", "height_px", PITCH, "focal_mm")
"""Keys of a camera in flight.toml that are written if they are zero, too."""

Effects = Callable[[Array, Mapping[str, float]], Array]
"""From points, shape (n, 2), and values by their roles to the distortion, shape (n, 2)."""


@dataclass(frozen=True, kw_only=True)
class Formula:
    """A lens model of a program.

    Attributes
    ----------
    names : tuple of str
        Its parameters in the program's order.
    roles : tuple of str
        What each of them is in the formula.
    is_fisheye : bool
    effects : callable
        `effects`, or the function of a model that is none of this formula.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    is_fisheye: bool
    effects: Effects

    def distortion(self, values: Sequence[float]) -> Model:
        """Return the map from ideal points to measured ones, by values in the program's order."""
        by_role = dict(zip(self.roles, values, strict=True))
        return lambda points: points + self.effects(points, by_role)

    def lens(
        self, values: Sequence[float], hole: Pinhole, size: tuple[int, int], wrong: Wrong
    ) -> Lens:
        """Return the lens of values, a pinhole and an image's width and height."""
        return Lens(
            width_px=size[0],
            height_px=size[1],
            hole=hole,
            distortion=self.distortion(values),
            is_fisheye=self.is_fisheye,
            wrong=wrong,
        )


@dataclass(frozen=True, kw_only=True)
class Lens:
    """A camera as another program has it.

    Attributes
    ----------
    width_px, height_px : int
    hole : Pinhole
    distortion : callable
        From ideal points to measured ones, in units of the focal length, shape (n, 2).
    is_fisheye : bool
        Whether the length of the points that `distortion` takes is the angle from the axis.
    skew : tuple of float
        What is added to x of y, and to y of x, after the distortion, in units of the focal lengths.
    pixel_um : float
        0 where it is not known.
    mount : Pose
        T_b_c, in the library's axes.
    kind : str
        Which of the program's calibrations it is, where it has several: adjusted, initial, nominal.
    remark : str
        What is to be said of it; empty for nothing.
    wrong : callable
        The error that names where the lens was read.
    """

    width_px: int
    height_px: int
    hole: Pinhole
    distortion: Model
    wrong: Wrong
    is_fisheye: bool = False
    skew: tuple[float, float] = (0.0, 0.0)
    pixel_um: float = 0.0
    mount: Pose = AHEAD
    kind: str = ""
    remark: str = ""

    def ideal(self, colrow: Array) -> Array:
        """Return the ideal points of pixels, shape (n, 2); NaN where there is none."""
        points = np.linalg.solve(self._affine, self.hole.points(colrow).T).T
        points = inverse(self.distortion, points, points)
        return off_fisheye(points) if self.is_fisheye else points

    def colrow(self, ideal: Array) -> Array:
        """Return the pixels of ideal points, shape (n, 2)."""
        points = self.distortion(_on_fisheye(ideal) if self.is_fisheye else ideal)
        return self.hole.colrow(points @ self._affine.T)

    @property
    def _affine(self) -> Array:
        return np.array([[1.0, self.skew[0]], [self.skew[1], 1.0]])

    def nearest(self, name: str, pixel_mm: float) -> tuple[Camera, Left]:
        """Return the camera that is nearest over the whole image, as `camera_of`."""
        size = {"width_px": self.width_px, "height_px": self.height_px}
        return camera_of(self.ideal, self.hole, name=name, pixel_mm=pixel_mm, **size)

    def refitted(self, name: str, pixel_um: float | None = None) -> Refitted:
        """Return the camera that is nearest over the whole image.

        Parameters
        ----------
        name : str
            Of the camera.
        pixel_um : float, optional
            Pixel size, where the lens has none.

        Raises
        ------
        ValueError
            Where no camera of a flight is like it.
        """
        camera, left = self.nearest(name, (self.pixel_um or pixel_um or NOMINAL_UM) / 1000)
        camera = replace(camera, T_b_c=self.mount)
        return Refitted(camera=camera, table=_table(camera), f_px=self.hole.fy, left=left)


def _on_fisheye(ideal: Array) -> Array:
    """Return points (n, 2) whose length is the angle from the axis, of ideal points."""
    r = np.hypot(*ideal.T)
    scale: Array = np.divide(np.arctan(r), r, out=np.ones_like(r), where=r > 0)
    return ideal * scale[:, None]


@dataclass(frozen=True, kw_only=True)
class Refitted:
    """A lens of another program as a camera of a flight.

    Attributes
    ----------
    camera : Camera
    table : dict
        Of flight.toml.
    f_px : float
        Focal length of the program.
    left : Left
    """

    camera: Camera
    table: dict[str, Any]
    f_px: float
    left: Left

    @property
    def said(self) -> str:
        """Sentence on the lens and its difference from its refit."""
        name, size, f, f_program, _, _ = self.row
        focal = f if f == f_program else f"{f} (there {f_program})"
        return (
            f"lens of {name}: {size} px, f {focal} px; refitted as Brown's model it differs by "
            f"{self.left}"
        )

    @property
    def row(self) -> tuple[str, ...]:
        """Cells of a table: camera, size, f, f of the program, largest and rms difference, px."""
        camera = self.camera
        return (
            camera.name,
            f"{camera.width_px} x {camera.height_px}",
            f"{camera.interior.f / camera.pixel_mm:.2f}",
            f"{self.f_px:.2f}",
            f"{self.left.largest_px:.2g}",
            f"{self.left.rms_px:.2g}",
        )


def _table(camera: Camera) -> dict[str, Any]:
    """Return the table of flight.toml, with ten digits and without zeros."""
    values = settings.camera_table(camera)
    short = {  # a pixel size is printed from single precision by some programs
        key: float(f"{value:.{7 if key == PITCH else 10}g}") if isinstance(value, float) else value
        for key, value in values.items()
    }
    for key, value in short.items():
        if key in RANGES and value not in RANGES[key]:
            raise ValueError(f"{key} {value:g} {RANGES[key]}")
    return {key: value for key, value in short.items() if key in NEEDED or value}


def _field_of_view(points: Array, values: Mapping[str, float]) -> Array:
    omega, r = values["omega"], np.maximum(np.hypot(*points.T), 1e-9)[:, None]
    if abs(omega) < 1e-6:
        return np.zeros_like(points)
    scaled: Array = points * np.arctan(2 * r * np.tan(omega / 2)) / (r * omega)
    return scaled - points


def _division(points: Array, values: Mapping[str, float]) -> Array:
    """Return points at the smaller root of r_ideal (1 + k r²) = r, less the points."""
    inside = 1 - 4 * values["k"] * np.sum(points**2, axis=1, keepdims=True)
    return points * 2 / (1 + np.sqrt(np.where(inside >= 0, inside, np.nan))) - points


def _unified(points: Array, values: Mapping[str, float]) -> Array:
    alpha, r2 = values["alpha"], np.sum(points**2, axis=1, keepdims=True)
    moved: Array = points / (alpha * np.sqrt(values["beta"] * r2 + 1) + 1 - alpha)
    return moved - points


def _radial_then_others(points: Array, values: Mapping[str, float]) -> Array:
    """Return the effects of a model whose decentring and prism are of radially distorted points."""
    radial = {role: value for role, value in values.items() if role[0] == "k"}
    others = {role: value for role, value in values.items() if role[0] != "k"}
    moved = points + effects(points, radial)
    return moved - points + effects(moved, others)


def _dual(points: Array, values: Mapping[str, float]) -> Array:
    """Return the effects of a lens between a perspective one and a fisheye."""
    weight = values["transition"]
    between = weight * points + (1 - weight) * _on_fisheye(points)
    return between - points + effects(between, values)


def fisheye(
    polynomial: Sequence[float],
    affine: Sequence[float],
    centre: tuple[float, float],
    *,
    size: tuple[int, int],
    wrong: Wrong,
) -> Lens:
    """Return a fisheye as Pix4D documents it and Parrot writes it.

    With t = 2/pi a of the angle a from the axis, a point lies in its direction at the distance p0 +
    p1 t + p2 t² + ...; the matrix (c d; e f) takes it to pixels from the centre.

    Parameters
    ----------
    polynomial : sequence of float
        p0, which is 0, p1, which is positive, and others.
    affine : sequence of float
        c, d, e, f, px; c and f are positive.
    centre : tuple of float
        Principal point, the library's pixels.
    size : tuple of int
        Width and height, px.
    wrong : callable
        As `Lens` has it.
    """
    c, d, e, f = affine
    slope = 2 / np.pi * polynomial[1]
    others = [coefficient / polynomial[1] for coefficient in polynomial[2:]]

    def distorted(points: Array) -> Array:
        t = 2 / np.pi * np.hypot(*points.T)[:, None]
        factor = np.zeros_like(t)
        for p in reversed((1.0, *others)):  # without p0 the factor is smooth
            factor = p + t * factor
        return points * factor

    return Lens(
        width_px=size[0],
        height_px=size[1],
        hole=Pinhole(fx=c * slope, fy=f * slope, cx=centre[0], cy=centre[1]),
        distortion=distorted,
        is_fisheye=True,
        skew=(d / c, e / f),
        wrong=wrong,
    )


def _formula(row: str, effects: Effects = effects) -> Formula:
    """Return the model of a row: names, with `=role` where the role has another name."""
    cells = [cell.partition("=") for cell in row.split() if cell != FISHEYE]
    return Formula(
        names=tuple(name for name, _, _ in cells),
        roles=tuple(role or name for name, _, role in cells),
        is_fisheye=row.startswith(FISHEYE),
        effects=effects,
    )


COLMAP = {
    "SIMPLE_PINHOLE": _formula(ONE),
    "PINHOLE": _formula(TWO),
    "SIMPLE_RADIAL": _formula(f"{ONE} k=k1"),
    "RADIAL": _formula(f"{ONE} k1 k2"),
    "OPENCV": _formula(f"{TWO} k1 k2 p1=u p2=v"),
    "OPENCV_FISHEYE": _formula(f"> {TWO} k1 k2 k3 k4"),
    "FULL_OPENCV": _formula(f"{TWO} k1 k2 p1=u p2=v k3 k4=d1 k5=d2 k6=d3"),
    "FOV": _formula(f"{TWO} omega", _field_of_view),
    "SIMPLE_RADIAL_FISHEYE": _formula(f"> {ONE} k=k1"),
    "RADIAL_FISHEYE": _formula(f"> {ONE} k1 k2"),
    "THIN_PRISM_FISHEYE": _formula(f"> {TWO} k1 k2 p1=u p2=v k3 k4 sx1=s0 sy1=s2"),
    "RAD_TAN_THIN_PRISM_FISHEYE": _formula(
        f"> {TWO} k0=k1 k1=k2 k2=k3 k3=k4 k4=k5 k5=k6 p0=v p1=u s0 s1 s2 s3", _radial_then_others
    ),
    "SIMPLE_DIVISION": _formula(f"{ONE} k", _division),
    "DIVISION": _formula(f"{TWO} k", _division),
    "SIMPLE_FISHEYE": _formula(f"> {ONE}"),
    "FISHEYE": _formula(f"> {TWO}"),
    "EUCM": _formula(f"{TWO} alpha beta", _unified),
}
"""By their names in text files, in the order of their numbers in binary files, from 0."""

OPENSFM = {
    "perspective": _formula("k1 k2"),
    "simple_radial": _formula("k1"),
    "radial": _formula("k1 k2"),
    "brown": _formula("k1 k2 k3 p1=u p2=v"),
    "fisheye": _formula("> k1 k2"),
    "fisheye_opencv": _formula("> k1 k2 k3 k4"),
    "fisheye62": _formula("> k1 k2 k3 k4 k5 k6 p1=u p2=v"),
    "fisheye624": _formula("> k1 k2 k3 k4 k5 k6 p1=u p2=v s0 s1 s2 s3"),
    "dual": _formula("k1 k2 transition", _dual),
}
"""By `projection_type`: https://opensfm.org/docs/geometry.html."""

METASHAPE = {
    "frame": _formula("k1 k2 k3 k4 p1=v p2=u p3=m1 p4=m2"),
    "fisheye": _formula("> k1 k2 k3 k4 p1=v p2=u p3=m1 p4=m2"),
}
"""By the type of a calibration: the manual's appendix on camera models."""

OPF = _formula("R1=k1 R2=k2 R3=k3 T1=u T2=v")
"""Internals of type perspective; a fisheye is `fisheye`."""

OPENCV = _formula("k1 k2 p1=u p2=v k3")
