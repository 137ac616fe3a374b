"""Figures of the rig."""

from __future__ import annotations

import matplotlib.pyplot as plt

from acx4book.reference.surround.figures import (
    surround_enlarged,
    surround_ground,
    surround_misfits,
    surround_photographs,
)


def test_figures_have_a_panel_for_what_they_show(cameras, images, views, corners):
    refinements = {"before": cameras, "after": cameras}
    stages = {"before": views, "after": views}
    assert len(surround_photographs(cameras, images).axes) == 4
    assert len(surround_ground(cameras, views, views).axes) == 2
    assert len(surround_misfits(refinements, corners).axes) == 2
    assert len(surround_enlarged(cameras, corners, stages).axes) == 4 * 4
    assert plt.get_fignums() == []
