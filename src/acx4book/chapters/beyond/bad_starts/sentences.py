"""The answer of the chapter on bad starts."""

from __future__ import annotations

import numpy as np

from acx4book.chapters.beyond.bad_starts.trials import FromBadStarts

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
        f"Rays passed their points by {given:.1f}° in the median at the start, and {same} of "
        f"{len(starts.apart)} adjustments ended in the same place: no parameter differs from the "
        f"usual adjustment by more than {starts.apart.max():.1g} of its standard deviations. Start "
        "values need not be good where positions are known and cameras are turned first."
    )
