"""OPF, Pix4D's open photogrammetry format, version 1: sensors, rigs, images, marks, tie points.

Specification: https://pix4d.github.io/opf-spec. Perspective internals are OpenCV's model with R1,
R2, R3 for k1, k2, k3 and T1, T2 for p1, p2. In a fisheye the angle from the axis counts in right
angles, t = 2/pi * angle; a point lies in its direction at the distance p0 + p1 t + p2 t² + ..., and
the affine matrix (c d; e f) takes it to pixels. Pixels count from the outer corner of the top-left
one. Every place has a coordinate system of its own, whose order of axes its coordinates follow.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from acx4files.exchange import coordinates, safe
from acx4files.exchange.coordinates import FLIP, TOP_AHEAD, UNKNOWN, Chosen, stacked, turned
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.lens import OPF as PERSPECTIVE
from acx4files.exchange.lens import WORST_PX, Lens, Pinhole, fisheye
from acx4files.exchange.options import (
    Allow,
    BlockOfProject,
    CrsOfProject,
    HeightsOfFlight,
    Orientations,
    PixelUmOfProject,
    Source,
)
from acx4files.exchange.project import (
    DEGREES,
    Control,
    Images,
    InGrid,
    Measured,
    Project,
    Proof,
    Trajectory,
    flight_of,
    joined,
    nowhere,
    require_names,
    trajectory_in_grid,
    without_doubles,
)
from acx4files.exchange.safe import Node, Opened, refusal
from acx4files.flight.problems import METRES, PIXELS, RANGES, Range, quoted
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem, mean_origin

BEGIN, END = "application/opf-", "+json"
"""Prefix and suffix of the names of JSON formats."""

PROJECT = "project"

READ = (
    "camera-list",
    "input-cameras",
    "calibrated-cameras",
    "input-control-points",
    "calibrated-control-points",
    "scene-reference-frame",
    "gps-bias",
)
"""Names of the formats that are read."""

CALIBRATION, GLTF = "calibration", "model/gltf+json"
"""Type of the item, and format of its file, that has the tie points."""

MAJOR = "1"
"""Major version that is read."""


TYPES = ("perspective", "fisheye")
"""Types of internals that are read."""

POSITIVE = Range(1e-9, 1e9, "must be positive")

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in OPF."""

ASSUMED = (
    "Pixels: OPF counts from the outer corner of the top-left one, so 0.5 is taken off",
    "The body's x axis is towards the top of the reference camera's images",
    "Rig relatives are Rx Ry Rz from the camera to the reference camera, x right, y down, z ahead",
)

ANGLES = (
    "Yaw, pitch, roll are zero for a camera that looks down with the top of its image to the "
    "north: yaw clockwise, pitch positive with the top up, roll with the right side down"
)


def project(
    source: Path,
    *,
    orientations: str = "initial",
    crs: str | None = None,
    heights: str | float | None = None,
) -> Project:
    """Return a project.

    Parameters
    ----------
    source : Path
        A file .opf, or a folder with it or with the JSON files of OPF.
    orientations : {"initial", "adjusted", "none"}
        "initial" is what was measured of captures, "adjusted" the calibrated cameras.
    crs : str, optional
        The flight's projected CRS; by default that of the scene, or the UTM zone of a place.
    heights : str or float, optional
        As the key of flight.toml; by default those of the control points, else of the captures.

    Raises
    ------
    FlightError
        Where the files are no project of OPF, or something in them cannot be.
    """
    documents = _documents_of(source)
    sensors = _sensors(documents)
    shots = _shots(documents, sensors)
    listed = documents.by_format.get("input-control-points")
    gcps = {} if listed is None else _surveyed(listed)
    system = _system(documents, _captured(shots), [place for place, _ in gcps.values()], crs)
    if system is not None and heights is not None:
        system = _with_heights(system, heights)
    poses = _calibrated(documents)
    rows = {shot.number: k for k, shot in enumerate(shots)}
    marks, lost_marks = _marks(documents, rows)
    ties, lost_ties = Measured(), 0
    if documents.tracks is not None:
        ties, lost_ties = _ties(documents.tracks, rows)
    control, strange = _control(gcps, system)
    bias = documents.by_format.get("gps-bias") is not None
    others = ", ".join(dict.fromkeys(documents.others))
    return Project(
        source=documents.program,
        sources=documents.sources,
        lenses={sensor.name: sensor.lens for sensor in sensors.values()},
        images=Images(
            names=tuple(shot.name for shot in shots),
            cameras=tuple(shot.sensor.name for shot in shots),
            exposures=tuple(shot.exposure for shot in shots),
            T_w_c=stacked([poses.get(shot.number, UNKNOWN) for shot in shots]),
        ),
        measured=joined(marks, ties),
        proofs=(
            Proof(whose="the calibrated control points", measured=marks),
            Proof(whose="the calibrated tie points", measured=ties),
        ),
        control=control,
        settings={"name": documents.name, **(system.settings if system else {})},
        in_grid=_in_grid(documents, system),
        trajectory=_measured(shots, system) if orientations == "initial" else Trajectory(),
        lost={
            "marks in images that are not in the project": lost_marks,
            "measurements of tie points in other images, or second ones in one": lost_ties,
        },
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        left_out=(
            *strange,
            *(("the bias of GPS positions",) if bias else ()),
            *((f"files of formats that are not read: {others}",) if others else ()),
        ),
        may_leave_cameras=True,
    )


def read(
    source: Annotated[Path, Source],
    *,
    block: BlockOfProject = None,
    crs: CrsOfProject = None,
    heights: HeightsOfFlight = None,
    orientations: Orientations = "initial",
    pixel_um: PixelUmOfProject = None,
    allow: Allow = WORST_PX,
) -> ImportedFlight:
    """Read a project in Pix4D's open photogrammetry format (OPF).

    SOURCE is a file .opf, or a folder with it or with JSON files of OPF. Sensors with rig
    relatives, images, tie points, control points with their marks and the measured orientations are
    taken; with --orientations adjusted the trajectory is the calibrated cameras, and then a
    boresight means nothing.

    Examples
    --------
    acx4 import opf project.opf --out my_flight

    Raises
    ------
    FlightError
        As `project` and `flight_of`.
    """
    return flight_of(
        project(source, orientations=orientations, crs=crs, heights=heights),
        orientations=orientations,
        block=block,
        pixel_um=pixel_um,
        allow=allow,
    )


@dataclass(kw_only=True)
class _Documents:
    """The documents of a project: the first of each format of `READ`, the tie points' glTF file.

    `others` are formats that are not read, and second documents.
    """

    name: str
    program: str = "OPF"
    by_format: Mapping[str, Node] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)
    tracks: Node | None = None
    sources: tuple[Opened, ...] = ()


def _documents_of(source: Path) -> _Documents:
    """Return the documents of a file .opf, of a folder, or of one JSON file of OPF."""
    if source.is_dir():
        listed = sorted(source.glob("*.opf"))
        if len(listed) > 1:
            names = ", ".join(path.name for path in listed)
            raise refusal(str(source), 1, "folder", f"has {names}", "name one of them")
        if not listed:
            return _gathered(source)
        source = listed[0]
    root = safe.json_tree(safe.read(source))
    if _format(root) != PROJECT:
        return _documents(source.stem, "OPF", [root])
    return _of_items(source, root)


def _gathered(folder: Path) -> _Documents:
    """Return the documents of a folder without a project."""
    roots = [safe.json_tree(safe.read(path)) for path in sorted(folder.glob("*.json"))]
    roots = [root for root in roots if _format(root, must=False)]
    if not roots:
        fault, expected = "has no file of OPF", "must have project.opf, or JSON files of OPF"
        raise refusal(str(folder), 1, "folder", fault, expected)
    return _documents(folder.resolve().name, "OPF", roots)


def _of_items(path: Path, root: Node) -> _Documents:
    _require_version(root)
    roots: dict[Path, Node] = {}
    others, tracks = [], None
    for kind, resource in _resources(root):
        name = resource.one("format").text()
        if kind == CALIBRATION and name == GLTF and tracks is None:
            place = _inside(resource.one("uri"), path.parent)
            if place.exists():
                tracks = safe.json_tree(safe.read(place))
                continue
        if name.removeprefix(BEGIN).removesuffix(END) not in READ:
            others.append(name)
            continue
        place = _inside(resource.one("uri"), path.parent)
        if place not in roots:
            roots[place] = safe.json_tree(safe.read(place))
    generator = root.maybe("generator")
    program = "OPF"
    if generator is not None:
        parts = (generator.maybe("name"), generator.maybe("version"))
        program = " ".join(["OPF of", *(part.text() for part in parts if part is not None)])
    title = root.maybe("name")
    if not roots:
        known = ", ".join(READ)
        raise root.one("items").wrong("has no file that is read", f"must have some of {known}")
    name = path.stem if title is None else title.text()
    documents = _documents(name, program, [*roots.values()])
    documents.others += others
    documents.tracks = tracks
    documents.sources = (
        root.source,
        *documents.sources,
        *(() if tracks is None else (tracks.source,)),
    )
    return documents


def _resources(root: Node) -> Iterator[tuple[str, Node]]:
    """Yield the files of a project, with the type of the item that they belong to."""
    for item in root.one("items").each():
        for resource in item.one("resources").each():
            yield item.one("type").text(), resource


def _documents(name: str, program: str, roots: list[Node]) -> _Documents:
    documents: dict[str, Node] = {}
    others = []
    for root in roots:
        _require_version(root)
        kind = _format(root)
        if kind in READ and kind not in documents:
            documents[kind] = root
        else:
            others.append(kind if kind not in READ else f"a second {kind}")
    if not documents:
        fault = f"{quoted(others[0])} is none that is read"
        raise roots[0].one("format").wrong(fault, f"must be one of {', '.join(READ)}")
    return _Documents(
        name=name,
        program=program,
        by_format=documents,
        others=others,
        sources=tuple(root.source for root in documents.values()),
    )


def _format(root: Node, *, must: bool = True) -> str:
    """Return the name of a document's format; empty where it has none and need not."""
    text = root.maybe("format")
    if text is not None and isinstance(text.value, str) and text.value.startswith(BEGIN):
        return text.value.removeprefix(BEGIN).removesuffix(END)
    if not must:
        return ""
    fault = "is missing" if text is None else quoted(text.value)
    raise (text or root).wrong(f"format {fault}", f"must begin with {BEGIN}")


def _require_version(root: Node) -> None:
    version = root.one("version")
    if version.text().split(".")[0] != MAJOR:
        raise version.wrong(quoted(version.text()), f"must be version {MAJOR}")


def _inside(uri: Node, folder: Path) -> Path:
    """Return the path of a file in a project; it must lie below the project's folder."""
    text = unquote(uri.text())
    parts = PurePosixPath(text.replace("\\", "/"))
    if parts.is_absolute() or ".." in parts.parts or ":" in text or "\0" in text:
        raise uri.wrong(quoted(text), "must lie below the project's folder")
    return folder / parts


# sensors


@dataclass(frozen=True, kw_only=True)
class _Sensor:
    """A sensor: its name and its lens."""

    name: str
    lens: Lens


def _sensors(project: _Documents) -> dict[str, _Sensor]:
    """Return the sensors by their numbers, with adjusted internals where there are any."""
    declared = project.by_format.get("input-cameras")
    if declared is None:
        source = project.sources[0]
        missing = "the project has no input-cameras"
        raise source.wrong("file", missing, "required: the sizes of images are there")
    nodes = {sensor.one("id").text(): sensor for sensor in declared.one("sensors").each()}
    calibrated = project.by_format.get("calibrated-cameras")
    after: dict[str, Node] = {}
    if calibrated is not None:
        after = {sensor.one("id").text(): sensor for sensor in calibrated.one("sensors").each()}
    ids = list(nodes)
    names, _ = without_doubles(_sensor_labels(nodes), ids)
    places = dict(zip(names, nodes.values(), strict=True))
    require_names(names, lambda name, fault, expected: places[name].wrong(fault, expected))
    return {i: _sensor(name, nodes[i], after.get(i)) for i, name in zip(ids, names, strict=True)}


def _sensor_labels(nodes: Mapping[str, Node]) -> list[str]:
    """Return the names of sensors, with their bands where several have one name."""
    labels = {}
    for i, node in nodes.items():
        name = node.maybe("name")
        labels[i] = i if name is None or not name.text().strip() else name.text().strip()
    often = Counter(labels.values())
    return [f"{name} {_bands(nodes[i])}" if often[name] > 1 else name for i, name in labels.items()]


def _bands(node: Node) -> str:
    bands = node.maybe("bands")
    listed = [band.maybe("name") for band in bands.each()] if bands is not None else []
    return "+".join(band.text() for band in listed if band is not None)


def _sensor(name: str, declared: Node, after: Node | None) -> _Sensor:
    source = declared if after is None else after
    width, height = (declared.one("image_size_px").numbers(2)).tolist()
    for side in (width, height):
        if side not in PIXELS:
            raise declared.one("image_size_px").wrong(f"{side:g}", str(PIXELS))
    pixel = declared.maybe("pixel_size_um")
    lens = _lens(source.one("internals"), int(width), int(height))
    return _Sensor(
        name=name,
        lens=replace(
            lens,
            pixel_um=0.0 if pixel is None else pixel.number(RANGES["pixel_um"]),
            mount=_mount(source.maybe("rig_relatives") or declared.maybe("rig_relatives")),
            kind="initial" if after is None else "adjusted",
            remark=_sigma(name, declared.maybe("rig_relatives")),
        ),
    )


def _mount(relatives: Node | None) -> Pose:
    """Return T_b_c from rig relatives, which are input's or calibrated ones."""
    if relatives is None:
        return Pose(R=TOP_AHEAD, r=np.zeros(3))
    shift, turn = relatives.one("translation"), relatives.maybe("rotation")
    if turn is None:
        r, angles = shift.numbers(3), relatives.one("rotation_angles_deg").numbers(3)
    else:
        r, angles = shift.one("values_m").numbers(3), turn.one("angles_deg").numbers(3)
    R_rel = rotation_from_opk(np.radians(angles)[None])[0]  # Rx Ry Rz, as there
    return Pose(R=TOP_AHEAD @ turned(R_rel), r=TOP_AHEAD @ FLIP @ r)


def _sigma(name: str, relatives: Node | None) -> str:
    if relatives is None or relatives.maybe("rotation") is None:
        return ""
    turn = relatives.maybe("rotation", "sigmas_deg")
    shift = relatives.maybe("translation", "sigmas_m")
    if turn is None or shift is None:
        return ""
    degrees = ", ".join(f"{value:g}" for value in turn.numbers(3))
    metres = ", ".join(f"{value:g}" for value in shift.numbers(3))
    return (
        f"place of {name} in the rig before the adjustment, sigma: {degrees} degrees and {metres} m"
    )


def _lens(node: Node, width: int, height: int) -> Lens:
    """Return the lens that a node ``internals`` describes, of an image of a size."""
    kind = node.one("type").text()
    if kind not in TYPES:
        raise node.one("type").wrong(quoted(kind), f"must be one of {', '.join(TYPES)}")
    cx, cy = (node.one("principal_point_px").numbers(2) - HALF).tolist()
    if kind == "fisheye":
        return _fisheye(node, width, height, (cx, cy))
    f = node.one("focal_length_px").number(POSITIVE)
    values = [*_floats(node, "radial_distortion", 3), *_floats(node, "tangential_distortion", 2)]
    return Lens(
        width_px=width,
        height_px=height,
        hole=Pinhole(fx=f, fy=f, cx=cx, cy=cy),
        distortion=PERSPECTIVE.distortion(values),
        wrong=node.wrong,
    )


def _fisheye(node: Node, width: int, height: int, centre: tuple[float, float]) -> Lens:
    c, d, e, f = _floats(node, "affine", 4)
    p = _floats(node, "polynomial", -1)
    if len(p) < 2 or p[0] != 0 or p[1] <= 0:
        values = quoted(list(p))
        raise node.one("polynomial").wrong(values, "must be 0, a positive number, and others")
    if c <= 0 or f <= 0 or c * f - d * e <= 0:
        values = quoted([c, d, e, f])
        raise node.one("affine").wrong(values, "must be c d; e f with positive c and f")
    return fisheye(p, (c, d, e, f), centre, size=(width, height), wrong=node.wrong)


def _floats(node: Node, key: str, n: int) -> list[float]:
    return node.one(key).numbers(n).tolist()


# images


@dataclass(frozen=True, kw_only=True)
class _Shot:
    """An image; that of a reference camera has its `capture`, with measured place and angles."""

    number: str
    name: str
    exposure: str
    sensor: _Sensor
    capture: Node | None


def _shots(project: _Documents, sensors: Mapping[str, _Sensor]) -> list[_Shot]:
    """Return the images of the captures, or else of the calibrated cameras."""
    captures = list(project.by_format["input-cameras"].one("captures").each())
    pairs: list[tuple[Node, Node | None]] = [
        (camera, capture) for capture in captures for camera in capture.one("cameras").each()
    ]
    after = project.by_format.get("calibrated-cameras")
    if not pairs and after is not None:
        pairs = [(camera, None) for camera in after.one("cameras").each()]
    numbers = [camera.one("id").text() for camera, _ in pairs]
    labels = _labels(project)
    names, _ = without_doubles([labels.get(i, i) for i in numbers], numbers)
    places_of = {name: camera for name, (camera, _) in zip(names, pairs, strict=True)}
    require_names(names, lambda name, fault, wanted: places_of[name].wrong(fault, wanted))
    named = dict(zip(numbers, names, strict=True))
    if len(named) < len(numbers):
        times = Counter(numbers)
        again = next(camera for camera, _ in pairs if times[camera.one("id").text()] > 1)
        raise again.one("id").wrong("is there twice", "must be unique")
    return [_shot(camera, capture, named, sensors) for camera, capture in pairs]


def _shot(
    camera: Node, capture: Node | None, named: Mapping[str, str], sensors: Mapping[str, _Sensor]
) -> _Shot:
    number, sensor = camera.one("id").text(), camera.one("sensor_id")
    if sensor.text() not in sensors:
        raise sensor.wrong(quoted(sensor.text()), "must be the id of a sensor")
    leader = number if capture is None else capture.one("reference_camera_id").text()
    if capture is not None and leader not in named:
        raise capture.one("reference_camera_id").wrong(quoted(leader), "must be a camera's id")
    return _Shot(
        number=number,
        name=named[number],
        exposure=named[leader],
        sensor=sensors[sensor.text()],
        capture=capture if number == leader else None,
    )


def _labels(project: _Documents) -> dict[str, str]:
    """Return the names of images by camera numbers: the last part of their addresses."""
    listed = project.by_format.get("camera-list")
    if listed is None:
        return {}
    return {
        camera.one("id").text(): camera.one("uri").text().replace("\\", "/").rpartition("/")[2]
        for camera in listed.one("cameras").each()
    }


def _captured(shots: list[_Shot]) -> list[_Place]:
    """Return the place of the first capture with a place, in a list; else an empty list."""
    for shot in shots:
        if shot.capture is not None and (node := shot.capture.maybe("geolocation")) is not None:
            return [_place(node)]
    return []


def _calibrated(project: _Documents) -> dict[str, Pose]:
    """Return the poses of calibrated cameras in the processing system, by camera numbers."""
    document = project.by_format.get("calibrated-cameras")
    if document is None:
        return {}
    poses = {}
    for camera in document.one("cameras").each():
        opk = np.radians(camera.one("orientation_deg").numbers(3))
        poses[camera.one("id").text()] = Pose(
            R=rotation_from_opk(opk[None])[0], r=camera.one("position").numbers(3, allowed=METRES)
        )
    return poses


def _in_grid(project: _Documents, system: Chosen | None) -> InGrid:
    """Return how the processing system lies in the flight's grid."""
    frame = project.by_format.get("scene-reference-frame")
    if frame is None or system is None:
        root = frame or project.by_format["input-cameras"]
        expected = "adjusted orientations need one"
        return nowhere(root.wrong("has no coordinate system on the Earth", expected))
    node = frame.one("crs", "definition")

    def in_grid(T: Pose) -> tuple[Array, Array]:
        try:
            source = coordinates.parsed(node.text())
            if not source.is_projected:
                raise node.wrong(quoted(source.name), "must be projected for adjusted orientations")
            enh = replace(system, source=source).from_source(_base(frame, T.r))
            enh = coordinates.with_heights(system, enh, coordinates.heights_of(source))
        except ValueError as error:
            raise node.wrong(" ".join(str(error).split()), "must be convertible") from None
        return enh, T.opk

    return in_grid


def _base(frame: Node, xyz: Array) -> Array:
    """Return positions of the processing system in the scene's own, east first."""
    turn = frame.one("base_to_canonical")
    scale, shift = turn.one("scale").numbers(3), turn.one("shift").numbers(3)
    if (scale == 0).any():
        raise turn.one("scale").wrong("has a zero", "must be three numbers that are not zero")
    # scaled, swapped, then shifted; what is swapped is swapped once more by its order of axes
    return np.asarray((xyz - shift) / (scale[[1, 0, 2]] if _swaps(turn) else scale))


def _swaps(turn: Node) -> bool:
    swap = turn.maybe("swap_xy")
    return swap is not None and swap.value is True


def _measured(shots: list[_Shot], system: Chosen | None) -> Trajectory:
    """Return the trajectory by the measured places and angles of captures."""
    rows = [
        (shot, shot.capture.one("geolocation"), shot.capture.one("orientation"))
        for shot in shots
        if shot.capture is not None
        and shot.capture.maybe("geolocation") is not None
        and shot.capture.maybe("orientation") is not None
    ]
    if not rows or system is None:
        return Trajectory(left_out=("a trajectory: no capture has position and angles",))
    names = [shot.exposure for shot, _, _ in rows]
    spots = [_place(place_node) for _, place_node, _ in rows]
    try:
        enh = np.stack([_enh(system, spot) for spot in spots])
    except FlightError as error:
        return Trajectory(left_out=(f"the measured orientations: {error.problems[0]}",))
    opk, sigma = zip(
        *(
            _attitude(angles_node, place, system)
            for (_, _, angles_node), place in zip(rows, enh, strict=True)
        ),
        strict=True,
    )
    table: dict[str, object] = {
        **dict(trajectory_in_grid(names, enh, np.stack(opk))),
        **_sigmas(("east_m", "north_m", "height_m"), np.stack([spot.sigma for spot in spots])),
        **_sigmas(("roll_deg", "pitch_deg", "heading_deg"), np.stack(sigma)),
    }
    return Trajectory(table=table, assumed=(ANGLES,))


def _sigmas(names: tuple[str, str, str], values: Array) -> Mapping[str, list[float]]:
    """Return the columns of standard deviations; none where one is not known."""
    if not (values > 0).all():
        return {}
    pairs = zip(names, np.round(values, DEGREES).T.tolist(), strict=True)
    return {f"sigma_{name}": column for name, column in pairs}


def _attitude(node: Node, enh: Array, system: Chosen) -> tuple[Array, Array]:
    """Return a body's omega, phi, kappa against the grid, rad, and sigma of its axes, degrees."""
    kind = node.one("type").text()
    angles = np.radians(node.one("angles_deg").numbers(3))
    sigmas = node.maybe("sigmas_deg")
    sigma = np.zeros(3) if sigmas is None else np.maximum(sigmas.numbers(3), 0.0)
    grid = coordinates.grid_of(system.crs)
    lonlat = grid.lonlat_from_grid(enh[None, :2])
    if kind == "yaw_pitch_roll":
        frame = mean_origin(grid, lonlat)
        lonlath = np.append(lonlat, [[enh[2]]], axis=1)
        T_b = frame.pose_from_geographic(lonlath, angles[None, [2, 1, 0]])
        return frame.pose_to_grid(T_b)[1][0], sigma[[2, 1, 0]]
    if kind != "omega_phi_kappa":
        expected = "must be yaw_pitch_roll or omega_phi_kappa"
        raise node.one("type").wrong(quoted(kind), expected)
    R_g_b = rotation_from_opk(angles[None])[0] @ TOP_AHEAD.T
    turned = _meridians(node.one("crs"), lonlat, grid) @ R_g_b
    return opk_from_rotation(turned[None])[0], sigma[[1, 0, 2]]


def _meridians(node: Node, lonlat: Array, grid: GridSystem) -> Array:
    """Return the rotation from the axes of another grid to those of the flight's at a place."""
    try:
        other = coordinates.grid_of(node.text())
    except ValueError as error:
        raise node.wrong(str(error), "must be a projected coordinate system") from None
    here, there = (system.convergence(lonlat)[0] for system in (grid, other))
    if not np.isfinite([here, there]).all():
        raise node.wrong(f"{node.text()} is not defined there", "must be that of the place")
    c, s = np.cos(here - there), np.sin(here - there)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


# places


@dataclass(frozen=True, kw_only=True, eq=False)
class _Place:
    """A node ``geolocation``: east or longitude first, sigma 0 where it is not given.

    `text` is the definition of its coordinate system, `heights` as the key of flight.toml.
    """

    node: Node
    xyh: Array
    sigma: Array
    text: str
    heights: str | float


def _place(node: Node) -> _Place:
    """Return the place in a node ``geolocation``."""
    definition = node.one("crs", "definition")
    text = definition.text()
    try:
        system = coordinates.parsed(text)
        swap = coordinates.is_north_first(system)
    except ValueError as error:
        raise definition.wrong(str(error), "must be a coordinate system") from None
    order = [1, 0, 2] if swap else [0, 1, 2]
    sigma = node.maybe("sigmas")
    undulation = node.maybe("crs", "geoid_height")
    return _Place(
        node=node,
        xyh=node.one("coordinates").numbers(3, allowed=METRES)[order],
        sigma=np.zeros(3) if sigma is None else np.maximum(sigma.numbers(3), 0.0)[order],
        text=text,
        heights=coordinates.heights_of(system) if undulation is None else undulation.number(),
    )


def _system(
    project: _Documents, captured: list[_Place], surveyed: list[_Place], wanted: str | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where the project has none on the Earth.

    It is that of the scene reference frame where this is projected, else the UTM zone of the first
    place; heights are those of the control points, else of the captures.
    """
    frame = project.by_format.get("scene-reference-frame")
    nodes: list[tuple[Node, Array | None]] = []
    if frame is not None:
        nodes.append((frame.one("crs", "definition"), None))
    nodes += [
        (place.node.one("crs", "definition"), place.xyh[:2]) for place in (*captured, *surveyed)
    ]
    system, fault = None, None
    for node, xy in nodes:
        try:
            system = coordinates.chosen(node.text(), xy, wanted)
        except ValueError as error:
            fault = fault or node.wrong(str(error), "must be one that a flight can have")
        if system is not None:
            break
    if system is None and fault is not None:
        raise fault
    places = (*surveyed, *captured)
    return system if system is None or not places else _with_heights(system, places[0].heights)


def _with_heights(system: Chosen, heights: str | float) -> Chosen:
    """Return a system with other heights, and with the sentence on them."""
    phrase = "above the ellipsoid" if heights == "ellipsoidal" else f"of {heights}"
    if isinstance(heights, float):
        phrase = f"{heights:g} m less than above the ellipsoid"
    return replace(system, heights=heights, assumed=(*system.assumed[:1], f"Heights are {phrase}"))


def _enh(system: Chosen, place: _Place) -> Array:
    """Return east, north, height of a place in the flight's system, shape (3,)."""
    try:
        of_place = replace(system, source=coordinates.parsed(place.text))
        enh = of_place.from_source(place.xyh[None])
        enh = coordinates.with_heights(system, enh, place.heights)
    except ValueError as error:
        message = " ".join(str(error).split()).split(" (Error")[0]
        raise place.node.wrong(message, "must be convertible into the flight's system") from None
    if not np.isfinite(enh).all():
        raise place.node.wrong("lies outside the flight's system", "must lie inside")
    return np.asarray(enh[0])


def _surveyed(control: Node) -> dict[str, tuple[_Place, bool]]:
    """Return the places of control points, and whether they are check points."""
    places: dict[str, tuple[_Place, bool]] = {}
    for gcp in control.one("gcps").each():
        name = gcp.one("id").text()
        if name in places:
            raise gcp.one("id").wrong(f"{quoted(name)} is there twice", "must be unique")
        require_names([name], lambda _, fault, wanted: gcp.one("id").wrong(fault, wanted))  # noqa: B023 called at once
        check = gcp.maybe("is_checkpoint")
        is_check = check is not None and check.value is True
        places[name] = (_place(gcp.one("geolocation")), is_check)
    return places


def _control(
    gcps: Mapping[str, tuple[_Place, bool]], system: Chosen | None
) -> tuple[Control | None, tuple[str, ...]]:
    """Return the control points, and sentences on those that are left out."""
    if system is None:
        return None, (f"{len(gcps)} control points: no system on the Earth",) * bool(gcps)
    enh: dict[str, Array] = {}
    strange = []
    for name, (spot, _) in gcps.items():
        try:
            enh[name] = _enh(system, spot)
        except FlightError as error:
            strange.append(f"control point {name}: {error.problems[0]}")
    if not enh:
        return None, tuple(strange)
    control = Control(
        names=tuple(enh),
        enh=np.stack(list(enh.values())),
        sigma=np.stack([gcps[name][0].sigma for name in enh]),
        is_check=tuple(gcps[name][1] for name in enh),
    )
    return control, tuple(strange)


# measurements


def _marks(project: _Documents, rows: Mapping[str, int]) -> tuple[Measured, int]:
    """Return the marks of control points and of manual tie points, and how many lie elsewhere."""
    control = project.by_format.get("input-control-points")
    if control is None:
        return Measured(), 0
    marks: list[tuple[int, str, Array]] = []
    lost = 0
    for kind in ("gcps", "mtps"):
        listed = control.maybe(kind)
        for point in listed.each() if listed is not None else ():
            of_point = _marks_of(point)
            marks += [(rows[n], name, colrow) for n, name, colrow in of_point if n in rows]
            lost += sum(n not in rows for n, _, _ in of_point)
    return Measured.of(marks, _calibrated_points(project)), lost


def _marks_of(point: Node) -> list[tuple[str, str, Array]]:
    """Return the camera's number, the point and the pixel of a point's marks."""
    name, marks = point.one("id"), []
    require_names([name.text()], lambda _, fault, wanted: name.wrong(fault, wanted))
    seen = set()
    for mark in point.one("marks").each():
        number, position = mark.one("camera_id").text(), mark.one("position_px")
        if number in seen:
            raise mark.wrong(f"{name.text()} is twice in one camera", "must be there once")
        seen.add(number)
        colrow = position.numbers(2) - HALF
        if np.abs(colrow).max() > RANGES["col_px"].high:
            raise position.wrong("is too large", str(RANGES["col_px"]))
        marks.append((number, name.text(), colrow))
    return marks


def _calibrated_points(project: _Documents) -> dict[str, Array]:
    document = project.by_format.get("calibrated-control-points")
    if document is None:
        return {}
    return {
        point.one("id").text(): point.one("coordinates").numbers(3, allowed=METRES)
        for point in document.one("points").each()
    }


# tie points: a glTF file with its buffers, and matches as an extension. A point has a range of
# matches: its first one in 40 bits, their number in 24 bits behind that. The node's matrix takes
# positions to glTF's axes, whose y is up; in the processing system z is.

MATCHES = "OPF_mesh_primitive_matches"
"""Extension of a mesh that has the measurements of its points."""

COMPONENTS = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Numbers of glTF for types."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From glTF's axes, y up, to those with z up."""

COUNT_BITS = 40
"""Number of low bits of a range, below those with the number of its matches."""


@dataclass(kw_only=True, eq=False)
class _Scene:
    """A glTF file, and the buffers that were read."""

    root: Node
    buffers: dict[str, bytes] = field(default_factory=dict)

    def array(self, accessor: Node, *, width: int, kind: str) -> NDArray[Any]:
        """Return the values of an accessor, shape (n, width), of a kind of NumPy: "f" or "u"."""
        node = self.root.one("accessors", accessor.whole())
        layout = COMPONENTS.get(node.one("componentType").whole(), "")
        if WIDTHS.get(node.one("type").text()) != width or layout[1:2] != kind:
            raise node.wrong(quoted(node.value), f"must be {width} values of kind {kind!r}")
        view = self.root.one("bufferViews", node.one("bufferView").whole())
        data = self._buffer(self.root.one("buffers", view.one("buffer").whole()).one("uri"))
        first = view.maybe("byteOffset")
        begin, n = 0 if first is None else first.whole(), node.one("count").whole()
        size = n * width * np.dtype(layout).itemsize
        if begin < 0 or n < 0 or begin + size > len(data):
            raise node.wrong(f"{size} bytes from {begin} of {len(data)}", "must be complete")
        values = np.frombuffer(data, dtype=layout, count=n * width, offset=begin)
        return values.reshape(n, width)

    def _buffer(self, uri: Node) -> bytes:
        if uri.text() not in self.buffers:
            folder = Path(self.root.source.file).parent
            self.buffers[uri.text()] = safe.read(_inside(uri, folder)).data
        return self.buffers[uri.text()]


def _ties(root: Node, rows: Mapping[str, int]) -> tuple[Measured, int]:
    """Return the measurements of tie points, a point once in each image, and how many are left."""
    scene, parts, first, lost = _Scene(root=root), [], 0, 0
    for node in root.one("nodes").each():
        mesh = node.maybe("mesh")
        if mesh is None:
            continue
        primitive = root.one("meshes", mesh.whole(), "primitives", 0)
        matches = primitive.maybe("extensions", MATCHES)
        if matches is None or matches.maybe("imagePoints") is None:
            continue
        xyz = _positions(scene, node, primitive)
        part, without = _matched(scene, matches, xyz, rows)
        parts.append(replace(part, points=tuple(f"t{first + k}" for k in range(len(xyz)))))
        first, lost = first + len(xyz), lost + without
    return joined(*parts), lost


def _positions(scene: _Scene, node: Node, primitive: Node) -> Array:
    """Return the points of a mesh in the processing system, shape (n, 3)."""
    xyz = scene.array(primitive.one("attributes", "POSITION"), width=3, kind="f").astype(float)
    matrix = node.maybe("matrix")
    turn = np.eye(4) if matrix is None else matrix.numbers(16).reshape(4, 4).T
    return (xyz @ turn[:3, :3].T + turn[:3, 3]) @ UPRIGHT.T


def _matched(
    scene: _Scene, matches: Node, xyz: Array, rows: Mapping[str, int]
) -> tuple[Measured, int]:
    """Return the measurements of the points of one mesh, and how many are left out."""
    numbers = [uid.text() for uid in matches.one("cameraUids").each()]
    camera = scene.array(matches.one("cameraIds"), width=1, kind="u")[:, 0]
    node = matches.one("imagePoints", "pixelCoordinates")
    colrow = scene.array(node, width=2, kind="f").astype(float) - HALF
    point, match = _ranges(scene, matches.one("pointIndexRanges"), len(xyz), len(camera))
    if len(camera) != len(colrow) or (len(camera) and camera.max() >= len(numbers)):
        raise matches.wrong(
            "its matches do not fit together", "must have a camera and a pixel each"
        )
    if not (np.abs(colrow) <= RANGES["col_px"].high).all():
        raise node.wrong("a pixel is too large", str(RANGES["col_px"]))
    pairs = np.stack([point, camera[match]], axis=1)
    once = np.sort(np.unique(pairs, axis=0, return_index=True)[1])
    image = np.array([rows.get(number, -1) for number in numbers], dtype=int)
    kept = once[image[camera[match[once]]] >= 0] if len(once) else once
    measured = Measured(
        x_w=xyz,
        image_idx=image[camera[match[kept]]] if len(kept) else np.zeros(0, dtype=int),
        point_idx=point[kept],
        colrow=colrow[match[kept]],
    )
    return measured, len(point) - len(kept)


def _ranges(
    scene: _Scene, accessor: Node, n_points: int, n_matches: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the point and the place of every match that belongs to a point."""
    pairs = scene.array(accessor, width=2, kind="u").astype(np.uint64)
    packed = pairs[:, 0] | (pairs[:, 1] << np.uint64(32))
    begin = (packed & np.uint64(2**COUNT_BITS - 1)).astype(np.int64)
    count = (packed >> np.uint64(COUNT_BITS)).astype(np.int64)
    if len(count) != n_points or ((begin + count) > n_matches).any() or count.sum() > n_matches:
        raise accessor.wrong("does not fit to its points and matches", "must have a range each")
    point = np.repeat(np.arange(n_points), count)
    within = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
    return point, begin[point] + within
