"""A choice of strips as tables."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4lib.planning.choosing.chosen import Chosen
from acx4lib.planning.choosing.target import BLOCK


def wanted(chosen: Chosen) -> pd.DataFrame:
    """Return a row for everything that is wanted: the limit, with all candidates, and as chosen."""
    return pd.DataFrame(
        {
            "camera": [one.camera for one in chosen.wanted],
            "wanted": [one.name for one in chosen.wanted],
            "limit": [one.limit for one in chosen.wanted],
            "all_candidates": [one.with_all for one in chosen.wanted],
            "chosen": chosen.given,
        }
    )


def strips(chosen: Chosen) -> pd.DataFrame:
    """Return a row for every chosen strip and everything that is wanted.

    Columns are the strip, its flying height and course, the flying time up to its end, what is
    wanted, and what the flight gives after this strip and where it alone is left out.
    """
    listed = chosen.plan.blocks[BLOCK].strips
    n, k = len(listed), len(chosen.wanted)

    def each(values: list[object]) -> list[object]:
        return [value for value in values for _ in range(k)]

    return pd.DataFrame(
        {
            "strip": each([*listed]),
            "flying_height_m": each([one.flying_height_m for one in listed.values()]),
            "course_deg": each([one.course_deg for one in listed.values()]),
            "minutes": each([*chosen.minutes_after]),
            "camera": [one.camera for one in chosen.wanted] * n,
            "wanted": [one.name for one in chosen.wanted] * n,
            "after": np.ravel(chosen.after),
            "without": np.ravel(chosen.without),
        }
    )
