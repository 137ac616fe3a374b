"""The verdicts follow the rule that stands above them."""

import nbformat
import numpy as np
import pandas as pd
import pytest

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.paper import printed, questions, scorecard
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


# --- The paper's four questions: the paper's numbers, and the answers of chapters ------------


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (0, "2.3 to 3.2 µm"),
        (0, "held at 74 mm"),
        (1, "around 3 µm, 0.5 pixel"),
        (2, "$f$ is 74.4511 ± 0.0007 mm and 74.4404 ± 0.0010 mm"),
        (3, "0.43 to 0.46 m by axis"),
        (3, "38.89 % of the points"),
        (3, "1:5000 to 1:2000"),
    ],
)
def test_the_papers_answers_have_its_numbers(number, said):
    assert said in questions.QUESTIONS[number].answered()


def test_the_chapters_of_the_questions_end_with_an_answer():
    for one in questions.QUESTIONS:
        notebook = nbformat.read(NOTEBOOKS_PATH / f"{one.chapter}.ipynb", as_version=4)
        tagged = [questions.TAG in cell.metadata.get("tags", []) for cell in notebook.cells]
        assert sum(tagged) == 1
        assert any(tagged[-3:])  # below it, results are written
