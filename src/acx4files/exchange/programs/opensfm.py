"""Projects of OpenSfM, ODM and WebODM: cameras, rigs, images, tracks, control, orientations.

https://opensfm.org/docs/geometry.html; names in the files as in ``opensfm/io.py``, order of the
steps as in ``opensfm/src/geometry/camera_instances.h``. Normalised pixels count from the middle of
the image, whose longer side is 1, y down; a shot's rotation and translation take object points to
its camera: x right, y down, z ahead.

OpenSfM writes east, north, up at the place of reference_lla. ODM replaces its reconstruction.json
by one in UTM, from which an offset was taken, and leaves reference_lla and the measured positions
as they were. The files do not say which of the two they are; the measured positions do.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np

from acx4files.exchange import coordinates, lens, options, project, safe
from acx4files.exchange.coordinates import FLIP, Chosen, stacked
from acx4files.exchange.lens import Lens, Pinhole
from acx4files.exchange.project import Control, Images, Measured, Project, Proof
from acx4files.exchange.safe import Line, Node, Opened
from acx4files.flight.problems import METRES, RANGES, Range, quoted
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.geodesy import GridSystem, MappingFrame

OPENSFM = "opensfm"
"""Folder of OpenSfM's files in a project of ODM."""

RECONSTRUCTION, TRACKS = "reconstruction.json", "tracks.csv"
VERSIONS = ("OPENSFM_TRACKS_VERSION_v1", "OPENSFM_TRACKS_VERSION_v2")
"""First lines of tracks.csv; the first version of all had none."""

NO_POSITION_DOP = 999_999
"""Dilution of precision that OpenSfM writes where there is no position."""

NORMALISED = Range(-1e3, 1e3, "must be divided by the longer side of the image")
TURN = Range(-100.0, 100.0, "must be a rotation vector in radians")

CONTROL = ("ground_control_points.json", "gcp_list.txt", "../gcp_list.txt")
"""Control points: in the folder of the project, or in that of ODM above it."""

COORDS = "../odm_georeferencing/coords.txt"
"""Zone and offset of ODM."""

BETTER = 2.0
"""Factor by which measured positions must fit UTM better, so that UTM is taken."""

LAT, LON, HEIGHT = Range(-90.0, 90.0), Range(-360.0, 360.0), Range(-12_000.0, 100_000.0)
FOCAL = Range(1e-3, 1e3, "must be the focal length divided by the longer side of the image")
COEFFICIENT = Range(-1e6, 1e6)

ANISOTROPIC = ("brown", "radial", "simple_radial", "fisheye_opencv", "fisheye62", "fisheye624")
"""Models with two focal lengths and a principal point."""

ASSUMED = (
    "normalised pixels count from the middle of the image, whose longer side is 1, y down",
    "rotation and translation of a shot take object points to its camera: x right, y down, z ahead",
)


def read_project(
    source: Annotated[Path, options.Source],
    *,
    crs: options.CrsOfProject = None,
    orientations: options.Orientations = "initial",
) -> Project:
    """Read a project of OpenSfM, ODM or WebODM: cameras, images, tracks, rigs, control.

    SOURCE is the folder with reconstruction.json and tracks.csv, the folder of an ODM project, or
    one file reconstruction.json. Where a reconstruction by ODM has the axes of UTM, the measured
    positions tell.

    Examples
    --------
    acx4 import opensfm my_project --out my_flight
    acx4 import opensfm my_project --orientations adjusted --crs EPSG:25833 --out my_flight

    Raises
    ------
    FlightError
        For files that are not those of OpenSfM, or a reconstruction without what is asked for.
    """
    files = _files_of(source)
    root, others = _reconstruction(files)
    images, models, gps = _images(root)
    lenses = _lenses(files, root, models)
    sizes = np.array([(lenses[name].width_px, lenses[name].height_px) for name in images.cameras])
    ties = _ties(files, root, images, sizes)
    named = {"image": images.names, "camera": images.cameras, "exposure": images.exposures}
    for kind, names in {**named, "point": ties.points}.items():
        project.require_names(names, partial(root.source.wrong, kind))
    place = _place_of(files, root, images.T_w_c.r, gps, crs)
    listed = [file for file in map(files.maybe, CONTROL) if file is not None]
    marks, control, lost = Measured(), None, dict[str, int]()
    proofs = [Proof(whose="the program's own points", measured=ties, is_own=True)]
    if listed and place is None:
        others = (f"{listed[0].name}: the reconstruction has no place on the Earth", *others)
    elif listed and place is not None:
        marks, control, lost = _marks(listed[0], images, sizes, place.frame)
        others = (*(f"{file.name}: {listed[0].name} is taken" for file in listed[1:]), *others)
        if {*marks.points, *control.names}.intersection(ties.points):
            ties = replace(ties, points=tuple(f"track {name}" for name in ties.points))
        whose, T_m_c = "control points, by the adjusted orientations,", place.in_frame(images.T_w_c)
        proofs.append(Proof(whose=whose, measured=marks, T_w_c=T_m_c))
    is_placed = place is not None and (control is not None or orientations == "adjusted")
    n_known = int(np.isfinite(gps).all(axis=1).sum())
    return Project(
        source="OpenSfM",
        sources=files.read.values(),
        lenses=lenses,
        images=images,
        measured=project.joined(marks, ties),
        proofs=tuple(proofs),
        control=control,
        settings=place.settings if place is not None and is_placed else {},
        orientations=orientations,
        in_grid=_in_grid(root, place),
        lost={**lost, "measured positions: without attitudes they are no trajectory": n_known},
        assumed=(*ASSUMED, *(place.said if place is not None and is_placed else ())),
        left_out=others,
    )


read = project.reader(read_project)


def _lenses(files: _Files, root: Node, models: dict[str, str]) -> dict[str, Lens]:
    """Return the cameras, or the heads of rigs, with their places in the rig."""
    mounts = root.maybe("rig_cameras") or files.tree("rig_cameras.json")
    lenses: dict[str, Lens] = {}
    for head, model in models.items():
        lenses[head] = _lens(root.one("cameras").one(model))
        if mounts is not None and (mount := mounts.maybe(head)) is not None:
            T_r_v = _pose(mount).inverse
            T_r_h = Pose(R=coordinates.turned(T_r_v.R), r=T_r_v.r @ FLIP)
            lenses[head] = replace(lenses[head], mount=T_r_h)
    return lenses


def _in_grid(root: Node, place: _Place | None) -> project.InGrid:
    if place is None:
        fault = "has no measured position: the adjusted orientations are nowhere on the Earth"
        expected = "must have gps_position, with reference_lla"
        return root.one("shots").wrong(fault, expected)
    return lambda T: place.frame.pose_to_grid(place.in_frame(T))


def _ties(files: _Files, root: Node, images: Images, sizes: Array) -> Measured:
    """Return the tracks in reconstructed images, with their reconstructed points."""
    known, source = root.maybe("points"), files.maybe(TRACKS)
    if source is None:
        return Measured()
    row_of = {name: row for row, name in enumerate(images.names)}
    seen = []
    for row in safe.lines(source, separator="\t"):
        if row.number == 1 and row.cells[0].startswith("OPENSFM_TRACKS"):
            if row.cells[0] not in VERSIONS:
                raise row.wrong("version", quoted(row.cells[0]), f"must be {' or '.join(VERSIONS)}")
            continue
        point = row.numbers(3, 5, "x, y", NORMALISED)
        if row.cells[0] in row_of:
            seen.append((row_of[row.cells[0]], row.cell(1, "track"), point))
    places = known.items() if known is not None else ()
    x_w = {name: point.one("coordinates").numbers(3, allowed=METRES) for name, point in places}
    ties = Measured.of(seen, x_w)
    return replace(ties, colrow=_colrow(ties.colrow, sizes[ties.image_idx]))


def _colrow(points: Array, sizes: Array) -> Array:
    """Return the library's pixels of normalised points in images of sizes, both (..., 2)."""
    return np.asarray(points * sizes.max(axis=-1, keepdims=True) + (sizes - 1) / 2)


# files


@dataclass(frozen=True, kw_only=True)
class _Files:
    """A folder of OpenSfM's files, with the files' other names and the files opened so far."""

    folder: Path
    names: dict[str, str] = field(default_factory=dict)
    read: dict[str, Opened] = field(default_factory=dict)

    def maybe(self, *names: str) -> Opened | None:
        """Return the first file that exists of some names; None where there is none."""
        for name in names:
            path = self.folder / self.names.get(name, name)
            if name.startswith("../") and self.folder.name != OPENSFM:
                continue  # above the folder is ODM's only if it has this name
            if path.is_symlink() or path.exists():
                return self.read.setdefault(path.name, safe.read(path))
        return None

    def tree(self, *names: str) -> Node | None:
        """Return the first file that exists of some names, as JSON; None where there is none."""
        source = self.maybe(*names)
        return None if source is None else safe.json_tree(source)


def _files_of(source: Path) -> _Files:
    """Return the files at a path: a folder, an ODM project's folder, or one file."""
    if not source.is_dir():
        return _Files(folder=source.parent, names={RECONSTRUCTION: source.name, TRACKS: "\0"})
    for folder in (source, source / OPENSFM):
        if (folder / RECONSTRUCTION).exists():
            return _Files(folder=folder)
    wanted = f"must hold {RECONSTRUCTION}, as OpenSfM writes it"
    raise safe.refusal(str(source), 1, "folder", "has no file of OpenSfM", wanted)


def _reconstruction(files: _Files) -> tuple[Node, tuple[str, ...]]:
    """Return the reconstruction with the most shots, and a sentence on the others."""
    tree = safe.json_tree(safe.read(files.folder / files.names.get(RECONSTRUCTION, RECONSTRUCTION)))
    files.read[tree.source.name] = tree.source
    parts = [tree] if isinstance(tree.value, dict) else [*tree.each()]
    if not parts:
        raise tree.wrong("has no reconstruction", "must have one at least")
    sizes = [len([*part.one("shots").items()]) for part in parts]
    best = int(np.argmax(sizes))
    others = f"{len(parts) - 1} more reconstructions with {sum(sizes) - sizes[best]} shots"
    return parts[best], (f"{others}: each has a frame of its own",) if len(parts) > 1 else ()


# shots and cameras


def _images(root: Node) -> tuple[Images, dict[str, str], Array]:
    """Return the shots, the camera model of every head, and measured positions.

    An image's exposure and camera are those of its rig, or its own name and model where there is
    no rig. Measured positions, shape (n, 3), m, are in the frame of the orientations; NaN where
    there is none, for which OpenSfM writes a dilution of 999999.
    """
    shots = dict(root.one("shots").items())
    if not shots:
        raise root.one("shots").wrong("has no shot", "must have one at least")
    models = {name: shot.one("camera").text() for name, shot in shots.items()}
    exposures, heads = {name: name for name in shots}, dict(models)
    rigs = root.maybe("rig_instances")
    for instance, rig in rigs.items() if rigs is not None else ():
        cameras = dict(rig.one("rig_camera_ids").items())
        for image, head in cameras.items() if len(cameras) > 1 else ():
            exposures[image], heads[image] = instance, head.text()
    gps = np.full((len(shots), 3), np.nan)
    for k, shot in enumerate(shots.values()):
        position, dop = shot.maybe("gps_position"), shot.maybe("gps_dop")
        if position is not None and (dop is None or dop.number() < NO_POSITION_DOP):
            gps[k] = position.numbers(3, allowed=METRES)
    T_w_v = stacked([_pose(shot) for shot in shots.values()]).inverse
    images = Images(
        names=tuple(shots),
        cameras=tuple(heads[name] for name in shots),
        exposures=tuple(exposures[name] for name in shots),
        T_w_c=Pose(R=T_w_v.R @ FLIP, r=T_w_v.r),
    )
    return images, {heads[name]: model for name, model in models.items()}, gps


def _pose(node: Node) -> Pose:
    """Return the pose of a shot, or of a camera in its rig: from object, or rig, to camera."""
    R = exp(node.one("rotation").numbers(3, allowed=TURN))
    return Pose(R=R, r=node.one("translation").numbers(3, allowed=METRES))


def _lens(node: Node) -> Lens:
    """Return a camera of reconstruction.json."""
    place = node.maybe("projection_type")
    kind = "perspective" if place is None else place.text()
    if kind not in lens.OPENSFM:
        raise (place or node).wrong(quoted(kind), f"must be one of {', '.join(lens.OPENSFM)}")
    width, height = (int(node.one(key).number(RANGES[f"{key}_px"])) for key in ("width", "height"))
    longer, two = max(width, height), kind in ANISOTROPIC
    focal = ("focal_x", "focal_y") if two else ("focal", "focal")
    fx, fy = (node.one(key).number(FOCAL) for key in focal)
    cx, cy = (_number(node, key) if two else 0.0 for key in ("c_x", "c_y"))
    formula = lens.OPENSFM[kind]
    hole = Pinhole(
        fx=fx * longer,
        fy=fy * longer,
        cx=cx * longer + (width - 1) / 2,
        cy=cy * longer + (height - 1) / 2,
    )
    coefficients = [_number(node, name) for name in formula.names]
    return formula.lens(coefficients, hole, (width, height), node.wrong)


def _number(node: Node, name: str) -> float:
    child = node.maybe(name)
    return 0.0 if child is None else child.number(COEFFICIENT)


# where it is


@dataclass(frozen=True, kw_only=True, eq=False)
class _Place:
    """Where the frame w of a project is.

    `frame` is the flight's mapping frame with its origin below that of the project, `altitude`
    the height of this; `utm` is the same in UTM, where w has the axes of UTM, with the `offset`
    of the origin of w in UTM, m; `said` is what was assumed.
    """

    frame: MappingFrame
    altitude: float
    utm: MappingFrame | None = None
    offset: Array
    said: tuple[str, ...]

    @property
    def settings(self) -> dict[str, str | float]:
        """Keys of flight.toml."""
        return {"crs": self.frame.grid.crs, "heights": self.frame.grid.heights}

    def in_frame(self, T_w: Pose) -> Pose:
        """Return poses of the project in the mapping frame."""
        if self.utm is None:
            return Pose(R=T_w.R, r=T_w.r + np.array([0.0, 0.0, self.altitude]))
        return self.utm.pose_from_grid(T_w.r + np.append(self.offset, 0.0), T_w.opk)


def _place_of(
    files: _Files, root: Node, centres: Array, gps: Array, crs: str | None
) -> _Place | None:
    """Return where a project is; None without measured positions: then it is nowhere.

    Of the axes of UTM and topocentric ones, it has those in which the camera centres fit the
    measured positions, both (n, 3), better.
    """
    node = root.maybe("reference_lla") or files.tree("reference_lla.json")
    if node is None or not np.isfinite(gps).any():
        return None
    lon, lat, altitude = (
        node.one(key).number(allowed)
        for key, allowed in (("longitude", LON), ("latitude", LAT), ("altitude", HEIGHT))
    )
    zone, offset = _zone_and_offset(files, lon, lat)
    try:
        grids = [GridSystem(crs=code, heights="ellipsoidal") for code in (zone, crs or zone)]
        utm, flown = (MappingFrame(grid=one, origin=np.array([lon, lat])) for one in grids)
    except ValueError as error:
        raise FlightError([f"--crs:1: crs: {error}; must be projected and in metres"]) from None
    said = f"positions are of WGS 84, in {flown.grid.crs}; altitudes are taken as ellipsoidal"
    place = _Place(frame=flown, altitude=altitude, offset=offset, said=(said,))
    known = np.isfinite(gps).all(axis=1)
    xy, gps = centres[known, :2], gps[known]
    grid = utm.to_grid(gps + np.array([0.0, 0.0, altitude]))[:, :2] - offset
    size, plain, in_utm = (
        float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
        for off in (gps[:, :2] - gps[:, :2].mean(axis=0), xy - gps[:, :2], xy - grid)
    )
    if known.sum() < 3 or BETTER * in_utm > plain or in_utm > size:
        return place
    sentence = (
        f"orientations and points have the axes of UTM, as ODM writes them: camera centres are "
        f"{in_utm:.2g} m rms from the measured positions so, {plain:.2g} m in topocentric axes"
    )
    return replace(place, utm=utm, said=(*place.said, sentence))


def _zone_and_offset(files: _Files, lon: float, lat: float) -> tuple[str, Array]:
    """Return the UTM zone as an EPSG code, and the origin of a reconstruction by ODM in it."""
    source = files.maybe(COORDS)
    rows = [] if source is None else list(safe.lines(source))[:2]
    if len(rows) == 2 and rows[0].cells[:2] == ("WGS84", "UTM"):
        zone = rows[0].cell(2, "zone")
        return _code(int(zone[:-1]), zone[-1] != "S"), rows[1].numbers(0, 2, "offset")
    zone = _code(min(int((lon + 180) % 360 // 6) + 1, 60), lat >= 0)
    grid = GridSystem(crs=zone, heights="ellipsoidal")
    return zone, grid.grid_from_lonlat(np.array([[lon, lat]]))[0]


def _code(zone: int, north: bool) -> str:
    return f"EPSG:{(32600 if north else 32700) + zone}"


# control points


Seen = tuple[str, str, Array]
"""Image, point and pixel of a measurement."""


def _marks(
    file: Opened, images: Images, sizes: Array, frame: MappingFrame
) -> tuple[Measured, Control, dict[str, int]]:
    """Return measurements of control points, points with an altitude, and counts of lost ones."""
    is_json = file.name.endswith(".json")
    if is_json:
        places, marks = _of_json(safe.json_tree(file), frame.grid)
    else:
        places, marks, _ = _list(file, frame.grid.crs)
    row_of = {name: row for row, name in enumerate(images.names)}
    used = [(row_of[image], name, at) for image, name, at in marks if image in row_of]
    enh = np.array([*places.values()]).reshape(-1, 3)
    measured = Measured.of(used, dict(zip(places, frame.from_grid(enh), strict=True)))
    if is_json:
        colrow = _colrow(measured.colrow, sizes[measured.image_idx])
        measured = replace(measured, colrow=colrow)
    control, flat = _with_heights(places)
    lost = {
        "control points without an altitude": len(flat),
        "measurements of control points in images that were not oriented": len(marks) - len(used),
    }
    return measured, control, lost


def _with_heights(places: dict[str, Array]) -> tuple[Control, list[str]]:
    """Return points whose height is known as control points, and the names of the others."""
    high = {name: enh for name, enh in places.items() if np.isfinite(enh[2])}
    enh = np.array([*high.values()]).reshape(-1, 3)
    return Control(names=tuple(high), enh=enh), [name for name in places if name not in high]


def _of_json(node: Node, grid: GridSystem) -> tuple[dict[str, Array], list[Seen]]:
    """Return points with a position, m, and measurements, normalised; heights may be NaN."""
    places: dict[str, Array] = {}
    marks: list[Seen] = []
    for point in node.one("points").each():
        name = point.one("id").text()
        if (place := point.maybe("position")) is not None:
            lon, lat = place.one("longitude").number(LON), place.one("latitude").number(LAT)
            height = place.maybe("altitude")
            h = np.nan if height is None else height.number(HEIGHT)
            places[name] = np.append(grid.grid_from_lonlat(np.array([[lon, lat]]))[0], h)
        for observation in point.one("observations").each():
            if (seen := observation.maybe("projection")) is not None:
                image, xy = observation.one("shot_id").text(), seen.numbers(2, NORMALISED)
                marks.append((image, name, xy))
    return places, marks


# --- ODM's gcp_list.txt: surveyed points and where they are in the pictures
#
# https://docs.opendronemap.org/gcp/: the first line is the CRS; then x y z col row image [name].


UTM = re.compile(r"WGS\s?84\s+UTM\s+(\d{1,2})\s*([NS]?)", re.ASCII | re.I)

_EXPECTED = "must be WGS84 UTM 17N, EPSG:n, WGS84, or a PROJ string"


def control(
    source: Annotated[Path, options.Source],
    *,
    crs: options.CrsOfProject = None,
    camera: Annotated[
        str | None,
        options.Option("NAME", "Camera of all pictures: then images.csv is written, too."),
    ] = None,
) -> Project:
    """Read ODM's gcp_list.txt: surveyed points and their places in the pictures.

    The first line is the CRS; a height NaN makes a tie point of a point. Longitudes and latitudes
    are written in the UTM zone where they lie, or in --crs.

    Examples
    --------
    acx4 import odm-control gcp_list.txt --out my_flight
    acx4 import odm-control gcp_list.txt --camera CAM --crs EPSG:25833 --out my_flight

    Raises
    ------
    FlightError
        For another layout, or one name for two points.
    """
    file = safe.read(source)
    places, seen, system = _list(file, crs)
    control, flat = _with_heights(places)
    images, image_idx = project.first_use([image for image, _, _ in seen])
    return Project(
        source="ODM's control points",
        sources=[file],
        images=Images.of((image, camera or "", image, None) for image in images),
        measured=Measured.of(
            [(k, name, at) for k, (_, name, at) in zip(image_idx, seen, strict=True)]
        ),
        control=control,
        settings=system.settings,
        lost={f"points without a height: {', '.join(flat[:5])}": len(flat)},
        assumed=(
            *system.assumed,
            "pixel 0, 0 is the centre of the top-left one, rows grow down",
        ),
    )


read_control = project.reader(control, ("block",))


def _list(file: Opened, crs: str | None) -> tuple[dict[str, Array], list[Seen], Chosen]:
    """Return places in the flight's system, NaN without a height, measurements, and the system."""
    rows = [*safe.lines(file, comment="#")]
    if len(rows) < 2:
        raise file.wrong("file", "has no point after the CRS", "must have one at least")
    names, seen = _points(rows[1:])
    xyz = np.array([(*place, np.nan)[:3] for place in names])
    text = file.text().split("\n")[rows[0].number - 1].strip()
    try:
        system = coordinates.chosen(crs_of(text), xyz[:, :2].mean(axis=0), crs)
        enh = xyz if system is None else system.from_source(xyz)
    except ValueError as error:
        raise rows[0].wrong("CRS", f"{quoted(text)}: {error}", _EXPECTED) from None
    if system is None:
        raise rows[0].wrong("CRS", quoted(text), _EXPECTED)
    return dict(zip(names.values(), enh, strict=True)), seen, system


def crs_of(text: str) -> str:
    """Return the CRS of a first line: a UTM zone of WGS 84, WGS 84 alone, a code, a PROJ string."""
    text = text.strip().strip("'\"")
    zone = UTM.fullmatch(text)
    if zone and 1 <= int(zone[1]) <= 60:
        return _code(int(zone[1]), zone[2].upper() != "S")
    return "EPSG:4326" if re.fullmatch(r"WGS\s?84", text, re.I) else text


def _points(rows: Sequence[Line]) -> tuple[dict[tuple[float, ...], str], list[Seen]]:
    """Return the names of points by x, y and, if known, z, as two NaN are not equal, and marks.

    Points without a name are numbered in the order of the file.
    """
    names: dict[tuple[float, ...], str] = {}
    places: dict[str, tuple[float, ...]] = {}
    seen: dict[tuple[str, str], Array] = {}
    for row in rows:
        xyz = tuple(row.numbers(0, 2, "x, y", METRES).tolist())
        if row.cell(2, "z").lower() != "nan":
            xyz = (*xyz, row.number_at(2, "z", RANGES["height_m"]))
        colrow = row.numbers(3, 5, "col, row", RANGES["col_px"])
        given = row.cells[6] if len(row) > 6 else ""
        key = (row.cell(5, "image"), names.setdefault(xyz, given or f"GCP{len(names) + 1}"))
        project.require_names(key, partial(row.wrong, "name"))
        if given not in ("", key[1]):
            fault = f"{quoted(given)} has the coordinates of {quoted(key[1])}"
            raise row.wrong("name", fault, "must be one name for one point")
        if places.setdefault(key[1], xyz) != xyz:
            fault = f"{quoted(key[1])} has different coordinates"
            raise row.wrong("name", fault, "must be one point for one name")
        if key in seen:
            fault = f"{quoted(key[1])} stands twice in {quoted(key[0])}"
            raise row.wrong("image", fault, "must stand once")
        seen[key] = colrow
    return names, [(image, name, colrow) for (image, name), colrow in seen.items()]
