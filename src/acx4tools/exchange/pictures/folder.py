"""A flight of the pictures in a folder: cameras, mountings, exposures, positions, attitudes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.setup import LEVER, camera_table
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4tools.exchange.brought import Brought, number_of
from acx4tools.exchange.pictures import exposure, radiometry, rig
from acx4tools.exchange.pictures.lens import Lens, lens_of
from acx4tools.exchange.pictures.rig import Head
from acx4tools.exchange.pictures.tags import Tags, read
from acx4tools.exchange.safe.opened import refusal

SUFFIXES = (".tif", ".tiff", ".jpg", ".jpeg")
MOST = 100_000
"""Largest number of pictures."""

SYNTHETIC = "SYN"
SAID = 5
"""Files that are named where more are counted."""

_LEVEL = (10.0, 30.0)


@dataclass(frozen=True, kw_only=True)
class Taken:
    """One picture: its metadata, its head, its file below the flight's block."""

    tags: Tags
    head: Head
    file: str


@dataclass(frozen=True, kw_only=True)
class Shot:
    """The pictures of one exposure, and its name."""

    name: str
    taken: tuple[Taken, ...]


def bring(source: Path, *, crs: str = "", pixel_um: float | None = None) -> Brought:
    """Return the flight that the metadata of a folder's pictures describe.

    Parameters
    ----------
    source : Path
        Folder with TIFF or JPEG files, in folders of it too.
    crs : str
        Projected CRS of the flight; by default the UTM zone of the mean position, in WGS 84.
    pixel_um : float, optional
        Size of a pixel, for pictures that do not say it.

    Returns
    -------
    Brought
        A block ``heads`` of several cameras, a block ``calibration`` of one.

    Raises
    ------
    FlightError
        With a line for every picture that cannot be read, or where a number in it is none.
    """
    taken, others = _alike(_read_all(source))
    shots, without = _placed(_shots(taken))
    heads = rig.in_order(list({one.head.name: one.head for s in shots for one in s.taken}.values()))
    first = {one.head.name: one.tags for shot in reversed(shots) for one in shot.taken}
    known = None if pixel_um is None else pixel_um / 1000
    lenses = {h.name: lens_of(first[h.name], h.name, known_pixel_mm=known) for h in heads}
    block = "heads" if len(heads) > 1 else "calibration"
    return Brought(
        source=f"pictures of {_maker(taken)}",
        sha256={one.file: one.tags.sha256 for one in taken},
        settings=_settings(source, shots, heads, lenses, crs),
        tables={
            "control_points.csv": {n: [] for n in ("point", "east_m", "north_m", "height_m")},
            **{f"{block}/{name}": table for name, table in _tables(shots).items()},
        },
        pictures={f"{block}/{one.file}": one.tags.path for shot in shots for one in shot.taken},
        assumed=tuple(_assumed(shots, heads)),
        found=tuple(_found(shots, heads, lenses, first)),
        left_out=(*others, *without),
    )


# --- which pictures --------------------------------------------------------------------------


def _read_all(source: Path) -> list[Taken]:
    """Return all pictures of a folder."""
    if not source.is_dir():
        raise refusal(str(source), 1, "folder", "is no folder", "must be one with pictures")
    paths = sorted(p for p in source.rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file())
    if not 0 < len(paths) <= MOST:
        found = f"holds {len(paths)} pictures ({', '.join(SUFFIXES)})"
        raise refusal(str(source), 1, "folder", found, f"must hold 1 to {MOST}")
    taken: list[Taken] = []
    problems: list[str] = []
    for path in paths:
        try:
            tags = read(path)
            file = f"images/{path.relative_to(source).as_posix()}"
            taken.append(Taken(tags=tags, head=rig.head_of(tags), file=file))
        except FlightError as error:
            problems += error.problems
    if problems:
        raise FlightError(problems)
    return taken


def _alike(taken: Sequence[Taken]) -> tuple[list[Taken], list[str]]:
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


def _kind(one: Taken) -> tuple[int, int, int, int]:
    return one.tags.width_px, one.tags.height_px, one.tags.samples, one.tags.bits


def _shots(taken: Sequence[Taken]) -> list[Shot]:
    """Return the exposures in the order of time; a head has one picture of each."""
    ordered = sorted(taken, key=lambda one: exposure.key(one.tags))
    groups = [tuple(g) for _, g in groupby(ordered, key=lambda one: exposure.key(one.tags))]
    for group in groups:
        names = [one.head.name for one in group]
        ((again, times),) = Counter(names).most_common(1)
        if times > 1:
            first, second, *_ = [one.tags for one in group if one.head.name == again]
            found = f"{again} as in {first.path} of the same exposure"
            raise second.wrong(f"{rig.INDEX}, {rig.BAND}", found, "must be another head's")
    groups.sort(key=lambda group: (_when(group[0].tags), str(group[0].tags.path)))
    names = [exposure.name_of(group[0].tags) for group in groups]
    often = Counter(names)
    folders = [group[0].tags.path.parent.name for group in groups]
    unique = [
        n if often[n] == 1 else f"{folder}/{n}" for n, folder in zip(names, folders, strict=True)
    ]
    if len(set(unique)) < len(unique):
        unique = [f"{k}/{name}" for k, name in enumerate(names, start=1)]
    return [Shot(name=n, taken=group) for n, group in zip(unique, groups, strict=True)]


def _when(tags: Tags) -> float:
    time = exposure.time_of(tags)
    return 0.0 if time is None else time.timestamp()


def _placed(shots: Sequence[Shot]) -> tuple[list[Shot], list[str]]:
    """Return the exposures that have a position, and what is said of the others."""
    known = [exposure.place_of(shot.taken[0].tags) is not None for shot in shots]
    placed = [shot for shot, there in zip(shots, known, strict=True) if there]
    if not placed:
        tags, expected = shots[0].taken[0].tags, "needed, and no other picture has a position"
        raise tags.wrong("GPSLatitude, GPSLongitude, GPSAltitude", "missing", expected)
    without = [shot.name for shot, there in zip(shots, known, strict=True) if not there]
    said = f"{number_of(len(without), 'exposures')} without a position: {_some(without)}"
    return placed, [said] if without else []


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:SAID]) + (", …" if len(names) > SAID else "")


def _maker(taken: Sequence[Taken]) -> str:
    makes = (f"{t.tags.text('Make')} {t.tags.text('Model')}".strip() for t in taken)
    return ", ".join(dict.fromkeys(make or "an unnamed camera" for make in makes))


# --- flight.toml -----------------------------------------------------------------------------


def _settings(
    source: Path,
    shots: Sequence[Shot],
    heads: Sequence[Head],
    lenses: Mapping[str, Lens],
    crs: str,
) -> dict[str, Any]:
    mounts = rig.mountings(heads)
    cameras = {name: _camera(lens.camera, mounts[name]) for name, lens in lenses.items()}
    places = np.array([_place(shot) for shot in shots])
    out: dict[str, Any] = {
        "name": source.resolve().name or "pictures",
        "crs": crs or _utm(*places[:, :2].mean(axis=0)),
        "heights": "ellipsoidal",
        "cameras": cameras,
    }
    time = exposure.time_of(shots[0].taken[0].tags)
    if time is not None:
        out["session"] = {"date": time.date()}
    if len(heads) > 1:
        first = lenses[heads[0].name].camera
        ideal = replace(first, name=SYNTHETIC, interior=Interior(f=first.interior.f))
        cameras[SYNTHETIC] = _camera(ideal, rig.DOWN)
        out["synthetic"] = {"camera": SYNTHETIC, "heads": [head.name for head in heads]}
    return out


def _camera(camera: Camera, R_b_c: Array) -> dict[str, Any]:
    """Return the table of a camera; nothing is known of its lever arm."""
    mounted = replace(camera, T_b_c=Pose(R=R_b_c, r=np.zeros(3)))
    table = camera_table(mounted)
    zero = ("k1", "k2", "k3", "p1", "p2", "b1")
    return {
        key: float(f"{value:.12g}") if isinstance(value, float) else value
        for key, value in table.items()
        if key not in LEVER and not (key in zero and value == 0)
    }


def _utm(lat: float, lon: float) -> str:
    zone = min(int((lon + 180) // 6) + 1, 60)
    return f"EPSG:{32600 + zone if lat >= 0 else 32700 + zone}"


# --- tables ----------------------------------------------------------------------------------


def _tables(shots: Sequence[Shot]) -> dict[str, dict[str, list[Any]]]:
    rows = [(shot, one) for shot in shots for one in shot.taken]
    images = {
        "image": [f"{shot.name} {one.head.name}" for shot, one in rows],
        "camera": [one.head.name for _, one in rows],
        "exposure": [shot.name for shot, _ in rows],
        "file": [one.file for _, one in rows],
    }
    points: dict[str, list[Any]] = {n: [] for n in ("image", "point", "col_px", "row_px")}
    return {"images.csv": images, "image_points.csv": points, "trajectory.csv": _trajectory(shots)}


def _trajectory(shots: Sequence[Shot]) -> dict[str, list[Any]]:
    places = [_place(shot) for shot in shots]
    held = [_attitude(shot, way) for shot, way in zip(shots, exposure.course(places), strict=True)]
    table: dict[str, list[Any]] = {
        "exposure": [shot.name for shot in shots],
        "lat_deg": [round(lat, 9) for lat, _, _ in places],
        "lon_deg": [round(lon, 9) for _, lon, _ in places],
        "height_m": [round(height, 4) for _, _, height in places],
        "roll_deg": [round(one.roll, 6) for one in held],
        "pitch_deg": [round(one.pitch, 6) for one in held],
        "heading_deg": [round(one.heading, 6) for one in held],
    }
    times = [exposure.time_of(shot.taken[0].tags) for shot in shots]
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


def _place(shot: Shot) -> tuple[float, float, float]:
    found = exposure.place_of(shot.taken[0].tags)
    return found or (np.nan, np.nan, np.nan)


def _sigma(shot: Shot) -> tuple[float, float, float]:
    """Return sigma of a position; of a navigation receiver where no picture says it."""
    known = (exposure.sigma_of(one.tags) for one in shot.taken)
    return next((sigma for sigma in known if sigma is not None), (3.0, 3.0, 6.0))


def _attitude(shot: Shot, heading: float) -> exposure.Attitude:
    found = exposure.attitude_of(shot.taken[0].tags)
    tilt, turn = _LEVEL
    return found or exposure.Attitude(
        roll=0.0,
        pitch=0.0,
        heading=heading,
        sigma_tilt=tilt,
        sigma_heading=turn,
        said="no angles: level, and ahead along the track",
    )


# --- what is said ----------------------------------------------------------------------------


def _assumed(shots: Sequence[Shot], heads: Sequence[Head]) -> list[str]:
    ways = dict.fromkeys(_attitude(shot, 0.0).said for shot in shots)
    said = [
        "positions are EXIF's, in WGS 84; heights are taken as they are, above an unnamed surface",
        "times are EXIF's: UTC of MicaSense, the clock's zone of others",
        "the camera looks down, and the top of its image is ahead",
        f"attitudes: {'; '.join(ways)}",
        "pixels: (0, 0) is the centre of the first one; principal points count from there",
    ]
    return [*said, *([rig.sentence(heads)] if len(heads) > 1 else [])]


def _found(
    shots: Sequence[Shot],
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
    return [*said, *radiometry.sentences([first[head.name] for head in heads])]
