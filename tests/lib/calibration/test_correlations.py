"""Correlations of interior and exterior orientation."""

import numpy as np
import pytest

from acx4lib.calibration import correlations


def test_correlations_are_those_of_the_covariance(fits):
    """East, north, height turned back to the mapping frame's axes must give the raw ones."""
    fit = fits["CAM2"]
    found = correlations.interior_exterior(fit)
    assert found.interior == ("xp_mm", "yp_mm", "k1", "p1", "p2")
    assert found.values.shape == (31, 5, 6)
    assert np.abs(found.values).max() <= 1.0
    network = fit.network
    pose, interior = network.layout.pose[4], network.layout.interior[0]
    cov = fit.solution.cov
    # the share of an interior parameter's variance that the pose explains has no axes
    for j, column in enumerate(interior[interior >= 0]):
        raw = cov[column, pose] @ np.linalg.solve(cov[np.ix_(pose, pose)], cov[pose, column])
        assert np.all(found.values[4, j] ** 2 <= raw / cov[column, column] + 1e-12)
    sigma_z = np.sqrt(cov[pose[2], pose[2]] * cov[interior[1], interior[1]])
    # 2 km from its origin the mapping frame's z is the grid's height up to 0.02 degrees
    assert found.values[4, 0, 2] == pytest.approx(cov[interior[1], pose[2]] / sigma_z, abs=0.01)


def test_the_largest_pairs_are_named_as_results_name_them(fits):
    found = correlations.interior_exterior(fits["CAM1"])
    pairs = correlations.largest_pairs(found, n=3)
    assert list(pairs.values()) == sorted(pairs.values(), reverse=True)
    assert next(iter(pairs.values())) == np.abs(found.values).max()
    assert all(
        name.split("/")[0] in found.interior and name.split("/")[1] in correlations.EXTERIOR
        for name in pairs
    )
