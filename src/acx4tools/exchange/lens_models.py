"""Lens models of other programs: one table of their parameters, one formula, and lenses by them.

All models but a few are the formula of `lens.effects`: a row of the table says which of its values
each parameter is. In a fisheye the length of the ideal point is the angle from the axis, not its
tangent. Points have x right and y down, in units of the focal length; pixels are the library's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight import settings
from acx4lib.flight.problems import RANGES
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose
from acx4tools.exchange import lens
from acx4tools.exchange.axes import AHEAD

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
class _Formula:
    """A lens model of a program.

    Attributes
    ----------
    names : tuple of str
        Its parameters in the program's order.
    roles : tuple of str
        What each of them is in the formula.
    is_fisheye : bool
    effects : callable
        `lens.effects`, or the function of a model that is none of this formula.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    is_fisheye: bool
    effects: Effects

    def distortion(self, values: Sequence[float]) -> lens.Model:
        """Return the map from ideal points to measured ones, by values in the program's order."""
        by_role = dict(zip(self.roles, values, strict=True))
        return lambda points: points + self.effects(points, by_role)


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
    hole: lens.Pinhole
    distortion: lens.Model
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
        points = lens.inverse(self.distortion, points, points)
        return lens.off_fisheye(points) if self.is_fisheye else points

    def colrow(self, ideal: Array) -> Array:
        """Return the pixels of ideal points, shape (n, 2)."""
        points = self.distortion(_on_fisheye(ideal) if self.is_fisheye else ideal)
        return self.hole.colrow(points @ self._affine.T)

    @property
    def _affine(self) -> Array:
        return np.array([[1.0, self.skew[0]], [self.skew[1], 1.0]])

    def nearest(self, name: str, pixel_mm: float) -> tuple[Camera, lens.Left]:
        """Return the camera that is nearest over the whole image, and its distances: `camera_of`.

        Parameters
        ----------
        name : str
            Of the camera.
        pixel_mm : float

        Raises
        ------
        ValueError
            Where a pixel has no ray ahead, or for values that no Camera has.
        """
        return lens.camera_of(
            self.ideal,
            self.hole,
            name=name,
            width_px=self.width_px,
            height_px=self.height_px,
            pixel_mm=pixel_mm,
        )

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
    left: lens.Left

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
    moved = points + lens.effects(points, radial)
    return moved - points + lens.effects(moved, others)


def _dual(points: Array, values: Mapping[str, float]) -> Array:
    """Return the effects of a lens between a perspective one and a fisheye."""
    weight = values["transition"]
    between = weight * points + (1 - weight) * _on_fisheye(points)
    return between - points + lens.effects(between, values)


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
        hole=lens.Pinhole(fx=c * slope, fy=f * slope, cx=centre[0], cy=centre[1]),
        distortion=distorted,
        is_fisheye=True,
        skew=(d / c, e / f),
        wrong=wrong,
    )


def _formula(row: str, effects: Effects = lens.effects) -> _Formula:
    """Return the model of a row: names, with `=role` where the role has another name."""
    cells = [cell.partition("=") for cell in row.split() if cell != FISHEYE]
    return _Formula(
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

BUNDLER = _formula("k1 k2")
OPENCV = _formula("k1 k2 p1=u p2=v k3")
