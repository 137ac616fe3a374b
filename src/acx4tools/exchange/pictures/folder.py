"""A flight of the pictures in a folder: cameras, mountings, exposures, positions, attitudes."""

from __future__ import annotations

import datetime as dt
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.problems import quoted
from acx4lib.flight.setup import LEVER, camera_table
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4tools.exchange.flight_folder import Brought, number_of
from acx4tools.exchange.lens import FLIP, WARNED_PX, WORST_PX, too_far
from acx4tools.exchange.pictures import marks
from acx4tools.exchange.pictures.lens import Lens, lens_of
from acx4tools.exchange.pictures.marks import Mark
from acx4tools.exchange.pictures.tags import Tags, rational, read
from acx4tools.exchange.safe.opened import refusal

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


def bring(
    source: Path,
    *,
    crs: str = "",
    pixel_um: float | None = None,
    allow: float = WORST_PX,
    hold_out: int | None = None,
) -> Brought:
    """Return the flight that the metadata of a folder's pictures describe.

    Parameters
    ----------
    source : Path
        Folder with TIFF or JPEG files, in folders of it too.
    crs : str
        Projected CRS of the flight; by default the UTM zone of the mean position, in WGS 84.
    pixel_um : float, optional
        Size of a pixel, for pictures that do not say it.
    allow : float
        Largest difference of a refitted lens, px.
    hold_out : int, optional
        Every so many exposures one is held out, as block ``validation``.

    Returns
    -------
    Brought
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
    heads = in_order(list({one.head.name: one.head for s in shots for one in s.taken}.values()))
    first = {one.head.name: one.tags for shot in reversed(shots) for one in shot.taken}
    known = None if pixel_um is None else pixel_um / 1000
    lenses = {h.name: lens_of(first[h.name], h.name, known_pixel_mm=known) for h in heads}
    for name, lens in lenses.items():
        if (fault := too_far(lens.fitted, allow)) is not None:
            raise first[name].wrong("lens", f"{name}: {fault[0]}", fault[1])
    blocks = _blocks(shots, len(heads) > 1, hold_out)
    in_heads = {"heads", "calibration"} <= blocks.keys()
    return Brought(
        source=f"pictures of {_maker(taken)}",
        sha256={**{one.file: one.tags.sha256 for one in taken}, **sums},
        settings={
            **_settings(source, shots, heads, lenses, crs, in_heads=in_heads),
            **(_HELD if in_heads and _is_navigation(shots) else {}),
        },
        tables={
            "control_points.csv": {n: [] for n in ("point", "east_m", "north_m", "height_m")},
            **{
                f"{block}/{name}": table
                for block, own in blocks.items()
                for name, table in _tables(own).items()
            },
        },
        pictures={
            f"{block}/{one.file}": one.tags.path
            for block, own in blocks.items()
            for shot in own
            for one in shot.taken
        },
        warnings=(
            *(marks.warnings_of(_marks(shots))),
            *_cut(taken),
            *decided,
            *(
                f"the lens of {name} differs from that of its metadata by {lens.fitted}"
                for name, lens in lenses.items()
                if lens.fitted.largest_px > WARNED_PX
            ),
        ),
        assumed=(*_assumed(shots, heads), *_on_blocks(shots, hold_out, in_heads=in_heads)),
        found=tuple(_found(shots, heads, lenses, first)),
        left_out=(*others, *without),
    )


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
        found = f"{hold_out} of {number_of(len(shots), 'exposures')}"
        raise refusal(str(path), 1, "--hold-out", found, "must leave exposures on either side")
    kept = [shot for k, shot in enumerate(shots, start=1) if k % hold_out]
    heads = {"heads": kept} if is_rig else {}
    return {**heads, "calibration": kept, "validation": held}


_HELD: dict[str, Any] = {"stages": {"mounting": {"estimate": [], "fix": ["lever_arm"]}}}
"""What the mounting stage of heads estimates where a navigation receiver gives positions."""


def _is_navigation(shots: Sequence[_Shot]) -> bool:
    return float(np.median([_sigma(shot) for shot in shots])) > NAVIGATION_M


def _on_blocks(shots: Sequence[_Shot], hold_out: int | None, *, in_heads: bool) -> Iterator[str]:
    """Yield what is held out, and what is held."""
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
        found = f"holds {len(paths)} pictures ({', '.join(SUFFIXES)})"
        raise refusal(str(source), 1, "folder", found, f"must hold 1 to {MOST}")
    taken: list[_Taken] = []
    problems: list[str] = []
    for path in paths:
        try:
            tags = read(path)
            file = f"images/{path.relative_to(source).as_posix()}"
            taken.append(_Taken(tags=tags, head=head_of(tags), file=file))
        except FlightError as error:
            problems += error.problems
    if problems:
        raise FlightError(problems)
    return taken


def _marked(taken: Sequence[_Taken]) -> tuple[list[_Taken], dict[str, str]]:
    """Return the pictures with the marks of files beside them, and the checksums of these."""
    folders = {one.tags.path.parent for one in taken}
    found = {folder: marks.marks_of(folder) for folder in sorted(folders)}
    sums = {name: value for _, own in found.values() for name, value in own.items()}
    numbers = [marks.number_in(name_of(one.tags)) for one in taken]
    return [
        replace(one, mark=None if k is None else found[one.tags.path.parent][0].get(k))
        for one, k in zip(taken, numbers, strict=True)
    ], sums


def _marks(shots: Sequence[_Shot]) -> list[Mark]:
    return [mark for shot in shots if (mark := shot.taken[0].mark) is not None]


def _cut(taken: Sequence[_Taken]) -> Iterator[str]:
    """Yield a warning where EXIF says that pictures were larger when they were taken."""
    pairs = Counter(
        (one.tags.width_px, one.tags.height_px, width, height)
        for one in taken
        if (width := one.tags.number("PixelXDimension"))
        and (height := one.tags.number("PixelYDimension"))
        and {width, height} != {one.tags.width_px, one.tags.height_px}
    )
    for (width, height, before_w, before_h), n in pairs.items():
        yield (
            f"{number_of(n, 'pictures')} of {width} x {height} px, and {before_w:g} x "
            f"{before_h:g} px by their EXIF: cropped or reduced since, so that the lens of the "
            "metadata is not theirs"
        )


def _decided(shots: Sequence[_Shot]) -> tuple[list[_Shot], list[str]]:
    """Let the pictures decide where gimbal and aircraft of an exposure look in other directions.

    Returns
    -------
    list of _Shot, list of str
        The exposures, with the aircraft's heading where the pictures agree with that, and what is
        said of it.
    """
    both = {}
    for k, shot in enumerate(shots):
        tags = shot.taken[0].tags
        aircraft = tags.number(FLIGHT_YAW)
        if aircraft is not None and all(tags.number(name) is not None for name in GIMBAL):
            both[k] = (_attitude(shot, 0.0).heading, float(aircraft) % 360.0)
    other = [k for k, two in both.items() if _apart(*two) > ANOTHER_COURSE_DEG]
    if not other:
        return list(shots), []
    begin = (
        f"at {len(other)} of {number_of(len(both), 'exposures')} the yaw of the gimbal and that of "
        f"the aircraft differ by {np.median([_apart(*both[k]) for k in other]):.0f}° (median): "
    )
    votes = _votes(shots, both, other)
    if 3 * max(votes) < 2 * sum(votes) or not any(votes):
        return list(shots), [
            f"{begin}the pictures do not say which is right, and the gimbal's is taken"
        ]
    which = int(votes[1] > votes[0])
    said = (
        f"{begin}{votes[which]} of {number_of(sum(votes), 'pairs')} of pictures agree with the "
        f"{('gimbal', 'aircraft')[which]}'s, which is taken"
    )
    if which == 0:
        return list(shots), [said]
    turned = {k: replace(shots[k], heading=both[k][1]) for k in other}
    return [turned.get(k, shot) for k, shot in enumerate(shots)], [said]


def _votes(
    shots: Sequence[_Shot], both: Mapping[int, tuple[float, float]], other: Sequence[int]
) -> tuple[int, int]:
    """Count pairs of neighbours whose pictures agree with the gimbal, and with the aircraft."""
    from acx4tools.exchange.pictures.headings import heading_by  # noqa: PLC0415 loads OpenCV

    pairs = [k for k in other if k + 1 in other and _is_straight(both[k], both[k + 1])]
    votes = [0, 0]
    for k in pairs[:: max(len(pairs) // PAIRS, 1)][:PAIRS]:
        a, b = (shot.taken[0].tags for shot in shots[k : k + 2])
        (lat, lon, _), (next_lat, next_lon, _) = (_place(shot) for shot in shots[k : k + 2])
        step = next_lat - lat, (next_lon - lon) * np.cos(np.radians(lat))
        found = heading_by(a.path, b.path, step, (a.width_px, a.height_px))
        if found is not None:
            apart = [_apart(found, heading) for heading in both[k]]
            if min(apart) < ANOTHER_COURSE_DEG:
                votes[int(apart[1] < apart[0])] += 1
    return votes[0], votes[1]


def _is_straight(first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Return whether gimbal and aircraft kept their headings from one exposure to the next."""
    return max(_apart(a, b) for a, b in zip(first, second, strict=True)) < ANOTHER_COURSE_DEG / 2


def _apart(a: float, b: float) -> float:
    """Return the angle between two headings, degrees."""
    return abs((a - b + 180.0) % 360.0 - 180.0)


def _alike(taken: Sequence[_Taken]) -> tuple[list[_Taken], list[str]]:
    """Return the pictures of the size and kind that most have, and what is said of the others."""
    kinds = Counter(_kind(one) for one in taken)
    usual = max(kinds, key=lambda kind: (kinds[kind], kind))
    others = [one for one in taken if _kind(one) != usual]
    said = []
    if others:
        width, height, samples, bits = usual
        said = [
            f"{number_of(len(others), 'pictures')} of another kind than {width} x {height} px, "
            f"{samples} x {bits} bit: {_some([one.tags.path.name for one in others])}"
        ]
    return [one for one in taken if _kind(one) == usual], said


def _kind(one: _Taken) -> tuple[int, int, int, int]:
    return one.tags.width_px, one.tags.height_px, one.tags.samples, one.tags.bits


def _shots(taken: Sequence[_Taken]) -> list[_Shot]:
    """Return the exposures in the order of time; a head has one picture of each."""
    ordered = sorted(taken, key=lambda one: key(one.tags))
    groups = [tuple(g) for _, g in groupby(ordered, key=lambda one: key(one.tags))]
    for group in groups:
        names = [one.head.name for one in group]
        ((again, times),) = Counter(names).most_common(1)
        if times > 1:
            first, second, *_ = [one.tags for one in group if one.head.name == again]
            found = f"{again} as in {first.path} of the same exposure"
            raise second.wrong(f"{INDEX}, {BAND}", found, "must be another head's")
    groups.sort(key=lambda group: (_when(group[0].tags), str(group[0].tags.path)))
    names = [name_of(group[0].tags) for group in groups]
    often = Counter(names)
    folders = [group[0].tags.path.parent.name for group in groups]
    unique = [
        n if often[n] == 1 else f"{folder}/{n}" for n, folder in zip(names, folders, strict=True)
    ]
    if len(set(unique)) < len(unique):
        unique = [f"{k}/{name}" for k, name in enumerate(names, start=1)]
    return [_Shot(name=n, taken=group) for n, group in zip(unique, groups, strict=True)]


def _when(tags: Tags) -> float:
    time = time_of(tags)
    return 0.0 if time is None else time.timestamp()


def _placed(shots: Sequence[_Shot]) -> tuple[list[_Shot], list[str]]:
    """Return the exposures that have a position, and what is said of the others."""
    known = [_found_place(shot) is not None for shot in shots]
    placed = [shot for shot, there in zip(shots, known, strict=True) if there]
    if not placed:
        tags, expected = shots[0].taken[0].tags, "needed, and no other picture has a position"
        raise tags.wrong("GPSLatitude, GPSLongitude, GPSAltitude", "missing", expected)
    without = [shot.name for shot, there in zip(shots, known, strict=True) if not there]
    said = f"{number_of(len(without), 'exposures')} without a position: {_some(without)}"
    return placed, [said] if without else []


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
    time = time_of(shots[0].taken[0].tags)
    if time is not None:
        out["session"] = {"date": time.date()}
    if len(heads) > 1:
        first = lenses[heads[0].name].camera
        ideal = replace(first, name=SYNTHETIC, interior=Interior(f=first.interior.f))
        cameras[SYNTHETIC] = _camera(ideal, DOWN)
        out["synthetic"] = {"camera": SYNTHETIC, "heads": [head.name for head in heads]}
        if in_heads:
            out["synthetic"]["measured_in"] = "heads"
    return out


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
    rows = [(shot, one) for shot in shots for one in shot.taken]
    images = {
        "image": [f"{shot.name} {one.head.name}" for shot, one in rows],
        "camera": [one.head.name for _, one in rows],
        "exposure": [shot.name for shot, _ in rows],
        "file": [one.file for _, one in rows],
    }
    points: dict[str, list[Any]] = {n: [] for n in ("image", "point", "col_px", "row_px")}
    return {"images.csv": images, "image_points.csv": points, "trajectory.csv": _trajectory(shots)}


def _trajectory(shots: Sequence[_Shot]) -> dict[str, list[Any]]:
    places = [_place(shot) for shot in shots]
    held = [_attitude(shot, way) for shot, way in zip(shots, course(places), strict=True)]
    table: dict[str, list[Any]] = {
        "exposure": [shot.name for shot in shots],
        "lat_deg": [round(lat, 9) for lat, _, _ in places],
        "lon_deg": [round(lon, 9) for _, lon, _ in places],
        "height_m": [round(height, 4) for _, _, height in places],
        "roll_deg": [round(one.roll, 6) for one in held],
        "pitch_deg": [round(one.pitch, 6) for one in held],
        "heading_deg": [round(one.heading, 6) for one in held],
    }
    times = [time_of(shot.taken[0].tags) for shot in shots]
    if all(time is not None for time in times):
        day = min(time for time in times if time).replace(hour=0, minute=0, second=0, microsecond=0)
        table["time_s"] = [round((time - day).total_seconds(), 6) for time in times if time]
    sigma = np.array([_sigma(shot) for shot in shots])
    for k, axis in enumerate(("east", "north", "height")):
        table[f"sigma_{axis}_m"] = sigma[:, k].tolist()
    for axis in ("roll", "pitch", "heading"):
        name = "sigma_heading" if axis == "heading" else "sigma_tilt"
        table[f"sigma_{axis}_deg"] = [getattr(one, name) for one in held]
    return table


def _place(shot: _Shot) -> tuple[float, float, float]:
    return _found_place(shot) or (np.nan, np.nan, np.nan)


def _found_place(shot: _Shot) -> tuple[float, float, float] | None:
    """Return latitude, longitude, height of an exposure: by its mark, else by its metadata."""
    first = shot.taken[0]
    if first.mark is not None:
        return first.mark.lat_deg, first.mark.lon_deg, first.mark.height_m
    return place_of(first.tags)


def _sigma(shot: _Shot) -> tuple[float, float, float]:
    """Return sigma of a position; of a navigation receiver where no picture says it."""
    if (mark := shot.taken[0].mark) is not None and min(mark.sigma_m) > 0:
        return mark.sigma_m
    known = (sigma_of(one.tags) for one in shot.taken)
    return next((sigma for sigma in known if sigma is not None), (3.0, 3.0, 6.0))


def _attitude(shot: _Shot, heading: float) -> Attitude:
    found = attitude_of(shot.taken[0].tags)
    if found is not None and shot.heading is not None:
        return replace(found, heading=shot.heading)
    tilt, turn = _LEVEL
    return found or Attitude(
        roll=0.0,
        pitch=0.0,
        heading=heading,
        sigma_tilt=tilt,
        sigma_heading=turn,
        said="no angles: level, and ahead along the track",
    )


# --- what is said ----------------------------------------------------------------------------


def _assumed(shots: Sequence[_Shot], heads: Sequence[Head]) -> list[str]:
    ways = dict.fromkeys(_attitude(shot, 0.0).said for shot in shots)
    said = [
        *_whose_positions(shots),
        "times are EXIF's: UTC of MicaSense, the clock's zone of others",
        "the camera looks down, and the top of its image is ahead",
        f"attitudes: {'; '.join(ways)}",
        "pixels: (0, 0) is the centre of the first one; principal points count from there",
    ]
    return [*said, *([sentence(heads)] if len(heads) > 1 else [])]


def _whose_positions(shots: Sequence[_Shot]) -> Iterator[str]:
    """Yield whose positions and heights these are."""
    own = [shot for shot in shots if shot.taken[0].mark is None]
    ellipsoidal = [shot for shot in own if _ellipsoidal(shot.taken[0].tags) is not None]
    if ellipsoidal:
        yield (
            "positions are EXIF's, in WGS 84; heights are senseFly's above the ellipsoid, not "
            "those above the sea that stand beside them"
        )
    elif own:
        yield (
            "positions are EXIF's, in WGS 84; heights are taken as they are, above an unnamed "
            "surface"
        )
    if len(own) < len(shots):
        yield marks.sentence(_marks(shots), _beside(shots))
        if own:
            names = _some([shot.name for shot in own])
            yield f"{number_of(len(own), 'exposures')} without a mark have EXIF's heights: {names}"


def _beside(shots: Sequence[_Shot]) -> dict[str, tuple[float, float]]:
    """Return how far the positions of the pictures' own metadata lie from the marks, medians, m."""
    both = [
        (mark, place)
        for shot in shots
        if (mark := shot.taken[0].mark) is not None
        and (place := place_of(shot.taken[0].tags)) is not None
    ]
    if not both:
        return {}
    metre = np.pi / 180 * marks.AXIS_M
    d = [
        (
            metre * np.hypot(lat - m.lat_deg, (lon - m.lon_deg) * np.cos(np.radians(lat))),
            height - m.height_m,
        )
        for m, (lat, lon, height) in both
    ]
    plane, height = np.median(np.array(d), axis=0)
    return {"those of EXIF": (float(plane), float(height))}


def _clock(shots: Sequence[_Shot]) -> Iterator[str]:
    """Yield by how much the clock of EXIF is off the time of the receiver, zones of it aside."""
    off = []
    for shot in shots:
        tags = shot.taken[0].tags
        time, parts = time_of(tags), tags.exif.get("GPSTimeStamp")
        if time is None or not isinstance(parts, tuple):
            continue
        pairs = [parts[i : i + 2] for i in (0, 2, 4)] if len(parts) == 6 else list(parts)
        hours, minutes, seconds = (rational(one) for one in pairs)
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
    left = max((lens.fitted for lens in lenses.values()), key=lambda one: one.largest_px)
    said = [
        f"{number_of(n, 'pictures')} of {number_of(len(heads), 'heads')} at "
        f"{number_of(len(shots), 'exposures')}, {whole} of these complete",
        f"focal lengths {min(f):.3f} to {max(f):.3f} mm; "
        f"{'; '.join(dict.fromkeys(lens.said for lens in lenses.values()))}",
        f"lenses rewritten with k1 to p2 of the flight leave {left}",
    ]
    return [
        *said,
        *_clock(shots),
        *_take_off(shots),
        *sentences([first[head.name] for head in heads]),
    ]


def _take_off(shots: Sequence[_Shot]) -> list[str]:
    """Return the height of the ground at take-off, by heights above it, and what it is for."""
    above = ((shot, shot.taken[0].tags.number(ABOVE_TAKE_OFF)) for shot in shots)
    ground = [_place(shot)[2] - height for shot, height in above if height is not None]
    if not ground:
        return []
    middle, spread = float(np.median(ground)), float(np.ptp(ground))
    return [
        f"ground at take-off at {middle:.1f} m in the heights of the positions (RelativeAltitude "
        f"of {number_of(len(ground), 'exposures')}, within {spread:.1f} m): where the ground "
        f"is level, acx4 measure takes it by --ground {middle:.0f}"
    ]


# --- When, where and how a camera was held, from the metadata of one of its pictures


CAPTURE = ("MicaSense:CaptureId", "drone-dji:CaptureUUID", "Camera:CaptureUUID")
GIMBAL = tuple(f"drone-dji:Gimbal{name}Degree" for name in ("Roll", "Pitch", "Yaw"))
CAMERA = tuple(f"Camera:{name}" for name in ("Roll", "Pitch", "Yaw"))
LIGHT = tuple(f"DLS:{name}" for name in ("Roll", "Pitch", "Yaw"))
FLIGHT_YAW = "drone-dji:FlightYawDegree"
SENSEFLY = ("senseFly:Roll", "senseFly:Pitch", "senseFly:Heading")
ANOTHER_COURSE_DEG, PAIRS = 45.0, 7
"""Headings that are farther apart are two; pairs of pictures that decide between them at most."""

ZONES_S, CLOCK_S = 900, 2.0
"""Zones of time differ by quarters of an hour; a clock that is off by more is told."""

ABOVE_TAKE_OFF = "drone-dji:RelativeAltitude"
RTK = tuple(f"drone-dji:RtkStd{name}" for name in ("Lon", "Lat", "Hgt"))
ACCURACY = ("Camera:GPSXYAccuracy", "Camera:GPSZAccuracy")

_HEADS_OF_NAME = re.compile(r"(.+?)_\d{1,2}$")


@dataclass(frozen=True, kw_only=True)
class Attitude:
    """Roll, pitch and heading, degrees, sigma of them, and what they are from."""

    roll: float
    pitch: float
    heading: float
    sigma_tilt: float
    sigma_heading: float
    said: str


def key(tags: Tags) -> str:
    """Return what the pictures of one exposure have in common: an identifier, or their name.

    The name is that of the file, without the number of the head: ``IMG_0688`` of ``IMG_0688_4``.
    """
    stem = tags.path.stem
    found = _HEADS_OF_NAME.match(stem)
    return tags.text(*CAPTURE) or f"{tags.path.parent}/{found[1] if found else stem}"


def name_of(tags: Tags) -> str:
    """Return the name of an exposure by that of one of its files."""
    found = _HEADS_OF_NAME.match(tags.path.stem)
    return found[1] if found else tags.path.stem


def time_of(tags: Tags) -> dt.datetime | None:
    """Return the time of the exposure by EXIF; None where it has none.

    Raises
    ------
    FlightError
        Where it is no time.
    """
    text = tags.text("DateTimeOriginal", "DateTime")
    if not text:
        return None
    try:
        time = dt.datetime.strptime(text[:19], "%Y:%m:%d %H:%M:%S")
    except ValueError:
        expected = "must be a time as 2023:10:14 11:48:22"
        raise tags.wrong("DateTimeOriginal", quoted(text), expected) from None
    digits = tags.text("SubsecTimeOriginal", "SubsecTime")
    sign = -1 if digits.startswith("-") else 1
    part = digits.lstrip("-")
    return time + sign * dt.timedelta(seconds=float(f"0.{part}") if part.isdigit() else 0.0)


def place_of(tags: Tags) -> tuple[float, float, float] | None:
    """Return latitude and longitude, degrees, and height, m; None where there are none.

    0 N 0 E is what receivers write that have no fix, and no position.

    Raises
    ------
    FlightError
        Where one of them is no number, or is nowhere on Earth.
    """
    lat, lon = (_angle(tags, f"GPS{name}") for name in ("Latitude", "Longitude"))
    height = tags.number("GPSAltitude")
    if lat is None or lon is None or height is None or lat == lon == 0:
        return None
    if not (abs(lat) <= 90 and abs(lon) <= 180):
        raise tags.wrong("GPSLatitude, GPSLongitude", f"{lat:g}, {lon:g}", "must be on Earth")
    below = str(tags.exif.get("GPSAltitudeRef", 0)) in ("1", "b'\\x01'", "3")
    ellipsoidal = _ellipsoidal(tags)
    if ellipsoidal is not None:
        return lat, lon, ellipsoidal
    return lat, lon, -height if below else height


def _ellipsoidal(tags: Tags) -> float | None:
    """Return senseFly's height above the ellipsoid; None where there is none."""
    for name in tags.xmp:
        kind = name.lower()
        if kind.startswith("sensefly:") and "alt" in kind and "wgs84" in kind:
            return tags.number(name)
    return None


def _angle(tags: Tags, name: str) -> float | None:
    """Return an angle of EXIF, degrees, minutes and seconds, with its sign."""
    value = tags.exif.get(name)
    if value is None:
        return None
    parts = value if isinstance(value, tuple) else ()
    if len(parts) == 6:
        parts = tuple(rational(parts[i : i + 2]) for i in (0, 2, 4))
    degrees = sum(rational(part) / 60**k for k, part in enumerate(parts))
    if len(parts) != 3 or not np.isfinite(degrees):
        raise tags.wrong(name, quoted(str(value)), "must be three ratios")
    negative = str(tags.exif.get(f"{name}Ref", "")).strip("\0 ").upper() in ("S", "W")
    return -degrees if negative else degrees


def sigma_of(tags: Tags) -> tuple[float, float, float] | None:
    """Return sigma of east, north and height, m; None where the metadata have none."""
    rtk = [tags.number(name) for name in RTK]
    if all(value is not None and value > 0 for value in rtk):
        east, north, up = (float(value or 0) for value in rtk)
        return east, north, up
    plan, height = (tags.number(name) for name in ACCURACY)
    return (plan, plan, height) if plan and height and min(plan, height) > 0 else None


def attitude_of(tags: Tags) -> Attitude | None:
    """Return the attitude of a body whose camera looks down, the top of the image ahead.

    The first that is there: the gimbal's angles of DJI, whose pitch is -90 deg straight down; the
    camera's, after the specification of Pix4D; those of the light sensor of MicaSense, which sits
    on the aircraft and not on the camera.
    """
    ways = (
        (GIMBAL, 1.0, 90.0, (0.5, 3.0), "the gimbal's angles; its pitch is -90° straight down"),
        (CAMERA, 1.0, 0.0, (3.0, 5.0), "the angles Camera:Roll, Pitch and Yaw in degrees"),
        (_of_sensefly(tags), 1.0, 0.0, (3.0, 5.0), "senseFly's roll, pitch and heading in degrees"),
        (LIGHT, np.degrees(1.0), 0.0, (10.0, 10.0), "the light sensor's (DLS) angles in radians"),
    )
    for names, unit, level, (tilt, heading), said in ways:
        values = [tags.number(name) for name in names]
        if all(value is not None for value in values):
            roll, pitch, yaw = (float(unit) * float(value or 0.0) for value in values)
            if abs(roll) > 90.0:  # the same attitude by its other three angles
                roll, pitch, yaw = (
                    roll - np.copysign(180.0, roll),
                    -pitch % 360.0 - 180.0,
                    yaw + 180.0,
                )
            return Attitude(
                roll=roll,
                pitch=pitch + level,
                heading=yaw % 360.0,
                sigma_tilt=tilt,
                sigma_heading=heading,
                said=said,
            )
    return None


def _of_sensefly(tags: Tags) -> tuple[str, ...]:
    """Return the names of senseFly's angles as a file writes them, whatever their capitals."""
    there = {name.lower(): name for name in tags.xmp}
    roll, pitch, heading = (there.get(name.lower(), name) for name in SENSEFLY)
    return roll, pitch, there.get("sensefly:yaw", heading)


def course(places: Sequence[tuple[float, float, float]]) -> list[float]:
    """Return the course at every exposure, degrees from north, by its neighbours; 0 for one."""
    if len(places) < 2:
        return [0.0] * len(places)
    lat, lon, _ = np.array(places).T
    north, east = np.gradient(lat), np.gradient(lon) * np.cos(np.radians(lat))
    return [float(a) for a in np.degrees(np.arctan2(east, north)) % 360.0]


# --- Which head took a picture, and how the heads of a rig are turned to each other
#
# `RigRelatives` of MicaSense are three angles of every head to its reference. The vendor's own
# software makes Rx(a) Ry(b) Rz(c) of them. This matrix turns a ray of the *head* into the
# reference: the pixels say so (chapter on ten real heads). Camera axes there have y down and z
# ahead.


RELATIVES, REFERENCE = "Camera:RigRelatives", "Camera:RigRelativesReferenceRigCameraIndex"
INDEX, BAND = "Camera:RigCameraIndex", "Camera:BandName"

DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""R_b_c of a camera that looks straight down and whose top of the image is ahead."""


@dataclass(frozen=True, kw_only=True)
class Head:
    """One head of a camera.

    Attributes
    ----------
    name : str
        Number and band: ``2 Green``; of a camera without bands, its model.
    index : int
        Its number in the rig; -1 where it has none.
    reference : int or None
        Number of the head to which its angles are; None where it has none.
    relatives_deg : tuple of float
        Its angles a, b, c; none where it has none.
    """

    name: str
    index: int
    reference: int | None
    relatives_deg: tuple[float, ...]


def head_of(tags: Tags) -> Head:
    """Return the head that took a picture.

    Raises
    ------
    FlightError
        Where numbers in the metadata are none.
    """
    found, reference = tags.number(INDEX), tags.number(REFERENCE)
    index, band = -1 if found is None else int(found), tags.text(BAND, "drone-dji:BandName")
    model = tags.text("Model", "Make") or "camera"
    relatives = tags.numbers(RELATIVES, 3)
    name = " ".join(filter(None, [str(index + 1) if index >= 0 else "", band])) or model
    return Head(
        name=name,
        index=index,
        reference=int(reference) if relatives and reference is not None else None,
        relatives_deg=relatives,
    )


def rotation(relatives_deg: Sequence[float]) -> Array:
    """Return R_ref_h of a head, the library's axes: from the head's to those of its reference.

    Parameters
    ----------
    relatives_deg : sequence of float
        `RigRelatives`: a, b, c.
    """
    flip = np.diag([*FLIP, -1.0])
    turned = Rotation.from_euler("XYZ", relatives_deg, degrees=True).as_matrix()
    return np.asarray(flip @ turned @ flip)


def in_order(heads: Sequence[Head]) -> list[Head]:
    """Return the heads, first the one that is the reference of most; without angles, the first.

    Parameters
    ----------
    heads : sequence of Head
    """
    sorted_heads = sorted(heads, key=lambda head: (head.index, head.name))
    named = [head.reference for head in heads if head.reference is not None]
    first = next((h for h in sorted_heads if named and h.index == named[0]), sorted_heads[0])
    return [first, *(head for head in sorted_heads if head is not first)]


def _mountings(heads: Sequence[Head]) -> Mapping[str, Array]:
    """Return R_b_c of every head: looking down, the top of the image ahead, by its angles."""
    turned = {
        head.name: DOWN @ rotation(head.relatives_deg) if head.relatives_deg else DOWN
        for head in heads
    }
    return {name: np.asarray(R) for name, R in turned.items()}


def sentence(heads: Sequence[Head]) -> str:
    """Return what was assumed of the heads' rotations."""
    names = {head.index: head.name for head in heads}
    references = dict.fromkeys(h.reference for h in heads if h.reference is not None)
    turned = [h for h in heads if h.relatives_deg]
    if turned and not references:
        return (
            "RigRelatives a, b, c are degrees; Rx(a) Ry(b) Rz(c) turns a ray of a head into its "
            f"reference, which no file names: {in_order(heads)[0].name}, the first; y down, z ahead"
        )
    if not references:
        return "the heads look in one direction: the metadata have no RigRelatives"
    said = (
        "RigRelatives a, b, c are degrees; Rx(a) Ry(b) Rz(c) turns a ray of a head into its "
        f"reference, {' or '.join(names.get(r, f'head {r}') for r in references)}; y down, z ahead"
    )
    if len(references) > 1:
        said += "; no angles join the rigs, whose references look in one direction at first"
    return said


# --- What the metadata say of grey values: dark level and vignetting. Nothing is applied to
# pixels


CENTRE, POLYNOMIAL = "Camera:VignettingCenter", "Camera:VignettingPolynomial"
DARK, COVERED = "BlackLevel", "MicaSense:DarkRowValue"


@dataclass(frozen=True, kw_only=True)
class Vignetting:
    """The factory's vignetting of a head: grey values are divided by it.

    Attributes
    ----------
    centre_px : tuple of float
        col, row.
    coefficients : tuple of float
        Of r, r^2, …; the constant is one.
    """

    centre_px: tuple[float, float]
    coefficients: tuple[float, ...]

    def at(self, colrow: Array) -> Array:
        """Return the vignetting at pixels (..., 2): one in the middle, less outside."""
        r = np.hypot(*np.moveaxis(np.asarray(colrow, float) - self.centre_px, -1, 0))
        return np.asarray(np.polyval([*self.coefficients[::-1], 1.0], r))


def vignetting(tags: Tags) -> Vignetting | None:
    """Return the vignetting by XMP, as MicaSense's own software reads it; None without it.

    Raises
    ------
    FlightError
        Where the numbers are none.
    """
    centre, coefficients = tags.numbers(CENTRE, 2), tags.numbers(POLYNOMIAL)
    if not (centre and coefficients):
        return None
    return Vignetting(centre_px=(centre[0], centre[1]), coefficients=coefficients)


def dark_level(tags: Tags) -> float | None:
    """Return the grey value of darkness by the TIFF's `DARK`; None without it."""
    value = tags.exif.get(DARK)
    if value is None:
        return None
    found = np.atleast_1d(np.asarray(value, float))
    return float(found.mean()) if found.size and np.all(np.isfinite(found)) else None


def sentences(pictures: Sequence[Tags]) -> list[str]:
    """Return what is known of the grey values of heads, one picture each."""
    said = []
    dark = [level for level in map(dark_level, pictures) if level is not None]
    falls = [(tags, one) for tags in pictures if (one := vignetting(tags)) is not None]
    if dark:
        said.append(f"dark level {min(dark):g} to {max(dark):g}, not subtracted")
    if falls:
        corner = [
            float(one.at(np.array([[0, 0], [t.width_px, 0], [0, t.height_px]])).min())
            for t, one in falls
        ]
        said.append(
            f"vignetting of {number_of(len(falls), 'heads')}, corners with {min(corner):.2f} to "
            f"{max(corner):.2f} of the middle, not applied"
        )
    return said
