"""The entries of summary.json, and their checks when the file is read."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from acx4lib.errors import FlightError
from acx4lib.flight.problems import Problem, lines_of
from acx4lib.flight.table_files import read_text
from acx4lib.results.table_files import MOST_BYTES, STAGES, is_there

Test = Callable[[Any], bool]

Wrong = tuple[tuple[str, ...], str, str]
"""Keys in a JSON file, content, and expected content."""


def _number(value: object) -> bool:
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return plain and -1e15 < value < 1e15  # type: ignore[operator] # compared as numbers only


def _whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1e15


def _not_negative(value: object) -> bool:
    return _number(value) and float(value) >= 0  # type: ignore[arg-type]


def _probability(value: object) -> bool:
    return _not_negative(value) and float(value) <= 1  # type: ignore[arg-type]


def _or_null(test: Test) -> Test:
    return lambda value: value is None or test(value)


def _sentences(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(line, str) for line in value)


def _three(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_or_null(_number), value))


def _pairs(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(pair, list) and len(pair) == 3 and _sentences(pair[:2]) and _number(pair[2])
        for pair in value
    )


def _groups(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(group, list)
        and len(group) == 3
        and isinstance(group[0], str)
        and all(map(_number, group[1:]))
        for group in value
    )


def _named_pairs(value: Any) -> bool:
    return isinstance(value, list) and all(_sentences(pair) and len(pair) == 3 for pair in value)


def _is_condition(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < 1e300


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
    return all(_has_words(classes, ("plan", "height")) for classes in of_scales) and all(
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


def _is_sigma_test(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and all(_not_negative(value.get(key)) for key in ("ratio", "redundancy", "effective"))
        and _probability(value.get("p"))
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
    return isinstance(value, dict) and all(isinstance(checksum, str) for checksum in value.values())


def _is_named(value: Any) -> bool:
    """Tell whether a flight has its name and its digest."""
    return isinstance(value, dict) and _has_words(value, ("name", "sha256"))


def _is_earlier(value: Any) -> bool:
    """Tell whether the calibration of an earlier flight is fully identified."""
    texts = ("results", "sha256", "computed", "method")
    return _has_words(value, texts) and _is_named(value.get("flight"))


_COUNT = ("iterations", "n_observations", "n_unknowns", "redundancy", "n_rejected", "n_left_out")
_OF_PAIRS = ("n_pairs", "n_points", "n_failed_pairs")
_NOT_NEGATIVE = ("sigma0_squared", "joint_chi_square", "expected_rejections")

TESTS: Mapping[str, tuple[Test, str]] = {
    "converged": (lambda value: isinstance(value, bool), "true or false"),
    **dict.fromkeys(
        (*_COUNT, *_OF_PAIRS, "n_exposures"), (_or_null(_whole), "a whole number or null")
    ),
    **dict.fromkeys(
        ("height_scale_error", "height_scale_sigma", "height_offset_share", "joint_dof"),
        (_or_null(_number), "a number or null"),
    ),
    **dict.fromkeys(_NOT_NEGATIVE, (_or_null(_not_negative), "zero, positive or null")),
    **dict.fromkeys(
        ("chi_square_p", "joint_chi_square_p"),
        (_or_null(_probability), "between 0 and 1, or null"),
    ),
    "condition": (_or_null(_is_condition), "a positive number or null"),
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
    "sigma_of_heads": (_by_name(_not_negative), "numbers by parameter, zero or positive"),
    "weak_parameters": (_by_name(_by_name(_or_null(_number))), "numbers by parameter and name"),
    "sigma_tests": (_by_name(_is_sigma_test), "ratio, redundancy, effective and p by group"),
    "sigma_factors": (_by_name(_by_name(_or_null(_number))), "numbers by name and group"),
    "rays_rms_px": (_or_null(_not_negative), "zero, positive or null"),
    "picture_turns_deg": (_three, "a list of three numbers"),
    **dict.fromkeys(("mean", "std", "rms", "position_rms_m"), (_three, "a list of three numbers")),
    "points": (_points, "mean, std, rms and classes over the points"),
    "flight": (_is_named, "name and sha256 of a flight"),
    "calibration": (_is_earlier, "what names the calibration of an earlier flight"),
    "measured": (_checksums, "checksums by file"),
}
"""Tests of the known entries by name, each with the expected content; others are not read."""

_ADJUSTED = ("n_observations", "n_unknowns", "redundancy", "n_rejected", "chi_square_p")
_VALIDATED = (*_OF_PAIRS, "mean", "std", "rms", "points")


def read_summary(path: Path, problems: list[str]) -> dict[str, dict[str, object]]:
    """Read summary.json; a missing file counts as empty.

    Parameters
    ----------
    path : Path
    problems : list of str
        One line per problem is added to it.
    """
    try:
        summary = read_object(path, "one object per stage/method") if is_there(path) else {}
    except FlightError as error:
        problems += error.problems
        return {}
    faults = list(_wrong_entries(summary))
    problems += lines_of(problem_of(path, *fault) for fault in faults)
    return {} if faults else summary


def read_object(path: Path, what: str) -> dict[str, Any]:
    """Return the object in a JSON file; a repeated key is refused.

    Parameters
    ----------
    path : Path
        An existing file.
    what : str
        Expected content, for messages.

    Raises
    ------
    FlightError
    """
    text = _text_of(path)

    def wrong(line: int, fault: str) -> FlightError:
        expected = f"must be {what}; remove it and run again"
        problem = Problem(file=str(path), line=line, column="file", found=fault, expected=expected)
        return FlightError([str(problem)])

    try:
        content = json.loads(text, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise wrong(error.lineno, f"not JSON ({error.msg}, character {error.colno})") from None
    except (ValueError, RecursionError) as error:
        raise wrong(1, f"not JSON ({' '.join(str(error).split())})") from None
    if not isinstance(content, dict):
        raise wrong(1, _quoted(content))
    return content


def _text_of(path: Path) -> str:
    """Return the text of a file; FlightError if it cannot be read."""
    text, _, problems = read_text(path, str(path), needed_by="a report", most=MOST_BYTES)
    if problems:
        raise FlightError([f"{problem}; remove it and run again" for problem in problems])
    return text


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entries = dict(pairs)
    if len(entries) < len(pairs):
        again = next(key for k, (key, _) in enumerate(pairs) if key in dict(pairs[:k]))
        raise ValueError(f"{_quoted(again)} stands twice in one object")
    return entries


def problem_of(path: Path, keys: Sequence[str], found: str, expected: str) -> Problem:
    """Return a problem of a key in a JSON file, with the line of the key if it is found."""
    text, offset = _text_of(path) if path.is_file() else "", 0
    for key in keys:
        position = text.find(f"{json.dumps(key, ensure_ascii=False)}:", offset)
        offset = position if position >= 0 else offset
    line = text.count("\n", 0, offset) + 1
    name = ": ".join(keys) or "file"
    return Problem(file=str(path), line=line, column=name, found=found, expected=expected)


def _wrong_entries(summary: Mapping[str, object]) -> Iterator[Wrong]:
    """Yield keys, content and expected content of each problem in a summary."""
    for name, entry in summary.items():
        if name.partition("/")[0] not in STAGES or "/" not in name:
            yield (name,), "is unknown", f"must be of a stage: {', '.join(STAGES)}"
            continue
        if not isinstance(entry, dict):
            yield (name,), _quoted(entry), "must be an object"
            continue
        for key, (test, wanted) in TESTS.items():
            if key in entry and not test(entry[key]):
                yield (name, key), _quoted(entry[key]), f"must be {wanted}"
        for key in _required(name, entry):
            if entry.get(key) is None:
                yield (name, key), "is missing", "an adjustment has it"


def _required(name: str, entry: Mapping[str, object]) -> tuple[str, ...]:
    """Return the required entries of an object, if it is an adjustment or a validation."""
    if name.startswith("validation/") and "n_points" in entry:
        return _VALIDATED
    sigma0_sq = entry.get("sigma0_squared")
    adjusted = name.startswith(("heads/bundle", "mounting/"))
    return _ADJUSTED if adjusted and _number(sigma0_sq) else ()


def _quoted(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"
