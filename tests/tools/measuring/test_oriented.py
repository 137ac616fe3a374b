import numpy as np

from acx4lib.flight.block import select_images
from acx4tools.measuring.flights import read_unmeasured
from acx4tools.measuring.measure import views_of
from acx4tools.measuring.oriented import approximate, refined
from acx4tools.measuring.points import TieRays


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
