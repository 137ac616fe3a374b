"""The entries of summary.json: as they are written, and checked when they are read."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.flight.text.files import text_of

Test = Callable[[Any], bool]


def _number(value: object) -> bool:
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return plain and -1e300 < value < 1e300  # type: ignore[operator] # compared as numbers only


def _or_null(test: Test) -> Test:
    return lambda value: value is None or test(value)


def _sentences(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(line, str) for line in value)


def _three(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_or_null(_number), value))


def _pairs(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(one, list) and len(one) == 3 and _sentences(one[:2]) and _number(one[2])
        for one in value
    )


def _groups(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(one, list)
        and len(one) == 3
        and isinstance(one[0], str)
        and all(map(_number, one[1:]))
        for one in value
    )


def _named_pairs(value: Any) -> bool:
    return isinstance(value, list) and all(_sentences(one) and len(one) == 3 for one in value)


def _by_name(test: Test) -> Test:
    return lambda value: isinstance(value, dict) and all(map(test, value.values()))


_WORDS: Mapping[str, tuple[str, ...]] = {
    "nssda": ("statement",),
    "asprs_2014": ("horizontal", "vertical"),
    "asprs_2023": ("horizontal", "vertical", "three_d"),
}


def _classes(value: Any) -> bool:
    """Tell whether the classes of every standard are texts."""
    if not _by_name(_is_object)(value):
        return False
    of_scales = value.get("pec_pcd", {}).values()
    return all(_has_words(one, ("plan", "height")) for one in of_scales) and all(
        _has_words(value[name], keys) for name, keys in _WORDS.items() if name in value
    )


def _is_object(value: object) -> bool:
    return isinstance(value, dict)


def _is_compared(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and _three(value.get("difference"))
        and _or_null(_number)(value.get("p"))
        and isinstance(value.get("confirmed"), bool)
        and all(isinstance(value.get(key, ""), str) for key in ("told", "mistake"))
    )


_OF_TURNS = ("f", "dof", "redundancy", "p")


def _turns(value: Any) -> bool:
    """Tell whether a test of turns of the cameras against the body is complete."""
    if not (isinstance(value, dict) and _sentences(value.get("names"))):
        return False
    by_name = (value.get("turns_deg"), value.get("sigma_deg"))
    return all(_number(value.get(key)) for key in _OF_TURNS) and all(
        isinstance(rows, list) and len(rows) == len(value["names"]) and all(map(_three, rows))
        for rows in by_name
    )


def _has_words(value: Any, keys: tuple[str, ...]) -> bool:
    return isinstance(value, dict) and all(isinstance(value.get(key), str) for key in keys)


_OF_POINTS = ("mean", "std", "rms", "mean_sigma", "normalised_rms", "effective_number")


def _points(value: object) -> bool:
    return (
        isinstance(value, dict)
        and all(_or_null(_three)(value.get(key)) for key in _OF_POINTS)
        and _classes(value.get("classes", {}))
    )


def _checksums(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(one, str) for one in value.values())


def _is_named(value: Any) -> bool:
    """Tell whether a flight has its name and its digest."""
    return isinstance(value, dict) and _has_words(value, ("name", "sha256"))


def _is_earlier(value: Any) -> bool:
    """Tell whether the calibration of an earlier flight has what names it."""
    texts = ("results", "sha256", "computed", "method")
    return _has_words(value, texts) and _is_named(value.get("flight"))


_COUNT = ("iterations", "n_observations", "n_unknowns", "redundancy", "n_rejected", "n_left_out")
_JUDGED = ("expected_rejections", "height_scale_error", "height_offset_share")
_OF_PAIRS = ("n_pairs", "n_points", "n_failed_pairs")
_TESTED = ("sigma0_squared", "chi_square_p", "condition", "joint_chi_square", "joint_chi_square_p")

TESTS: Mapping[str, tuple[Test, str]] = {
    "converged": (lambda value: isinstance(value, bool), "true or false"),
    **dict.fromkeys(
        (*_COUNT, *_OF_PAIRS, *_TESTED, *_JUDGED, "joint_dof", "n_exposures"),
        (_or_null(_number), "a number or null"),
    ),
    **dict.fromkeys(
        (
            *("left_out", "not_determined", "weak", "stopped", "exchanged", "not_confirmed"),
            *("approximations", "sigma_beyond", "notes"),
        ),
        (_sentences, "a list of sentences"),
    ),
    "declared": (_by_name(_is_compared), "difference, p and confirmed by part of a mounting"),
    "exchanged_names": (_named_pairs, "a list of a kind and two names each"),
    "boresight_stability": (
        _by_name(_or_null(_turns)),
        "strips and drift, each null or with names, turns_deg, sigma_deg, f, dof, redundancy and p",
    ),
    "stopped_groups": (_groups, "a list of a group and two numbers each"),
    "correlated": (_pairs, "a list of two parameters and a number each"),
    **dict.fromkeys(
        ("weakest", "largest_correlations", "left_out_points"),
        (_by_name(_or_null(_number)), "numbers by name"),
    ),
    "weak_parameters": (_by_name(_by_name(_or_null(_number))), "numbers by parameter and name"),
    "sigma_factors": (_by_name(_by_name(_or_null(_number))), "numbers by name and group"),
    **dict.fromkeys(("mean", "std", "rms"), (_three, "a list of three numbers")),
    "points": (_points, "mean, std, rms and classes over the points"),
    "flight": (_is_named, "name and sha256 of a flight"),
    "calibration": (_is_earlier, "what names the calibration of an earlier flight"),
    "measured": (_checksums, "checksums by file"),
}
"""Tests of the known entries by name, each with what it expects; others are not read."""

_ADJUSTED = ("n_observations", "n_unknowns", "redundancy", "n_rejected", "chi_square_p")
_VALIDATED = (*_OF_PAIRS, "mean", "std", "rms", "points")


def read_summary(path: Path, problems: list[str]) -> dict[str, dict[str, object]]:
    """Read summary.json; a missing file counts as empty.

    Parameters
    ----------
    path : Path
    problems : list of str
        A line for each thing that is wrong is added to it.
    """
    if not path.is_file():
        if path.exists():
            problems.append(f"{path}: is no regular file; remove it and run again")
        return {}
    try:
        summary = json.loads(text_of(path))
    except (ValueError, RecursionError) as error:
        problems.append(f"{path}: not JSON ({error}); remove it and run again")
        return {}
    if not isinstance(summary, dict):
        problems.append(f"{path}: not one object per stage/method; remove it and run again")
        return {}
    wrong = [f"{path}: {line}; remove the results and run again" for line in wrong_entries(summary)]
    problems += wrong
    return {} if wrong else summary


def summary_text(summary: Mapping[str, Mapping[str, object]]) -> str:
    """Return the text of summary.json; a number that is not finite becomes null."""
    plain = _plain(summary)
    return json.dumps(plain, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def wrong_entries(summary: Mapping[str, object]) -> Iterator[str]:
    """Yield a line for each thing that is wrong with the objects of a summary.

    Parameters
    ----------
    summary : mapping
        Objects read from JSON, by ``stage/method``.
    """
    for name, entry in summary.items():
        if not isinstance(entry, dict):
            yield f"{name}: {_quoted(entry)}; must be an object"
            continue
        for key, (test, expected) in TESTS.items():
            if key in entry and not test(entry[key]):
                yield f"{name}: {key}: {_quoted(entry[key])}; must be {expected}"
        for key in _required(name, entry):
            if entry.get(key) is None:
                yield f"{name}: {key}: missing; an adjustment has it"


def _required(name: str, entry: Mapping[str, object]) -> tuple[str, ...]:
    """Return the required entries of an object, if it is an adjustment or a validation."""
    if name.startswith("validation/") and "n_points" in entry:
        return _VALIDATED
    sigma0_sq = entry.get("sigma0_squared")
    adjusted = name.startswith(("heads/bundle", "mounting/"))
    is_number = isinstance(sigma0_sq, int | float) and math.isfinite(sigma0_sq)
    return _ADJUSTED if adjusted and is_number else ()


def _quoted(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"
