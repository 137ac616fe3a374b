import numpy as np

from acx4tools.measuring.pairs import Found
from acx4tools.measuring.points import chosen, joined

AT = [np.array([[100, 100], [300, 100]]), np.array([[50, 60]]), np.zeros((0, 2), np.intp)]


def found(which, colrow, sigma):
    n = len(which)
    return Found(
        which=np.array(which, np.intp),
        colrow=np.array(colrow, float).reshape(n, 2),
        sigma_px=np.array(sigma, float).reshape(n, 2),
    )


ONE_CAMERA = np.zeros(3, np.intp)


def three_views(camera=ONE_CAMERA):
    nothing = found([], [], [])
    return joined(
        AT,
        {
            (0, 1): (found([0, 1], [[90, 95], [280, 90]], [[0.2, 0.1], [0.2, 0.1]]), nothing),
            (0, 2): (found([0], [[80, 90]], [[0.4, 0.3]]), nothing),
            (1, 2): (found([0], [[31, 41]], [[0.1, 0.1]]), nothing),
        },
        camera,
    )


def test_a_corner_and_its_places_are_one_point():
    rays = three_views()
    assert rays.point.tolist() == [0, 0, 0, 1, 1, 2, 2]
    assert rays.view.tolist() == [0, 1, 2, 0, 1, 1, 2]
    np.testing.assert_array_equal(rays.colrow[:3], [[100, 100], [90, 95], [80, 90]])


def test_half_of_the_variance_of_a_difference_belongs_to_either_picture():
    rays = three_views()
    # the corner's own: the mean of its two differences
    expected = np.sqrt([(0.2**2 + 0.4**2) / 4, 0.1**2 / 2, 0.3**2 / 2])
    np.testing.assert_allclose(rays.sigma_px[:3], expected)


def test_three_rays_are_needed_only_where_three_pictures_show_the_place():
    rays = three_views()
    shown = np.array([3, 3, 3, 3, 3, 2, 2])
    assert set(chosen(rays, shown, apart_px=5).point) == {0, 2}


def test_of_two_points_on_the_same_texture_the_one_with_more_rays_stays():
    rays = three_views()
    moved = rays.colrow.copy()
    moved[5] = [97, 103]  # beside the point 0 in view 1
    near = type(rays)(point=rays.point, view=rays.view, colrow=moved, sigma_px=rays.sigma_px)
    shown = np.full(7, 2)
    assert set(chosen(near, shown, apart_px=10).point) == {0, 1}
    assert set(chosen(near, shown, apart_px=2).point) == {0, 1, 2}


def test_points_of_another_head_on_the_same_texture_stay():
    rays = three_views(np.array([0, 1, 0]))
    assert rays.of_head.tolist() == [True, False, True, True, False, True, False]
    shown = np.full(7, 2)
    assert set(chosen(rays, shown, apart_px=60).point) == {0, 1, 2}
    assert set(chosen(three_views(), shown, apart_px=60).point) == {0, 1}


def test_nothing_found_is_no_point():
    rays = joined(AT, {}, ONE_CAMERA)
    assert len(rays) == 0
    assert len(chosen(rays, np.zeros(0, int), apart_px=10)) == 0
