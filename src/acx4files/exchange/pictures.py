"""A flight of pictures alone: cameras, mountings, exposures and their poses by the metadata."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyproj

from acx4files.exchange import metadata, safe
from acx4files.exchange.flight_folder import ImportedFlight, number_of
from acx4files.exchange.lens import WARNED_PX, WORST_PX, too_far
from acx4files.exchange.metadata import DOWN, Attitude, Head, Lens, Tags, lens_of, read, rotation
from acx4files.exchange.options import Allow, Crs, Option
from acx4files.exchange.safe import Opened, refusal
from acx4files.flight.problems import quoted
from acx4files.flight.settings import LEVER, camera_table
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose

SUFFIXES = (".tif", ".tiff", ".jpg", ".jpeg")
SYNTHETIC = "SYN"
SAID = 5
"""Files that are named where more are counted."""

NAVIGATION = (3.0, 3.0, 6.0)
"""Sigma of a navigation receiver, m, where no picture states it: east, north, height."""

NAVIGATION_M = 0.5
"""Positions of a larger sigma determine neither lenses nor lever arms."""

ANOTHER_COURSE_DEG = 45.0
"""Headings that are farther apart than this are different."""

WGS_84 = pyproj.Geod(ellps="WGS84")

_HELD: dict[str, Any] = {"stages": {"mounting": {"estimate": [], "fix": ["lever_arm"]}}}
"""What the mounting stage of heads estimates where a navigation receiver gives positions."""


@dataclass(frozen=True, kw_only=True)
class _Shot:
    """The pictures of one exposure, its name, and what the first of them says for all.

    `place` is latitude, longitude, degrees, and height, m: by the mark, else by the metadata.
    """

    name: str
    taken: tuple[Tags, ...]
    mark: Mark | None
    place: tuple[float, float, float]

    @property
    def tags(self) -> Tags:
        """The metadata of its first picture."""
        return self.taken[0]

    @property
    def sigma(self) -> tuple[float, float, float]:
        """Sigma of the position, m; a navigation receiver's where no picture states it."""
        if self.mark is not None and min(self.mark.sigma_m) > 0:
            return self.mark.sigma_m
        known = (metadata.sigma_of(picture) for picture in self.taken)
        return next((sigma for sigma in known if sigma is not None), NAVIGATION)

    @property
    def attitude(self) -> Attitude | None:
        """The attitude by the metadata; None where they have no angles."""
        return metadata.attitude_of(self.tags)


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
    marks, sums = _marks({picture.path.parent for picture in taken})
    shots, without = _shots(taken, marks)
    heads = metadata.in_order(
        list({picture.head.name: picture.head for s in shots for picture in s.taken}.values())
    )
    first = {picture.head.name: picture for shot in reversed(shots) for picture in shot.taken}
    known = None if pixel_um is None else pixel_um / 1000
    lenses = {h.name: lens_of(first[h.name], h.name, known_pixel_mm=known) for h in heads}
    for name, lens in lenses.items():
        if (fault := too_far(lens.fitted, allow)) is not None:
            raise first[name].wrong("lens", f"{name}: {fault[0]}", fault[1])
    blocks = _blocks(source, shots, len(heads) > 1, hold_out)
    settings = _settings(source, shots, heads, lenses, crs)
    assumed = _assumed(shots, heads, crs)
    if hold_out is not None:
        assumed.append(
            f"{number_of(len(blocks['validation']), 'exposures')}, one in {hold_out} in the order "
            "of time, make block validation: they are held out"
        )
    sigma = float(np.median([shot.sigma for shot in shots]))
    if {"heads", "calibration"} <= blocks.keys():
        settings["synthetic"]["measured_in"] = "heads"
        if sigma > NAVIGATION_M:
            settings |= _HELD
            assumed.append(
                f"positions of {sigma:.1f} m (median sigma) determine neither the lens of the "
                "synthetic image nor its lever arm: stage mounting holds them, and estimates the "
                "boresight"
            )
    tables: dict[str, dict[str, list[Any]]] = {
        "control_points.csv": {n: [] for n in ("point", "east_m", "north_m", "height_m")}
    }
    for block, some in blocks.items():
        tables |= {f"{block}/{name}": table for name, table in _tables(some).items()}
    return ImportedFlight(
        source=f"pictures of {', '.join(dict.fromkeys(map(_maker, taken)))}",
        sha256={**{f"images/{picture.file}": picture.sha256 for picture in taken}, **sums},
        settings=settings,
        tables=tables,
        pictures={
            f"{block}/images/{picture.file}": picture.path
            for block, some in blocks.items()
            for shot in some
            for picture in shot.taken
        },
        warnings=tuple(_warnings(shots, taken, lenses)),
        assumed=tuple(assumed),
        found=tuple(_found(shots, lenses)),
        left_out=(*others, *without),
    )


def _blocks(
    source: Path, shots: Sequence[_Shot], is_rig: bool, hold_out: int | None
) -> dict[str, Sequence[_Shot]]:
    """Return the exposures of every block."""
    kept, held = shots, shots[:0]
    if hold_out is not None:
        held = shots[hold_out - 1 :: hold_out]
        kept = [shot for k, shot in enumerate(shots, start=1) if k % hold_out]
        if not held or not kept:
            count = f"{hold_out} of {number_of(len(shots), 'exposures')}"
            expected = "must leave exposures on either side"
            raise refusal(str(source), 1, "--hold-out", count, expected)
    blocks = {"heads": kept if is_rig else [], "calibration": kept, "validation": held}
    if is_rig and len(shots) == 1:
        del blocks["calibration"]
    return {name: some for name, some in blocks.items() if some}


# --- which pictures, and which of them are of one exposure -----------------------------------


def _read_all(source: Path) -> list[Tags]:
    """Return all pictures of a folder."""
    if not source.is_dir():
        raise refusal(str(source), 1, "folder", "is no folder", "must be one with pictures")
    paths = sorted(p for p in source.rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file())
    if not paths:
        fault = f"holds no pictures ({', '.join(SUFFIXES)})"
        raise refusal(str(source), 1, "folder", fault, "must hold one at least")
    taken: list[Tags] = []
    problems: list[str] = []
    for path in paths:
        try:
            taken.append(replace(read(path), file=path.relative_to(source).as_posix()))
            _ = taken[-1].head
        except FlightError as error:
            problems += error.problems
    if problems:
        raise FlightError(problems)
    return taken


def _alike(taken: Sequence[Tags]) -> tuple[list[Tags], list[str]]:
    """Return the pictures of the most frequent size and kind, and a message on the others."""
    kinds = Counter(picture.kind for picture in taken)
    usual = max(kinds, key=lambda kind: (kinds[kind], kind))
    others = [picture.path.name for picture in taken if picture.kind != usual]
    kind = "{} x {} px, {} x {} bit".format(*usual)
    message = f"{number_of(len(others), 'pictures')} of another kind than {kind}: {_some(others)}"
    alike = [picture for picture in taken if picture.kind == usual]
    return alike, [message] if others else []


def _shots(
    taken: Sequence[Tags], marks: Mapping[Path, Mapping[int, Mark]]
) -> tuple[list[_Shot], list[str]]:
    """Return the exposures with a position in the order of time, and a message on the others.

    A head has one picture of each. Names that occur twice get their folder's.
    """
    groups: dict[str, list[Tags]] = {}
    for picture in taken:
        groups.setdefault(metadata.key(picture), []).append(picture)
    for group in groups.values():
        _require_heads(group)
    in_time = sorted(groups.values(), key=lambda g: (_when(g[0]), str(g[0].path)))
    often = Counter(metadata.name_of(group[0]) for group in in_time)
    shots, without = [], []
    for group in in_time:
        tags, name = group[0], metadata.name_of(group[0])
        number = _OF_FILE.search(name)
        mark = marks[tags.path.parent].get(int(number[1])) if number else None
        place = metadata.place_of(tags) if mark is None else mark.place
        if often[name] > 1:
            name = str(Path(tags.file).with_name(name))
        if place is None:
            without.append(name)
        else:
            shots.append(_Shot(name=name, taken=tuple(group), mark=mark, place=place))
    if not shots:
        expected = "needed, and no other picture has a position"
        missing = "GPSLatitude, GPSLongitude, GPSAltitude"
        raise in_time[0][0].wrong(missing, "missing", expected)
    message = f"{number_of(len(without), 'exposures')} without a position: {_some(without)}"
    return shots, [message] if without else []


def _require_heads(group: Sequence[Tags]) -> None:
    """Refuse two pictures of one head at one exposure."""
    by_head: dict[str, Tags] = {}
    for picture in group:
        other = by_head.setdefault(picture.head.name, picture)
        if other is not picture:
            fault = f"{picture.head.name} as in {other.path} of the same exposure"
            element = f"{metadata.INDEX}, {metadata.BAND}"
            raise picture.wrong(element, fault, "must be another head's")


def _when(tags: Tags) -> float:
    time = metadata.time_of(tags)
    return 0.0 if time is None else time.timestamp()


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:SAID]) + (", …" if len(names) > SAID else "")


def _maker(picture: Tags) -> str:
    make, model = (picture.text(name) for name in ("Make", "Model"))
    return f"{make} {model}".strip() or "an unnamed camera"


# --- flight.toml and tables ------------------------------------------------------------------


def _settings(
    source: Path,
    shots: Sequence[_Shot],
    heads: Sequence[Head],
    lenses: Mapping[str, Lens],
    crs: str,
) -> dict[str, Any]:
    cameras = {
        head.name: _camera(
            lenses[head.name].camera,
            DOWN @ rotation(head.relatives_deg) if head.relatives_deg else DOWN,
        )
        for head in heads
    }
    lat, lon, _ = np.array([shot.place for shot in shots]).mean(axis=0)
    zone = min(int((lon + 180) // 6) + 1, 60)
    out: dict[str, Any] = {
        "name": source.resolve().name or "pictures",
        "crs": crs or f"EPSG:{32600 + zone if lat >= 0 else 32700 + zone}",
        "heights": "ellipsoidal",
        "cameras": cameras,
    }
    time = metadata.time_of(shots[0].tags)
    if time is not None:
        out["session"] = {"date": time.date()}
    if len(heads) > 1:
        first = lenses[heads[0].name].camera
        ideal = replace(first, name=SYNTHETIC, interior=Interior(f=first.interior.f))
        cameras[SYNTHETIC] = _camera(ideal, DOWN)
        out["synthetic"] = {"camera": SYNTHETIC, "heads": [head.name for head in heads]}
    return out


def _camera(camera: Camera, R_b_c: Any) -> dict[str, Any]:
    """Return the table of a camera; nothing is known of its lever arm."""
    table = camera_table(replace(camera, T_b_c=Pose(R=np.asarray(R_b_c), r=np.zeros(3))))
    zero = ("k1", "k2", "k3", "p1", "p2", "b1", "b2")
    return {
        key: float(f"{value:.12g}") if isinstance(value, float) else value
        for key, value in table.items()
        if key not in LEVER and not (key in zero and value == 0)
    }


def _tables(shots: Sequence[_Shot]) -> dict[str, dict[str, list[Any]]]:
    rows = [(shot, picture) for shot in shots for picture in shot.taken]
    images = {
        "image": [f"{shot.name} {picture.head.name}" for shot, picture in rows],
        "camera": [picture.head.name for _, picture in rows],
        "exposure": [shot.name for shot, _ in rows],
        "file": [f"images/{picture.file}" for _, picture in rows],
    }
    points: dict[str, list[Any]] = {n: [] for n in ("image", "point", "col_px", "row_px")}
    return {"images.csv": images, "image_points.csv": points, "trajectory.csv": _trajectory(shots)}


def _trajectory(shots: Sequence[_Shot]) -> dict[str, list[Any]]:
    held = [
        shot.attitude or replace(LEVEL, heading=course)
        for shot, course in zip(shots, _courses(shots), strict=True)
    ]
    places, sigma = np.array([shot.place for shot in shots]), [shot.sigma for shot in shots]
    table: dict[str, list[Any]] = {"exposure": [shot.name for shot in shots]}
    for k, (name, digits) in enumerate((("lat_deg", 9), ("lon_deg", 9), ("height_m", 4))):
        table[name] = [round(value, digits) for value in places[:, k].tolist()]
    for name in ("roll", "pitch", "heading"):
        table[f"{name}_deg"] = [round(getattr(attitude, name), 6) for attitude in held]
    times = [metadata.time_of(shot.tags) for shot in shots]
    if all(time is not None for time in times):
        day = min(time for time in times if time).replace(hour=0, minute=0, second=0, microsecond=0)
        table["time_s"] = [round((time - day).total_seconds(), 6) for time in times if time]
    for k, axis in enumerate(("east", "north", "height")):
        table[f"sigma_{axis}_m"] = [values[k] for values in sigma]
    for axis in ("roll", "pitch"):
        table[f"sigma_{axis}_deg"] = [attitude.sigma_tilt for attitude in held]
    return table | {"sigma_heading_deg": [attitude.sigma_heading for attitude in held]}


LEVEL = Attitude(
    roll=0.0,
    pitch=0.0,
    heading=0.0,
    sigma_tilt=10.0,
    sigma_heading=30.0,
    said="no angles: level, and ahead along the track",
)
"""The attitude of an exposure without angles but for its heading, that of the track."""


def _courses(shots: Sequence[_Shot]) -> list[float]:
    """Return the course at every exposure, degrees from north, by its neighbours; 0 for one."""
    if len(shots) < 2:
        return [0.0]
    lat, lon, _ = np.array([shot.place for shot in shots]).T
    north, east = np.gradient(lat), np.gradient(lon) * np.cos(np.radians(lat))
    return [float(a) for a in np.degrees(np.arctan2(east, north)) % 360.0]


# --- sentences -------------------------------------------------------------------------------


def _warnings(
    shots: Sequence[_Shot], taken: Sequence[Tags], lenses: Mapping[str, Lens]
) -> Iterator[str]:
    """Yield what may be wrong in marks, sizes, headings and lenses."""
    flags = Counter(shot.mark.flag for shot in shots if shot.mark is not None)
    if flags.keys() - {FIXED}:
        kinds = ", ".join(f"{n} with flag {flag}" for flag, n in sorted(flags.items()))
        yield f"positions by Timestamp.MRK: {kinds}; 50 is fixed, 34 float, 16 single"
    sizes = Counter(
        (tags.width_px, tags.height_px, width, height)
        for tags in taken
        if (width := tags.number("ExifImageWidth"))
        and (height := tags.number("ExifImageHeight"))
        and {width, height} != {tags.width_px, tags.height_px}
    )
    for (width, height, before_w, before_h), n in sizes.items():
        yield (
            f"{number_of(n, 'pictures')} of {width} x {height} px, and {before_w:g} x "
            f"{before_h:g} px by their EXIF: cropped or reduced since, so that the lens of the "
            "metadata is not theirs"
        )
    apart = [
        abs((shot.attitude.heading - aircraft + 180.0) % 360.0 - 180.0)
        for shot in shots
        if shot.attitude is not None
        and (aircraft := shot.tags.number(metadata.FLIGHT_YAW)) is not None
    ]
    if other := [angle for angle in apart if angle > ANOTHER_COURSE_DEG]:
        yield (
            f"at {len(other)} of {number_of(len(apart), 'exposures')} the yaw of the gimbal and "
            f"that of the aircraft differ by {np.median(other):.0f}° (median): the gimbal's is "
            "taken; look where the tops of pictures point"
        )
    for name, lens in lenses.items():
        if lens.fitted.largest_px > WARNED_PX:
            yield f"the lens of {name} differs from that of its metadata by {lens.fitted}"


def _assumed(shots: Sequence[_Shot], heads: Sequence[Head], crs: str) -> list[str]:
    ways = dict.fromkeys((shot.attitude or LEVEL).said for shot in shots)
    datum = f"latitudes and longitudes of WGS 84 are taken for those of the datum of {crs}"
    return [
        *_whose_positions(shots),
        *([datum] if crs else []),
        "times are EXIF's: UTC of MicaSense, the clock's zone of others",
        "the camera looks down, and the top of its image is ahead",
        f"attitudes: {'; '.join(ways)}",
        "pixels: (0, 0) is the centre of the first one; principal points count from there",
        *([metadata.sentence(heads)] if len(heads) > 1 else []),
    ]


def _whose_positions(shots: Sequence[_Shot]) -> Iterator[str]:
    """Yield sentences on the origin of positions and heights."""
    marks = {shot.name: shot.mark for shot in shots if shot.mark is not None}
    bare = [shot.name for shot in shots if shot.mark is None]
    if bare:
        yield (
            "positions are EXIF's, in WGS 84; heights are taken as they are, above an unnamed "
            "surface"
        )
    if not marks:
        return
    offset = float(np.median([mark.offset_m for mark in marks.values()]))
    text = (
        f"positions of {number_of(len(marks), 'exposures')} are those of the antenna in "
        f"Timestamp.MRK, joined by number and moved by {offset:.3f} m (median) to the camera; "
        "heights are above the ellipsoid"
    )
    beside = [
        (WGS_84.inv(lon, lat, shot.place[1], shot.place[0])[2], height - shot.place[2])
        for shot in shots
        if shot.mark is not None and (place := metadata.place_of(shot.tags)) is not None
        for lat, lon, height in [place]
    ]
    if beside:
        plane, height = np.median(np.array(beside), axis=0)
        text += f"; those of EXIF lie {plane:.3f} m beside them and {height:+.3f} m above (medians)"
    yield text
    if bare:
        yield (
            f"{number_of(len(bare), 'exposures')} without a mark have EXIF's heights: {_some(bare)}"
        )


ZONES_S, CLOCK_S = 900, 2.0
"""Step of time zones, a quarter of an hour; largest offset of a clock without a message."""


def _clock(shots: Sequence[_Shot]) -> Iterator[str]:
    """Yield by how much the clock of EXIF is off the time of the receiver, zones of it aside."""
    off = []
    for shot in shots:
        time, stamp = metadata.time_of(shot.tags), shot.tags.exif.get("GPSTimeStamp")
        if time is not None and stamp is not None and len(stamp) == 3:
            day = time.hour * 3600 + time.minute * 60 + time.second + time.microsecond / 1e6
            utc = float(np.dot([3600.0, 60.0, 1.0], [float(part) for part in stamp]))
            off.append((day - utc + ZONES_S / 2) % ZONES_S - ZONES_S / 2)
    if off and np.isfinite(off).all() and abs(float(np.median(off))) > CLOCK_S:
        yield (
            f"the clock of EXIF is {np.median(off):+.0f} s off the receiver's time, whole zones "
            "aside; times are the clock's"
        )


def _found(shots: Sequence[_Shot], lenses: Mapping[str, Lens]) -> Iterator[str]:
    n = sum(len(shot.taken) for shot in shots)
    whole = sum(len(shot.taken) == len(lenses) for shot in shots)
    f = [lens.camera.interior.f for lens in lenses.values()]
    yield (
        f"{number_of(n, 'pictures')} of {number_of(len(lenses), 'heads')} at "
        f"{number_of(len(shots), 'exposures')}, {whole} of these complete"
    )
    yield (
        f"focal lengths {min(f):.3f} to {max(f):.3f} mm; "
        f"{'; '.join(dict.fromkeys(lens.said for lens in lenses.values()))}"
    )
    yield from _clock(shots)
    above = ((shot, shot.tags.number(metadata.ABOVE_TAKE_OFF)) for shot in shots)
    if ground := [shot.place[2] - height for shot, height in above if height is not None]:
        middle, spread = float(np.median(ground)), float(np.ptp(ground))
        yield (
            f"ground at take-off at {middle:.1f} m in the heights of the positions "
            f"(RelativeAltitude of {number_of(len(ground), 'exposures')}, within {spread:.1f} m): "
            f"where the ground is level, acx4 measure takes it by --ground {middle:.0f}"
        )


# --- Timestamp.MRK of DJI and Autel: positions of an antenna, brought to the camera
#
# A line is an exposure: its number, GPS time, the way from the antenna to the camera along north,
# east and down in mm, latitude, longitude and ellipsoidal height of the antenna, three sigma
# (north, east, height) in m, and a flag of the solution: 50 is fixed, 34 float, 16 single.


FIXED = 50

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
    place : tuple of float
        Latitude and longitude of the camera, degrees, WGS 84; height above the ellipsoid, m.
    sigma_m : tuple of float
        East, north, height.
    flag : int
    offset_m : float
        Length of the way from the antenna.
    """

    place: tuple[float, float, float]
    sigma_m: tuple[float, float, float]
    flag: int
    offset_m: float


def _marks(folders: set[Path]) -> tuple[dict[Path, dict[int, Mark]], dict[str, str]]:
    """Return the marks beside pictures by folder and number, and the checksums of the files.

    A FlightError names a line that is none, and a number that comes twice.
    """
    marks: dict[Path, dict[int, Mark]] = {folder: {} for folder in folders}
    sums: dict[str, str] = {}
    for folder in sorted(folders):
        for path in sorted(p for p in folder.iterdir() if p.suffix.lower() == ".mrk"):
            file = safe.read(path)
            sums[path.name] = file.sha256
            for number, text in enumerate(file.text().splitlines(), start=1):
                if not text.strip():
                    continue
                exposure, mark = _mark(file, number, text)
                if exposure in marks[folder]:
                    expected = "must be there once in the files of a folder"
                    raise file.wrong("number", f"{exposure} again", expected, line=number)
                marks[folder][exposure] = mark
    return marks, sums


def _mark(file: Opened, number: int, text: str) -> tuple[int, Mark]:
    """Return an exposure's number, and where its camera was."""
    match = _LINE.fullmatch(text)
    try:
        values = [float(cell) for cell in match.groups()] if match else [np.nan] * 12
    except ValueError:
        values = [np.nan] * 12
    exposure, _, north, east, down, lat, lon, height, *sigma, flag = values
    if not np.all(np.isfinite(values)) or abs(lat) >= 90:
        expected = "must be number, time, N, E, V, Lat, Lon, Ellh, three sigma and Q"
        raise file.wrong("mark", quoted(text.strip()), expected, line=number)
    azimuth, metres = np.degrees(np.arctan2(east, north)), np.hypot(north, east) / 1000
    lon, lat, _ = WGS_84.fwd(lon, lat, azimuth, metres)
    return int(exposure), Mark(
        place=(lat, lon, height - down / 1000),
        sigma_m=(sigma[1], sigma[0], sigma[2]),
        flag=int(flag),
        offset_m=float(np.linalg.norm([north, east, down])) / 1000,
    )
