"""MicMac's XML of versions 1 and 2 (MMVII): orientations, calibrations, measured, surveyed points.

Pixels count from the centre of the top-left one; cameras have x right, y down, z ahead. In version
1 focal length, principal point and distortion are in pixels. With `eConvApero_DistM2C` the
distortion takes the ideal pixel to the measured one; the points under `Verif` in MicMac's own
orientations confirm this to 1e-9 px.

Of version 2 the formulas are as its source has them: a direction is projected, plane or as a
fisheye, to a point p in units of F; with r² = x² + y² the distortion is p (1 + K1 r² + K2 r⁴ + ...)
+ p1 (3x² + y², 2xy) + p2 (2xy, x² + 3y²) + (b1 x + b2 y, 0); the pixel is PP + F p. AxeI, AxeJ,
AxeK are the camera's axes in the world.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from acx4files.exchange import lens, safe
from acx4files.exchange.coordinates import FLIP, UNKNOWN, is_rotation, nearest_rotation, stacked
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.lens import WORST_PX, Lens, Model, Pinhole
from acx4files.exchange.options import (
    Allow,
    AsAdjusted,
    BlockOfProject,
    CrsOfFiles,
    PixelUmOfProject,
    Source,
)
from acx4files.exchange.project import (
    Control,
    Images,
    Measured,
    Project,
    Proof,
    flight_of,
    in_crs,
    require_all_names,
)
from acx4files.exchange.safe import Element, Opened
from acx4files.flight.problems import METRES, RANGES, Range, quoted
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose

KNOWN = "eConvApero_DistM2C"
"""The convention of all files that version 1 writes itself."""

MODELS = ("ModNoDist", "ModRad", "ModPhgrStd")
"""Distortion models of version 1 that are read; others are refused by name."""

ORIENTATION, CALIBRATION = "Ori-PerspCentral-", "Calib-PerspCentral-"
"""Beginnings of the names of files of version 2."""

KINDS = {"CameraPose": "NameImage", "InternalCalibration": "PerfectProj", "SetMesIm": "NameIm"}
KINDS |= {"SetGCP": "NameSet"}
"""Elements with the content of a file of version 2, and a part of each: early files lack them."""

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

PER_PIXEL = Range(-0.5, 0.5)
"""P1 and P2 of version 1, per pixel, b1 and b2 without a unit."""

COEFFICIENT = Range(-1e6, 1e6)
ENTRY = Range(-2.0, 2.0, "must be an entry of a rotation")

SKEW = 1e-6
"""Largest difference of a matrix from a rotation."""

AROUND = ("ExportAPERO", "Global")
"""Outermost elements of version 1 that hold others."""

CAMERA = "CAM"
"""Name of the camera where no orientation names a calibration."""

SHOWN = 5
"""Largest number of names in a sentence."""

PIXEL = "pixel 0, 0 is taken as the centre of the top-left one: no file says it"

Content = tuple[Any, ...]
"""Text of an element, and tags and contents of those below it."""

Ray = tuple[Element, str, str, Array]
"""The element, image, point and pixel of a measurement."""

Place = tuple[Element, str, Array, Array]
"""The element, name, coordinates and sigma of a surveyed point, sigma NaN where not given."""


def project(source: Path, *, crs: str | None = None) -> Project:
    """Return MicMac's files of version 1, or of version 2 if there are any.

    Parameters
    ----------
    source : Path
        Of version 1 a folder with one Ori-*, or an Ori-* in it, measures and surveyed points in
        XML; of version 2 a folder of orientations, its project's folder MMVII-PhgrProj or the one
        around that, with the points of the project; or one such file.
    crs : str, optional
        Of the flight and of MicMac's coordinates, which do not say it.

    Raises
    ------
    FlightError
        For files that are not MicMac's, other conventions, projections or distortion models.
    """
    version = _SECOND if _is_second(source) else _FIRST
    files = _files_of(source, version)
    lenses = {
        _camera(name): version.lens(calibration) for name, calibration in files.calibrations.items()
    }
    measured = _once(version.measured(files.measures))
    surveyed: dict[str, tuple[Array, Array]] = {}
    for element, name, x_w, sigma in version.surveyed(files.surveyed):
        if name in surveyed:
            raise element.wrong(f"point {quoted(name)} stands twice", "must stand once")
        surveyed[name] = (x_w, sigma)
    poses = {image: version.pose(node) for image, node in files.orientations.items()}
    names = tuple(dict.fromkeys([*poses, *(image for _, image, _, _ in measured)]))
    row_of = {image: row for row, image in enumerate(names)}
    images = Images(
        names=names,
        cameras=tuple(_camera_of(files, image, version) for image in names),
        exposures=names,
        T_w_c=stacked([poses.get(name, UNKNOWN) for name in names]),
    )
    rays = Measured.of(
        [(row_of[image], point, colrow) for _, image, point, colrow in measured],
        {name: x_w for name, (x_w, _) in surveyed.items()},
    )
    named = {"image": names, "camera": images.cameras, "point": rays.points}
    require_all_names(named, files.read[0].wrong)
    xyz, sigma = (
        np.array([place[k] for place in surveyed.values()]).reshape(-1, 3) for k in (0, 1)
    )
    return Project(
        source=version.name,
        sources=files.read,
        lenses=lenses,
        images=images,
        measured=rays,
        proofs=(Proof(whose="surveyed points", measured=rays), *version.proofs(files)),
        control=Control(names=tuple(surveyed), enh=xyz, sigma=sigma),
        settings={} if crs is None else {"crs": crs, "heights": "ellipsoidal"},
        in_grid=in_crs(source, crs),
        lost={"other XML files": files.others, **version.lost(rays.points, surveyed)},
        assumed=(
            *(version.assumed, PIXEL),
            *(_of_control(crs, version.precision) if surveyed else ()),
        ),
    )


def read(
    source: Annotated[Path, Source],
    *,
    block: BlockOfProject = None,
    crs: CrsOfFiles = None,
    orientations: AsAdjusted = "none",
    pixel_um: PixelUmOfProject = None,
    allow: Allow = WORST_PX,
) -> ImportedFlight:
    """Read MicMac's XML, version 1 or 2: calibration, orientations, measured, surveyed points.

    SOURCE is the folder that holds Ori-* and the points (SetOfMesureAppuisFlottants,
    DicoAppuisFlottant), one of several Ori-* in it, or one of these files. Distortion models
    ModRad, ModPhgrStd, ModNoDist and the three fisheyes are read; others are refused by name. Of
    version 2 (MMVII) it is the folder with MMVII-PhgrProj, or one of Ori/* in that.

    Examples
    --------
    acx4 import micmac my_project --out my_flight
    acx4 import micmac my_project/Ori-Ground --orientations adjusted --crs EPSG:2154 --out my_flight

    Raises
    ------
    FlightError
        As `project` and `flight_of`.
    """
    return flight_of(
        project(source, crs=crs),
        orientations=orientations,
        block=block,
        pixel_um=pixel_um,
        allow=allow,
    )


def _of_control(crs: str | None, precision: str) -> tuple[str, str]:
    """Return sentences on the coordinates and the precision of surveyed points."""
    where = "the flight's CRS" if crs is None else crs
    sentence = f"MicMac's coordinates are east, north, height in {where}: its files do not say it"
    return sentence, precision


def _once(rays: Iterable[Ray]) -> list[Ray]:
    """Return measurements, no point twice in an image."""
    measured, seen = list(rays), set[tuple[str, str]]()
    for element, image, name, _ in measured:
        if (image, name) in seen:
            raise element.wrong(f"{quoted(name)} stands twice in {quoted(image)}", "must once")
        seen.add((image, name))
    return measured


def _camera(calibration: str) -> str:
    name = calibration.removesuffix(".xml").removeprefix("AutoCal_")
    return name.removeprefix(CALIBRATION)


def _camera_of(files: _Files, image: str, version: _Version) -> str:
    """Return the camera of an image: that of its orientation, or the only one."""
    orientation = files.orientations.get(image)
    if orientation is None:
        return next(iter(map(_camera, files.calibrations)), CAMERA)
    if image in files.interior:
        return _camera(files.interior[image])
    element, name = version.calibration(orientation)
    if name not in files.calibrations:
        raise element.wrong(f"{quoted(name)} is not there", "must be beside the orientations")
    return _camera(name)


def _three(element: Element, allowed: Range = METRES) -> Array:
    return _within(element, element.numbers(3), allowed)


def _pixel(element: Element) -> Array:
    return _within(element, element.numbers(2), METRES)


def _within(element: Element, values: Array, allowed: Range) -> Array:
    if not all(value in allowed for value in values):
        raise element.wrong(quoted(element.text), str(allowed))
    return values


# --- The files of both versions


@dataclass(kw_only=True)
class _Files:
    """The XML files of a folder by kind; of version 1 also those of the folders Ori-* in it.

    `orientations` are by image, `calibrations` by their names, `interior` names that of each image
    whose orientation holds it itself, `others` counts files of another content.
    """

    read: list[Opened] = field(default_factory=list)
    orientations: dict[str, Element] = field(default_factory=dict)
    calibrations: dict[str, Element] = field(default_factory=dict)
    interior: dict[str, str] = field(default_factory=dict)
    measures: list[Element] = field(default_factory=list)
    surveyed: list[Element] = field(default_factory=list)
    others: int = 0
    by_content: dict[Content, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class _Version:
    """The readers of the files of a version, and its sentences.

    `keep` puts the content of a file into `_Files`, and is False where its kind is unknown;
    `calibration` is the element that names the calibration of an orientation, and the name;
    `proofs` and `lost` are those of this version alone.
    """

    name: str
    wanted: str
    assumed: str
    precision: str
    paths: Callable[[Path], Iterable[Path]]
    keep: Callable[[_Files, Path, Element], bool]
    pose: Callable[[Element], Pose]
    calibration: Callable[[Element], tuple[Element, str]]
    lens: Callable[[Element], Lens]
    measured: Callable[[Iterable[Element]], Iterator[Ray]]
    surveyed: Callable[[Iterable[Element]], Iterator[Place]]
    proofs: Callable[[_Files], tuple[Proof, ...]] = lambda _: ()
    lost: Callable[[Iterable[str], Iterable[str]], Mapping[str, int]] = lambda *_: {}


def _files_of(source: Path, version: _Version) -> _Files:
    """Return MicMac's files at a path: a folder, or one file."""
    contents = _Files()
    paths = list(version.paths(source)) if source.is_dir() else [source]
    if len(paths) > MOST:
        many = f"has {len(paths)} XML files"
        raise safe.refusal(str(source), 1, "folder", many, f"must have at most {MOST}")
    for path in paths:
        file = safe.read(path)
        if version.keep(contents, path, safe.xml_tree(file)):
            contents.read.append(file)
        else:
            contents.others += 1
    if not contents.read:
        expected = f"must hold {version.wanted}"
        raise safe.refusal(str(source), 1, "file", "has no XML of MicMac", expected)
    return contents


def _require_one(source: Path, names: list[str]) -> None:
    """Raise where there are orientations in several folders."""
    if len(names) > 1:
        listed = f"has orientations in {', '.join(names)}"
        raise safe.refusal(str(source), 1, "folder", listed, "give one of these folders")


# --- Version 1


def _first_paths(source: Path) -> Iterable[Path]:
    """Return the XML files of a folder and of its Ori-*, or of an Ori-* and the folder around."""
    inside = [inner for inner in sorted(source.glob("Ori-*")) if inner.is_dir()]
    oriented = [inner for inner in inside if next(inner.glob("Orientation-*.xml"), None)]
    _require_one(source, [inner.name for inner in oriented])
    around = [source.parent] if source.name.startswith("Ori-") else []
    folders = [source, *oriented, *(inner for inner in inside if inner not in oriented), *around]
    return [path for folder in folders for path in sorted(folder.glob("*.xml"))]


def _first_keep(files: _Files, path: Path, root: Element) -> bool:
    contents = root.below if root.tag in AROUND else [root]
    known = [_is_known(files, path, content) for content in contents]
    return any(known)


def _is_known(files: _Files, path: Path, content: Element) -> bool:
    """Keep an element under its kind; return False where its kind is unknown."""
    image = re.fullmatch(r"Orientation-(.+)\.xml", path.name)
    if content.tag == "OrientationConique" and image:
        files.orientations[image[1]] = content
        if (interior := content.maybe("Interne")) is not None:
            files.interior[image[1]] = _named(files, interior)
    elif content.tag == "CalibrationInternConique" and path.name not in files.calibrations:
        files.calibrations[path.name] = content
        files.by_content.setdefault(_content(content), path.name)
    elif content.tag == "SetOfMesureAppuisFlottants":
        files.measures.append(content)
    elif content.tag == "DicoAppuisFlottant":
        files.surveyed.append(content)
    else:
        return False
    return True


def _named(files: _Files, interior: Element) -> str:
    """Return the name of an orientation's own calibration; equal calibrations have one name."""
    new = f"CAM{len(files.calibrations) + 1}.xml"
    name = files.by_content.setdefault(_content(interior), new)
    files.calibrations.setdefault(name, interior)
    return name


def _content(element: Element) -> Content:
    return element.text, tuple((child.tag, _content(child)) for child in element.below)


def _first_pose(orientation: Element) -> Pose:
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
    return Pose(R=R_w_v @ FLIP, r=_three(orientation.one("Externe", "Centre")))


def _first_calibration(orientation: Element) -> tuple[Element, str]:
    element = orientation.one("FileInterne")
    return element, element.text.replace("\\", "/").rpartition("/")[2]


def _first_measured(sets: Iterable[Element]) -> Iterator[Ray]:
    for group in sets:
        for image in group.each("MesureAppuiFlottant1Im"):
            name = image.one("NameIm").text
            for point in image.each("OneMesureAF1I"):
                yield point, name, point.one("NamePt").text, _pixel(point.one("PtIm"))


def _first_surveyed(dictionaries: Iterable[Element]) -> Iterator[Place]:
    for dictionary in dictionaries:
        for point in dictionary.each("OneAppuisDAF"):
            sigma = point.maybe("Incertitude")
            values = np.full(3, np.nan) if sigma is None else _three(sigma)
            yield point, point.one("NamePt").text, _three(point.one("Pt")), values


def _verified(files: _Files) -> tuple[Proof]:
    """Return the proof by points that MicMac itself projected into images, each point once."""
    pairs = [
        (image, _three(point.one("Ter")), _pixel(point.one("Im")))
        for image, orientation in enumerate(files.orientations.values())
        for point in orientation.each("Verif", "Appuis")
    ]
    projected = Measured.of(
        [(image, str(k), colrow) for k, (image, _, colrow) in enumerate(pairs)],
        {str(k): x_w for k, (_, x_w, _) in enumerate(pairs)},
    )
    return (Proof(whose="points that MicMac projected itself (Verif)", measured=projected),)


def _alone(measured: Iterable[str], surveyed: Iterable[str]) -> dict[str, int]:
    """Return the points that are measured or surveyed alone, in words, and how many."""
    known, seen = set(surveyed), set(measured)
    unknown = [name for name in measured if name not in known] if known else []
    unseen = [name for name in surveyed if name not in seen]
    ties = "measured points are tie points, since their coordinates are not there"
    return {
        f"{ties}: {', '.join(unknown[:SHOWN])}": len(unknown),
        f"surveyed points are measured in no image: {', '.join(unseen[:SHOWN])}": len(unseen),
    }


# lenses


def _first_lens(root: Element) -> Lens:
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
    wide = [model for model in root.each("CalibDistortion", "ModUnif") if _is_fisheye(model)]
    if wide:
        return _fisheye(root, wide[0], hole, (width, height))
    shifts = [_shift(model) for model in root.each("CalibDistortion")]

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
    columns = {tag: column for tag in plain for column in element.everywhere(tag)}
    if not all(column.numbers(2).tolist() == plain[tag] for tag, column in columns.items()):
        raise element.wrong("turns or scales pixels", "must leave them as they are")


def _shift(element: Element) -> Callable[[Array], Array]:
    """Return the displacement of ideal pixels by one distortion of a calibration."""
    if len(element.below) != 1:
        count = f"holds {len(element.below)} models"
        raise element.wrong(count, "must hold one")
    model = element.below[0]
    if model.tag not in MODELS:
        kind = model.maybe("TypeModele")
        name = model.tag if kind is None else f"{model.tag} {kind.text}"
        raise model.wrong(f"distortion {quoted(name)}", f"must be {', '.join(MODELS)}, a fisheye")
    if model.tag == "ModNoDist":
        return np.zeros_like
    radial = model.one("RadialePart") if model.maybe("RadialePart") is not None else model
    centre = radial.one("CDist").numbers(2)
    k = {
        f"k{n}": coefficient.number()
        for n, coefficient in enumerate(radial.each("CoeffDist"), start=1)
    }
    p1, p2, b1, b2 = (_optional(model, tag) for tag in ("P1", "P2", "b1", "b2"))

    def shift(colrow: Array) -> Array:
        offset = colrow - centre
        out = lens.effects(offset, {**k, "u": p2, "v": p1})
        out[:, 0] += offset @ [b1, b2]
        return out

    return shift


def _optional(element: Element, tag: str) -> float:
    child = element.maybe(tag)
    return 0.0 if child is None else child.number(allowed=PER_PIXEL)


# Fisheyes, ModUnif: 10 radial, 5 decentring terms, polynomials to x⁵. As its source has them: an
# ideal pixel, seen from the centre of distortion c in units of the state s, is moved along its
# direction to the fisheye's distance; with r² of that point p the measured one is
# c + s (p (1 + sum of K_i r^2i) + decentring + polynomials).

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
    """Return the map from ideal pixels to measured ones, shape (n, 2), of an element ModUnif."""
    kind = model.one("TypeModele").text
    values = np.array([parameter.number() for parameter in model.each("Params")])
    if len(values) > N:
        raise model.wrong(f"has {len(values)} Params", f"must have at most {N}")
    values = np.pad(values, (0, N - len(values)))
    state, distance = model.one("Etats").number(allowed=STATE), PROJECTIONS[_MODELS[kind]]
    if distance is None:
        raise model.wrong(quoted(kind), "must be a fisheye")
    first = 2 + RADIAL
    radial, decentring = values[2:first], values[first : first + 2 * DECENTRING].reshape(-1, 2)

    def moved(colrow: Array) -> Array:
        points = (colrow - values[:2]) / state
        r = np.hypot(*points.T)
        scale = np.divide(distance(np.arctan(r)), r, out=np.ones_like(r), where=r > 0)
        p = points * scale[:, None]
        r2 = np.sum(p * p, axis=1)
        out = p * (1 + sum(k * r2**n for n, k in enumerate(radial, start=1)))[:, None]
        for n, pair in enumerate(decentring, start=1):  # derivatives of p r^2n by the centre
            if pair.any():
                across = 2 * n * p * (p @ pair)[:, None] * (r2 ** (n - 1))[:, None]
                out += across + np.outer(r2**n, pair)
        out += _polynomials(p, values[first + 2 * DECENTRING :])
        return values[:2] + state * out

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


_FIRST = _Version(
    name="MicMac",
    wanted="Ori-*/Orientation-*.xml, measures or surveyed points of MicMac",
    assumed=f"{KNOWN}: the matrix takes camera to object axes, x right, y down, z ahead; the "
    "distortion takes ideal pixels to measured ones",
    precision="Incertitude of a surveyed point is its standard deviation in metres",
    paths=_first_paths,
    keep=_first_keep,
    pose=_first_pose,
    calibration=_first_calibration,
    lens=_first_lens,
    measured=_first_measured,
    surveyed=_first_surveyed,
    proofs=_verified,
    lost=_alone,
)


# --- Version 2


def _is_second(source: Path) -> bool:
    """Tell whether a path is of version 2: one of its files, or a folder around them."""
    if not source.is_dir():
        return source.name.startswith((ORIENTATION, CALIBRATION))
    wanted = (f"{ORIENTATION}*.xml", f"{CALIBRATION}*.xml")
    inside = (source.glob(pattern) for pattern in wanted)
    around = ("MMVII-PhgrProj", "Ori")
    return any(next(matches, None) for matches in inside) or any(
        (source / n).is_dir() for n in around
    )


def _second_paths(source: Path) -> Iterable[Path]:
    """Return the XML files of one folder of orientations, and of the points of its project."""
    oriented = sorted({path.parent for path in source.rglob(f"{ORIENTATION}*.xml")})
    _require_one(source, [str(place.relative_to(source)) for place in oriented])
    folder = oriented[0] if oriented else source
    paths = sorted(folder.glob("*.xml"))
    if folder.parent.name == "Ori":
        rest = (place for place in sorted(folder.parent.parent.iterdir()) if place.name != "Ori")
        paths += [path for place in rest for path in sorted(place.rglob("Mes*.xml"))]
    return paths


def _second_keep(files: _Files, _: Path, root: Element) -> bool:
    kind, content = _kind(root)
    if kind == "CameraPose":
        files.orientations[_text(content.one("NameImage"))] = content
    elif kind == "InternalCalibration":
        files.calibrations[_text(content.one("Name"))] = content
    elif kind:
        (files.measures if kind == "SetMesIm" else files.surveyed).append(content)
    return bool(kind)


def _kind(root: Element) -> tuple[str, Element]:
    """Return the kind of a file, and the element with its content."""
    data = root.maybe("Data") or root
    for kind, inside in KINDS.items():
        within = data.maybe(kind) or data
        if within.maybe(inside) is not None:
            return kind, within
    return "", root


def _text(element: Element) -> str:
    """Return a text without the quotation marks of version 2."""
    text = element.text
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def _second_pose(element: Element) -> Pose:
    """Return T_w_c of an orientation in the library's camera axes."""
    matrix = element.one("RotMatrix")
    axes = [_three(matrix.one(f"Axe{axis}"), ENTRY) for axis in "IJK"]
    R_w_v = np.stack(axes, axis=1)
    if not is_rotation(R_w_v, SKEW):
        raise matrix.wrong("AxeI, AxeJ, AxeK are no rotation", "must be the columns of one")
    return Pose(R=nearest_rotation(R_w_v) @ FLIP, r=_three(element.one("Center")))


def _second_calibration(pose: Element) -> tuple[Element, str]:
    element = pose.one("NameInternalCalib")
    return element, _text(element)


def _second_measured(sets: Iterable[Element]) -> Iterator[Ray]:
    for group in sets:
        image = _text(group.one("NameIm"))
        for point in group.each("Measures", "el"):
            yield point, image, _text(point.one("Name")), _pixel(point.one("Pt"))


def _second_surveyed(sets: Iterable[Element]) -> Iterator[Place]:
    for group in sets:
        for point in group.each("Measures", "el"):
            yield point, _text(point.one("Name")), _three(point.one("Pt")), _sigma(point)


def _sigma(point: Element) -> Array:
    """Return standard deviations of a surveyed point, m; NaN where the file has none."""
    element = next((child for child in point.below if child.tag.endswith("Sigma2")), None)
    if element is None:
        return np.full(3, np.nan)
    variances = element.numbers(6)[[0, 3, 5]]
    if (variances < 0).any():
        raise element.wrong(quoted(element.text), "must have variances xx xy xz yy yz zz")
    return np.sqrt(variances)


def _second_lens(root: Element) -> Lens:
    """Return the camera of a calibration."""
    kind = _text(root.one("Projection"))
    if kind not in PROJECTIONS:
        expected = f"must be one of {', '.join(PROJECTIONS)}"
        raise root.one("Projection").wrong(quoted(kind), expected)
    size = root.one("PixelFrame", "NbPix")
    width, height = (int(side) for side in _within(size, size.numbers(2), RANGES["width_px"]))
    f = root.one("PerfectProj", "F").number(allowed=FOCAL)
    cx, cy = root.one("PerfectProj", "PP").numbers(2).tolist()
    values = _coefficients(root)
    b1, b2 = values.pop("b1", 0.0), values.pop("b2", 0.0)
    plain, outward = Pinhole(fx=f, fy=f, cx=cx, cy=cy), PROJECTIONS[kind]
    hole = replace(plain, fx=f * (1 + b1), skew=f * b2)

    def distorted(points: Array) -> Array:
        projected = points if outward is None else _moved(points, outward(np.hypot(*points.T)))
        moved = projected + lens.effects(projected, values)
        moved[:, 0] += projected @ [b1, b2]
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
    return points * scale[:, None]


def _coefficients(root: Element) -> dict[str, float]:
    """Return the terms of the distortion by their roles in `effects`, with b1 and b2."""
    coefficients: dict[str, float] = {}
    mode = root.maybe("Auxiliary", "IsFraserMode")
    known = {"p1": "v", "p2": "u", "b1": "b1", "b2": "b2"}
    if mode is not None and mode.text == "0":  # the terms of degree 1 are others
        known = {"p1": "v", "p2": "u"}
    for element in (term for part in root.one("Distorsion").below for term in part.below):
        value = element.number(allowed=COEFFICIENT)
        role = known.get(element.tag)
        if radial := re.fullmatch(r"K([1-6])", element.tag):
            role = f"k{radial[1]}"
        if role is None and value:
            expected = "must be 0; K1 to K6, p1, p2, b1, b2 are read"
            raise element.wrong(f"{value:g}", expected)
        if role is not None:
            coefficients[role] = value
    return coefficients


_SECOND = _Version(
    name="MicMac, version 2",
    wanted=f"{ORIENTATION}*.xml or {CALIBRATION}*.xml",
    assumed="AxeI, AxeJ, AxeK are the camera's axes in the world, x right, y down, z ahead; the "
    "distortion takes ideal points to measured ones",
    precision="Sigma2 of a surveyed point has its variances in m²",
    paths=_second_paths,
    keep=_second_keep,
    pose=_second_pose,
    calibration=_second_calibration,
    lens=_second_lens,
    measured=_second_measured,
    surveyed=_second_surveyed,
)
