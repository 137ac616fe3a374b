"""The same values as SciPy's distributions, to the last bit."""

import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from acx4lib.least_squares.statistical import distributions

DF = (1, 2, 3, 7.5, 30, 1000, 2_000_000)
X = (0.0, 1e-9, 0.3, 1.0, 4.7, 33.0, 1200.0, 2e6)
Q = (1e-6, 0.0005, 0.05, 0.5, 0.9, 0.9995)


@pytest.mark.parametrize("name", ["norm_cdf", "norm_sf", "norm_ppf"])
def test_normal_values_are_those_of_scipy(name):
    kind, what = name.split("_")
    for x in Q if what == "ppf" else (*X, *(-np.array(X)), np.nan):
        expected = getattr(getattr(stats, kind), what)(x)
        np.testing.assert_array_equal(getattr(distributions, name)(x), expected)


@pytest.mark.parametrize(
    "name", ["chi2_cdf", "chi2_sf", "chi2_ppf", "chi2_isf", "t_sf", "t_ppf", "t_isf"]
)
def test_values_with_degrees_of_freedom_are_those_of_scipy(name):
    kind, what = name.split("_")
    for df in DF:
        for x in Q if what in ("ppf", "isf") else X:
            expected = getattr(getattr(stats, kind), what)(x, df)
            np.testing.assert_array_equal(getattr(distributions, name)(x, df), expected)


def test_values_of_two_degrees_of_freedom_are_those_of_scipy():
    for dfn in DF:
        for dfd in DF:
            for x in X:
                np.testing.assert_array_equal(
                    distributions.f_sf(x, dfn, dfd), stats.f.sf(x, dfn, dfd)
                )


def test_the_stages_do_without_the_package_that_is_slow_to_load():
    code = (
        "import sys\nfrom acx4lib.stages import heads, mounting, rig, synthetic, validation\n"
        "assert 'scipy.stats' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
