"""What measuring fifty large pictures takes follows from what eight small ones took."""

import numpy as np
import pandas as pd
import pytest

from acx4book.pages.benchmarks import measuring

ALONE_S, PAIR_S, MEGAPIXEL_S = 1.2, 0.3, 0.05
ALONE_MB, HELD_MB, MEGAPIXEL_MB = 170.0, 250.0, 8.0


def row(pictures, megapixels, levels, pairs):
    return {"pictures": pictures, "megapixels": megapixels, "levels": levels, "pairs": pairs}


ROWS = pd.DataFrame(
    [
        row(0, 0.0, 0, 0),
        *(row(8, 1.6, 2, 26), row(8, 6.3, 2, 26), row(8, 25.3, 3, 26)),
        row(50, 101.0, 3, 300),
    ]
)


def truth(rows):
    matched = PAIR_S * rows["pairs"] + MEGAPIXEL_S * rows["pictures"] * rows["megapixels"]
    memory = np.where(rows["pictures"] > 0, HELD_MB + MEGAPIXEL_MB * rows["megapixels"], ALONE_MB)
    return ALONE_S + rows["levels"] * matched, memory


def measured():
    cpu_s, tree_mb = truth(ROWS)
    rows = ROWS.assign(cpu_s=cpu_s, tree_mb=tree_mb)
    rows.loc[len(rows) - 1, ["cpu_s", "tree_mb"]] = np.nan
    return rows


def test_costs_are_recovered():
    found = measuring.computed(measured()).iloc[-1]
    cpu_s, tree_mb = truth(ROWS)
    assert found["cpu_s"] == pytest.approx(cpu_s.iloc[-1])
    assert found["tree_mb"] == pytest.approx(tree_mb[-1])
    assert not found["run"]


def test_a_picture_that_costs_nothing_never_has_a_negative_cost():
    rows = measured()
    rows.loc[3, "cpu_s"] = rows.loc[1, "cpu_s"]  # larger pictures, more levels, and no longer
    found = measuring.computed(rows)
    assert found["cpu_s"].iloc[-1] > found["cpu_s"].iloc[3]


def test_the_page_says_what_was_run():
    lines = measuring.page(measuring.computed(measured())).splitlines()
    assert sum("| measured" in line or "measured |" in line for line in lines) == 3
    assert any("computed" in line and "101.0" in line for line in lines)
