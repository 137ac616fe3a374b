"""The answer on standard deviations: numbers of the flights with slow errors, not of the others."""

import pandas as pd
import pytest

from acx4book.chapters.beyond.weights import tables


def test_the_answer_is_that_of_slow_errors():
    errors = pd.DataFrame({"kind": ["white", "slow", "slow"], "sigma0_squared": [0.5, 1.0, 1.1]})
    ratio = {"boresight_omega_deg": 3.0, "boresight_phi_deg": 4.5, "f_mm": 9.0}
    scatter = pd.DataFrame(
        [("slow", name, r) for name, r in ratio.items()] + [("white", "boresight_phi_deg", 1.0)],
        columns=["kind", "parameter", "ratio"],
    )
    refraction = pd.DataFrame({"without_model": [-0.02, 0.01], "sigma": [0.01, 0.01]})
    said = tables.answer(errors, scatter, refraction)
    assert "3.0 to 4.5 times" in said
    assert "unit weight is 1.05" in said
    assert "up to 2.0 standard deviations" in said


@pytest.mark.parametrize(
    ("sigma_f_mm", "said"),
    [
        ((0.0008, 0.0012), "of $f$ is met at 1.0 cm of white noise in height"),
        ((0.0022, 0.0027), "of $f$ is met at none between 0.5 and 1.5 cm of white noise"),
    ],
)
def test_a_printed_sigma_outside_of_the_curve_is_met_nowhere(sigma_f_mm, said):
    noise = {"gnss_height_m": (0.005, 0.015), "sigma_lever_z_m": (0.01, 0.02)}
    assert said in tables.height_sentence(pd.DataFrame(noise | {"sigma_f_mm": sigma_f_mm}))
