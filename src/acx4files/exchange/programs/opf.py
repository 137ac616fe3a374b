"""OPF, Pix4D's open photogrammetry format, version 1: sensors, rigs, images, marks, tie points.

Specification: https://pix4d.github.io/opf-spec. Perspective internals are OpenCV's model with R1,
R2, R3 for k1, k2, k3 and T1, T2 for p1, p2. In a fisheye the angle from the axis counts in right
angles, t = 2/pi * angle; a point lies in its direction at the distance p0 + p1 t + p2 t² + ..., and
the affine matrix (c d; e f) takes it to pixels. Pixels count from the outer corner of the top-left
one. Every place has a coordinate system of its own, whose order of axes its coordinates follow.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import unquote

import numpy as np
import pyproj
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
from acx4files.exchange.safe import Node, Opened, inside, refusal, told
from acx4files.flight.problems import METRES, PIXELS, RANGES, Range, quoted
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk, turn
from acx4lib.geometry.geodesy import mean_origin

FORMAT = "application/opf-{}+json"
"""Name of a JSON format."""

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
        A file .opf, or a folder with it.
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
    documents = _documents(source)
    sensors = _sensors(documents)
    shots = _shots(documents, sensors)
    geolocated = [(shot, node) for shot in shots if (node := shot.measured("geolocation"))]
    points, surveyed = _points(documents)
    places = [place for place, _ in surveyed.values()]
    places += [_place(node) for _, node in geolocated[:1]]
    system = _system(documents, places, crs, heights)
    poses = _calibrated(documents)
    rows = {shot.number: k for k, shot in enumerate(shots)}
    marks, lost_marks = _marks(documents, points, rows)
    ties, lost_ties = Measured(), 0
    if documents.tracks is not None:
        ties, lost_ties = _ties(documents.tracks, rows)
    control = None
    if system is not None and surveyed:
        control = Control(
            names=tuple(surveyed),
            enh=np.stack([_enh(system, place) for place, _ in surveyed.values()]),
            sigma=np.stack([place.sigma for place, _ in surveyed.values()]),
            is_check=tuple(is_check for _, is_check in surveyed.values()),
        )
    left_out = {
        f"{len(surveyed)} control points: no system on the Earth": surveyed and control is None,
        "the bias of GPS positions": "gps-bias" in documents.by_format,
        f"files of formats that are not read: {', '.join(documents.others)}": documents.others,
    }
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
        trajectory=_measured(geolocated, system) if orientations == "initial" else Trajectory(),
        lost={
            "marks in images that are not in the project": lost_marks,
            "measurements of tie points in other images, or second ones in one": lost_ties,
        },
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        left_out=tuple(sentence for sentence, is_so in left_out.items() if is_so),
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

    SOURCE is a file .opf, or a folder with it. Sensors with rig relatives, images, tie points,
    control points with their marks and the measured orientations are taken; with --orientations
    adjusted the trajectory is the calibrated cameras, and then a boresight means nothing.

    Examples
    --------
    acx4 import opf project.opf --out my_flight

    Raises
    ------
    FlightError
        As `project` and `flight_of`.
    """
    found = project(source, orientations=orientations, crs=crs, heights=heights)
    return flight_of(found, orientations=orientations, block=block, pixel_um=pixel_um, allow=allow)


@dataclass(frozen=True, kw_only=True)
class _Documents:
    """The documents of a project: the first of each format of `READ`, the tie points' glTF file.

    `others` are formats that are not read, and second documents.
    """

    name: str
    program: str
    by_format: Mapping[str, Node]
    others: Sequence[str]
    tracks: Node | None
    sources: tuple[Opened, ...]


def _documents(source: Path) -> _Documents:
    """Return the documents of a file .opf, or of a folder with one."""
    if source.is_dir():
        listed = sorted(source.glob("*.opf"))
        if len(listed) != 1:
            fault = f"has {', '.join(path.name for path in listed) or 'no project'}"
            raise refusal(str(source), 1, "folder", fault, "must have one .opf, or name it")
        source = listed[0]
    root = _document(source, "project")
    by_format: dict[str, Node] = {}
    others = []
    tracks = None
    for kind, name, uri in _resources(root):
        known = next((one for one in READ if FORMAT.format(one) == name), None)
        if known is None and (kind, name) != (CALIBRATION, GLTF):
            others.append(name)
            continue
        place = _file(uri, source.parent)
        if known is not None and known not in by_format:
            by_format[known] = _document(place, known)
        elif known is None and tracks is None and place.exists():
            tracks = safe.json_tree(safe.read(place))
        elif known is None or Path(by_format[known].source.file) != place:
            others.append(name if known is None else f"a second {known}")
    parts = (root.maybe("generator", "name"), root.maybe("generator", "version"))
    generator = [part.text() for part in parts if part is not None]
    title = root.maybe("name")
    read = [root, *by_format.values(), *([] if tracks is None else [tracks])]
    return _Documents(
        name=source.stem if title is None else title.text(),
        program=" ".join(["OPF of", *generator] if generator else ["OPF"]),
        by_format=by_format,
        others=list(dict.fromkeys(others)),
        tracks=tracks,
        sources=tuple(node.source for node in read),
    )


def _document(path: Path, kind: str) -> Node:
    """Return a document, which must have a format and the version that is read."""
    root = safe.json_tree(safe.read(path))
    name, version = root.one("format"), root.one("version")
    if name.text() != FORMAT.format(kind):
        raise name.wrong(quoted(name.text()), f"must be {FORMAT.format(kind)}")
    if version.text().split(".")[0] != MAJOR:
        raise version.wrong(quoted(version.text()), f"must be version {MAJOR}")
    return root


def _resources(root: Node) -> Iterator[tuple[str, str, Node]]:
    """Yield the types of a project's items with the formats and addresses of their files."""
    for item in root.one("items").each():
        for resource in item.one("resources").each():
            yield item.one("type").text(), resource.one("format").text(), resource.one("uri")


def _file(uri: Node, folder: Path) -> Path:
    """Return the place of a file of the project, which must lie below a folder."""
    return inside(folder, unquote(uri.text()), uri.wrong)


def _by_id(listed: Iterable[Node]) -> dict[str, Node]:
    """Return the nodes of a list by their ids, which must be unique."""
    nodes: dict[str, Node] = {}
    for node in listed:
        name = node.one("id")
        if nodes.setdefault(name.text(), node) is not node:
            raise name.wrong(f"{quoted(name.text())} is there twice", "must be unique")
    return nodes


def _named(nodes: Mapping[str, Node], labels: Sequence[str]) -> dict[str, str]:
    """Return the names of nodes by their ids, which stand behind labels that occur twice."""
    names, _ = without_doubles(labels, list(nodes))
    places = dict(zip(names, nodes.values(), strict=True))
    require_names(names, lambda name, fault, expected: places[name].wrong(fault, expected))
    return dict(zip(nodes, names, strict=True))


def _is_true(node: Node | None) -> bool:
    return node is not None and node.value is True


# sensors


@dataclass(frozen=True, kw_only=True)
class _Sensor:
    """A sensor: its name and its lens."""

    name: str
    lens: Lens


def _sensors(documents: _Documents) -> dict[str, _Sensor]:
    """Return the sensors by their numbers, with adjusted internals where there are any."""
    declared = documents.by_format.get("input-cameras")
    if declared is None:
        missing = "the project has no input-cameras"
        expected = "required: the sizes of images are there"
        raise documents.sources[0].wrong("items", missing, expected)
    nodes = _by_id(declared.one("sensors").each())
    calibrated = documents.by_format.get("calibrated-cameras")
    after = {} if calibrated is None else _by_id(calibrated.one("sensors").each())
    labels = []
    for i, node in nodes.items():
        name = node.maybe("name")
        labels.append("" if name is None else name.text().strip())
        labels[-1] = labels[-1] or i
    often = Counter(labels)
    for k, node in enumerate(nodes.values()):
        if often[labels[k]] > 1 and (listed := node.maybe("bands")) is not None:
            bands = [band.one("name").text() for band in listed.each()]
            labels[k] = f"{labels[k]} {'+'.join(bands)}"
    names = _named(nodes, labels)
    return {i: _sensor(names[i], node, after.get(i)) for i, node in nodes.items()}


def _sensor(name: str, declared: Node, after: Node | None) -> _Sensor:
    source = declared if after is None else after
    size, pixel = declared.one("image_size_px"), declared.maybe("pixel_size_um")
    width, height = map(int, size.numbers(2, allowed=PIXELS))
    relatives, remark = declared.maybe("rig_relatives"), ""
    if relatives is not None:
        given = [relatives.maybe("rotation", "sigmas_deg")]
        given.append(relatives.maybe("translation", "sigmas_m"))
        sigmas = [one.numbers(3) for one in given if one is not None]
        if len(sigmas) == len(given):
            degrees, metres = (", ".join(f"{value:g}" for value in sigma) for sigma in sigmas)
            before = f"place of {name} in the rig before the adjustment"
            remark = f"{before}, sigma: {degrees} degrees and {metres} m"
    lens = replace(
        _lens(source.one("internals"), width, height),
        pixel_um=0.0 if pixel is None else pixel.number(RANGES["pixel_um"]),
        mount=_mount(source.maybe("rig_relatives") or relatives),
        kind="initial" if after is None else "adjusted",
        remark=remark,
    )
    return _Sensor(name=name, lens=lens)


def _mount(relatives: Node | None) -> Pose:
    """Return T_b_c from rig relatives, which are input's or calibrated ones."""
    if relatives is None:
        return Pose(R=TOP_AHEAD, r=np.zeros(3))
    shift, rotation = relatives.one("translation"), relatives.maybe("rotation")
    if rotation is None:
        r, angles = shift.numbers(3), relatives.one("rotation_angles_deg").numbers(3)
    else:
        r, angles = shift.one("values_m").numbers(3), rotation.one("angles_deg").numbers(3)
    R_rel = rotation_from_opk(np.radians(angles)[None])[0]  # Rx Ry Rz, as there
    return Pose(R=TOP_AHEAD @ turned(R_rel), r=TOP_AHEAD @ FLIP @ r)


def _lens(node: Node, width: int, height: int) -> Lens:
    """Return the lens that a node ``internals`` describes, of an image of a size."""
    kind = node.one("type")
    cx, cy = (node.one("principal_point_px").numbers(2) - HALF).tolist()
    if kind.text() == "perspective":
        f = node.one("focal_length_px").number(POSITIVE)
        radial = node.one("radial_distortion").numbers(3)
        tangential = node.one("tangential_distortion").numbers(2)
        return Lens(
            width_px=width,
            height_px=height,
            hole=Pinhole(fx=f, fy=f, cx=cx, cy=cy),
            distortion=PERSPECTIVE.distortion([*radial, *tangential]),
            wrong=node.wrong,
        )
    if kind.text() != "fisheye":
        raise kind.wrong(quoted(kind.text()), "must be one of perspective, fisheye")
    affine, polynomial = node.one("affine"), node.one("polynomial")
    c, d, e, f = affine.numbers(4).tolist()
    p = polynomial.numbers(-1).tolist()
    if len(p) < 2 or p[0] != 0 or p[1] <= 0:
        raise polynomial.wrong(quoted(p), "must be 0, a positive number, and others")
    if c <= 0 or f <= 0 or c * f - d * e <= 0:
        raise affine.wrong(quoted([c, d, e, f]), "must be c d; e f with positive c and f")
    return fisheye(p, (c, d, e, f), (cx, cy), size=(width, height), wrong=node.wrong)


# images


@dataclass(frozen=True, kw_only=True)
class _Shot:
    """An image; that of a reference camera has its `capture`, with measured place and angles."""

    number: str
    name: str
    exposure: str
    sensor: _Sensor
    capture: Node | None

    def measured(self, key: str) -> Node | None:
        """Return the capture's geolocation or orientation; None where there is none."""
        return None if self.capture is None else self.capture.maybe(key)


def _shots(documents: _Documents, sensors: Mapping[str, _Sensor]) -> list[_Shot]:
    """Return the images of the captures, or else of the calibrated cameras."""
    captures = documents.by_format["input-cameras"].one("captures").each()
    pairs: list[tuple[Node, Node | None]] = [
        (camera, capture) for capture in captures for camera in capture.one("cameras").each()
    ]
    after = documents.by_format.get("calibrated-cameras")
    if not pairs and after is not None:
        pairs = [(camera, None) for camera in after.one("cameras").each()]
    cameras = _by_id(camera for camera, _ in pairs)
    listed = documents.by_format.get("camera-list")
    files = () if listed is None else listed.one("cameras").each()
    uris = {file.one("id").text(): file.one("uri").text().replace("\\", "/") for file in files}
    named = _named(cameras, [uris.get(i, i).rpartition("/")[2] for i in cameras])
    shots = []
    for (number, name), (camera, capture) in zip(named.items(), pairs, strict=True):
        sensor = camera.one("sensor_id")
        if sensor.text() not in sensors:
            raise sensor.wrong(quoted(sensor.text()), "must be the id of a sensor")
        leader = camera.one("id") if capture is None else capture.one("reference_camera_id")
        if leader.text() not in named:
            raise leader.wrong(quoted(leader.text()), "must be a camera's id")
        shot = _Shot(
            number=number,
            name=name,
            exposure=named[leader.text()],
            sensor=sensors[sensor.text()],
            capture=capture if number == leader.text() else None,
        )
        shots.append(shot)
    return shots


def _calibrated(documents: _Documents) -> dict[str, Pose]:
    """Return the poses of calibrated cameras in the processing system, by camera numbers."""
    document = documents.by_format.get("calibrated-cameras")
    if document is None:
        return {}
    poses = {}
    for i, camera in _by_id(document.one("cameras").each()).items():
        opk = np.radians(camera.one("orientation_deg").numbers(3))
        r = camera.one("position").numbers(3, allowed=METRES)
        poses[i] = Pose(R=rotation_from_opk(opk[None])[0], r=r)
    return poses


def _in_grid(documents: _Documents, system: Chosen | None) -> InGrid:
    """Return how the processing system lies in the flight's grid."""
    frame = documents.by_format.get("scene-reference-frame")
    if frame is None or system is None:
        root = frame or documents.by_format["input-cameras"]
        expected = "adjusted orientations need one"
        return nowhere(root.wrong("has no coordinate system on the Earth", expected))
    node = frame.one("crs", "definition")

    def in_grid(T: Pose) -> tuple[Array, Array]:
        to_canonical = frame.one("base_to_canonical")
        scale, shift = (to_canonical.one(key).numbers(3) for key in ("scale", "shift"))
        if (scale == 0).any():
            raise to_canonical.one("scale").wrong("has a zero", "must be three numbers but zero")
        # scaled, swapped, then shifted; what is swapped is swapped once more by its order of axes
        if _is_true(to_canonical.maybe("swap_xy")):
            scale = scale[[1, 0, 2]]
        with told(node.wrong, "must be convertible"):
            source = coordinates.parsed(node.text())
            if not source.is_projected:
                raise node.wrong(quoted(source.name), "must be projected for adjusted orientations")
            enh = replace(system, source=source).from_source((T.r - shift) / scale)
            enh = coordinates.with_heights(system, enh, coordinates.heights_of(source))
        return enh, T.opk

    return in_grid


def _measured(geolocated: Sequence[tuple[_Shot, Node]], system: Chosen | None) -> Trajectory:
    """Return the trajectory by the measured places and angles of captures."""
    rows = [
        (shot.exposure, place, angles)
        for shot, place in geolocated
        if (angles := shot.measured("orientation")) is not None
    ]
    if not rows or system is None:
        return Trajectory(left_out=("a trajectory: no capture has position and angles",))
    places = [_place(node) for _, node, _ in rows]
    try:
        enh = np.stack([_enh(system, place) for place in places])
    except FlightError as error:
        return Trajectory(left_out=(f"the measured orientations: {error.problems[0]}",))
    opk, sigma = (
        np.stack(one)
        for one in zip(
            *(_attitude(angles, at, system) for (_, _, angles), at in zip(rows, enh, strict=True)),
            strict=True,
        )
    )
    table: dict[str, object] = {**trajectory_in_grid([name for name, _, _ in rows], enh, opk)}
    sigmas = {
        ("east_m", "north_m", "height_m"): np.stack([place.sigma for place in places]),
        ("roll_deg", "pitch_deg", "heading_deg"): sigma,
    }
    for names, values in sigmas.items():
        if (values > 0).all():
            columns = np.round(values, DEGREES).T.tolist()
            table |= {f"sigma_{name}": column for name, column in zip(names, columns, strict=True)}
    return Trajectory(table=table, assumed=(ANGLES,))


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
    crs = node.one("crs")  # of the grid by which the angles count
    with told(crs.wrong, "must be a projected coordinate system"):
        other = coordinates.grid_of(crs.text())
    here, there = (one.convergence(lonlat)[0] for one in (grid, other))
    if not np.isfinite([here, there]).all():
        raise crs.wrong(f"{crs.text()} is not defined there", "must be that of the place")
    R_g_b = turn(2, here - there) @ rotation_from_opk(angles[None])[0] @ TOP_AHEAD.T
    return opk_from_rotation(R_g_b[None])[0], sigma[[1, 0, 2]]


# places


@dataclass(frozen=True, kw_only=True, eq=False)
class _Place:
    """A node ``geolocation``: east or longitude first, sigma 0 where it is not given.

    `system` is its coordinate system, `heights` as the key of flight.toml.
    """

    node: Node
    xyh: Array
    sigma: Array
    system: pyproj.CRS
    heights: str | float


def _place(node: Node) -> _Place:
    """Return the place in a node ``geolocation``."""
    definition = node.one("crs", "definition")
    with told(definition.wrong, "must be a coordinate system"):
        system = coordinates.parsed(definition.text())
        order = [1, 0, 2] if coordinates.is_north_first(system) else [0, 1, 2]
    sigma = node.maybe("sigmas")
    undulation = node.maybe("crs", "geoid_height")
    return _Place(
        node=node,
        xyh=node.one("coordinates").numbers(3, allowed=METRES)[order],
        sigma=np.zeros(3) if sigma is None else np.maximum(sigma.numbers(3), 0.0)[order],
        system=system,
        heights=coordinates.heights_of(system) if undulation is None else undulation.number(),
    )


def _system(
    documents: _Documents,
    places: Sequence[_Place],
    wanted: str | None,
    heights: str | float | None,
) -> Chosen | None:
    """Return the flight's coordinate system; None where the project has none on the Earth.

    It is that of the scene reference frame where this is projected, else the UTM zone of the first
    place; heights are those of the first place.
    """
    frame = documents.by_format.get("scene-reference-frame")
    nodes: list[tuple[Node, Array | None]] = []
    if frame is not None:
        nodes.append((frame.one("crs", "definition"), None))
    nodes += [(place.node.one("crs", "definition"), place.xyh[:2]) for place in places]
    fault = None
    for node, xy in nodes:
        try:
            if (system := coordinates.chosen(node.text(), xy, wanted)) is not None:
                break
        except ValueError as error:
            fault = fault or node.wrong(str(error), "must be one that a flight can have")
    else:
        if fault is not None:
            raise fault
        return None
    if heights is None:
        heights = places[0].heights if places else system.heights
    phrase = "above the ellipsoid" if heights == "ellipsoidal" else f"of {heights}"
    if isinstance(heights, float):
        phrase = f"{heights:g} m less than above the ellipsoid"
    return replace(system, heights=heights, assumed=(*system.assumed[:1], f"Heights are {phrase}"))


def _enh(system: Chosen, place: _Place) -> Array:
    """Return east, north, height of a place in the flight's system, shape (3,)."""

    def wrong(said: str, expected: str) -> FlightError:
        return place.node.wrong(said.partition(" (Error")[0], expected)  # without PROJ's own words

    with told(wrong, "must be convertible into the flight's system"):
        enh = replace(system, source=place.system).from_source(place.xyh[None])
        enh = coordinates.with_heights(system, enh, place.heights)
    if not np.isfinite(enh).all():
        raise place.node.wrong("lies outside the flight's system", "must lie inside")
    return np.asarray(enh[0])


# measurements


def _points(
    documents: _Documents,
) -> tuple[dict[str, Node], dict[str, tuple[_Place, bool]]]:
    """Return the points with marks, and the places of control points and whether they check."""
    document = documents.by_format.get("input-control-points")
    if document is None:
        return {}, {}
    gcps = _by_id(document.one("gcps").each())
    mtps = document.maybe("mtps")
    points = _by_id([*gcps.values(), *(() if mtps is None else mtps.each())])
    require_names(list(points), lambda name, fault, wanted: points[name].wrong(fault, wanted))
    return points, {
        name: (_place(gcp.one("geolocation")), _is_true(gcp.maybe("is_checkpoint")))
        for name, gcp in gcps.items()
    }


def _marks(
    documents: _Documents, points: Mapping[str, Node], rows: Mapping[str, int]
) -> tuple[Measured, int]:
    """Return the marks of control points and of manual tie points, and how many lie elsewhere."""
    marks: dict[tuple[str, str], Array] = {}
    for name, point in points.items():
        for mark in point.one("marks").each():
            number, position = mark.one("camera_id").text(), mark.one("position_px")
            if (number, name) in marks:
                raise mark.wrong(f"{name} is twice in one camera", "must be there once")
            marks[number, name] = position.numbers(2, allowed=RANGES["col_px"]) - HALF
    seen = [(rows[i], name, colrow) for (i, name), colrow in marks.items() if i in rows]
    calibrated = documents.by_format.get("calibrated-control-points")
    nodes = {} if calibrated is None else _by_id(calibrated.one("points").each())
    x_w = {i: one.one("coordinates").numbers(3, allowed=METRES) for i, one in nodes.items()}
    return Measured.of(seen, x_w), len(marks) - len(seen)


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


def _array(root: Node, accessor: Node, *, width: int, kind: str) -> NDArray[Any]:
    """Return the values of an accessor, shape (n, width), of a kind of NumPy: "f" or "u"."""
    node = root.one("accessors", accessor.whole())
    layout = COMPONENTS.get(node.one("componentType").whole(), "")
    if WIDTHS.get(node.one("type").text()) != width or layout[1:2] != kind:
        raise node.wrong(quoted(node.value), f"must be {width} values of kind {kind!r}")
    view = root.one("bufferViews", node.one("bufferView").whole())
    uri = root.one("buffers", view.one("buffer").whole(), "uri")
    data = safe.read(_file(uri, Path(root.source.file).parent)).data
    first = view.maybe("byteOffset")
    begin, n = 0 if first is None else first.whole(), node.one("count").whole()
    size = n * width * np.dtype(layout).itemsize
    if begin < 0 or n < 0 or begin + size > len(data):
        raise node.wrong(f"{size} bytes from {begin} of {len(data)}", "must be complete")
    values = np.frombuffer(data, dtype=layout, count=n * width, offset=begin)
    return values.reshape(n, width)


def _ties(root: Node, rows: Mapping[str, int]) -> tuple[Measured, int]:
    """Return the measurements of tie points, a point once in each image, and how many are left."""
    parts, first, lost = [], 0, 0
    for node in root.one("nodes").each():
        mesh = node.maybe("mesh")
        if mesh is None:
            continue
        primitive = root.one("meshes", mesh.whole(), "primitives", 0)
        if primitive.maybe("extensions", MATCHES, "imagePoints") is None:
            continue
        xyz = _array(root, primitive.one("attributes", "POSITION"), width=3, kind="f").astype(float)
        matrix = node.maybe("matrix")
        T = np.eye(4) if matrix is None else matrix.numbers(16).reshape(4, 4).T
        xyz = (xyz @ T[:3, :3].T + T[:3, 3]) @ UPRIGHT.T
        part, without = _matched(root, primitive.one("extensions", MATCHES), xyz, rows)
        parts.append(replace(part, points=tuple(f"t{first + k}" for k in range(len(xyz)))))
        first, lost = first + len(xyz), lost + without
    return joined(*parts), lost


def _matched(
    root: Node, matches: Node, xyz: Array, rows: Mapping[str, int]
) -> tuple[Measured, int]:
    """Return the measurements of the points of one mesh, and how many are left out."""
    numbers = [uid.text() for uid in matches.one("cameraUids").each()]
    camera = _array(root, matches.one("cameraIds"), width=1, kind="u")[:, 0]
    node = matches.one("imagePoints", "pixelCoordinates")
    colrow = _array(root, node, width=2, kind="f").astype(float) - HALF
    point, match = _ranges(root, matches.one("pointIndexRanges"), len(xyz), len(camera))
    if len(camera) != len(colrow) or (len(camera) and camera.max() >= len(numbers)):
        fault = "its matches do not fit together"
        raise matches.wrong(fault, "must have a camera and a pixel each")
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
    root: Node, accessor: Node, n_points: int, n_matches: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the point and the place of every match that belongs to a point."""
    pairs = _array(root, accessor, width=2, kind="u").astype(np.uint64)
    packed = pairs[:, 0] | (pairs[:, 1] << np.uint64(32))
    begin = (packed & np.uint64(2**COUNT_BITS - 1)).astype(np.int64)
    count = (packed >> np.uint64(COUNT_BITS)).astype(np.int64)
    if len(count) != n_points or ((begin + count) > n_matches).any() or count.sum() > n_matches:
        raise accessor.wrong("does not fit to its points and matches", "must have a range each")
    point = np.repeat(np.arange(n_points), count)
    within = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
    return point, begin[point] + within
