"""Display of a DataFrame at the end of a cell: as HTML in Jupyter, as Markdown in the book.

Numbers are rounded and nothing else is changed. Two columns ``value`` and ``sigma`` are shown as
one, ``value ± sigma``, to two digits of sigma; a sigma that is missing says that the value was
held. Other columns of numbers have as many decimals as their largest number needs for four digits;
``table.attrs["formats"]`` asks for other formats, such as ``{"p": ".3f"}``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from numbers import Integral, Number
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_bool_dtype, is_integer_dtype, is_numeric_dtype

from acx4book.typesetting.myst import (
    LABELS,
    MISSING,
    cell_text,
    scientific,
    unsigned_zero,
    value_and_sigma,
    with_unit,
)
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.geometry.parameters import REPORTED

VALUE, SIGMA = "value", "sigma"
"""Names of two columns that belong together."""

PARAMETER, UNIT = "parameter", "unit"
"""Names of two levels of an index that belong together."""

PRINTED = "printed"
"""Second heading of a column with the paper's numbers."""

SYMBOLS = {
    **{name: LABELS[key] for name, (key, _) in REPORTED.items()},
    **{f"lever {axis}": LABELS[f"lever_{axis}_m"] for axis in "xyz"},
    **{
        f"boresight {letter}": LABELS[f"boresight_{name}_deg"]
        for letter, name in (("ω", "omega"), ("φ", "phi"), ("κ", "kappa"))
    },
    **{f"{axis}c": LABELS[f"{axis}c_mm"] for axis in "XYZ"},
    **{
        letter: LABELS[f"{name}_deg"]
        for letter, name in (("ω", "omega"), ("φ", "phi"), ("κ", "kappa"))
    },
}
"""Labels shown instead of the names of parameters in an index."""

LEAST, MOST = 1e-4, 1e6
"""Limits of numbers without powers of ten; columns of very different sizes have them, too."""

LOWER_CASE_UNITS = ("mm", "cm", "km", "px", "rad", "mrad", "deg")
"""Units of two letters and more that may begin a heading."""

DIGITS = 4
"""Digits of the largest number of a column."""

UNKNOWN = "not determined"
HELD = "held"


def register(shell: Any) -> None:
    """Register the display of this module with an IPython shell."""
    formatters = shell.display_formatter.formatters
    formatters["text/html"].for_type(pd.DataFrame, _html)
    formatters["text/markdown"].for_type(pd.DataFrame, markdown)


def markdown(table: pd.DataFrame) -> str:
    """Return a table as Markdown in the notation of MyST.

    Parameters
    ----------
    table : DataFrame
        Its index is shown unless it only counts the rows. Text is shown as it is; `Markup` is
        Markdown. Of an empty table nothing is shown.
    """
    if table.empty:
        return ""
    columns = _columns(table)
    rows = [
        [cell_text(title) for title, _, _ in columns],
        ["---:" if right else ":---" for _, _, right in columns],
        *(
            [cell_text(cell) for cell in row]
            for row in zip(*(c for _, c, _ in columns), strict=True)
        ),
    ]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _html(table: pd.DataFrame) -> str:
    """Return a table as HTML; formulas stand between dollars, which Jupyter typesets."""
    if table.empty:
        return ""
    columns = _columns(table)
    head = "".join(_tag("th", title, right=right) for title, _, right in columns)
    body = (
        "".join(
            _tag("td", cell, right=right) for cell, (_, _, right) in zip(row, columns, strict=True)
        )
        for row in zip(*(cells for _, cells, _ in columns), strict=True)
    )
    rows = "".join(f"<tr>{row}</tr>" for row in body)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _tag(name: str, cell: object, *, right: bool) -> str:
    text = " ".join(str(cell).split())
    inner = (
        re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", escape(text, quote=False))
        if isinstance(cell, Markup)
        else shown(text, "html")
    )
    return f'<{name} style="text-align:{"right" if right else "left"}">{inner}</{name}>'


# --- columns ---------------------------------------------------------------------------------


Column = tuple[str, list[str], bool]
"""Title, texts, and whether they are numbers, which stand on the right."""


def _columns(table: pd.DataFrame) -> list[Column]:
    formats = table.attrs.get("formats", {})
    out = _of_index(table.index)
    keys, done = list(table.columns), set()
    for i, key in enumerate(keys):
        if i in done:
            continue
        other = _sigma_of(key, keys)
        if other is None:
            title = _title(key)
            out.append((title, *_texts(table.iloc[:, i], formats.get(str(title), ""))))
        else:
            done.add(other)
            out.append(
                (
                    _title(key[:-1] if isinstance(key, tuple) else ("value ± σ",)),
                    _with_sigma(table.iloc[:, i], table.iloc[:, other]),
                    False,
                )
            )
    return out


def _sigma_of(key: object, keys: Sequence[object]) -> int | None:
    """Return the index of the column with the sigma of another column; None if missing."""
    if isinstance(key, tuple) and key[-1] == VALUE:
        wanted: object = (*key[:-1], SIGMA)
    elif key == VALUE:
        wanted = SIGMA
    else:
        return None
    return keys.index(wanted) if wanted in keys else None


def _of_index(index: pd.Index) -> list[Column]:
    if isinstance(index, pd.RangeIndex) or (index.nlevels == 1 and is_integer_dtype(index)):
        return []
    names = list(index.names)
    levels = {name: list(index.get_level_values(i)) for i, name in enumerate(names)}
    if {PARAMETER, UNIT} <= levels.keys():
        units = levels.pop(UNIT)
        levels[PARAMETER] = [
            with_unit(SYMBOLS.get(name, name), unit)
            for name, unit in zip(levels[PARAMETER], units, strict=True)
        ]
    return [
        (_heading(name), [v if isinstance(v, str) else str(v) for v in values], False)
        for name, values in levels.items()
    ]


def _heading(name: object) -> str:
    """Return the heading of a level of the index, with a capital if it begins with a word.

    Units and the letters of quantities keep their case: mm, σ, f.
    """
    text = str(name or "")
    word = re.match(r"[a-z]{2,}", text)
    is_word = word is not None and word[0] not in LOWER_CASE_UNITS
    return text[:1].upper() + text[1:] if is_word and not isinstance(name, Markup) else text


def _title(key: object) -> str:
    """Return the heading of a column; of several levels, without repetitions."""
    parts = key if isinstance(key, tuple) else (key,)
    words = [part for part in parts if part not in ("", PRINTED)]
    if len(words) == 1 and isinstance(words[0], Markup):
        return words[0]
    return ", ".join(str(word) for word in words)


def _with_sigma(values: pd.Series, sigmas: pd.Series) -> list[str]:
    return [_estimate(float(v), float(s)) for v, s in zip(values, sigmas, strict=True)]


def _estimate(value: float, sigma: float) -> str:
    if not np.isfinite(value):
        return MISSING
    if np.isposinf(sigma):
        return UNKNOWN
    if not (np.isfinite(sigma) and sigma > 0):
        return Markup(f"{_plain(value)} ({HELD})") if value else HELD
    return value_and_sigma(value, sigma)


def _texts(column: pd.Series, spec: str) -> tuple[list[str], bool]:
    """Return the texts of a column, and whether they are numbers."""
    if is_bool_dtype(column):
        return ["yes" if v else "no" for v in column], False
    if is_integer_dtype(column):
        return [_minus(format(v, spec or "d")) for v in column], True
    if not is_numeric_dtype(column):
        return [_object(v, spec) for v in column], False
    if spec:
        return [MISSING if np.isnan(v) else _in_format(v, spec) for v in column], True
    return _rounded(column.to_numpy(float)), True


def _object(value: object, spec: str) -> str:
    if value is None or value is pd.NA or value != value:  # noqa: PLR0124 (NaN of any kind)
        return MISSING
    if isinstance(value, Number) and not isinstance(value, bool):
        return _minus(format(value, spec)) if spec or isinstance(value, Integral) else _plain(value)
    return value if isinstance(value, str) else str(value)


def _rounded(values: Any) -> list[str]:
    """Format numbers with common decimals, or with powers of ten if their sizes differ much."""
    size = np.abs(values[np.isfinite(values) & (values != 0)])
    if len(size) == 0:
        return [MISSING if np.isnan(v) else _minus(f"{v:g}") for v in values]
    largest, least = float(size.max()), float(size.min())
    decimals = int(np.clip(DIGITS - 1 - np.floor(np.log10(largest)), 0, 8))
    if largest < LEAST or largest >= MOST or (least < 0.5 * 10.0**-decimals):
        return [MISSING if np.isnan(v) else _plain(v) for v in values]
    return [MISSING if np.isnan(v) else _minus(f"{v:.{decimals}f}") for v in values]


def _plain(value: Any) -> str:
    """Format a number with four digits; a very large or small one with a power of ten."""
    if value and np.isfinite(value) and not LEAST <= abs(value) < MOST:
        return _minus(scientific(float(value), digits=2))
    return _minus(f"{value:.{DIGITS}g}")


def _in_format(value: float, spec: str) -> Markup:
    """Format a number; a positive one rounded to zero becomes "< 0.01" with its digits."""
    text = format(value, spec)
    if value > 0 and re.fullmatch(r"0\.0+", text):
        return Markup(f"<\N{NO-BREAK SPACE}{text[:-1]}1")
    return _minus(text)


def _minus(text: str) -> Markup:
    number = unsigned_zero(text) if text.startswith("-") else text
    return Markup(number.replace("-", "\N{MINUS SIGN}").replace("inf", "∞"))
