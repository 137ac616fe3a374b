from dataclasses import replace

from acx4lib.geometry.frames import Pose
from acx4tools.measuring.pictures.overlaps import overlapping


def moved(view, by):
    return replace(view, T_m_c=Pose(R=view.T_m_c.R, r=view.T_m_c.r + by))


def test_neighbours_opposite_and_crossing_strips_overlap(views, surface):
    assert overlapping(views, surface) == [(i, j) for i in range(3) for j in range(i + 1, 3)]


def test_far_pictures_and_other_scales_do_not(views, surface):
    far = [views[0], moved(views[0], [3000.0, 0, 0]), moved(views[0], [0, 0, 5000.0])]
    assert overlapping(far, surface) == []
