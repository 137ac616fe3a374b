"""The answer of the chapter on bad starts counts the adjustments that end in one place."""

import numpy as np

from acx4book.chapters.beyond.bad_starts import sentences
from acx4book.chapters.beyond.bad_starts.trials import FromBadStarts


def test_adjustments_that_end_elsewhere_are_not_counted():
    misfit = np.broadcast_to(np.array([8.0, 1.0, 0.1, 0.01])[:, None], (3, 4, 5))
    starts = FromBadStarts(misfit_deg=misfit, apart=np.array([1e-6, 2e-6, 0.5]))
    said = sentences.answer(starts)
    assert "by 8.0° in the median" in said
    assert "every angle 5°, the focal length 3 % and every coordinate of a tie point 100 m" in said
    assert "2 of 3 adjustments ended in the same place" in said
    assert "more than 5·10⁻¹ of its" in said
