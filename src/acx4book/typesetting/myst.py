"""Text of notebooks in MyST: tables and numbers, labels for readers, sentences from templates."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from numbers import Number
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, StrictUndefined
from pandas.api.types import is_numeric_dtype

from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.geometry.parameters import AXES, BORESIGHT, LEVER_ARM, REPORTED

# --- tables and numbers ----------------------------------------------------------------------


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

TAG = re.compile(r"{%.*?%}")
"""A tag of Jinja."""

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


# --- labels of methods, parameters and units; values with their sigma ------------------------


TITLES = {
    "two_step": "Two-step",
    "two_step_gnss": "Two-step, GNSS positions",
    "single_step": "Single-step",
    "rig": "Rig",
    "rig_calibration": "Rig, calibration block",
    "relative_orientation": "Relative orientation",
    "given": "As given",
}
"""Names of the methods in headings."""

UNITS = {"deg": "°", "um": "µm"}
"""Signs of units that are spelt out in results files."""

UNIT_FORM = re.compile(r"[\w/^.-]{1,20}")
"""Form of a unit; any other text, from foreign results, is shown as it is."""

_LABELS = {
    "sigma0_squared": "variance of unit weight",
    "f_mm": "$f$",
    "xp_mm": "$x_p$",
    "yp_mm": "$y_p$",
    "k1": "$k_1$",
    "k2": "$k_2$",
    "k3": "$k_3$",
    "p1": "$p_1$",
    "p2": "$p_2$",
    "b1": "$b_1$",
    "b2": "$b_2$",
    "lever_x_m": "lever arm $x$",
    "lever_y_m": "lever arm $y$",
    "lever_z_m": "lever arm $z$",
    "boresight_omega_deg": "boresight $\\omega$",
    "boresight_phi_deg": "boresight $\\varphi$",
    "boresight_kappa_deg": "boresight $\\kappa$",
    **{f"gnss_shift_{axis}_m": f"GNSS shift, {axis}" for axis in AXES},
    "gnss_delay_s": "GNSS delay",
    "deviation_sin_deg": "Deviation of headings, by their sine",
    "deviation_cos_deg": "Deviation of headings, by their cosine",
    "Xc_mm": "$X_c$",
    "Yc_mm": "$Y_c$",
    "Zc_mm": "$Z_c$",
    "omega_deg": "$\\omega_c$",
    "phi_deg": "$\\varphi_c$",
    "kappa_deg": "$\\kappa_c$",
    "width_px": "width",
    "height_px": "height",
    "pixel_um": "pixel",
    "width_mm": "X dimension",
    "height_mm": "Y dimension",
    "n_pairs": "intersection pairs",
    "n_points": "check points",
    "n_success": "successful intersections",
    "success_percent": "successful intersections",
    "n_fail": "failed intersections",
    "fail_percent": "failed intersections",
    "n_within_3_gsd": "points within 3 GSD",
    "within_3_gsd_percent": "points within 3 GSD",
    "gsd_m": "ground pixel",
    **{
        f"{kind}_{axis}_{unit}": f"{title}, {axis}"
        for kind, title in (("mean", "mean"), ("rms", "RMS"))
        for axis in AXES
        for unit in ("m", "px")
    },
}

LABELS = {name: Markup(label) for name, label in _LABELS.items()}
"""Labels for readers of parameters and statistics, by name."""


def group_label(keys: Sequence[str]) -> Markup:
    """Return the label of parameters that are tested together, by the library's names."""
    for part, names in (("lever arm", LEVER_ARM), ("boresight", BORESIGHT)):
        if tuple(keys) == names:
            return Markup(part)
    return Markup(", ".join(LABELS[REPORTED[key][0]] for key in keys))


def p_value(p: float) -> str:
    """Return a probability for a table."""
    return f"{p:.3f}" if p >= 5e-4 else "<\N{NO-BREAK SPACE}0.0005"


def inside(title: str) -> str:
    """Return a title, such as that of a method, for use inside a sentence."""
    return title[:1].lower() + title[1:]


def value_and_sigma(value: float, sigma: float) -> Markup:
    """Return a value and its standard deviation, both to two digits of the standard deviation."""
    if not np.isfinite(value):
        return Markup("")
    if not (np.isfinite(sigma) and sigma > 0):
        return Markup(f"{value:.4g}")
    if abs(value) < 1e-3 and sigma < 1e-3:
        return Markup(f"{scientific(value, digits=2)} ± {scientific(sigma, digits=1)}")
    digits = max(0, 1 - int(np.floor(np.log10(sigma))))
    return Markup(f"{unsigned_zero(f'{value:.{digits}f}')} ± {sigma:.{digits}f}")


def unsigned_zero(text: str) -> str:
    """Return a number in text, without a sign where its digits are all zero."""
    return re.sub(r"^[+-](?=0(\.0*)?$)", "", text)


def with_unit(label: str, unit: str) -> Markup:
    """Return a label with its unit in brackets; without brackets if there is no unit."""
    text = shown(label)
    if unit in ("", "1"):
        return Markup(text)
    known = UNITS.get(unit, unit) if UNIT_FORM.fullmatch(unit) else shown(unit)
    return Markup(f"{text} ({known})")


def lacking(reason: str) -> str:
    """Return the text for a method without outcome, by the reason."""
    return "needs control points" if "control points" in reason else "no outcome"


# --- sentences with numbers: templates that a teacher can edit -------------------------------


@dataclass(frozen=True)
class Sentence:
    """Text in Markdown that Jupyter and the book show."""

    text: str

    def _repr_markdown_(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return self.text


def say(template: str, **values: Any) -> Sentence:
    """Fill a Jinja template with values.

    Text of a flight, such as the name of a point, is shown character for character; `Markup` is
    Markdown. The filters are ``fixed`` (decimals), ``signed`` (decimals, with a sign), ``digits``
    (significant ones), ``span`` (the least to the largest, once where they look alike), ``sci``
    (a power of ten), ``pm`` (``{{ value | pm(sigma) }}``), ``plural``
    (``{{ n | plural("point") }}``: 1 point, 2 points) and ``listed`` (text, with commas between);
    sequences of numbers are joined by commas.

    Parameters
    ----------
    template : str
        In Markdown; lines may be indented as the cell is.
    values
        By their names in the template.

    Raises
    ------
    jinja2.UndefinedError
        For a name without a value.
    """
    rendered = _jinja().from_string(_lines_kept(template)).render(values)
    return Sentence("\n".join(line.strip() for line in rendered.splitlines()).strip())


def _lines_kept(template: str) -> str:
    """Return a template whose lines of text do not run into the next where they end in a tag.

    Jinja's `trim_blocks` removes the line break after a tag: right for a line of tags alone.
    """
    return "\n".join(
        f"{line} " if line.endswith("%}") and TAG.sub("", line).strip() else line
        for line in template.splitlines()
    )


def sections(path: Path) -> dict[str, str]:
    """Return the text below each heading of the second level of a Markdown file, by the heading."""
    parts = [part.partition("\n") for part in path.read_text("utf-8").split("\n## ")[1:]]
    return {heading: text.strip() for heading, _, text in parts}


@cache
def _jinja() -> Environment:
    jinja = Environment(
        undefined=StrictUndefined, finalize=_finalized, trim_blocks=True, lstrip_blocks=True
    )
    jinja.filters |= {
        "fixed": lambda x, n=2: _each(x, f".{n}f"),
        "signed": lambda x, n=2: _each(x, f"+.{n}f"),
        "digits": lambda x, n=3: _each(x, f".{n}g"),
        "span": lambda values, n=2: " to ".join(
            dict.fromkeys(_each(end, f".{n}f") for end in (min(values), max(values)))
        ),
        "sci": lambda x, n=1: Markup(scientific(float(x), digits=n)),
        "plural": _plural,
        "pm": lambda x, sigma: Markup(value_and_sigma(x, sigma).replace("-", "\N{MINUS SIGN}")),
        "listed": lambda texts: Markup(", ".join(shown(text) for text in texts)),
    }
    return jinja


def _finalized(value: object) -> str:
    if isinstance(value, float):
        return _each(value, ".4g")
    return shown(value)


def _each(value: Any, spec: str) -> Markup:
    """Return a number in a format, or several with commas between them."""
    values = value if isinstance(value, Iterable) else (value,)
    return Markup(", ".join(format(float(x), spec) for x in values).replace("-", "\N{MINUS SIGN}"))


def _plural(number: Any, word: str, several: str = "") -> Markup:
    """Return a count with its noun in singular or plural."""
    return Markup(f"{int(number)} {word if int(number) == 1 else several or f'{word}s'}")
