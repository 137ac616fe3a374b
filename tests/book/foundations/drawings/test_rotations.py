import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4book.foundations import example
from acx4book.foundations.drawings import rotations
from acx4lib.geometry.frames import rotation_from_opk
from support.figures import assert_labelled, drawn, panels, title


@pytest.mark.parametrize("opk", example.attitudes())
def test_the_mistakes_are_what_they_are_called(opk):
    made = rotations.mistaken(opk)
    expected = {
        "transposed": Rotation.from_euler("xyz", -opk),
        "axes for vectors": Rotation.from_euler("XYZ", -opk),
        "other order": Rotation.from_euler("ZYX", opk[::-1]),
    }
    assert list(made) == list(expected)
    for name, rotation in expected.items():
        assert_allclose(made[name], rotation.as_matrix(), atol=1e-15)


def test_a_camera_pitched_up_looks_ahead_of_its_nadir():
    level, up = np.eye(3), rotation_from_opk(np.radians([0.0, -1.0, 0.0]))  # flown east
    assert_allclose(rotations.nadir_shift(level, up, 1000.0), [17.455, 0], atol=1e-3)


def test_every_mistake_is_missed_by_one_strip_or_seen_by_both():
    for row, small in ((0, "other order"), (2, "transposed")):
        opk = example.attitudes()[row]
        R = rotation_from_opk(opk)
        for name, wrong in rotations.mistaken(opk).items():
            shift = np.hypot(*rotations.nadir_shift(R, wrong, 480.0))
            assert shift < 0.2 if name == small else shift > 10


def test_roll_and_pitch_go_round_with_the_heading():
    (ax,) = panels(drawn(rotations.headings()))
    curves = {line.get_label(): line for line in ax.lines}
    omega, phi, _ = np.degrees(example.attitudes()[0])
    kappa, roll = curves["roll"].get_data()
    pitch = curves["pitch"].get_ydata()
    for degrees, expected in ((0, [omega, -phi]), (90, [phi, omega]), (180, [-omega, phi])):
        (i,) = np.flatnonzero(kappa == degrees)
        assert_allclose([roll[i], pitch[i]], expected, atol=1e-3)


def test_at_a_quarter_turn_omega_and_kappa_turn_about_one_axis():
    omega, phi, kappa = rotations.turning_axes(np.pi / 2)
    assert_allclose(kappa, omega, atol=1e-15)
    assert_allclose(phi @ kappa, 0, atol=1e-15)


def test_sigma_of_the_angles_has_its_closed_form():
    phi = np.radians([0.0, 30.0, 80.0])
    sigma, correlation = rotations.angle_sigmas(phi)
    assert_allclose(sigma, np.stack([1 / np.cos(phi), np.ones(3), 1 / np.cos(phi)], axis=1))
    assert_allclose(correlation, -np.sin(phi), atol=1e-15)


def test_the_figures_draw():
    drawn(rotations.axes())
    fig = drawn(rotations.mistakes(480.0))
    assert_labelled(fig)
    assert [title(ax) for ax in panels(fig)] == ["transposed", "axes for vectors", "other order"]
    drawn(rotations.singularity())
    assert_labelled(drawn(rotations.headings()))
