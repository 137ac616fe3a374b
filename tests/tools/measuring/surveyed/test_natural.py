import numpy as np

from acx4tools.measuring.surveyed.natural import carried


def test_a_tie_point_is_found_again_between_the_pixels(whole):
    """A corner of one picture is carried from there into those in which it was matched."""
    matched = whole.outcome.matched
    rays = matched.rays
    off = []
    for point in np.unique(rays.point)[:60]:
        own = rays[rays.point == point]
        others = [matched.views[v] for v in own.view[1:]]
        view = matched.views[own.view[0]]
        which, places, sigma = carried(view, others, matched.surface, own.colrow[0])
        off += list(np.hypot(*(places - own.colrow[1:][which]).T))
        assert np.all(sigma > 0)
    assert len(off) > 80
    assert np.median(off) < 0.1
