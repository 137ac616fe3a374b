"""Metashape's projects and exported XML: cameras, images, markers, control, orientations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.exchange.brought import Brought, number_of
from acx4lib.exchange.programs.metashape import alone, files, markers, oriented
from acx4lib.exchange.programs.metashape.files import Chunk
from acx4lib.exchange.programs.metashape.markers import Locations, Surveyed
from acx4lib.exchange.programs.metashape.sensors import Sensor, sensors
from acx4lib.exchange.programs.metashape.shots import Shot, measured_place, shots
from acx4lib.exchange.programs.shared import cameras, crs, tables
from acx4lib.exchange.programs.shared.adjusted import Flown
from acx4lib.exchange.programs.shared.cameras import Refitted
from acx4lib.exchange.programs.shared.crs import Chosen
from acx4lib.exchange.safe.opened import checksums
from acx4lib.flight.text.in_memory import Columns

ASSUMED = (
    "Pixels: Metashape counts from the outer corner of the top-left one, so 0.5 is taken off",
    "The body's x axis is towards the top of the master camera's images: there Metashape's yaw, "
    "pitch and roll are zero for a camera that looks down with its top to the north",
)

APRIORI = {
    "accuracy_projections": "image_point_px",
    "accuracy_cameras": "gnss_horizontal_m",
    "accuracy_cameras_ypr": "roll_pitch_deg",
}
"""Metashape's settings and the keys of ``[apriori]`` that they are."""


def read(  # noqa: PLR0913 one for every option
    source: Path,
    *,
    camera: str = "adjusted",
    orientations: str = "initial",
    block: str | None = None,
    crs: str | None = None,
    heights: str | float | None = None,
    chunk: str | None = None,
    pixel_um: float | None = None,
) -> Brought:
    """Read a chunk, or the cameras of a file without images.

    Parameters
    ----------
    source : Path
        XML that Metashape exported, a ``.psx`` or a ``chunk.zip``, or a calibration.
    camera : str
        Which calibration is taken where there are both: adjusted or initial.
    orientations : str
        The trajectory: "initial" is what was measured of the cameras, "adjusted" what Metashape
        adjusted, "none" none.
    block : str, optional
        Name of the block; by default heads for a rig, else calibration.
    crs : str, optional
        The flight's projected CRS; by default the chunk's own, or its UTM zone.
    heights : str or float, optional
        As the key of flight.toml; by default the chunk's own.
    chunk : str, optional
        Label of the chunk; by default the active one.
    pixel_um : float, optional
        Pixel size where the file has none.

    Raises
    ------
    FlightError
        Where the file is no project of Metashape, or something in it cannot be.
    """
    whole = files.chunk(source, label=chunk)
    if alone.has_none_but_cameras(whole):
        return alone.read(whole, wanted=camera, pixel_um=pixel_um)
    of = sensors(whole.root, wanted=camera)
    every, doubled = shots(whole.root, of)
    used = _used(whole, every, orientations)
    named = {one.camera for one in used.values()}
    lenses = {one.name: one.lens for one in of.values() if one.name in named}
    fitted = oriented.told(whole, lambda: cameras.refitted(lenses, pixel_um=pixel_um))
    system = _system(whole, used, wanted=crs, heights=heights)
    names = markers.labels(whole.root)
    places, known = markers.locations(whole, every, names), markers.surveyed(whole.root)
    folder = block or ("heads" if _is_rig(used.values()) else "calibration")
    flown = oriented.trajectory(whole, used, system, wanted=orientations)
    unaligned = sum(one.enabled for one in every.values()) - len(used)
    used = _with_trajectory(used, flown)
    table = {
        f"{folder}/images.csv": _images(used),
        **_points(folder, places, used),
        "control_points.csv": _control(whole, known, system),
        f"{folder}/trajectory.csv": flown.table,
    }
    proofs = oriented.proofs(whole, fitted.cameras, places, known, system)
    return Brought(
        source=_version(whole),
        sha256=checksums(whole.sources),
        settings=_settings(whole, fitted, system),
        tables={name: one for name, one in table.items() if one},
        assumed=(*ASSUMED, *fitted.assumed, *(system.assumed if system else ()), *flown.assumed),
        found=(*_found(used, places, known), *_kinds(of, named), *fitted.found, *proofs),
        left_out=(*_left_out(whole, every, used, places, doubled, unaligned), *flown.left_out),
    )


def _used(whole: Chunk, every: Mapping[str, Shot], orientations: str) -> dict[str, Shot]:
    """Return the enabled cameras; only aligned ones where adjusted orientations are wanted."""
    adjusted = orientations == "adjusted"
    used = {
        i: one for i, one in every.items() if one.enabled and not (adjusted and one.T_c is None)
    }
    if not used:
        kind = "aligned" if adjusted else "enabled"
        raise whole.root.one("cameras").wrong(f"has no {kind} camera", "must have one")
    return used


def _system(
    chunk: Chunk, used: Mapping[str, Shot], *, wanted: str | None, heights: str | float | None
) -> Chosen | None:
    """Return the flight's coordinate system; None where the chunk has none."""
    element = chunk.root.maybe("reference")
    text = "" if element is None else element.text
    at = next(
        (
            place[:2]
            for one in used.values()
            if one.reference is not None and (place := measured_place(one.reference)) is not None
        ),
        None,
    )
    found = oriented.told(chunk, lambda: crs.chosen(text, at, wanted), element)
    return found if found is None or heights is None else replace(found, heights=heights)


def _with_trajectory(used: dict[str, Shot], flown: Flown) -> dict[str, Shot]:
    """Return the images whose exposures are in the trajectory, if there is one."""
    if flown.table is None:
        return used
    exposures = set(flown.table["exposure"])
    return {i: one for i, one in used.items() if one.exposure in exposures}


def _is_rig(used: Any) -> bool:
    exposures = [one.exposure for one in used]
    return len(set(exposures)) < len(exposures)


def _images(used: Mapping[str, Shot]) -> Columns:
    every = used.values()
    return tables.images(*([getattr(o, k) for o in every] for k in ("name", "camera", "exposure")))


def _points(folder: str, places: Locations, used: Mapping[str, Shot]) -> dict[str, Columns]:
    """Return the table of what was measured in images that are used."""
    names = {one.name for one in used.values()}
    rows = [k for k, one in enumerate(places.shots) if places.measured[k] and one.name in names]
    if not rows:
        return {}
    table = tables.image_points(
        [places.shots[k].name for k in rows], [places.points[k] for k in rows], places.colrow[rows]
    )
    return {f"{folder}/image_points.csv": table}


def _control(
    chunk: Chunk, known: Mapping[str, Surveyed], system: Chosen | None
) -> dict[str, list[Any]] | None:
    """Return the table of control and check points; None where there are none."""
    if not known or system is None:
        return None
    xyh = np.array([one.xyh for one in known.values()])
    enh = oriented.told(chunk, lambda: crs.into(system, xyh), chunk.root.maybe("reference"))
    common = files.setting(chunk, "accuracy_markers") or 0.005
    sigma = [np.where(np.isnan(one.sigma), common, one.sigma) for one in known.values()]
    east, north, height = np.round(enh, tables.METRES).T.tolist()
    sigmas = np.round(sigma, tables.METRES).T.tolist()
    return {
        "point": list(known),
        "east_m": east,
        "north_m": north,
        "height_m": height,
        **dict(zip(("sigma_east_m", "sigma_north_m", "sigma_height_m"), sigmas, strict=True)),
        "role": ["check" if one.is_check else "control" for one in known.values()],
    }


def _settings(chunk: Chunk, fitted: Refitted, system: Chosen | None) -> dict[str, Any]:
    apriori = {key: value for name, key in APRIORI.items() if (value := files.setting(chunk, name))}
    if "gnss_horizontal_m" in apriori:
        apriori["gnss_vertical_m"] = apriori["gnss_horizontal_m"]
    if "roll_pitch_deg" in apriori:
        apriori["heading_deg"] = apriori["roll_pitch_deg"]
    label = chunk.root.attributes.get("label", "").strip() or "Metashape"
    return {
        "name": label,
        **(system.settings if system else {}),
        **fitted.settings,
        **({"apriori": apriori} if apriori else {}),
    }


def _version(chunk: Chunk) -> str:
    for one in chunk.root.each("meta", "property"):
        if one.attributes.get("name") == "Info/LastSavedSoftwareVersion":
            return f"Metashape {one.attribute('value')}"
    return "Metashape"


def _found(
    used: Mapping[str, Shot], places: Locations, known: Mapping[str, Surveyed]
) -> tuple[str, ...]:
    exposures = {one.exposure for one in used.values()}
    posed = sum(one.T_c is not None for one in used.values())
    checks = sum(one.is_check for one in known.values())
    return (
        f"{number_of(len(used), 'images')} of {number_of(len(exposures), 'exposures')}, "
        f"{posed} of them aligned",
        f"{number_of(int(places.measured.sum()), 'measured locations')} of "
        f"{number_of(len(set(places.points)), 'markers')}; "
        f"{len(known)} markers have coordinates, {checks} of them check points",
    )


def _kinds(of: Mapping[str, Sensor], named: set[str]) -> tuple[str, ...]:
    kinds: dict[str, list[str]] = {}
    for one in of.values():
        if one.name in named:
            kinds.setdefault(one.kind, []).append(one.name)
    slaves = sum(one.master != i for i, one in of.items())
    rig = (f"{slaves} sensors are slaves of a rig; their mountings are relative to the master",)
    return (
        *(f"calibration of {'; '.join(names)}: {kind}" for kind, names in kinds.items()),
        *(rig if slaves else ()),
    )


def _left_out(
    chunk: Chunk,
    every: Mapping[str, Shot],
    used: Mapping[str, Shot],
    places: Locations,
    doubled: int,
    unaligned: int,
) -> tuple[str, ...]:
    names = {one.name for one in used.values()}
    elsewhere = sum(
        bool(measured) and one.name not in names
        for one, measured in zip(places.shots, places.measured, strict=True)
    )
    counted: Sequence[tuple[int, str]] = (
        (
            int((~places.measured).sum()),
            'marker locations without pinned="true": Metashape computed them, nobody measured them',
        ),
        (elsewhere, "measured marker locations in images that are left out"),
        (places.lost, "marker locations in cameras that the chunk has not"),
        (sum(not one.enabled for one in every.values()), "cameras that are disabled"),
        (unaligned, "cameras that are not aligned, and so have no adjusted orientation"),
        (doubled, "labels of cameras that occur twice: their numbers stand behind them"),
        (len(chunk.others), f"other chunks: {', '.join(chunk.others)}"),
    )
    frames = max(0, len(list(chunk.root.each("frames", "frame"))) - 1)
    tags = ("location", "translation", "rolling_shutter", "antenna")
    bare = sum(
        "master_id" in one.attributes and one.maybe("rotation") is None
        for one in chunk.root.each("sensors", "sensor")
    )
    odd = sum(
        one.maybe(tag) is not None for one in chunk.root.each("sensors", "sensor") for tag in tags
    )
    return (
        *(f"{n} {what}" for n, what in counted if n),
        *((f"{frames} further frames",) if frames else ()),
        *(
            (f"{odd} offsets of sensors (of slaves, antennas, shutters): lever arms stay 0",)
            if odd
            else ()
        ),
        *((f"{bare} slaves have no rotation: their mountings are the master's",) if bare else ()),
        "tie points, which the XML does not have",
    )
