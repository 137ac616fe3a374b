"""What can be wrong with what flight.toml says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from acx4lib.camera import distortion
from acx4lib.flight.document import Toml
from acx4lib.flight.problems import POSITIVE, RANGES, Problem, Range, did_you_mean
from acx4lib.flight.setup import (
    ESTIMABLE,
    LENS,
    LEVER,
    MOUNT,
    SIZE,
    Apriori,
    camera_of,
    grid_of,
    named_file,
)
from acx4lib.geodesy import GridSystem
from acx4lib.unknowns import GNSS

TOP = ("name", "crs", "heights", "refraction", "cameras", "synthetic", "apriori", "stages")
STAGES = {"heads": ("estimate",), "mounting": ("estimate", "fix", "gnss", "weights")}
FIXABLE = ("lever_arm", "boresight")
WEIGHTS = ("given", "estimated")
GRID_SUFFIXES = (".gtx", ".tif", ".tiff", ".gsb", ".byn", ".asc", ".gri", ".bin")


def toml_problems(toml: Toml) -> Iterator[Problem]:
    """Yield what is wrong with flight.toml; nothing more where it could not be read at all."""
    if toml.problems:
        yield from toml.problems
        return
    yield from _keys(toml, (), TOP, required=("name", "crs", "heights", "cameras"))
    for key in ("name", "crs", "heights"):
        if key in toml.values and not _is_name(toml.values[key]):
            yield toml.problem((key,), repr(toml.values[key]), "must be text")
    if toml.values.get("refraction", "none") not in ("none", "standard"):
        found = repr(toml.values["refraction"])
        yield toml.problem(("refraction",), found, "must be 'none' or 'standard'")
    yield from _grid_problems(toml)
    yield from _camera_problems(toml)
    yield from _synthetic_problems(toml)
    apriori = tuple(Apriori.__dataclass_fields__)
    yield from _keys(toml, ("apriori",), apriori)
    yield from _numbers(toml, ("apriori",), dict.fromkeys(apriori, POSITIVE))
    yield from _stage_problems(toml)


def _is_name(value: object) -> bool:
    return isinstance(value, str) and bool(value.strip())


def _keys(
    toml: Toml, keys: tuple[str, ...], known: Iterable[str], required: Iterable[str] = ()
) -> Iterator[Problem]:
    """Say what a table has that is not known, and has not that is required."""
    value = toml.get(*keys)
    if value is not None and not isinstance(value, dict):
        yield toml.problem(keys, repr(value), "must be a table")
        return
    table, known = toml.table(*keys), tuple(known)
    for key in table:
        if key not in known:
            found, expected = (
                f"unknown key{did_you_mean(key, known)}",
                f"must be one of {', '.join(known)}",
            )
            yield toml.problem((*keys, key), found, expected)
    for key in required:
        if key not in table:
            yield toml.problem((*keys, key), "missing", "required")


def _numbers(toml: Toml, keys: tuple[str, ...], ranges: dict[str, Range]) -> Iterator[Problem]:
    for key, allowed in ranges.items():
        value = toml.table(*keys).get(key)
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float):
            yield toml.problem((*keys, key), repr(value), "must be a number")
        elif value not in allowed:
            yield toml.problem((*keys, key), f"{value!r}{_unit_hint(key, value)}", str(allowed))


def _unit_hint(key: str, value: float) -> str:
    if key == "pixel_um" and 0 < value < 0.1:
        return " (millimetres or metres?)"
    if key == "focal_mm" and 0 < value < 1:
        return " (metres?)"
    return " (pixels?)" if key == "focal_mm" and value > 10_000 else ""


def _grid_problems(toml: Toml) -> Iterator[Problem]:
    crs, heights = toml.values.get("crs"), toml.values.get("heights")
    if not _is_name(crs):
        return
    try:
        _ = GridSystem(crs=str(crs))
    except ValueError as error:
        yield toml.problem(("crs",), str(error), "must be a projected CRS in metres")
        return
    if not _is_name(heights) or heights == "ellipsoidal":
        return
    expected = "must be 'ellipsoidal', a geoid grid in the flight, or a vertical CRS"
    path, wrong = named_file(toml.folder, toml.folder, str(heights))
    if path is None and (_looks_like_file(str(heights)) or wrong == "lies outside the flight"):
        yield toml.problem(("heights",), f"{heights!r} {wrong}", expected)
        return
    try:
        _ = grid_of(toml)
    except ValueError as error:
        reason = " ".join(str(error.__cause__ or error).split())
        if path is not None:
            reason = "PROJ cannot read it as a geoid grid"
        hint = did_you_mean(str(heights), ["ellipsoidal"]) or f" ({reason})"
        yield toml.problem(("heights",), f"{heights!r} cannot be used{hint}", expected)


def _looks_like_file(heights: str) -> bool:
    """Tell a file from a CRS; the working folder's files are none of the flight's."""
    return heights.lower().endswith(GRID_SUFFIXES) or Path(heights).is_file()


def _camera_problems(toml: Toml) -> Iterator[Problem]:
    if "cameras" in toml.values and not toml.table("cameras"):
        yield toml.problem(("cameras",), "no cameras", "must hold one table per camera")
    for name in toml.table("cameras"):
        keys = ("cameras", name)
        known = (*SIZE, *LENS, *MOUNT, *LEVER)
        wrong = list(_keys(toml, keys, known, SIZE))
        wrong += _numbers(toml, keys, {key: RANGES[key] for key in known})
        if not isinstance(toml.get(*keys), dict):
            wrong = [toml.problem(keys, repr(toml.get(*keys)), "must be a table")]
        if not _is_name(name):
            wrong.append(toml.problem(keys, "is empty", "must be a name"))
        yield from wrong or _lens_problems(toml, keys)


def _lens_problems(toml: Toml, keys: tuple[str, ...]) -> Iterator[Problem]:
    """Say where distortion at the corners is absurd: other units, or of another model."""
    camera = camera_of(keys[-1], toml.table(*keys))
    half = 0.5 * camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    corners = half * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
    worst = float(np.abs(distortion(camera.interior, corners)).max())
    if worst > 0.25 * float(np.hypot(*half)):
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
    yield from _keys(toml, ("synthetic",), ("camera", "heads"), ("camera", "heads"))
    camera, heads = toml.get("synthetic", "camera"), toml.get("synthetic", "heads")
    cameras = toml.table("cameras")
    if camera is not None and (not isinstance(camera, str) or camera not in cameras):
        yield _unknown_camera(toml, ("synthetic", "camera"), camera)
    if heads is not None and (not isinstance(heads, list) or not heads):
        yield toml.problem(("synthetic", "heads"), repr(heads), "must be a list of cameras")
        return
    names = heads or []
    for i, head in enumerate(names):
        if not isinstance(head, str) or head not in cameras:
            yield _unknown_camera(toml, ("synthetic", "heads"), head)
        elif head == camera or head in names[:i]:
            yield toml.problem(("synthetic", "heads"), f"{head!r} again", "every camera once")


def _unknown_camera(toml: Toml, keys: tuple[str, ...], name: object) -> Problem:
    hint = did_you_mean(str(name), toml.table("cameras"))
    return toml.problem(keys, f"{name!r}{hint}", "must be one of [cameras.…]")


def _stage_problems(toml: Toml) -> Iterator[Problem]:
    yield from _keys(toml, ("stages",), STAGES)
    for stage, known in STAGES.items():
        yield from _keys(toml, ("stages", stage), known)
        for key, allowed in (("estimate", tuple(ESTIMABLE)), ("fix", FIXABLE), ("gnss", GNSS)):
            yield from _choices(toml, ("stages", stage, key), allowed)
    keys = ("stages", "mounting", "weights")
    weights = toml.get(*keys)
    if weights is not None and weights not in WEIGHTS:
        hint = did_you_mean(str(weights), WEIGHTS)
        yield toml.problem(keys, f"{weights!r}{hint}", "must be 'given' or 'estimated'")


def _choices(toml: Toml, keys: tuple[str, ...], allowed: tuple[str, ...]) -> Iterator[Problem]:
    names = toml.get(*keys)
    if names is None:
        return
    if not isinstance(names, list):
        yield toml.problem(keys, repr(names), f"must be a list of {', '.join(allowed)}")
        return
    for i, name in enumerate(names):
        if name not in allowed:
            hint = did_you_mean(str(name), allowed)
            yield toml.problem(keys, f"{name!r}{hint}", f"must be of {', '.join(allowed)}")
        elif name in names[:i]:
            yield toml.problem(keys, f"{name!r} again", "every name once")
