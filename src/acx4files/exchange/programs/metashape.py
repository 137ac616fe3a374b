"""Metashape: its projects and exported XML, and calibrations that it saved.

Sources: the user manual's appendix on camera models (versions 1.2 to 2.2), and files that Metashape
1.7 wrote. A calibration has x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + (p1 (r² + 2x²) + 2 p2 x y)
(1 + p3 r² + p4 r⁴), y' likewise with p1 and p2 exchanged; u = w/2 + cx + x' f + x' b1 + y' b2,
v = h/2 + cy + y' f, from the outer corner of the top-left pixel.

Only a location of a marker with ``pinned="true"`` was measured. The others are where Metashape
expects the marker: they follow from its own adjustment and say nothing that is new.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from acx4files.exchange import coordinates, lens, options, project, safe
from acx4files.exchange.coordinates import FLIP, TOP_AHEAD, Chosen
from acx4files.exchange.lens import Lens, Pinhole
from acx4files.exchange.project import Control, Measured, Project, Proof, Trajectory
from acx4files.exchange.safe import Element, Opened, told
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
ACCURACIES = {
    "x": ("sx", "sxy", "sxyz"),
    "y": ("sy", "sxy", "sxyz"),
    "z": ("sz", "sxyz"),
    **{name: (f"s{name}", "sypr", "syawpitchroll") for name in ANGLES},
}
"""Attributes with the accuracy of a value of a reference, the narrowest first."""

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


def read_project(
    source: Annotated[Path, options.Source],
    *,
    crs: options.CrsOfProject = None,
    heights: options.HeightsOfFlight = None,
    orientations: options.Orientations = "initial",
) -> Project:
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
        Where the file is no project of Metashape, or something in it cannot be.
    """
    chunk = _chunk(source)
    root = chunk.root
    cameras = project.by_id(_ids(one for one in root.each("cameras//camera")))
    if not cameras:
        return _cameras_alone(chunk)
    names, doubled = project.named(
        cameras, [one.attribute("label").strip() for one in cameras.values()]
    )
    sensors = _sensors(root, {camera.get("sensor_id") for camera in cameras.values()})
    places = _places(root)
    images = _images(cameras, names, sensors, places)
    adjusted = orientations == "adjusted"
    if not (images.used & (images.oriented | (not adjusted))).any():
        kind = "aligned" if adjusted else "enabled"
        raise root.one("cameras").wrong(f"has no {kind} camera", "must have one")
    flown = {
        name: reference
        for (i, camera), name, used in zip(cameras.items(), images.names, images.used, strict=True)
        if used and camera.get("master_id", i) == i
        if (reference := camera.maybe("reference")) is not None
    }
    system = _system(chunk, flown.values(), wanted=crs, heights=heights)
    located, pinned, lost = _located(chunk, list(cameras))
    control = _control(chunk, system)
    odd, found = _rig(root, sensors)
    apriori = {key: chunk.settings[name] for key, name in APRIORI.items() if name in chunk.settings}
    return Project(
        source=_version(root),
        sources=chunk.sources,
        lenses=dict(sensors.values()),
        images=images,
        measured=located.some(pinned),
        proofs=_proofs(chunk, located, pinned, control, system if places else None),
        control=control if system else None,
        settings={
            "name": root.get("label", "").strip() or "Metashape",
            **(system.settings if system else {}),
            "apriori": apriori,
        },
        orientations=orientations,
        in_grid=_in_grid(chunk, system, placed=bool(places)),
        trajectory=_measured(chunk, flown, system) if orientations == "initial" else Trajectory(),
        lost={
            'marker locations without pinned="true": Metashape computed them, nobody measured '
            "them": int((~pinned).sum()),
            "marker locations in cameras that the chunk has not": lost,
            "surveyed markers: the chunk has no coordinate system (--crs)": (
                0 if system else len(control.names)
            ),
            "labels of cameras that occur twice: their numbers stand behind them": doubled,
            f"other chunks: {', '.join(chunk.others)}": len(chunk.others),
            **odd,
        },
        assumed=(*ASSUMED, *(system.assumed if system else ())),
        found=found,
        left_out=("tie points, which the XML does not have",),
    )


read = project.reader(read_project)


def _cameras_alone(chunk: _Chunk) -> Project:
    """Return a calibration that Metashape saved, or the sensors of a chunk without images."""
    if chunk.root.tag == CALIBRATION:
        lenses = {Path(chunk.sources[0].file).stem: _lens(chunk.root)}
    else:
        lenses = {name: replace(one, kind="") for name, one in _sensors(chunk.root).values()}
    return Project(source="Metashape's cameras", sources=chunk.sources, lenses=lenses)


def _version(root: Element) -> str:
    for setting in root.each("meta/property"):
        if setting.get("name") == "Info/LastSavedSoftwareVersion":
            return f"Metashape {setting.attribute('value')}"
    return "Metashape"


def _rig(root: Element, sensors: Mapping[str, object]) -> tuple[dict[str, int], tuple[str, ...]]:
    """Count the parts of a chunk that a flight cannot have; return a sentence on slaves, too."""
    elements = list(root.each("sensors/sensor"))
    slaves = [
        one.get("id") for one in elements if one.get("master_id", one.get("id")) != one.get("id")
    ]
    used = [i for i in slaves if i in sensors]
    tags = ("location", "translation", "rolling_shutter", "antenna")
    n = sum(sensor.maybe(tag) is not None for sensor in elements for tag in tags)
    odd = {"offsets of sensors (of slaves, antennas, shutters): lever arms stay 0": n}
    said = f"{len(used)} sensors are slaves of a rig; their mountings are relative to the master"
    return odd, (said,) if used else ()


@dataclass(frozen=True, kw_only=True)
class _Chunk:
    """A chunk's XML, that of its first frame, the files, and the labels of the other chunks."""

    root: Element
    sources: tuple[Opened, ...]
    frame: Element | None = None
    others: tuple[str, ...] = ()

    @property
    def where(self) -> Element:
        """The element that names the coordinate system."""
        found = self.root.maybe("reference")
        return self.root if found is None else found

    @property
    def settings(self) -> dict[str, float]:
        """The accuracies of the chunk's settings that are positive."""
        known = {*APRIORI.values(), "accuracy_markers"}
        return {
            name: value
            for setting in self.root.each("settings/property")
            if (name := setting.get("name", "")) in known and (value := setting.number("value")) > 0
        }


def _chunk(source: Path) -> _Chunk:
    """Return the active chunk, or the first where none is named."""
    file = safe.read(source)
    if file.data[:2] == b"PK":
        return _in_archive(file)
    root = safe.xml_tree(file)
    if root.tag == CALIBRATION:
        return _Chunk(root=root, sources=(file,))
    if root.tag == "chunk":
        return _whole(root, file)
    if root.tag != "document":
        raise root.wrong("is no file of Metashape", "must begin with <document> or <chunk>")
    if "path" not in root.attrib:
        others = tuple(chunk.get("label", "") for chunk in root.each("chunk"))[1:]
        return replace(_whole(root.one("chunk"), file), others=others)
    # A .psx names an archive with the names of the chunks' archives.
    name = root.attribute("path").replace("{projectname}", source.stem)
    place = safe.inside(source.parent, name, root.wrong)
    listed = safe.member(safe.read(place), DOCUMENT)
    document = safe.xml_tree(listed)
    first = document.one("chunks/chunk").get("id")
    active = document.one("chunks").get("active_id", first)
    entries = sorted(document.each("chunks/chunk"), key=lambda entry: entry.get("id") != active)
    paths = [safe.inside(place.parent, one.attribute("path"), one.wrong) for one in entries]
    chunks = [_in_archive(safe.read(path)) for path in paths]
    others = tuple(chunk.root.get("label", "") for chunk in chunks[1:])
    return replace(chunks[0], sources=(file, listed, *chunks[0].sources), others=others)


def _in_archive(file: Opened) -> _Chunk:
    document = safe.member(file, DOCUMENT)
    root = safe.xml_tree(document)
    if root.tag != "chunk":
        raise root.wrong("is no chunk", "must begin with <chunk>")
    return _whole(root, document)


def _whole(root: Element, source: Opened) -> _Chunk:
    """Return a chunk with its first frame, which may lie in an archive of its own."""
    frame = root.maybe("frames/frame")
    if frame is None or "path" not in frame.attrib:
        return _Chunk(root=root, frame=frame, sources=(source,))
    # Below the chunk's archive; an archive's name ends with that of its member.
    folder = Path(source.file.removesuffix(f"/{DOCUMENT}")).parent
    place = safe.inside(folder, frame.attribute("path"), frame.wrong)
    document = safe.member(safe.read(place), DOCUMENT)
    return _Chunk(root=root, frame=safe.xml_tree(document), sources=(source, document))


def _ids(elements: Iterable[Element]) -> Iterator[tuple[str, Element]]:
    yield from ((element.attribute("id"), element) for element in elements)


def _known(element: Element, attribute: str, ids: Iterable[str], kind: str) -> str:
    """Return the id that an attribute names, which must be there."""
    i = element.attribute(attribute)
    if i not in ids:
        raise element.wrong(quoted(i), f"must be a {kind}'s id", attribute=attribute)
    return i


# sensors


def _sensors(root: Element, used: Iterable[str | None] = ()) -> dict[str, tuple[str, Lens]]:
    """Return names and lenses of the sensors of a chunk's images; of all, where it has no image."""
    root.one("sensors/sensor")  # there must be one
    elements = project.by_id(_ids(root.each("sensors/sensor")))
    labels = [sensor.get("label", "").strip() or "unknown" for sensor in elements.values()]
    names, _ = project.named(elements, labels)
    sensors = {}
    for i, element in elements.items():
        if "master_id" in element.attrib:
            _known(element, "master_id", elements, "sensor")
        if used and i not in used:
            continue
        rotation = element.maybe("rotation")
        R: Array = np.eye(3)
        if rotation is not None and element.get("master_id", i) != i:
            R = coordinates.turned(_matrix(rotation, 1e-5))  # what is written is slave to master
        mount = Pose(R=TOP_AHEAD @ R, r=np.zeros(3))
        sensors[i] = (names[i], replace(_chosen(element), mount=mount))
    return sensors


def _matrix(element: Element, off: float) -> Array:
    """Return a rotation, shape (3, 3), that is one but for `off`."""
    R = element.numbers(9).reshape(3, 3)
    if not coordinates.is_rotation(R, off):
        raise element.wrong("is no rotation", "must be a rotation matrix, row by row")
    return R


def _chosen(element: Element) -> Lens:
    """Return a sensor's adjusted or initial lens, or else that of its nominal focal length."""
    mm = {
        name: entry.number("value")
        for entry in element.each("property")
        if (name := entry.get("name")) in ("pixel_width", "focal_length")
    }
    pixel, focal = mm.get("pixel_width", 0.0), mm.get("focal_length", 0.0)
    calibrations = {one.get("class", "adjusted"): one for one in element.each("calibration")}
    if kind := next((one for one in ("adjusted", "initial") if one in calibrations), ""):
        chosen = _lens(calibrations[kind])
    elif pixel > 0 and focal > 0:
        chosen, kind = _lens(element, focal / pixel), "nominal"
    else:
        expected = "must have one, or focal_length and pixel_width"
        raise element.wrong("has no adjusted calibration", expected)
    return replace(chosen, pixel_um=1000 * pixel, kind=kind)


def _lens(element: Element, nominal: float | None = None) -> Lens:
    """Return the lens of a calibration, or of a sensor that has but a nominal f, px."""
    alone = element.maybe("projection")  # of a calibration that was saved
    kind = element.get("type", "frame") if alone is None else alone.content
    if kind not in lens.METASHAPE:
        expected = f"must be one of {', '.join(lens.METASHAPE)}"
        raise (element if alone is None else alone).wrong(quoted(kind), expected)
    if element.maybe("fx") is not None:
        fault = "has <fx>: PhotoScan before 1.2 wrote it, whose p1 and p2 mean other things"
        raise element.wrong(fault, "must have <f>; save the project with a newer version")
    formula, size = lens.METASHAPE[kind], element.maybe("resolution")
    width, height = (
        int(element.one(side).number("", PIXELS) if size is None else size.number(side, PIXELS))
        for side in ("width", "height")
    )
    values = dict.fromkeys(("cx", "cy", "b1", "b2", *formula.names), 0.0)
    values |= {one.tag: one.number() for one in element.each("*") if one.tag in values}
    f = element.one("f").number(allowed=POSITIVE) if nominal is None else nominal
    if f + values["b1"] <= 0:
        raise element.wrong("f + b1 is not positive", "must be a focal length in px")
    hole = Pinhole(
        fx=f + values["b1"],
        fy=f,
        cx=(width - 1) / 2 + values["cx"],
        cy=(height - 1) / 2 + values["cy"],
        skew=values["b2"],
    )
    coefficients = [values[name] for name in formula.names]
    return formula.lens(coefficients, hole, (width, height), element.wrong)


# images


_Place = tuple[Array, Array, float]
"""The chunk's coordinates in the frame of poses: R, r, scale of x_e = scale R x + r."""


def _images(
    cameras: Mapping[str, Element],
    names: Mapping[str, str],
    sensors: Mapping[str, tuple[str, Lens]],
    places: Mapping[str, _Place],
) -> project.Images:
    """Return the images of a chunk, in the ECEF frame of its system or in its own coordinates."""
    rows, enabled = [], []
    for name, camera in zip(names.values(), cameras.values(), strict=True):
        by, own = sensors[_known(camera, "sensor_id", sensors, "sensor")]
        leader = camera.attribute("id")
        if "master_id" in camera.attrib:
            leader = _known(camera, "master_id", cameras, "camera")
        master = cameras[leader]
        _, led = sensors[_known(master, "sensor_id", sensors, "sensor")]
        T_c = _pose(master, led.mount.R.T @ own.mount.R, places)
        rows.append((name, by, names[leader], T_c))
        enabled.append(_is_on(camera) and _is_on(master))
    return project.Images.of(rows, np.array(enabled, dtype=bool))


def _pose(master: Element, R_master_c: Array, places: Mapping[str, _Place]) -> Pose | None:
    """Return a camera's pose, None where it is not aligned, or its component has no place."""
    element = master.maybe("transform")
    place = places.get(master.get("component_id", "")) or places.get("")
    if element is None or (places and place is None):
        return None
    values = element.numbers(16).reshape(4, 4)
    R, r = values[:3, :3], values[:3, 3]
    if not coordinates.is_rotation(R):
        raise element.wrong("does not turn", "must be a rotation and a place, row by row")
    R = coordinates.nearest_rotation(R) @ FLIP @ R_master_c
    if place is None:
        return Pose(R=R, r=r)
    R_e, r_e, scale = place
    return Pose(R=R_e @ R, r=r_e + scale * transform(R_e, r))


def _places(root: Element) -> dict[str, _Place]:
    """Return the transformations of a chunk's components by their numbers; its own is ""."""
    parts = {one.get("id", ""): one for one in root.each("components/component")}
    places = {}
    for i, part in {"": root, **parts}.items():
        if (element := part.maybe("transform")) is None:
            continue
        R = coordinates.nearest_rotation(_matrix(element.one("rotation"), 1e-4))
        scale, shift = element.maybe("scale"), element.one("translation")
        places[i] = (R, shift.numbers(3), 1.0 if scale is None else scale.number("", POSITIVE))
    return places


def _accuracy(reference: Element, names: tuple[str, str, str]) -> Array:
    """Return the sigmas of three values, shape (3,); NaN where none is positive."""
    given = [next((s for s in ACCURACIES[n] if s in reference.attrib), "") for n in names]
    sigma = np.array([reference.number(name) if name else np.nan for name in given])
    return np.where(sigma > 0, sigma, np.nan)


def _three(element: Element, names: tuple[str, ...], *switches: str) -> Array | None:
    """Return three values of a reference, None where one is absent or a switch is off."""
    there = all(name in element.attrib for name in names)
    if not there or not all(_is_on(element, switch) for switch in switches):
        return None
    return np.array([element.number(name) for name in names])


def _is_on(element: Element, switch: str = "enabled") -> bool:
    """Tell whether an image, or its reference, takes part in Metashape's adjustment."""
    return element.get(switch, "true") not in ("false", "0")


# where they are


def _system(
    chunk: _Chunk, flown: Iterable[Element], *, wanted: str | None, heights: str | float | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where the chunk has none."""
    element = chunk.root.maybe("reference")
    text = "" if element is None else element.content
    places = [place for one in flown if (place := _three(one, LOCATION, "enabled")) is not None]
    with told(chunk.where.wrong, FLYABLE):
        if wanted is None and text and coordinates.parsed(text).is_engineering:
            wanted = LOCAL  # that of a test field or a building site, on no map
        system = coordinates.chosen(text, places[0][:2] if places else None, wanted)
    return system if system is None or heights is None else replace(system, heights=heights)


def _in_grid(chunk: _Chunk, system: Chosen | None, *, placed: bool) -> project.InGrid:
    """Return the map from the frame of poses into the grid."""
    if system is None:
        expected = "adjusted orientations need one"
        return chunk.where.wrong("is no coordinate system on the Earth", expected)
    if system.crs != LOCAL and not placed:
        return chunk.root.wrong("<transform> is missing", "required")
    if system.crs == LOCAL or system.source is None:
        return project.as_they_are

    def in_grid(T: Pose) -> tuple[Array, Array]:
        with told(chunk.where.wrong, FLYABLE):
            return project.grid_poses_of_ecef(system.grid(), T)

    return in_grid


def _measured(chunk: _Chunk, flown: Mapping[str, Element], system: Chosen | None) -> Trajectory:
    """Return the trajectory from references with both position and angles switched on."""
    rows = {}
    n_places, n_off, n_unturned = 0, 0, 0
    for name, reference in flown.items():
        place = _three(reference, LOCATION, "enabled")
        turns = _three(reference, ANGLES, "enabled", "rotation_enabled")
        if place is not None and turns is not None:
            rows[name] = (reference, place, turns)
        n_places += place is not None
        n_off += place is None and _three(reference, LOCATION) is not None
        n_unturned += turns is None and _three(reference, ANGLES, "enabled") is not None
    off = {
        'positions, with their angles, that are switched off (enabled="false")': n_off,
        'attitudes that are switched off (rotation_enabled="false")': n_unturned,
    }
    left_out = tuple(f"{n} measured {kind}: they are not used" for kind, n in off.items() if n)
    if not rows or system is None:
        lacks = "the chunk has no coordinate system (--crs)"
        why = lacks if rows else "none has angles as well, which trajectory.csv needs"
        cure = "another import, or --orientations adjusted"
        sentence = f"{n_places} measured camera positions: {why}; {cure}"
        return Trajectory(left_out=(*left_out, *([sentence] if n_places else [])))
    references, positions, angles = zip(*rows.values(), strict=True)
    places, (yaw, pitch, roll) = np.array(positions), np.array(angles).T
    of_positions, north = tuple[str, ...](), "true north"
    if system.crs == LOCAL:
        north = "y"
        rph = np.radians(np.stack([roll, pitch, yaw], axis=1))
        opk = LocalFrame().pose_from_rph(places, rph).opk
        table = project.trajectory_in_grid(list(rows), places, opk)
    else:
        lonlath, of_positions = _geographic(chunk, places, system)
        if system.source is None:
            north = f"the north of {system.crs}, made true by the convergence"
            yaw = yaw + np.degrees(system.grid().convergence(lonlath[:, :2]))
        names = "lat_deg lon_deg height_m roll_deg pitch_deg heading_deg"
        values = np.column_stack([lonlath[:, [1, 0, 2]], roll, pitch, yaw])
        table = {"exposure": list(rows), **project.columns(names, values)}
    said = (
        f"Yaw is the heading, clockwise from {north}, pitch is positive with the top of the image "
        "up, roll with its right side down; positions are those of the camera"
    )
    return Trajectory(
        table=table | _sigmas(chunk, references), assumed=(*of_positions, said), left_out=left_out
    )


def _sigmas(chunk: _Chunk, references: Sequence[Element]) -> dict[str, list[float]]:
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
        if lacking.any() and common not in chunk.settings:
            bare = references[int(np.flatnonzero(lacking.any(axis=1))[0])]
            expected = f"others have one; or {common} is needed"
            raise bare.wrong(f"has no accuracy of {', '.join(names)}", expected)
        sigma[lacking] = chunk.settings.get(common, np.nan)
        columns |= {f"sigma_{u}": v for u, v in zip(units, sigma.T.tolist(), strict=True)}
    return columns


def _geographic(chunk: _Chunk, xyh: Array, system: Chosen) -> tuple[Array, tuple[str, ...]]:
    """Return longitude, latitude, height of references, and sentences on assumptions."""
    source = system.source
    are_degrees = (np.abs(xyh[:, 0]) <= 180).all() and (np.abs(xyh[:, 1]) <= 90).all()
    with told(chunk.where.wrong, FLYABLE):
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


def _located(chunk: _Chunk, cameras: Sequence[str]) -> tuple[Measured, Mask, int]:
    """Return markers in images, which of them are pinned, and how many are in unknown cameras."""
    markers = project.by_id(_ids(chunk.root.each("markers/marker")))
    labels = [marker.attribute("label").strip() for marker in markers.values()]
    project.by_id(zip(labels, markers.values(), strict=True))  # they are the points' names
    names, _ = project.named(markers, labels)
    row = {camera: k for k, camera in enumerate(cameras)}
    places: dict[tuple[str, str], Element] = {}
    for marker in () if chunk.frame is None else chunk.frame.each("markers/marker"):
        name = names[_known(marker, "marker_id", names, "marker")]
        for place in marker.each("location"):
            if places.setdefault((place.attribute("camera_id"), name), place) is not place:
                raise place.wrong(f"marker {name} is twice in one camera", "must be there once")
    known = [
        (row[camera], name, place) for (camera, name), place in places.items() if camera in row
    ]
    seen = [
        (image, name, [place.number(axis, RANGES["col_px"]) - HALF for axis in "xy"])
        for image, name, place in known
    ]
    pinned = [place.get("pinned") in ("true", "1") for _, _, place in known]
    return Measured.of(seen), np.array(pinned, dtype=bool), len(places) - len(known)


def _control(chunk: _Chunk, system: Chosen | None) -> Control:
    """Return the markers with coordinates, in the flight's system or, without one, their own."""
    surveyed = [
        (marker.attribute("label").strip(), reference, place)
        for marker in chunk.root.each("markers/marker")
        if (reference := marker.maybe("reference")) is not None
        and (place := _three(reference, LOCATION)) is not None
    ]
    sigma = np.array([_accuracy(one, LOCATION) for _, one, _ in surveyed]).reshape(-1, 3)
    xyh = np.array([place for _, _, place in surveyed]).reshape(-1, 3)
    if system is not None and len(xyh):
        with told(chunk.where.wrong, FLYABLE):
            xyh = coordinates.into(system, xyh)
    common = chunk.settings.get("accuracy_markers", MARKER_SIGMA_M)
    return Control(
        names=tuple(name for name, _, _ in surveyed),
        enh=xyh,
        sigma=np.where(np.isnan(sigma), common, sigma),
        is_check=tuple(not _is_on(reference) for _, reference, _ in surveyed),
    )


def _proofs(
    chunk: _Chunk, located: Measured, pinned: Mask, control: Control, system: Chosen | None
) -> tuple[Proof, ...]:
    """Return the proofs by markers: located by Metashape, measured, and surveyed."""
    computed, measured = located.some(~pinned), located.some(pinned)
    proofs = (
        Proof(whose="the locations that Metashape computed itself", measured=computed),
        Proof(whose="the measured locations of each marker", measured=measured),
    )
    if system is None or not control.names:
        return proofs
    x_e = control.enh
    if system.source is not None:
        with told(chunk.where.wrong, FLYABLE):
            grid = system.grid()
        lonlat = grid.lonlat_from_grid(x_e[:, :2])
        height = x_e[:, 2] + grid.undulation(lonlat)
        x_e = grid.ecef_from_geographic(np.column_stack([lonlat, height]))
    known = dict(zip(control.names, x_e, strict=True))
    x_w = np.array([known.get(name, project.NOWHERE) for name in located.points]).reshape(-1, 3)
    whose = "the surveyed markers, by Metashape's adjusted orientations,"
    return (*proofs, Proof(whose=whose, measured=replace(measured, x_w=x_w)))
