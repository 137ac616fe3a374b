"""The boresight over time: single images, and the tests of the certified adjustment."""

import numpy as np
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report.material import read
from acx4book.report.mounting import stability
from acx4book.report.mounting.stability import boresights
from support.run_results import SINGLE, edit, edit_summary


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


def test_the_tests_of_the_certified_adjustment_are_read_back(folder):
    told = {
        "names": ["1", "2"],
        "turns_deg": [[0.0, 0.01, -0.002], [0.0, -0.01, 0.002]],
        "sigma_deg": [[0.004, 0.002, None], [0.004, 0.002, 0.004]],
        "f": 4.5,
        "dof": 3,
        "redundancy": 61.5,
        "p": 0.0063,
    }
    edit_summary(folder, SINGLE, boresight_stability={"strips": told, "drift": None})
    (test,) = stability.turns_of(read(folder))
    assert (test.title, test.dof, test.p) == ("differences between strips", 3, 0.0063)
    assert test.sentence.endswith("+0.0100° ± 0.0020° about y of strip 1")
    edit_summary(folder, SINGLE, boresight_stability={"strips": None, "drift": None})
    assert stability.turns_of(read(folder)) == []
