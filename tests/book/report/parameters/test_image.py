"""The drawn image and the distortion table: axes, corners, numbers of the library."""

import matplotlib as mpl
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.report.parameters import image
from acx4book.report.parameters.lens import balanced
from support.figures import drawn

mpl.use("agg")


@pytest.fixture(scope="module")
def lens(run):
    (one,) = image.shown_lenses(run)
    return one


def test_corners_are_half_a_format_from_the_middle_less_half_a_pixel(run, lens):
    table = image.corner_table(run).set_index("Corner")
    camera = lens.camera
    x = 0.5 * (camera.width_px - 1) * camera.pixel_mm
    assert float(table.loc["upper left", "x (mm)"]) == pytest.approx(-x, abs=1e-4)
    assert float(table.loc["upper left", "y (mm)"]) > 0  # y up, rows down
    assert table.loc["lower right", "Row (px)"] == f"{camera.height_px - 1}"


def test_the_profile_ends_at_the_farthest_corner_where_it_is_balanced(lens):
    found = image.profile(lens)
    assert_allclose(found["radius_mm"].iloc[-1], lens.radius)
    assert_allclose(abs(found["balanced_um"].iloc[-1]), 1000 * balanced(lens).largest, rtol=1e-9)
    f, last = lens.interior.f, found.iloc[-1]
    assert_allclose(
        f * np.tan(np.radians(last["angle_deg"])), lens.radius - last["radial_um"] / 1000
    )
    assert (np.diff(found["radius_mm"]) > 0).all()


def test_the_camera_is_drawn_with_its_axes_and_the_direction_of_flight(run, lens):
    fig = image.image_figure(run)
    drawn(fig)
    words = {text.get_text() for text in fig.axes[0].texts}
    assert {"x", "y", "col", "row", "body x"} <= words
    forward = lens.camera.T_b_c.R[0]  # the body's x axis seen from the camera, turned by 90 degrees
    assert_allclose(forward, [0, -1, 0], atol=1e-12)
    label = next(t for t in fig.axes[0].texts if t.get_text() == "body x")
    assert label.get_position()[1] > 0  # above the tail of an arrow that points down
