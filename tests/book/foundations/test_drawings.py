"""Drawings of the foundations show what their chapters say."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4book.foundations import adjusting, example
from acx4book.foundations.designs import lines
from acx4book.foundations.drawings import adjustment, camera, frames, strips
from acx4book.paper import printed
from acx4lib.geometry.camera import Interior, distort
from acx4lib.geometry.camera import distortion as of_library
from acx4lib.geometry.frames import exp
from support.figures import assert_labelled, drawn, panels, title
from support.helpers import numeric_jacobian

# --- image -----------------------------------------------------------------------------------


def words(ax):
    return {text.get_text(): text for text in ax.texts if text.get_text()}


def test_the_ray_goes_through_the_image_point_to_the_ground():
    ax = drawn(camera.ray()).axes[0]
    said = words(ax)
    (x, y), (across, down) = said["image point $a$"].xy, said["point $A$"].xy
    assert_allclose(y / down, x / across)
    assert_allclose([-y, -down], [camera.F, camera.H])


# --- rotations -------------------------------------------------------------------------------


@pytest.mark.parametrize("opk", example.attitudes())
def test_the_mistakes_are_what_they_are_called(opk):
    made = frames.mistaken(opk)
    expected = {
        "transposed": Rotation.from_euler("xyz", -opk),
        "axes for vectors": Rotation.from_euler("XYZ", -opk),
        "other order": Rotation.from_euler("ZYX", opk[::-1]),
    }
    assert list(made) == list(expected)
    for name, rotation in expected.items():
        assert_allclose(made[name], rotation.as_matrix(), atol=1e-15)


def test_every_mistake_is_missed_by_one_strip_or_seen_by_both():
    """What the points below the axes of A1 and B1 are carried by, from the angles alone."""
    fig = drawn(frames.mistakes(480.0))
    for row, small in ((0, "other order"), (2, "transposed")):
        opk, image = example.attitudes()[row], example.EXPOSURES["image"][row]
        right = Rotation.from_euler("XYZ", opk).as_matrix()
        for ax, wrong in zip(panels(fig), frames.mistaken(opk).values(), strict=True):
            down = [480.0 * R[:2, 2] / -R[2, 2] for R in (right, wrong)]
            shift = np.hypot(*(down[1] - down[0]))
            assert f"{image}: {shift:.1f} m" in words(ax)
            assert shift < 0.2 if title(ax) == small else shift > 10


def test_roll_and_pitch_go_round_with_the_heading():
    (ax,) = panels(drawn(frames.headings()))
    curves = {line.get_label(): line for line in ax.lines}
    omega, phi, _ = np.degrees(example.attitudes()[0])
    kappa, roll = curves["roll"].get_data()
    pitch = curves["pitch"].get_ydata()
    for degrees, expected in ((0, [omega, -phi]), (90, [phi, omega]), (180, [-omega, phi])):
        (i,) = np.flatnonzero(kappa == degrees)
        assert_allclose([roll[i], pitch[i]], expected, atol=1e-3)


def test_sigma_of_the_angles_has_its_closed_form():
    ax = panels(drawn(frames.singularity()))[3]
    curves = {line.get_label(): line.get_data() for line in ax.lines}
    for label, closed in (
        ("σ of ω, the same as of κ", lambda phi: 1 / np.cos(phi)),
        ("σ of φ", lambda phi: 0 * phi + 1),
        ("correlation of ω and κ", lambda phi: -np.sin(phi)),
    ):
        degrees, values = curves[label]
        assert_allclose(values, closed(np.radians(degrees)), atol=1e-12)


# --- collinearity ----------------------------------------------------------------------------


HEIGHT_M = 480.0


def collinearity_image(turn, shift, xy):
    """Project points of flat ground, seen at xy by a level camera, once it is turned and moved."""
    ground = np.column_stack([xy / example.F_MM, -np.ones(len(xy))]) * HEIGHT_M
    D = (ground - shift) @ exp(turn)
    return -example.F_MM * D[:, :2] / D[:, 2:]


def test_the_columns_are_derivatives_of_the_projection():
    xy, zero = strips.grid(3, 3), np.zeros(3)
    by_turn = numeric_jacobian(lambda turn: collinearity_image(turn, zero, xy), zero)
    assert_allclose(strips.by_turn(xy), by_turn, atol=1e-6)
    by_shift = numeric_jacobian(lambda shift: collinearity_image(zero, shift, xy), zero, step=1e-3)
    fields = strips.effects(xy, HEIGHT_M)
    for k, (name, sign) in enumerate((("−x", -1), ("y", 1), ("−z", -1))):
        assert_allclose(fields[f"shift along {name}"], sign * by_shift[:, :, k], atol=1e-8)


def test_look_alikes_point_the_same_way():
    fields = strips.effects(strips.grid(), HEIGHT_M)
    for one, other in (
        ("turn about y", "shift along −x"),
        ("turn about x", "shift along y"),
        ("focal length", "shift along −z"),
    ):
        assert np.all(np.sum(fields[one] * fields[other], axis=1)[1:-1] >= 0)
    change = 0.1 / (example.F_MM / HEIGHT_M)
    assert_allclose(fields["focal length"], change * fields["shift along −z"], atol=1e-15)


def test_what_is_left_has_nothing_of_the_field_that_was_taken_out():
    fields = strips.effects(strips.grid(), HEIGHT_M)
    turn, shift = (fields[name].ravel() for name in ("turn about y", "shift along −x"))
    (factor,), (square,), *_ = np.linalg.lstsq(shift[:, None], turn, rcond=None)
    _, taken, left = panels(drawn(strips.look_alike(HEIGHT_M)))
    assert title(taken).startswith(f"{factor:.2f} m along −x")
    rms = 1000 * np.sqrt(2 * square / len(turn))
    assert f"RMS {rms:.0f} µm, drawn 5 times longer" in words(left)


# --- distortion ------------------------------------------------------------------------------


def test_radial_distortion_is_that_of_the_library_along_the_x_axis():
    ax = panels(drawn(camera.curves()))[0]
    curves = {line.get_label(): line.get_data() for line in ax.lines}
    for head in printed.HEADS:
        r, drawn_um = curves[head]
        lens = printed.interior(1, head)
        radial = Interior(f=lens.f, k1=lens.k1, k2=lens.k2, k3=lens.k3)
        along = of_library(radial, np.stack([r, 0 * r], axis=1))
        assert_allclose(drawn_um, 1000 * along[:, 0], rtol=1e-12)
    said = printed.statement("head_border_distortion_px")
    border = curves["CAM1"][1][-1] / 1000 / printed.pixel_mm("CAM1")
    assert border == pytest.approx(said, abs=1)


def test_the_balance_leaves_a_quarter_inside_and_at_the_border():
    k1, far = 2e-6, 33.0
    r = np.linspace(0, far, 10_001)
    left = k1 * r**3 - camera.balance(k1, far) * r
    assert_allclose([left.max(), left.min()], np.array([1, -1]) * k1 * far**3 / 4, rtol=1e-6)


def test_mistakes_are_of_the_order_that_the_series_gives():
    ax, k1 = panels(drawn(camera.directions("CAM1")))[0], printed.interior(1, "CAM1").k1
    found = {line.get_label(): printed.pixel_mm("CAM1") * line.get_ydata() for line in ax.lines[:3]}
    r = ax.lines[0].get_xdata()
    assert_allclose(found["other sign"], abs(2 * k1 * r**3), rtol=2e-2)
    assert_allclose(found["at the ideal point"], 3 * k1**2 * r**5, rtol=3e-2)
    assert_allclose(
        found["at the ideal point, $k_2$ converted too"], 12 * abs(k1) ** 3 * r**7, rtol=4e-2
    )
    at = distort(Interior(f=74.0, k1=k1), np.stack([r, 0 * r], axis=1))[:, 0]
    assert_allclose(found["at the ideal point"], abs(at - (r + k1 * r**3)), rtol=1e-6)


# --- least squares ---------------------------------------------------------------------------


def test_an_ellipse_has_the_points_of_equal_probability():
    cov = np.array([[4.0, 1.5], [1.5, 2.0]])
    (patch,) = adjustment.valley({"one": cov}).axes[0].patches
    vertices = patch.get_patch_transform().transform(patch.get_path().vertices)
    square = np.einsum("ni,ij,nj->n", vertices, np.linalg.inv(cov), vertices)
    assert_allclose(square[:-1:3], 1.0)  # every third vertex of the curves is no control point


# --- bundle ----------------------------------------------------------------------------------


def test_cost_is_that_of_the_formulas():
    fig = drawn(adjustment.cost(points_per_image=10, rays=4, width=20))
    assert_labelled(fig)
    whole, reduced, band = (dict(zip(*line.get_data(), strict=True)) for line in fig.axes[0].lines)
    assert whole[4] == adjusting.whole(4, 40, n_shared=14)
    assert reduced[10_000] == adjusting.reduced(10_000, 100_000, 4, n_shared=14)
    assert band[10_000] < reduced[10_000] < whole[10_000]


@pytest.mark.parametrize("column", [0, 1, 2])
def test_nothing_that_is_left_looks_like_a_movement(column):
    view = adjusting.view((0, 15, 0), relief_m=30.0)
    assert_allclose(view.by_pose.T @ view.left[:, column], 0.0, atol=1e-8)


# --- what the figures of direct georeferencing show is what the words beside them say --------


AT = np.array([[0.0, 0.0], [100.0, -50.0]])


def moved(shift=(0, 0, 0), turned=(0, 0, 0)):
    return strips.moved_on_ground(AT, 500.0, np.array(shift), np.array(turned))


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
    """Of every flight a dashed line down to the true point, then the ray: where they end."""
    found = {}
    for ax in strips.three_flights().axes:
        ends = [line.get_xdata()[-1] for line in ax.lines if len(line.get_xdata()) == 2][1:]
        found[title(ax)] = np.subtract(ends[1::2], ends[::2]).tolist()
    assert found == {
        "boresight": [0.5, -0.5, 1.0],
        "lever arm": [0.5, -0.5, 0.5],
        "GNSS shift": [0.5, 0.5, 0.5],
    }


# --- the Earth, its heights and the projection as they are drawn -----------------------------


def test_the_normal_meets_the_ellipse_at_right_angles():
    ax = frames.earth().axes[0]
    curve, normal = (ax.lines[i].get_xydata() for i in (0, 1))
    assert_allclose(curve[:, 0] ** 2 + (curve[:, 1] / frames.FLAT) ** 2, 1.0)
    ways = np.linspace(0, 1, 100_001)[:, None]
    along = normal[0] + ways * (normal[1] - normal[0])
    at = along[np.argmin(np.abs(along[:, 0] ** 2 + (along[:, 1] / frames.FLAT) ** 2 - 1))]
    gradient = at / np.array([1.0, frames.FLAT]) ** 2
    forward = normal[1] - normal[0]
    assert_allclose(forward / np.hypot(*forward), gradient / np.hypot(*gradient), atol=1e-4)


def test_the_second_axis_is_the_focal_length_that_the_scale_causes():
    east = np.array([200_000.0, 500_000.0])
    curves = {0.0: (east, np.array([1.0007, 0.9996])), 900.0: (east, np.array([1.0, 0.9995]))}
    ax = frames.projection(curves, focal_mm=74.0).axes[0]
    assert_allclose(ax.lines[0].get_ydata(), [700.0, -400.0], rtol=1e-9)
    to_um = ax.child_axes[0]._functions[0]
    # 74 mm / 0.9996 less 74 mm is 29.61 um; the axis leaves out the square of the scale
    assert_allclose(to_um(-400.0), 1000 * (74 / 0.9996 - 74), rtol=1e-3)


# --- plans, correlations and curves are drawn from what they are given -----------------------


def test_the_footprint_lies_along_the_flight():
    """30 x 40 mm at 500 m and 50 mm."""
    fig = strips.plans({"one": lines(0.0), "two": lines(90.0, height_m=1000.0)})
    for ax, size in zip(fig.axes, ([300.0, 400.0], [800.0, 600.0]), strict=True):
        assert_allclose(np.ptp(ax.lines[0].get_xydata(), axis=0), size)
