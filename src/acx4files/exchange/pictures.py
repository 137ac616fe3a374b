"""A flight of pictures alone: cameras, mountings, exposures and their poses by the metadata."""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import tifffile

from acx4files.exchange import metadata, safe
from acx4files.exchange.flight_folder import ImportedFlight, number_of
from acx4files.exchange.lens import WARNED_PX, WORST_PX, too_far
from acx4files.exchange.metadata import (
    ANOTHER_COURSE_DEG,
    BROKEN,
    DOWN,
    Attitude,
    Head,
    Lens,
    Tags,
    lens_of,
    rational,
    read,
    rotation,
)
from acx4files.exchange.options import Allow, Crs, Option
from acx4files.exchange.safe import Opened, refusal
from acx4files.flight.problems import quoted
from acx4files.flight.settings import LEVER, camera_table
from acx4files.images import tiff as tiff_files
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose

SUFFIXES = (".tif", ".tiff", ".jpg", ".jpeg")
MOST = 100_000
"""Largest number of pictures."""

SYNTHETIC = "SYN"
SAID = 5
"""Files that are named where more are counted."""

_LEVEL = (10.0, 30.0)


@dataclass(frozen=True, kw_only=True)
class _Taken:
    """One picture: its metadata, its head, its file below the flight's block, its mark if any."""

    tags: Tags
    head: Head
    file: str
    mark: Mark | None = None


@dataclass(frozen=True, kw_only=True)
class _Shot:
    """The pictures of one exposure, its name, and its heading where the pictures decided it."""

    name: str
    taken: tuple[_Taken, ...]
    heading: float | None = None


def read_folder(
    source: Annotated[Path, Option("FOLDER", "Folder of the pictures.")],
    *,
    crs: Crs = "",
    pixel_um: Annotated[
        float | None, Option("UM", "Size of a pixel, if unsaid.", low=0.1, high=100.0)
    ] = None,
    allow: Allow = WORST_PX,
    hold_out: Annotated[
        int | None,
        Option(
            "N",
            "Every N exposures one is held out as block validation; the others are heads and "
            "calibration.",
            low=2,
        ),
    ] = None,
) -> ImportedFlight:
    """Make a flight of a folder of pictures: what their EXIF and XMP say, no point is measured.

    TIFF or JPEG of MicaSense, DJI and others: cameras with their factory's calibration, how the
    heads are turned to each other, exposures, positions, attitudes, times. The pictures are linked
    into the flight, or copied to another disk. Of several heads, `acx4 run --stages synthetic`
    finds tie points in the pictures, and `acx4 render --blend stack` lays their bands over each
    other. Without --crs it is the UTM zone of the mean position, in WGS 84.

    Examples
    --------
    acx4 import pictures my_pictures --out my_flight
    acx4 import pictures my_pictures --hold-out 2 --out my_flight

    Returns
    -------
    ImportedFlight
        A block ``calibration``, which of several cameras is the block ``heads``, too; one exposure
        of these is a block ``heads`` alone.

    Raises
    ------
    FlightError
        With a line for every picture that cannot be read, or where a number in it is none.
    """
    taken, others = _alike(_read_all(source))
    taken, sums = _marked(taken)
    shots, without = _placed(_shots(taken))
    shots, decided = _decided(shots)
    heads = metadata.in_order(
        list({picture.head.name: picture.head for s in shots for picture in s.taken}.values())
    )
    first = {picture.head.name: picture.tags for shot in reversed(shots) for picture in shot.taken}
    known = None if pixel_um is None else pixel_um / 1000
    lenses = {h.name: lens_of(first[h.name], h.name, known_pixel_mm=known) for h in heads}
    for name, lens in lenses.items():
        if (fault := too_far(lens.fitted, allow)) is not None:
            raise first[name].wrong("lens", f"{name}: {fault[0]}", fault[1])
    blocks = _blocks(shots, len(heads) > 1, hold_out)
    in_heads = {"heads", "calibration"} <= blocks.keys()
    return ImportedFlight(
        source=f"pictures of {_maker(taken)}",
        sha256={**{picture.file: picture.tags.sha256 for picture in taken}, **sums},
        settings={
            **_settings(source, shots, heads, lenses, crs, in_heads=in_heads),
            **(_HELD if in_heads and _is_navigation(shots) else {}),
        },
        tables=_tables_of(blocks),
        pictures=_pictures_of(blocks),
        warnings=(*_warnings_of(_marks(shots)), *_cut(taken), *decided, *_refitted(lenses)),
        assumed=(*_assumed(shots, heads), *_on_blocks(shots, hold_out, in_heads=in_heads)),
        found=tuple(_found(shots, heads, lenses, first)),
        left_out=(*others, *without),
    )


def _tables_of(blocks: Mapping[str, Sequence[_Shot]]) -> dict[str, dict[str, list[Any]]]:
    """Return the tables of all blocks by file, and one of control points without any."""
    tables: dict[str, dict[str, list[Any]]] = {
        "control_points.csv": {n: [] for n in ("point", "east_m", "north_m", "height_m")}
    }
    for block, shots in blocks.items():
        tables |= {f"{block}/{name}": table for name, table in _tables(shots).items()}
    return tables


def _pictures_of(blocks: Mapping[str, Sequence[_Shot]]) -> dict[str, Path]:
    """Return where the pictures of all blocks are, by file below the flight."""
    return {
        f"{block}/{picture.file}": picture.tags.path
        for block, shots in blocks.items()
        for shot in shots
        for picture in shot.taken
    }


def _refitted(lenses: Mapping[str, Lens]) -> Iterator[str]:
    """Yield a warning for each lens that differs much from that of its metadata."""
    for name, lens in lenses.items():
        if lens.fitted.largest_px > WARNED_PX:
            yield f"the lens of {name} differs from that of its metadata by {lens.fitted}"


# --- which exposures judge ---------------------------------------------------------------------

NAVIGATION_M = 0.5
"""Positions of a larger sigma determine neither lenses nor lever arms."""


def _blocks(
    shots: Sequence[_Shot], is_rig: bool, hold_out: int | None
) -> dict[str, Sequence[_Shot]]:
    """Return the exposures of every block."""
    if hold_out is None:
        heads = {"heads": shots} if is_rig else {}
        return heads if is_rig and len(shots) == 1 else {**heads, "calibration": shots}
    held = shots[hold_out - 1 :: hold_out]
    if not held or len(held) == len(shots):
        path = shots[0].taken[0].tags.path.parent
        count = f"{hold_out} of {number_of(len(shots), 'exposures')}"
        raise refusal(str(path), 1, "--hold-out", count, "must leave exposures on either side")
    kept = [shot for k, shot in enumerate(shots, start=1) if k % hold_out]
    heads = {"heads": kept} if is_rig else {}
    return {**heads, "calibration": kept, "validation": held}


_HELD: dict[str, Any] = {"stages": {"mounting": {"estimate": [], "fix": ["lever_arm"]}}}
"""What the mounting stage of heads estimates where a navigation receiver gives positions."""


def _is_navigation(shots: Sequence[_Shot]) -> bool:
    return float(np.median([_sigma(shot) for shot in shots])) > NAVIGATION_M


def _on_blocks(shots: Sequence[_Shot], hold_out: int | None, *, in_heads: bool) -> Iterator[str]:
    """Yield sentences on exposures that are held out and parameters that are held."""
    if hold_out is not None:
        n = len(shots[hold_out - 1 :: hold_out])
        yield (
            f"{number_of(n, 'exposures')}, one in {hold_out} in the order of time, make block "
            "validation: they are held out"
        )
    if in_heads and _is_navigation(shots):
        sigma = float(np.median([_sigma(shot) for shot in shots]))
        yield (
            f"positions of {sigma:.1f} m (median sigma) determine neither the lens of the "
            "synthetic image nor its lever arm: stage mounting holds them, and estimates the "
            "boresight"
        )


# --- which pictures --------------------------------------------------------------------------


def _read_all(source: Path) -> list[_Taken]:
    """Return all pictures of a folder."""
    if not source.is_dir():
        raise refusal(str(source), 1, "folder", "is no folder", "must be one with pictures")
    paths = sorted(p for p in source.rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file())
    if not 0 < len(paths) <= MOST:
        count = f"holds {len(paths)} pictures ({', '.join(SUFFIXES)})"
        raise refusal(str(source), 1, "folder", count, f"must hold 1 to {MOST}")
    taken: list[_Taken] = []
    problems: list[str] = []
    for path in paths:
        try:
            tags = read(path)
            file = f"images/{path.relative_to(source).as_posix()}"
            taken.append(_Taken(tags=tags, head=metadata.head_of(tags), file=file))
        except FlightError as error:
            problems += error.problems
    if problems:
        raise FlightError(problems)
    return taken


def _marked(taken: Sequence[_Taken]) -> tuple[list[_Taken], dict[str, str]]:
    """Return the pictures with the marks of files beside them, and the checksums of these."""
    folders = {picture.tags.path.parent for picture in taken}
    marks = {folder: marks_of(folder) for folder in sorted(folders)}
    sums = {name: value for _, digests in marks.values() for name, value in digests.items()}
    numbers = [_number_in(metadata.name_of(picture.tags)) for picture in taken]
    return [
        replace(picture, mark=None if k is None else marks[picture.tags.path.parent][0].get(k))
        for picture, k in zip(taken, numbers, strict=True)
    ], sums


def _marks(shots: Sequence[_Shot]) -> list[Mark]:
    return [mark for shot in shots if (mark := shot.taken[0].mark) is not None]


def _cut(taken: Sequence[_Taken]) -> Iterator[str]:
    """Yield a warning where EXIF says that pictures were larger when they were taken."""
    pairs = Counter(
        (picture.tags.width_px, picture.tags.height_px, width, height)
        for picture in taken
        if (width := picture.tags.number("PixelXDimension"))
        and (height := picture.tags.number("PixelYDimension"))
        and {width, height} != {picture.tags.width_px, picture.tags.height_px}
    )
    for (width, height, before_w, before_h), n in pairs.items():
        yield (
            f"{number_of(n, 'pictures')} of {width} x {height} px, and {before_w:g} x "
            f"{before_h:g} px by their EXIF: cropped or reduced since, so that the lens of the "
            "metadata is not theirs"
        )


def _decided(shots: Sequence[_Shot]) -> tuple[list[_Shot], list[str]]:
    """Return the exposures, with the aircraft's heading where the pictures agree with it alone."""
    both = {}
    for k, shot in enumerate(shots):
        tags = shot.taken[0].tags
        aircraft = tags.number(metadata.FLIGHT_YAW)
        if aircraft is not None and all(tags.number(name) is not None for name in metadata.GIMBAL):
            both[k] = (_attitude(shot, 0.0).heading, float(aircraft) % 360.0)
    other = [k for k, two in both.items() if _apart(*two) > metadata.ANOTHER_COURSE_DEG]
    if not other:
        return list(shots), []

    is_aircraft, message = _judged(
        [(shot.taken[0].tags, _place(shot)) for shot in shots], both, other
    )
    turned = {k: replace(shots[k], heading=both[k][1]) for k in other if is_aircraft}
    return [turned.get(k, shot) for k, shot in enumerate(shots)], [message]


def _apart(a: float, b: float) -> float:
    """Return the angle between two headings, degrees."""
    return abs((a - b + 180.0) % 360.0 - 180.0)


def _alike(taken: Sequence[_Taken]) -> tuple[list[_Taken], list[str]]:
    """Return the pictures of the most frequent size and kind, and a message on the others."""
    kinds = Counter(_kind(picture) for picture in taken)
    usual = max(kinds, key=lambda kind: (kinds[kind], kind))
    others = [picture for picture in taken if _kind(picture) != usual]
    messages = []
    if others:
        width, height, samples, bits = usual
        messages = [
            f"{number_of(len(others), 'pictures')} of another kind than {width} x {height} px, "
            f"{samples} x {bits} bit: {_some([picture.tags.path.name for picture in others])}"
        ]
    return [picture for picture in taken if _kind(picture) == usual], messages


def _kind(picture: _Taken) -> tuple[int, int, int, int]:
    return picture.tags.width_px, picture.tags.height_px, picture.tags.samples, picture.tags.bits


def _shots(taken: Sequence[_Taken]) -> list[_Shot]:
    """Return the exposures in the order of time; a head has one picture of each."""
    ordered = sorted(taken, key=lambda picture: metadata.key(picture.tags))
    groups = [tuple(g) for _, g in groupby(ordered, key=lambda picture: metadata.key(picture.tags))]
    for group in groups:
        names = [picture.head.name for picture in group]
        ((again, times),) = Counter(names).most_common(1)
        if times > 1:
            first, second, *_ = [picture.tags for picture in group if picture.head.name == again]
            duplicate = f"{again} as in {first.path} of the same exposure"
            raise second.wrong(
                f"{metadata.INDEX}, {metadata.BAND}", duplicate, "must be another head's"
            )
    groups.sort(key=lambda group: (_when(group[0].tags), str(group[0].tags.path)))
    names = [metadata.name_of(group[0].tags) for group in groups]
    often = Counter(names)
    folders = [group[0].tags.path.parent.name for group in groups]
    unique = [
        n if often[n] == 1 else f"{folder}/{n}" for n, folder in zip(names, folders, strict=True)
    ]
    if len(set(unique)) < len(unique):
        unique = [f"{k}/{name}" for k, name in enumerate(names, start=1)]
    return [_Shot(name=n, taken=group) for n, group in zip(unique, groups, strict=True)]


def _when(tags: Tags) -> float:
    time = metadata.time_of(tags)
    return 0.0 if time is None else time.timestamp()


def _placed(shots: Sequence[_Shot]) -> tuple[list[_Shot], list[str]]:
    """Return the exposures with a position, and a message on the others."""
    known = [_found_place(shot) is not None for shot in shots]
    placed = [shot for shot, is_known in zip(shots, known, strict=True) if is_known]
    if not placed:
        tags, expected = shots[0].taken[0].tags, "needed, and no other picture has a position"
        raise tags.wrong("GPSLatitude, GPSLongitude, GPSAltitude", "missing", expected)
    without = [shot.name for shot, is_known in zip(shots, known, strict=True) if not is_known]
    message = f"{number_of(len(without), 'exposures')} without a position: {_some(without)}"
    return placed, [message] if without else []


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:SAID]) + (", …" if len(names) > SAID else "")


def _maker(taken: Sequence[_Taken]) -> str:
    makes = (f"{t.tags.text('Make')} {t.tags.text('Model')}".strip() for t in taken)
    return ", ".join(dict.fromkeys(make or "an unnamed camera" for make in makes))


# --- flight.toml -----------------------------------------------------------------------------


def _settings(
    source: Path,
    shots: Sequence[_Shot],
    heads: Sequence[Head],
    lenses: Mapping[str, Lens],
    crs: str,
    *,
    in_heads: bool,
) -> dict[str, Any]:
    mounts = _mountings(heads)
    cameras = {name: _camera(lens.camera, mounts[name]) for name, lens in lenses.items()}
    places = np.array([_place(shot) for shot in shots])
    out: dict[str, Any] = {
        "name": source.resolve().name or "pictures",
        "crs": crs or _utm(*places[:, :2].mean(axis=0)),
        "heights": "ellipsoidal",
        "cameras": cameras,
    }
    time = metadata.time_of(shots[0].taken[0].tags)
    if time is not None:
        out["session"] = {"date": time.date()}
    if len(heads) > 1:
        first = lenses[heads[0].name].camera
        ideal = replace(first, name=SYNTHETIC, interior=Interior(f=first.interior.f))
        cameras[SYNTHETIC] = _camera(ideal, metadata.DOWN)
        out["synthetic"] = {"camera": SYNTHETIC, "heads": [head.name for head in heads]}
        if in_heads:
            out["synthetic"]["measured_in"] = "heads"
    return out


def _mountings(heads: Sequence[Head]) -> Mapping[str, Array]:
    """Return R_b_c of every head: looking down, the top of the image ahead, by its angles."""
    turned = {
        head.name: DOWN @ rotation(head.relatives_deg) if head.relatives_deg else DOWN
        for head in heads
    }
    return {name: np.asarray(R) for name, R in turned.items()}


def _camera(camera: Camera, R_b_c: Array) -> dict[str, Any]:
    """Return the table of a camera; nothing is known of its lever arm."""
    mounted = replace(camera, T_b_c=Pose(R=R_b_c, r=np.zeros(3)))
    table = camera_table(mounted)
    zero = ("k1", "k2", "k3", "p1", "p2", "b1", "b2")
    return {
        key: float(f"{value:.12g}") if isinstance(value, float) else value
        for key, value in table.items()
        if key not in LEVER and not (key in zero and value == 0)
    }


def _utm(lat: float, lon: float) -> str:
    zone = min(int((lon + 180) // 6) + 1, 60)
    return f"EPSG:{32600 + zone if lat >= 0 else 32700 + zone}"


# --- tables ----------------------------------------------------------------------------------


def _tables(shots: Sequence[_Shot]) -> dict[str, dict[str, list[Any]]]:
    rows = [(shot, picture) for shot in shots for picture in shot.taken]
    images = {
        "image": [f"{shot.name} {picture.head.name}" for shot, picture in rows],
        "camera": [picture.head.name for _, picture in rows],
        "exposure": [shot.name for shot, _ in rows],
        "file": [picture.file for _, picture in rows],
    }
    points: dict[str, list[Any]] = {n: [] for n in ("image", "point", "col_px", "row_px")}
    return {"images.csv": images, "image_points.csv": points, "trajectory.csv": _trajectory(shots)}


def _trajectory(shots: Sequence[_Shot]) -> dict[str, list[Any]]:
    places = [_place(shot) for shot in shots]
    held = [_attitude(shot, way) for shot, way in zip(shots, metadata.course(places), strict=True)]
    table: dict[str, list[Any]] = {
        "exposure": [shot.name for shot in shots],
        "lat_deg": [round(lat, 9) for lat, _, _ in places],
        "lon_deg": [round(lon, 9) for _, lon, _ in places],
        "height_m": [round(height, 4) for _, _, height in places],
        "roll_deg": [round(attitude.roll, 6) for attitude in held],
        "pitch_deg": [round(attitude.pitch, 6) for attitude in held],
        "heading_deg": [round(attitude.heading, 6) for attitude in held],
    }
    times = [metadata.time_of(shot.taken[0].tags) for shot in shots]
    if all(time is not None for time in times):
        day = min(time for time in times if time).replace(hour=0, minute=0, second=0, microsecond=0)
        table["time_s"] = [round((time - day).total_seconds(), 6) for time in times if time]
    sigma = np.array([_sigma(shot) for shot in shots])
    for k, axis in enumerate(("east", "north", "height")):
        table[f"sigma_{axis}_m"] = sigma[:, k].tolist()
    for axis in ("roll", "pitch", "heading"):
        name = "sigma_heading" if axis == "heading" else "sigma_tilt"
        table[f"sigma_{axis}_deg"] = [getattr(attitude, name) for attitude in held]
    return table


def _place(shot: _Shot) -> tuple[float, float, float]:
    return _found_place(shot) or (np.nan, np.nan, np.nan)


def _found_place(shot: _Shot) -> tuple[float, float, float] | None:
    """Return latitude, longitude, height of an exposure: by its mark, else by its metadata."""
    first = shot.taken[0]
    if first.mark is not None:
        return first.mark.lat_deg, first.mark.lon_deg, first.mark.height_m
    return metadata.place_of(first.tags)


def _sigma(shot: _Shot) -> tuple[float, float, float]:
    """Return sigma of a position, m; a navigation receiver's where no picture states it."""
    if (mark := shot.taken[0].mark) is not None and min(mark.sigma_m) > 0:
        return mark.sigma_m
    known = (metadata.sigma_of(picture.tags) for picture in shot.taken)
    return next((sigma for sigma in known if sigma is not None), (3.0, 3.0, 6.0))


def _attitude(shot: _Shot, heading: float) -> Attitude:
    attitude = metadata.attitude_of(shot.taken[0].tags)
    if attitude is not None and shot.heading is not None:
        return replace(attitude, heading=shot.heading)
    tilt, turn = _LEVEL
    return attitude or Attitude(
        roll=0.0,
        pitch=0.0,
        heading=heading,
        sigma_tilt=tilt,
        sigma_heading=turn,
        said="no angles: level, and ahead along the track",
    )


# --- sentences -------------------------------------------------------------------------------


def _assumed(shots: Sequence[_Shot], heads: Sequence[Head]) -> list[str]:
    ways = dict.fromkeys(_attitude(shot, 0.0).said for shot in shots)
    sentences = [
        *_whose_positions(shots),
        "times are EXIF's: UTC of MicaSense, the clock's zone of others",
        "the camera looks down, and the top of its image is ahead",
        f"attitudes: {'; '.join(ways)}",
        "pixels: (0, 0) is the centre of the first one; principal points count from there",
    ]
    return [*sentences, *([metadata.sentence(heads)] if len(heads) > 1 else [])]


def _whose_positions(shots: Sequence[_Shot]) -> Iterator[str]:
    """Yield sentences on the origin of positions and heights."""
    bare = [shot for shot in shots if shot.taken[0].mark is None]
    ellipsoidal = [shot for shot in bare if metadata.ellipsoidal(shot.taken[0].tags) is not None]
    if ellipsoidal:
        yield (
            "positions are EXIF's, in WGS 84; heights are senseFly's above the ellipsoid, not "
            "those above the sea that stand beside them"
        )
    elif bare:
        yield (
            "positions are EXIF's, in WGS 84; heights are taken as they are, above an unnamed "
            "surface"
        )
    if len(bare) < len(shots):
        yield _sentence(_marks(shots), _beside(shots))
        if bare:
            names = _some([shot.name for shot in bare])
            yield f"{number_of(len(bare), 'exposures')} without a mark have EXIF's heights: {names}"


def _beside(shots: Sequence[_Shot]) -> dict[str, tuple[float, float]]:
    """Return how far the positions of the pictures' own metadata lie from the marks, medians, m."""
    both = [
        (mark, place)
        for shot in shots
        if (mark := shot.taken[0].mark) is not None
        and (place := metadata.place_of(shot.taken[0].tags)) is not None
    ]
    if not both:
        return {}
    metre = np.pi / 180 * AXIS_M
    d = [
        (
            metre * np.hypot(lat - m.lat_deg, (lon - m.lon_deg) * np.cos(np.radians(lat))),
            height - m.height_m,
        )
        for m, (lat, lon, height) in both
    ]
    plane, height = np.median(np.array(d), axis=0)
    return {"those of EXIF": (float(plane), float(height))}


ZONES_S, CLOCK_S = 900, 2.0
"""Step of time zones, a quarter of an hour; largest offset of a clock without a message."""


def _clock(shots: Sequence[_Shot]) -> Iterator[str]:
    """Yield by how much the clock of EXIF is off the time of the receiver, zones of it aside."""
    off = []
    for shot in shots:
        tags = shot.taken[0].tags
        time, parts = metadata.time_of(tags), tags.exif.get("GPSTimeStamp")
        if time is None or not isinstance(parts, tuple):
            continue
        pairs = [parts[i : i + 2] for i in (0, 2, 4)] if len(parts) == 6 else list(parts)
        hours, minutes, seconds = (rational(pair) for pair in pairs)
        utc = 3600 * hours + 60 * minutes + seconds
        day = time.hour * 3600 + time.minute * 60 + time.second + time.microsecond / 1e6
        off.append((day - utc + ZONES_S / 2) % ZONES_S - ZONES_S / 2)
    if off and np.isfinite(off).all() and abs(float(np.median(off))) > CLOCK_S:
        yield (
            f"the clock of EXIF is {np.median(off):+.0f} s off the receiver's time, whole zones "
            "aside; times are the clock's"
        )


def _found(
    shots: Sequence[_Shot],
    heads: Sequence[Head],
    lenses: Mapping[str, Lens],
    first: Mapping[str, Tags],
) -> list[str]:
    n = sum(len(shot.taken) for shot in shots)
    whole = sum(len(shot.taken) == len(heads) for shot in shots)
    f = [lens.camera.interior.f for lens in lenses.values()]
    worst = max((lens.fitted for lens in lenses.values()), key=lambda fitted: fitted.largest_px)
    sentences = [
        f"{number_of(n, 'pictures')} of {number_of(len(heads), 'heads')} at "
        f"{number_of(len(shots), 'exposures')}, {whole} of these complete",
        f"focal lengths {min(f):.3f} to {max(f):.3f} mm; "
        f"{'; '.join(dict.fromkeys(lens.said for lens in lenses.values()))}",
        f"lenses rewritten with k1 to p2 of the flight leave {worst}",
    ]
    return [
        *sentences,
        *_clock(shots),
        *_take_off(shots),
        *metadata.sentences([first[head.name] for head in heads]),
    ]


def _take_off(shots: Sequence[_Shot]) -> list[str]:
    """Return a sentence on the height of the ground at take-off, from heights above it."""
    above = ((shot, shot.taken[0].tags.number(metadata.ABOVE_TAKE_OFF)) for shot in shots)
    ground = [_place(shot)[2] - height for shot, height in above if height is not None]
    if not ground:
        return []
    middle, spread = float(np.median(ground)), float(np.ptp(ground))
    return [
        f"ground at take-off at {middle:.1f} m in the heights of the positions (RelativeAltitude "
        f"of {number_of(len(ground), 'exposures')}, within {spread:.1f} m): where the ground "
        f"is level, acx4 measure takes it by --ground {middle:.0f}"
    ]


# --- Timestamp.MRK of DJI and Autel: positions of an antenna, brought to the camera
#
# A line is an exposure: its number, GPS time, the way from the antenna to the camera along north,
# east and down in mm, latitude, longitude and ellipsoidal height of the antenna, three sigma
# (north, east, height) in m, and a flag of the solution: 50 is fixed, 34 float, 16 single.


SUFFIX = ".mrk"
FIXED = 50
FLAGS = {0: "none", 16: "single", 34: "float"}

AXIS_M, FLATTENING = 6378137.0, 1 / 298.257223563
"""Of WGS 84, for ways of a metre."""

POLE_DEG = 90.0

_NUMBER = r"\s*([-+\d.eE]++)\s*"
_LINE = re.compile(
    rf"\s*(\d++){_NUMBER}\[\d++\]{_NUMBER},\s*N{_NUMBER},\s*E{_NUMBER},\s*V{_NUMBER},\s*Lat"
    rf"{_NUMBER},\s*Lon{_NUMBER},\s*Ellh{_NUMBER},{_NUMBER},\s*([-+\d.eE]++)\s+(\d++),\s*Q\s*",
    re.ASCII | re.IGNORECASE,
)
_OF_FILE = re.compile(r"_(\d{4,5})(?:_[A-Za-z]+(?:_\d+)?)?$")
"""The number of an exposure in a file's name: ``DJI_0024``, ``DJI_20240501102030_0024_V``."""


@dataclass(frozen=True, kw_only=True)
class Mark:
    """Where the camera was at an exposure.

    Attributes
    ----------
    lat_deg, lon_deg, height_m : float
        Of the camera, WGS 84, above the ellipsoid.
    sigma_m : tuple of float
        East, north, height.
    flag : int
    offset_m : float
        Length of the way from the antenna.
    """

    lat_deg: float
    lon_deg: float
    height_m: float
    sigma_m: tuple[float, float, float]
    flag: int
    offset_m: float


def marks_of(folder: Path) -> tuple[dict[int, Mark], dict[str, str]]:
    """Return the marks beside pictures by their numbers, and the checksums of the files.

    Raises
    ------
    FlightError
        For a line that is none, and a number that comes twice.
    """
    marks: dict[int, Mark] = {}
    sums: dict[str, str] = {}
    for path in sorted(p for p in folder.iterdir() if p.suffix.lower() == SUFFIX):
        file = safe.read(path)
        sums[path.name] = file.sha256
        for number, text in enumerate(file.text().splitlines(), start=1):
            if text.strip():
                exposure, mark = _mark(file, number, text)
                if exposure in marks:
                    expected = "must be there once in the files of a folder"
                    raise file.wrong("number", f"line {number}: {exposure} again", expected)
                marks[exposure] = mark
    return marks, sums


def _mark(file: Opened, number: int, text: str) -> tuple[int, Mark]:
    """Return an exposure's number, and where its camera was."""
    match = _LINE.fullmatch(text)
    try:
        values = [] if match is None else [float(cell) for cell in match.groups()]
    except ValueError:
        values = []
    if not values or not np.all(np.isfinite(values)) or abs(values[5]) >= POLE_DEG:
        expected = "must be number, time, N, E, V, Lat, Lon, Ellh, three sigma and Q"
        raise file.wrong(f"line {number}", quoted(text.strip()), expected)
    north, east, down = (value / 1000 for value in values[2:5])
    lat, lon, height, sigma_north, sigma_east, sigma_up, flag = values[5:12]
    by_north, by_east = _degrees_of_metre(lat)
    return int(values[0]), Mark(
        lat_deg=lat + north * by_north,
        lon_deg=lon + east * by_east,
        height_m=height - down,
        sigma_m=(sigma_east, sigma_north, sigma_up),
        flag=int(flag),
        offset_m=float(np.linalg.norm([north, east, down])),
    )


def _degrees_of_metre(lat_deg: float) -> tuple[float, float]:
    """Return a metre to the north, and to the east, in degrees."""
    e2 = FLATTENING * (2 - FLATTENING)
    lat = np.radians(lat_deg)
    w = np.sqrt(1 - e2 * np.sin(lat) ** 2)
    meridian, normal = AXIS_M * (1 - e2) / w**3, AXIS_M / w
    return float(np.degrees(1 / meridian)), float(np.degrees(1 / (normal * np.cos(lat))))


def _number_in(stem: str) -> int | None:
    """Return the number of an exposure in the name of its picture; None where it has none."""
    match = _OF_FILE.search(stem)
    return int(match[1]) if match else None


def _warnings_of(marks: Sequence[Mark]) -> list[str]:
    """Return a warning where marks of exposures are no fixed solutions."""
    bad = Counter(mark.flag for mark in marks if mark.flag != FIXED)
    if not bad:
        return []
    kinds = ", ".join(
        f"{n} with flag {flag} ({FLAGS.get(flag, 'not fixed')})" for flag, n in sorted(bad.items())
    )
    counted = number_of(len(marks), "exposures")
    return [f"positions of {counted} are by Timestamp.MRK, of which not all are fixed: {kinds}"]


def _sentence(marks: Sequence[Mark], others: Mapping[str, tuple[float, float]]) -> str:
    """Return a sentence on the use of the marks of exposures."""
    offset = float(np.median([mark.offset_m for mark in marks]))
    text = (
        f"positions of {number_of(len(marks), 'exposures')} are those of the antenna in "
        f"Timestamp.MRK, joined by number and moved by {offset:.3f} m (median) to the camera; "
        "heights are above the ellipsoid"
    )
    for whose, (plane, height) in others.items():
        text += f"; {whose} lie {plane:.3f} m beside them and {height:+.3f} m above (medians)"
    return text


# --- Where the top of a picture points, by the next picture of its strip and the way between them


SIDE = 1000
"""Pixels of the longer side at which pictures are compared."""

LEAST, RATIO, WITHIN_PX = 12, 0.8, 4.0
"""Of features that agree; of the best distance to the second; from the common shift."""

PAIRS = 7
"""Pairs of pictures that decide between two headings at most."""

Taken = tuple[Tags, tuple[float, float, float]]
"""The metadata of a picture; latitude and longitude, degrees, and height."""

Both = Mapping[int, tuple[float, float]]
"""Headings of the gimbal and of the aircraft, degrees, by the numbers of exposures."""


def _judged(taken: Sequence[Taken], both: Both, other: Sequence[int]) -> tuple[bool, str]:
    """Let the pictures decide where gimbal and aircraft look in other directions."""
    by = np.median([_apart(*both[k]) for k in other])
    begin = (
        f"at {len(other)} of {number_of(len(both), 'exposures')} the yaw of the gimbal and that of "
        f"the aircraft differ by {by:.0f}° (median): "
    )
    votes = _votes(taken, both, other)
    if 3 * max(votes) < 2 * sum(votes) or not any(votes):
        return False, f"{begin}the pictures do not say which is right, and the gimbal's is taken"
    is_aircraft = votes[1] > votes[0]
    return is_aircraft, (
        f"{begin}{max(votes)} of {number_of(sum(votes), 'pairs')} of pictures agree with the "
        f"{'aircraft' if is_aircraft else 'gimbal'}'s, which is taken"
    )


def _votes(taken: Sequence[Taken], both: Both, other: Sequence[int]) -> tuple[int, int]:
    """Count pairs of neighbours whose pictures agree with the gimbal, and with the aircraft."""
    pairs = [k for k in other if k + 1 in other and _is_straight(both[k], both[k + 1])]
    votes = [0, 0]
    for k in pairs[:: max(len(pairs) // PAIRS, 1)][:PAIRS]:
        (a, (lat, lon, _)), (b, (next_lat, next_lon, _)) = taken[k : k + 2]
        step = next_lat - lat, (next_lon - lon) * np.cos(np.radians(lat))
        by_pictures = _heading_by(a.path, b.path, step)
        if by_pictures is not None:
            off = [_apart(by_pictures, heading) for heading in both[k]]
            if min(off) < ANOTHER_COURSE_DEG:
                votes[int(off[1] < off[0])] += 1
    return votes[0], votes[1]


def _is_straight(first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Return whether gimbal and aircraft kept their headings from one exposure to the next."""
    return max(_apart(a, b) for a, b in zip(first, second, strict=True)) < ANOTHER_COURSE_DEG / 2


def _heading_by(first: Path, second: Path, step: tuple[float, float]) -> float | None:
    """Return the heading of the top of two vertical pictures, taken one after the other.

    What is on the ground moves through the picture against the way of the camera.
    """
    grey = [picture for path in (first, second) if (picture := _grey(path)) is not None]
    if len(grey) < 2:
        return None
    sift = cv2.SIFT.create(nfeatures=3000, contrastThreshold=0.02)
    (at_a, words_a), (at_b, words_b) = (sift.detectAndCompute(pixels, None) for pixels in grey)
    if min(len(at_a), len(at_b)) < LEAST:
        return None
    pairs = cv2.BFMatcher().knnMatch(words_a, words_b, k=2)
    alike = [two[0] for two in pairs if len(two) == 2 and two[0].distance < RATIO * two[1].distance]
    if len(alike) < LEAST:
        return None
    a, b = (
        np.array([points[getattr(match, which)].pt for match in alike])
        for points, which in ((at_a, "queryIdx"), (at_b, "trainIdx"))
    )
    turn, inside = cv2.estimateAffinePartial2D(a, b, ransacReprojThreshold=WITHIN_PX)
    if turn is None or int(inside.sum()) < LEAST:
        return None
    shift = np.mean(b[inside.ravel() == 1] - a[inside.ravel() == 1], axis=0)
    if np.hypot(*shift) < 5 * WITHIN_PX:
        return None
    right, ahead = -shift[0], shift[1]  # the way of the camera; rows count downwards
    way = np.degrees(np.arctan2(step[1], step[0]) - np.arctan2(right, ahead))
    return float(way % 360.0)


def _grey(path: Path) -> Array | None:
    """Return a picture in 8 bit, at most `SIDE` px long; None where it cannot be unpacked."""
    try:
        picture = _pixels(safe.read(path).data)
    except (*BROKEN, cv2.error):
        return None
    share = min(1.0, SIDE / max(picture.shape))
    small = cv2.resize(
        picture.astype(np.float32), None, fx=share, fy=share, interpolation=cv2.INTER_AREA
    )
    low, high = np.percentile(small, (0.5, 99.5))
    bright = (small - low) * (255 / max(float(high - low), 1e-6))
    return np.asarray(np.clip(bright, 0, 255).astype(np.uint8))


def _pixels(data: bytes) -> Array:
    """Return the pixels of a JPEG or a TIFF, (rows, cols)."""
    if data[:2] == b"\xff\xd8":
        flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
        if decoded is None:
            raise ValueError("is damaged")
        return np.asarray(decoded, dtype=float)
    with tiff_files.in_silence():
        picture = tifffile.imread(io.BytesIO(data)).astype(float)
    return np.asarray(picture.mean(axis=-1) if picture.ndim > 2 else picture)
