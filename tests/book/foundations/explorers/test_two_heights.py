import numpy as np
import pytest

from acx4book.foundations.explorers import two_heights


@pytest.fixture(scope="module")
def shown():
    return two_heights.explorer()


def numbers(shown, ratio):
    return [float(row[0].replace("\N{MINUS SIGN}", "-")) for row in shown.readings([ratio])]


@pytest.mark.parametrize("ratio", [1.0, 1.5, 3.0])
def test_readings_are_the_covariance_at_a_stop(shown, ratio):
    cov = two_heights.covariances([ratio])[0]
    sigma = np.sqrt(np.diag(cov))
    *read, correlation = numbers(shown, ratio)
    assert read == pytest.approx(sigma, abs=0.0051)
    assert correlation == pytest.approx(cov[0, 1] / (sigma[0] * sigma[1]), abs=0.0051)


def test_f_and_z_are_exchanged_for_each_other_at_one_height():
    """As chapter 9 has it: f changes by f s / h."""
    cov = two_heights.covariances([1.0])[0]
    assert np.sqrt(cov[0, 0] / cov[1, 1]) == pytest.approx(1000 * 50 / 500 / 100, rel=0.01)


def test_ellipses_have_the_covariance_of_their_points():
    cov = two_heights.covariances([1.2, 2.0])[:, :2, :2]
    points = two_heights.ellipses(cov)[:, :-1]
    mean = np.einsum("rni,rnj->rij", points, points) / points.shape[1]
    assert 2 * mean == pytest.approx(cov, rel=1e-9)
    weights = np.linalg.inv(cov)
    assert np.einsum("rni,rij,rnj->rn", points, weights, points) == pytest.approx(1.0, rel=1e-9)
