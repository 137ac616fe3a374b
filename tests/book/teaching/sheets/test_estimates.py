import statistics

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from acx4book.teaching.sheets import estimates


def test_the_statistics_are_those_of_others():
    d = np.random.default_rng(3).normal(0.05, 0.2, (17, 3))
    found = estimates.statistics(d)
    height = d[:, 2].tolist()
    assert found[estimates.N] == 17
    assert found["rms_east_m"] == pytest.approx(np.sqrt(np.mean(d[:, 0] ** 2)))
    assert found[estimates.MEAN] == pytest.approx(statistics.mean(height))
    assert found[estimates.STD] == pytest.approx(statistics.stdev(height))
    assert found[estimates.T] == pytest.approx(ttest_1samp(height, 0.0).statistic)
    assert found[estimates.CHI] == pytest.approx(16 * statistics.variance(height) / 0.15**2)
