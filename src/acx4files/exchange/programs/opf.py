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

from acx4files.exchange import coordinates, lens, options, project, safe
from acx4files.exchange.coordinates import FLIP, TOP_AHEAD, Chosen
from acx4files.exchange.lens import Lens, Pinhole
from acx4files.exchange.project import Control, Measured, Project, Proof, Trajectory
from acx4files.exchange.safe import Node, refusal, told
from acx4files.flight.problems import METRES, PIXELS, RANGES, Range, quoted
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk, turn
from acx4lib.geometry.geodesy import mean_origin

FORMAT = "application/opf-{}+json"
"""Name of a JSON format."""

BEFORE, AFTER, CONTROL = "input-cameras", "calibrated-cameras", "input-control-points"
MARKED, SCENE, FILES = "calibrated-control-points", "scene-reference-frame", "camera-list"
READ = (FILES, BEFORE, AFTER, CONTROL, MARKED, SCENE, "gps-bias")
"""Names of the formats that are read."""

CALIBRATION, GLTF = "calibration", "model/gltf+json"
"""Type of the item, and format of its file, that has the tie points."""

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


def read_project(
    source: Annotated[Path, options.Source],
    *,
    crs: options.CrsOfProject = None,
    heights: options.HeightsOfFlight = None,
    orientations: options.Orientations = "initial",
) -> Project:
    """Read a project in Pix4D's open photogrammetry format (OPF).

    SOURCE is a file .opf, or a folder with it. Sensors with rig relatives, images, tie points,
    control points with their marks and the measured orientations are taken; with --orientations
    adjusted the trajectory is the calibrated cameras, and then a boresight means nothing. Tie
    points need pyopf, Pix4D's own library: pip install 'acx4lib[opf]'.

    Examples
    --------
    acx4 import opf project.opf --out my_flight

    Raises
    ------
    FlightError
        Where the files are no project of OPF, or something in them cannot be.
    """
    root, documents, others, tracks = _documents(source)
    sensors = _sensors(documents)
    images, captures = _images(documents, sensors)
    points, surveyed = _points(documents[CONTROL])
    places = [place for place, _ in surveyed.values()]
    located = {name: one for name, one in captures.items() if one.maybe("geolocation")}
    captured = [_place(node.one("geolocation")) for node in [*located.values()][:1]]
    if heights is None and (places or captured):
        heights = (*places, *captured)[0].heights
    system = _system(documents[SCENE], (*captured, *places), crs, heights)
    rows = {number: k for k, number in enumerate(images)}
    marks, lost_marks = _marks(documents, points, rows)
    ties, lost_ties, untied = Measured(), 0, tuple[str, ...]()
    if tracks is not None:
        ties, lost_ties, untied = _ties(tracks, rows)
    control = None
    if system is not None and surveyed:
        control = Control(
            names=tuple(surveyed),
            enh=np.stack([_enh(system, place) for place in places]),
            sigma=np.stack([place.sigma for place in places]),
            is_check=tuple(is_check for _, is_check in surveyed.values()),
        )
    poses = _calibrated(documents[AFTER])
    read = [one for one in (root, *documents.values()) if one.value]
    generator = [
        part.text() for key in ("name", "version") if (part := root.maybe("generator", key))
    ]
    title = root.maybe("name")
    left_out = {
        f"{len(surveyed)} control points: no system on the Earth": surveyed and control is None,
        "the bias of GPS positions": documents["gps-bias"].value,
        f"files of formats that are not read: {', '.join(others)}": others,
    }
    return Project(
        source=" ".join(["OPF of", *generator] if generator else ["OPF"]),
        sources=[one.source for one in (*read, *([] if tracks is None else [tracks]))],
        lenses=dict(sensors.values()),
        images=project.Images.of((*image, poses.get(i)) for i, image in images.items()),
        measured=project.joined(marks, ties),
        proofs=(
            Proof(whose="the calibrated control points", measured=marks, is_own=True),
            Proof(whose="the calibrated tie points", measured=ties, is_own=True),
        ),
        control=control,
        settings={
            "name": Path(root.source.file).stem if title is None else title.text(),
            **(system.settings if system else {}),
        },
        orientations=orientations,
        in_grid=_in_grid(documents, system),
        trajectory=_measured(located, system) if orientations == "initial" else Trajectory(),
        lost={
            "marks in images that are not in the project": lost_marks,
            "measurements of tie points in other images, or second ones in one": lost_ties,
        },
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        left_out=(*untied, *(sentence for sentence, is_so in left_out.items() if is_so)),
        may_leave_cameras=True,
    )


read = project.reader(read_project)


def _documents(source: Path) -> tuple[Node, dict[str, Node], list[str], Node | None]:
    """Return a project, its first document of each format, other formats, tie points' glTF file.

    A format that the project has not is an empty document.
    """
    if source.is_dir():
        listed = sorted(source.glob("*.opf"))
        if len(listed) != 1:
            fault = f"has {', '.join(path.name for path in listed) or 'no project'}"
            raise refusal(str(source), 1, "folder", fault, "must have one .opf, or name it")
        source = listed[0]
    root = _document(source, "project")
    found, others, tracks = dict[str, Node](), list[str](), None
    resources = [
        (one, item.one("type").text())
        for item in root.all("items")
        for one in item.all("resources")
    ]
    for resource, kind in resources:
        name, uri = resource.one("format").text(), resource.one("uri")
        known = name.removeprefix("application/opf-").removesuffix("+json")
        is_tracks = (kind, name) == (CALIBRATION, GLTF)
        if known not in READ and not is_tracks:
            others.append(name)
            continue
        place = safe.inside(source.parent, unquote(uri.text()), uri.wrong)
        if known in READ and known not in found:
            found[known] = _document(place, known)
        elif is_tracks and tracks is None and place.exists():
            tracks = safe.json_tree(safe.read(place))
        elif is_tracks or Path(found[known].source.file) != place:
            others.append(name)
    empty = dict.fromkeys(READ, Node(source=root.source, value={}))
    return (
        root,
        found | {key: empty[key] for key in READ if key not in found},
        [*dict.fromkeys(others)],
        tracks,
    )


def _document(path: Path, kind: str) -> Node:
    """Return a document, which must have a format and the version that is read."""
    root = safe.json_tree(safe.read(path))
    name, version = root.one("format"), root.one("version")
    if name.text() != FORMAT.format(kind):
        raise name.wrong(quoted(name.text()), f"must be {FORMAT.format(kind)}")
    if version.text().split(".")[0] != "1":
        raise version.wrong(quoted(version.text()), "must be version 1")
    return root


def _ids(nodes: Iterable[Node]) -> Iterator[tuple[str, Node]]:
    yield from ((node.one("id").text(), node) for node in nodes)


# sensors


def _sensors(documents: Mapping[str, Node]) -> dict[str, tuple[str, Lens]]:
    """Return names and lenses of sensors by their numbers, with adjusted internals if there are."""
    nodes = project.by_id(_ids(documents[BEFORE].one("sensors").each()))
    after = project.by_id(_ids(documents[AFTER].all("sensors")))
    labels = [(one.value.get("name") or "").strip() or i for i, one in nodes.items()]
    often = Counter(labels)
    for k, node in enumerate(nodes.values()):
        if often[labels[k]] > 1 and (bands := [*node.all("bands")]):
            labels[k] += f" {'+'.join(band.one('name').text() for band in bands)}"
    names, _ = project.named(nodes, labels)
    return {i: (names[i], _sensor(names[i], node, after.get(i))) for i, node in nodes.items()}


def _sensor(name: str, declared: Node, after: Node | None) -> Lens:
    source = declared if after is None else after
    width, height = map(int, declared.one("image_size_px").numbers(2, PIXELS))
    pixel, relatives, remark = declared.maybe("pixel_size_um"), declared.maybe("rig_relatives"), ""
    if relatives is not None:
        turns, shift = relatives.maybe("rotation"), relatives.maybe("translation")
        given = (turns and turns.maybe("sigmas_deg"), shift and shift.maybe("sigmas_m"))
        texts = [", ".join(f"{sigma:g}" for sigma in one.numbers(3)) for one in given if one]
        if len(texts) == len(given):
            before = f"place of {name} in the rig before the adjustment"
            remark = f"{before}, sigma: {texts[0]} degrees and {texts[1]} m"
    return replace(
        _lens(source.one("internals"), width, height),
        pixel_um=0.0 if pixel is None else pixel.number(RANGES["pixel_um"]),
        mount=_mount(source.maybe("rig_relatives") or relatives),
        kind="initial" if after is None else "adjusted",
        remark=remark,
    )


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
    return Pose(R=TOP_AHEAD @ coordinates.turned(R_rel), r=TOP_AHEAD @ FLIP @ r)


def _lens(node: Node, width: int, height: int) -> Lens:
    """Return the lens that a node ``internals`` describes, of an image of a size."""
    kind = node.one("type")
    cx, cy = (node.one("principal_point_px").numbers(2) - HALF).tolist()
    if kind.text() == "perspective":
        f = node.one("focal_length_px").number(POSITIVE)
        radial = node.one("radial_distortion").numbers(3)
        tangential = node.one("tangential_distortion").numbers(2)
        hole = Pinhole(fx=f, fy=f, cx=cx, cy=cy)
        return lens.OPF.lens([*radial, *tangential], hole, (width, height), node.wrong)
    if kind.text() != "fisheye":
        raise kind.wrong(quoted(kind.text()), "must be one of perspective, fisheye")
    affine, polynomial = node.one("affine"), node.one("polynomial")
    c, d, e, f = affine.numbers(4).tolist()
    p = polynomial.numbers().tolist()
    if len(p) < 2 or p[0] != 0 or p[1] <= 0:
        raise polynomial.wrong(quoted(p), "must be 0, a positive number, and others")
    if c <= 0 or f <= 0 or c * f - d * e <= 0:
        raise affine.wrong(quoted([c, d, e, f]), "must be c d; e f with positive c and f")
    return lens.fisheye(p, (c, d, e, f), (cx, cy), size=(width, height), wrong=node.wrong)


# images


def _images(
    documents: Mapping[str, Node], sensors: Mapping[str, tuple[str, Lens]]
) -> tuple[dict[str, tuple[str, str, str]], dict[str, Node]]:
    """Return name, camera and exposure of images by their numbers, and captures by exposures."""
    pairs = [
        (camera, capture)
        for capture in documents[BEFORE].one("captures").each()
        for camera in capture.one("cameras").each()
    ]
    cameras = project.by_id(_ids(camera for camera, _ in pairs))
    files = documents[FILES].all("cameras")
    uris = {file.one("id").text(): file.one("uri").text().replace("\\", "/") for file in files}
    named, _ = project.named(cameras, [uris.get(i, i).rpartition("/")[2] for i in cameras])
    images, first = {}, dict[str, Node]()
    for (number, name), (camera, capture) in zip(named.items(), pairs, strict=True):
        leader = capture.one("reference_camera_id")
        sensor = _known(camera.one("sensor_id"), sensors, "a sensor")
        exposure = _known(leader, named, "a camera")
        images[number] = (name, sensors[sensor][0], named[exposure])
        if number == exposure:
            first[name] = capture
    return images, first


def _known(node: Node, ids: Iterable[str], kind: str) -> str:
    if node.text() not in ids:
        raise node.wrong(quoted(node.text()), f"must be the id of {kind}")
    return node.text()


def _calibrated(document: Node) -> dict[str, Pose]:
    """Return the poses of calibrated cameras in the processing system, by camera numbers."""
    poses = {}
    for i, camera in project.by_id(_ids(document.all("cameras"))).items():
        opk = np.radians(camera.one("orientation_deg").numbers(3))
        r = camera.one("position").numbers(3, METRES)
        poses[i] = Pose(R=rotation_from_opk(opk[None])[0], r=r)
    return poses


def _in_grid(documents: Mapping[str, Node], system: Chosen | None) -> project.InGrid:
    """Return how the processing system lies in the flight's grid."""
    frame = documents[SCENE]
    if not frame.value or system is None:
        root = frame if frame.value else documents[BEFORE]
        expected = "adjusted orientations need one"
        return root.wrong("has no coordinate system on the Earth", expected)
    node, to_canonical = frame.one("crs", "definition"), frame.one("base_to_canonical")

    def in_grid(T: Pose) -> tuple[Array, Array]:
        scale, shift = (to_canonical.one(key).numbers(3) for key in ("scale", "shift"))
        if (scale == 0).any():
            raise to_canonical.one("scale").wrong("has a zero", "must be numbers that are not zero")
        # scaled, swapped, then shifted; what is swapped is swapped once more by its order of axes
        if to_canonical.value.get("swap_xy"):
            scale = scale[[1, 0, 2]]
        with told(node.wrong, "must be convertible"):
            source = coordinates.parsed(node.text())
            if not source.is_projected:
                raise node.wrong(quoted(source.name), "must be projected for adjusted orientations")
            enh = replace(system, source=source).from_source((T.r - shift) / scale)
            enh = coordinates.with_heights(system, enh, coordinates.heights_of(source))
        return enh, T.opk

    return in_grid


def _measured(captures: Mapping[str, Node], system: Chosen | None) -> Trajectory:
    """Return the trajectory by the measured places and angles of captures, by exposures."""
    rows = {name: one for name, one in captures.items() if one.maybe("orientation")}
    if not rows or system is None:
        return Trajectory(left_out=("a trajectory: no capture has position and angles",))
    places = [_place(capture.one("geolocation")) for capture in rows.values()]
    try:
        enh = np.stack([_enh(system, place) for place in places])
    except FlightError as error:
        return Trajectory(left_out=(f"the measured orientations: {error.problems[0]}",))
    attitudes = [
        _attitude(capture.one("orientation"), at, system)
        for capture, at in zip(rows.values(), enh, strict=True)
    ]
    opk, sigma = (np.stack(one) for one in zip(*attitudes, strict=True))
    table = project.trajectory_in_grid(list(rows), enh, opk)
    sigmas = {
        ("east_m", "north_m", "height_m"): np.stack([place.sigma for place in places]),
        ("roll_deg", "pitch_deg", "heading_deg"): sigma,
    }
    for names, values in sigmas.items():
        if (values > 0).all():
            columns = np.round(values, 9).T.tolist()
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
        xyh=node.one("coordinates").numbers(3, METRES)[order],
        sigma=np.zeros(3) if sigma is None else np.maximum(sigma.numbers(3), 0.0)[order],
        system=system,
        heights=coordinates.heights_of(system) if undulation is None else undulation.number(),
    )


def _system(
    frame: Node, places: Sequence[_Place], wanted: str | None, heights: str | float | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where the project has none on the Earth.

    It is that of the scene reference frame where this is projected, else the UTM zone of the first
    place.
    """
    nodes: list[tuple[Node, Array | None]] = []
    if frame.value:
        nodes.append((frame.one("crs", "definition"), None))
    nodes += [(place.node.one("crs", "definition"), place.xyh[:2]) for place in places]
    system = None
    for node, xy in nodes:
        with told(node.wrong, "must be one that a flight can have"):
            system = system or coordinates.chosen(node.text(), xy, wanted)
    if system is None or heights is None:
        return system
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


def _points(document: Node) -> tuple[dict[str, Node], dict[str, tuple[_Place, bool]]]:
    """Return the points with marks, and the places of control points and whether they check."""
    gcps = project.by_id(_ids(document.all("gcps")))
    points = project.by_id(_ids([*gcps.values(), *document.all("mtps")]))
    project.named(points, list(points))
    return points, {
        name: (_place(gcp.one("geolocation")), gcp.value.get("is_checkpoint") is True)
        for name, gcp in gcps.items()
    }


def _marks(
    documents: Mapping[str, Node], points: Mapping[str, Node], rows: Mapping[str, int]
) -> tuple[Measured, int]:
    """Return the marks of control points and of manual tie points, and how many lie elsewhere."""
    marks: dict[tuple[str, str], Array] = {}
    for name, point in points.items():
        for mark in point.one("marks").each():
            key = (mark.one("camera_id").text(), name)
            if key in marks:
                raise mark.wrong(f"{name} is twice in one camera", "must be there once")
            marks[key] = mark.one("position_px").numbers(2, RANGES["col_px"]) - HALF
    seen = [(rows[i], name, colrow) for (i, name), colrow in marks.items() if i in rows]
    calibrated = project.by_id(_ids(documents[MARKED].all("points")))
    x_w = {i: one.one("coordinates").numbers(3, METRES) for i, one in calibrated.items()}
    return Measured.of(seen, x_w), len(marks) - len(seen)


# tie points: a glTF file with its buffers, and matches as an extension. A point has a range of
# matches: its first one in 40 bits, their number in 24 bits behind that. The node's matrix takes
# positions to glTF's axes, whose y is up; in the processing system z is.

UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From glTF's axes, y up, to those with z up."""

COUNT_BITS = 40
"""Number of low bits of a range, below those with the number of its matches."""

OF_PYOPF = (
    ArithmeticError,
    AttributeError,
    LookupError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""What pyopf raises for files that do not fit together."""


def _ties(root: Node, rows: Mapping[str, int]) -> tuple[Measured, int, tuple[str, ...]]:
    """Return the measurements of tie points, a point once in each image, and how many are left.

    The last is what to say where pyopf is not installed.
    """
    try:
        from pyopf.pointcloud import GlTFPointCloud  # noqa: PLC0415 an extra
    except ImportError:
        return Measured(), 0, ("tie points: they need pyopf: pip install 'acx4lib[opf]'",)
    path = Path(root.source.file)
    for buffer in root.one("buffers").each():
        uri = buffer.one("uri")
        safe.inside(path.parent, unquote(uri.text()), uri.wrong)
    parts, first, lost = [], 0, 0
    try:
        for node in GlTFPointCloud.open(path).nodes:
            if node.matches is not None and node.matches.image_points is not None:
                part, without = _matched(node, first, rows)
                parts.append(part)
                first, lost = first + len(part.points), lost + without
    except OF_PYOPF as error:
        fault = f"pyopf cannot read it: {type(error).__name__}: {error}"
        raise root.wrong(fault, "must be tie points of OPF that fit together") from None
    return project.joined(*parts), lost, ()


def _matched(node: Any, first: int, rows: Mapping[str, int]) -> tuple[Measured, int]:
    """Return the measurements of the points of a node, and how many are left out.

    Raises
    ------
    ValueError, IndexError
        Where ranges, cameras and pixels do not fit to each other.
    """
    matches, T = node.matches, node.matrix
    xyz = np.array(node.position, dtype=float)
    xyz = (xyz @ T[:3, :3].T + T[:3, 3]) @ UPRIGHT.T
    pairs = np.array(matches.point_index_ranges.ranges, dtype=np.uint64)
    packed = pairs[:, 0] | (pairs[:, 1] << np.uint64(32))
    begin = (packed & np.uint64(2**COUNT_BITS - 1)).astype(np.int64)
    count = (packed >> np.uint64(COUNT_BITS)).astype(np.int64)
    colrow = np.array(matches.image_points.pixelCoordinates, dtype=float) - HALF
    camera = np.array(matches.camera_ids)
    n = len(camera)
    if len(count) != len(xyz) or count.sum() > n or colrow.shape != (n, 2):
        raise ValueError("points, ranges, cameras and pixels are not as many")
    point = np.repeat(np.arange(len(xyz)), count)
    within = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count)
    match = begin[point] + within
    image = np.array([rows.get(str(uid.int), -1) for uid in matches.camera_uids], dtype=int)
    image = image[camera[match]]
    if not (np.abs(colrow[match]) <= RANGES["col_px"].high).all():
        raise ValueError("a pixel is too large")
    pair = np.stack([point, image], axis=1)
    once = np.sort(np.unique(pair[image >= 0], axis=0, return_index=True)[1])
    kept = np.flatnonzero(image >= 0)[once]
    measured = Measured(
        points=tuple(f"t{first + k}" for k in range(len(xyz))),
        x_w=xyz,
        image_idx=image[kept],
        point_idx=point[kept],
        colrow=colrow[match[kept]],
    )
    return measured, len(point) - len(kept)
