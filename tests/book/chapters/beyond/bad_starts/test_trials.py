"""Bad starts on purpose, and their figure."""

import numpy as np
import pytest

from acx4book.chapters.beyond.bad_starts import figures
from acx4book.chapters.beyond.bad_starts.trials import OFF_DEG, PHASES, from_bad_starts, single_step


@pytest.fixture(scope="module")
def starts():
    return from_bad_starts(single_step("single-head", 1), seeds=(1, 2))


def test_each_phase_brings_rays_nearer_and_all_ends_are_one(starts):
    given, turned, robust, adjusted = np.moveaxis(starts.misfit_deg, 1, 0)
    assert given.shape == (2, 37)
    assert np.median(given) > OFF_DEG  # about three axes
    assert turned.max() < 0.1 * given.min()
    assert adjusted.max() < 0.01  # deg; of 0.4 px, that is 0.002
    assert robust.max() == pytest.approx(adjusted.max(), rel=0.1)
    assert starts.apart.shape == (2,)
    assert starts.apart.max() < 1e-3


def test_the_figure_has_every_phase_and_every_start(starts):
    fig = figures.from_bad_starts(starts)
    left, right = fig.axes
    assert [label.get_text() for label in left.get_xticklabels()] == list(PHASES)
    medians = np.median(np.moveaxis(starts.misfit_deg, 1, 0).reshape(4, -1), axis=1)
    np.testing.assert_allclose(left.lines[0].get_ydata(), medians)
    np.testing.assert_allclose(right.lines[0].get_ydata(), np.maximum(starts.apart, 1e-12))
