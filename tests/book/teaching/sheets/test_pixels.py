"""By hand, from the numbers in the tables."""

import math

import pytest

from acx4book.teaching import flights, grading
from acx4book.teaching.sheets.every import SHEETS


@pytest.fixture(scope="module")
def by_hand(key):
    """Return what a student reads: column, row, heights."""
    flight = flights.flight_of(SHEETS["lab-1"], "Ada", key)
    points = flight.tables["calibration/image_points.csv"]
    control = flight.tables["control_points.csv"].set_index("point")
    row = points[points["point"].isin(control.index)].iloc[0]
    over = flight.tables["calibration/trajectory.csv"].set_index("exposure")["height_m"]
    ground = control.loc[row["point"], "height_m"]
    return row["col_px"], row["row_px"], over[row["image"]], ground


def test_the_right_answers_are_the_textbooks_formulas(by_hand, solved):
    column, row, over, ground = by_hand
    _, right = solved("lab-1", "Ada")
    x, y = 0.0046 * (column - 11607 / 2), 0.0046 * (8707 / 2 - row)
    expected = {
        "x_mm": x,
        "y_mm": y,
        "off_axis_deg": math.degrees(math.atan(math.hypot(x, y) / 50)),
        "height_above_ground_m": over - ground,
        "scale_number": (over - ground) / 0.050,
        "gsd_m": 4.6e-6 * (over - ground) / 0.050,
        "sigma_ground_m": 0.4 * 4.6e-6 * (over - ground) / 0.050,
    }
    assert {name: answer.value for name, answer in right.items()} == pytest.approx(expected)


def test_mistakes_made_by_hand_are_named(by_hand, solved, handed):
    column, row, over, _ = by_hand
    case, right = solved("lab-1", "Ada")
    for wrong, says in (
        ({"x_mm": 0.0046 * (column - 5804), "y_mm": 0.0046 * (4354 - row)}, "half a pixel"),
        ({"x_mm": 0.0046 * (4353.5 - row), "y_mm": 0.0046 * (column - 5803.5)}, "swapped"),
        ({"x_mm": column - 5803.5, "y_mm": 4353.5 - row}, "in pixels"),
        ({"y_mm": 0.0046 * (row - 4353.5)}, "rows count downwards"),
        ({"height_above_ground_m": over, "scale_number": over / 0.05}, "ground's height"),
    ):
        verdicts = grading.graded(SHEETS["lab-1"], case, handed("lab-1", right, **wrong))
        for verdict in verdicts:
            assert (says in verdict.says) == (verdict.question.name in wrong)
