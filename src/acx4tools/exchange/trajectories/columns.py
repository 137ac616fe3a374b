"""Words for the columns of a list of orientations, events or points, and their units."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.flight.problems import did_you_mean

UNITS = {"deg": 1.0, "gon": 0.9, "grad": 0.9, "rad": float(np.degrees(1.0)), "arcmin": 1 / 60}
"""Of angles, in degrees."""

ANGLES = ("omega", "phi", "kappa", "roll", "pitch", "heading", "lat", "lon")
SIGMA_M = ("sigma_east", "sigma_north", "sigma_height")
SIGMA_ANGLES = ("sigma_roll", "sigma_pitch", "sigma_heading")
NUMBERS = (*ANGLES, "east", "north", "height", *SIGMA_M, *SIGMA_ANGLES)
SKIP = "skip"

SYNONYMS = {
    "image": "image imagename image_name filename file label photoid photo id name nom n",
    "exposure": "exposure event #event",
    "camera": "camera cam c",
    "strip": "strip line run",
    "time": "time time(s) gpstime gps_time t",
    "week": "week gpsweek gps_week",
    "east": "east easting x e",
    "north": "north northing y",
    "height": "height altitude alt z h elevation",
    "lat": "lat latitude",
    "lon": "lon long longitude lng",
    "omega": "omega o",
    "phi": "phi p",
    "kappa": "kappa k",
    "roll": "roll r",
    "pitch": "pitch",
    "heading": "heading yaw azimuth",
    "sigma_east": "sigma_east sigma_x",
    "sigma_north": "sigma_north sigma_y",
    "sigma_height": "sigma_height sigma_z",
    "sigma_roll": "sigma_roll",
    "sigma_pitch": "sigma_pitch",
    "sigma_heading": "sigma_heading sigma_yaw",
    SKIP: "skip s - _ other",
}


def words_of(synonyms: Mapping[str, str]) -> dict[str, str]:
    """Return the names of columns by the words for them."""
    return {word: name for name, words in synonyms.items() for word in words.split()}


KNOWN = words_of(SYNONYMS)
"""Words for the columns of orientations and events."""

POINT = "point pointname point_name point_id pointid id name nom n pt gcp marker target label"
SKIPPED = {SKIP: SYNONYMS[SKIP]}
SHARED = ("east", "north", "height", "lat", "lon", *SIGMA_M)

MEASURED = words_of(
    {
        "point": POINT,
        "image": "image imagename image_name filename file photo photoid cliche",
        "col": "col column sample c u x",
        "row": "row line lin l v y",
        "sigma": "sigma",
        **SKIPPED,
    }
)
"""Words for the columns of points measured in images."""

SURVEYED = words_of(
    {"point": POINT, "role": "role", **{one: SYNONYMS[one] for one in SHARED}, **SKIPPED}
)
"""Words for the columns of surveyed points."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a list.

    Attributes
    ----------
    name : str
        What it holds, such as one of the keys of `SYNONYMS`.
    unit : str
        Of an angle, one of `UNITS`; empty where the word does not say.
    """

    name: str
    unit: str = ""


def column(word: str, known: Mapping[str, str] = KNOWN) -> Column | None:
    """Return the column that a word means, such as ``omega``, ``kappa_gon``, ``x``; or None."""
    plain = re.sub(r"\s+", "_", word.strip().lower())
    for unit in UNITS:
        stem = plain.removesuffix(f"_{unit}").removesuffix(f"[{unit}]").removesuffix(f"({unit})")
        name = known.get(stem.strip("_"))
        if stem != plain and (name in ANGLES or name in SIGMA_ANGLES):
            return Column(name=str(name), unit=unit)
    for unit in ("_m", "[m]", "(m)", "_s", "_px", "[px]", "(px)"):
        stem = plain.removesuffix(unit).strip("_")
        plain = stem if stem in known else plain
    name = known.get(plain)
    return Column(name=name) if name else None


def declared(text: str, known: Mapping[str, str] = KNOWN) -> tuple[Column, ...]:
    """Return the columns that a user declares: words with commas or spaces between.

    Raises
    ------
    ValueError
        For a word that is not known, or a column that stands twice.
    """
    words = [word for word in re.split(r"[\s,;]+", text) if word]
    found = []
    for word in words:
        one = column(word, known)
        if one is None:
            words_known = ", ".join(dict.fromkeys(known.values()))
            hint = did_you_mean(word.lower(), known)
            msg = f"column {word!r} is not known{hint}; known are {words_known}"
            raise ValueError(msg)
        found.append(one)
    times = Counter(found)
    twice = [one.name for one in times if one.name != SKIP and times[one] > 1]
    if twice or not found:
        msg = f"column {twice[0]!r} stands twice" if twice else "no column is declared"
        raise ValueError(msg)
    return tuple(found)


def position_of(columns: Sequence[Column], name: str) -> int | None:
    """Return where a column stands first, None where it is not there."""
    return next((k for k, one in enumerate(columns) if one.name == name), None)
