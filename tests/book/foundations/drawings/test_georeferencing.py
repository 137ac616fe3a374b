"""What the figures of direct georeferencing show is what the words beside them say."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from acx4book.foundations.drawings import georeferencing as drawings

AT = np.array([[0.0, 0.0], [100.0, -50.0]])


def moved(shift=(0, 0, 0), turned=(0, 0, 0)):
    return drawings.moved_on_ground(AT, 500.0, np.array(shift), np.array(turned))


def test_a_shift_moves_all_points_alike_and_a_height_moves_them_outwards():
    assert_allclose(moved(shift=(0.03, 0.01, 0)), [[0.03, 0.01]] * 2)
    assert_allclose(moved(shift=(0, 0, 0.05)), AT * 0.05 / 500)


def test_a_rotation_moves_points_as_the_turned_ray_does():
    """Exactly, by turning the ray and meeting the ground, to the square of the angle."""
    for axis in range(3):
        turned = np.eye(3)[axis] * 1e-5
        j, k = (axis + 1) % 3, (axis + 2) % 3
        R = np.eye(3)
        R[j, j] = R[k, k] = np.cos(1e-5)
        R[k, j], R[j, k] = np.sin(1e-5), -np.sin(1e-5)
        ray = np.column_stack([AT, [-500.0, -500.0]]) @ R.T
        exact = -500.0 * ray[:, :2] / ray[:, 2:] - AT
        assert_allclose(moved(turned=turned), exact, atol=1e-7)  # 1e-10 of the height


def test_opposite_lines_and_another_height_tell_the_three_errors_apart():
    found = {
        kind: [drawings.missed(kind, way, h)[1] for way, h in ((1, 1), (-1, 1), (1, 2))]
        for kind in ("boresight", "lever arm", "GNSS shift")
    }
    assert found == {
        "boresight": [0.5, -0.5, 1.0],
        "lever arm": [0.5, -0.5, 0.5],
        "GNSS shift": [0.5, 0.5, 0.5],
    }


@pytest.mark.parametrize("strip", ["A", "B"])
def test_misclosures_are_drawn_with_their_direction(strip):
    xy = np.arange(16.0).reshape(8, 2)
    d = np.tile([[3.0, 4.0]], (8, 1))
    fig = drawings.misclosures(xy, 100 * d, d)
    drawn = [q for q in fig.axes[0].collections if q.get_label() == f"strip {strip}"]
    assert_allclose(drawn[0].U / drawn[0].V, 0.75)
    assert {text.get_text() for ax in fig.axes for text in ax.texts} == {"500 µm", "5 µm"}


def test_the_drawings_name_their_parts():
    words = {text.get_text() for text in drawings.vector_sum().axes[0].texts}
    assert {"IMU, $b$", r"$R_b^m r_c^b$"} <= words
    assert [ax.get_title(loc="left") for ax in drawings.three_flights().axes] == [
        "boresight",
        "lever arm",
        "GNSS shift",
    ]
    fig = drawings.ground_errors(
        height_m=500.0, half_m=(200.0, 150.0), position_m=np.ones(3), attitude_rad=np.full(3, 1e-4)
    )
    assert isinstance(fig, Figure)
    assert [ax.get_title(loc="left") for ax in fig.axes[:2]] == ["position forward", "height"]
