"""The keys of flight.toml: what each may be, and what is wrong with a file.

`FLIGHT` declares them, for the check of a file and for the table of the book's page.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from pyproj.exceptions import ProjError

from acx4lib.errors import UNSEEN
from acx4lib.flight.block import SMALLEST_ANGLE
from acx4lib.flight.problems import POSITIVE, RANGES, SHOWN, Problem, Range, did_you_mean, quoted
from acx4lib.flight.setup import (
    ESTIMABLE,
    ESTIMATED,
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
from acx4lib.flight.toml_file import (
    Keys,
    Table,
    Tables,
    Toml,
    Value,
    choice,
    choices,
    date,
    defaults,
    is_number,
    is_text,
    name_problems,
    no_problems,
    number,
    numbers,
    text,
)
from acx4lib.geometry.camera import distortion
from acx4lib.geometry.crs import is_code_or_wkt
from acx4lib.geometry.geodesy import LARGEST_UNDULATION_M, LOCAL, grid_system
from acx4lib.geometry.parameters import ATTITUDE, GNSS

INWARD, OUTWARD = 0.25, 0.5
"""Largest corrections of a corner, in half diagonals: a third inwards would fold a lens of k1
alone, and outwards a fisheye needs a quarter and more."""

FORMAT = 6
"""The latest format of flight.toml that is understood, as are all before it."""

MOST_CAMERAS = 1000
MOST_REASON = 200
"""Largest number of characters of a message of PROJ that is repeated."""


def flight_table(toml: Toml) -> Table:
    """Return `FLIGHT` for a document: on no map, heights may be left out."""
    if toml.values.get("crs") != LOCAL:
        return FLIGHT
    return replace(FLIGHT, required=[key for key in FLIGHT.required if key != "heights"])


def _crs_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield what is wrong with the text of a CRS: WKT may have several lines."""
    value = toml.get(*keys)
    if not is_text(value):
        yield toml.problem(keys, quoted(value), "must be text, such as EPSG:32633")
    elif unseen := UNSEEN.search(re.sub(r"[\n\r\t]", " ", value)):
        found = f"holds the character U+{ord(unseen[0]):04X}"
        yield toml.problem(keys, found, "must be text without control characters")


def _height_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    value = number(_UNDULATION) if is_number(toml.get(*keys)) else text(_HEIGHTS)
    yield from value.problems(toml, keys)


def _format_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    if toml.get(*keys) not in range(1, FORMAT + 1):
        expected = f"must be a whole number up to {FORMAT}; a larger one is of a later acx4"
        yield toml.problem(keys, quoted(toml.get(*keys)), expected)


def _flag_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    if not isinstance(toml.get(*keys), bool):
        yield toml.problem(keys, quoted(toml.get(*keys)), "must be true or false")


def _halves(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield a share of correlated errors without its time constant, and the reverse."""
    table = toml.table(*keys)
    for of in ("gnss", "attitude"):
        both = (f"{of}_correlation_s", f"{of}_correlated_share")
        for key, other in (both, both[::-1]):
            if key in table and other not in table:
                yield toml.problem((*keys, key), "stands alone", f"needs {other} as well")


def _grid_problems(toml: Toml, _: Keys) -> Iterator[Problem]:
    crs, heights = toml.values.get("crs"), toml.values.get("heights")
    if not is_text(crs):
        return
    try:
        grid_system(str(crs))
    except ValueError as error:
        expected = f"must be a projected CRS in metres, or {LOCAL!r}"
        yield toml.problem(("crs",), str(error), expected)
        return
    if crs == LOCAL:
        yield from _local_problems(toml)
        return
    if not is_text(heights) or heights == "ellipsoidal":
        return
    expected = "must be 'ellipsoidal', a geoid grid in the flight, a vertical CRS, or a number"
    inside = toml.folder.resolve()
    path, wrong = named_file(inside, inside, str(heights))
    hint = did_you_mean(str(heights), ["ellipsoidal"])
    if path is None and not hint and not is_code_or_wkt(str(heights)):
        yield toml.problem(("heights",), f"{quoted(heights)} {wrong}", expected)
        return
    try:
        grid_of(toml)
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


def _whole_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    n = len(toml.table(*keys))
    if n == 0:
        yield toml.problem(keys, "no cameras", "must hold one table per camera")
    if n > MOST_CAMERAS:
        yield toml.problem(keys, f"{n} cameras", f"must be at most {MOST_CAMERAS}")


def _sigma_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield a sigma of a mounting that is not there."""
    for key, of in zip(SIGMAS, (LEVER, MOUNT), strict=True):
        if key in toml.table(*keys) and not any(name in toml.table(*keys) for name in of):
            cure = f"needs the values it is of: {', '.join(of)}"
            yield toml.problem((*keys, key), "sigma of nothing", cure)


def _lens_problems(toml: Toml, keys: tuple[str, ...]) -> Iterator[Problem]:
    """Yield a problem where the distortion at a corner is absurd: other units or another model."""
    camera = camera_of("camera", toml.table(*keys))
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


def _synthetic_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield names of the synthetic camera and its heads that are no cameras, or stand twice."""
    cameras, camera, heads = (
        toml.table("cameras"),
        toml.get(*keys, "camera"),
        toml.get(*keys, "heads"),
    )
    if "camera" in toml.table(*keys) and (not isinstance(camera, str) or camera not in cameras):
        yield _unknown_camera(toml, (*keys, "camera"), camera)
    if "heads" in toml.table(*keys) and (not isinstance(heads, list) or not heads):
        yield toml.problem((*keys, "heads"), quoted(heads), "must be a list of cameras")
        return
    seen = {camera} if isinstance(camera, str) else set()
    for n, head in enumerate((heads or [])[:MOST_CAMERAS]):
        if not isinstance(head, str) or head not in cameras:
            yield _unknown_camera(toml, (*keys, "heads"), head, hints=n < SHOWN)
        elif head in seen:
            yield toml.problem((*keys, "heads"), f"{quoted(head)} again", "every camera once")
        else:
            seen.add(head)


def _unknown_camera(toml: Toml, keys: Keys, name: object, *, hints: bool = True) -> Problem:
    hint = did_you_mean(name, toml.table("cameras")) if hints and isinstance(name, str) else ""
    return toml.problem(keys, f"{quoted(name)}{hint}", "must be one of [cameras.…]")


def _device_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield cameras of a certificate that the flight does not have."""
    cameras, stated = toml.table("cameras"), toml.table(*keys, "cameras")
    for n, name in enumerate(name for name in stated if name not in cameras):
        found = f"no camera of this name{did_you_mean(name, cameras) if n < SHOWN else ''}"
        yield toml.problem((*keys, "cameras", name), found, "must be one of [cameras.…]")


_METRES = f"an undulation in metres, at most {LARGEST_UNDULATION_M:g} either way"
_HEIGHTS = f"must be text, or {_METRES}"
_UNDULATION = Range(-LARGEST_UNDULATION_M, LARGEST_UNDULATION_M, f"must be {_METRES}")
_SHARES = dict.fromkeys(("gnss_correlated_share", "attitude_correlated_share"), Range(0.0, 1.0))
_APRIORI = dict.fromkeys(defaults(Apriori), POSITIVE) | _SHARES
_QUOTED = text("must be text in quotes")
_SIGMA = numbers(3, POSITIVE, "must be a number or a list of three", alone=True)
_ESTIMATE = choices(tuple(ESTIMABLE))

CAMERA = Table(
    keys={
        **{key: number(RANGES[key]) for key in (*SIZE, *LENS, *MOUNT, *LEVER)},
        **dict.fromkeys(SIGMAS, _SIGMA),
    },
    required=SIZE,
    default=dict.fromkeys((*LENS, *MOUNT, *LEVER), 0.0),
    rules=[_sigma_problems],
    sound=[_lens_problems],
)

FLIGHT = Table(
    keys={
        "name": text(),
        "crs": Value('code, WKT or PROJ string of a projected CRS, or `"local"`', _crs_problems),
        "heights": Value("text, or a number", _height_problems),
        "refraction": choice(("none", "standard")),
        "simulated": Value("`true` or `false`; default `false`", _flag_problems),
        "cameras": Tables(of=CAMERA, whole=_whole_problems, named=name_problems),
        "synthetic": Table(
            keys={
                "camera": Value("name of a camera", no_problems),
                "heads": Value("list of names of cameras", no_problems),
                "measured_in": choice(("synthetic", "heads")),
            },
            required=("camera", "heads"),
            default=defaults(Synthetic),
            rules=[_synthetic_problems],
        ),
        "apriori": Table(
            keys={key: number(allowed) for key, allowed in _APRIORI.items()},
            default={k: v for k, v in defaults(Apriori).items() if "correlat" not in k},
            rules=[_halves],
        ),
        "adjustment": Table(
            keys={"smallest_angle_deg": number(Range(0.0, 90.0))},
            default={"smallest_angle_deg": float(np.degrees(SMALLEST_ANGLE))},
        ),
        "session": Table(
            keys={"date": date(timed=True), "temperature_c": number(Range(-100.0, 100.0))}
        ),
        "stages": Table(
            keys={
                "heads": Table(
                    keys={"estimate": _ESTIMATE}, default={"estimate": ESTIMATED["heads"]}
                ),
                "mounting": Table(
                    keys={
                        "estimate": _ESTIMATE,
                        "fix": choices(("lever_arm", "boresight")),
                        "gnss": choices(GNSS),
                        "attitude": choices(ATTITUDE),
                        "weights": choice(("given", "estimated")),
                    },
                    default={"estimate": ESTIMATED["mounting"], "weights": "given"},
                ),
            }
        ),
        "certificate": Table(
            keys={
                **dict.fromkeys(defaults(Certificate), _QUOTED),
                "antenna_lever_m": numbers(
                    3, RANGES[LEVER[0]], "must be a list of three numbers: x, y, z, in m"
                ),
                "valid_until": date(),
                "cameras": Tables(of=Table(keys=dict.fromkeys(defaults(Device), _QUOTED))),
            },
            rules=[_device_problems],
        ),
        "format": Value(f"whole number from 1 to {FORMAT}", _format_problems),
    },
    required=("name", "crs", "heights", "cameras"),
    default={"refraction": "none"},
    rules=[_grid_problems],
)
"""The keys of flight.toml, with what stands where they do not; any other key is refused."""
