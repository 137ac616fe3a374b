"""Heads oriented one by one and together, and what more knowledge gains."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.rig import one_by_one
from acx4book.chapters.beyond.rig.one_by_one import (
    ONE_BY_ONE,
    REFINED,
    RIG,
    UNSHARED,
    WITH_F,
    gains,
    unshared,
)
from acx4lib.calibration import rig
from acx4lib.stages.rig import RigStage
from support import blocks
from support.flights import rigs


@pytest.fixture(scope="module")
def block():
    return blocks.noisy(rigs.simulated(ties=60), np.random.default_rng(8))


@pytest.fixture(scope="module")
def ways(block):
    return in_every_way(block)


def in_every_way(block):
    flight = SimpleNamespace(
        synthetic_camera=rigs.SYNTHETIC, estimate_heads=rigs.FREE, refraction="none"
    )
    together = rig.calibrate(block, free=rigs.FREE)
    return one_by_one.oriented(flight, RigStage(block=block, rig=together))


def test_heads_are_oriented_in_every_way(ways):
    assert list(ways) == [ONE_BY_ONE, REFINED, WITH_F, UNSHARED, RIG]
    f = {title: [head.interior.f for head in one.heads] for title, one in ways.items()}
    assert f[ONE_BY_ONE] == f[REFINED] == [50.0, 50.1]  # held at the declared values
    assert all(0 < abs(f[title][0] - 50.0) < 0.1 for title in (WITH_F, UNSHARED, RIG))


def test_more_knowledge_makes_smaller_sigmas(ways):
    """The rig has all observations of the heads one by one, and the trajectory besides."""
    assert np.all(gains(ways[WITH_F], ways[RIG]) > 1)
    assert np.all(gains(ways[UNSHARED], ways[RIG]) > 1)
    assert np.isnan(gains(ways[ONE_BY_ONE], ways[RIG])[0, 2])  # Zc of the first head is held


def test_heads_that_cannot_be_adjusted_alone_still_make_a_rig(block):
    """One head sees no control point: alone it has no datum, on the rig it needs none."""
    points = block.image_points
    blind = (block.images.camera_idx[points.image_idx] == 1) & np.isin(
        points.point_idx, block.control.point_idx
    )
    some = replace(block, image_points=points[~blind])
    found = in_every_way(some)
    assert ONE_BY_ONE not in found
    assert RIG in found


def test_heads_without_shared_points_keep_every_measurement(block):
    alone = unshared(block)
    points, before = alone.image_points, block.image_points
    assert_allclose(points.colrow, before.colrow)
    assert len(set(alone.points)) == len(alone.points)
    head = alone.images.camera_idx[points.image_idx]
    ties = ~np.isin(points.point_idx, block.control.point_idx)
    for point in np.unique(points.point_idx[ties]):
        assert len(set(head[points.point_idx == point])) == 1
    said = [alone.points[i].partition(" ")[0] for i in points.point_idx]
    assert said == [block.points[i] for i in before.point_idx]
    assert np.all(points.point_idx[~ties] == before.point_idx[~ties])
