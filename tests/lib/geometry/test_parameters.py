"""What is known of a mounting: six values, and what is no such."""

import numpy as np
import pytest

from acx4lib.flight.setup import camera_of
from acx4lib.geometry.parameters import Prior

TABLE = {"width_px": 4000, "height_px": 3000, "pixel_um": 5.0, "focal_mm": 50.0}


def test_nothing_is_known_by_default():
    prior = Prior()
    assert not prior.lever_declared.any()
    assert not prior.boresight_declared.any()
    assert np.isinf(prior.lever_sigma).all()


@pytest.mark.parametrize("wrong", [{"sigma": (1.0,) * 5}, {"declared": ()}])
def test_six_values_are_expected(wrong):
    with pytest.raises(ValueError, match="expected 6 values each"):
        Prior(**wrong)


def test_a_sigma_is_positive():
    with pytest.raises(ValueError, match="expected positive numbers"):
        Prior(sigma=(0.1, 0.0, 0.1, 1.0, 1.0, 1.0))


def test_declared_is_what_is_written_and_sigma_is_of_that():
    """One number is of all three; where no value is written, there is no sigma either."""
    said = {"lever_x_m": 0.0, "lever_z_m": -0.3, "lever_sigma_m": 0.02, "mount_kappa_deg": 90.0}
    prior = camera_of("CAM", {**TABLE, **said, "mount_sigma_deg": [0.5, 0.5, 0.2]}).prior
    assert prior.lever_declared.tolist() == [True, False, True]
    assert prior.lever_sigma.tolist() == [0.02, np.inf, 0.02]
    assert prior.boresight_declared.tolist() == [False, False, True]
    assert prior.boresight_sigma.tolist() == [np.inf, np.inf, np.radians(0.2)]
