"""The answer of the chapter on bad starts."""

from __future__ import annotations

import numpy as np

from acx4book.chapters.beyond.bad_starts.trials import OFF_DEG, OFF_FOCAL, OFF_M, FromBadStarts
from acx4book.typesetting.myst import scientific

SAME = 1e-3
"""Standard deviations by which two adjustments may differ and count as one."""


def answer(starts: FromBadStarts) -> str:
    """Say how far off starts may be, and whether the ends agree.

    Parameters
    ----------
    starts : FromBadStarts
    """
    given = np.median(starts.misfit_deg[:, 0])
    same = int(np.sum(starts.apart < SAME))
    return (
        f"At least this wrong: with every angle {OFF_DEG:g}°, the focal length "
        f"{100 * OFF_FOCAL:g} % and every coordinate of a tie point {OFF_M:g} m off, rays pass "
        f"their points by {given:.1f}° in the median. {same} of {len(starts.apart)} adjustments "
        "ended in the same place; no parameter differs from the usual adjustment by more than "
        f"{scientific(starts.apart.max())} of its standard deviation. Start values need not "
        "be good where positions are known and cameras are turned first."
    )
