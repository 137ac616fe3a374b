"""Plans, and the blocks that are flown by them."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from acx4book.planning import flown
from acx4book.planning import plan as plans
from acx4book.planning.flown import flying_time_s
from acx4book.planning.plan import Area, Points, Strip, strip_of
from acx4lib.errors import FlightError
from acx4sim import earth
from acx4sim.fly import fly
from support.flights.planned import values
from support.helpers import ROOT


@pytest.fixture(scope="module")
def plan():
    return plans.from_values(values())


def test_an_image_has_four_fifths_of_the_next(plan):
    camera = plan.cameras("calibration")[0]
    one = strip_of(camera, 600.0, 400.0, images=7, overlap=0.8)
    along_mm = 0.0046 * 8708  # the camera is turned by 90 degrees: its height flies forward
    assert one.base_m == pytest.approx(0.2 * along_mm * 600.0 / 50.0, rel=1e-9)
    assert (one.n_exposures, one.course_deg) == (7, 40.0)
    assert flying_time_s((one,)) == pytest.approx(6 * one.base_m / 70)


# --- Plans from TOML: what is read, what is wrong and where, what is written


PLAN = plans.written(values())


def problems(written, tmp_path):
    """Return the problems of a plan's text, without the path."""
    path = tmp_path / "p.toml"
    path.write_text(written)
    with pytest.raises(FlightError) as error:
        plans.read(path)
    return [line.removeprefix(str(path)) for line in error.value.problems]


def test_what_is_written_is_read_again(tmp_path):
    (tmp_path / "p.toml").write_text(PLAN)
    read, made = plans.read(tmp_path / "p.toml"), plans.from_values(values())
    assert read.values == made.values
    assert read.setup.apriori == made.setup.apriori
    assert read.blocks["calibration"].strips == made.blocks["calibration"].strips
    assert plans.written(read.values) == PLAN


def test_an_overlap_becomes_a_base_by_the_side_of_the_image_along_the_flight():
    # turned by 90 degrees: the short side, 8708 px of 4.6 um, lies along the flight
    strip = {"flying_height_m": 500.0, "course_deg": 0.0, "length_m": 300.0, "overlap": 0.75}
    plan = plans.from_values(values(calibration={"strips": {"s": strip}, "tie_points": 0}))
    base = plan.blocks["calibration"].strips["s"].base_m
    assert base == pytest.approx(0.25 * 8708 * 0.0046 * 500 / 50)


def test_parallel_strips_lie_beside_each_other_and_are_flown_to_and_fro():
    strip = {
        "flying_height_m": 500.0,
        "course_deg": 90.0,
        "length_m": 300.0,
        "base_m": 100.0,
        "parallel": 3,
        "side_overlap": 0.5,
    }
    plan = plans.from_values(values(calibration={"strips": {"s": strip}, "tie_points": 0}))
    strips = plan.blocks["calibration"].strips
    assert [*strips] == ["s-1", "s-2", "s-3"]
    assert [s.course_deg for s in strips.values()] == [90.0, 270.0, 90.0]
    # to the left of a course to the east is north, the axis forward
    apart = 0.5 * 11608 * 0.0046 * 500 / 50
    assert [s.forward_m for s in strips.values()] == pytest.approx([apart, 0.0, -apart])
    assert [s.left_m for s in strips.values()] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def changed(old, new):
    assert PLAN.count(old) == 1
    return PLAN.replace(old, new)


LOW = PLAN.splitlines().index("[calibration.strips]") + 2
"""Line of the first strip."""

FIELD = PLAN.splitlines().index("[field]") + 1

WRONG = {
    "a misspelt table": (
        changed("[field]", "[feild]"),
        [
            ":1: field: missing; required",
            f":{FIELD}: feild: unknown key (did you mean 'field'?); must be one of name,",
        ],
    ),
    "a number that is text": (
        changed("east_m = 385000.0", 'east_m = "385000"'),
        [": field.east_m: '385000'; must be a number"],
    ),
    "a height beyond all aircraft": (
        changed("low-1 = {flying_height_m = 600.0", "low-1 = {flying_height_m = 60000.0"),
        [
            f":{LOW}: calibration.strips.low-1.flying_height_m: 60000.0; "
            "must lie between 1 and 30000"
        ],
    ),
    "a strip without a base": (
        changed(
            "low-1 = {flying_height_m = 600.0,", "low-1 = {overlap = 0.8, flying_height_m = 1,"
        ),
        [f":{LOW}: calibration.strips.low-1: both base_m and overlap; needs one of the two"],
    ),
    "an unknown key of a strip": (
        changed("low-1 = {flying_height_m", "low-1 = {height = 3, flying_height_m"),
        [f":{LOW}: calibration.strips.low-1.height: unknown key"],
    ),
    "a strip that is no table": (
        changed("[calibration.strips]\n", "[calibration.strips]\nx = 3\n"),
        [f":{LOW}: calibration.strips.x: 3; must be a table, as {{flying_height_m = 600"],
    ),
    "a field where there is no map": (
        changed("east_m = 385000.0", "east_m = 99999999.0"),
        [f":{FIELD + 1}: field.east_m: 1e+08 east, 5.518e+06 north; must lie where EPSG:32633"],
    ),
    "a layout that is unknown": (
        changed("number = [3, 3]", 'layout = "grdi"\nnumber = [3, 3]'),
        [": control.layout: 'grdi' (did you mean 'grid'?); must be one of grid, corners"],
    ),
    "a grid with one number": (
        changed("number = [3, 3]", "number = 9"),
        [": control.number: 9; must be a list of 2 numbers"],
    ),
    "a camera's mistake": (
        changed("pixel_um = 4.6", "pixel_um = 0.0046"),
        [": cameras.CAM.pixel_um: 0.0046 (millimetres or metres?); must lie between"],
    ),
    "no block": (
        PLAN[: PLAN.index("[calibration]")],
        [":1: calibration: no block at all; needs one of heads, calibration, validation"],
    ),
    "a truth that is no camera's": (
        PLAN + "\n[truth.OTHER]\nfocal_mm = 3.0\n",
        [": truth.OTHER: unknown key; must be one of CAM"],
    ),
    "a truth outside its range": (
        PLAN + "\n[truth.CAM]\nfocal_mm = 0.05\n",
        [": truth.CAM.focal_mm: 0.05 (metres?); must lie between 1 and 10000"],
    ),
    "no TOML": (changed("[field]", "[field"), [": character"]),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_named_with_line_key_and_cure(name, tmp_path):
    written, expected = WRONG[name]
    found = problems(written, tmp_path)
    assert len(found) == len(expected)
    for line, part in zip(sorted(found, key=lambda p: part_of(p, expected)), expected, strict=True):
        assert part in line


def part_of(line, expected):
    return next((i for i, part in enumerate(expected) if part in line), len(expected))


def test_a_validation_needs_check_points_and_heads_need_more_than_one_camera():
    strips = values()["calibration"]["strips"]
    with pytest.raises(FlightError, match=r"validation\.check: missing"):
        plans.from_values(values(validation={"strips": strips}))
    with pytest.raises(FlightError, match="heads: one camera; heads are several"):
        plans.from_values(values(heads={"strips": strips}))


def test_the_plans_in_the_book_can_be_read(tmp_path):
    page = (ROOT / "book" / "planning.md").read_text("utf-8")
    shown = [
        part for part in re.findall(r"```toml\n(.*?)```", page, re.DOTALL) if "[field]" in part
    ]
    for part in shown:
        (tmp_path / "p.toml").write_text(part)
        assert "calibration" in plans.read(tmp_path / "p.toml").blocks
    plan = plans.from_values(tomllib.loads(shown[0]))
    assert [*plan.blocks["calibration"].strips] == ["low-1", "low-2", "high", "back"]


def test_a_middle_in_degrees_is_named(tmp_path):
    field = {"east_m": 13.4, "north_m": 49.8, "height_m": 430.0, "relief_m": 20.0}
    (line,) = problems(plans.written(values(field=field)), tmp_path)
    assert re.fullmatch(
        r":\d+: field.east_m: 13.4 east, 49.8 north \(longitude, latitude in degrees\?\); "
        r"must be metres where EPSG:32633 is meant for",
        line,
    )


# --- The ground of a plan: layouts of points


def places(layout, number, **other):
    return plans.places(Points(layout=layout, number=number, area_m=(400.0, 200.0), **other))


def test_a_grid_has_rows_along_and_columns_across():
    at = places("grid", (3, 2))
    assert sorted(set(at[:, 0])) == [-200.0, 0.0, 200.0]
    assert sorted(set(at[:, 1])) == [-100.0, 100.0]
    assert len(at) == 6
    np.testing.assert_array_equal(places("grid", (1, 1)), [[0.0, 0.0]])


def test_corners_come_by_diagonals_before_the_middle():
    at = places("corners", (5,))
    np.testing.assert_array_equal(np.abs(at[:4]), [[200.0, 100.0]] * 4)
    np.testing.assert_array_equal(at[0] + at[1], [0.0, 0.0])
    np.testing.assert_array_equal(at[4], [0.0, 0.0])


def test_forward_is_along_the_course_and_left_is_left_of_it():
    area = Area(east_m=100.0, north_m=200.0, course_deg=90.0)
    at = plans.on_map(area, np.array([[10.0, 0.0], [0.0, 10.0]]))
    np.testing.assert_allclose(at, [[110.0, 200.0], [100.0, 210.0]], atol=1e-9)


def test_the_relief_is_the_root_mean_square_of_the_hills():
    lon_lat = np.random.default_rng(1).uniform((13.0, 49.0), (15.0, 51.0), (20000, 2))
    llh = np.column_stack([np.radians(lon_lat)[:, ::-1], np.zeros(20000)])
    above = earth.terrain_height(llh, 430.0, relief=40.0 / earth.RELIEF_M) - 430.0
    assert np.sqrt(np.mean(above**2)) == pytest.approx(40.0, rel=0.02)


# --- Where, when and in which attitude a plan is exposed


STRIP = Strip(flying_height_m=500.0, course_deg=30.0, length_m=900.0, base_m=100.0)


def exposed(*strips):
    """Return places, attitudes and times of the exposures in the even wind."""
    whole = plans.from_values(values(field={"course_deg": 30.0}))
    planned = flown.simulated(whole.with_strips(strips), {}, wind=0)
    track = fly(planned, planned.blocks["calibration"], None)
    rph_deg = np.degrees(earth.rph_from_attitude(track.R_enu_b))
    return track.places, rph_deg, track.time_s - flown.START_S["calibration"]


def test_exposures_lie_on_their_line_but_for_the_scatter():
    places, _, _ = exposed(STRIP, replace(STRIP, course_deg=210.0, left_m=80.0))
    along = np.linspace(-450.0, 450.0, 10)
    planned = [np.r_[along, -along], np.repeat([0.0, 80.0], 10), np.full(20, 500.0)]
    assert np.all(np.abs(places - np.column_stack(planned)) <= [12.0, 16.0, 10.0])


def test_the_aircraft_is_as_unsteady_as_it_says_and_the_same_in_every_run():
    (_, rph_deg, _), (_, again, _) = (exposed(replace(STRIP, length_m=40_000.0)) for _ in range(2))
    np.testing.assert_array_equal(rph_deg, again)
    motion = rph_deg - [0.0, 0.0, rph_deg[:, 2].mean()]
    # clipped at two standard deviations, a normal distribution has 0.96 of its own
    np.testing.assert_allclose(motion.std(axis=0), 0.96 * np.array([1.1, 0.9, 0.8]), rtol=0.06)
    assert np.abs(motion[:, :2].mean(axis=0)).max() < 0.05
    related = np.corrcoef(motion.T)
    assert np.abs(related - np.eye(3)).max() < 0.15
    assert abs(rph_deg[:, 2].mean() - 30.0) <= 4.0 + 1.5  # crab, and the convergence of the grid


def test_time_goes_on_by_base_over_speed_and_four_minutes_for_a_turn():
    fast = replace(STRIP, speed_m_s=50.0)
    places, _, time_s = exposed(STRIP, fast)
    # an exposure is late by as much as it is ahead: along its line the speed is constant
    ahead = places[:, 0] - np.tile(np.linspace(-450.0, 450.0, 10), 2)
    planned = time_s - ahead / np.repeat([70.0, 50.0], 10)
    np.testing.assert_allclose(np.diff(planned)[:9], 100 / 70)
    assert planned[10] - planned[9] == pytest.approx(240.0)
    assert planned[11] - planned[10] == pytest.approx(2.0)
    assert flying_time_s((STRIP, fast)) == pytest.approx(planned[-1])
    assert flying_time_s(()) == 0.0
