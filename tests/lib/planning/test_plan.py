"""A plan with other strips and other control points, and a strip by the number of its images."""

import pytest

from acx4lib.errors import FlightError
from acx4lib.planning import design, ground, text
from acx4lib.planning.exposures import flying_time_s
from acx4lib.planning.plan import strip_of
from support.flights.planned import values


@pytest.fixture(scope="module")
def plan():
    return text.from_values(values())


def test_an_image_has_four_fifths_of_the_next(plan):
    camera = plan.cameras("calibration")[0]
    one = strip_of(camera, 600.0, 400.0, images=7, overlap=0.8)
    along_mm = 0.0046 * 8708  # the camera is turned by 90 degrees: its height flies forward
    assert one.base_m == pytest.approx(0.2 * along_mm * 600.0 / 50.0, rel=1e-9)
    assert (one.n_exposures, one.course_deg) == (7, 40.0)
    assert flying_time_s((one,)) == pytest.approx(6 * one.base_m / 70)
    with pytest.raises(ValueError, match="images"):
        strip_of(camera, 600.0, 0.0, images=0)


def test_a_plan_flies_other_strips_in_their_order(plan):
    camera = plan.cameras("calibration")[0]
    low, high = (strip_of(camera, height_m, 0.0, images=3) for height_m in (600.0, 900.0))
    other = plan.with_strips([high, low, high])
    assert [*other.blocks["calibration"].strips.items()] == [("1", high), ("2", low), ("3", high)]
    named = plan.with_strips({"north": low})
    assert [*named.blocks["calibration"].strips] == ["north"]
    with pytest.raises(ValueError, match="block"):
        plan.with_strips([low], block="none")


def test_what_a_changed_plan_says_of_itself_is_the_same_plan(plan):
    camera = plan.cameras("calibration")[0]
    strips = [strip_of(camera, height_m, 90.0, images=5) for height_m in (600.0, 900.0)]
    changed = plan.with_strips(strips).with_control(3, (400.0, 300.0))
    again = text.from_values(changed.values)
    assert again.blocks["calibration"].strips == changed.blocks["calibration"].strips
    assert again.control == changed.control
    assert again.blocks["calibration"].points == changed.blocks["calibration"].points


def test_control_points_are_corners_first(plan):
    places = ground.places(plan.with_control(5, (400.0, 300.0)).control)
    assert abs(places[:4]).tolist() == 4 * [[200.0, 150.0]]
    assert places[4].tolist() == [0.0, 0.0]
    assert len(ground.places(plan.with_control(0).control)) == 0
    with pytest.raises(ValueError, match="number"):
        plan.with_control(10)


def test_sigmas_are_those_of_the_design(plan):
    (mounting,) = design.of(plan).mountings.values()
    found = design.sigmas(plan)
    assert found.tolist() == mounting.table()["sigma"].tolist()
    assert found.index[0] == "f_mm"


def test_sigmas_need_a_calibration_block(plan):
    only = {name: block for name, block in plan.blocks.items() if name == "validation"}
    with pytest.raises(FlightError, match="without block calibration"):
        design.sigmas(type(plan)(**{**vars(plan), "blocks": only}))
