"""Metashape: its projects and exported XML, and calibrations that it saved.

Sources: the user manual's appendix on camera models (versions 1.2 to 2.2), and files that Metashape
1.7 wrote. A calibration has x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + (p1 (r² + 2x²) + 2 p2 x y)
(1 + p3 r² + p4 r⁴), y' likewise with p1 and p2 exchanged; u = w/2 + cx + x' f + x' b1 + y' b2,
v = h/2 + cy + y' f, from the outer corner of the top-left pixel.

Only a location of a marker with ``pinned="true"`` was measured. The others are where Metashape
expects the marker: they follow from its own adjustment and say nothing that is new.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from acx4files.exchange import coordinates, safe
from acx4files.exchange.coordinates import (
    FLIP,
    TOP_AHEAD,
    UNKNOWN,
    Chosen,
    is_rotation,
    nearest_rotation,
    parsed,
    stacked,
    turned,
)
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.lens import METASHAPE as MODELS
from acx4files.exchange.lens import WORST_PX, Lens, Pinhole
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
    METRES,
    Control,
    Images,
    InGrid,
    Measured,
    Project,
    Proof,
    Trajectory,
    as_they_are,
    flight_of,
    grid_poses_of_ecef,
    nowhere,
    require_names,
    trajectory_in_grid,
    without_doubles,
)
from acx4files.exchange.safe import Element, Opened, inside, told
from acx4files.flight.problems import PIXELS, RANGES, Range, quoted
from acx4lib.expected import Array, Mask
from acx4lib.geometry.frames import Pose, transform
from acx4lib.geometry.geodesy import LOCAL, LocalFrame

CALIBRATION = "calibration"
"""Outermost element of a calibration that was saved alone."""

DOCUMENT = "doc.xml"
"""The XML in each of a project's archives."""

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in Metashape."""

POSITIVE = Range(1e-9, 1e9, "must be positive")

LOCATION, ANGLES = ("x", "y", "z"), ("yaw", "pitch", "roll")
TOGETHER = {
    "x": ("sxy", "sxyz"),
    "y": ("sxy", "sxyz"),
    "z": ("sxyz",),
    **dict.fromkeys(ANGLES, ("sypr", "syawpitchroll")),
}
"""Attributes with the accuracy of several values of a reference, the narrowest first."""

FLYABLE = "must be what a flight can have"

APRIORI = {
    "image_point_px": "accuracy_projections",
    "gnss_horizontal_m": "accuracy_cameras",
    "roll_pitch_deg": "accuracy_cameras_ypr",
    "gnss_vertical_m": "accuracy_cameras",
    "heading_deg": "accuracy_cameras_ypr",
}
"""Keys of ``[apriori]`` and the settings of Metashape for them."""

MARKER_SIGMA_M = 0.005
"""Metashape's own accuracy of markers, where the chunk has none."""

ASSUMED = (
    "Pixels: Metashape counts from the outer corner of the top-left one, so 0.5 is taken off",
    "The body's x axis is towards the top of the master camera's images: there Metashape's yaw, "
    "pitch and roll are zero for a camera that looks down with its top to the north",
)


def project(
    source: Path,
    *,
    orientations: str = "initial",
    crs: str | None = None,
    heights: str | float | None = None,
) -> Project:
    """Return a chunk, or the cameras of a file without images.

    Parameters
    ----------
    source : Path
        XML that Metashape exported, a ``.psx`` or a ``chunk.zip``, or a calibration.
    orientations : {"initial", "adjusted", "none"}
        "initial" is what was measured of the cameras, "adjusted" what Metashape adjusted.
    crs : str, optional
        The flight's projected CRS; by default the chunk's own, or its UTM zone.
    heights : str or float, optional
        As the key of flight.toml; by default the chunk's own.

    Raises
    ------
    FlightError
        Where the file is no project of Metashape, or something in it cannot be.
    """
    whole = _chunk(source)
    root = whole.root
    cameras = [camera for listed in root.each("cameras") for camera in listed.everywhere("camera")]
    if not cameras:
        return _cameras_alone(whole)
    sensors = _sensors(root, {camera.attributes.get("sensor_id", "") for camera in cameras})
    places = _places(root)
    by_id, doubled = _shots(cameras, sensors, places)
    shots = list(by_id.values())
    adjusted = orientations == "adjusted"
    if not any(shot.enabled and (shot.T_c is not None or not adjusted) for shot in shots):
        kind = "aligned" if adjusted else "enabled"
        raise root.one("cameras").wrong(f"has no {kind} camera", "must have one")
    system = _system(whole, shots, wanted=crs, heights=heights)
    located, pinned, lost = _located(whole, list(by_id))
    control = _control(whole, system)
    images = Images(
        names=tuple(shot.name for shot in shots),
        cameras=tuple(shot.sensor.name for shot in shots),
        exposures=tuple(shot.exposure for shot in shots),
        T_w_c=stacked([UNKNOWN if shot.T_c is None else shot.T_c for shot in shots]),
        enabled=np.array([shot.enabled for shot in shots], dtype=bool),
    )
    unknown = 0 if system else len(control.names)
    odd, found = _rig(root, sensors)
    label = root.attributes.get("label", "").strip() or "Metashape"
    apriori = {key: whole.settings[name] for key, name in APRIORI.items() if name in whole.settings}
    return Project(
        source=_version(root),
        sources=whole.sources,
        lenses={sensor.name: sensor.lens for sensor in sensors.values()},
        images=images,
        measured=located.where(pinned),
        proofs=_proofs(whole, located, pinned, control, system if places else None),
        control=control if system else None,
        settings={"name": label, **(system.settings if system else {}), "apriori": apriori},
        in_grid=_in_grid(whole, system, placed=bool(places)),
        trajectory=_measured(whole, shots, system) if orientations == "initial" else Trajectory(),
        lost={
            'marker locations without pinned="true": Metashape computed them, nobody measured '
            "them": int((~pinned).sum()),
            "marker locations in cameras that the chunk has not": lost,
            "surveyed markers: the chunk has no coordinate system (--crs)": unknown,
            "labels of cameras that occur twice: their numbers stand behind them": doubled,
            f"other chunks: {', '.join(whole.others)}": len(whole.others),
            **odd,
        },
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        found=found,
        left_out=("tie points, which the XML does not have",),
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
    """Read a project of Metashape: cameras, images, markers, control, orientations.

    SOURCE is an XML file that Metashape exported (File > Export > Export Cameras, or Export
    Markers), a calibration that it saved, a project's .psx with its folder .files beside it, or a
    chunk.zip of that folder. Of several chunks it is the active one.

    Only marker locations that were measured are taken, not those that Metashape computed itself.
    Tie points are not in these files. The trajectory is what was measured of the cameras, where
    position and angles are there; with --orientations adjusted it is Metashape's own adjustment,
    and then a boresight means nothing.

    Examples
    --------
    acx4 import metashape cameras.xml --out my_flight
    acx4 import metashape survey.psx --orientations adjusted --out my_flight

    Raises
    ------
    FlightError
        As `project` and `flight_of`.
    """
    found = project(source, orientations=orientations, crs=crs, heights=heights)
    return flight_of(found, orientations=orientations, block=block, pixel_um=pixel_um, allow=allow)


def _cameras_alone(whole: _Chunk) -> Project:
    """Return a calibration that Metashape saved, or the sensors of a chunk without images."""
    if whole.root.tag == CALIBRATION:
        lenses = {Path(whole.sources[0].file).stem: _lens(whole.root)}
    else:
        sensors = _sensors(whole.root).values()
        lenses = {sensor.name: replace(sensor.lens, kind="") for sensor in sensors}
    return Project(source="Metashape's cameras", sources=whole.sources, lenses=lenses)


def _version(root: Element) -> str:
    for setting in root.each("meta", "property"):
        if setting.attributes.get("name") == "Info/LastSavedSoftwareVersion":
            return f"Metashape {setting.attribute('value')}"
    return "Metashape"


def _rig(root: Element, sensors: Mapping[str, _Sensor]) -> tuple[dict[str, int], tuple[str, ...]]:
    """Count the parts of a chunk that a flight cannot have; return a sentence on slaves, too."""
    elements = list(root.each("sensors", "sensor"))
    slaves = [sensor for sensor in elements if "master_id" in sensor.attributes]
    n = sum(
        slave.attribute("id") in sensors and slave.attribute("id") != slave.attribute("master_id")
        for slave in slaves
    )
    tags = ("location", "translation", "rolling_shutter", "antenna")
    odd = {
        "further frames": max(0, len(list(root.each("frames", "frame"))) - 1),
        "offsets of sensors (of slaves, antennas, shutters): lever arms stay 0": sum(
            sensor.maybe(tag) is not None for sensor in elements for tag in tags
        ),
        "slaves have no rotation: their mountings are the master's": sum(
            slave.maybe("rotation") is None for slave in slaves
        ),
    }
    sentence = f"{n} sensors are slaves of a rig; their mountings are relative to the master"
    return odd, (sentence,) if n else ()


@dataclass(frozen=True, kw_only=True)
class _Chunk:
    """A chunk's XML, that of its first frame, the files, and the labels of the other chunks."""

    root: Element
    frame: Element | None
    sources: tuple[Opened, ...]
    others: tuple[str, ...] = ()

    @property
    def where(self) -> Element:
        """The element that names the coordinate system."""
        return self.root.maybe("reference") or self.root

    @property
    def settings(self) -> dict[str, float]:
        """The accuracies of the chunk's settings that are positive."""
        known = {*APRIORI.values(), "accuracy_markers"}
        return {
            name: value
            for setting in self.root.each("settings", "property")
            if (name := setting.attributes.get("name", "")) in known
            and (value := setting.number("value")) > 0
        }


def _chunk(source: Path) -> _Chunk:
    """Return the active chunk, or the first where none is named."""
    file = safe.read(source)
    if file.data[:2] == b"PK":
        return _in_archive(file)
    root = safe.xml_tree(file)
    if root.tag == CALIBRATION:
        return _Chunk(root=root, frame=None, sources=(file,))
    if root.tag == "chunk":
        return _whole(root, file)
    if root.tag != "document":
        raise root.wrong("is no file of Metashape", "must begin with <document> or <chunk>")
    if "path" not in root.attributes:
        others = [chunk.attributes.get("label", "") for chunk in root.each("chunk")][1:]
        return replace(_whole(root.one("chunk"), file), others=tuple(others))
    # A .psx names an archive with the names of the chunks' archives.
    name = root.attribute("path").replace("{projectname}", source.stem)
    place = inside(source.parent, name, root.wrong)
    project = safe.member(safe.read(place), DOCUMENT)
    document = safe.xml_tree(project)
    first = document.one("chunks", "chunk").attributes.get("id")
    active = document.one("chunks").attributes.get("active_id", first)
    entries = list(document.each("chunks", "chunk"))
    entries.sort(key=lambda entry: entry.attributes.get("id") != active)
    chunks = [
        _in_archive(safe.read(inside(place.parent, entry.attribute("path"), entry.wrong)))
        for entry in entries
    ]
    others = [chunk.root.attributes.get("label", "") for chunk in chunks[1:]]
    return replace(chunks[0], sources=(file, project, *chunks[0].sources), others=tuple(others))


def _in_archive(file: Opened) -> _Chunk:
    document = safe.member(file, DOCUMENT)
    root = safe.xml_tree(document)
    if root.tag != "chunk":
        raise root.wrong("is no chunk", "must begin with <chunk>")
    return _whole(root, document)


def _whole(root: Element, source: Opened) -> _Chunk:
    """Return a chunk with its first frame, which may lie in an archive of its own."""
    frame = root.maybe("frames", "frame")
    if frame is None or "path" not in frame.attributes:
        return _Chunk(root=root, frame=frame, sources=(source,))
    # Below the chunk's archive; an archive's name ends with that of its member.
    folder = Path(source.file.removesuffix(f"/{DOCUMENT}")).parent
    place = inside(folder, frame.attribute("path"), frame.wrong)
    document = safe.member(safe.read(place), DOCUMENT)
    return _Chunk(root=root, frame=safe.xml_tree(document), sources=(source, document))


def _named(elements: Sequence[Element], labels: Sequence[str]) -> tuple[dict[str, str], int]:
    """Return the names of elements by ids, and how many labels stand twice: ids are behind them."""
    by_id: dict[str, Element] = {}
    for element in elements:
        i = element.attribute("id")
        if by_id.setdefault(i, element) is not element:
            raise element.wrong(f"{quoted(i)} is there twice", "must be unique", attribute="id")
    names, doubled = without_doubles(labels, list(by_id))
    places = dict(zip(names, elements, strict=True))
    require_names(
        names, lambda name, fault, expected: places[name].wrong(fault, expected, attribute="label")
    )
    return dict(zip(by_id, names, strict=True)), doubled


# sensors


@dataclass(frozen=True, kw_only=True)
class _Sensor:
    """A sensor: its label, and its lens with the mounting relative to the master's axes."""

    name: str
    lens: Lens


def _sensors(root: Element, used: Iterable[str] = ()) -> dict[str, _Sensor]:
    """Return the sensors of a chunk's images by numbers; all, where it has no image."""
    root.one("sensors", "sensor")  # there must be one
    elements = list(root.each("sensors", "sensor"))
    labels = [sensor.attributes.get("label", "").strip() or "unknown" for sensor in elements]
    names, _ = _named(elements, labels)
    sensors = {}
    for (i, name), element in zip(names.items(), elements, strict=True):
        master = element.attributes.get("master_id", i)
        if master not in names:
            raise element.wrong(quoted(master), "must be a sensor's id", attribute="master_id")
        if used and i not in used:
            continue
        rotation = element.maybe("rotation")
        R: Array = np.eye(3)
        if rotation is not None and master != i:  # what is written is slave to master
            R = turned(_matrix(rotation, 1e-5))
        mount = Pose(R=TOP_AHEAD @ R, r=np.zeros(3))
        sensors[i] = _Sensor(name=name, lens=replace(_chosen(element), mount=mount))
    return sensors


def _matrix(element: Element, off: float) -> Array:
    """Return a rotation, shape (3, 3), that is one but for `off`."""
    R = element.numbers(9).reshape(3, 3)
    if not is_rotation(R, off):
        raise element.wrong("is no rotation", "must be a rotation matrix, row by row")
    return R


def _chosen(element: Element) -> Lens:
    """Return a sensor's adjusted or initial lens, or else that of its nominal focal length."""
    mm = {
        name: entry.number("value")
        for entry in element.each("property")
        if (name := entry.attributes.get("name")) in ("pixel_width", "focal_length")
    }
    pixel, focal = mm.get("pixel_width", 0.0), mm.get("focal_length", 0.0)
    calibrations = {one.attributes.get("class"): one for one in element.each("calibration")}
    if (found := calibrations.get("adjusted") or calibrations.get(None)) is not None:
        lens, kind = _lens(found), "adjusted"
    elif "initial" in calibrations:
        lens, kind = _lens(calibrations["initial"]), "initial"
    elif pixel > 0 and focal > 0:
        lens, kind = _lens(element, focal / pixel), "nominal"
    else:
        expected = "must have one, or focal_length and pixel_width"
        raise element.wrong("has no adjusted calibration", expected)
    return replace(lens, pixel_um=1000 * pixel, kind=kind)


def _lens(element: Element, nominal: float | None = None) -> Lens:
    """Return the lens of a calibration, or of a sensor that has but a nominal f, px."""
    alone = element.maybe("projection")  # of a calibration that was saved
    kind = element.attributes.get("type", "frame") if alone is None else alone.text
    if kind not in MODELS:
        raise (alone or element).wrong(quoted(kind), f"must be one of {', '.join(MODELS)}")
    if element.maybe("fx") is not None:
        fault = "has <fx>: PhotoScan before 1.2 wrote it, whose p1 and p2 mean other things"
        raise element.wrong(fault, "must have <f>; save the project with a newer version")
    formula, sides = MODELS[kind], ("width", "height")
    if (size := element.maybe("resolution")) is None:
        width, height = (int(element.one(side).number(allowed=PIXELS)) for side in sides)
    else:
        width, height = (int(size.number(side, PIXELS)) for side in sides)
    known = ("cx", "cy", "b1", "b2", *formula.names)
    values = dict.fromkeys(known, 0.0)
    values |= {one.tag: one.number() for one in element.below if one.tag in known}
    f = element.one("f").number(allowed=POSITIVE) if nominal is None else nominal
    if f + values["b1"] <= 0:
        raise element.wrong("f + b1 is not positive", "must be a focal length in px")
    return Lens(
        width_px=width,
        height_px=height,
        hole=Pinhole(
            fx=f + values["b1"],
            fy=f,
            cx=(width - 1) / 2 + values["cx"],
            cy=(height - 1) / 2 + values["cy"],
            skew=values["b2"],
        ),
        distortion=formula.distortion([values[name] for name in formula.names]),
        is_fisheye=formula.is_fisheye,
        wrong=element.wrong,
    )


# images


@dataclass(frozen=True, kw_only=True)
class _Shot:
    """An image, its pose, and for an image that leads an exposure what was measured of it.

    `place` are x, y, z and `turns` are yaw, pitch, roll, degrees, None where they are absent or
    switched off. The pose is in the ECEF frame of the chunk's coordinate system, in its own
    coordinates where that is local or has no place.
    """

    name: str
    exposure: str
    sensor: _Sensor
    enabled: bool
    T_c: Pose | None
    reference: Element | None
    place: Array | None
    turns: Array | None


_Place = tuple[Array, Array, float]
"""The chunk's coordinates in the frame of poses: R, r, scale of x_e = scale R x + r."""


def _shots(
    cameras: Sequence[Element], sensors: Mapping[str, _Sensor], places: Mapping[str, _Place]
) -> tuple[dict[str, _Shot], int]:
    """Return the images of a chunk by their numbers, and how many labels stand twice."""
    names, doubled = _named(cameras, [camera.attribute("label").strip() for camera in cameras])
    elements = dict(zip(names, cameras, strict=True))
    for element in cameras:
        i, leader = element.attribute("sensor_id"), element.attributes.get("master_id")
        if i not in sensors:
            raise element.wrong(quoted(i), "must be a sensor's id", attribute="sensor_id")
        if leader is not None and leader not in elements:
            raise element.wrong(quoted(leader), "must be a camera's id", attribute="master_id")
    shots = {}
    for i, element in elements.items():
        leader = element.attributes.get("master_id", i)
        master, sensor = elements[leader], sensors[element.attribute("sensor_id")]
        R_b_master = sensors[master.attribute("sensor_id")].lens.mount.R
        reference = element.maybe("reference") if i == leader else None
        shots[i] = _Shot(
            name=names[i],
            exposure=names[leader],
            sensor=sensor,
            enabled=_is_on(element) and _is_on(master),
            T_c=_pose(master, R_b_master.T @ sensor.lens.mount.R, places),
            reference=reference,
            place=_three(reference, LOCATION, "enabled"),
            turns=_three(reference, ANGLES, "enabled", "rotation_enabled"),
        )
    return shots, doubled


def _pose(master: Element, R_master_c: Array, places: Mapping[str, _Place]) -> Pose | None:
    """Return a camera's pose; None where it is not aligned, or its component has no place."""
    element = master.maybe("transform")
    place = places.get(master.attributes.get("component_id", "")) or places.get("")
    if element is None or (places and place is None):
        return None
    values = element.numbers(16).reshape(4, 4)
    R, r = values[:3, :3], values[:3, 3]
    if not is_rotation(R):
        raise element.wrong("does not turn", "must be a rotation and a place, row by row")
    R = nearest_rotation(R) @ FLIP @ R_master_c
    if place is None:
        return Pose(R=R, r=r)
    R_e, r_e, scale = place
    return Pose(R=R_e @ R, r=r_e + scale * transform(R_e, r))


def _places(root: Element) -> dict[str, _Place]:
    """Return the transformations of a chunk's components by their numbers; its own is ""."""
    parts = {one.attributes.get("id", ""): one for one in root.each("components", "component")}
    places = {}
    for i, part in {"": root, **parts}.items():
        if (element := part.maybe("transform")) is None:
            continue
        R = nearest_rotation(_matrix(element.one("rotation"), 1e-4))
        scale, shift = element.maybe("scale"), element.one("translation")
        size = 1.0 if scale is None else scale.number(allowed=POSITIVE)
        places[i] = (R, shift.numbers(3), size)
    return places


def _accuracy(reference: Element, names: tuple[str, str, str]) -> Array:
    """Return the sigmas of three values, shape (3,); NaN where a value has none that is positive.

    An attribute names the values that it is of: ``sx``, ``sxy``, ``sxyz``, ``syaw``, ``sypr``. That
    of the fewest values counts.
    """
    sigma = []
    for name in names:
        given = [one for one in (f"s{name}", *TOGETHER[name]) if one in reference.attributes]
        sigma.append(reference.number(given[0]) if given else np.nan)
    return np.where(np.array(sigma) > 0, sigma, np.nan)


def _three(element: Element | None, names: tuple[str, ...], *switches: str) -> Array | None:
    """Return three values of a reference, None where one is absent or a switch is off."""
    if element is None or any(name not in element.attributes for name in names):
        return None
    if not all(_is_on(element, switch) for switch in switches):
        return None
    return np.array([element.number(name) for name in names])


def _is_on(element: Element, switch: str = "enabled") -> bool:
    """Tell whether an image, or its reference, takes part in Metashape's adjustment."""
    return element.attributes.get(switch, "true") not in ("false", "0")


# where they are


def _system(
    whole: _Chunk, shots: Sequence[_Shot], *, wanted: str | None, heights: str | float | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where the chunk has none."""
    element = whole.root.maybe("reference")
    text = "" if element is None else element.text
    places = [shot.place for shot in shots if shot.enabled and shot.place is not None]
    with told(whole.where.wrong, FLYABLE):
        if wanted is None and text and parsed(text).is_engineering:
            wanted = LOCAL  # that of a test field or a building site, on no map
        system = coordinates.chosen(text, places[0][:2] if places else None, wanted)
    return system if system is None or heights is None else replace(system, heights=heights)


def _in_grid(whole: _Chunk, system: Chosen | None, *, placed: bool) -> InGrid:
    """Return the map from the frame of poses into the grid."""
    if system is None:
        expected = "adjusted orientations need one"
        return nowhere(whole.where.wrong("is no coordinate system on the Earth", expected))
    if system.crs == LOCAL:
        return as_they_are
    if not placed:
        return nowhere(whole.root.wrong("<transform> is missing", "required"))
    if system.source is None:
        return as_they_are

    def in_grid(T: Pose) -> tuple[Array, Array]:
        with told(whole.where.wrong, FLYABLE):
            return grid_poses_of_ecef(system.grid(), T)

    return in_grid


def _measured(whole: _Chunk, shots: Sequence[_Shot], system: Chosen | None) -> Trajectory:
    """Return the trajectory from references with both position and angles switched on."""
    leaders = [shot for shot in shots if shot.enabled and shot.reference is not None]
    off = _switched_off(leaders)
    rows = [shot for shot in leaders if shot.place is not None and shot.turns is not None]
    if not rows or system is None:
        n = sum(shot.place is not None for shot in leaders)
        lacks = "the chunk has no coordinate system (--crs)"
        why = lacks if rows else "none has angles as well, which trajectory.csv needs"
        cure = "another import, or --orientations adjusted"
        sentence = f"{n} measured camera positions: {why}; {cure}"
        return Trajectory(left_out=(*off, sentence) if n else off)
    names, places = [shot.exposure for shot in rows], np.array([shot.place for shot in rows])
    yaw, pitch, roll = np.array([shot.turns for shot in rows]).T
    table: dict[str, object] = {}
    of_positions: tuple[str, ...] = ()
    if system.crs == LOCAL:
        north = "y"
        rph = np.radians(np.stack([roll, pitch, yaw], axis=1))
        table |= trajectory_in_grid(names, places, LocalFrame().pose_from_rph(places, rph).opk)
    else:
        lonlath, of_positions = _geographic(whole, places, system)
        north = "true north"
        if system.source is None:
            north = f"the north of {system.crs}, made true by the convergence"
            yaw = yaw + np.degrees(system.grid().convergence(lonlath[:, :2]))
        table |= {
            "exposure": names,
            "lat_deg": np.round(lonlath[:, 1], DEGREES + 1).tolist(),
            "lon_deg": np.round(lonlath[:, 0], DEGREES + 1).tolist(),
            "height_m": np.round(lonlath[:, 2], METRES).tolist(),
            "roll_deg": np.round(roll, DEGREES).tolist(),
            "pitch_deg": np.round(pitch, DEGREES).tolist(),
            "heading_deg": np.round(yaw, DEGREES).tolist(),
        }
    sigmas, whose = _sigmas(whole, [shot.reference for shot in rows if shot.reference])
    said = (
        f"Yaw is the heading, clockwise from {north}, pitch is positive with the top of the image "
        "up, roll with its right side down; positions are those of the camera"
    )
    return Trajectory(table=table | sigmas, assumed=(*of_positions, said, *whose), left_out=off)


def _switched_off(leaders: Sequence[_Shot]) -> tuple[str, ...]:
    """Return sentences on measured positions and angles that are switched off."""
    places = [shot for shot in leaders if shot.place is None]
    turns = [shot for shot in leaders if shot.turns is None]
    counted = {
        'positions, with their angles, that are switched off (enabled="false")': sum(
            _three(shot.reference, LOCATION) is not None for shot in places
        ),
        'attitudes that are switched off (rotation_enabled="false")': sum(
            _three(shot.reference, ANGLES, "enabled") is not None for shot in turns
        ),
    }
    return tuple(f"{n} measured {kind}: they are not used" for kind, n in counted.items() if n)


def _sigmas(
    whole: _Chunk, references: Sequence[Element]
) -> tuple[dict[str, object], tuple[str, ...]]:
    """Return columns of the references' accuracies, or else those of the chunk, and whose they are.

    A sentence says of how many references they are where not all have one.
    """
    kinds = (
        ("positions", LOCATION, ("east_m", "north_m", "height_m"), "accuracy_cameras"),
        ("attitudes", ANGLES, ("heading_deg", "pitch_deg", "roll_deg"), "accuracy_cameras_ypr"),
    )
    columns: dict[str, object] = {}
    whose = []
    for kind, names, units, common in kinds:
        sigma = np.array([_accuracy(reference, names) for reference in references])
        lacking = np.isnan(sigma)
        if lacking.all():
            continue
        if lacking.any() and common not in whole.settings:
            bare = references[int(np.flatnonzero(lacking.any(axis=1))[0])]
            expected = f"others have one; or {common} is needed"
            raise bare.wrong(f"has no accuracy of {', '.join(names)}", expected)
        if n := int((~lacking.any(axis=1)).sum()) % len(references):
            said = f"{n} of {len(references)} {kind} have an accuracy of their own"
            whose.append(f"{said}; others have the chunk's")
        sigma[lacking] = whole.settings.get(common, np.nan)
        columns |= {f"sigma_{u}": v for u, v in zip(units, sigma.T.tolist(), strict=True)}
    return columns, tuple(whose)


def _geographic(whole: _Chunk, xyh: Array, system: Chosen) -> tuple[Array, tuple[str, ...]]:
    """Return longitude, latitude, height of references, and sentences on assumptions."""
    source = system.source
    are_degrees = (np.abs(xyh[:, 0]) <= 180).all() and (np.abs(xyh[:, 1]) <= 90).all()
    with told(whole.where.wrong, FLYABLE):
        grid = system.grid()
        if source is None or not source.is_projected or not are_degrees:
            enh = coordinates.into(system, xyh)
            return np.column_stack([grid.lonlat_from_grid(enh[:, :2]), enh[:, 2]]), ()
        enh = np.column_stack([grid.grid_from_lonlat(xyh[:, :2]), xyh[:, 2]])
        enh = coordinates.with_heights(system, enh, coordinates.heights_of(source))
    sentence = (
        "Positions of cameras are longitude and latitude: as coordinates of the chunk's "
        "system they would lie at its origin"
    )
    return np.column_stack([xyh[:, :2], enh[:, 2]]), (sentence,)


# markers


def _located(whole: _Chunk, cameras: Sequence[str]) -> tuple[Measured, Mask, int]:
    """Return markers in images, which of them are pinned, and how many are in unknown cameras."""
    labels: dict[str, Element] = {}
    markers = list(whole.root.each("markers", "marker"))
    for marker in markers:
        label = marker.attribute("label").strip()
        if labels.setdefault(label, marker) is not marker:
            fault = f"{quoted(label)} is there twice"
            raise marker.wrong(fault, "must be unique", attribute="label")
    names, _ = _named(markers, list(labels))
    row = {camera: k for k, camera in enumerate(cameras)}
    places: dict[tuple[str, str], Element] = {}
    lost = 0
    for marker in whole.frame.each("markers", "marker") if whole.frame else ():
        i = marker.attribute("marker_id")
        if i not in names:
            raise marker.wrong(quoted(i), "must be a marker's id", attribute="marker_id")
        for place in marker.each("location"):
            camera = place.attribute("camera_id")
            if places.setdefault((i, camera), place) is not place:
                raise place.wrong(f"marker {names[i]} is twice in one camera", "must be there once")
            lost += camera not in row
    known = [(*key, place) for key, place in places.items() if key[1] in row]
    seen = [
        (row[camera], names[i], [place.number(axis, RANGES["col_px"]) - HALF for axis in "xy"])
        for i, camera, place in known
    ]
    pinned = [place.attributes.get("pinned") in ("true", "1") for _, _, place in known]
    return Measured.of(seen), np.array(pinned, dtype=bool), lost


def _control(whole: _Chunk, system: Chosen | None) -> Control:
    """Return the markers with coordinates, in the flight's system or, without one, their own."""
    surveyed = [
        (marker.attribute("label").strip(), reference, place)
        for marker in whole.root.each("markers", "marker")
        if (reference := marker.maybe("reference")) is not None
        and (place := _three(reference, LOCATION)) is not None
    ]
    sigma = np.array([_accuracy(one, LOCATION) for _, one, _ in surveyed]).reshape(-1, 3)
    xyh = np.array([place for _, _, place in surveyed]).reshape(-1, 3)
    if system is not None and len(xyh):
        with told(whole.where.wrong, FLYABLE):
            xyh = coordinates.into(system, xyh)
    common = whole.settings.get("accuracy_markers", MARKER_SIGMA_M)
    return Control(
        names=tuple(name for name, _, _ in surveyed),
        enh=xyh,
        sigma=np.where(np.isnan(sigma), common, sigma),
        is_check=tuple(not _is_on(reference) for _, reference, _ in surveyed),
    )


def _proofs(
    whole: _Chunk, located: Measured, pinned: Mask, control: Control, system: Chosen | None
) -> tuple[Proof, ...]:
    """Return the proofs by markers: located by Metashape, measured, and surveyed."""
    computed = Proof(
        whose="the locations that Metashape computed itself", measured=located.where(~pinned)
    )
    measured = Proof(whose="the measured locations of each marker", measured=located.where(pinned))
    if system is None or not control.names:
        return computed, measured
    x_e = control.enh
    if system.source is not None:
        with told(whole.where.wrong, FLYABLE):
            grid = system.grid()
        lonlat = grid.lonlat_from_grid(x_e[:, :2])
        height = x_e[:, 2] + grid.undulation(lonlat)
        x_e = grid.ecef_from_geographic(np.column_stack([lonlat, height]))
    known, nowhere_known = dict(zip(control.names, x_e, strict=True)), np.full(3, np.nan)
    x_w = np.array([known.get(name, nowhere_known) for name in located.points])
    surveyed = Proof(
        whose="the surveyed markers, by Metashape's adjusted orientations,",
        measured=replace(located.where(pinned), x_w=x_w),
    )
    return computed, measured, surveyed
