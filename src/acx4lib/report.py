"""Tables and numbers of a notebook as the book shows them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import pandas as pd
from pandas.api.types import is_numeric_dtype

MISSING = "\N{EN DASH}"
"""What stands in a cell without a value."""

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

SIGMA = "\N{PLUS-MINUS SIGN}"

POWER = re.compile(r"(?<=mm)\^(-\d)")
"""Exponent of a unit, as results files write it."""


def myst_table(
    table: pd.DataFrame,
    caption: str,
    *,
    name: str,
    formats: Mapping[str, str] | None = None,
) -> str:
    """Return a table as a numbered, captioned MyST table.

    As the last line of a cell: ``Markdown(myst_table(...))``. The index is left out.

    Parameters
    ----------
    table : DataFrame
        Text cells are taken as Markdown; line breaks in them become spaces, a ``|`` is escaped,
        and no line ends after a ``±``. Columns of numbers are set right-aligned.
    caption : str
        Markdown, without line breaks.
    name : str
        Label for cross-references, such as ``tab-errata``.
    formats : mapping, optional
        Format of the numbers by column, such as ``{"value": ".3f"}``.

    Returns
    -------
    str
    """
    formats = formats or {}
    unknown = sorted(set(formats) - set(map(str, table.columns)))
    if unknown:
        msg = f"formats for columns that the table does not have: {', '.join(unknown)}"
        raise ValueError(msg)
    names = [str(column) for column in table.columns]
    rules = ["---:" if is_numeric_dtype(table.iloc[:, i]) else ":---" for i in range(len(names))]
    body = [
        [_cell(value, formats.get(column, "")) for column, value in zip(names, row, strict=True)]
        for row in table.itertuples(index=False, name=None)
    ]
    lines = ["| " + " | ".join(row) + " |" for row in ([_cell(n, "") for n in names], rules, *body)]
    return "\n".join([f"```{{table}} {_line(caption)}", f":name: {name}", "", *lines, "```"])


def scientific(value: float, *, digits: int = 0) -> str:
    """Return a number as mantissa and power of ten with superscripts, such as 2.3·10⁻⁶.

    Parameters
    ----------
    value : float
        Finite.
    digits : int
        After the decimal point.
    """
    mantissa, exponent = f"{value:.{digits}e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def _cell(value: object, spec: str) -> str:
    """Return one cell; what is missing or not a number is a dash."""
    if value is None or value is pd.NA or value != value:  # noqa: PLR0124 (NaN of any kind)
        return MISSING
    text = format(value, "" if isinstance(value, str) else spec)
    text = POWER.sub(lambda m: m[1].translate(SUPERSCRIPTS), _line(text)).replace("|", r"\|")
    return text.replace(f"{SIGMA} ", f"{SIGMA}\N{NO-BREAK SPACE}")  # no line ends between the two


def _line(text: str) -> str:
    return " ".join(text.split())
