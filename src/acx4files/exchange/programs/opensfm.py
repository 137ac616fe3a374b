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
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, NoReturn

import numpy as np

from acx4files.exchange import coordinates, safe
from acx4files.exchange.coordinates import FLIP, UNKNOWN, Chosen, stacked, turned
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.lens import OPENSFM as MODELS
from acx4files.exchange.lens import WORST_PX, Lens, Pinhole
from acx4files.exchange.options import (
    Allow,
    BlockOfProject,
    CrsOfProject,
    Option,
    Orientations,
    PixelUmOfProject,
    Source,
)
from acx4files.exchange.project import (
    Control,
    Images,
    InGrid,
    Measured,
    Project,
    Proof,
    first_use,
    flight_of,
    joined,
    naming,
    nowhere,
    require_all_names,
    require_names,
)
from acx4files.exchange.safe import Line, Node, Opened
from acx4files.flight.problems import METRES, RANGES, Range, quoted
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.geodesy import GridSystem, MappingFrame

OPENSFM = "opensfm"
"""Folder of OpenSfM's files in a project of ODM."""

RECONSTRUCTION, TRACKS = "reconstruction.json", "tracks.csv"
CAMERAS = ("camera_models.json", "cameras.json")
"""Cameras before the adjustment, by OpenSfM; cameras after it, by ODM."""

VERSIONS = ("OPENSFM_TRACKS_VERSION_v1", "OPENSFM_TRACKS_VERSION_v2")
"""First lines of tracks.csv; the first version of all had none."""

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


def project(
    source: Path,
    *,
    orientations: str = "initial",
    crs: str | None = None,
) -> Project:
    """Return a project of OpenSfM or ODM.

    Parameters
    ----------
    source : Path
        Its folder, the folder of an ODM project, or one file reconstruction.json or cameras.json.
    orientations : {"initial", "adjusted", "none"}
        Where "adjusted", the flight has the project's coordinate system.
    crs : str, optional
        Of the flight; by default the UTM zone of the project's origin.

    Raises
    ------
    FlightError
        For files that are not those of OpenSfM, or a reconstruction without what is asked for.
    """
    files = _files_of(source)
    root, others = _reconstruction(files)
    if root is None:
        return _cameras_alone(files)
    shots = _shots(root, files.tree("rig_assignments.json"))
    lenses = _lenses(files, root, shots)
    ties = _ties(files, root, shots, lenses)
    named = {"image": shots.names, "camera": shots.heads, "exposure": shots.instances}
    require_all_names({**named, "point": ties.points}, root.source.wrong)
    place = _place_of(files, root, shots, crs)
    listed = [file for file in map(files.maybe, CONTROL) if file is not None]
    marks, control, left_out = Measured(), None, others
    lost: dict[str, int] = {}
    if listed and place is None:
        sentence = f"{listed[0].name}: the reconstruction has no place on the Earth"
        left_out = (sentence, *others)
    elif listed and place is not None:
        marks, control, lost = _marks(listed[0], shots, lenses, place)
        taken = (f"{file.name}: {listed[0].name} is taken" for file in listed[1:])
        left_out = (*taken, *others)
        ties = _renamed(ties, {*marks.points, *control.names})
    T_w_c = Pose(R=shots.T_w_v.R @ FLIP, r=shots.T_w_v.r)
    placed = place is not None and (control is not None or orientations == "adjusted")
    return Project(
        source="OpenSfM",
        sources=files.read.values(),
        lenses=lenses,
        images=Images(
            names=shots.names,
            cameras=shots.heads,
            exposures=shots.instances,
            T_w_c=T_w_c,
        ),
        measured=joined(marks, ties),
        proofs=(
            Proof(whose="the program's own points", measured=ties),
            *_of_control(marks, T_w_c, place),
        ),
        control=control,
        settings=place.settings if place is not None and placed else {},
        in_grid=_in_grid(root, place),
        lost={
            **lost,
            "measured positions: without attitudes they are no trajectory": int(
                np.isfinite(shots.gps).all(axis=1).sum()
            ),
        },
        assumed=(*ASSUMED, *(place.said if place is not None and placed else ())),
        left_out=left_out,
    )


def read(
    source: Annotated[Path, Source],
    *,
    block: BlockOfProject = None,
    crs: CrsOfProject = None,
    orientations: Orientations = "initial",
    pixel_um: PixelUmOfProject = None,
    allow: Allow = WORST_PX,
) -> ImportedFlight:
    """Read a project of OpenSfM, ODM or WebODM: cameras, images, tracks, rigs, control.

    SOURCE is the folder with reconstruction.json and tracks.csv, the folder of an ODM project, or
    one file reconstruction.json, camera_models.json or cameras.json. Where a reconstruction by ODM
    has the axes of UTM, the measured positions tell.

    Examples
    --------
    acx4 import opensfm my_project --out my_flight
    acx4 import opensfm my_project --orientations adjusted --crs EPSG:25833 --out my_flight

    Raises
    ------
    FlightError
        As `project` and `flight_of`.
    """
    return flight_of(
        project(source, orientations=orientations, crs=crs),
        orientations=orientations,
        block=block,
        pixel_um=pixel_um,
        allow=allow,
    )


def _cameras_alone(files: _Files) -> Project:
    """Return the cameras of a project in which nothing is oriented yet."""
    node = files.tree(*CAMERAS)
    if node is None:
        path = str(files.folder / TRACKS)
        wanted = f"needs {RECONSTRUCTION} beside it, which names the cameras of the images"
        raise safe.refusal(path, 1, "file", "alone", wanted)
    return Project(
        source="OpenSfM's cameras",
        sources=files.read.values(),
        lenses={name: _lens(camera) for name, camera in node.items()},
        assumed=ASSUMED[:1],
    )


def _lenses(files: _Files, root: Node, shots: _Shots) -> dict[str, Lens]:
    """Return the cameras, or the heads of rigs, with their places in the rig."""
    models = root.one("cameras")
    mounts = _rig_mounts(root.maybe("rig_cameras") or files.tree("rig_cameras.json"))
    lenses: dict[str, Lens] = {}
    for head, model in dict(zip(shots.heads, shots.models, strict=True)).items():
        lens = _lens(models.one(model))
        lenses[head] = replace(lens, mount=mounts[head]) if head in mounts else lens
    return lenses


def _of_control(marks: Measured, T_w_c: Pose, place: _Place | None) -> tuple[Proof, ...]:
    """Return the proof by control points, in the flight's mapping frame."""
    if place is None or not len(marks.colrow):
        return ()
    whose = "control points, by the adjusted orientations,"
    return (Proof(whose=whose, measured=marks, T_w_c=place.in_frame(T_w_c)),)


def _in_grid(root: Node, place: _Place | None) -> InGrid:
    if place is None:
        fault = "has no measured position: the adjusted orientations are nowhere on the Earth"
        expected = "must have gps_position, with reference_lla"
        return nowhere(root.one("shots").wrong(fault, expected))
    return lambda T: place.frame.pose_to_grid(place.in_frame(T))


def _ties(files: _Files, root: Node, shots: _Shots, lenses: Mapping[str, Lens]) -> Measured:
    """Return the tracks in reconstructed images, with their reconstructed points."""
    known, source = root.maybe("points"), files.maybe(TRACKS)
    x_w = {} if known is None else _points(known)
    if source is None:
        return Measured()
    images, names, points = _tracks(source)
    row_of = {name: row for row, name in enumerate(shots.names)}
    used = np.array([image in row_of for image in images], dtype=bool)
    image_idx = np.array([row_of[image] for image in images if image in row_of], dtype=int)
    tracks, point_idx = first_use([n for n, is_used in zip(names, used, strict=True) if is_used])
    sizes = [(lenses[head].width_px, lenses[head].height_px) for head in shots.heads]
    return Measured(
        points=tuple(tracks),
        x_w=np.array([x_w.get(track, [np.nan] * 3) for track in tracks]).reshape(-1, 3),
        image_idx=image_idx,
        point_idx=point_idx,
        colrow=_colrow(points[used], np.array(sizes)[image_idx]),
    )


def _colrow(points: Array, sizes: Array) -> Array:
    """Return the library's pixels of normalised points in images of sizes, both (n, 2)."""
    return points * sizes.max(axis=1, initial=0)[:, None] + (sizes - 1) / 2


def _renamed(ties: Measured, taken: set[str]) -> Measured:
    """Return tie points, with other names where a control point has the name of any."""
    if not taken.intersection(ties.points):
        return ties
    return replace(ties, points=tuple(f"track {name}" for name in ties.points))


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
        kind = CAMERAS[0] if _is_cameras(source) else RECONSTRUCTION
        return _Files(folder=source.parent, names={kind: source.name} | _none_but(kind))
    for folder in (source, source / OPENSFM):
        known = _Files(folder=folder)
        if any((folder / name).exists() for name in (RECONSTRUCTION, TRACKS, *CAMERAS)):
            return known
    wanted = f"must hold {RECONSTRUCTION}, {TRACKS} or {CAMERAS[0]}, as OpenSfM writes them"
    raise safe.refusal(str(source), 1, "folder", "has no file of OpenSfM", wanted)


def _is_cameras(source: Path) -> bool:
    """Tell whether a file holds cameras and no reconstruction."""
    value = safe.json_tree(safe.read(source)).value
    return isinstance(value, dict) and "shots" not in value


def _none_but(kind: str) -> dict[str, str]:
    """Return the names of absent files for all kinds but one, whose file was given alone."""
    others = {RECONSTRUCTION, TRACKS, *CAMERAS} - {kind}
    return dict.fromkeys(others, "\0")


def _reconstruction(files: _Files) -> tuple[Node | None, tuple[str, ...]]:
    """Return the reconstruction with the most shots, and a sentence on the others."""
    tree = files.tree(RECONSTRUCTION)
    if tree is None:
        return None, ()
    if isinstance(tree.value, dict):
        return tree, ()
    parts = list(tree.each())
    if not parts:
        raise tree.wrong("has no reconstruction", "must have one at least")
    sizes = [len(list(part.one("shots").items())) for part in parts]
    best = int(np.argmax(sizes))
    others = sum(sizes) - sizes[best]
    remarks = (
        f"{len(parts) - 1} more reconstructions with {others} shots: each has a frame of its own",
    )
    return parts[best], remarks if len(parts) > 1 else ()


# shots, rigs, points, tracks


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shots:
    """The shots of a reconstruction, one for each image.

    `instances` and `heads` are the rig instance that took an image, and as which of its cameras;
    its own name and model where there is no rig. `T_w_v` has y down, z ahead; `gps` are measured
    positions in the same frame, m, NaN where none is.
    """

    names: tuple[str, ...]
    models: tuple[str, ...]
    instances: tuple[str, ...]
    heads: tuple[str, ...]
    T_w_v: Pose
    gps: Array


def _shots(root: Node, rigs: Node | None) -> _Shots:
    """Return the shots; `rigs` is rig_assignments.json, for files that say nothing of rigs."""
    shots = list(root.one("shots").items())
    if not shots:
        raise root.one("shots").wrong("has no shot", "must have one at least")
    of_rig = dict(_instances(root)) or (dict(_assigned(rigs)) if rigs is not None else {})
    names = tuple(name for name, _ in shots)
    models = tuple(shot.one("camera").text() for _, shot in shots)
    R_v_w = exp(np.array([shot.one("rotation").numbers(3, allowed=TURN) for _, shot in shots]))
    t = np.array([shot.one("translation").numbers(3, allowed=METRES) for _, shot in shots])
    alone = zip(names, names, models, strict=True)
    rows = {name: of_rig.get(name, (instance, model)) for name, instance, model in alone}
    return _Shots(
        names=names,
        models=models,
        instances=tuple(instance for instance, _ in rows.values()),
        heads=tuple(head for _, head in rows.values()),
        T_w_v=Pose(R=R_v_w, r=t).inverse,
        gps=np.array([_gps(shot) for _, shot in shots]),
    )


def _gps(shot: Node) -> list[float]:
    """Return a measured position; OpenSfM writes a dilution of 999999 where there was none."""
    position, dop = shot.maybe("gps_position"), shot.maybe("gps_dop")
    if position is None or (dop is not None and dop.number() >= 999_999):
        return [np.nan] * 3
    return position.numbers(3, allowed=METRES).tolist()


def _instances(root: Node) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield images with their rig instance and their camera in the rig."""
    rigs = root.maybe("rig_instances")
    for instance, rig in rigs.items() if rigs is not None else ():
        cameras = list(rig.one("rig_camera_ids").items())
        if len(cameras) > 1:
            for image, head in cameras:
                yield image, (instance, head.text())


def _assigned(rigs: Node) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the rows of `_instances` from rig_assignments.json: lists of images and cameras."""
    by_name = isinstance(rigs.value, dict)
    all_rigs = (
        list(rigs.items()) if by_name else [(f"rig {k}", v) for k, v in enumerate(rigs.each())]
    )
    for instance, rig in all_rigs:
        cameras = [(pair.one(0).text(), pair.one(1).text()) for pair in rig.each()]
        for image, head in cameras if len(cameras) > 1 else ():
            yield image, (instance, head)


def _rig_mounts(node: Node | None) -> dict[str, Pose]:
    """Return the mountings of cameras in their rig by their names, the library's axes."""
    if node is None:
        return {}
    poses = {
        name: Pose(
            R=exp(mount.one("rotation").numbers(3, allowed=TURN)),
            r=mount.one("translation").numbers(3, allowed=METRES),
        ).inverse
        for name, mount in node.items()
    }
    return {name: Pose(R=turned(pose.R), r=pose.r @ FLIP) for name, pose in poses.items()}


def _points(node: Node) -> dict[str, list[float]]:
    """Return the coordinates of object points by their names."""
    return {
        name: point.one("coordinates").numbers(3, allowed=METRES).tolist()
        for name, point in node.items()
    }


def _tracks(source: Opened) -> tuple[list[str], list[str], Array]:
    """Return images, tracks and normalised points of tracks.csv, shape (n, 2)."""
    rows = safe.lines(source, separator="\t")
    images, names, points = [], [], []
    for row in rows:
        if row.number == 1 and row.cells[0].startswith("OPENSFM_TRACKS"):
            if row.cells[0] not in VERSIONS:
                raise row.wrong("version", quoted(row.cells[0]), f"must be {' or '.join(VERSIONS)}")
            continue
        images.append(row.cell(0, "image"))
        names.append(row.cell(1, "track"))
        points.append(row.numbers(3, 5, "x, y", NORMALISED))
    return images, names, np.array(points).reshape(-1, 2)


def _lens(node: Node) -> Lens:
    """Return a camera of reconstruction.json, camera_models.json or cameras.json."""
    kind = _kind(node)
    width, height = (int(node.one(key).number(RANGES[f"{key}_px"])) for key in ("width", "height"))
    longer, two = max(width, height), kind in ANISOTROPIC
    focal = ("focal_x", "focal_y") if two else ("focal", "focal")
    fx, fy = (node.one(key).number(FOCAL) for key in focal)
    cx, cy = (_number(node, key) if two else 0.0 for key in ("c_x", "c_y"))
    formula = MODELS[kind]
    return Lens(
        width_px=width,
        height_px=height,
        hole=Pinhole(
            fx=fx * longer,
            fy=fy * longer,
            cx=cx * longer + (width - 1) / 2,
            cy=cy * longer + (height - 1) / 2,
        ),
        distortion=formula.distortion([_number(node, name) for name in formula.names]),
        is_fisheye=formula.is_fisheye,
        wrong=node.wrong,
    )


def _number(node: Node, name: str) -> float:
    child = node.maybe(name)
    return 0.0 if child is None else child.number(COEFFICIENT)


def _kind(node: Node) -> str:
    place = node.maybe("projection_type")
    kind = "perspective" if place is None else place.text()
    if kind in MODELS:
        return kind
    expected = f"must be one of {', '.join(MODELS)}"
    if kind in ("spherical", "equirectangular"):
        expected = "has rays in all directions, and is no camera of a flight"
    raise (place or node).wrong(quoted(kind), expected)


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


def _place_of(files: _Files, root: Node, shots: _Shots, crs: str | None) -> _Place | None:
    """Return where a project is; None without measured positions: then it is nowhere."""
    node = root.maybe("reference_lla") or files.tree("reference_lla.json")
    if node is None or not np.isfinite(shots.gps).any():
        return None
    lon, lat, altitude = (
        node.one(key).number(allowed)
        for key, allowed in (("longitude", LON), ("latitude", LAT), ("altitude", HEIGHT))
    )
    zone, offset = _zone_and_offset(files, lon, lat)
    try:
        utm, flight_frame = (
            MappingFrame(
                grid=GridSystem(crs=code, heights="ellipsoidal"), origin=np.array([lon, lat])
            )
            for code in (zone, crs or zone)
        )
    except ValueError as error:
        raise FlightError([f"--crs:1: crs: {error}; must be projected and in metres"]) from None
    place = _Place(
        frame=flight_frame,
        altitude=altitude,
        offset=offset,
        said=(
            f"positions are of WGS 84, in {flight_frame.grid.crs}; "
            "altitudes are taken as ellipsoidal",
        ),
    )
    return _in_utm_if_better(place, utm, shots)


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


def _in_utm_if_better(place: _Place, utm: MappingFrame, shots: _Shots) -> _Place:
    """Return the place in which the camera centres fit the measured positions."""
    known = np.isfinite(shots.gps).all(axis=1)
    centres, gps = shots.T_w_v.r[known, :2], shots.gps[known]
    grid = utm.to_grid(gps + np.array([0.0, 0.0, place.altitude]))[:, :2] - place.offset
    plain, in_utm = (_rms(centres - positions) for positions in (gps[:, :2], grid))
    size = _rms(gps[:, :2] - gps[:, :2].mean(axis=0))
    if known.sum() < 3 or BETTER * in_utm > plain or in_utm > size:
        return place
    sentence = (
        f"orientations and points have the axes of UTM, as ODM writes them: camera centres are "
        f"{in_utm:.2g} m rms from the measured positions so, {plain:.2g} m in topocentric axes"
    )
    return replace(place, utm=utm, said=(*place.said, sentence))


def _rms(off: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


# control points


def _marks(
    file: Opened, shots: _Shots, lenses: Mapping[str, Lens], place: _Place
) -> tuple[Measured, Control, dict[str, int]]:
    """Return measurements of control points, points with an altitude, and counts of lost ones."""
    size = {
        name: (lenses[head].width_px, lenses[head].height_px)
        for name, head in zip(shots.names, shots.heads, strict=True)
    }
    if file.name.endswith(".json"):
        names, lonlath, marks = _of_json(safe.json_tree(file))
    else:
        names, lonlath, marks = _of_list(file, size, place.frame.grid)
    row_of = {name: row for row, name in enumerate(shots.names)}
    used = [mark for mark in marks if mark[0] in row_of]
    sizes = np.array([size[image] for image, _, _ in used], dtype=float).reshape(-1, 2)
    colrow = _colrow(np.array([xy for _, _, xy in used]).reshape(-1, 2), sizes)
    rows = [
        (row_of[image], name, pixel) for (image, name, _), pixel in zip(used, colrow, strict=True)
    ]
    places = dict(zip(names, place.frame.from_geographic(lonlath), strict=True))
    measured = Measured.of(rows, places)
    has_height = np.isfinite(lonlath[:, 2])
    enh = np.column_stack(
        [place.frame.grid.grid_from_lonlat(lonlath[has_height, :2]), lonlath[has_height, 2]]
    )
    control = Control(
        names=tuple(n for n, has in zip(names, has_height, strict=True) if has), enh=enh
    )
    lost = {
        "control points without an altitude": int((~has_height).sum()),
        "measurements of control points in images that were not oriented": len(marks) - len(used),
    }
    return measured, control, lost


Seen = tuple[str, str, list[float]]
"""Image, point and normalised pixel of a measurement."""


def _of_json(node: Node) -> tuple[list[str], Array, list[Seen]]:
    """Return the names of points with a position, longitude, latitude, altitude, measurements."""
    names: list[str] = []
    places: list[list[float]] = []
    measured: list[Seen] = []
    for point in node.one("points").each():
        name = point.one("id").text()
        if (place := point.maybe("position")) is not None:
            names.append(name)
            places.append(_lonlath(place))
        for observation in point.one("observations").each():
            projection = observation.maybe("projection")
            if projection is not None:
                image = observation.one("shot_id").text()
                measured.append(
                    (image, name, [projection.one(k).number(NORMALISED) for k in (0, 1)])
                )
    return names, np.array(places).reshape(-1, 3), measured


def _of_list(
    file: Opened, size: Mapping[str, tuple[int, int]], grid: GridSystem
) -> tuple[list[str], Array, list[Seen]]:
    """Return what `_of_json` does, from ODM's list, whose coordinates are the flight's grid's."""
    listed = _list(file, grid.crs)
    ellipsoidal = GridSystem(crs=grid.crs, heights="ellipsoidal")
    known = np.isfinite(listed.enh[:, 2])
    names = [name for name, has in zip(listed.names.values(), known, strict=True) if has]
    enh = listed.enh[known]
    lonlath = np.column_stack([ellipsoidal.lonlat_from_grid(enh[:, :2]), enh[:, 2]])
    marks = [
        (
            mark.image,
            listed.names[mark.xyz],
            _normalised(np.array(mark.colrow), size.get(mark.image)),
        )
        for mark in listed.seen
    ]
    return names, lonlath, marks


def _normalised(colrow: Array, size: tuple[int, int] | None) -> list[float]:
    width, height = size or (1, 1)
    return ((colrow - [(width - 1) / 2, (height - 1) / 2]) / max(width, height)).tolist()


def _lonlath(node: Node) -> list[float]:
    height = node.maybe("altitude")
    return [
        node.one("longitude").number(LON),
        node.one("latitude").number(LAT),
        np.nan if height is None else height.number(HEIGHT),
    ]


# --- ODM's gcp_list.txt: surveyed points and where they are in the pictures
#
# https://docs.opendronemap.org/gcp/: the first line is the CRS; then x y z col row image [name].


UTM = re.compile(r"WGS\s?84\s+UTM\s+(\d{1,2})\s*([NS]?)", re.ASCII | re.I)

_EXPECTED = "must be WGS84 UTM 17N, EPSG:n, WGS84, or a PROJ string"


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """A line of the list: two coordinates where the height is not known, maybe no name."""

    line: Line
    name: str
    xyz: tuple[float, ...]
    colrow: tuple[float, ...]
    image: str


@dataclass(frozen=True, kw_only=True, eq=False)
class _List:
    """The lines, names by coordinates, and these in the flight's system, NaN without a height."""

    seen: list[_Seen]
    names: dict[tuple[float, ...], str]
    enh: Array
    system: Chosen


def read_control(
    source: Annotated[Path, Source],
    *,
    block: BlockOfProject = None,
    crs: CrsOfProject = None,
    camera: Annotated[
        str | None, Option("NAME", "Camera of all pictures: then images.csv is written, too.")
    ] = None,
) -> ImportedFlight:
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
        As `control` and `flight_of`.
    """
    return flight_of(control(source, crs=crs, camera=camera), block=block or "calibration")


def control(source: Path, *, crs: str | None = None, camera: str | None = None) -> Project:
    """Return the points of gcp_list.txt and their measurements.

    Parameters
    ----------
    source : Path
    crs : str, optional
        Of the flight; by default the file's own, or the UTM zone for longitudes and latitudes.
    camera : str, optional
        Name of the camera of all images: then there are images, too.

    Raises
    ------
    FlightError
        For another layout, or one name for two points.
    """
    file = safe.read(source)
    listed = _list(file, crs)
    known = np.isfinite(listed.enh[:, 2])
    high, flat = (
        tuple(name for name, has in zip(listed.names.values(), mask, strict=True) if has)
        for mask in (known, ~known)
    )
    images, image_idx = first_use([mark.image for mark in listed.seen])
    pairs = zip(image_idx, listed.seen, strict=True)
    return Project(
        source="ODM's control points",
        sources=[file],
        images=Images(
            names=tuple(images),
            cameras=(camera or "",) * len(images),
            exposures=tuple(images),
            T_w_c=stacked([UNKNOWN] * len(images)),
        ),
        measured=Measured.of([(k, listed.names[mark.xyz], mark.colrow) for k, mark in pairs]),
        control=Control(names=high, enh=listed.enh[known]),
        settings=listed.system.settings,
        lost={f"points without a height: {', '.join(flat[:5])}": len(flat)},
        assumed=(
            *listed.system.assumed,
            "pixel 0, 0 is the centre of the top-left one, rows grow down",
        ),
    )


def _list(file: Opened, crs: str | None) -> _List:
    first, *rows = [*safe.lines(file, comment="#")] or [_blank(file)]
    marks = [_seen(row) for row in rows]
    if not marks:
        raise first.wrong("file", "has no point after the CRS", "must have one at least")
    names = _names(marks)
    _require_once(marks, names)
    xyz = np.array([(*place, np.nan)[:3] for place in names])
    system = _chosen(first, file, xyz, crs)
    try:
        enh = system.from_source(xyz)
    except ValueError as error:
        raise first.wrong("CRS", str(error), "must lead to the flight's CRS") from None
    return _List(seen=marks, names=names, enh=enh, system=system)


def crs_of(text: str) -> str:
    """Return the CRS of a first line: a UTM zone of WGS 84, WGS 84 alone, a code, a PROJ string."""
    text = text.strip().strip("'\"")
    zone = UTM.fullmatch(text)
    if zone and 1 <= int(zone[1]) <= 60:
        return f"EPSG:{(32700 if zone[2].upper() == 'S' else 32600) + int(zone[1])}"
    return "EPSG:4326" if re.fullmatch(r"WGS\s?84", text, re.I) else text


def _blank(file: Opened) -> NoReturn:
    raise file.wrong("file", "has no line but remarks", _EXPECTED)


def _chosen(first: Line, file: Opened, xyz: Array, crs: str | None) -> Chosen:
    text = file.text().split("\n")[first.number - 1]
    try:
        system = coordinates.chosen(crs_of(text), xyz[:, :2].mean(axis=0), crs)
    except ValueError as error:
        raise first.wrong("CRS", f"{quoted(text.strip())}: {error}", _EXPECTED) from None
    if system is None:
        raise first.wrong("CRS", quoted(text.strip()), _EXPECTED)
    return system


def _seen(row: Line) -> _Seen:
    x, y = (row.number_at(k, name, METRES) for k, name in ((0, "x"), (1, "y")))
    z = float("nan")
    if row.cell(2, "z").lower() != "nan":
        z = row.number_at(2, "z", RANGES["height_m"])
    colrow = tuple(row.number_at(k, name, RANGES["col_px"]) for k, name in ((3, "col"), (4, "row")))
    return _Seen(
        line=row,
        name=row.cells[6] if len(row) > 6 else "",
        xyz=(x, y) if np.isnan(z) else (x, y, z),  # no two NaN are equal
        colrow=colrow,
        image=row.cell(5, "image"),
    )


def _names(marks: list[_Seen]) -> dict[tuple[float, ...], str]:
    """Return names by coordinates; points without one are numbered in the order of the file."""
    names: dict[tuple[float, ...], str] = {}
    for mark in marks:
        name = names.setdefault(mark.xyz, mark.name or f"GCP{len(names) + 1}")
        if mark.name not in ("", name):
            fault = f"{quoted(mark.name)} has the coordinates of {quoted(name)}"
            raise mark.line.wrong("name", fault, "must be one name for one point")
    times = Counter(names.values())
    if len(times) < len(names):
        again = [mark for mark in marks if times[names[mark.xyz]] > 1]
        fault = f"{quoted(names[again[0].xyz])} has different coordinates"
        raise again[-1].line.wrong("name", fault, "must be one point for one name")
    return names


def _require_once(marks: list[_Seen], names: dict[tuple[float, ...], str]) -> None:
    before: set[tuple[str, str]] = set()
    for mark in marks:
        key = (mark.image, names[mark.xyz])
        if key in before:
            fault = f"{quoted(key[1])} stands twice in {quoted(key[0])}"
            raise mark.line.wrong("image", fault, "must stand once")
        before.add(key)
        require_names(key, naming(partial(mark.line.wrong, "name")))
