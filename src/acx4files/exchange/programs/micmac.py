"""MicMac's XML: orientations, calibrations, measured and surveyed points.

Pixels count from the centre of the top-left one; cameras have x right, y down, z ahead. Focal
length, principal point and distortion are in pixels. With `eConvApero_DistM2C` the distortion takes
the ideal pixel to the measured one; the points under `Verif` in MicMac's own orientations confirm
this to 1e-9 px.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from acx4files.exchange import coordinates, lens, options, project, safe
from acx4files.exchange.coordinates import FLIP
from acx4files.exchange.lens import Lens, Pinhole
from acx4files.exchange.project import Control, Images, Measured, Project, Proof
from acx4files.exchange.safe import Element, Opened
from acx4files.flight.problems import METRES, RANGES, Range, quoted
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose

KNOWN = "eConvApero_DistM2C"
"""The convention of all files that MicMac writes itself."""

MODELS = ("ModNoDist", "ModRad", "ModPhgrStd")
"""Distortion models that are read; others are refused by name."""

SECOND = ("MMVII-PhgrProj", "Ori-PerspCentral-", "Calib-PerspCentral-")
"""Beginnings of the names of folders and files of version 2 (MMVII), which is not read."""

FOCAL = Range(1.0, 1e7, "must be a focal length in pixels")
ENTRY = Range(-2.0, 2.0, "must be an entry of a rotation")

SHOWN = 5
"""Largest number of names in a sentence."""

PIXEL = "pixel 0, 0 is taken as the centre of the top-left one: no file says it"

ASSUMED = (
    f"{KNOWN}: the matrix takes camera to object axes, x right, y down, z ahead; the "
    "distortion takes ideal pixels to measured ones"
)
PRECISION = "Incertitude of a surveyed point is its standard deviation in metres"


@dataclass(kw_only=True)
class _Content:
    """What XML files say.

    `lenses` are by the names of calibrations, `poses` by images, with the element that names the
    calibration and its name; `seen` are pixels by image and point, `places` coordinates and sigma,
    NaN where not given. `own` are image, object point and pixel of points that MicMac itself
    projected; `others` counts files of another content.
    """

    read: list[Opened] = field(default_factory=list)
    lenses: dict[str, Lens] = field(default_factory=dict)
    poses: dict[str, tuple[Pose, Element, str]] = field(default_factory=dict)
    seen: dict[tuple[str, str], Array] = field(default_factory=dict)
    places: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    own: list[tuple[str, Array, Array]] = field(default_factory=list)
    others: int = 0

    def see(self, element: Element, image: str, point: str) -> None:
        """Add the pixel of a point in an image."""
        if (image, point) in self.seen:
            raise element.wrong(f"{quoted(point)} stands twice in {quoted(image)}", "must once")
        self.seen[image, point] = element.numbers(2, METRES)

    def survey(self, element: Element, point: str, sigma: Array) -> None:
        """Add the coordinates of a point."""
        if point in self.places:
            raise element.wrong(f"point {quoted(point)} stands twice", "must stand once")
        self.places[point] = (element.numbers(3, METRES), sigma)


def read_project(
    source: Annotated[Path, options.Source],
    *,
    crs: options.CrsOfFiles = None,
    orientations: options.AsAdjusted = "none",
) -> Project:
    """Read MicMac's XML: calibration, orientations, measured and surveyed points.

    SOURCE is the folder that holds Ori-* and the points (SetOfMesureAppuisFlottants,
    DicoAppuisFlottant), one of several Ori-* in it, or one of these files. Distortion models
    ModRad, ModPhgrStd and ModNoDist are read; others, fisheyes among them, are refused by name, and
    so are files of version 2 (MMVII).

    Examples
    --------
    acx4 import micmac my_project --out my_flight
    acx4 import micmac my_project/Ori-Ground --orientations adjusted --crs EPSG:2154 --out my_flight

    Raises
    ------
    FlightError
        For files that are not MicMac's, other conventions, projections or distortion models.
    """
    content = _content(source)
    cameras = {name: _camera(name) for name in content.lenses}
    names = tuple(dict.fromkeys([*content.poses, *(image for image, _ in content.seen)]))
    row_of = {image: row for row, image in enumerate(names)}
    camera_of = dict.fromkeys(names, next(iter(cameras.values()), "CAM"))
    for image, (_, element, name) in content.poses.items():
        if name not in cameras:
            raise element.wrong(f"{quoted(name)} is not there", "must be beside the orientations")
        camera_of[image] = cameras[name]
    measured = Measured.of(
        [(row_of[image], point, colrow) for (image, point), colrow in content.seen.items()],
        {name: x_w for name, (x_w, _) in content.places.items()},
    )
    own = Measured.of(
        [(row_of[image], str(k), colrow) for k, (image, _, colrow) in enumerate(content.own)],
        {str(k): x_w for k, (_, x_w, _) in enumerate(content.own)},
    )
    for kind, of in (("image", names), ("camera", cameras.values()), ("point", measured.points)):
        project.require_names(of, partial(content.read[0].wrong, kind))
    unknown = [name for name in measured.points if name not in content.places]
    unseen = [name for name in content.places if name not in measured.points]
    ties = "measured points are tie points, since their coordinates are not there"
    where = "the flight's CRS" if crs is None else crs
    on_map = f"MicMac's coordinates are east, north, height in {where}: its files do not say it"
    surveyed = np.array([*content.places.values()]).reshape(-1, 2, 3)
    return Project(
        source="MicMac",
        sources=content.read,
        lenses={cameras[name]: lens for name, lens in content.lenses.items()},
        images=Images.of(
            (name, camera, name, content.poses[name][0] if name in content.poses else None)
            for name, camera in camera_of.items()
        ),
        measured=measured,
        proofs=(
            Proof(whose="surveyed points", measured=measured),
            Proof(whose="points that MicMac projected itself (Verif)", measured=own, is_own=True),
        ),
        control=Control(names=(*content.places,), enh=surveyed[:, 0], sigma=surveyed[:, 1]),
        settings={} if crs is None else {"crs": crs, "heights": "ellipsoidal"},
        orientations=orientations,
        in_grid=project.in_crs(source, crs),
        lost={
            "other XML files": content.others,
            f"{ties}: {', '.join(unknown[:SHOWN])}": len(unknown) if content.places else 0,
            f"surveyed points are measured in no image: {', '.join(unseen[:SHOWN])}": len(unseen),
        },
        assumed=(ASSUMED, PIXEL, *((on_map, PRECISION) if len(surveyed) else ())),
    )


read = project.reader(read_project)


def _content(source: Path) -> _Content:
    """Return the content of MicMac's files at a path: a folder, or one file."""
    content = _Content()
    for path in _paths(source) if source.is_dir() else [source]:
        if path.name.startswith(SECOND):
            expected = "must be MicMac's first version; write COLMAP's form in place of it"
            raise safe.refusal(str(path), 1, "file", "is of version 2 (MMVII)", expected)
        file = safe.read(path)
        root = safe.xml_tree(file)
        if _take(content, path, root):
            content.read.append(file)
        else:
            content.others += 1
    if not content.read:
        expected = "must hold Ori-*/Orientation-*.xml, measures or surveyed points of MicMac"
        raise safe.refusal(str(source), 1, "file", "has no XML of MicMac", expected)
    return content


def _require_one(source: Path, names: list[str]) -> None:
    """Raise where there are orientations in several folders."""
    if len(names) > 1:
        listed = f"has orientations in {', '.join(names)}"
        raise safe.refusal(str(source), 1, "folder", listed, "give one of these folders")


def _camera(calibration: str) -> str:
    return calibration.removesuffix(".xml").removeprefix("AutoCal_")


def _rotation(element: Element, *tags: str) -> Array:
    """Return a rotation of three rows below an element."""
    R = np.stack([element.one(tag).numbers(3, ENTRY) for tag in tags])
    if not coordinates.is_rotation(R, 1e-6):
        raise element.wrong(f"{', '.join(tags)} are no rotation", "must be orthogonal unit vectors")
    return R


def _paths(source: Path) -> Iterator[Path]:
    """Yield the XML files of a folder and of its Ori-*, or of an Ori-* and the folder around."""
    yield from sorted(source.glob("MMVII-PhgrProj"))
    inside = [inner for inner in sorted(source.glob("Ori-*")) if inner.is_dir()]
    oriented = [inner for inner in inside if next(inner.glob("Orientation-*.xml"), None)]
    _require_one(source, [inner.name for inner in oriented])
    around = [source.parent] if source.name.startswith("Ori-") else []
    for folder in (source, *oriented, *(one for one in inside if one not in oriented), *around):
        yield from sorted(folder.glob("*.xml"))


def _take(content: _Content, path: Path, root: Element) -> bool:
    """Add what a file says; return False where it is of another kind."""
    image, is_known = re.fullmatch(r"Orientation-(.+)\.xml", path.name), False
    for element in root.each("*") if root.tag in ("ExportAPERO", "Global") else [root]:
        if element.tag == "OrientationConique" and image:
            _take_orientation(content, image[1], element)
        elif element.tag == "CalibrationInternConique" and path.name not in content.lenses:
            content.lenses[path.name] = _lens(element)
        elif element.tag == "SetOfMesureAppuisFlottants":
            _take_measures(content, element)
        elif element.tag == "DicoAppuisFlottant":
            for point in element.each("OneAppuisDAF"):
                given = point.maybe("Incertitude")
                sigma = project.NOWHERE if given is None else given.numbers(3, METRES)
                content.survey(point.one("Pt"), point.one("NamePt").content, sigma)
        else:
            continue
        is_known = True
    return is_known


def _take_measures(content: _Content, measures: Element) -> None:
    for seen in measures.each("MesureAppuiFlottant1Im"):
        for point in seen.each("OneMesureAF1I"):
            names = seen.one("NameIm").content, point.one("NamePt").content
            content.see(point.one("PtIm"), *names)


def _take_orientation(content: _Content, image: str, orientation: Element) -> None:
    """Add T_w_c of an ``OrientationConique`` in the library's camera axes, and its own points."""
    for path, wanted in (
        ("Externe/KnownConv", KNOWN),
        ("ConvOri/KnownConv", KNOWN),
        ("TypeProj", "eProjStenope"),
    ):
        _require(orientation.maybe(path), wanted)
    _require_plain(orientation, "OrIntImaM2C")
    if (inside := orientation.maybe("Interne")) is not None:
        raise inside.wrong("a calibration in an orientation", "must be a file named by FileInterne")
    R_w_v = _rotation(orientation.one("Externe/ParamRotation/CodageMatr"), "L1", "L2", "L3")
    pose = Pose(R=R_w_v @ FLIP, r=orientation.one("Externe/Centre").numbers(3, METRES))
    file = orientation.one("FileInterne")
    content.poses[image] = (pose, file, file.content.replace("\\", "/").rpartition("/")[2])
    for point in orientation.each("Verif/Appuis"):
        x_w, colrow = point.one("Ter").numbers(3, METRES), point.one("Im").numbers(2, METRES)
        content.own.append((image, x_w, colrow))


def _require(element: Element | None, wanted: str) -> None:
    if element is not None and element.content != wanted:
        raise element.wrong(quoted(element.content), f"must be {wanted}")


def _require_plain(element: Element, *tags: str) -> None:
    """Raise for an affine map of pixels below that does not leave them where they are."""
    plain = {"I00": [0.0, 0.0], "V10": [1.0, 0.0], "V01": [0.0, 1.0]}
    for affine in (found for tag in tags for found in element.each(tag)):
        for tag, values in plain.items():
            if any(one.numbers(2).tolist() != values for one in affine.each(f".//{tag}")):
                raise affine.wrong("turns or scales pixels", "must leave them as they are")


def _lens(root: Element) -> Lens:
    """Return the camera of an AutoCal*.xml."""
    _require(root.maybe("KnownConv"), KNOWN)
    _require_plain(root, "OrIntGlob", "OrIntImaM2C")
    width, height = root.one("SzIm").numbers(2, RANGES["width_px"]).tolist()
    f = root.one("F").numbers(None, FOCAL).tolist()
    if len(f) not in (1, 2):
        raise root.one("F").wrong(f"{len(f)} numbers", str(FOCAL))
    cx, cy = root.one("PP").numbers(2).tolist()
    hole = stretched = Pinhole(fx=f[0], fy=f[-1], cx=cx, cy=cy)
    terms = [_term(distortion) for distortion in root.each("CalibDistortion")]
    for centre, _, (b1, b2) in terms:  # the pinhole has b1 and b2 of Fraser's model in it
        x, y = np.array([stretched.cx, stretched.cy]) - centre
        moved = float(stretched.cx + b1 * x + b2 * y)
        fx, skew = stretched.fx * (1 + b1), stretched.fy * b2
        stretched = replace(stretched, fx=fx, cx=moved, skew=skew)

    def distorted(ideal: Array) -> Array:
        colrow = hole.colrow(ideal)
        for centre, values, affine in terms:
            offset = colrow - centre
            moved = lens.effects(offset, values)
            moved[:, 0] += offset @ affine
            colrow = colrow + moved
        return stretched.points(colrow)

    return Lens(
        width_px=int(width),
        height_px=int(height),
        hole=stretched,
        distortion=distorted,
        wrong=root.wrong,
    )


def _term(distortion: Element) -> tuple[Array, dict[str, float], list[float]]:
    """Return the centre of a distortion of pixels, its terms in `effects`, and b1, b2."""
    if len(distortion) != 1:
        raise distortion.wrong(f"holds {len(distortion)} models", "must hold one")
    model = distortion.one("*")
    if model.tag not in MODELS:
        kind = model.maybe("TypeModele")
        name = model.tag if kind is None else f"{model.tag} {kind.content}"
        raise model.wrong(f"distortion {quoted(name)}", f"must be {', '.join(MODELS)}")
    if model.tag == "ModNoDist":
        return np.zeros(2), {}, [0.0, 0.0]
    inner = model.maybe("RadialePart")
    radial = model if inner is None else inner
    k = [coefficient.number() for coefficient in radial.each("CoeffDist")]
    if any(k[6:]):
        raise radial.wrong(f"has {len(k)} CoeffDist", "must have at most 6")
    p1, p2, b1, b2 = (
        0.0 if (value := model.maybe(tag)) is None else value.number("", RANGES["b1"])
        for tag in ("P1", "P2", "b1", "b2")
    )
    values = {f"k{n}": value for n, value in enumerate(k, start=1)} | {"u": p2, "v": p1}
    return radial.one("CDist").numbers(2), values, [b1, b2]
