"""What sigma would be in calm air over level ground."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import designed
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.steady import LEFT, TIE_POINTS, calm_sigmas
from acx4lib.geometry.frames import Pose
from acx4tools.planning import design, plan, tables
from support import blocks
from support.flights.planned import strip, values

ONE_HEIGHT = {line: strip(line) for line in ("north", "south", "east", "west")}


def flown(tilt_deg, relief_m, *, ties=150):
    """Four strips of three exposures at two heights, tilted so much, over so high hills."""
    points = blocks.terrain(ties, half_m=450.0, relief_m=relief_m)
    control = blocks.crosses() * [1.0, 1.0, 0.0] + [0.0, 0.0, blocks.GROUND_M]
    poses = blocks.fly(ONE_LEVEL, tilt_deg=tilt_deg)
    block = blocks.in_strips(blocks.simulate(poses, ties=points, control=control), 3)
    return designed(mounted_orientation(block, free=("f", "xp", "yp")))


ONE_LEVEL = ((1000.0, 0.0, 0.0), (1000.0, 0.0, 90.0), (1000.0, 0.0, 180.0), (1000.0, 0.0, 270.0))


def sigma(bundle):
    return np.sqrt(np.diag(trajectory_errors.reported_covariance(bundle)))


def test_it_is_that_of_a_flight_of_which_a_twentieth_of_tilts_and_hills_is_left():
    """Two blocks, simulated each by itself; strips tilt otherwise on average, which is left out."""
    rough, calm = flown(1.5, 60.0), flown(1.5 * LEFT, 60.0 * LEFT)
    expected = sigma(calm) / sigma(rough)
    found = calm_sigmas(rough)
    f = 0  # the camera is mounted obliquely, by which x_p and y_p are told from the lever arm
    assert expected[f] > 5
    assert_allclose(found, expected, rtol=0.15)


def test_two_heights_rest_on_no_wind():
    bundle = design.of(plan.from_values(values())).mountings["single_step"].bundle
    assert np.all(np.abs(calm_sigmas(bundle) - 1) < 0.2)


def of_plan(**changes):
    bundle = design.of(plan.from_values(values(**changes))).mountings["single_step"].bundle
    names = [p.name for p in tables.unknowns(bundle)]
    return dict(zip(names, calm_sigmas(bundle), strict=True))


def test_of_one_height_focal_length_and_lever_arm_rest_on_the_wind():
    found = of_plan(calibration={"strips": ONE_HEIGHT})
    assert all(found[name] > 10 for name in ("f_mm", "lever_z_m", "lever_x_m", "xp_mm"))
    assert all(found[name] < 1.2 for name in ("k1", "p1", "boresight_kappa_deg"))


@pytest.mark.parametrize(
    ("speeds", "rests"), [((70, 70), True), ((70, 66), True), ((80, 55), False)]
)
def test_a_delay_rests_on_the_wind_where_strips_have_about_one_speed(speeds, rests):
    strips = {
        name: {**one, "speed_m_s": float(v)}
        for (name, one), v in zip(
            values()["calibration"]["strips"].items(), 2 * speeds, strict=True
        )
    }
    stages = {"mounting": {"estimate": ["f_mm"], "gnss": ["delay", "attitude_delay"]}}
    found = of_plan(calibration={"strips": strips}, stages=stages)
    assert (found["gnss_delay_s"] > 4) == rests
    assert found["attitude_delay_s"] > 10  # whatever the speeds: nobody plans how attitudes change


def test_without_straight_strips_nothing_is_said():
    block = blocks.standard()
    bundle = designed(mounted_orientation(block, free=("f",)))
    assert calm_sigmas(bundle) is None
    block = blocks.in_strips(block, 3)
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    r = block.trajectory.T_m_b.r.copy()
    r[:, :2] = 300 * np.column_stack([np.cos(turn), np.sin(turn)])
    around = replace(block.trajectory, T_m_b=Pose(R=block.trajectory.T_m_b.R, r=r))
    images = replace(block.images, strips=("round",) * len(block.images))
    bundle = replace(
        designed(mounted_orientation(blocks.in_strips(blocks.standard(), 3), free=("f",))),
        network=replace(
            mounted_orientation(block, free=("f",)),
            block=replace(block, images=images, trajectory=around),
        ),
    )
    bundle = replace(bundle, state=replace(bundle.state, T_m_b=around.T_m_b))
    assert calm_sigmas(bundle) is None


def test_a_part_of_many_tie_points_says_the_same_as_all():
    few, many = (flown(1.5, 60.0, ties=n) for n in (TIE_POINTS, 4 * TIE_POINTS))
    assert_allclose(calm_sigmas(few), calm_sigmas(many), rtol=0.3)
