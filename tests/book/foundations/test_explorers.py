import numpy as np
import pytest

from acx4book.foundations import explorers
from acx4book.foundations.drawings.georeferencing import moved_on_ground
from acx4book.paper import printed
from acx4lib.geometry import camera


def test_the_start_is_the_head_of_table_1():
    shown = explorers.distortion_explorer()
    interior = printed.interior(1, explorers.HEAD)
    principal = np.array([interior.xp, interior.yp])
    for row, corner in zip(
        shown.readings(shown.start), printed.corners(explorers.HEAD)[[0, 2]], strict=False
    ):
        expected = np.linalg.norm(camera.distortion(interior, corner[None] + principal))
        assert float(row[0]) == pytest.approx(1000 * expected, abs=0.06)
        assert float(row[1]) == pytest.approx(expected / printed.pixel_mm(explorers.HEAD), abs=0.06)
        assert float(row[2]) == pytest.approx(1600 * expected / interior.f, abs=0.006)


def test_any_lens_is_the_sum_of_its_coefficients():
    values, xy = (
        np.array([1.5, -2.0, 0.7, 3.0, -5.0, 120.0]),
        np.array([[20.0, -11.0], [-3.0, 16.0]]),
    )
    expected = explorers.moved(values, xy).ravel()
    assert explorers.response(xy) @ values == pytest.approx(expected, rel=1e-12)


def test_a_longer_f_moves_ideal_points_as_rays_say():
    """The same ray with another f."""
    values, f = np.array([0, 0, 0, 0, 0, 100.0]), printed.interior(1, explorers.HEAD).f
    xy = np.array([[20.0, -11.0]])
    assert explorers.moved(values, xy) == pytest.approx(xy - xy * (f + 0.1) / f, rel=1e-9)


def test_a_balanced_f_leaves_a_quarter_in_the_corner():
    shown = explorers.distortion_explorer()
    alone, balanced = (
        shown.readings(shown.presets[name])[0][0] for name in ("only k₁", "k₁ and a balanced f")
    )
    assert float(balanced) == pytest.approx(float(alone) / 4, rel=0.05)


XY = np.array([[0.0, 0.0], [16.0, -12.0], [-16.0, 9.0]])


@pytest.mark.parametrize("azimuth", [90.0, 270.0, 0.0, 180.0])
@pytest.mark.parametrize("k", range(6))
def test_derivatives_agree_with_differences(azimuth, k):
    step = np.eye(6)[k] * explorers.SLIDERS[k].step
    high, low = (explorers.on_ground(azimuth, 500.0, XY, way * step) for way in (1, -1))
    found = explorers.derivatives(azimuth, 500.0, XY)[:, :, k]
    assert found == pytest.approx((high - low) / (2 * step[k]), abs=1e-3)


def test_derivatives_are_those_of_the_closed_form_above_flat_ground():
    """Flown east, body axes are those of the map."""
    at = XY * 500.0 / 50.0
    for k, shift, turned in (
        *((axis, np.zeros(3), np.eye(3)[axis]) for axis in range(3)),
        *((3 + axis, np.eye(3)[axis], np.zeros(3)) for axis in range(3)),
    ):
        expected = moved_on_ground(at, 500.0, shift, turned) * explorers.UNITS[k]
        found = explorers.derivatives(90.0, 500.0, XY)[:, :, k]
        assert found == pytest.approx(expected, abs=1e-9)


def test_a_matrix_is_enough_up_to_the_ends_of_all_sliders():
    worst = np.array([slider.high for slider in explorers.SLIDERS])
    exact = explorers.on_ground(0.0, 500.0, XY, worst) - explorers.on_ground(
        0.0, 500.0, XY, 0 * worst
    )
    assert explorers.derivatives(0.0, 500.0, XY) @ worst == pytest.approx(exact, abs=0.005)


def test_boresight_and_lever_arm_cancel_at_one_height_only():
    shown = explorers.boresight_explorer()
    cancelled = next(v for name, v in shown.presets.items() if "cancel" in name)
    for row in shown.readings(cancelled):
        assert row[:2] == ["0", "0"]
        assert row[2:] != ["0", "0"]


@pytest.fixture(scope="module")
def shown():
    return explorers.two_heights_explorer()


def numbers(shown, ratio):
    return [float(row[0].replace("\N{MINUS SIGN}", "-")) for row in shown.readings([ratio])]


@pytest.mark.parametrize("ratio", [1.0, 1.5, 3.0])
def test_readings_are_the_covariance_at_a_stop(shown, ratio):
    cov = explorers.covariances([ratio])[0]
    sigma = np.sqrt(np.diag(cov))
    *read, correlation = numbers(shown, ratio)
    assert read == pytest.approx(sigma, abs=0.0051)
    assert correlation == pytest.approx(cov[0, 1] / (sigma[0] * sigma[1]), abs=0.0051)


def test_f_and_z_are_exchanged_for_each_other_at_one_height():
    """As chapter 9 has it: f changes by f s / h."""
    cov = explorers.covariances([1.0])[0]
    assert np.sqrt(cov[0, 0] / cov[1, 1]) == pytest.approx(1000 * 50 / 500 / 100, rel=0.01)


def test_ellipses_have_the_covariance_of_their_points():
    cov = explorers.covariances([1.2, 2.0])[:, :2, :2]
    points = explorers.ellipses(cov)[:, :-1]
    mean = np.einsum("rni,rnj->rij", points, points) / points.shape[1]
    assert 2 * mean == pytest.approx(cov, rel=1e-9)
    weights = np.linalg.inv(cov)
    assert np.einsum("rni,rij,rnj->rn", points, weights, points) == pytest.approx(1.0, rel=1e-9)
