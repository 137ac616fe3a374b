"""Timestamp.MRK of DJI and Autel: positions of an antenna, brought to the camera.

A line is an exposure: its number, GPS time, the way from the antenna to the camera along north,
east and down in mm, latitude, longitude and ellipsoidal height of the antenna, three sigma (north,
east, height) in m, and a flag of the solution: 50 is fixed, 34 float, 16 single.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4lib.flight.problems import quoted
from acx4tools.exchange.flight_folder import number_of
from acx4tools.exchange.safe import opened
from acx4tools.exchange.safe.opened import Opened

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
    found: dict[int, Mark] = {}
    sums: dict[str, str] = {}
    for path in sorted(p for p in folder.iterdir() if p.suffix.lower() == SUFFIX):
        file = opened.read(path)
        sums[path.name] = file.sha256
        for number, text in enumerate(file.text().splitlines(), start=1):
            if text.strip():
                exposure, mark = _mark(file, number, text)
                if exposure in found:
                    expected = "must be there once in the files of a folder"
                    raise file.wrong("number", f"line {number}: {exposure} again", expected)
                found[exposure] = mark
    return found, sums


def _mark(file: Opened, number: int, text: str) -> tuple[int, Mark]:
    """Return an exposure's number, and where its camera was."""
    match = _LINE.fullmatch(text)
    try:
        values = [] if match is None else [float(one) for one in match.groups()]
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


def number_in(stem: str) -> int | None:
    """Return the number of an exposure in the name of its picture; None where it has none."""
    match = _OF_FILE.search(stem)
    return int(match[1]) if match else None


def warnings_of(marks: Sequence[Mark]) -> list[str]:
    """Return a warning where marks of exposures are no fixed solutions."""
    bad = Counter(mark.flag for mark in marks if mark.flag != FIXED)
    if not bad:
        return []
    kinds = ", ".join(
        f"{n} with flag {flag} ({FLAGS.get(flag, 'not fixed')})" for flag, n in sorted(bad.items())
    )
    of = number_of(len(marks), "exposures")
    return [f"positions of {of} are by Timestamp.MRK, of which not all are fixed: {kinds}"]


def sentence(marks: Sequence[Mark], others: Mapping[str, tuple[float, float]]) -> str:
    """Return what was done with the marks of exposures.

    Parameters
    ----------
    marks : sequence of Mark
    others : mapping of str to tuple of float
        Median distance of the marks from positions of the pictures, in the plane and in height,
        m; by whose these are.
    """
    offset = float(np.median([mark.offset_m for mark in marks]))
    said = (
        f"positions of {number_of(len(marks), 'exposures')} are those of the antenna in "
        f"Timestamp.MRK, joined by number and moved by {offset:.3f} m (median) to the camera; "
        "heights are above the ellipsoid"
    )
    for whose, (plane, height) in others.items():
        said += f"; {whose} lie {plane:.3f} m beside them and {height:+.3f} m above (medians)"
    return said
