"""Gross errors: a robust start where there are many, then Baarda's data snooping.

Every adjustment is followed by a test of every observation. A used observation is tested by its
residual, a rejected one by its difference from the prediction by the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.gross_errors.absurd_control import tested, without_absurd_control
from acx4lib.bundle.gross_errors.exchanged import exchanges
from acx4lib.bundle.gross_errors.limits import Stopped, sentence, within_limits
from acx4lib.bundle.gross_errors.rejections import CRITICAL, KINDS, Rejection, without
from acx4lib.bundle.gross_errors.single_tests import (
    Observations,
    Verdict,
    by_group,
    flat,
    judge,
    observations,
)
from acx4lib.bundle.network import Network
from acx4lib.bundle.start.robust import SUSPECT, reweighted, robust_phase, sizes, spread
from acx4lib.bundle.unknowns import State
from acx4lib.bundle.uses import robust_start
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block
from acx4lib.least_squares.statistical.w_test import OUT, tau_limits, w_limits

HEAVY = 0.002
"""Share of failed tests above which a robust start is made: ten times that by chance."""

SMEARED = 0.5
"""An observation with less than this share of the largest w near it waits for the next round."""

MOST_ROUNDS = 10


def adjust_rejecting(
    block: Block,
    set_up: Callable[[Block], Network],
    *,
    critical: float = CRITICAL,
    sigma0: str = "known",
) -> Bundle:
    """Adjust and reject gross errors until every remaining observation passes its test.

    Parameters
    ----------
    block : Block
    set_up : callable
        Makes the network of a block.
    critical : float
        Critical value of a normal variable.
    sigma0 : str
        ``"known"``: Baarda's w, for observations with reliable sigma.
        ``"estimated"``: Pope's tau, where only the ratios of the sigmas are known. Tau is w over
        the a posteriori sigma0; its critical value has the same probability.

    Returns
    -------
    Bundle
        Adjustment of the block without the rejected observations. The statistic of a rejection
        is the w that the observation would have if it alone were put back.

    Raises
    ------
    AdjustmentError
        Where an adjustment does not converge.
    ValueError
        For another `sigma0`, or a critical value that is not positive.

    Notes
    -----
    A control point that is far from all of its rays, unlike the others, is rejected first. Then,
    in every round, the observations with the largest w near them are rejected. A large error
    raises the w of other observations of its point and its image; these must be tested without
    it. A rejected observation returns, once at most, if its difference from the prediction by the
    others passes the same test; the variance is that of this difference. Where the spread of w
    shows that the a priori sigma of a kind is too small, w is divided by that spread, because a
    wrong weight is no gross error. What exceeds the limits of `limits` is a systematic error:
    nothing of that group is rejected, and `Bundle.stopped` names it.
    """
    expected.instance("block", block, Block)
    expected.positive_number("critical", critical)
    expected.one_of("sigma0", sigma0, ("known", "estimated"))
    if not callable(set_up):
        msg = f"set_up: expected a function of a block, got {expected.given(set_up)}"
        raise ValueError(msg)
    network, absurd = without_absurd_control(block, set_up)
    observed = observations(network)
    test = partial(judge, w_limits if sigma0 == "known" else tau_limits, critical)
    bundle, search = _first(network, _nothing_out(len(observed.kind)), test)
    verdict = test(bundle, search.out)
    for _ in range(MOST_ROUNDS):
        fits = ~(_misfits_after(bundle, search.out) > SUSPECT)
        following = _next(search, observed, verdict, fits)
        if np.array_equal(following.out, search.out):
            break
        bundle, search = _following(network, bundle.state, search, following)
        verdict = test(bundle, search.out)
    found = (*tested(block, bundle, absurd), *_rejections(search, observed, verdict))
    if not found:
        return bundle
    kept, stopped = within_limits(block, network.rows, found)
    mixed = exchanges(block, set_up, bundle, found, partial(_failed, test))
    best = _without(block, set_up, bundle, kept, stopped)
    return replace(best, rejected=kept, stopped=stopped, exchanged=mixed)


def _failed(test: Callable[[Bundle, Mask], Verdict], bundle: Bundle) -> set[tuple[str, int]]:
    """Return kinds and rows of the observations that fail their tests, with none rejected."""
    observed = observations(bundle.network)
    failed = test(bundle, np.zeros(len(observed.kind), dtype=bool)).failed
    kinds = (KINDS[k] for k in observed.kind[failed])
    return set(zip(kinds, observed.row[failed].tolist(), strict=True))


def _first(
    network: Network, search: _Search, test: Callable[[Bundle, Mask], Verdict]
) -> tuple[Bundle, _Search]:
    """Adjust with all observations; where many fail, without those that misfit a robust state."""
    try:
        bundle = adjust(network)
    except AdjustmentError:
        state = robust_start(network)
    else:
        if np.mean(test(bundle, search.out).failed) <= HEAVY:
            return bundle, search
        state = robust_phase(
            network, bundle.state, [group.redundancy for group in bundle.solution.groups]
        )
    search = replace(search, out=_misfits(network, state) > SUSPECT)
    return _adjust_without(network, search.out, state), search


def _following(
    network: Network, state: State, search: _Search, following: _Search
) -> tuple[Bundle, _Search]:
    """Adjust for the next round; without returned observations where it fails with them."""
    try:
        return _adjust_without(network, following.out, state), following
    except AdjustmentError:
        again = search.out & ~following.out
        following = replace(
            following,
            out=following.out | again,
            w=np.where(again, _misfits(network, state), following.w),
        )
        return _adjust_without(network, following.out, state), following


def _without(
    block: Block,
    set_up: Callable[[Block], Network],
    bundle: Bundle,
    rejected: tuple[Rejection, ...],
    stopped: tuple[Stopped, ...],
) -> Bundle:
    """Adjust without the rejected observations; say what else is wrong where that fails."""
    network = set_up(without(block, rejected))
    known, state = np.isfinite(bundle.state.x_m), bundle.state
    warm = replace(state, x_m=np.where(known, state.x_m, network.start.x_m))
    try:
        return adjust(replace(network, start=warm))
    except AdjustmentError as error:
        if not stopped:
            raise
        raise AdjustmentError(f"{sentence(stopped)}; with them, {error}") from error


def _adjust_without(network: Network, out: Mask, state: State) -> Bundle:
    """Adjust without the effect of some observations; their predictions are still computed."""
    factors = by_group(network, np.where(out, OUT, 1.0))
    return adjust(reweighted(network, factors).beginning_at(state))


def _misfits(network: Network, state: State) -> Array:
    """Return the residuals divided by their sigma and by the spread of their kind."""
    return _shares_of_spread(network.residuals(state)[: len(KINDS)])


def _misfits_after(bundle: Bundle, out: Mask) -> Array:
    """Return the same after an adjustment with `OUT` times the sigma of rejected observations."""
    factors = by_group(bundle.network, np.where(out, OUT, 1.0))
    groups = zip(bundle.solution.groups[: len(KINDS)], factors, strict=True)
    return _shares_of_spread([(group.v, group.sigma / factor) for group, factor in groups])


def _shares_of_spread(groups: Sequence[tuple[Array, Array]]) -> Array:
    return flat([np.nan_to_num(sizes(*group)) / spread(*group) for group in groups])


# --- rounds ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """The rejected observations, and the course of the search.

    Attributes
    ----------
    out : ndarray, shape (n,)
    w : ndarray, shape (n,)
        The w with which an observation was rejected; zero before its first test.
    returned : ndarray, shape (n,)
        Observations that returned; they do not return again.
    """

    out: Mask
    w: Array
    returned: Mask


def _nothing_out(n: int) -> _Search:
    none = np.zeros(n, dtype=bool)
    return _Search(out=none, w=np.zeros(n), returned=none)


def _next(search: _Search, observed: Observations, verdict: Verdict, fits: Mask) -> _Search:
    """Reject observations that fail their test, put back those that pass; not both at one point.

    An observation that was only suspected, and that no other controls, returns where it fits.
    """
    taken = _to_take(observed, np.where(verdict.failed & ~search.out, verdict.w, 0.0))
    busy = np.isin(observed.point, observed.point[taken & (observed.point >= 0)])
    passed = search.out & ~verdict.failed & ~search.returned
    back = passed & ~busy & (verdict.controlled | (fits & (search.w == 0)))
    return _Search(
        out=(search.out | taken) & ~back,
        w=np.where(taken, verdict.w, search.w),
        returned=search.returned | back,
    )


def _to_take(observed: Observations, w: Array) -> Mask:
    """Choose the candidates, w > 0, that no larger one near them explains."""
    of_point, of_pose = observed.point >= 0, observed.pose >= 0
    posed, tied = of_pose & ~of_point, of_pose & of_point
    row_pose = np.zeros(observed.pose.max(initial=-1) + 2)  # the last one of what has no pose
    np.maximum.at(row_pose, observed.pose[posed], w[posed])
    at_pose = row_pose.copy()
    np.maximum.at(at_pose, observed.pose[tied], w[tied])
    at_point = np.zeros(observed.point.max(initial=-1) + 2)  # likewise
    np.maximum.at(at_point, observed.point[of_point], w[of_point])
    np.maximum.at(at_point, observed.point[tied], row_pose[observed.pose[tied]])
    largest = np.where(of_point, at_point[observed.point], at_pose[observed.pose])
    wide = np.max(w[~tied], initial=0.0)  # control and trajectory affect everything
    largest = np.maximum(
        largest, SMEARED * np.where(tied, at_pose[observed.pose], w.max(initial=0.0))
    )
    return (w > 0) & (w >= np.maximum(largest, SMEARED * wide))


def _rejections(search: _Search, observed: Observations, verdict: Verdict) -> tuple[Rejection, ...]:
    """Return the rejections, the largest w first."""
    w = np.where(verdict.controlled & verdict.failed, verdict.w, search.w)
    rows = np.flatnonzero(search.out)
    return tuple(
        Rejection(
            kind=KINDS[observed.kind[i]],
            row=int(observed.row[i]),
            component=int(observed.component[i]),
            statistic=float(w[i]),
            limit=float(verdict.limit[i]),
            largest=int(verdict.largest[i] if observed.component[i] < 0 else observed.component[i]),
        )
        for i in rows[np.argsort(-w[rows], kind="stable")]
    )
