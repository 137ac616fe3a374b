import numpy as np

from acx4tools.measuring.surveyed.targets import find_targets
from support.pictures import measured


def test_targets_are_found_to_a_twentieth_of_a_pixel(whole):
    found = measured.target_errors(whole.measured, whole.truth)
    assert len(found.off) >= 4
    assert np.max(np.hypot(*found.off.T)) < 0.2
    assert np.sqrt(np.mean(found.off**2)) < 0.05
    assert np.mean(found.z**2) < 2.5


def test_where_no_target_is_nothing_is_found(views, surface):
    x, y = np.meshgrid(np.linspace(-150, 150, 3), np.linspace(-150, 150, 3))
    xy = views[0].T_m_c.r[0, :2] + np.column_stack([x.ravel(), y.ravel()]) + 7.0
    nowhere = np.column_stack([xy, surface.heights(xy)])
    assert len(find_targets(views, nowhere)) <= 2  # a bright spot or two by chance
