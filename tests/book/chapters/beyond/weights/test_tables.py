"""The printed standard deviations, and the noise of GNSS heights that would give them."""

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.weights import figures, study, tables
from acx4book.notebooks.simulated.flown import fly


def test_noisier_heights_are_seen_in_f_and_lever_z():
    flown = fly("acx4-ideal", 1, study.WHITE)
    noisy = {s: study.with_height_noise(flown.block, s) for s in (0.005, 0.02, 0.08)}
    table = tables.height_noise({s: study.adjusted(flown, block) for s, block in noisy.items()})
    for name in ("sigma_f_mm", "sigma_lever_z_m"):
        assert table[name].is_monotonic_increasing
    # as large as it is, the noise of 52 heights is what determines both
    assert table["sigma_lever_z_m"].iloc[2] > 2 * table["sigma_lever_z_m"].iloc[1]
    assert len(figures.height_noise(table, beside_print=True).axes) == 2


@pytest.mark.parametrize(
    ("sigma_f_mm", "met"), [((0.0008, 0.0012), 1.0), ((0.0022, 0.0027), np.nan)]
)
def test_a_printed_sigma_outside_of_the_curve_is_met_nowhere(sigma_f_mm, met):
    noise = {"gnss_height_m": (0.005, 0.015), "sigma_lever_z_m": (0.01, 0.02)}
    table = pd.DataFrame(noise | {"sigma_f_mm": sigma_f_mm})
    assert tables.met_at_cm(table, "f_mm") == pytest.approx(met, nan_ok=True)
