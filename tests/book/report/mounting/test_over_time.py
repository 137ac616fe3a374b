"""Boresights drawn over time."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.report.mounting.over_time import boresight_over_time

mpl.use("agg")


@pytest.fixture
def boresights():
    """Four images that drift about x by 0.03 degrees in three minutes."""
    drift = {"x_deg": [0.0, 0.01, 0.02, 0.03], "y_deg": np.zeros(4), "z_deg": np.zeros(4)}
    sigma = {f"sigma_{axis}_deg": 0.005 for axis in "xyz"}
    times = {"time_s": [0.0, 60.0, 120.0, 180.0], "number": [1, 2, 3, 4]}
    return pd.DataFrame({**times, "strip": ["1", "1", "2", "2"], **drift, **sigma})


def test_boresights_have_their_line_over_time_in_minutes(boresights):
    fig = boresight_over_time(boresights)
    assert [ax.get_ylabel() for ax in fig.axes] == [f"about {axis} (°)" for axis in "xyz"]
    assert fig.axes[-1].get_xlabel() == "time after the first image (min)"
    (line,) = [a for a in fig.axes[0].get_lines() if a.get_linestyle() == "--"]
    assert_allclose(line.get_xydata(), [[0, 0], [3, 0.03]], atol=1e-12)
    untimed = boresight_over_time(boresights.assign(time_s=np.nan))
    assert untimed.axes[-1].get_xlabel() == "image number"


def test_no_boresights_are_said():
    assert len(boresight_over_time(pd.DataFrame()).axes[0].texts) == 1
