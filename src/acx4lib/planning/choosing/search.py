"""The cheapest choice of candidates that meets a target: greedy, then by exchange.

What a candidate is does not matter here. A choice has a *lack*, which says how far it is from the
target and never grows when a candidate is added, and a cost, the sum of those of its candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array

Choice = tuple[int, ...]
"""Numbers of candidates, in the order in which they were taken."""

MET = 1e-9
"""A lack up to this is rounding."""


def cheapest(lack: Callable[[Choice], float], cost: Array, *, most: float = np.inf) -> Choice:
    """Return a cheap choice that meets the target, or else one that lacks little.

    Candidates are added until the target is met: each time the one that takes off most of the
    lack, in a first search for its cost, in a second one at any cost. Then candidates are dropped
    or exchanged as long as this is better. The cheaper result is returned. It is no proof: another
    choice may be cheaper by a little.

    Parameters
    ----------
    lack : callable
        How far a choice is from the target; zero where it meets it.
    cost : ndarray, shape (n,)
        Of each candidate.
    most : float
        Largest cost of a choice.

    Raises
    ------
    ValueError
        For a cost that is not positive.
    """
    cost = expected.numbers("cost", cost, ("n",))
    if not np.all(cost > 0):
        msg = f"cost must be positive, got {cost.min()}"
        raise ValueError(msg)
    search = _Search(lack=lack, cost=cost, most=most)
    found = [search.exchanged(search.grown(by)) for by in (cost, np.ones_like(cost))]
    return min(found, key=search.rank)


def in_order(chosen: Choice, lack: Callable[[Choice], float], cost: Array) -> Choice:
    """Return a choice, first the candidate that takes off most of the lack for its cost."""
    order: Choice = ()
    while left := [k for k in chosen if k not in order]:
        now, taken = lack(order), order
        order = (*taken, max(left, key=lambda k: (now - lack((*taken, k))) / cost[k]))
    return order


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """A search for the cheapest choice; what a choice lacks is computed once."""

    lack: Callable[[Choice], float]
    cost: Array
    most: float
    known: dict[frozenset[int], float] = field(default_factory=dict)

    def lacks(self, chosen: Choice) -> float:
        key = frozenset(chosen)
        if key not in self.known:
            self.known[key] = self.lack(tuple(sorted(chosen)))
        return self.known[key] if self.known[key] > MET else 0.0

    def price(self, chosen: Choice) -> float:
        return float(self.cost[list(chosen)].sum())

    def rank(self, chosen: Choice) -> tuple[float, float]:
        """Return what is to be made small: first the lack, then the cost."""
        return self.lacks(chosen), self.price(chosen)

    def grown(self, by: Array) -> Choice:
        """Return a choice that meets the target, or to which none can be added for its cost."""
        chosen: Choice = ()
        while now := self.lacks(chosen):
            left = self.most - self.price(chosen)
            others = [k for k in range(len(by)) if k not in chosen and self.cost[k] <= left]
            gain = [(now - self.lacks((*chosen, k))) / by[k] for k in others]
            if max(gain, default=0.0) <= 0:
                break
            chosen = (*chosen, others[int(np.argmax(gain))])
        return chosen

    def exchanged(self, chosen: Choice) -> Choice:
        """Return what exchanging one or two candidates at a time makes of a choice."""
        while (better := self._better(chosen)) is not None:
            chosen = better
        return chosen

    def _better(self, chosen: Choice) -> Choice | None:
        """Return the best choice near to one; None where none is better."""
        if self.lacks(chosen):
            near = [one for one in self._near(chosen, 1) if self.price(one) <= self.most]
            best = min(near, key=self.rank, default=chosen)
            return best if self.lacks(best) < self.lacks(chosen) - MET else None
        least = self.price(chosen) * (1 - MET)
        cheaper = (one for one in self._near(chosen, 2) if self.price(one) < least)
        return next((one for one in sorted(cheaper, key=self.price) if not self.lacks(one)), None)

    def _near(self, chosen: Choice, most: int) -> Iterator[Choice]:
        """Yield choices with so many candidates left out or taken, three in all at most."""
        others = [k for k in range(len(self.cost)) if k not in chosen]
        for left_out in range(min(most, len(chosen)) + 1):
            for kept in combinations(chosen, len(chosen) - left_out):
                for taken in range(min(most, 3 - left_out) + 1):
                    yield from ((*kept, *new) for new in combinations(others, taken))
