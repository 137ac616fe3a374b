"""The least-squares core alone, on NIST's certified regressions."""

from __future__ import annotations

import pytest

from acx4book.reference import nist
from support.helpers import needs

pytestmark = needs("nist-strd")

NOT_FROM_START_1 = {"BoxBOD"}
"""The first steps lead where its exponential vanishes; MINPACK does not get there, either."""

DIGITS = 8
"""What is asked for; the certified values have eleven."""


@pytest.fixture(scope="module")
def table():
    return nist.results()


def test_all_twenty_are_there(table):
    assert len(nist.MODELS) == 20
    assert set(table["dataset"]) == set(nist.MODELS)
    assert set(table["start"]) == {1, 2}


def test_eight_digits_everywhere_from_the_second_start(table):
    own = table[table["start"] == 2]
    wrong = own[~(own["digits"] >= DIGITS)]
    assert wrong.empty, wrong.to_string()


def test_eight_digits_from_the_first_start_where_the_method_gets_there(table):
    own = table[(table["start"] == 1) & ~table["dataset"].isin(NOT_FROM_START_1)]
    wrong = own[~(own["digits"] >= DIGITS)]
    assert wrong.empty, wrong.to_string()


def test_where_it_does_not_get_there_it_says_so(table):
    """A wrong minimum is never returned in silence: the parameters are open there."""
    own = table[(table["start"] == 1) & table["dataset"].isin(NOT_FROM_START_1)]
    assert (own["outcome"] == "no step reduces the cost any more").all()
    others = table[~table.index.isin(own.index)]
    assert (others["outcome"] == nist.CONVERGED).all()
