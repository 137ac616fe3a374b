import numpy as np

from acx4lib.flight.block import select_images
from acx4tools.measuring.measure import read_unmeasured, views_of
from acx4tools.measuring.oriented import TieRays, approximate, chosen, joined, refined
from acx4tools.measuring.pairs import Found

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


def block_and_views(whole):
    flight = read_unmeasured(whole.flight).flight
    files = flight.image_files["calibration"]
    keep = np.array([path is not None for path in files])
    block = select_images(flight.calibration, keep)
    return block, views_of(flight, block, [path for path in files if path is not None])


def test_a_ray_that_misses_the_others_is_rejected(whole):
    block, views = block_and_views(whole)
    rays = whole.outcome.matched.rays
    many = np.flatnonzero(np.bincount(rays.point)[rays.point] == 3)[7]
    colrow = rays.colrow.copy()
    colrow[many] += [4.0, 12.0]
    spoilt = TieRays(point=rays.point, view=rays.view, colrow=colrow, sigma_px=rays.sigma_px)
    found = refined(approximate(block, 600.0), views, spoilt)
    assert not found.kept[many]
    assert np.mean(found.kept) > 0.97


def test_orientation_and_ground_come_near_the_truth(whole):
    block, views = block_and_views(whole)
    found = refined(approximate(block, 600.0), views, whole.outcome.matched.rays)
    camera = whole.truth["cameras"]["CAM"]
    interior = found.views[0].camera.interior
    assert abs(interior.k1 - camera["k1"]) < 1e-6
    turned = views[0].T_m_c.R[0].T @ found.views[0].T_m_c.R[0]
    assert 0.1 < np.degrees(np.arccos((np.trace(turned) - 1) / 2)) < 0.8  # a boresight of 0.4
    heights = found.surface.z
    control = block.frame.from_grid(np.array(list(whole.truth["control_points"].values())))
    assert abs(np.median(heights) - np.median(control[:, 2])) < 20
