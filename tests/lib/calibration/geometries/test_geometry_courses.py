"""A compass that deviates: courses all around tell it, named and estimated; fewer do not."""

from dataclasses import replace

import numpy as np
import pytest

import acx4sim
from acx4files.flight import reader
from acx4files.results import sentences
from acx4files.stages import diagnosed
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.calibration import mounting, trajectory_errors
from acx4lib.model import Model
from support import blocks

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
    return mounting.single_step(block, Model(free=free, gnss=gnss), snooping=False)


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
    line, own = sentences.on_trajectory(bundle)
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
    (entry,) = diagnosed.of_mounting(found).summary.values()
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
    return adjust(mounted_orientation(block, Model(free=("f",), gnss=("deviation",))))


def test_on_one_line_the_part_across_it_is_a_boresight():
    (line,) = not_determined(over(0.0, 180.0))
    assert line.startswith("deviation_cos_deg is not determined")
    assert "strips across the others" in line
    assert not_determined(over(0.0, 90.0, 180.0, 270.0)) == []


def not_determined(bundle):
    """What is not determined by sigma a priori: the measurements are exact."""
    cov = trajectory_errors.reported_covariance(bundle) / bundle.solution.sigma0_sq
    return sentences.trajectory_not_determined(bundle, cov)


def test_errors_that_are_declared_as_slow_are_no_courses(flights):
    block = flights[0].blocks["calibration"]
    process = replace(block.trajectory.slow_attitudes, share=0.9, time_constant_s=600.0)
    block = replace(block, trajectory=replace(block.trajectory, slow_attitudes=process))
    bundle = adjust(mounted_orientation(block, Model(free=flights[0].estimate_mounting)))
    assert trajectory_errors.by_course(bundle) is None


def test_one_course_alone_is_not_tested():
    assert trajectory_errors.by_course(over(90.0)) is None
