"""MicMac's XML of version 1: orientations, calibrations, points. Version 2 is `mmvii`.

Pixels count from the centre of the top-left one; cameras have x right, y down, z ahead. Focal
length, principal point and distortion are in pixels. With `eConvApero_DistM2C` the distortion takes
the ideal pixel to the measured one; the points under `Verif` in MicMac's own orientations confirm
this to 1e-9 px.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, RANGES, Range, quoted
from acx4lib.geometry.frames import Pose
from acx4tools.exchange import lens, tables
from acx4tools.exchange.axes import FLIP, UNKNOWN, is_rotation, stacked
from acx4tools.exchange.flight_folder import Brought
from acx4tools.exchange.lens import WORST_PX, Model, Pinhole
from acx4tools.exchange.lens_models import Lens
from acx4tools.exchange.programs import mmvii
from acx4tools.exchange.programs.mmvii import PROJECTIONS
from acx4tools.exchange.project import Control, Images, Measured, Project, Proof, flight_of, in_crs
from acx4tools.exchange.safe import opened, xml_tree
from acx4tools.exchange.safe.opened import Opened, Together
from acx4tools.exchange.safe.xml_tree import Element

KNOWN = "eConvApero_DistM2C"
"""The convention of all files that MicMac writes itself."""

MODELS = ("ModNoDist", "ModRad", "ModPhgrStd")
"""Distortion models that are read; others are refused by name."""

MOST = 100_000
"""Largest number of XML files of a folder."""

FOCAL = Range(1.0, 1e7, "must be a focal length in pixels")

COEFFICIENT = Range(-0.5, 0.5)
"""P1 and P2 per pixel, b1 and b2 without a unit."""

ENTRY = Range(-2.0, 2.0, "must be an entry of a rotation")

SKEW = 1e-6
"""Largest difference of a matrix from a rotation."""

AROUND = ("ExportAPERO", "Global")
"""Outermost elements that hold others."""

CAMERA = "CAM"
"""Name of the camera where no orientation names a calibration."""

SHOWN = 5
"""Number of names that a sentence has at most."""

ASSUMED = (
    f"{KNOWN}: the matrix takes camera to object axes, x right, y down, z ahead; the "
    "distortion takes ideal pixels to measured ones",
    "pixel 0, 0 is taken as the centre of the top-left one: no file says it",
)

Content = tuple[Any, ...]
"""Text of an element, and tags and contents of those below it."""

Surveyed = dict[str, tuple[Array, Array]]
"""Coordinates and sigma of surveyed points, sigma NaN where it is not given."""


def read(
    source: Path,
    *,
    orientations: str = "initial",
    block: str | None = None,
    crs: str | None = None,
    pixel_um: float | None = None,
    allow: float = WORST_PX,
) -> Brought:
    """Read a folder as a part of a flight; options as those of `project` and `flight_of`.

    The files have no orientations but adjusted ones: "initial" is no trajectory.
    """
    found = project(source, crs=crs)
    return flight_of(found, orientations=orientations, block=block, pixel_um=pixel_um, allow=allow)


def project(source: Path, *, crs: str | None = None) -> Project:
    """Return MicMac's files, of version 1, or of version 2 where such are there.

    Parameters
    ----------
    source : Path
        A folder with one Ori-*, or an Ori-* in it, measures and surveyed points in XML; or one
        such file.
    crs : str, optional
        Of the flight and of MicMac's coordinates, which do not say it.

    Raises
    ------
    FlightError
        For files that are not MicMac's, other conventions or other distortion models.
    """
    if mmvii.is_there(source):
        return mmvii.project(source, crs=crs)
    found = _files_of(source)
    lenses = {_camera(name): _lens(root) for name, root in found.calibrations.items()}
    images, measured, surveyed = _images(found)
    tables.require_all_names(
        {
            "image": images.names,
            "camera": images.cameras,
            "exposure": images.exposures,
            "point": measured.points,
        },
        found.read[0].wrong,
    )
    control = _control(surveyed)
    unknown = [name for name in measured.points if name not in surveyed] if surveyed else []
    seen = set(measured.points)
    unmeasured = [name for name in surveyed if name not in seen]
    ties = (
        "measured points are tie points, since their coordinates are not there: "
        f"{', '.join(unknown[:SHOWN])}"
    )
    return Project(
        source="MicMac",
        sources=found.read,
        lenses=lenses,
        images=images,
        measured=measured,
        proofs=(
            Proof(whose="surveyed points", measured=measured),
            Proof(whose="points that MicMac projected itself (Verif)", measured=_own(found)),
        ),
        control=control,
        settings={} if crs is None else {"crs": crs, "heights": "ellipsoidal"},
        in_grid=in_crs(source, crs),
        lost={
            "other XML files": found.others,
            ties: len(unknown),
            f"surveyed points are measured in no image: {', '.join(unmeasured[:SHOWN])}": len(
                unmeasured
            ),
        },
        assumed=(
            *ASSUMED,
            *mmvii.of_control(
                crs, control, "Incertitude of a surveyed point is its standard deviation in metres"
            ),
        ),
    )


def _images(found: _Files) -> tuple[Images, Measured, Surveyed]:
    """Return images with their measurements, and surveyed points."""
    measured, surveyed = list(_measurements(found.measures)), Surveyed()
    for element, name, x_w, sigma in _surveyed(found.surveyed):
        if name in surveyed:
            raise element.wrong(f"point {quoted(name)} stands twice", "must stand once")
        surveyed[name] = (x_w, sigma)
    seen: set[tuple[str, str]] = set()
    for element, image, name, _ in measured:
        if (image, name) in seen:
            raise element.wrong(f"{quoted(name)} stands twice in {quoted(image)}", "must once")
        seen.add((image, name))
    names = list(dict.fromkeys([*found.orientations, *(image for _, image, _, _ in measured)]))
    row_of = {image: row for row, image in enumerate(names)}
    oriented = found.orientations
    images = Images(
        names=tuple(names),
        cameras=tuple(_camera_of(found, image) for image in names),
        exposures=tuple(names),
        T_w_c=stacked([_pose(oriented[n]) if n in oriented else UNKNOWN for n in names]),
    )
    points, point_idx = tables.first_use([name for _, _, name, _ in measured])
    places = [surveyed[name][0] if name in surveyed else np.full(3, np.nan) for name in points]
    rays = Measured(
        points=tuple(points),
        x_w=np.array(places).reshape(-1, 3),
        image_idx=np.array([row_of[image] for _, image, _, _ in measured], dtype=int),
        point_idx=point_idx,
        colrow=np.array([at for _, _, _, at in measured]).reshape(-1, 2),
    )
    return images, rays, surveyed


def _control(surveyed: Surveyed) -> Control:
    xyz, sigma = (np.array([one[k] for one in surveyed.values()]).reshape(-1, 3) for k in (0, 1))
    return Control(names=tuple(surveyed), enh=xyz, sigma=sigma)


def _own(found: _Files) -> Measured:
    """Return what MicMac itself computed of images, each point once."""
    own = [_own_points(one) for one in found.orientations.values()]
    n = sum(len(colrow) for _, colrow in own)
    return Measured(
        points=tuple(map(str, range(n))),
        x_w=np.concatenate([x_w for x_w, _ in own]) if own else np.zeros((0, 3)),
        image_idx=np.repeat(np.arange(len(own)), [len(colrow) for _, colrow in own]),
        point_idx=np.arange(n),
        colrow=np.concatenate([colrow for _, colrow in own]) if own else np.zeros((0, 2)),
    )


def _camera(file: str) -> str:
    return file.removesuffix(".xml").removeprefix("AutoCal_")


def _camera_of(found: _Files, image: str) -> str:
    """Return the camera of an image: that of its orientation, or the only one."""
    orientation = found.orientations.get(image)
    if orientation is None:
        return next(iter(map(_camera, found.calibrations)), CAMERA)
    if image in found.interior:
        return _camera(found.interior[image])
    element = orientation.one("FileInterne")
    name = element.text.replace("\\", "/").rpartition("/")[2]
    if name not in found.calibrations:
        raise element.wrong(f"{quoted(name)} is not there", "must be beside the orientations")
    return _camera(name)


# files


@dataclass(kw_only=True)
class _Files:
    """The XML files of a folder and of the folders Ori-* in it, by what they hold.

    `orientations` are by image, `calibrations` by the name of the file, `interior` names that of
    each image whose orientation holds it itself, `others` counts files of another content.
    """

    read: list[Opened] = field(default_factory=list)
    orientations: dict[str, Element] = field(default_factory=dict)
    calibrations: dict[str, Element] = field(default_factory=dict)
    interior: dict[str, str] = field(default_factory=dict)
    measures: list[Element] = field(default_factory=list)
    surveyed: list[Element] = field(default_factory=list)
    others: int = 0
    files: Together = field(default_factory=Together)
    _by_content: dict[Content, str] = field(default_factory=dict)

    def add(self, path: Path) -> None:
        """Read a file, and put what is in it where it belongs."""
        source = self.files.read(path)
        root = xml_tree.tree(source)
        known = [
            self._is_known(one, path) for one in (root.below if root.tag in AROUND else [root])
        ]
        if any(known):
            self.read.append(source)
        else:
            self.others += 1

    def _is_known(self, content: Element, path: Path) -> bool:
        """Put an element where it belongs; tell whether it belongs anywhere."""
        image = re.fullmatch(r"Orientation-(.+)\.xml", path.name)
        if content.tag == "OrientationConique" and image:
            self.orientations[image[1]] = content
            if (interior := content.maybe("Interne")) is not None:
                self.interior[image[1]] = self._named(interior)
        elif content.tag == "CalibrationInternConique" and path.name not in self.calibrations:
            self.calibrations[path.name] = content
            self._by_content.setdefault(_content(content), path.name)
        elif content.tag == "SetOfMesureAppuisFlottants":
            self.measures.append(content)
        elif content.tag == "DicoAppuisFlottant":
            self.surveyed.append(content)
        else:
            return False
        return True

    def _named(self, interior: Element) -> str:
        """Return the name of a calibration that an orientation holds; equal ones are one."""
        new = f"CAM{len(self.calibrations) + 1}.xml"
        name = self._by_content.setdefault(_content(interior), new)
        self.calibrations.setdefault(name, interior)
        return name


def _content(element: Element) -> Content:
    return element.text, tuple((one.tag, _content(one)) for one in element.below)


def _files_of(source: Path) -> _Files:
    """Return MicMac's files at a path: a folder, or one file."""
    found = _Files()
    for path in _paths(source):
        found.add(path)
    if not found.read:
        wanted = "must hold Ori-*/Orientation-*.xml, measures or surveyed points of MicMac"
        raise opened.refusal(str(source), 1, "file", "has no XML of MicMac", wanted)
    return found


def _paths(source: Path) -> Iterable[Path]:
    """Return the XML files of a folder and of its Ori-*, or of an Ori-* and the folder around."""
    if not source.is_dir():
        return [source]
    inside = [one for one in sorted(source.glob("Ori-*")) if one.is_dir()]
    oriented = [one for one in inside if next(one.glob("Orientation-*.xml"), None)]
    if len(oriented) > 1:
        names = ", ".join(one.name for one in oriented)
        found = f"has orientations in {names}"
        raise opened.refusal(str(source), 1, "folder", found, "give one of these folders")
    around = [source.parent] if source.name.startswith("Ori-") else []
    folders = [source, *oriented, *(one for one in inside if one not in oriented), *around]
    paths = [path for folder in folders for path in sorted(folder.glob("*.xml"))]
    if len(paths) > MOST:
        found = f"has {len(paths)} XML files"
        raise opened.refusal(str(source), 1, "folder", found, f"must have at most {MOST}")
    return paths


def _pose(orientation: Element) -> Pose:
    """Return T_w_c of an ``OrientationConique`` in the library's camera axes."""
    for place in (("Externe", "KnownConv"), ("ConvOri", "KnownConv")):
        known = orientation.maybe(*place)
        if known is not None and known.text != KNOWN:
            raise known.wrong(quoted(known.text), f"must be {KNOWN}")
    if (turned := orientation.maybe("OrIntImaM2C")) is not None:
        _require_plain(turned)
    kind = orientation.maybe("TypeProj")
    if kind is not None and kind.text != "eProjStenope":
        raise kind.wrong(quoted(kind.text), "must be eProjStenope, a central projection")
    rotation = orientation.one("Externe", "ParamRotation", "CodageMatr")
    R_w_v = np.stack([_three(rotation.one(f"L{k}"), ENTRY) for k in (1, 2, 3)])
    if not is_rotation(R_w_v, SKEW):
        raise rotation.wrong("L1, L2, L3 are no rotation", "must be the rows of one")
    return Pose(R=R_w_v @ FLIP, r=_three(orientation.one("Externe", "Centre"), METRES))


def _three(element: Element, allowed: Range) -> Array:
    return _within(element, element.numbers(3), allowed)


def _pixel(element: Element) -> Array:
    return _within(element, element.numbers(2), METRES)


def _within(element: Element, values: Array, allowed: Range) -> Array:
    if not all(value in allowed for value in values):
        raise element.wrong(quoted(element.text), str(allowed))
    return values


def _own_points(orientation: Element) -> tuple[Array, Array]:
    """Return what MicMac itself computed of an image: object points (n, 3), and pixels (n, 2)."""
    pairs = [
        (_three(one.one("Ter"), METRES), _pixel(one.one("Im")))
        for one in orientation.each("Verif", "Appuis")
    ]
    x_w, colrow = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
    return x_w.reshape(-1, 3), colrow.reshape(-1, 2)


def _measurements(sets: Iterable[Element]) -> Iterator[tuple[Element, str, str, Array]]:
    """Yield the element, image, point and pixel of every measurement."""
    for one in sets:
        for image in one.each("MesureAppuiFlottant1Im"):
            name = image.one("NameIm").text
            for point in image.each("OneMesureAF1I"):
                yield point, name, point.one("NamePt").text, _pixel(point.one("PtIm"))


def _surveyed(dictionaries: Iterable[Element]) -> Iterator[tuple[Element, str, Array, Array]]:
    """Yield the element, name, coordinates and sigma of every surveyed point."""
    for one in dictionaries:
        for point in one.each("OneAppuisDAF"):
            sigma = point.maybe("Incertitude")
            values = np.full(3, np.nan) if sigma is None else _three(sigma, METRES)
            yield point, point.one("NamePt").text, _three(point.one("Pt"), METRES), values


# lenses


def _lens(root: Element) -> Lens:
    """Return the camera of an AutoCal*.xml."""
    known = root.maybe("KnownConv")
    if known is not None and known.text != KNOWN:
        raise known.wrong(quoted(known.text), f"must be {KNOWN}")
    for tag in ("OrIntGlob", "OrIntImaM2C"):
        if (extra := root.maybe(tag)) is not None:
            _require_plain(extra)
    cx, cy = root.one("PP").numbers(2).tolist()
    width, height = (_size(root, k) for k in (0, 1))
    fx, fy = _focal(root)
    hole = Pinhole(fx=fx, fy=fy, cx=cx, cy=cy)
    stretched = _stretched(hole, root)
    wide = [one for one in root.each("CalibDistortion", "ModUnif") if _is_fisheye(one)]
    if wide:
        return _fisheye(root, wide[0], hole, (width, height))
    shifts = [_shift(one) for one in root.each("CalibDistortion")]

    def distorted(ideal: Array) -> Array:
        colrow = hole.colrow(ideal)
        for shift in shifts:
            colrow = colrow + shift(colrow)
        return stretched.points(colrow)

    return Lens(
        width_px=width, height_px=height, hole=stretched, distortion=distorted, wrong=root.wrong
    )


def _is_fisheye(model: Element) -> bool:
    kind = model.maybe("TypeModele")
    return kind is not None and kind.text in _MODELS


def _fisheye(root: Element, model: Element, hole: Pinhole, size: tuple[int, int]) -> Lens:
    if len(list(root.each("CalibDistortion"))) != 1:
        raise model.wrong("is one of several distortions", "must be the only one")
    measured = _measured(model)
    return Lens(
        width_px=size[0],
        height_px=size[1],
        hole=hole,
        distortion=lambda points: hole.points(measured(hole.colrow(lens.off_fisheye(points)))),
        is_fisheye=True,
        wrong=root.wrong,
    )


def _stretched(hole: Pinhole, root: Element) -> Pinhole:
    """Return a pinhole with the b1 and b2 of Fraser's model in it."""
    for model in root.everywhere("ModPhgrStd"):
        b1, b2 = _optional(model, "b1"), _optional(model, "b2")
        x, y = np.array([hole.cx, hole.cy]) - model.one("RadialePart").one("CDist").numbers(2)
        moved = float(hole.cx + b1 * x + b2 * y)
        hole = replace(hole, fx=hole.fx * (1 + b1), cx=moved, skew=hole.fy * b2)
    return hole


def _size(root: Element, k: int) -> int:
    element = root.one("SzIm")
    value = float(element.numbers(2)[k])
    if value not in RANGES["width_px"]:
        raise element.wrong(quoted(element.text), str(RANGES["width_px"]))
    return int(value)


def _focal(root: Element) -> tuple[float, float]:
    element = root.one("F")
    values = element.numbers().tolist()
    if len(values) not in (1, 2) or any(value not in FOCAL for value in values):
        raise element.wrong(quoted(element.text), str(FOCAL))
    return values[0], values[-1]


def _require_plain(element: Element) -> None:
    """Raise for an affine map of pixels that does not leave them where they are."""
    plain = {"I00": [0.0, 0.0], "V10": [1.0, 0.0], "V01": [0.0, 1.0]}
    found = {tag: one for tag in plain for one in element.everywhere(tag)}
    if not all(one.numbers(2).tolist() == plain[tag] for tag, one in found.items()):
        raise element.wrong("turns or scales pixels", "must leave them as they are")


def _shift(element: Element) -> Callable[[Array], Array]:
    """Return what one distortion of a calibration adds to ideal pixels."""
    if len(element.below) != 1:
        found = f"holds {len(element.below)} models"
        raise element.wrong(found, "must hold one")
    model = element.below[0]
    if model.tag not in MODELS:
        kind = model.maybe("TypeModele")
        name = model.tag if kind is None else f"{model.tag} {kind.text}"
        raise model.wrong(f"distortion {quoted(name)}", f"must be {', '.join(MODELS)}, a fisheye")
    if model.tag == "ModNoDist":
        return np.zeros_like
    radial = model.one("RadialePart") if model.maybe("RadialePart") is not None else model
    centre = radial.one("CDist").numbers(2)
    k = {f"k{n}": one.number() for n, one in enumerate(radial.each("CoeffDist"), start=1)}
    p1, p2, b1, b2 = (_optional(model, tag) for tag in ("P1", "P2", "b1", "b2"))

    def shift(colrow: Array) -> Array:
        at = colrow - centre
        out = lens.effects(at, {**k, "u": p2, "v": p1})
        out[:, 0] += at @ [b1, b2]
        return out

    return shift


def _optional(element: Element, tag: str) -> float:
    found = element.maybe(tag)
    return 0.0 if found is None else found.number(allowed=COEFFICIENT)


# --- Fisheyes of MicMac's version 1: ModUnif with 10 radial, 5 decentring terms,
# polynomials to x⁵
#
# As its source has them: an ideal pixel, seen from the centre of distortion c in units of the
# state s, is moved along its direction to the fisheye's distance; with r² of that point p the
# measured one is c + s (p (1 + sum of K_i r^2i) + decentring + polynomials).


_MODELS = {
    "eModele_FishEye_10_5_5": "FE_EquiDist",
    "eModele_EquiSolid_FishEye_10_5_5": "FE_EquiSolid",
    "eModele_Stereographik_FishEye_10_5_5": "StereroGraphik",
}
"""Names of version 1, and of the projections of version 2 that they begin with."""

RADIAL, DECENTRING, DEGREE = 10, 5, 5

N = 50
"""Number of parameters: centre, radial and decentring terms, polynomials."""

STATE = Range(1e-3, 1e9, "must be positive")


def _measured(model: Element) -> Model:
    """Return the map from ideal pixels to measured ones, shape (n, 2), of an element ModUnif.

    Raises
    ------
    FlightError
        For parameters that are not those of a fisheye.
    """
    kind = model.one("TypeModele").text
    values = np.array([one.number() for one in model.each("Params")])
    if len(values) > N:
        raise model.wrong(f"has {len(values)} Params", f"must have at most {N}")
    values = np.pad(values, (0, N - len(values)))
    state, distance = model.one("Etats").number(allowed=STATE), PROJECTIONS[_MODELS[kind]]
    if distance is None:
        raise model.wrong(quoted(kind), "must be a fisheye")
    first = 2 + RADIAL
    radial, decentring = values[2:first], values[first : first + 2 * DECENTRING].reshape(-1, 2)

    def moved(colrow: Array) -> Array:
        at = (colrow - values[:2]) / state
        r = np.hypot(*at.T)
        scale = np.divide(distance(np.arctan(r)), r, out=np.ones_like(r), where=r > 0)
        p = at * scale[:, None]
        r2 = np.sum(p * p, axis=1)
        out = p * (1 + sum(k * r2**n for n, k in enumerate(radial, start=1)))[:, None]
        for n, pair in enumerate(decentring, start=1):  # derivatives of p r^2n by the centre
            if pair.any():
                across = 2 * n * p * (p @ pair)[:, None] * (r2 ** (n - 1))[:, None]
                out += across + np.outer(r2**n, pair)
        out += _polynomials(p, values[first + 2 * DECENTRING :])
        moved: Array = values[:2] + state * out
        return moved

    return moved


def _polynomials(p: Array, values: Array) -> Array:
    """Return the polynomials of degree 1 and 3 to 5."""
    x, y = p.T
    a, b = values[:2]
    out = np.stack([a * x + b * y, b * x], axis=1)
    for value, (axis, n, k) in zip(values[2:], _terms(), strict=True):
        if value:
            out[:, axis] += value * x ** (n - k) * y**k
    return out


def _terms() -> Iterator[tuple[int, int, int]]:
    """Yield the axis, the degree and the power of y of each term, in the order of the file."""
    for n in range(3, DEGREE + 1):
        for k in range(n + 1):
            if k:
                yield 0, n, k
            if n % 2 or k != n:
                yield 1, n, k
