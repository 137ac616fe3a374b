import numpy as np
from numpy.testing import assert_allclose

from acx4book.foundations.drawings import image
from support.figures import drawn, panels


def words(ax):
    return {text.get_text(): text for text in ax.texts if text.get_text()}


def test_the_ray_goes_through_the_image_point_to_the_ground():
    ax = drawn(image.ray()).axes[0]
    said = words(ax)
    (x, y), (across, down) = said["image point $a$"].xy, said["point $A$"].xy
    assert_allclose(y / down, x / across)
    assert_allclose([-y, -down], [image.F, image.H])


def test_no_label_of_the_ray_lies_on_another():
    fig = drawn(image.ray())
    boxes = [text.get_window_extent() for text in words(fig.axes[0]).values()]
    overlaps = [a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i]]
    assert not np.any(overlaps)


def test_the_same_point_has_coordinates_half_a_pixel_apart():
    found = [
        next(t for t in words(ax) if t[0] == "(") for ax in panels(drawn(image.first_pixels()))
    ]
    assert found == ["(2, 1)", "(2.5, 1.5)"]
