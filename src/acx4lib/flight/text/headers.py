"""Problems of the first line of a table: the names of its columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from acx4lib.flight.problems import SHOWN, Problem, did_you_mean, quoted
from acx4lib.flight.text.schemas import Schema

MOST_COLUMNS = 1000
"""Largest number of columns of a table; unknown columns are not read."""


def header_problems(file: str, header: Sequence[str], schema: Schema) -> tuple[Problem, ...]:
    """Return what is wrong with the columns of a table.

    Parameters
    ----------
    file : str
    header : sequence of str
        The names, without spaces around them.
    schema : Schema
    """
    whole = _whole_problem(header, schema)
    if whole:
        found, expected = whole
        return (Problem(file=file, line=1, column="header", found=found, expected=expected),)
    return tuple(_column_problems(file, header, schema))


def extra_notes(file: str, header: Sequence[str], schema: Schema) -> Iterator[str]:
    """Yield a note on each column that is not read, up to `SHOWN`, and one on all others."""
    extra = [name for name in header if name and name not in schema.known]
    for name in extra[:SHOWN]:
        yield f"{file}: column {quoted(name)} is not read{did_you_mean(name, schema.known)}"
    if len(extra) > SHOWN:
        yield f"{file}: {len(extra) - SHOWN} more columns are not read"


def _whole_problem(header: Sequence[str], schema: Schema) -> tuple[str, str] | None:
    """Return the problem of a header that is no list of columns at all, None if it is one."""
    name, *others = header
    if len(others) >= MOST_COLUMNS:
        return f"has {len(header)} columns", f"must have at most {MOST_COLUMNS}"
    separators = {";": "semicolons", "\t": "tabs"}
    if set(name.split(" ")) & set(schema.known):
        separators[" "] = "spaces"
    called = [says for separator, says in separators.items() if separator in name]
    if others or not called:
        return None
    return (
        f"is separated by {called[0]}",
        "must be separated by commas, numbers with decimal points",
    )


def _column_problems(file: str, header: Sequence[str], schema: Schema) -> Iterator[Problem]:
    def wrong(column: str, found: str, expected: str) -> Problem:
        return Problem(file=file, line=1, column=column, found=found, expected=expected)

    for name, count in Counter(header).items():
        if count > 1 and name in schema.known:
            yield wrong(name, f"stands {count} times in the header", "every column once")
    named = list(dict.fromkeys(header))
    begun = [form for form in schema.forms if set(form) & set(named)]
    if len(begun) > 1:
        both = [", ".join(name for name in named if name in form) for form in begun]
        yield wrong(both[0], f"beside {both[1]}", "one form of trajectory in one file")
        return
    form = begun[0] if begun else ()
    if schema.forms and not begun:
        either = " or ".join(", ".join(form) for form in schema.forms)
        yield wrong("position and attitude", "missing in the header", f"must be {either}")
    for name in (*schema.required, *form):
        if name not in named:
            hint = _hint(name, named, schema)
            yield wrong(name, f"missing in the header{hint}", "required")


def _hint(name: str, header: Sequence[str], schema: Schema) -> str:
    unknown = [other for other in header if other not in schema.known]
    lower = {other.lower(): other for other in unknown}
    if name in lower:
        return f" (is it {lower[name]!r}?)"
    return did_you_mean(name, unknown).replace("did you mean", "is it")
