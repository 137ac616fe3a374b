"""How DataFrames are shown: rounded by their sigma, text as it is, the same in Jupyter and book."""

import numpy as np
import pandas as pd
import pytest

from acx4book.typesetting.plain_text import Markup
from acx4book.typesetting.tables import html, markdown

INDEX = pd.MultiIndex.from_tuples(
    [("f", "mm"), ("k1", "mm⁻²"), ("lever x", "m"), ("boresight ω", "°")],
    names=["parameter", "unit"],
)


def estimates(value, sigma):
    return pd.DataFrame({"value": value, "sigma": sigma}, index=INDEX)


def rows(table):
    lines = markdown(table).replace("\N{NO-BREAK SPACE}", " ").split("\n")
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]


def test_a_value_has_two_digits_of_its_sigma_in_one_column():
    table = estimates([74.440613, -1.2345e-7, -0.2, 90.0], [0.00031, 2e-9, 0.012, 0.0004])
    head, _, *body = rows(table)
    assert head == ["Parameter", "value ± σ"]
    assert body[0] == ["$f$ (mm)", "74.44061 ± 0.00031"]
    assert body[1] == ["$k_1$ (mm⁻²)", "−1.23·10⁻⁷ ± 2.0·10⁻⁹"]
    assert body[2][1] == "−0.200 ± 0.012"


def test_what_was_held_and_what_is_left_open_is_said():
    table = estimates([74.5, 0.0, -0.2, np.nan], [np.nan, np.nan, np.inf, 0.1])
    assert [row[1] for row in rows(table)[2:]] == ["74.5 (held)", "held", "not determined", "–"]


def test_tables_side_by_side_have_one_column_a_method_and_the_print_as_printed():
    one = estimates([74.4, 0.0, 0.1, 90.0], [0.1, np.nan, 0.01, 0.1])
    paper = pd.DataFrame({("paper", "printed"): ["74.4376", "ND", "", "x"]}, index=INDEX)
    head, _, first, *_ = rows(pd.concat({"two-step": one, "single": one}, axis=1).join(paper))
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
    assert [row[0] for row in rows(pd.DataFrame({"x": values}))[2:]] == texts


def test_formats_are_asked_for_by_column():
    table = pd.DataFrame({"p": [0.12345], "n": [3]})
    table.attrs["formats"] = {"p": ".2f"}
    assert rows(table)[2] == ["0.12", "3"]


def test_text_of_a_flight_is_shown_character_for_character():
    table = pd.DataFrame({"point": ["*K|1*", "<b>"], "note": [Markup("$k_1$"), Markup("**x**")]})
    text = markdown(table)
    assert "*K" not in text
    assert "<b>" not in text
    assert "$k_1$" in text
    shown = html(table)
    assert "&lt;b&gt;" in shown
    assert "<b>x</b>" in shown
    assert "*K|1*" in shown


def test_the_counting_of_rows_is_not_shown():
    table = pd.DataFrame({"x": [1, 2]})
    assert rows(table)[0] == ["x"]
    assert rows(table.iloc[[1]])[0] == ["x"]
