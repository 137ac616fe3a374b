"""Tables: what their rows have, and that shares add up."""

import numpy as np
import pytest

from acx4book.chapters.beyond.error_budget import as_printed, tables
from acx4book.chapters.beyond.error_budget.examined import PAPERS


def test_groups_have_a_row_for_every_method_kind_of_rays_and_coordinate(found):
    table = tables.groups(found)
    assert len(table) == len(found.validations) * 2 * 2
    assert table[list(tables.SHARES)].sum(axis=1).to_numpy() == pytest.approx(100.0)
    last = table.iloc[-1]
    assert (last["Rays"], last["Coordinate"]) == ("pairs", "height")
    assert last["RMS predicted (m)"] == pytest.approx(found.pairs(PAPERS).rms[2])
    assert table["RMS of d / σ"].between(0.5, 1.5).all()


def test_the_printed_flight_says_what_it_predicts_and_leaves(found):
    table = tables.printed_flight(found)
    assert len(table) == len(as_printed.assumptions())
    assert table.iloc[0, 0:2].tolist() == ["0.5", "0.05"]
    predicted, left = (float(x) for x in table.iloc[0, 2].split(", "))
    assert np.hypot(predicted, left) == pytest.approx(0.44, abs=0.01)
    assert table.iloc[2, 4].endswith("nothing")


def test_suspects_are_named_with_their_size(found):
    table = tables.suspects(found)
    assert table["Error"].tolist() == [one.name for one in as_printed.suspects(found)]
    assert table["Size needed"].str.contains(r"^[\d.]+(?: px| m|°)$").all()
