"""MicMac's XML of version 2 (MMVII): orientations, calibrations, measured and surveyed points.

Formulas as its source has them: a direction is projected, plane or as a fisheye, to a point p in
units of F; with r² = x² + y² the distortion is p (1 + K1 r² + K2 r⁴ + ...) + p1 (3x² + y², 2xy) +
p2 (2xy, x² + 3y²) + (b1 x + b2 y, 0); the pixel is PP + F p. Pixels count as in version 1. Axes are
x right, y down, z ahead; AxeI, AxeJ, AxeK are those of the camera in the world.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, RANGES, Range, quoted
from acx4lib.geometry.frames import Pose
from acx4tools.exchange import lens, tables
from acx4tools.exchange.axes import FLIP, UNKNOWN, is_rotation, nearest_rotation, stacked
from acx4tools.exchange.lens import Pinhole
from acx4tools.exchange.lens_models import Lens
from acx4tools.exchange.project import Control, Images, Measured, Project, Proof, in_crs
from acx4tools.exchange.safe import xml_tree
from acx4tools.exchange.safe.opened import Opened, Together, refusal
from acx4tools.exchange.safe.xml_tree import Element

ORIENTATION, CALIBRATION = "Ori-PerspCentral-", "Calib-PerspCentral-"
"""Beginnings of the names of files."""

KINDS = {"CameraPose": "NameImage", "InternalCalibration": "PerfectProj", "SetMesIm": "NameIm"}
KINDS |= {"SetGCP": "NameSet"}
"""Elements with the content of a file, and what each holds: early versions leave it out."""

PROJECTIONS = {
    "Stenope": None,
    "FE_EquiDist": lambda angle: angle,
    "FE_EquiSolid": lambda angle: 2 * np.sin(angle / 2),
    "StereroGraphik": lambda angle: 2 * np.tan(angle / 2),
}
"""Distances from the middle of the angles from the axis, by the names in files; None is plane."""

MOST = 100_000
"""Largest number of XML files of a folder."""

FOCAL = Range(1.0, 1e7, "must be a focal length in pixels")
COEFFICIENT = Range(-1e6, 1e6)
ENTRY = Range(-2.0, 2.0, "must be an entry of a rotation")

SKEW = 1e-6
"""Largest difference of a matrix from a rotation."""

ASSUMED = (
    "AxeI, AxeJ, AxeK are the camera's axes in the world, x right, y down, z ahead; the distortion "
    "takes ideal points to measured ones",
    "pixel 0, 0 is taken as the centre of the top-left one: no file says it",
)


@dataclass(kw_only=True)
class _Files:
    """The XML files of a folder by what they hold."""

    read: list[Opened] = field(default_factory=list)
    poses: dict[str, Element] = field(default_factory=dict)
    calibrations: dict[str, Element] = field(default_factory=dict)
    measures: list[Element] = field(default_factory=list)
    surveyed: list[Element] = field(default_factory=list)
    others: int = 0
    files: Together = field(default_factory=Together)

    def add(self, path: Path) -> None:
        """Read a file, and put what is in it where it belongs."""
        source = self.files.read(path)
        kind, content = _content(xml_tree.tree(source))
        if kind == "CameraPose":
            self.poses[_text(content.one("NameImage"))] = content
        elif kind == "InternalCalibration":
            self.calibrations[_text(content.one("Name"))] = content
        elif kind == "SetMesIm":
            self.measures.append(content)
        elif kind == "SetGCP":
            self.surveyed.append(content)
        else:
            self.others += 1
            return
        self.read.append(source)


def is_there(source: Path) -> bool:
    """Tell whether a path is of version 2: one of its files, or a folder around them."""
    if not source.is_dir():
        return source.name.startswith((ORIENTATION, CALIBRATION))
    wanted = (f"{ORIENTATION}*.xml", f"{CALIBRATION}*.xml")
    inside = (source.glob(pattern) for pattern in wanted)
    around = ("MMVII-PhgrProj", "Ori")
    return any(next(one, None) for one in inside) or any((source / n).is_dir() for n in around)


def project(source: Path, *, crs: str | None = None) -> Project:
    """Return the files of version 2.

    Parameters
    ----------
    source : Path
        A folder of orientations, its project's folder MMVII-PhgrProj or the one around that, or a
        calibration alone. Points are those in the folder, or of the project that it belongs to.
    crs : str, optional
        Of the flight and of MicMac's coordinates, which do not say it.

    Raises
    ------
    FlightError
        For files that are not MicMac's, other projections or terms of distortion that are not read.
    """
    found = _Files()
    for path in _paths(source):
        found.add(path)
    if not found.read:
        wanted = f"must hold {ORIENTATION}*.xml or {CALIBRATION}*.xml"
        raise refusal(str(source), 1, "file", "has no XML of MicMac", wanted)
    measured, control = _points(found)
    names = list(dict.fromkeys([*found.poses, *(name for _, name, _, _ in measured)]))
    images = Images(
        names=tuple(names),
        cameras=tuple(_camera_of(found, name) for name in names),
        exposures=tuple(names),
        T_w_c=stacked([_pose(found.poses[n]) if n in found.poses else UNKNOWN for n in names]),
    )
    rays = _rays(names, measured, control)
    tables.require_all_names(
        {"image": images.names, "camera": images.cameras, "point": rays.points},
        found.read[0].wrong,
    )
    return Project(
        source="MicMac, version 2",
        sources=found.read,
        lenses={_camera(name): _lens(one) for name, one in found.calibrations.items()},
        images=images,
        measured=rays,
        proofs=(Proof(whose="surveyed points", measured=rays),),
        control=control,
        settings={} if crs is None else {"crs": crs, "heights": "ellipsoidal"},
        in_grid=in_crs(source, crs),
        lost={"other XML files": found.others},
        assumed=(
            *ASSUMED,
            *of_control(crs, control, "Sigma2 of a surveyed point has its variances in m²"),
        ),
    )


def of_control(crs: str | None, control: Control, precision: str) -> tuple[str, ...]:
    """Return what is assumed of surveyed points, in both versions."""
    if not control.names:
        return ()
    where = "the flight's CRS" if crs is None else crs
    return (
        f"MicMac's coordinates are east, north, height in {where}: its files do not say it",
        precision,
    )


# files


def _paths(source: Path) -> Iterable[Path]:
    """Return the XML files of one folder of orientations, and of the points of its project."""
    if not source.is_dir():
        return [source]
    oriented = sorted({path.parent for path in source.rglob(f"{ORIENTATION}*.xml")})
    if len(oriented) > 1:
        names = ", ".join(str(one.relative_to(source)) for one in oriented)
        raise refusal(
            str(source), 1, "folder", f"has orientations in {names}", "give one of these folders"
        )
    folder = oriented[0] if oriented else source
    paths = sorted(folder.glob("*.xml"))
    if folder.parent.name == "Ori":
        rest = (one for one in sorted(folder.parent.parent.iterdir()) if one.name != "Ori")
        paths += [path for one in rest for path in sorted(one.rglob("Mes*.xml"))]
    if len(paths) > MOST:
        found = f"has {len(paths)} XML files"
        raise refusal(str(source), 1, "folder", found, f"must have at most {MOST}")
    return paths


def _content(root: Element) -> tuple[str, Element]:
    """Return what kind of file this is, and the element with its content."""
    data = root.maybe("Data") or root
    for kind, inside in KINDS.items():
        within = data.maybe(kind) or data
        if within.maybe(inside) is not None:
            return kind, within
    return "", root


def _text(element: Element) -> str:
    """Return a text without the quotation marks that version 2 writes around it."""
    text = element.text
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


# images


def _camera(name: str) -> str:
    return name.removeprefix(CALIBRATION)


def _camera_of(found: _Files, image: str) -> str:
    """Return the camera of an image: that of its orientation, or the only one."""
    pose = found.poses.get(image)
    if pose is None:
        return next(iter(map(_camera, found.calibrations)), "CAM")
    element = pose.one("NameInternalCalib")
    name = _text(element)
    if name not in found.calibrations:
        raise element.wrong(f"{quoted(name)} is not there", "must be beside the orientations")
    return _camera(name)


def _pose(element: Element) -> Pose:
    """Return T_w_c of an orientation in the library's camera axes."""
    matrix = element.one("RotMatrix")
    axes = [_three(matrix.one(f"Axe{axis}"), ENTRY) for axis in "IJK"]
    R_w_v = np.stack(axes, axis=1)
    if not is_rotation(R_w_v, SKEW):
        raise matrix.wrong("AxeI, AxeJ, AxeK are no rotation", "must be the columns of one")
    return Pose(R=nearest_rotation(R_w_v) @ FLIP, r=_three(element.one("Center"), METRES))


def _three(element: Element, allowed: Range) -> Array:
    return _within(element, element.numbers(3), allowed)


def _within(element: Element, values: Array, allowed: Range) -> Array:
    if not all(value in allowed for value in values):
        raise element.wrong(quoted(element.text), str(allowed))
    return values


# points

Place = tuple[Element, str, str, Array]
"""The element, image, point and pixel of a measurement."""


def _points(found: _Files) -> tuple[list[Place], Control]:
    """Return all measurements, and surveyed points."""
    measured, seen = list(_measured(found.measures)), set[tuple[str, str]]()
    for element, image, name, _ in measured:
        if (image, name) in seen:
            raise element.wrong(f"{quoted(name)} stands twice in {quoted(image)}", "must once")
        seen.add((image, name))
    surveyed: dict[str, tuple[Array, Array]] = {}
    for one in found.surveyed:
        for point in one.each("Measures", "el"):
            name = _text(point.one("Name"))
            if name in surveyed:
                raise point.wrong(f"point {quoted(name)} stands twice", "must stand once")
            surveyed[name] = (_three(point.one("Pt"), METRES), _sigma(point))
    xyz, sigma = (np.array([one[k] for one in surveyed.values()]).reshape(-1, 3) for k in (0, 1))
    return measured, Control(names=tuple(surveyed), enh=xyz, sigma=sigma)


def _measured(sets: Iterable[Element]) -> Iterator[Place]:
    for one in sets:
        image = _text(one.one("NameIm"))
        for point in one.each("Measures", "el"):
            place = point.one("Pt")
            yield point, image, _text(point.one("Name")), _within(place, place.numbers(2), METRES)


def _sigma(point: Element) -> Array:
    """Return standard deviations of a surveyed point, m; NaN where the file has none."""
    element = next((one for one in point.below if one.tag.endswith("Sigma2")), None)
    if element is None:
        return np.full(3, np.nan)
    variances = element.numbers(6)[[0, 3, 5]]
    if (variances < 0).any():
        raise element.wrong(quoted(element.text), "must have variances xx xy xz yy yz zz")
    return np.sqrt(variances)


def _rays(names: list[str], measured: list[Place], control: Control) -> Measured:
    row_of = {image: row for row, image in enumerate(names)}
    known = dict(zip(control.names, control.enh, strict=True))
    points, point_idx = tables.first_use([name for _, _, name, _ in measured])
    places = [known.get(name, np.full(3, np.nan)) for name in points]
    return Measured(
        points=tuple(points),
        x_w=np.array(places).reshape(-1, 3),
        image_idx=np.array([row_of[image] for _, image, _, _ in measured], dtype=int),
        point_idx=point_idx,
        colrow=np.array([at for _, _, _, at in measured]).reshape(-1, 2),
    )


# lenses


def _lens(root: Element) -> Lens:
    """Return the camera of a calibration."""
    kind = _text(root.one("Projection"))
    if kind not in PROJECTIONS:
        expected = f"must be one of {', '.join(PROJECTIONS)}"
        raise root.one("Projection").wrong(quoted(kind), expected)
    size = root.one("PixelFrame", "NbPix")
    width, height = (int(one) for one in _within(size, size.numbers(2), RANGES["width_px"]))
    f = root.one("PerfectProj", "F").number(allowed=FOCAL)
    cx, cy = root.one("PerfectProj", "PP").numbers(2).tolist()
    values = _coefficients(root)
    b1, b2 = values.pop("b1", 0.0), values.pop("b2", 0.0)
    plain, outward = Pinhole(fx=f, fy=f, cx=cx, cy=cy), PROJECTIONS[kind]
    hole = replace(plain, fx=f * (1 + b1), skew=f * b2)

    def distorted(points: Array) -> Array:
        at = points if outward is None else _moved(points, outward(np.hypot(*points.T)))
        moved = at + lens.effects(at, values)
        moved[:, 0] += at @ [b1, b2]
        return hole.points(plain.colrow(moved))

    return Lens(
        width_px=width,
        height_px=height,
        hole=hole,
        distortion=distorted,
        is_fisheye=outward is not None,
        wrong=root.wrong,
    )


def _moved(points: Array, distance: Array) -> Array:
    """Return points (n, 2) in their directions at other distances from the middle."""
    angle = np.hypot(*points.T)
    scale = np.divide(distance, angle, out=np.ones_like(angle), where=angle > 0)
    moved: Array = points * scale[:, None]
    return moved


def _coefficients(root: Element) -> dict[str, float]:
    """Return the terms of the distortion by what they are in `lens.effects`, with b1 and b2."""
    found: dict[str, float] = {}
    mode = root.maybe("Auxiliary", "IsFraserMode")
    known = {"p1": "v", "p2": "u", "b1": "b1", "b2": "b2"}
    if mode is not None and mode.text == "0":  # the terms of degree 1 are others
        known = {"p1": "v", "p2": "u"}
    for element in (one for part in root.one("Distorsion").below for one in part.below):
        value = element.number(allowed=COEFFICIENT)
        role = known.get(element.tag)
        if radial := re.fullmatch(r"K([1-6])", element.tag):
            role = f"k{radial[1]}"
        if role is None and value:
            expected = "must be 0; K1 to K6, p1, p2, b1, b2 are read"
            raise element.wrong(f"{value:g}", expected)
        if role is not None:
            found[role] = value
    return found
