"""Tables for flight.toml: read back they are the calibration, digit by digit."""

import tomllib
from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.flight.setup import camera_of
from acx4lib.geometry.frames import exp
from acx4tools.exchange.outward import calibrated, flight_toml


def test_the_cameras_come_back(rig):
    found = calibrated.read(rig)
    tables = tomllib.loads(flight_toml.take(found).files["cameras.toml"])["cameras"]
    assert list(tables) == ["LEFT", "RIGHT"]
    for camera in found.cameras:
        back = camera_of(camera.name, tables[camera.name])
        assert back.interior == camera.interior
        assert_allclose(back.T_b_c.R, camera.T_b_c.R, atol=1e-15)
        assert_allclose(back.T_b_c.r, camera.T_b_c.r, atol=1e-15)


def test_sigma_of_the_mounting_is_along_and_about_the_bodys_axes(single, rng):
    """As comments; about body axes they are the scatter of boresights drawn about camera axes."""
    found = calibrated.read(single)
    text = flight_toml.take(found).files["cameras.toml"]
    said = tomllib.loads(text.replace("# lever_s", "lever_s").replace("# mount_s", "mount_s"))
    columns = found.calibration.layout.mount[0]
    cov = found.calibration.cov[np.ix_(columns, columns)]
    own = said["cameras"]["CAM"]
    assert_allclose(own["lever_sigma_m"], np.sqrt(np.diag(cov)[:3]), rtol=1e-3)
    R = found.cameras[0].T_b_c.R
    drawn = R @ exp(rng.multivariate_normal(np.zeros(3), cov[3:, 3:], size=20_000)) @ R.T
    about = np.stack([drawn[:, 2, 1], drawn[:, 0, 2], drawn[:, 1, 0]])
    assert_allclose(own["mount_sigma_deg"], np.degrees(about.std(axis=1)), rtol=0.03)


def test_a_mounting_that_was_not_estimated_is_said(rig):
    found = replace(calibrated.read(rig), method="refined")
    made = flight_toml.take(found)
    assert flight_toml.NOT_MOUNTED in made.assumed
    assert "lever_sigma_m" not in made.files["cameras.toml"]


def test_a_synthetic_camera_keeps_its_frame(rig):
    found = calibrated.read(rig)
    synthetic = replace(found.flight.synthetic, camera="LEFT")
    named = replace(found, flight=replace(found.flight, synthetic=synthetic))
    assert flight_toml.FRAME.format("LEFT") in flight_toml.take(named).assumed
    assert not any("synthetic" in one for one in flight_toml.take(found).assumed)
