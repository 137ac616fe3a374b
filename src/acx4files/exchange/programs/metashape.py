"""Metashape: its projects and exported XML, and calibrations that it saved.

Sources: the user manual's appendix on camera models (versions 1.2 to 2.2), and files that Metashape
1.7 wrote. A calibration has x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + (p1 (r² + 2x²) + 2 p2 x y)
(1 + p3 r² + p4 r⁴), y' likewise with p1 and p2 exchanged; u = w/2 + cx + x' f + x' b1 + y' b2,
v = h/2 + cy + y' f, from the outer corner of the top-left pixel.

Only a location of a marker with ``pinned="true"`` was measured. The others are where Metashape
expects the marker: they follow from its own adjustment and say nothing that is new.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Annotated, TypeVar

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
from acx4files.exchange.safe import Element, Opened
from acx4files.flight.problems import PIXELS, RANGES, Range, quoted
from acx4lib.expected import Array, Mask
from acx4lib.geometry.frames import Pose, transform
from acx4lib.geometry.geodesy import LOCAL, LocalFrame

T = TypeVar("T")

CALIBRATION = "calibration"
"""Outermost element of a calibration that was saved alone."""

DOCUMENT = "doc.xml"
"""The XML in each of a project's archives."""

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in Metashape."""

POSITIVE = Range(1e-9, 1e9, "must be positive")
VALUES = Range(-1e9, 1e9)

LARGEST = 1e9
"""Largest coordinate of a chunk, or of the place where it lies."""

LOCATION, ANGLES = ("x", "y", "z"), ("yaw", "pitch", "roll")
TOGETHER = {
    "x": ("sxy", "sxyz"),
    "y": ("sxy", "sxyz"),
    "z": ("sxyz",),
    **dict.fromkeys(ANGLES, ("sypr", "syawpitchroll")),
}
"""Attributes with the accuracy of several values of a reference, the narrowest first."""

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
    listed = whole.root.maybe("cameras")
    if listed is None or next(listed.everywhere("camera"), None) is None:
        return _cameras_alone(whole)
    sensors = _sensors(whole.root)
    shots, doubled = _shots(whole.root, sensors)
    _require_some(whole, shots, orientations)
    system = _system(whole, shots, wanted=crs, heights=heights)
    places = _places(whole)
    located, pinned, lost = _located(whole, list(shots))
    control = _control(whole, system)
    images, in_grid = _images(whole, shots, places, system)
    label = whole.root.attributes.get("label", "").strip() or "Metashape"
    unknown = 0 if system else len(control.names)
    return Project(
        source=_version(whole),
        sources=whole.sources,
        lenses={sensor.name: sensor.lens for sensor in sensors.values()},
        images=images,
        measured=located.where(pinned),
        proofs=_proofs(whole, located, pinned, control, system if places else None),
        control=control if system else None,
        settings={"name": label, **(system.settings if system else {}), "apriori": _apriori(whole)},
        in_grid=in_grid,
        trajectory=_measured(whole, shots, system) if orientations == "initial" else Trajectory(),
        lost={
            'marker locations without pinned="true": Metashape computed them, nobody measured '
            "them": int((~pinned).sum()),
            "marker locations in cameras that the chunk has not": lost,
            "surveyed markers: the chunk has no coordinate system (--crs)": unknown,
            "labels of cameras that occur twice: their numbers stand behind them": doubled,
            f"other chunks: {', '.join(whole.others)}": len(whole.others),
            **_odd(whole.root),
        },
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        found=_slaves(sensors),
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
    return flight_of(
        project(source, orientations=orientations, crs=crs, heights=heights),
        orientations=orientations,
        block=block,
        pixel_um=pixel_um,
        allow=allow,
    )


def _cameras_alone(whole: _Chunk) -> Project:
    """Return a calibration that Metashape saved, or the sensors of a chunk without images."""
    if whole.root.tag == CALIBRATION:
        lenses = {Path(whole.sources[0].file).stem: _lens(whole.root)}
    else:
        sensors = _sensors(whole.root).values()
        lenses = {sensor.name: replace(sensor.lens, kind="") for sensor in sensors}
    return Project(source="Metashape's cameras", sources=whole.sources, lenses=lenses)


def _require_some(whole: _Chunk, shots: Mapping[str, _Shot], orientations: str) -> None:
    """Raise where no image can be part of the flight."""
    adjusted = orientations == "adjusted"
    if not any(shot.enabled and (shot.T_c or not adjusted) for shot in shots.values()):
        kind = "aligned" if adjusted else "enabled"
        raise whole.root.one("cameras").wrong(f"has no {kind} camera", "must have one")


def _system(
    whole: _Chunk, shots: Mapping[str, _Shot], *, wanted: str | None, heights: str | float | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where the chunk has none."""
    element = whole.root.maybe("reference")
    text = "" if element is None else element.text
    lonlat = next(
        (
            place[:2]
            for shot in shots.values()
            if shot.enabled
            and shot.reference is not None
            and (place := _measured_place(shot.reference)) is not None
        ),
        None,
    )
    if wanted is None and _told(whole, lambda: _is_engineers(text), element):
        wanted = LOCAL
    system = _told(whole, lambda: coordinates.chosen(text, lonlat, wanted), element)
    return system if system is None or heights is None else replace(system, heights=heights)


def _is_engineers(text: str) -> bool:
    """Tell whether a system is that of a test field or a building site, on no map."""
    return bool(text) and bool(parsed(text).is_engineering)


def _apriori(whole: _Chunk) -> dict[str, float]:
    settings = {key: _setting(whole, name) for key, name in APRIORI.items()}
    return {key: value for key, value in settings.items() if value}


def _version(whole: _Chunk) -> str:
    for setting in whole.root.each("meta", "property"):
        if setting.attributes.get("name") == "Info/LastSavedSoftwareVersion":
            return f"Metashape {setting.attribute('value')}"
    return "Metashape"


def _slaves(sensors: Mapping[str, _Sensor]) -> tuple[str, ...]:
    n = sum(sensor.master != i for i, sensor in sensors.items())
    sentence = f"{n} sensors are slaves of a rig; their mountings are relative to the master"
    return (sentence,) if n else ()


def _odd(root: Element) -> dict[str, int]:
    """Count the parts of a chunk that a flight cannot have."""
    sensors = list(root.each("sensors", "sensor"))
    tags = ("location", "translation", "rolling_shutter", "antenna")
    return {
        "further frames": max(0, len(list(root.each("frames", "frame"))) - 1),
        "offsets of sensors (of slaves, antennas, shutters): lever arms stay 0": sum(
            sensor.maybe(tag) is not None for sensor in sensors for tag in tags
        ),
        "slaves have no rotation: their mountings are the master's": sum(
            "master_id" in sensor.attributes and sensor.maybe("rotation") is None
            for sensor in sensors
        ),
    }


@dataclass(frozen=True, kw_only=True)
class _Chunk:
    """A chunk's XML, that of its first frame, the files, and the labels of the other chunks."""

    root: Element
    frame: Element | None
    sources: tuple[Opened, ...]
    others: tuple[str, ...] = ()


def _chunk(source: Path) -> _Chunk:
    """Return the active chunk, or the first where none is named."""
    file = safe.read(source)
    if file.data[:2] == b"PK":
        return _in_archive(file)
    root = safe.xml_tree(file)
    if root.tag == "document" and "path" in root.attributes:
        return _of_project(file, root)
    if root.tag == CALIBRATION:
        return _Chunk(root=root, frame=None, sources=(file,))
    if root.tag == "chunk":
        return _whole(root, (file,))
    if root.tag != "document":
        raise root.wrong("is no file of Metashape", "must begin with <document> or <chunk>")
    chunks = list(root.each("chunk"))
    labels = [chunk.attributes.get("label", "") for chunk in chunks]
    if not chunks:
        raise root.wrong("has no <chunk>", "must have one")
    return _whole(chunks[0], (file,), others=tuple(labels[1:]))


def _setting(chunk: _Chunk, name: str) -> float | None:
    """Return a positive number of the chunk's settings; None where there is none."""
    for setting in chunk.root.each("settings", "property"):
        if setting.attributes.get("name") == name and (value := setting.number("value")) > 0:
            return value
    return None


def _told(whole: _Chunk, work: Callable[[], T], element: Element | None = None) -> T:
    """Return the value of a call; its ValueError becomes a problem of an element of the chunk."""
    try:
        return work()
    except ValueError as error:
        message = " ".join(str(error).split())
        raise (element or whole.root).wrong(message, "must be what a flight can have") from None


def _of_project(file: Opened, root: Element) -> _Chunk:
    """Return a chunk of a .psx; it names an archive with the names of the chunks' archives."""
    folder = Path(file.file).parent
    name = root.attribute("path").replace("{projectname}", Path(file.file).stem)
    project = safe.member(safe.read(_inside(root, folder, name)), DOCUMENT)
    document = safe.xml_tree(project)
    listed = list(document.each("chunks", "chunk"))
    within = (folder / name).parent
    active = document.one("chunks").attributes.get("active_id")
    ids = [entry.attributes.get("id") for entry in listed]
    if not listed:
        raise document.wrong("has no <chunk>", "must have one")
    wanted = ids.index(active) if active in ids else 0
    chunks = (
        _in_archive(safe.read(_inside(entry, within, entry.attribute("path")))) for entry in listed
    )
    others = []
    for k, chunk in enumerate(chunks):  # of chunks that are not wanted the label alone is kept
        if k == wanted:
            selected = chunk
        else:
            others.append(chunk.root.attributes.get("label", ""))
    return replace(selected, sources=(file, project, *selected.sources), others=tuple(others))


def _in_archive(file: Opened) -> _Chunk:
    document = safe.member(file, DOCUMENT)
    root = safe.xml_tree(document)
    if root.tag != "chunk":
        raise root.wrong("is no chunk", "must begin with <chunk>")
    return _whole(root, (document,))


def _whole(root: Element, sources: tuple[Opened, ...], *, others: tuple[str, ...] = ()) -> _Chunk:
    """Return a chunk with its first frame, which may lie in an archive of its own."""
    frame = root.maybe("frames", "frame")
    if frame is not None and "path" in frame.attributes:
        # Below the chunk's archive; an archive's name ends with that of its member.
        folder = Path(sources[0].file.removesuffix(f"/{DOCUMENT}")).parent
        place = _inside(frame, folder, frame.attribute("path"))
        document = safe.member(safe.read(place), DOCUMENT)
        frame, sources = safe.xml_tree(document), (*sources, document)
    return _Chunk(root=root, frame=frame, sources=sources, others=others)


def _inside(element: Element, folder: Path, name: str) -> Path:
    """Return the path of a file in a project; it must lie below the project's folder."""
    parts = PurePosixPath(name.replace("\\", "/"))
    if parts.is_absolute() or ".." in parts.parts or ":" in name:
        raise element.wrong(quoted(name), "must lie below the project's folder", attribute="path")
    return folder / parts


# sensors


@dataclass(frozen=True, kw_only=True)
class _Sensor:
    """A sensor: its label, its lens, and the sensor whose slave it is, or its own number."""

    name: str
    lens: Lens
    master: str


def _sensors(root: Element) -> dict[str, _Sensor]:
    """Return the sensors of a chunk's images by numbers; all, where it has no image."""
    elements = list(root.each("sensors", "sensor"))
    if not elements:
        raise root.wrong("has no <sensor>", "must have one")
    ids = [sensor.attribute("id") for sensor in elements]
    labels = [sensor.attributes.get("label", "").strip() or "unknown" for sensor in elements]
    names, _ = without_doubles(labels, ids)
    places = dict(zip(names, elements, strict=True))
    require_names(
        names, lambda name, fault, expected: places[name].wrong(fault, expected, attribute="label")
    )
    sensors = {}
    images = [camera for listed in root.each("cameras") for camera in listed.everywhere("camera")]
    used = {camera.attributes.get("sensor_id") for camera in images} or set(ids)
    for i, name, element in zip(ids, names, elements, strict=True):
        if i in sensors:
            raise element.wrong(f"{quoted(i)} is there twice", "must be unique", attribute="id")
        master = element.attributes.get("master_id", i)
        if master not in ids:
            raise element.wrong(quoted(master), "must be a sensor's id", attribute="master_id")
        if i in used:
            sensors[i] = _sensor(element, name, master, is_slave=master != i)
    return sensors


def _sensor(element: Element, name: str, master: str, *, is_slave: bool) -> _Sensor:
    pixel_um = 1000 * (_property(element, "pixel_width") or 0.0)
    mount = Pose(R=TOP_AHEAD @ _mount_rotation(element, is_slave=is_slave), r=np.zeros(3))
    lens = replace(_chosen(element), pixel_um=pixel_um, mount=mount)
    return _Sensor(name=name, lens=lens, master=master)


def _mount_rotation(element: Element, *, is_slave: bool) -> Array:
    """Return R_master_slave in the library's camera axes; what is written is slave to master."""
    rotation = element.maybe("rotation")
    if rotation is None or not is_slave:
        return np.eye(3)
    R = rotation.numbers(9).reshape(3, 3)
    if not is_rotation(R, 1e-5):
        raise rotation.wrong("is no rotation", "must be a rotation matrix, row by row")
    return np.asarray(turned(R))


def _chosen(element: Element) -> Lens:
    """Return a sensor's adjusted or initial lens, or else that of its nominal focal length."""
    calibrations = {
        calibration.attributes.get("class", "adjusted"): calibration
        for calibration in element.each("calibration")
    }
    for kind in ("adjusted", "initial"):
        if kind in calibrations:
            return replace(_lens(calibrations[kind]), kind=kind)
    focal, pixel = (_property(element, name) for name in ("focal_length", "pixel_width"))
    if not focal or not pixel:
        raise element.wrong(
            "has no adjusted calibration", "must have one, or focal_length and pixel_width"
        )
    return replace(_lens_of(element, {"f": focal / pixel}), kind="nominal")


def _lens(element: Element) -> Lens:
    """Return the lens of an element ``calibration``, of a sensor or of a file of its own."""
    if element.maybe("fx") is not None:
        raise element.wrong(
            "has <fx>: PhotoScan before 1.2 wrote it, whose p1 and p2 mean other things",
            "must have <f>; open and save the project with a newer version",
        )
    known = ("cx", "cy", "b1", "b2", *MODELS["frame"].names)
    values = {
        parameter.tag: parameter.number() for parameter in element.below if parameter.tag in known
    }
    values["f"] = element.one("f").number(allowed=POSITIVE)
    if values["f"] + values.get("b1", 0.0) <= 0:
        raise element.wrong("f + b1 is not positive", "must be a focal length in px")
    return _lens_of(element, values)


def _lens_of(element: Element, values: Mapping[str, float]) -> Lens:
    """Return the lens of a type and a size by its values, px; absent is zero."""
    width, height = _resolution(element)
    formula = MODELS[_type(element)]
    fx, fy = values["f"] + values.get("b1", 0.0), values["f"]
    return Lens(
        width_px=width,
        height_px=height,
        hole=Pinhole(
            fx=fx,
            fy=fy,
            cx=(width - 1) / 2 + values.get("cx", 0.0),
            cy=(height - 1) / 2 + values.get("cy", 0.0),
            skew=values.get("b2", 0.0),
        ),
        distortion=formula.distortion([values.get(name, 0.0) for name in formula.names]),
        is_fisheye=formula.is_fisheye,
        wrong=element.wrong,
    )


def _type(element: Element) -> str:
    alone = element.maybe("projection")
    kind = element.attributes.get("type", "frame") if alone is None else alone.text
    if kind not in MODELS:
        expected = f"must be one of {', '.join(MODELS)}"
        if alone is not None:
            raise alone.wrong(quoted(kind), expected)
        raise element.wrong(quoted(kind), expected, attribute="type")
    return kind


def _resolution(element: Element) -> tuple[int, int]:
    if element.maybe("width") is not None:
        width, height = (element.one(side).number(allowed=PIXELS) for side in ("width", "height"))
    else:
        size = element.one("resolution")
        width, height = (size.number(side, PIXELS) for side in ("width", "height"))
    return int(width), int(height)


def _property(element: Element, name: str) -> float | None:
    """Return a sensor's property in mm; None where it is absent or zero."""
    for entry in element.each("property"):
        if entry.attributes.get("name") == name:
            value = entry.number("value")
            if value == 0:
                return None
            in_um = RANGES["pixel_um"]
            if name == "pixel_width" and 1000 * value not in in_um:
                raise entry.wrong(f"{value:g} mm", f"{in_um} µm", attribute="value")
            return value
    return None


# images


@dataclass(frozen=True, kw_only=True)
class _Shot:
    """An image: its pose in the chunk, its measured reference, the component of its pose."""

    name: str
    exposure: str
    sensor: _Sensor
    enabled: bool
    T_c: Pose | None
    reference: Element | None
    component: str


def _shots(root: Element, sensors: Mapping[str, _Sensor]) -> tuple[dict[str, _Shot], int]:
    """Return the images of a chunk by their numbers, and how many labels stand twice."""
    elements = {}
    for element in root.one("cameras").everywhere("camera"):
        i = element.attribute("id")
        if i in elements:
            raise element.wrong(f"{quoted(i)} is there twice", "must be unique", attribute="id")
        if element.attribute("sensor_id") not in sensors:
            sensor_id = quoted(element.attribute("sensor_id"))
            raise element.wrong(sensor_id, "must be a sensor's id", attribute="sensor_id")
        elements[i] = element
    labels = [camera.attribute("label").strip() for camera in elements.values()]
    names, doubled = without_doubles(labels, list(elements))
    places = dict(zip(names, elements.values(), strict=True))
    require_names(
        names, lambda name, fault, expected: places[name].wrong(fault, expected, attribute="label")
    )
    named = dict(zip(elements, names, strict=True))
    return {i: _shot(element, elements, named, sensors) for i, element in elements.items()}, doubled


def _shot(
    element: Element,
    elements: Mapping[str, Element],
    named: Mapping[str, str],
    sensors: Mapping[str, _Sensor],
) -> _Shot:
    i = element.attribute("id")
    leader = element.attributes.get("master_id", i)
    if leader not in elements:
        raise element.wrong(quoted(leader), "must be a camera's id", attribute="master_id")
    master = elements[leader]
    sensor = sensors[element.attribute("sensor_id")]
    return _Shot(
        name=named[i],
        exposure=named[leader],
        sensor=sensor,
        enabled=_is_on(element) and _is_on(master),
        T_c=_pose(master, sensor, sensors[master.attribute("sensor_id")]),
        reference=element.maybe("reference") if i == leader else None,
        component=master.attributes.get("component_id", ""),
    )


def _pose(master: Element, sensor: _Sensor, of_master: _Sensor) -> Pose | None:
    """Return a camera's pose in the chunk."""
    transform = master.maybe("transform")
    if transform is None:
        return None
    values = transform.numbers(16).reshape(4, 4)
    R = values[:3, :3]
    if not is_rotation(R) or np.abs(values[:3, 3]).max() > LARGEST:
        raise transform.wrong("does not turn", "must be a rotation and a place, row by row")
    R_master_c = of_master.lens.mount.R.T @ sensor.lens.mount.R
    return Pose(R=nearest_rotation(R) @ FLIP @ R_master_c, r=values[:3, 3])


def _location(reference: Element) -> Array | None:
    """Return x, y, z of a reference, shape (3,); None where one is absent."""
    return _three(reference, LOCATION)


def _rotation(reference: Element) -> Array | None:
    """Return yaw, pitch, roll of a reference, degrees, shape (3,); None where one is absent."""
    return _three(reference, ANGLES)


def _accuracy(reference: Element, names: tuple[str, str, str]) -> Array:
    """Return the sigmas of three values, shape (3,); NaN where a value has none that is positive.

    An attribute names the values that it is of: ``sx``, ``sxy``, ``sxyz``, ``syaw``, ``sypr``. That
    of the fewest values counts.
    """
    sigma = np.full(3, np.nan)
    for k, name in enumerate(names):
        for attribute in (f"s{name}", *TOGETHER[name]):
            if attribute in reference.attributes:
                value = reference.number(attribute, VALUES)
                sigma[k] = value if value > 0 else np.nan
                break
    return sigma


def _measured_place(reference: Element) -> Array | None:
    """Return the location of a reference, as `location`; None where it is switched off."""
    return _location(reference) if _is_on(reference) else None


def _measured_rotation(reference: Element) -> Array | None:
    """Return the rotation of a reference, as `rotation`; None where it is switched off."""
    switched_on = _is_on(reference) and _is_on(reference, "rotation_enabled")
    return _rotation(reference) if switched_on else None


def _three(element: Element, names: tuple[str, ...]) -> Array | None:
    if any(name not in element.attributes for name in names):
        return None
    return np.array([element.number(name, VALUES) for name in names])


def _is_on(element: Element, switch: str = "enabled") -> bool:
    """Tell whether an image, or its reference, takes part in Metashape's adjustment."""
    return element.attributes.get(switch, "true") not in ("false", "0")


# where they are


@dataclass(frozen=True, kw_only=True, eq=False)
class _Similarity:
    """The chunk's coordinates in the ECEF frame of its coordinate system: x_e = s R x + r.

    Where that is local, it has no such frame, and x_e are its own coordinates.
    """

    R: Array
    r: Array
    scale: float

    def pose(self, T_c: Pose) -> Pose:
        """Return poses in the ECEF frame."""
        return Pose(R=self.R @ T_c.R, r=self.r + self.scale * transform(self.R, T_c.r))


def _places(whole: _Chunk) -> dict[str, _Similarity]:
    """Return the transformations of a chunk's components by their numbers; its own is ""."""
    transforms = {"": whole.root.maybe("transform")}
    for component in whole.root.each("components", "component"):
        transforms[component.attributes.get("id", "")] = component.maybe("transform")
    return {i: _similarity(element) for i, element in transforms.items() if element is not None}


def _similarity(element: Element) -> _Similarity:
    rotation = element.one("rotation")
    R = rotation.numbers(9).reshape(3, 3)
    if not is_rotation(R):
        raise rotation.wrong("is no rotation", "must be a rotation matrix, row by row")
    scale = element.maybe("scale")
    size = 1.0 if scale is None else scale.number()
    if scale is not None and not 0 < size <= LARGEST:
        raise scale.wrong(f"{size:g}", f"must be positive, at most {LARGEST:g}")
    place = element.one("translation")
    r = place.numbers(3)
    if np.abs(r).max() > LARGEST:
        raise place.wrong("is too large", f"must be at most {LARGEST:g} either way")
    return _Similarity(R=nearest_rotation(R), r=r, scale=size)


def _images(
    whole: _Chunk,
    shots: Mapping[str, _Shot],
    places: Mapping[str, _Similarity],
    system: Chosen | None,
) -> tuple[Images, InGrid]:
    """Return all images, placed in the ECEF frame where possible, and the map into the grid."""
    poses = []
    for shot in shots.values():
        place = places.get(shot.component) or places.get("")
        if shot.T_c is None or (places and place is None):
            poses.append(UNKNOWN)
        else:
            poses.append(shot.T_c if place is None else place.pose(shot.T_c))
    images = Images(
        names=tuple(shot.name for shot in shots.values()),
        cameras=tuple(shot.sensor.name for shot in shots.values()),
        exposures=tuple(shot.exposure for shot in shots.values()),
        T_w_c=stacked(poses),
        enabled=np.array([shot.enabled for shot in shots.values()], dtype=bool),
    )
    element = whole.root.maybe("reference") or whole.root
    if system is None:
        expected = "adjusted orientations need one"
        return images, nowhere(element.wrong("is no coordinate system on the Earth", expected))
    if system.crs == LOCAL:
        return images, as_they_are
    if not places:
        return images, lambda _: _no_place(whole)
    if system.source is None:
        return images, as_they_are
    return images, lambda T: grid_poses_of_ecef(_told(whole, system.grid, element), T)


def _no_place(whole: _Chunk) -> tuple[Array, Array]:
    raise whole.root.wrong("<transform> is missing", "required")


def _measured(whole: _Chunk, shots: Mapping[str, _Shot], system: Chosen | None) -> Trajectory:
    """Return the trajectory from references with both position and angles switched on."""
    used = [shot for shot in shots.values() if shot.enabled]
    leaders = {shot.exposure: shot for shot in used}
    leaders |= {shot.exposure: shot for shot in used if shot.name == shot.exposure}
    rows = [
        (name, place, turns, shot.reference)
        for name, shot in leaders.items()
        if shot.reference is not None
        and (place := _measured_place(shot.reference)) is not None
        and (turns := _measured_rotation(shot.reference)) is not None
    ]
    off = _switched_off(leaders)
    if not rows or system is None:
        n = sum(
            shot.reference is not None and _measured_place(shot.reference) is not None
            for shot in leaders.values()
        )
        why = "none has angles as well, which trajectory.csv needs"
        if rows:
            why = "the chunk has no coordinate system (--crs)"
        sentence = (
            f"{n} measured camera positions: {why}; another import, or --orientations adjusted"
        )
        return Trajectory(left_out=(*off, *((sentence,) if n else ())))
    names, places, rotations, references = zip(*rows, strict=True)
    if system.crs == LOCAL:
        enh, rph = np.array(places), np.radians(np.array(rotations)[:, ::-1])
        opk = LocalFrame().pose_from_rph(enh, rph).opk
        local = trajectory_in_grid(list(names), enh, opk)
        return Trajectory(
            table={**local, **_sigmas(whole, references)},
            assumed=(_YAW.format(north="y"), *_whose_accuracy(references)),
            left_out=off,
        )
    lonlath, of_positions = _geographic(whole, np.array(places), system)
    yaw, pitch, roll = np.array(rotations).T
    north = "true north"
    if system.source is None:
        north = f"the north of {system.crs}, made true by the convergence"
        yaw = yaw + np.degrees(system.grid().convergence(lonlath[:, :2]))
    table: dict[str, object] = {
        "exposure": list(names),
        "lat_deg": np.round(lonlath[:, 1], DEGREES + 1).tolist(),
        "lon_deg": np.round(lonlath[:, 0], DEGREES + 1).tolist(),
        "height_m": np.round(lonlath[:, 2], METRES).tolist(),
        "roll_deg": np.round(roll, DEGREES).tolist(),
        "pitch_deg": np.round(pitch, DEGREES).tolist(),
        "heading_deg": np.round(yaw, DEGREES).tolist(),
        **_sigmas(whole, references),
    }
    assumed = (
        *of_positions,
        _YAW.format(north=north),
        *_whose_accuracy(references),
    )
    return Trajectory(table=table, assumed=assumed, left_out=off)


_YAW = (
    "Yaw is the heading, clockwise from {north}, pitch is positive with the top of the image up, "
    "roll with its right side down; positions are those of the camera"
)


def _switched_off(leaders: Mapping[str, _Shot]) -> tuple[str, ...]:
    """Return sentences on measured positions and angles that are switched off."""
    references = [shot.reference for shot in leaders.values() if shot.reference is not None]
    places = sum(
        _location(reference) is not None and _measured_place(reference) is None
        for reference in references
    )
    angles = sum(
        _is_on(reference)
        and _rotation(reference) is not None
        and _measured_rotation(reference) is None
        for reference in references
    )
    counted = (
        (places, 'positions, with their angles, that are switched off (enabled="false")'),
        (angles, 'attitudes that are switched off (rotation_enabled="false")'),
    )
    return tuple(f"{n} measured {kind}: they are not used" for n, kind in counted if n)


def _whose_accuracy(references: tuple[Element, ...]) -> tuple[str, ...]:
    """Return how many references have accuracies of their own, where not all have."""
    kinds = (("positions", LOCATION), ("attitudes", ANGLES))
    n = len(references)
    counts = {
        name: sum(bool(np.isfinite(_accuracy(reference, names)).all()) for reference in references)
        for name, names in kinds
    }
    return tuple(
        f"{k} of {n} {name} have an accuracy of their own; others have the chunk's"
        for name, k in counts.items()
        if 0 < k < n
    )


def _sigmas(whole: _Chunk, references: tuple[Element, ...]) -> dict[str, list[float]]:
    """Return columns of the references' accuracies, or else those of the chunk."""
    kinds = (
        (LOCATION, ("east_m", "north_m", "height_m"), "accuracy_cameras"),
        (ANGLES, ("heading_deg", "pitch_deg", "roll_deg"), "accuracy_cameras_ypr"),
    )
    columns: dict[str, list[float]] = {}
    for names, units, common in kinds:
        sigma = np.array([_accuracy(reference, names) for reference in references])
        lacking = np.isnan(sigma)
        if lacking.all():
            continue
        of_all = _setting(whole, common)
        if lacking.any() and of_all is None:
            bare = references[int(np.flatnonzero(lacking.any(axis=1))[0])]
            raise bare.wrong(
                f"has no accuracy of {', '.join(names)}", f"others have one; or {common} is needed"
            )
        sigma[lacking] = of_all or np.nan
        columns |= {f"sigma_{u}": v for u, v in zip(units, sigma.T.tolist(), strict=True)}
    return columns


def _geographic(whole: _Chunk, xyh: Array, system: Chosen) -> tuple[Array, tuple[str, ...]]:
    """Return longitude, latitude, height of references, and sentences on assumptions."""
    source = system.source
    are_degrees = (np.abs(xyh[:, 0]) <= 180).all() and (np.abs(xyh[:, 1]) <= 90).all()
    element = whole.root.maybe("reference")
    if source is not None and source.is_projected and are_degrees:
        grid = _told(whole, system.grid, element)
        enh = np.column_stack([grid.grid_from_lonlat(xyh[:, :2]), xyh[:, 2]])
        enh = _told(
            whole,
            lambda: coordinates.with_heights(system, enh, coordinates.heights_of(source)),
            element,
        )
        sentence = (
            "Positions of cameras are longitude and latitude: as coordinates of the chunk's "
            "system they would lie at its origin"
        )
        return np.column_stack([xyh[:, :2], enh[:, 2]]), (sentence,)
    enh = _told(whole, lambda: coordinates.into(system, xyh), element)
    grid = _told(whole, system.grid, element)
    return np.column_stack([grid.lonlat_from_grid(enh[:, :2]), enh[:, 2]]), ()


# markers


def _located(whole: _Chunk, cameras: list[str]) -> tuple[Measured, Mask, int]:
    """Return markers in images, which of them are pinned, and how many are in unknown cameras."""
    names = _markers(whole.root)
    labels, number = list(names.values()), {i: k for k, i in enumerate(names)}
    row = {camera: k for k, camera in enumerate(cameras)}
    rows: list[tuple[int, int, float, float]] = []
    pinned, seen, lost = [], set(), 0
    for marker in whole.frame.each("markers", "marker") if whole.frame else ():
        i = marker.attribute("marker_id")
        if i not in names:
            raise marker.wrong(quoted(i), "must be a marker's id", attribute="marker_id")
        for place in marker.each("location"):
            camera = place.attribute("camera_id")
            if camera not in row:
                lost += 1
                continue
            if (i, camera) in seen:
                raise place.wrong(f"marker {names[i]} is twice in one camera", "must be there once")
            seen.add((i, camera))
            x, y = (place.number(axis, RANGES["col_px"]) for axis in ("x", "y"))
            rows.append((row[camera], number[i], x - HALF, y - HALF))
            pinned.append(place.attributes.get("pinned") in ("true", "1"))
    table = np.array(rows, dtype=float).reshape(-1, 4)
    located = Measured(
        points=tuple(labels),
        image_idx=table[:, 0].astype(int),
        point_idx=table[:, 1].astype(int),
        colrow=table[:, 2:],
    )
    return located, np.array(pinned, dtype=bool), lost


def _markers(root: Element) -> dict[str, str]:
    """Return the labels of markers by their numbers."""
    labels: dict[str, str] = {}
    places: dict[str, Element] = {}
    for marker in root.each("markers", "marker"):
        label = marker.attribute("label").strip()
        if label in places:
            raise marker.wrong(
                f"{quoted(label)} is there twice", "must be unique", attribute="label"
            )
        places[label] = marker
        labels[marker.attribute("id")] = label
    require_names(
        list(places),
        lambda name, fault, expected: places[name].wrong(fault, expected, attribute="label"),
    )
    return labels


def _control(whole: _Chunk, system: Chosen | None) -> Control:
    """Return the markers with coordinates, in the flight's system or, without one, their own."""
    references = {
        marker.attribute("label").strip(): (reference, place)
        for marker in whole.root.each("markers", "marker")
        if (reference := marker.maybe("reference")) is not None
        and (place := _location(reference)) is not None
    }
    sigma = np.array([_accuracy(entry, LOCATION) for entry, _ in references.values()]).reshape(
        -1, 3
    )
    xyh: Array = np.array([place for _, place in references.values()]).reshape(-1, 3)
    if system is not None and len(xyh):
        element = whole.root.maybe("reference")
        xyh = _told(whole, lambda: coordinates.into(system, xyh), element)
    common = _setting(whole, "accuracy_markers") or MARKER_SIGMA_M
    return Control(
        names=tuple(references),
        enh=xyh,
        sigma=np.where(np.isnan(sigma), common, sigma),
        is_check=tuple(
            entry.attributes.get("enabled", "true") in ("false", "0")
            for entry, _ in references.values()
        ),
    )


def _proofs(
    whole: _Chunk, located: Measured, pinned: Mask, control: Control, system: Chosen | None
) -> tuple[Proof, ...]:
    """Return the proofs by markers: located by Metashape, measured, and surveyed."""
    proofs = [
        Proof(
            whose="the locations that Metashape computed itself", measured=located.where(~pinned)
        ),
        Proof(whose="the measured locations of each marker", measured=located.where(pinned)),
    ]
    if system is not None and control.names:
        element = whole.root.maybe("reference")
        x_e = _told(whole, lambda: _ecef(system, control.enh), element)
        x_w = dict(zip(control.names, x_e, strict=True))
        nowhere_known = np.full(3, np.nan)
        places = np.array([x_w.get(name, nowhere_known) for name in located.points])
        surveyed = replace(located.where(pinned), x_w=places)
        whose = "the surveyed markers, by Metashape's adjusted orientations,"
        proofs.append(Proof(whose=whose, measured=surveyed))
    return tuple(proofs)


def _ecef(system: Chosen, enh: Array) -> Array:
    """Return places in the flight's system in the frame of `_Similarity`, shape (n, 3)."""
    if system.source is None:
        return enh
    grid = system.grid()
    lonlat = grid.lonlat_from_grid(enh[:, :2])
    height = enh[:, 2] + grid.undulation(lonlat)
    return grid.ecef_from_geographic(np.column_stack([lonlat, height]))
