"""Medians of groups of numbers."""

from __future__ import annotations

import numpy as np

from acx4lib.expected import Array, Index


def medians(values: Array, group: Index, n_groups: int) -> Array:
    """Return the (lower) median of each group; zero for an empty one, NaN counts as infinite."""
    order = np.lexsort((values, group))
    count = np.bincount(group, minlength=n_groups)
    middle = np.cumsum(count) - count + (count - 1) // 2
    out = np.zeros(n_groups)
    out[count > 0] = np.nan_to_num(values[order[middle[count > 0]]], nan=np.inf)
    return out
