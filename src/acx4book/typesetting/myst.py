"""Tables and numbers of a notebook as MyST text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from numbers import Number

import pandas as pd
from pandas.api.types import is_numeric_dtype

from acx4book.typesetting.plain_text import Markup, shown

MISSING = "\N{EN DASH}"
"""Text of a cell without a value."""

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

UNIT = r"(?:[±·%°″]|[µcmn]?m\b|px\b|m?s\b)"
HYPHEN = re.compile(rf"(?<![\w.\-/^])-(?=\d+(?:\.\d|,\s[+-]\d|\s?{UNIT}))")
"""A hyphen in the place of a minus sign; not before a whole number alone, which may be a name."""

KEPT = re.compile(
    r"(?<=[<>≤≥≈±]) (?=[+−-]?\d)"
    r"|(?<![\w^])(\d[\d.,]{0,40}+) (?=[°‰σ]|%(?!\w)|(?:[µcmnk]?m|px|m?s|m?rad|min|h|[kMG]B)\b)"
)
"""A space without line break: behind a sign of comparison or ±, and between number and unit."""

POWER = re.compile(r"(?<=mm)\^(-\d)")
"""Exponent of a unit, in the notation of results files."""


def myst_table(
    table: pd.DataFrame,
    caption: str,
    *,
    name: str,
    formats: Mapping[str, str] | None = None,
) -> str:
    """Return a table as a numbered, captioned MyST table.

    Use it in the last line of a cell: ``Markdown(myst_table(...))``. The index is left out.

    Parameters
    ----------
    table : DataFrame
        Text in cells and headings is shown as it is. `Markup` is Markdown; in it line breaks
        become spaces, ``|`` is escaped, and no line ends after ``±``. Columns of numbers are
        right-aligned.
    caption : str
        Text, or `Markup`.
    name : str
        Label for cross-references, such as ``tab-errata``.
    formats : mapping, optional
        Format of the numbers by column, such as ``{"value": ".3f"}``.
    """
    formats = formats or {}
    unknown = sorted(set(formats) - set(map(str, table.columns)))
    if unknown:
        msg = f"formats for columns that the table does not have: {', '.join(unknown)}"
        raise ValueError(msg)
    head = list(table.columns)
    rules = ["---:" if is_numeric_dtype(table.iloc[:, i]) else ":---" for i in range(len(head))]
    body = [
        [
            _cell(value, formats.get(str(column), ""))
            for column, value in zip(head, row, strict=True)
        ]
        for row in table.itertuples(index=False, name=None)
    ]
    lines = ["| " + " | ".join(row) + " |" for row in ([_cell(h, "") for h in head], rules, *body)]
    return numbered("\n".join(lines), _text(caption), name)


def numbered(table: str, caption: str, name: str) -> str:
    """Return a Markdown table with a number, a caption in Markdown, and a label for references."""
    return "\n".join([f"```{{table}} {caption}", f":name: {name}", "", table, "```"])


def scientific(value: float, *, digits: int = 0) -> str:
    """Return a number as mantissa and power of ten with superscripts, such as 2.3·10⁻⁶; 0 as it is.

    Parameters
    ----------
    value : float
        A finite number.
    digits : int
        Digits after the decimal point.
    """
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.{digits}e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def numbers(text: str) -> str:
    """Return text with minus signs before numbers, and with its numbers and units on one line."""
    return KEPT.sub(lambda m: f"{m[1] or ''}\N{NO-BREAK SPACE}", HYPHEN.sub("\N{MINUS SIGN}", text))


def marked(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with all texts and headings as Markdown; none may come from a flight."""
    texts = table.astype(object).map(lambda cell: Markup(cell) if isinstance(cell, str) else cell)
    columns = {
        name: column if is_numeric_dtype(column) else texts[name] for name, column in table.items()
    }
    return pd.DataFrame(columns).rename(columns=Markup)


def _cell(value: object, spec: str) -> str:
    """Return the text of a cell; a missing value or NaN is a dash."""
    if value is None or value is pd.NA or value != value:  # noqa: PLR0124 (NaN of any kind)
        return MISSING
    if isinstance(value, Number):
        return format(value, spec).replace("-", "\N{MINUS SIGN}")
    return cell_text(value)


def cell_text(value: object) -> str:
    """Return the text of a table cell: plain text unchanged, `Markup` as Markdown."""
    return _text(value).replace("|", r"\|")


def _text(text: object) -> str:
    """Escape text, so that it is shown unchanged; put `Markup` on one line."""
    if not isinstance(text, Markup):
        return shown(text)
    line = POWER.sub(lambda m: m[1].translate(SUPERSCRIPTS), " ".join(text.split()))
    return numbers(line)


def at_commit(commit: str) -> str:
    """Return the commit of stored numbers, with the number of changed files.

    Parameters
    ----------
    commit : str
        A hash, and where files differed, after a comma, their number: ``"b689…, 2 files differ"``.
    """
    name, _, differing = commit.partition(", ")
    number = differing.partition(" ")[0]
    files = "one file" if number == "1" else f"{number} files"
    return f"commit `{name[:7]}`" + (f" with changes in {files}" if differing else "")
