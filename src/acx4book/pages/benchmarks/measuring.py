"""What ``acx4 measure`` takes, and what fifty pictures of full size would, by computation.

The numbers are those of ``make bench``, which leaves them in ``data/benchmarks``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.pages.benchmarks import stored
from acx4book.typesetting.myst import myst_table
from acx4lib.expected import Array

TITLES = {
    "pictures": "Pictures",
    "megapixels": "Megapixels each",
    "levels": "Levels",
    "pairs": "Pairs",
    "cpu_s": "CPU seconds",
    "tree_mb": "MB",
}


def read(folder: Path) -> pd.DataFrame:
    """Read what ``make bench`` left in a folder, and fill in what was not run."""
    _, (table,) = stored.read(folder, "measuring")
    return computed(table)


def computed(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with time and memory of the rows that have none.

    A pair costs the same at each level of the search, and a picture by its pixels, which are read
    at each level; what the library costs alone is a row without pictures. Memory grows with the
    pixels of a picture, because a few are held at a time.

    Parameters
    ----------
    table : DataFrame
        ``measuring.csv``: `pictures`, `megapixels`, `levels`, `pairs`, `cpu_s`, `tree_mb`.
    """
    found = table.copy()
    run = found["cpu_s"].notna().to_numpy()
    ones = np.ones(len(found))
    pixels = found["megapixels"].to_numpy()
    levels, pairs, pictures = (found[name].to_numpy() for name in ("levels", "pairs", "pictures"))
    by = {
        "cpu_s": np.column_stack([ones, levels * pairs, levels * pictures * pixels]),
        "tree_mb": np.column_stack([pictures == 0, pictures > 0, pixels]),
    }
    for name, A in by.items():
        found.loc[~run, name] = A[~run] @ _costs(A[run], found.loc[run, name].to_numpy())
    return found.assign(run=run)


def _costs(A: Array, cost: Array) -> Array:
    """Return the costs by least squares; none is below zero."""
    from scipy.optimize import nnls  # noqa: PLC0415 here alone

    weights = 1 / cost
    return np.asarray(nnls(A * weights[:, None], cost * weights)[0])


def page(table: pd.DataFrame) -> str:
    """Return the measured and the computed costs as MyST text."""
    shown = table[table["pictures"] > 0]
    own = shown[list(TITLES)].rename(columns=TITLES)
    own.insert(0, "", np.where(shown["run"], "measured", "computed"))
    formats = {"Megapixels each": ".1f", "CPU seconds": ",.0f", "MB": ",.0f"}
    caption = (
        "Measuring pictures: CPU time, and the largest memory of all processes together; "
        "what is computed follows from the costs of a pair and of a megapixel in the other rows"
    )
    return myst_table(own, caption, name="tab-speed-measure", formats=formats)
