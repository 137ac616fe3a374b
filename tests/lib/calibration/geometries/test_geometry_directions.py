"""One flying direction, a single strip, and few courses with a compass that deviates."""

from dataclasses import replace

import numpy as np
import pytest

import acx4sim
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.calibration import mounting, trajectory_errors
from acx4lib.calibration.estimates import not_determined, parameters
from acx4lib.flight import reader
from acx4lib.results import adjustments
from support import blocks

# --- one flying direction and no control points: a lever arm is a shift of the whole ground --


ONE_WAY = ((1000.0, -150.0, 0.0), (1000.0, 150.0, 0.0), (1500.0, -80.0, 0.0), (1500.0, 80.0, 0.0))
BOTH_WAYS = tuple((h, y, way) for (h, y, _), way in zip(ONE_WAY, (0.0, 180.0) * 2, strict=True))


def calibrated(strips, *, with_control=False):
    block = blocks.simulate(
        blocks.fly(strips, per_strip=4),
        ties=blocks.terrain(40, relief_m=5.0),
        control=blocks.crosses() if with_control else None,
    )
    block = blocks.noisy(block, np.random.default_rng(1))
    return mounting.single_step(block, free=("f", "xp", "yp")).calibration


def named(calibration):
    return {line.split()[1] for line in not_determined(calibration)}


@pytest.fixture(scope="module")
def one_way():
    return calibrated(ONE_WAY)


def test_the_lever_arm_is_not_determined(one_way):
    assert named(one_way) == {"lever_x_m", "lever_y_m", "lever_z_m"}


def test_no_pair_of_parameters_gives_it_away(one_way):
    """The twin is the ground, which is no parameter: pairwise correlations stay small."""
    for line in not_determined(one_way):
        largest = float(line.split("correlation ")[1].split()[0])
        assert abs(largest) < 0.9


def test_what_would_help_is_named(one_way):
    for line in not_determined(one_way):
        if "lever_z" not in line:
            assert line.endswith("control points or strips flown in opposite directions")


def test_opposite_directions_leave_only_the_height_open():
    assert named(calibrated(BOTH_WAYS)) == {"lever_z_m"}


def test_control_points_determine_all_of_it():
    assert named(calibrated(ONE_WAY, with_control=True)) == set()


# --- A single strip: as one height and one direction, and the block may roll about the strip -


STRIP = ((1000.0, 0.0, 0.0),)
THERE_AND_BACK = (*STRIP, (1000.0, 0.0, 180.0))
FREE = ("f", "xp", "yp")


def calibrated_single_strip(strips, *, with_control, fix=(), per_strip=6):
    """Flat ground: hills would be a second height."""
    flat = blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M]
    block = blocks.simulate(
        blocks.fly(strips, per_strip=per_strip),
        ties=blocks.terrain(40, relief_m=5.0),
        control=flat if with_control else None,
    )
    block = blocks.noisy(block, np.random.default_rng(1))
    return mounting.single_step(block, free=FREE, fix=fix).calibration


def lines(calibration):
    return {line.split()[1]: line for line in not_determined(calibration)}


@pytest.fixture(scope="module")
def floating():
    return calibrated_single_strip(STRIP, with_control=False)


def test_also_the_boresight_about_the_strip_is_not_determined(floating):
    """With a mount that hardly turns, omega tilts across the strip: ground and block roll."""
    assert set(lines(floating)) == {
        *("f_mm", "xp_mm", "yp_mm"),
        *("lever_x_m", "lever_y_m", "lever_z_m"),
        "boresight_omega_deg",
    }


def test_the_cure_of_the_boresight_is_named(floating):
    line = lines(floating)["boresight_omega_deg"]
    assert line.endswith("it would need: strips flown in opposite directions, and control points")


def test_control_points_or_the_way_back_determine_the_boresight(floating):
    """Either is enough to come below the limit of 0.1 degrees; both are better than one."""
    found = [
        calibrated_single_strip(STRIP, with_control=True),
        calibrated_single_strip(THERE_AND_BACK, with_control=False),
        calibrated_single_strip(THERE_AND_BACK, with_control=True),
    ]
    sigma = [{p.key: p.sigma for p in parameters(c)}["boresight_x"] for c in [floating, *found]]
    assert sigma[0] > 0.1
    assert max(sigma[1:]) < 0.1
    assert sigma[3] < min(sigma[1:3])


def test_one_height_leaves_the_rest_open_whatever_else_there_is():
    assert {"f_mm", "lever_x_m", "lever_y_m", "lever_z_m"} <= set(
        lines(calibrated_single_strip(THERE_AND_BACK, with_control=True))
    )


def test_a_held_lever_arm_and_control_points_make_a_strip_enough():
    assert lines(calibrated_single_strip(STRIP, with_control=True, fix=("lever_arm",))) == {}


# --- A compass that deviates: courses all around tell it, named and estimated; fewer do not --


COMPASS_DEG = (-0.05, 0.06)
"""As B and C; ten times what a single heading of the simulated flights is off by."""

NAMES = ["deviation_sin_deg", "deviation_cos_deg"]
N_FLIGHTS = 6


def flown(folder, seed, **options):
    """The calibration block of the flight of one camera."""
    options = acx4sim.Options(tie_points={"calibration": 60}, blocks=("calibration",), **options)
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=seed, options=options), folder / "flight")
    return reader.read(folder / "flight")


def single(flight, *gnss):
    block, free = flight.blocks["calibration"], flight.estimate_mounting
    return mounting.single_step(block, free=free, gnss=gnss, snooping=False)


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    return [
        flown(tmp_path_factory.mktemp("courses"), seed, compass_deg=COMPASS_DEG)
        for seed in range(1, N_FLIGHTS + 1)
    ]


def test_a_compass_comes_out_within_its_sigma(flights):
    """The chi-square of 12 normalised errors, 99 % two-sided; each sigma far below the error."""
    listed = [
        p
        for flight in flights
        for p in trajectory_errors.parameters(single(flight, "deviation").bundle)
    ]
    assert [p.name for p in listed] == NAMES * N_FLIGHTS
    truth = np.tile(COMPASS_DEG, N_FLIGHTS)
    total = sum(((p.value - true) / p.sigma) ** 2 for p, true in zip(listed, truth, strict=True))
    assert 3.07 < total < 28.3
    assert all(p.sigma < 0.1 for p in listed)


def test_seven_degrees_come_out_to_their_digits(tmp_path):
    """Without noise; the heights of two exposures differ, and so do their verticals."""
    exact = dict.fromkeys(("image_noise", "control_noise", "gnss_noise", "attitude_noise"), 0.0)
    bundle = single(flown(tmp_path, 1, compass_deg=(-5.0, 6.0), **exact), "deviation").bundle
    found = [p.value for p in trajectory_errors.parameters(bundle)]
    np.testing.assert_allclose(found, [-5.0, 6.0], atol=1e-4)  # 1 km over the earth's radius
    line, own = trajectory_errors.notes(bundle)
    assert "-5.000 ± 0.000° times their sine" in line
    assert "by 7.810° at 320°" in line
    assert own.startswith("the deviation of headings is this block's own")


def test_headings_that_differ_by_course_are_named_until_they_are_estimated(flights):
    found = single(flights[0])
    by_course = trajectory_errors.by_course(found.bundle)
    assert by_course.differs
    for one in by_course.courses:
        angle = np.radians(one.course_deg)
        off = COMPASS_DEG @ np.array([np.sin(angle), np.cos(angle)])
        assert one.off_deg == pytest.approx(off, abs=0.02)  # the mean of all is the boresight's
    (entry,) = adjustments.of_mounting(found).summary.values()
    assert any("the deviation of a magnetometer" in note for note in entry["notes"])
    assert not trajectory_errors.by_course(single(flights[0], "deviation").bundle).differs


def test_a_flight_without_a_compass_has_nothing_to_name(tmp_path):
    assert not trajectory_errors.by_course(single(flown(tmp_path, 1)).bundle).differs


# --- fewer courses ---------------------------------------------------------------------------


def over(*azimuths):
    """The adjustment of strips of three exposures at two heights on these courses."""
    strips = tuple((1000.0 + 300.0 * (k % 2), 0.0, a) for k, a in enumerate(azimuths))
    block = blocks.in_strips(
        blocks.simulate(
            blocks.fly(strips, tilt_deg=0.05),
            ties=blocks.terrain(150, half_m=450.0),
            control=blocks.crosses(),
        ),
        3,
    )
    return adjust(mounted_orientation(block, free=("f",), gnss=("deviation",)))


def test_on_one_line_the_part_across_it_is_a_boresight():
    (line,) = not_determined_courses(over(0.0, 180.0))
    assert line.startswith("deviation_cos_deg is not determined")
    assert "strips across the others" in line
    assert not_determined_courses(over(0.0, 90.0, 180.0, 270.0)) == []


def not_determined_courses(bundle):
    """What is not determined by sigma a priori: the measurements are exact."""
    cov = trajectory_errors.reported_covariance(bundle) / bundle.solution.sigma0_sq
    return trajectory_errors.not_determined(bundle, cov)


def test_errors_that_are_declared_as_slow_are_no_courses(flights):
    block = flights[0].blocks["calibration"]
    process = replace(block.trajectory.slow_attitudes, share=0.9, time_constant_s=600.0)
    block = replace(block, trajectory=replace(block.trajectory, slow_attitudes=process))
    bundle = adjust(mounted_orientation(block, free=flights[0].estimate_mounting))
    assert trajectory_errors.by_course(bundle) is None


def test_one_course_alone_is_not_tested():
    assert trajectory_errors.by_course(over(90.0)) is None
