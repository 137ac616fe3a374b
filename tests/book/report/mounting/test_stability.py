"""The boresight over time: scatter and drift."""

import numpy as np
import pandas as pd
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report.material import read
from acx4book.report.mounting import stability
from acx4book.report.mounting.stability import boresights
from support.run_results import edit


def test_boresights_scatter_as_their_sigma_says(run):
    found = boresights(run)
    assert len(found) == len(run.flight.calibration.images)
    assert found["time_s"].is_monotonic_increasing
    for axis in stability.AXES:
        z = found[f"{axis}_deg"] / found[f"sigma_{axis}_deg"]
        # chi-square of n - 1 at 0.1 %; what images share makes it smaller, never larger
        assert np.sum(z**2) < stats.chi2.isf(0.001, len(z) - 1)
        assert np.sum(z**2) > stats.chi2.ppf(0.001, len(z) - 1)
        assert abs(found[f"{axis}_deg"].mean()) < 1e-4  # the mean rotation is the mean to 2nd order


def test_an_image_turned_to_the_left_turns_the_boresight_about_z(folder):
    """kappa counts from x to y seen from above, and so does a turn about the body's z axis."""
    before = boresights(read(folder))
    image, n = before["image"][3], len(before)

    def turn(table):
        rows = (table["method"] == "two_step") & (table["image"] == image)
        table.loc[rows, "kappa_deg"] = table.loc[rows, "kappa_deg"].astype(float) + 0.5

    edit(folder, "exterior_orientation", turn)
    after = boresights(read(folder))
    change = (after["z_deg"] - before["z_deg"]).to_numpy()
    # attitudes of a few degrees: the cosine is one within 1 %, and the mean takes its part
    assert_allclose(change[3], 0.5 * (1 - 1 / n), atol=0.005)
    assert_allclose(np.delete(change, 3), -0.5 / n, atol=0.001)


def made_up(values, strips="1"):
    time = np.arange(len(values), dtype=float)
    axes = {f"{axis}_deg": values for axis in stability.AXES}
    return pd.DataFrame({"time_s": time, "number": time + 1, "strip": list(strips), **axes})


def test_a_drift_is_found_with_its_size_and_noise_is_none(rng):
    noise = rng.normal(0, 0.005, 40)
    drifting = stability.drifts(made_up(noise + np.linspace(0, 0.02, 40), "1" * 20 + "2" * 20))[0]
    still = stability.drifts(made_up(noise, "12" * 20))[0]
    assert drifting.p < 1e-3
    assert drifting.p_strips < 1e-3
    assert still.p > 0.05
    assert still.p_strips > 0.05
    exact = stability.drifts(made_up(np.linspace(0.01, 0.04, 7), "1" * 7))[0]
    assert_allclose(exact.change_deg, 0.03)
    assert np.isnan(exact.p_strips)
    assert stability.drifts(made_up(np.zeros(3), "111")) == []


def test_a_line_is_that_of_scipy(rng):
    x, y = rng.uniform(0, 900, 30), rng.normal(0, 0.005, 30)
    line, expected = stability.straight_line(x, y), stats.linregress(x, y)
    assert_allclose(line.at_zero, expected.intercept, rtol=1e-12)
    assert_allclose(line.slope, expected.slope, rtol=1e-12)
    assert_allclose(line.sigma_slope, expected.stderr, rtol=1e-12)
    assert_allclose(line.p, expected.pvalue, rtol=1e-12)


def test_a_line_through_two_points_has_no_scatter():
    line = stability.straight_line(np.array([1.0, 3.0]), np.array([2.0, 6.0]))
    assert (line.at_zero, line.slope) == (0.0, 2.0)
    assert np.isnan([line.sigma_slope, line.p]).all()


def test_means_are_compared_as_in_scipy(rng):
    groups = [rng.normal(0, 1, n) for n in (5, 9, 2)]
    assert_allclose(stability.equal_means_p(groups), stats.f_oneway(*groups).pvalue, rtol=1e-12)
