"""Figures of the heads together beside the heads one by one."""

from types import SimpleNamespace

import numpy as np
import pytest

from acx4book.chapters.beyond.rig.deformations import deformation
from acx4book.chapters.beyond.rig.figures import (
    gains,
    median_gains,
    rig_correlations,
    rig_deformations,
    rig_gains,
)
from acx4lib.calibration import heads, rig
from acx4lib.flight.parts import unshared
from acx4lib.stages import attempt
from acx4lib.tie_points.ties import refine_by_mean_differences, shared_points
from support import blocks
from support.figures import assert_texts_apart, drawn, panels
from support.flights import rigs


@pytest.fixture(scope="module")
def ways():
    """The orientations of two heads, by each way to find them."""
    block = blocks.noisy(rigs.simulated(ties=60), np.random.default_rng(8))
    names = [camera.name for camera in block.cameras]
    held, with_f = (
        heads.relative_orientation(
            heads.calibrate_heads(block, names, free=free), rigs.SYNTHETIC, weak=True
        )
        for free in (rigs.FREE, ("f", *rigs.FREE))
    )
    rigid, apart = (
        rig.relative_orientation(rig.calibrate(one, free=rigs.FREE), rigs.SYNTHETIC, weak=True)
        for one in (block, unshared(block))
    )
    refined = refine_by_mean_differences(held, shared_points(block, held))
    return SimpleNamespace(
        held=held, refined=refined, with_f=with_f, apart=apart, rigid=rigid, block=block
    )


@pytest.fixture
def failed():
    return attempt(heads.relative_orientation, heads.Heads(bundles={}, failures={"A": "no"}), None)


def test_focal_lengths_are_held_in_one_way_only(ways):
    f = [head.interior.f for head in ways.held.heads]
    assert f == [head.interior.f for head in ways.refined.heads] == [50.0, 50.1]  # as declared
    for one in (ways.with_f, ways.apart, ways.rigid):
        assert 0 < abs(one.heads[0].interior.f - 50.0) < 0.1


def test_more_knowledge_makes_smaller_sigmas(ways):
    """The rig has all observations of the heads one by one, and the trajectory besides."""
    assert np.all(gains(ways.with_f, ways.rigid) > 1)
    assert np.all(gains(ways.apart, ways.rigid) > 1)
    assert np.isnan(gains(ways.held, ways.rigid)[0, 2])  # Zc of the first head is held


def test_medians_of_gains_are_by_kinds_of_parameters(ways, failed):
    found = median_gains(ways.apart, ways.rigid)
    assert list(found) == ["$X_c$ and $Y_c$", "$Z_c$", "the angles"]
    every = gains(ways.apart, ways.rigid)
    assert list(found.values()) == [np.median(every[:, a:b]) for a, b in ((0, 2), (2, 3), (3, 6))]
    assert median_gains(failed, ways.rigid) == {}


def test_gains_have_a_panel_for_each_way_that_has_an_outcome(ways, failed):
    fig = drawn(rig_gains({"alone": ways.held, "nothing": failed, "apart": ways.apart}, ways.rigid))
    assert [ax.get_title(loc="left") for ax in panels(fig)] == ["alone", "apart"]
    assert len(drawn(rig_gains({"nothing": failed}, ways.rigid)).axes) == 1


def test_correlations_have_a_panel_for_each_way_that_has_an_outcome(ways, failed):
    fig = drawn(rig_correlations({"alone": failed, "rig": ways.rigid}))
    assert_texts_apart(fig)
    (text,) = [ax.get_title(loc="left") for ax in panels(fig)][:1]
    assert text == "rig"
    assert len(drawn(rig_correlations({"alone": failed})).axes) == 1


def test_deformations_are_drawn_with_and_without_a_truth(ways):
    for truth in (None, ways.rigid):
        found = {"alone": deformation(ways.held, rigs.SYNTHETIC, truth=truth)}
        fig = drawn(rig_deformations(rigs.SYNTHETIC, found))
        (title,) = [ax.get_title(loc="left") for ax in panels(fig)][:1]
        assert title == "alone"
