import numpy as np

from acx4tools.measuring.pictures.corners import corners


def test_every_cell_has_one_corner_away_from_the_border(views):
    found = corners(views[0], number=100, margin=13)
    assert 80 <= len(found) <= 120
    size = np.array([views[0].camera.width_px, views[0].camera.height_px])
    assert np.all((found >= 13) & (found < size - 13))
    cells = np.unique(found // (size // 4), axis=0)
    assert len(cells) >= 16
