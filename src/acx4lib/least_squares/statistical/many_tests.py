"""Many tests at one joint level."""

from __future__ import annotations

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array


def holm(p: Array) -> Array:
    """Return the probabilities of many tests, each comparable with one joint level, by Holm.

    If every test is rejected whose value is below the level, the probability that any true
    hypothesis is among the rejected ones is below the level, however the tests depend on each
    other. Bonferroni's factor, the number of tests, applies to the smallest probability; the
    others need less.

    Parameters
    ----------
    p : ndarray, shape (n,)
        Of the single tests; NaN where there is none.

    Returns
    -------
    ndarray, shape (n,)
        Not below `p`, at most one; NaN stays.
    """
    expected.shape("p", p, ("n",))
    order = np.argsort(p, kind="stable")  # NaN comes last
    n = int(np.isfinite(p).sum())
    ordered = p[order]
    ordered[:n] = np.minimum(1.0, np.maximum.accumulate(ordered[:n] * np.arange(n, 0, -1)))
    out = np.empty_like(ordered)
    out[order] = ordered
    return out
