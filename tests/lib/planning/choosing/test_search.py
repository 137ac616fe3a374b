from itertools import combinations

import numpy as np
import pytest

from acx4lib.planning.choosing.search import cheapest, in_order


def covering(sets, n):
    """Return a lack that counts what no chosen set has: a problem whose optimum is by hand."""

    def lack(chosen):
        return float(n - len(set().union(*(sets[k] for k in chosen))))

    return lack


def test_one_dear_candidate_gives_way_to_two_cheap_ones():
    lack = covering([{1, 2, 3, 4}, {1, 2}, {3, 4}], 4)
    assert set(cheapest(lack, np.array([10.0, 4.0, 4.0]))) == {1, 2}
    assert cheapest(lack, np.array([7.0, 4.0, 4.0])) == (0,)


def test_what_becomes_superfluous_is_dropped():
    """The greedy step takes the large set first, and the two others have all of it."""
    lack = covering([{2, 3, 4, 5}, {1, 2, 3}, {4, 5, 6}], 6)
    assert set(cheapest(lack, np.ones(3))) == {1, 2}


def test_a_choice_costs_no_more_than_is_allowed_and_then_lacks_least():
    lack = covering([{1}, {2, 3}, {4, 5, 6}, {1, 2, 3, 4}], 6)
    assert cheapest(lack, np.ones(4), most=1.0) == (3,)
    assert cheapest(lack, np.ones(4), most=0.5) == ()
    assert len(cheapest(lack, np.ones(4), most=2.0)) == 2


def test_no_choice_is_far_from_the_best_of_all():
    rng = np.random.default_rng(3)
    for _ in range(40):
        sets = [set(rng.integers(0, 30, 8).tolist()) for _ in range(9)]
        cost = rng.uniform(1.0, 3.0, 9)
        lack = covering(sets, len(set().union(*sets)))
        found = cheapest(lack, cost)
        assert lack(found) == 0
        best = min(
            cost[list(one)].sum()
            for n in range(10)
            for one in combinations(range(9), n)
            if lack(one) == 0
        )
        assert cost[list(found)].sum() <= 1.05 * best


def test_the_first_is_the_one_that_takes_off_most_for_its_cost():
    lack = covering([{1}, {2, 3, 4}, {5, 6}], 6)
    assert in_order((0, 1, 2), lack, np.array([1.0, 2.0, 1.0])) == (2, 1, 0)


def test_a_cost_must_be_positive():
    with pytest.raises(ValueError, match=r"cost must be positive, got 0\.0"):
        cheapest(covering([{1}], 1), np.zeros(1))
