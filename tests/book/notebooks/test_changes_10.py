"""What notebook 10 says of its changes is seen in its tables."""

import numpy as np
import pytest

from acx4book.chapters.beyond.image_quality import examined
from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

DRAWN = "draws = examined.drawn_errors(known, 50, seed=1, angle_deg={})"
TARGETS = "targets = examined.border_distortion_of_targets(known, {}, seed=1)"


@pytest.mark.slow
def test_drawn_angles_and_errors_of_targets_go_where_the_text_says():
    old, new = TARGETS.format("200, sigma_px=0.5"), TARGETS.format("50, sigma_px=0.1")
    angles = {DRAWN.format(0.01): DRAWN.format(0.03).replace("50", "10")}
    found = changed("10", {old: new, **angles}, reduce=16)
    known = found["known"]
    draws = examined.drawn_errors(known, 10, seed=1, angle_deg=0.01)
    before, after = (
        one.groupby("refinement")["oriented_px"].median() for one in (draws, found["draws"])
    )
    assert 2.3 < after["mean shift"] / before["mean shift"] < 3.1
    assert after["rotations"] == pytest.approx(before["rotations"], rel=0.1)
    targets = examined.border_distortion_of_targets(known, 50, sigma_px=0.5, seed=1)
    invented = np.median(found["targets"].radial_px)
    assert np.median(targets.radial_px) == pytest.approx(5 * invented, rel=0.02)
