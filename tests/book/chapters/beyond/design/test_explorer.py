import numpy as np
import pytest

from acx4book.chapters.beyond.design import explorer
from acx4book.chapters.beyond.design.plans import papers
from acx4lib.planning.design import sigmas
from acx4lib.planning.plan import strip_of


@pytest.fixture(scope="module")
def plan():
    return papers(gnss=("shift",))


@pytest.fixture(scope="module")
def shown(plan):
    return explorer.explorer(plan)


@pytest.mark.parametrize("values", [(1.5, 180.0, 5.0), (1.25, 90.0, 8.0), (1.0, 0.0, 2.0)])
def test_readings_are_those_of_a_plan_of_these_strips(shown, plan, values):
    ratio, turn, control = values
    camera = plan.cameras("calibration")[0]
    strips = [
        strip_of(camera, height_m, 28.0 + turned, images=5)
        for height_m in (1000.0, 1000.0 * ratio)
        for turned in (0.0, turn)
    ]
    flown = plan.with_strips(strips).with_control(int(control), (1300.0, 1000.0))
    expected = sigmas(flown)
    for row, (name, (_, factor)) in zip(
        shown.readings(values), explorer.SHOWN.items(), strict=True
    ):
        assert float(row[0]) == pytest.approx(factor * expected[name], rel=0.1, abs=0.006)


def test_control_points_that_are_not_surveyed_are_out_of_the_drawing(shown):
    squares = shown.panels[0].marks[2:]
    for control in explorer.CONTROL.stops:
        inside = [np.all(np.abs(m.places([1.5, 0.0, control])) < 400) for m in squares]
        assert inside == [k < control for k in range(len(squares))]


def test_the_second_strip_turns_clockwise(shown):
    """Up is the first course, so a quarter turn flies to the right."""
    turned = shown.panels[0].marks[0].places([1.5, 90.0, 5.0])
    start, end = turned[0], turned[1]
    assert end[0] > start[0] + 50
    assert end[1] == pytest.approx(start[1], abs=1e-6)
