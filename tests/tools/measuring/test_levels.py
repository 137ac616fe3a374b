from dataclasses import replace

import numpy as np
import pytest

from acx4lib.geometry.frames import Pose
from acx4tools.measuring.levels import (
    COARSE_PX,
    STEP_DOWN,
    MeasureOptions,
    corners,
    overlapping,
    sizes_of,
)


def test_every_cell_has_one_corner_away_from_the_border(views):
    found = corners(views[0], number=100, margin=13)
    assert 80 <= len(found) <= 120
    size = np.array([views[0].camera.width_px, views[0].camera.height_px])
    assert np.all((found >= 13) & (found < size - 13))
    cells = np.unique(found // (size // 4), axis=0)
    assert len(cells) >= 16


def moved(view, by):
    return replace(view, T_m_c=Pose(R=view.T_m_c.R, r=view.T_m_c.r + by))


def test_neighbours_opposite_and_crossing_strips_overlap(views, surface):
    assert overlapping(views, surface) == [(i, j) for i in range(3) for j in range(i + 1, 3)]


def test_far_pictures_and_other_scales_do_not(views, surface):
    far = [views[0], moved(views[0], [3000.0, 0, 0]), moved(views[0], [0, 0, 5000.0])]
    assert overlapping(far, surface) == []


def test_levels_grow_by_no_more_than_a_step_to_the_size_asked_for(views):
    for reduce in (1, 2):
        own = [replace(view, shrink=1) for view in views]
        factors = [level[0] for level in sizes_of(own, reduce)]
        assert factors[-1] == reduce
        assert 11608 / factors[0] <= COARSE_PX * 1.01
        steps = np.array(factors[:-1]) / factors[1:]
        assert np.all((steps > 1) & (steps <= STEP_DOWN + 1))


def test_pictures_that_are_small_have_one_level(views):
    assert sizes_of([replace(view, shrink=16) for view in views], 1) == [[16] * 3]


def test_options_are_checked():
    with pytest.raises(ValueError, match="points"):
        MeasureOptions(points=5)
    with pytest.raises(ValueError, match="reduce"):
        MeasureOptions(reduce=0)


def test_the_last_level_knows_most(whole):
    matched = whole.outcome.matched
    assert matched.reduced == 1
    rays = matched.rays
    half = replace(matched, rays=rays[: len(rays) // 2])
    assert matched.weight > half.weight
    assert matched.weight == pytest.approx(np.sum((6 * rays.sigma_px) ** -2.0))
