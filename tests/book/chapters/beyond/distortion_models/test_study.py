"""The stored flights, their sums, and Schwarz's criterion."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.distortion_models import cases, study
from acx4book.chapters.beyond.distortion_models.families import MODELS


def test_every_case_has_every_model_in_every_flight(stored):
    n = stored.n_flights * len(cases.CASES) * len(MODELS)
    assert len(stored.rows) == n + len(MODELS)  # and the measurements of others
    assert stored.rows["cost"].notna().all()


def test_a_missing_file_names_the_target_of_make(tmp_path):
    with pytest.raises(FileNotFoundError, match="make models"):
        study.read(tmp_path)


def test_a_useless_parameter_costs_ln_n():
    rows = pd.DataFrame(
        {
            "case": "symmetric",
            "seed": 1,
            "model": ["Brown", "other"],
            "cost": 100.0,
            "redundancy": 100,
            "observations": 1000,
            "estimated": [8, 11],
        }
    )
    found = study.with_criteria(rows)["bic_less_first"]
    assert_allclose(found, [0.0, 3 * np.log(1000)])


def test_the_right_model_of_a_lens_has_the_smallest_criterion(stored):
    found = study.summary(stored)
    for case in (cases.SYMMETRIC, cases.DECENTRED):
        own = found[found["case"] == case].set_index("model")
        assert own["bic_less_first"].idxmin() == study.FIRST
        assert own.loc[study.FIRST, "sigma0_sq"] == pytest.approx(1, abs=0.02)


def test_errors_are_root_mean_squares_over_flights(stored):
    own = stored.rows[(stored.rows["case"] == "dented") & (stored.rows["model"] == "Brown")]
    found = study.summary(stored).set_index(["case", "model"])["strip_height_m"]
    rms = np.sqrt(np.mean(own["strip_height_m"] ** 2))
    assert found["dented", "Brown"] == pytest.approx(rms)
