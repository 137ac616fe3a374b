"""What is stored of a flight is what is computed of it again."""

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.distortion_models import candidates, trials
from acx4book.chapters.beyond.distortion_models.families import MODELS


@pytest.mark.parametrize("model", [MODELS[0], MODELS[-1]], ids=lambda model: model.name)
def test_a_flight_computed_again_gives_the_stored_numbers(decentred, stored, model):
    rows = stored.rows[(stored.rows["case"] == "decentred") & (stored.rows["seed"] == 1)]
    kept = rows.set_index("model").loc[model.name]
    found = trials.of_model(decentred, model)
    for name in ("cost", "joint", "correlation", "strip_px", "strip_plan_m", "direct_height_m"):
        assert found[name] == pytest.approx(kept[name], rel=1e-4), name  # stored to seven digits


def made(shares):
    rows = [
        {"depth_um": depth, "model": name, "e": value}
        for depth, share in zip((0.0, 10.0, 20.0), shares, strict=True)
        for name, value in ((MODELS[0].name, 2.0), (trials.FLEXIBLE, 2.0 * share))
    ]
    return pd.DataFrame(rows)


def test_the_depth_that_halves_an_error_is_interpolated():
    assert trials.halved_at_um(made((1.0, 0.6, 0.4)), "e") == pytest.approx(15.0)
    assert trials.halved_at_um(made((1.0, 0.9, 0.6)), "e") == np.inf


def test_strips_are_named_once(decentred):
    assert trials.strips(decentred.calibration) == ("1", "2", "3", "4", "5")


def test_a_strip_left_out_is_predicted_as_well_as_its_noise_allows(decentred):
    found = trials.leave_out(decentred.calibration, MODELS[0], "2")
    assert len(found.errors) > 5
    assert 0.2 < np.sqrt(np.mean(found.residuals**2)) < 0.4  # px; noise of 0.4 px, redundancy
    assert np.abs(found.errors).max() < 0.6  # m, from 600 m


def test_a_wrong_camera_is_seen_in_the_strip(decentred):
    own = np.array([name == "2" for name in decentred.calibration.images.strips])
    others = trials.only(decentred.calibration, ~own)
    wrong = candidates.single_step(others, MODELS[3])
    found = trials.predict(wrong, trials.only(decentred.calibration, own), "2")
    right = trials.leave_out(decentred.calibration, MODELS[0], "2")
    assert np.mean(found.errors**2) > 4 * np.mean(right.errors**2)
