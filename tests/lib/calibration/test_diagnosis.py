"""Determined parameters that are weak: by their share of the ground, or by what they rest on."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.planning import design, plan, tables
from acx4files.results import sentences
from acx4lib.calibration import diagnosis
from acx4lib.calibration.estimates import features, parameters, to_reported
from acx4lib.georeferencing import budget
from support.flights.planned import strip, values

MAPPING = {
    "check": {"number": [3, 3], "area_m": [600.0, 600.0]},
    "strips": {"a": strip("north", 800.0, overlap=0.6), "b": strip("south", 800.0, overlap=0.6)},
}
NO_CONTROL = {"number": [0, 0]}
ONE_HEIGHT = {"strips": {line: strip(line) for line in ("north", "south", "east", "west")}}
BARE = {"control": NO_CONTROL, "validation": MAPPING}


def of(**changes):
    return design.of(plan.from_values(values(**changes)))


def weak(found):
    """Return sentences on the weak parameters of a plan, by its check points or its format."""
    mounting = found.mountings["single_step"]
    calibration, block = mounting.calibration, mounting.bundle.network.block
    if found.validations:
        sources, where = found.validations["single_step"].points.sources, diagnosis.CHECK_POINTS
        shares = budget.parameter_shares(sources, calibration)
    else:
        shares, where = budget.shares_at_corners(calibration, block), diagnosis.CORNERS
    late = bool(mounting.bundle.network.layout.delay[0] >= 0)
    weaknesses = diagnosis.of(mounting.bundle).weak(shares, of=where)
    return sentences.weak(weaknesses, features(block), late=late)


def test_the_share_of_a_parameter_is_what_the_variance_falls_by_when_it_is_known():
    """The covariance of the others, given one, is the inverse of their part of the weights."""
    found = of(validation=MAPPING)
    calibration = found.mountings["single_step"].calibration
    sources = found.validations["single_step"].points.sources
    shares = budget.parameter_shares(sources, calibration)
    to = to_reported(calibration)
    J = sources.by_parameters @ np.linalg.inv(to)
    scale = np.sqrt(np.diag(to @ calibration.cov @ to.T))
    weights = np.linalg.inv(to @ calibration.cov @ to.T / scale[:, None] / scale)
    total = np.diagonal(sources.cov, axis1=1, axis2=2).mean(axis=0)
    for k, p in enumerate(parameters(calibration)):
        if p.name not in ("f_mm", "lever_z_m", "xp_mm", "boresight_phi_deg"):
            continue
        rest = np.delete(np.arange(len(scale)), k)
        given = np.linalg.inv(weights[np.ix_(rest, rest)])
        both = [J * scale, (J * scale)[:, :, rest]]
        every, without = (
            np.einsum("pai,ij,paj->a", part, cov, part) / len(J)
            for part, cov in zip(both, (np.linalg.inv(weights), given), strict=True)
        )
        assert_allclose(shares[:, k] * total, every - without, rtol=1e-4, atol=1e-9)


def test_a_known_lever_arm_lowers_the_variance_by_the_share_of_its_z():
    """Without control points, its z alone is unknown of it: the others have hardly a share."""
    free = of(**BARE)
    stages = {"mounting": {**values()["stages"]["mounting"], "fix": ["lever_arm"]}}
    held = of(**BARE, stages=stages)
    before, after = (
        np.mean(found.validations["single_step"].points.sigma[:, 2] ** 2) for found in (free, held)
    )
    mounting = free.mountings["single_step"]
    share = budget.parameter_shares(
        free.validations["single_step"].points.sources, mounting.calibration
    )[2]
    names = [p.name for p in parameters(mounting.calibration)]
    assert share[names.index("lever_z_m")] == pytest.approx(1 - after / before, abs=0.02)


def test_a_plan_of_two_heights_with_control_points_has_nothing_weak():
    assert weak(of(validation=MAPPING)) == []
    assert weak(of()) == []


def test_one_height_without_control_points_is_determined_but_weak():
    found = of(**BARE, calibration=ONE_HEIGHT)
    assert tables.not_determined(found) == []
    said = {line.split()[1]: line for line in weak(found)}
    assert {"f_mm", "xp_mm", "yp_mm", "lever_x_m", "lever_y_m", "lever_z_m"} == set(said)
    assert "% of the variance of check points in height; it rests on wind" in said["lever_z_m"]
    assert said["lever_z_m"].endswith(
        "it would need: control points, and two flying heights or f held"
    )


def test_without_check_points_the_ground_under_the_corners_counts():
    found = of(control=NO_CONTROL)
    (line,) = weak(found)
    assert "lever_z_m is weak" in line
    assert "% of the variance of the ground under the format's corners in height" in line
    assert line.endswith("it would need: control points")


def test_what_two_reasons_make_weak_is_named_once_with_both():
    mounting = of(**BARE, calibration=ONE_HEIGHT).mountings["single_step"]
    found = diagnosis.of(mounting.bundle, mounting.calibration)
    by_wind = found.weak()
    shares = np.zeros((3, len(parameters(mounting.calibration))))
    shares[1, 0] = 0.4
    both = found.weak(shares, of=diagnosis.CHECK_POINTS)
    assert len(both) == len(by_wind)
    first = sentences.weak(both, found.features)[0]
    assert "CAM f_mm is weak" in first
    assert "40 % of the variance of check points in north; it rests on wind and hills" in first


SPEEDS = "strips flown at different speeds at one height, or the lever arm held"


def late(low, high):
    strips = {
        name: {**one, "speed_m_s": high if name.startswith("high") else low}
        for name, one in values()["calibration"]["strips"].items()
    }
    stages = {"mounting": {"estimate": ["f_mm", "xp_mm", "yp_mm"], "gnss": ["delay"]}}
    lines = weak(of(calibration={"strips": strips}, stages=stages))
    return {line.split(" is weak")[0].split()[-1]: line for line in lines}


def test_the_lever_arm_of_a_late_clock_needs_other_speeds():
    said = late(70.0, 70.0)
    assert {"lever_x_m", "gnss_delay_s"} <= set(said)
    assert said["lever_x_m"].endswith(SPEEDS)


def test_speeds_that_differ_with_the_height_are_not_enough_beside_a_principal_point():
    """Along the flight, the image shifts by x_p, lever arm over height, and speed over height."""
    said = late(70.0, 50.0)
    assert {"lever_x_m", "yp_mm", "gnss_delay_s"} <= set(said)
    assert all(line.endswith(SPEEDS) for line in said.values())
