"""Problems of the values in flight.toml."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from pyproj.exceptions import ProjError

from acx4lib.errors import UNSEEN
from acx4lib.flight.problems import POSITIVE, RANGES, SHOWN, Problem, Range, did_you_mean, quoted
from acx4lib.flight.setup import (
    ESTIMABLE,
    LENS,
    LEVER,
    MOUNT,
    SIGMAS,
    SIZE,
    Apriori,
    Certificate,
    Device,
    Synthetic,
    camera_of,
    grid_of,
)
from acx4lib.flight.table_files import named_file
from acx4lib.flight.tables import name_fault
from acx4lib.flight.toml_file import Toml
from acx4lib.geometry.camera import distortion
from acx4lib.geometry.crs import is_code_or_wkt
from acx4lib.geometry.geodesy import LARGEST_UNDULATION_M, LOCAL, grid_system
from acx4lib.geometry.parameters import ATTITUDE, GNSS

INWARD, OUTWARD = 0.25, 0.5
"""Largest corrections of a corner, in half diagonals: a third inwards would fold a lens of k1
alone, and outwards a fisheye needs a quarter and more."""

FORMAT = 6
"""The latest format of flight.toml that is understood, as are all before it."""

TOP = (
    "name",
    "crs",
    "heights",
    "refraction",
    "simulated",
    "cameras",
    "synthetic",
    "apriori",
    "adjustment",
    "session",
    "stages",
    "certificate",
    "format",
)
ADJUSTMENT = {"smallest_angle_deg": Range(0.0, 90.0)}
UNDULATION = {
    "heights": Range(
        -LARGEST_UNDULATION_M,
        LARGEST_UNDULATION_M,
        f"must be an undulation in metres, at most {LARGEST_UNDULATION_M:g} either way",
    )
}
SHARES = dict.fromkeys(("gnss_correlated_share", "attitude_correlated_share"), Range(0.0, 1.0))
TEMPERATURE = {"temperature_c": Range(-100.0, 100.0)}
FIXABLE = ("lever_arm", "boresight")
WEIGHTS = ("given", "estimated")
MEASURED_IN = ("synthetic", "heads")
NAME = "NAME"
"""In `KEYS` the name of a camera."""

KEYS: Mapping[tuple[str, ...], tuple[str, ...]] = {
    (): TOP,
    ("cameras", NAME): (*SIZE, *LENS, *MOUNT, *LEVER, *SIGMAS),
    ("synthetic",): tuple(Synthetic.__dataclass_fields__),
    ("apriori",): tuple(Apriori.__dataclass_fields__),
    ("adjustment",): tuple(ADJUSTMENT),
    ("session",): ("date", *TEMPERATURE),
    ("stages",): ("heads", "mounting"),
    ("stages", "heads"): ("estimate",),
    ("stages", "mounting"): ("estimate", "fix", "gnss", "attitude", "weights"),
    ("certificate",): tuple(Certificate.__dataclass_fields__),
    ("certificate", "cameras", NAME): tuple(Device.__dataclass_fields__),
}
"""Every key of flight.toml by its table; a key that is not here is refused."""

CHOICES: Mapping[tuple[str, ...], tuple[str, ...]] = {
    ("refraction",): ("none", "standard"),
    ("synthetic", "measured_in"): MEASURED_IN,
    ("stages", "heads", "estimate"): tuple(ESTIMABLE),
    ("stages", "mounting", "estimate"): tuple(ESTIMABLE),
    ("stages", "mounting", "fix"): FIXABLE,
    ("stages", "mounting", "gnss"): GNSS,
    ("stages", "mounting", "attitude"): ATTITUDE,
    ("stages", "mounting", "weights"): WEIGHTS,
}
"""The values of keys that have only some, or of their lists."""

MOST_CAMERAS = 1000
MOST_REASON = 200
"""Largest number of characters of a message of PROJ that is repeated."""


def toml_problems(toml: Toml) -> Iterator[Problem]:
    """Yield what is wrong with flight.toml; if it could not be read, only that."""
    if toml.problems:
        yield from toml.problems
        return
    heights = () if toml.values.get("crs") == LOCAL else ("heights",)
    yield from key_problems(toml, (), KEYS[()], required=("name", "crs", *heights, "cameras"))
    constant = isinstance(toml.values.get("heights"), int | float)
    for key in ("name", "crs", *(() if constant else ("heights",))):
        if key in toml.values:
            yield from _text_problems(toml, key)
    if constant:
        yield from number_problems(toml, (), UNDULATION)
    if toml.values.get("refraction", "none") not in CHOICES["refraction",]:
        found = quoted(toml.values["refraction"])
        yield toml.problem(("refraction",), found, "must be 'none' or 'standard'")
    if not isinstance(toml.values.get("simulated", False), bool):
        found = quoted(toml.values["simulated"])
        yield toml.problem(("simulated",), found, "must be true or false")
    if toml.values.get("format", FORMAT) not in range(1, FORMAT + 1):
        expected = f"must be a whole number up to {FORMAT}; a larger one is of a later acx4"
        yield toml.problem(("format",), quoted(toml.values["format"]), expected)
    yield from _grid_problems(toml)
    yield from _camera_problems(toml)
    yield from _synthetic_problems(toml)
    apriori = KEYS["apriori",]
    yield from key_problems(toml, ("apriori",), apriori)
    yield from number_problems(toml, ("apriori",), dict.fromkeys(apriori, POSITIVE) | SHARES)
    yield from _halves(toml)
    yield from key_problems(toml, ("adjustment",), KEYS["adjustment",])
    yield from number_problems(toml, ("adjustment",), ADJUSTMENT)
    yield from _session_problems(toml)
    yield from _stage_problems(toml)
    yield from _certificate_problems(
        toml, KEYS["certificate",], KEYS["certificate", "cameras", NAME]
    )


def _session_problems(toml: Toml) -> Iterator[Problem]:
    yield from key_problems(toml, ("session",), KEYS["session",])
    yield from number_problems(toml, ("session",), TEMPERATURE)
    date = toml.get("session", "date")
    if date is not None and not isinstance(date, dt.date):
        yield toml.problem(
            ("session", "date"), quoted(date), "must be a date without quotes, as 2026-05-02"
        )


def _is_name(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _text_problems(toml: Toml, key: str) -> Iterator[Problem]:
    value = toml.values[key]
    if not _is_name(value):
        yield toml.problem((key,), quoted(value), "must be text")
    elif key == "crs":  # WKT may have several lines
        unseen = UNSEEN.search(re.sub(r"[\n\r\t]", " ", value))
        if unseen:
            found = f"holds the character U+{ord(unseen[0]):04X}"
            yield toml.problem((key,), found, "must be text without control characters")
    else:
        fault = name_fault(value)
        if fault:
            yield toml.problem((key,), *fault)


def _halves(toml: Toml) -> Iterator[Problem]:
    """Yield a share of correlated errors without its time constant, and the reverse."""
    table = toml.table("apriori")
    for of in ("gnss", "attitude"):
        both = (f"{of}_correlation_s", f"{of}_correlated_share")
        for key, other in (both, both[::-1]):
            if key in table and other not in table:
                yield toml.problem(("apriori", key), "stands alone", f"needs {other} as well")


def _grid_problems(toml: Toml) -> Iterator[Problem]:
    crs, heights = toml.values.get("crs"), toml.values.get("heights")
    if not _is_name(crs):
        return
    try:
        _ = grid_system(str(crs))
    except ValueError as error:
        expected = f"must be a projected CRS in metres, or {LOCAL!r}"
        yield toml.problem(("crs",), str(error), expected)
        return
    if crs == LOCAL:
        yield from _local_problems(toml)
        return
    if not _is_name(heights) or heights == "ellipsoidal":
        return
    expected = "must be 'ellipsoidal', a geoid grid in the flight, a vertical CRS, or a number"
    inside = toml.folder.resolve()
    path, wrong = named_file(inside, inside, str(heights))
    hint = did_you_mean(str(heights), ["ellipsoidal"])
    if path is None and not hint and not is_code_or_wkt(str(heights)):
        yield toml.problem(("heights",), f"{quoted(heights)} {wrong}", expected)
        return
    try:
        _ = grid_of(toml)
    except ValueError as error:
        reason = " ".join(str(error.__cause__ or error).split())
        if path is not None and type(error.__cause__) is ProjError:
            reason = "PROJ cannot read it as a geoid grid"
        found = f"{quoted(heights)} cannot be used{hint or f' ({reason[:MOST_REASON]})'}"
        yield toml.problem(("heights",), found, expected)


def _local_problems(toml: Toml) -> Iterator[Problem]:
    """Yield what a frame on no map cannot have: a geoid, and the air of a vertical."""
    for key, only in (("heights", "ellipsoidal"), ("refraction", "none")):
        value = toml.values.get(key, only)
        if value != only:
            expected = f"must be {only!r} or left out, since crs is {LOCAL!r}"
            yield toml.problem((key,), quoted(value), expected)


def _camera_problems(toml: Toml) -> Iterator[Problem]:
    if "cameras" in toml.values and not toml.table("cameras"):
        yield toml.problem(("cameras",), "no cameras", "must hold one table per camera")
    if len(toml.table("cameras")) > MOST_CAMERAS:
        found = f"{len(toml.table('cameras'))} cameras"
        yield toml.problem(("cameras",), found, f"must be at most {MOST_CAMERAS}")
        return
    for name in toml.table("cameras"):
        keys = ("cameras", name)
        known = (*SIZE, *LENS, *MOUNT, *LEVER)
        wrong = list(key_problems(toml, keys, KEYS["cameras", NAME], SIZE))
        wrong += number_problems(toml, keys, {key: RANGES[key] for key in known})
        for key, of in zip(SIGMAS, (LEVER, MOUNT), strict=True):
            wrong += _sigma_problems(toml, (*keys, key), of)
        if not isinstance(toml.get(*keys), dict):
            wrong = [toml.problem(keys, quoted(toml.get(*keys)), "must be a table")]
        if not _is_name(name):
            wrong.append(toml.problem(keys, "is empty", "must be a name"))
        fault = name_fault(name)
        if fault:
            wrong.append(toml.problem(keys, *fault))
        yield from wrong or _lens_problems(toml, keys)


def _sigma_problems(toml: Toml, keys: tuple[str, ...], of: tuple[str, ...]) -> Iterator[Problem]:
    """Yield what is wrong with the sigma of a mounting: one number, or one for each axis."""
    value = toml.get(*keys)
    if value is None:
        return
    each = value if isinstance(value, list) else [value]
    numbers = all(isinstance(one, int | float) and not isinstance(one, bool) for one in each)
    if not numbers or (isinstance(value, list) and len(value) != 3):
        yield toml.problem(keys, quoted(value), "must be a number or a list of three")
    elif not all(one in POSITIVE for one in each):
        yield toml.problem(keys, quoted(value), str(POSITIVE))
    elif isinstance(toml.get(*keys[:-1]), dict) and not any(
        key in toml.table(*keys[:-1]) for key in of
    ):
        yield toml.problem(keys, "sigma of nothing", f"needs the values it is of: {', '.join(of)}")


def _lens_problems(toml: Toml, keys: tuple[str, ...]) -> Iterator[Problem]:
    """Yield a problem where the distortion at a corner is absurd: other units or another model."""
    camera = camera_of(keys[-1], toml.table(*keys))
    half = 0.5 * camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    corners = half * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    radius, off = float(np.hypot(*half)), distortion(camera.interior, corners)
    worst, inward = float(np.abs(off).max()), float(np.max(np.sum(off * corners, axis=1))) / radius
    if worst > OUTWARD * radius or inward > INWARD * radius:
        found = f"distortion by k1 to p2 reaches {worst:.3g} mm at a corner"
        yield toml.problem(keys, found, "must be small; k1 in mm^-2, k2 in mm^-4, k3 in mm^-6")
    for axis, key in enumerate(("xp_mm", "yp_mm")):
        value = toml.table(*keys).get(key, 0.0)
        if abs(value) > half[axis]:
            expected = "must lie on the sensor, in mm from its middle"
            yield toml.problem((*keys, key), f"{value!r} (pixels?)", expected)


def _synthetic_problems(toml: Toml) -> Iterator[Problem]:
    if "synthetic" not in toml.values:
        return
    yield from key_problems(toml, ("synthetic",), KEYS["synthetic",], ("camera", "heads"))
    yield from _one_of_problems(toml, ("synthetic", "measured_in"), MEASURED_IN)
    camera, heads = toml.get("synthetic", "camera"), toml.get("synthetic", "heads")
    cameras = toml.table("cameras")
    if camera is not None and (not isinstance(camera, str) or camera not in cameras):
        yield _unknown_camera(toml, ("synthetic", "camera"), camera)
    if heads is not None and (not isinstance(heads, list) or not heads):
        yield toml.problem(("synthetic", "heads"), quoted(heads), "must be a list of cameras")
        return
    seen = {camera} if isinstance(camera, str) else set()
    for n, head in enumerate((heads or [])[:MOST_CAMERAS]):
        if not isinstance(head, str) or head not in cameras:
            yield _unknown_camera(toml, ("synthetic", "heads"), head, hints=n < SHOWN)
        elif head in seen:
            yield toml.problem(("synthetic", "heads"), f"{quoted(head)} again", "every camera once")
        else:
            seen.add(head)


def _unknown_camera(
    toml: Toml, keys: tuple[str, ...], name: object, *, hints: bool = True
) -> Problem:
    hint = did_you_mean(name, toml.table("cameras")) if hints and isinstance(name, str) else ""
    return toml.problem(keys, f"{quoted(name)}{hint}", "must be one of [cameras.…]")


def _stage_problems(toml: Toml) -> Iterator[Problem]:
    yield from key_problems(toml, ("stages",), KEYS["stages",])
    for stage in KEYS["stages",]:
        yield from key_problems(toml, ("stages", stage), KEYS["stages", stage])
        for key in (k for k in KEYS["stages", stage] if k != "weights"):
            keys = ("stages", stage, key)
            yield from _choice_problems(toml, keys, CHOICES[keys])
    yield from _one_of_problems(toml, ("stages", "mounting", "weights"), WEIGHTS)


# --- Problems of the table [certificate] in flight.toml: text, dates and numbers that
# nothing uses


TABLE = "certificate"
OTHERS = ("antenna_lever_m", "valid_until", "cameras")
"""Keys that are not text; those of a device all are."""


def _certificate_problems(
    toml: Toml, known: Iterable[str], device: Iterable[str]
) -> Iterator[Problem]:
    """Yield what is wrong with the table [certificate]."""
    yield from key_problems(toml, (TABLE,), known)
    yield from key_problems(toml, (TABLE, "cameras"), toml.table(TABLE, "cameras"))
    yield from _certificate_text_problems(
        toml, (TABLE,), [key for key in known if key not in OTHERS]
    )
    yield from _lever_problems(toml)
    until = toml.get(TABLE, "valid_until")
    if until is not None and type(until) is not dt.date:
        expected = "must be a date without quotes, such as 2027-05-31"
        yield toml.problem((TABLE, "valid_until"), quoted(until), expected)
    cameras = toml.table("cameras")
    for n, name in enumerate(toml.table(TABLE, "cameras")):
        keys = (TABLE, "cameras", name)
        if name not in cameras:
            hint = did_you_mean(name, cameras) if n < SHOWN else ""
            found = f"no camera of this name{hint}"
            yield toml.problem(keys, found, "must be one of [cameras.…]")
        yield from key_problems(toml, keys, device)
        yield from _certificate_text_problems(toml, keys, device)


def _certificate_text_problems(
    toml: Toml, keys: tuple[str, ...], known: Iterable[str]
) -> Iterator[Problem]:
    for key in known:
        value = toml.table(*keys).get(key)
        if value is None:
            continue
        if not isinstance(value, str) or not value.strip():
            yield toml.problem((*keys, key), quoted(value), "must be text in quotes")
        elif fault := name_fault(value):
            yield toml.problem((*keys, key), *fault)


def _lever_problems(toml: Toml) -> Iterator[Problem]:
    value = toml.get(TABLE, "antenna_lever_m")
    if value is None:
        return
    keys = (TABLE, "antenna_lever_m")
    each = value if isinstance(value, list) else [value]
    numbers = all(isinstance(one, int | float) and not isinstance(one, bool) for one in each)
    if not numbers or len(each) != 3:
        yield toml.problem(keys, quoted(value), "must be a list of three numbers: x, y, z, in m")
    elif not all(one in RANGES[key] for one, key in zip(each, LEVER, strict=True)):
        yield toml.problem(keys, quoted(value), str(RANGES[LEVER[0]]))


# --- Problems of the values of any table of a TOML document: keys, numbers, choices


MOST_CHOICES = 1000
"""Number of names of a list that are looked at."""


def key_problems(
    toml: Toml, keys: tuple[str, ...], known: Iterable[str], required: Iterable[str] = ()
) -> Iterator[Problem]:
    """Yield unknown keys of a table, and required keys that are missing."""
    value = toml.get(*keys)
    if value is not None and not isinstance(value, dict):
        yield toml.problem(keys, quoted(value), "must be a table")
        return
    table, known = toml.table(*keys), tuple(known)
    unknown = [key for key in table if key not in known]
    for n, key in enumerate(unknown[: SHOWN + 1]):
        expected = f"must be one of {', '.join(known)}"
        found = f"unknown key{did_you_mean(key, known)}"
        if n == SHOWN:
            found = f"unknown key, as {len(unknown) - n - 1} more"
        yield toml.problem((*keys, key), found, expected)
    for key in required:
        if key not in table:
            yield toml.problem((*keys, key), "missing", "required")


def number_problems(
    toml: Toml, keys: tuple[str, ...], ranges: Mapping[str, Range]
) -> Iterator[Problem]:
    """Yield the values of a table that are no numbers, or outside their ranges."""
    for key, allowed in ranges.items():
        value = toml.table(*keys).get(key)
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float):
            yield toml.problem((*keys, key), quoted(value), "must be a number")
        elif value not in allowed:
            yield toml.problem(
                (*keys, key), f"{quoted(value)}{_unit_hint(key, value)}", str(allowed)
            )


def _unit_hint(key: str, value: float) -> str:
    if key == "pixel_um" and 0 < value < 0.1:
        return " (millimetres or metres?)"
    if key == "focal_mm" and 0 < value < 1:
        return " (metres?)"
    return " (pixels?)" if key == "focal_mm" and value > 10_000 else ""


def _one_of_problems(
    toml: Toml, keys: tuple[str, ...], allowed: tuple[str, str]
) -> Iterator[Problem]:
    """Yield a problem where a value is given and is none of the two that are allowed."""
    value = toml.get(*keys)
    if value is not None and value not in allowed:
        hint = did_you_mean(value, allowed) if isinstance(value, str) else ""
        expected = " or ".join(map(repr, allowed))
        yield toml.problem(keys, f"{quoted(value)}{hint}", f"must be {expected}")


def _choice_problems(
    toml: Toml, keys: tuple[str, ...], allowed: tuple[str, ...]
) -> Iterator[Problem]:
    """Yield what is wrong with a list of names, each once and of those allowed."""
    names = toml.get(*keys)
    if names is None:
        return
    if not isinstance(names, list):
        yield toml.problem(keys, quoted(names), f"must be a list of {', '.join(allowed)}")
        return
    seen = set()
    for name in names[:MOST_CHOICES]:
        if not isinstance(name, str) or name not in allowed:
            hint = did_you_mean(name, allowed) if isinstance(name, str) else ""
            yield toml.problem(keys, f"{quoted(name)}{hint}", f"must be of {', '.join(allowed)}")
        elif name in seen:
            yield toml.problem(keys, f"{name!r} again", "every name once")
        else:
            seen.add(name)
