"""Verdicts on predicted standard deviations in words, with their numbers."""

from __future__ import annotations

import pandas as pd

from acx4book.typesetting.myst import inside, p_value
from acx4lib.least_squares.verdict import FAILS


def spreads(table: pd.DataFrame) -> dict[str, object]:
    """Return what the tests of `accuracy.spread_table` say together.

    Returns
    -------
    dict of str to object
        The number ``n`` of tests; those ``outside`` of the limits of a single test, in words with
        their numbers; the smallest ``p`` of all jointly, by Holm, behind its sign; ``fails``, those
        of them whose prediction does not hold.
    """
    if table.empty:
        return {"n": 0, "outside": [], "p": "", "fails": []}
    p = p_value(table["p joint"].min())
    return {
        "n": len(table),
        "outside": _in_words(table[table["limits"] != "inside"]),
        "p": p if p.startswith("<") else f"= {p}",
        "fails": _in_words(table[table["state"] == FAILS]),
    }


def _in_words(table: pd.DataFrame) -> list[str]:
    """Return the number of each test with the limit that it is near."""
    rows = table.rename_axis(["method", "coordinate"]).reset_index().to_dict("records")
    limits = [row["lower limit" if row["limits"] == "below" else "upper limit"] for row in rows]
    return [
        f"{row['RMS of d / σ']:.3f} in {row['coordinate']} ({inside(row['method'])}; "
        f"limit {limit:.3f}, p = {row['p']:.3f})"
        for row, limit in zip(rows, limits, strict=True)
    ]
