"""Tables, matrices, labels and sentences as Markdown."""

from __future__ import annotations

import html
from types import SimpleNamespace

import jinja2
import numpy as np
import pandas as pd
import pytest
from IPython.core.formatters import DisplayFormatter
from markdown_it import MarkdownIt

from acx4book.typesetting import myst, tables
from acx4book.typesetting.matrix import sigma_figure
from acx4book.typesetting.myst import say
from acx4book.typesetting.plain_text import Markup
from acx4book.typesetting.tables import markdown
from acx4lib.georeferencing.budget import SOURCES, Budget, Format
from support.figures import drawn, panels

# --- tables for the book ---------------------------------------------------------------------


def rows(markdown: str) -> list[list[str]]:
    """Parse the pipe table inside the directive."""
    inner = "\n".join(markdown.splitlines()[3:-1])
    tokens = MarkdownIt("commonmark").enable("table").parse(inner)
    cells: list[list[str]] = []
    for token, after in zip(tokens, [*tokens[1:], None], strict=True):
        if token.type == "tr_open":
            cells.append([])
        elif token.type in ("th_open", "td_open"):
            cells[-1].append(after.content)
    return cells


def test_missing_values_are_dashes_and_text_takes_no_number_format():
    frame = pd.DataFrame(
        {"v": [np.nan, 0.5], "s": [None, "ND"], "m": pd.Series([1.0, "A"], dtype=object)}
    )
    got = rows(myst.myst_table(frame, "c", name="t", formats={"v": ".1e", "m": ".2f", "s": "f"}))
    assert got[1:] == [[myst.MISSING, myst.MISSING, "1.00"], ["5.0e−01", "ND", "A"]]


def test_text_is_no_markup_in_a_cell_a_heading_or_a_caption():
    frame = pd.DataFrame({"*a* $x$": ["`b` mm^-2 ± 1", "{{ c }}"], "n": ["-1", "--"]})
    got = myst.myst_table(frame, "*d* {e}`f`", name="t")
    assert not set("*$`{}^") & set(got.replace("```{table}", "").removesuffix("```"))
    said = [[html.unescape(cell) for cell in row] for row in rows(got)]
    assert said == [["*a* $x$", "n"], ["`b` mm^-2 ± 1", "-1"], ["{{ c }}", "--"]]


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [
        (2.27e-6, 2, "2.27·10⁻⁶"),
        (-1.04e-10, 1, "-1.0·10⁻¹⁰"),
        (4e23, 0, "4·10²³"),
        (1, 0, "1·10⁰"),
        (0, 2, "0"),
    ],
)
def test_scientific_numbers(value, digits, expected):
    assert myst.scientific(value, digits=digits) == expected


@pytest.mark.parametrize(
    ("text", "set_so"),
    [
        ("off by -0.4, -0.4, +0.2 m", "off by −0.4, −0.4, +0.2\u00a0m"),
        ("by -23, +27, -33 m", "by −23, +27, −33\u00a0m"),
        ("(-0.99), p < 0.0005", "(−0.99), p <\u00a00.0005"),
        ("-8.8·10⁻¹¹ ± 1.5 mm", "−8.8·10⁻¹¹ ±\u00a01.5\u00a0mm"),
        ("σ of 3 % at 600 m in 12 min", "σ of 3\u00a0% at 600\u00a0m in 12\u00a0min"),
        *((same, same) for same in ("C5-04", "2026-05-02", "1-2.5", "--seeds 1-20", "a -12 b")),
        *((same, same) for same in ("12 models", "5 sets", "3 hours")),
    ],
)
def test_numbers_have_minus_signs_and_keep_their_units(text, set_so):
    assert myst.numbers(text) == set_so


# --- tables ----------------------------------------------------------------------------------
#
# How DataFrames are shown: rounded by their sigma, text as it is, the same in Jupyter and book.


INDEX = pd.MultiIndex.from_tuples(
    [("f", "mm"), ("k1", "mm⁻²"), ("lever x", "m"), ("boresight ω", "°")],
    names=["parameter", "unit"],
)


def estimates(value, sigma):
    return pd.DataFrame({"value": value, "sigma": sigma}, index=INDEX)


def tables_rows(table):
    lines = markdown(table).replace("\N{NO-BREAK SPACE}", " ").split("\n")
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]


def test_a_value_has_two_digits_of_its_sigma_in_one_column():
    table = estimates([74.440613, -1.2345e-7, -0.2, 90.0], [0.00031, 2e-9, 0.012, 0.0004])
    head, _, *body = tables_rows(table)
    assert head == ["Parameter", "value ± σ"]
    assert body[0] == ["$f$ (mm)", "74.44061 ± 0.00031"]
    assert body[1] == ["$k_1$ (mm⁻²)", "−1.23·10⁻⁷ ± 2.0·10⁻⁹"]
    assert body[2][1] == "−0.200 ± 0.012"


def test_what_was_held_and_what_is_left_open_is_said():
    table = estimates([74.5, 0.0, -0.2, np.nan], [np.nan, np.nan, np.inf, 0.1])
    assert [row[1] for row in tables_rows(table)[2:]] == [
        "74.5 (held)",
        "held",
        "not determined",
        "–",
    ]


def test_tables_side_by_side_have_one_column_a_method_and_the_print_as_printed():
    one = estimates([74.4, 0.0, 0.1, 90.0], [0.1, np.nan, 0.01, 0.1])
    paper = pd.DataFrame({("paper", "printed"): ["74.4376", "ND", "", "x"]}, index=INDEX)
    head, _, first, *_ = tables_rows(
        pd.concat({"two-step": one, "single": one}, axis=1).join(paper)
    )
    assert head == ["Parameter", "two-step", "single", "paper"]
    assert first == ["$f$ (mm)", "74.40 ± 0.10", "74.40 ± 0.10", "74.4376"]


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ([0.98765, 1.00212], ["0.988", "1.002"]),
        ([1200.04, 350.5], ["1200", "350"]),
        ([1e-7, 3.0], ["1.00·10⁻⁷", "3"]),
        ([-0.25, np.nan], ["−0.2500", "–"]),
        ([0.0, 0.0], ["0", "0"]),
    ],
)
def test_a_column_has_common_decimals_unless_its_numbers_differ_much(values, texts):
    assert [row[0] for row in tables_rows(pd.DataFrame({"x": values}))[2:]] == texts


def test_text_of_a_flight_is_shown_character_for_character():
    table = pd.DataFrame({"point": ["*K|1*", "<b>"], "note": [Markup("$k_1$"), Markup("**x**")]})
    text = markdown(table)
    assert "*K" not in text
    assert "<b>" not in text
    assert "$k_1$" in text
    shell = SimpleNamespace(display_formatter=DisplayFormatter())
    tables.register(shell)
    shown = shell.display_formatter.format(table)[0]["text/html"]
    assert "&lt;b&gt;" in shown
    assert "<b>x</b>" in shown
    assert "*K|1*" in shown


# --- Standard deviations over the format are drawn where they are, in centimetres


def test_panels_have_plan_height_and_the_calibrations_part():
    """Variances of 1, 4 and 9 cm^2 of image points, and 16 cm^2 of the interior in height."""
    variance = np.zeros((4, 3, len(SOURCES)))
    variance[:, :, SOURCES.index("image points")] = np.array([1.0, 4.0, 9.0]) * 1e-4
    variance[:, 2, SOURCES.index("interior orientation")] = 16e-4
    variance[3] = np.nan
    col, row = np.meshgrid([0.0, 99.0], [0.0, 199.0])
    shown = Format(colrow=np.stack([col, row], axis=-1), budget=Budget(variance=variance))
    axes = panels(drawn(sigma_figure(shown)))[:3]
    for ax, cm in zip(axes, (np.sqrt(5.0), 5.0, 4.0), strict=True):
        image = np.ma.filled(ax.images[0].get_array(), np.nan)
        np.testing.assert_allclose(image.ravel(), [cm, cm, cm, np.nan])
        assert ax.get_ylim() == (199.0, 0.0)
    assert [ax.get_title(loc="left") for ax in axes] == ["plan", "height", "height, calibration"]


# --- tables show values to the digits that their standard deviations support -----------------


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (74.44038, 0.00104, "74.4404 ± 0.0010"),
        (-0.3987, 0.0262, "-0.399 ± 0.026"),
        (2.42e-7, 2.04e-8, "2.42·10⁻⁷ ± 2.0·10⁻⁸"),
        (12.3, 45.0, "12 ± 45"),
        (-0.001, 0.10, "0.00 ± 0.10"),
        (74.0, 0.0, "74"),
        (np.nan, 1.0, ""),
    ],
)
def test_a_value_is_rounded_to_two_digits_of_its_sigma(value, sigma, text):
    assert myst.value_and_sigma(value, sigma) == text


# --- sentences of notebooks: templates with numbers, in which text of a flight stays text ----


def test_a_sentence_has_the_numbers_in_the_formats_that_it_asks_for():
    text = say("$f$ is {{ f | fixed(3) }} mm, {{ d | signed(1) }}", f=74.44061, d=[-0.25, 2])
    assert str(text) == "$f$ is 74.441 mm, −0.2, +2.0"


def test_names_of_a_flight_are_no_markdown():
    assert "*" not in str(say("{{ name }}", name="*K1*"))


def test_a_name_without_a_value_is_an_error():
    with pytest.raises(jinja2.UndefinedError, match="'m' is undefined"):
        say("{{ m }}", n=1)
