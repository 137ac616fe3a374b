"""The transcription of the paper: complete, and equal to what is printed."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.paper import printed

TABLES = (1, 2, 3, 4)
NUMBER = r"(-?\d*\.?\d+(?:E[+-]\d+)?)(?:\^(-?)(\d+))?"


def printed_numbers(text: str) -> list[float]:
    """Read a printed cell anew: mantissa^exponent, the exponent's minus sign restored."""
    found = re.findall(NUMBER, re.sub(r"\s*[\[x].*", "", text))
    return [float(f"{mantissa}e-{power}" if power else mantissa) for mantissa, _, power in found]


@pytest.mark.parametrize("number", TABLES)
def test_values_are_what_is_printed(number):
    rows = printed.table(number)
    rows = rows[~rows["note"].str.contains("in brackets")]
    for row in rows.itertuples():
        expected = [] if row.as_printed == "ND" else printed_numbers(row.as_printed)
        got = [x for x in (row.value, row.sigma) if not np.isnan(x)]
        assert got == pytest.approx(expected, rel=1e-12), row


def test_numbers_in_brackets_are_what_is_printed():
    rows = printed.table(4)
    rows = rows[rows["note"].str.contains("in brackets")]
    assert len(rows) == 2 * 6
    for row in rows.itertuples():
        assert float(re.search(r"\[([\d.]+)", row.as_printed)[1]) == row.value


@pytest.mark.parametrize(
    ("number", "columns", "rows"),
    [(1, printed.HEADS, 15), (2, ("SYN",), 6), (3, printed.METHODS, 15), (4, printed.METHODS, 12)],
)
def test_every_printed_row_has_every_column(number, columns, rows):
    table = printed.table(number)
    assert set(table["table"]) == {number}
    assert table["row"].nunique() == rows
    assert not table.duplicated(["parameter", "column"]).any()
    assert (table.groupby("parameter")["column"].apply(tuple) == columns).all()


def test_single_values():
    assert printed.value(1, "kappa_deg", "CAM2") == -93.408507
    assert printed.value(1, "xp_mm", "CAM3") == 0.2619
    assert printed.printed(1, "xp_mm", "CAM3").startswith(".2619")
    assert (printed.value(3, "k3", "single_step"), printed.sigma(3, "k3", "single_step")) == (
        2.06e-14,
        3.19e-15,
    )
    assert np.isnan(printed.value(3, "lever_x_m", "two_step"))
    assert printed.sigma(4, "mean_height_m", "single_step") == 0.52


def test_statements_are_their_print_in_other_units():
    """Every statement's number stands in its print, apart from the unit."""
    words = {"One": 1, "Two": 2, "Three": 3, "three": 3, "four": 4, "twenty": 20, "same": 1}
    words |= {"1/2": 0.5, "I": 1}
    for row in printed.statements().itertuples():
        numbers = [float(n) for n in re.findall(r"\d*\.?\d+", row.as_printed)]
        numbers += [words[w] for w in re.findall(r"[\w/]+", row.as_printed) if w in words]
        scales = {"m": (1, 0.01), "1": (1, 0.01)}.get(row.unit, (1,))
        assert any(np.isclose(n * s, row.value) for n in numbers for s in scales), row


def test_interior_orientation_takes_undetermined_coefficients_as_zero():
    head, synthetic = printed.interior(1, "CAM4"), printed.interior(3, "two_step")
    assert (head.f, head.xp, head.k1, head.k2, head.p2) == (74.0, -0.1785, 2.15e-6, 0.0, 2.4e-6)
    assert (synthetic.f, synthetic.k3, synthetic.p1) == (74.4511, 2.28e-14, 1.73e-6)


def test_formats():
    """Table 2's size in mm follows from its pixels, and a head is 53.9 x 40.4 mm."""
    assert_allclose(printed.corners("SYN")[0], [67.20 / 2, 90.72 / 2], atol=1e-9)
    assert_allclose(printed.corners("CAM1")[2], [-26.952, -20.196], atol=1e-9)


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        ((3, "f_mm", "two_step"), "74.4511 ± 0.0007"),
        ((3, "f_mm", "single_step"), "74.4404 ± 0.0010"),
        ((3, "k2", "single_step"), "-9.30·10⁻¹¹ ± 1.47·10⁻¹¹"),
        ((3, "sigma0_squared", "two_step"), "1.070"),
        ((3, "lever_x_m", "two_step"), "ND"),
        ((1, "xp_mm", "CAM3"), "0.2619 ± 0.0032"),
        ((1, "omega_deg", "CAM3"), "14.689320"),
        ((4, "within_3_gsd_percent", "two_step"), "38.89"),
    ],
)
def test_a_number_is_shown_to_the_digits_of_the_print(cell, shown):
    assert printed.shown(*cell) == shown


# --- Every printed number has one of four roles, and pages say how many have which


@pytest.fixture(scope="module")
def numbers():
    """Return every printed number of the tables with its role."""
    rows = []
    for number in (1, 2, 3, 4):
        for row in printed.table(number).itertuples():
            said = ((row.parameter, row.value, row.role), ("sigma", row.sigma, row.sigma_role))
            for what, value, role in said:
                if np.isfinite(value):
                    rows.append((number, row.parameter, what, row.column, role))
                else:
                    assert role == "", row
    return pd.DataFrame(rows, columns=["table", "parameter", "what", "column", "role"])


def test_each_of_the_172_numbers_has_one_of_five_roles(numbers):
    assert len(numbers) == 172
    assert set(numbers["role"]) == set(printed.ROLES)


def test_22_sigmas_of_table_3_were_chosen_for(numbers):
    """Those of the two-step boresight were not: they are scatters, and do not agree."""
    sigmas = numbers[(numbers["table"] == 3) & (numbers["what"] == "sigma")]
    assert (sigmas["role"] == "chosen").sum() == 22
    others = sigmas[sigmas["role"] != "chosen"]
    assert set(others["role"]) == {"independent"}
    assert set(others["parameter"]) == {f"boresight_{a}_deg" for a in ("omega", "phi", "kappa")}
    assert set(others["column"]) == {"two_step"}


def test_single_step_is_given_and_three_two_step_values_follow_from_it_by_a_reading(numbers):
    values = numbers[(numbers["table"] == 3) & (numbers["what"] != "sigma")]
    values = values[values["parameter"] != "sigma0_squared"].set_index("column")
    assert set(values.loc["single_step", "role"]) == {"given"}
    two = values.loc["two_step"].set_index("parameter")["role"]
    assert {*two[two == printed.GIVEN_READING].index} == {*printed.STRONG}
    assert "independent" not in {*two}
