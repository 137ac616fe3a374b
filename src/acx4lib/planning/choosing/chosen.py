"""The strips that are chosen for a target: what the flight then determines, and what each buys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array
from acx4lib.planning.choosing.candidates import Candidates, Wanted
from acx4lib.planning.choosing.search import Choice, cheapest, in_order
from acx4lib.planning.choosing.target import BLOCK
from acx4lib.planning.plan import TURN_S, Plan

TRIALS = 5
"""Largest number of searches."""

SAFE = 0.999
"""Factor on the limits of a repeated search, so that rounding does not miss them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """Chosen strips, and what they give as a plan of their own.

    Attributes
    ----------
    wanted : tuple of Wanted
    plan : Plan
        Its block `BLOCK` has the chosen strips, first the one that buys most for its time.
    given : ndarray, shape (n,)
        What is wanted, as the plan gives it.
    after : ndarray, shape (n_strips, n)
        What is wanted, from every strip and those before it.
    without : ndarray, shape (n_strips, n)
        What is wanted, where one strip alone is left out.
    minutes_after : ndarray, shape (n_strips,)
        Flying time from the first exposure of the first strip to the last of each.
    """

    wanted: tuple[Wanted, ...]
    plan: Plan
    given: Array
    after: Array
    without: Array
    minutes_after: Array

    @property
    def strips(self) -> tuple[str, ...]:
        """Names of the chosen strips."""
        return tuple(self.plan.blocks[BLOCK].strips)

    @property
    def minutes(self) -> float:
        """Flying time from the first exposure to the last."""
        return float(self.minutes_after[-1])

    @property
    def excess(self) -> float:
        """How many times its limit the worst is of what is wanted."""
        return float(np.max(self.given / np.array([one.limit for one in self.wanted])))

    @property
    def met(self) -> bool:
        """Whether the target is met."""
        return self.excess <= 1.0


def choose(candidates: Candidates, *, minutes: float = np.inf) -> Chosen:
    """Return cheap strips that give what is wanted, or come near to it in so many minutes.

    The search sees a part of the tie points, at places that all candidates share. A plan of fewer
    strips has its tie points where these see them. So the strips that are found are computed as
    such a plan, and the search is repeated for limits that allow for the difference.

    Parameters
    ----------
    candidates : Candidates
    minutes : float
        Longest flying time.
    """
    limits = wanted = candidates.limits
    tried: dict[Choice, Array] = {}
    for _ in range(TRIALS):
        order = searched(candidates, limits, minutes)
        if order in tried:
            break
        tried[order] = candidates.planned(with_strips(candidates.target.plan, order))
        limits = wanted * SAFE * candidates.given(order) / tried[order]

    def rank(order: Choice) -> tuple[float, float]:
        return lack_of(tried[order], wanted), candidates.minutes(order)

    return _of(candidates, min(tried, key=rank), tried)


def _of(candidates: Candidates, order: Choice, tried: Mapping[Choice, Array]) -> Chosen:
    scale = tried[order] / candidates.given(order)
    firsts = [order[: k + 1] for k in range(len(order))]
    others = [order[:k] + order[k + 1 :] for k in range(len(order))]
    return Chosen(
        wanted=candidates.wanted,
        plan=with_strips(candidates.target.plan, order),
        given=tried[order],
        after=scale * [candidates.given(one) for one in firsts],
        without=scale * [candidates.given(one) for one in others],
        minutes_after=np.array([candidates.minutes(one) for one in firsts]),
    )


def lack_of(given: Array, limits: Array) -> float:
    """Return how far from its limits is what is given: zero, or the sum of logarithmic excesses."""
    return float(np.log(np.maximum(given / limits, 1.0)).sum())


def searched(candidates: Candidates, limits: Array, minutes: float) -> Choice:
    """Return strips that keep limits by a part of the tie points, or come near to them.

    Parameters
    ----------
    candidates : Candidates
    limits : ndarray, shape (n,)
        Of what is wanted.
    minutes : float

    Returns
    -------
    tuple of int
        First the strip that buys most for its time.
    """

    def lack(chosen: Choice) -> float:
        return lack_of(candidates.given(chosen), limits)

    seconds = candidates.seconds
    found = cheapest(lack, seconds, most=60.0 * minutes + TURN_S)  # no turn after the last strip
    return in_order(found, lack, seconds)


def with_strips(plan: Plan, chosen: Choice) -> Plan:
    """Return a plan of which only some strips are flown.

    Parameters
    ----------
    plan : Plan
    chosen : tuple of int
        Their places among those of its block `BLOCK`.
    """
    listed = [*plan.blocks[BLOCK].strips.items()]
    return plan.with_strips(dict(listed[k] for k in chosen), BLOCK)
