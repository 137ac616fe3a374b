import numpy as np
import pytest

from acx4book.foundations import explorers
from acx4book.foundations.designs import covariance, lines, planned
from acx4book.foundations.drawings.camera import grid
from acx4book.foundations.drawings.strips import moved_on_ground
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


def test_any_lens_is_the_sum_of_its_coefficients_and_a_longer_f_moves_points_as_rays_say():
    """With another f the ideal point of the same ray lies nearer to the middle, or farther."""
    (arrows,) = explorers.distortion_explorer().panels[0].marks
    values = np.array([1.5, -2.0, 0.7, 3.0, -5.0, 120.0])
    xy, f = grid(explorers.HEAD, 9, 7), printed.interior(1, explorers.HEAD).f
    units = explorers.KEYS.items()
    lens = camera.Interior(f=f, **{k: u * v for (k, u), v in zip(units, values, strict=False)})
    longer = xy - xy * (f + 0.12) / f
    expected = camera.distortion(lens, xy) + longer
    found = (arrows.response.matrix @ values).reshape(-1, 2)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_a_balanced_f_leaves_a_quarter_in_the_corner():
    shown = explorers.distortion_explorer()
    alone, balanced = (
        shown.readings(shown.presets[name])[0][0] for name in ("only k₁", "k₁ and a balanced f")
    )
    assert float(balanced) == pytest.approx(float(alone) / 4, rel=0.05)


XY = explorers.POINTS_MM


@pytest.fixture(scope="module")
def derivatives():
    """By the azimuth, what the arrows of a strip show, shape (n, 2, 6)."""
    panels = explorers.boresight_explorer().panels
    azimuths = [azimuth for azimuth, _ in explorers.STRIPS.values()]
    matrices = [panel.marks[0].response.matrix for panel in panels]
    return dict(zip(azimuths, (m.reshape(-1, 2, 6) for m in matrices), strict=True))


@pytest.mark.parametrize("azimuth", [90.0, 270.0, 0.0, 180.0])
@pytest.mark.parametrize("k", range(6))
def test_derivatives_agree_with_differences(derivatives, azimuth, k):
    step = np.eye(6)[k] * explorers.SLIDERS[k].step
    high, low = (explorers.on_ground(azimuth, 500.0, XY, way * step) for way in (1, -1))
    found = derivatives[azimuth][:, :, k]
    assert found == pytest.approx((high - low) / (2 * step[k]), abs=1e-3)


def test_derivatives_are_those_of_the_closed_form_above_flat_ground(derivatives):
    """Flown east, body axes are those of the map."""
    at = XY * 500.0 / 50.0
    for k, shift, turned in (
        *((axis, np.zeros(3), np.eye(3)[axis]) for axis in range(3)),
        *((3 + axis, np.eye(3)[axis], np.zeros(3)) for axis in range(3)),
    ):
        expected = moved_on_ground(at, 500.0, shift, turned) * explorers.UNITS[k]
        assert derivatives[90.0][:, :, k] == pytest.approx(expected, abs=1e-9)


def test_a_matrix_is_enough_up_to_the_ends_of_all_sliders(derivatives):
    worst = np.array([slider.high for slider in explorers.SLIDERS])
    exact = explorers.on_ground(0.0, 500.0, XY, worst) - explorers.on_ground(
        0.0, 500.0, XY, 0 * worst
    )
    assert derivatives[0.0] @ worst == pytest.approx(exact, abs=0.01)


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
def test_readings_are_the_covariance_of_the_planned_lines(shown, ratio):
    flown = lines(90, 270, height_m=500.0) + lines(90, 270, height_m=500.0 * ratio)
    cov = covariance(planned(flown), free=["f", "xp", "yp"], gnss=["shift"])
    names = [*explorers.SHOWN]
    factors = np.array([factor for _, factor in explorers.SHOWN.values()])
    sigma = np.sqrt([cov.loc[name, name] for name in names])
    *read, correlation = numbers(shown, ratio)
    assert read == pytest.approx(factors * sigma, abs=0.0051)
    expected = cov.loc[names[0], names[1]] / (sigma[0] * sigma[1])
    assert correlation == pytest.approx(expected, abs=0.0051)


def test_f_and_z_are_exchanged_for_each_other_at_one_height(shown):
    """As chapter 9 has it: f changes by f s / h."""
    sigma_f, sigma_z, *_ = numbers(shown, 1.0)
    assert sigma_f / sigma_z == pytest.approx(1000 * 50 / 500 / 100, rel=0.01)


@pytest.mark.parametrize("ratio", [1.2, 2.0])
def test_ellipses_have_the_covariance_of_their_points(shown, ratio):
    (ellipse,) = shown.panels[0].marks
    points = np.asarray(ellipse.response.at([ratio])).reshape(-1, 2)[:-1]
    sigma_f, sigma_z, *_, correlation = numbers(shown, ratio)
    found = 2 * points.T @ points / len(points)
    assert np.sqrt(np.diag(found)) == pytest.approx([sigma_f, sigma_z], abs=0.0051)
    assert found[0, 1] / np.sqrt(found[0, 0] * found[1, 1]) == pytest.approx(
        correlation, abs=0.0051
    )
    on = np.einsum("ni,ij,nj->n", points, np.linalg.inv(found), points)
    assert on == pytest.approx(1.0, rel=1e-9)
