"""Planned flights: their standard deviations against simulation and against closed forms."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.foundations import designs, example
from acx4book.foundations.designs import covariance, lines, planned
from acx4lib.calibration import mounting
from acx4lib.geometry.frames import Pose, exp


def errors_drawn(block, rng):
    """Return a planned block with the errors that its standard deviations state."""
    seen, flown, control = block.image_points, block.trajectory, block.control
    turned = rng.normal(size=(len(flown), 3)) * flown.sigma_attitude
    moved = rng.normal(size=(len(flown), 3)) * flown.sigma_position
    T_m_b = Pose(R=flown.T_m_b.R @ exp(turned), r=flown.T_m_b.r + moved)
    noise = rng.normal(size=seen.colrow.shape) * seen.sigma_px[:, None]
    surveyed = control.x_m + rng.normal(size=control.x_m.shape) * control.sigma_m
    return replace(
        block,
        image_points=replace(seen, colrow=seen.colrow + noise),
        trajectory=replace(flown, T_m_b=T_m_b),
        control=replace(control, x_m=surveyed),
    )


@pytest.mark.slow
def test_planned_standard_deviations_are_those_of_simulated_flights():
    block = planned(lines(90, 270) + lines(90, 270, height_m=900.0))
    cov = covariance(block, free=["f"]).to_numpy()
    truth = np.array([example.F_MM, *example.LEVER_ARM_M, 0.0, 0.0, 0.0])
    rng = np.random.default_rng(1)
    n, square = 40, 0.0
    for _ in range(n):
        camera = mounting.single_step(errors_drawn(block, rng), free=["f"]).calibration.cameras[0]
        opk = np.degrees(camera.T_b_c.opk)
        d = np.array([camera.interior.f, *camera.T_b_c.r, *opk]) - truth
        square += d @ np.linalg.solve(cov, d)
    dof = 7 * n
    assert abs(square / dof - 1) < 4 * np.sqrt(2 / dof)


def test_the_shift_of_gnss_has_a_closed_form_far_from_all_else():
    """All images shifted alike against control: sigma is that of means, in quadrature."""
    block = planned(lines(90, 270, 90, 270, 90, 270))
    cov = covariance(block, fix=["lever_arm", "boresight"], gnss=["shift"])
    height, n = 500.0, len(block.images)
    gnss = example.SIGMA_POSITION_M[0] / np.sqrt(n)
    control = example.SIGMA_CONTROL_M[0] / np.sqrt(5)
    attitude = height * np.radians(example.SIGMA_ATTITUDE_DEG[0]) / np.sqrt(n)
    least, most = np.hypot(gnss, control), np.sqrt(gnss**2 + control**2 + attitude**2)
    assert least < np.sqrt(cov.loc["GNSS east, m", "GNSS east, m"]) < 1.1 * most


def test_without_control_the_lever_arm_is_open_in_height():
    table = designs.sigmas({"none": covariance(planned(lines(90, 270), control=0))})
    assert np.isinf(table.loc["lever z, m", "none"])
    assert np.isfinite(table.drop("lever z, m").to_numpy()).all()
    assert designs.written(table).loc["lever z, m", "none"] == "open"


def test_every_fifth_of_a_footprint_there_is_an_image():
    line = designs.Line(azimuth_deg=90.0, height_m=750.0)
    footprint = example.WIDTH_PX * example.PIXEL_MM * line.height_m / example.F_MM
    assert_allclose(line.base_m, footprint / 5)
    T_m_b = planned([line]).trajectory.T_m_b
    assert_allclose(np.diff(T_m_b.r[:, 0]), line.base_m)
    assert_allclose(T_m_b.R, np.tile(np.eye(3), (5, 1, 1)), atol=1e-12)  # nose to the east


def test_correlations_have_the_names_of_their_covariance():
    cov = pd.DataFrame([[4.0, 3.0], [3.0, 9.0]], ["a", "b"], ["a", "b"])
    assert_allclose(designs.correlations(cov).loc["a", "b"], 0.5)
