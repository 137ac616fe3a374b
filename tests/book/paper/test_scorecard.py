"""The verdicts follow the rule that stands above them."""

import numpy as np
import pandas as pd
import pytest

from acx4book.paper import printed, scorecard
from acx4book.paper.printed import ROLES
from acx4book.paper.scorecard import Ours


@pytest.mark.parametrize(
    ("text", "number", "half"),
    [
        ("74.4404 ± 0.0010", 74.4404, 0.00005),
        ("74.4404 ± 0.0010", 0.0010, 0.00005),
        ("2.42^07 ± 2.05^08", 2.42e-7, 0.5e-9),
        ("2.42^07 ± 2.05^08", 2.05e-8, 0.5e-10),
        ("2.75E-03", 2.75e-3, 0.5e-5),
        ("0.44 [4.4 pixels]", 0.44, 0.005),
        ("0.44 [4.4 pixels]", 4.4, 0.05),
        ("262", 262.0, 0.5),
    ],
)
def test_rounding_of_the_print_is_half_a_unit_of_its_last_digit(text, number, half):
    """An error that is uniform over a unit has a standard deviation of half of it over √3."""
    cell = scorecard.Printed(
        **dict.fromkeys(("parameter", "column", "role", "sigma_role", "unit"), ""),
        table=3,
        value=number,
        sigma=np.nan,
        as_printed=text,
    )
    row = scorecard.line(cell, "value", Ours(value=number + half, sigma=0.0))
    assert row["deviation"] == pytest.approx(np.sqrt(3))


@pytest.mark.parametrize(
    ("off", "verdict"), [(0.0, "agrees"), (1.9, "agrees"), (2.5, "near"), (3.1, "differs")]
)
def test_a_verdict_counts_combined_standard_deviations(off, verdict):
    f = next(
        scorecard.as_printed_row(row)
        for row in printed.table(3).to_dict("records")
        if row["parameter"] == "f_mm" and row["column"] == "single_step"
    )
    ours_sigma = 0.002
    combined = np.sqrt(ours_sigma**2 + 0.0010**2 + 0.00005**2 / 3)
    ours = Ours(value=74.4404 + off * combined, sigma=ours_sigma)
    row = scorecard.line(f, "value", ours)
    assert row["verdict"] == verdict
    assert row["deviation"] == pytest.approx(off, abs=1e-9)
    assert bool(row["reason"]) == (verdict != "agrees")


def test_a_printed_mean_is_less_sure_where_points_share_errors():
    """What is printed beside a mean is the scatter of 36 points; theirs is not independent."""
    mean = next(
        scorecard.as_printed_row(row)
        for row in printed.table(4).to_dict("records")
        if row["parameter"] == "mean_height_m" and row["column"] == "single_step"
    )
    paper_sigma = 1.5 * mean.sigma / 6
    off = 2.5 * np.sqrt(0.05**2 + paper_sigma**2 + 0.005**2 / 3)
    row = scorecard.line(mean, "value", Ours(value=mean.value + off, sigma=0.05, sharing=1.5))
    assert row["deviation"] == pytest.approx(2.5)
    assert row["verdict"] == "near"


def test_counts_are_those_of_the_card():
    card = pd.DataFrame(
        {
            "table": [1, 1, 1, 3],
            "role": ["given", "given", "independent", "independent"],
            "verdict": ["agrees", "differs", "near", "agrees"],
        }
    )
    table = scorecard.counts(card).set_index("role")
    assert [*table.index] == [*ROLES]
    given = table.loc["given"]
    assert (given["paper's Table 1"], given["paper's Table 3"], given["numbers"]) == (2, 0, 2)
    assert (given["agrees"], given["near"], given["differs"]) == (1, 0, 1)
    assert table["numbers"].sum() == 4


# --- The scorecard of an ideal camera, with the closed chain beside


def card(*rows):
    return pd.DataFrame(rows, columns=["table", "quantity", "column", "ours", "verdict"])


CHAIN = card(
    (1, "k1", "CAM1", 1.0, "agrees"),
    (3, "f_mm", "single_step", 3.0, "differs"),
    (3, "k1", "two_step", 4.0, "differs"),
)
IDEAL = card((3, "k1", "two_step", 40.0, "near"), (3, "f_mm", "single_step", 30.0, "agrees"))


def test_the_ideal_camera_is_judged_and_the_chain_stands_beside_it():
    both = scorecard.beside_chain(CHAIN, IDEAL)
    assert both["ours"].tolist() == [1.0, 40.0, 30.0]
    assert both["chain"].tolist()[1:] == [4.0, 3.0]
    assert both["verdict"].tolist() == ["agrees", "near", "agrees"]


def test_tables_of_the_heads_have_no_chain_beside_them():
    both = scorecard.beside_chain(CHAIN, IDEAL)
    assert both.loc[both["table"] == 1, "chain"].isna().all()


def test_a_number_that_the_chain_does_not_have_is_missing_and_not_lost():
    both = scorecard.beside_chain(CHAIN.iloc[:2], IDEAL)
    assert len(both) == 3
    assert both.set_index("quantity").loc["k1", "chain"].isna().all()
