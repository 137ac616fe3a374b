"""Gross errors: found by data snooping, and removed from a block.

Adjustment, test and rejection alternate until no test fails. Control points far from all of
their rays are removed first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from acx4lib import expected
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle, adjust_chosen
from acx4lib.bundle.network import Network
from acx4lib.bundle.rejections import (
    CRITICAL,
    KINDS,
    Rejection,
    Stopped,
    sentence,
    too_many,
    within_limits,
    without,
)
from acx4lib.bundle.start import (
    ASTRAY,
    SUSPECT,
    control_misfits,
    prepared,
    reweighted,
    robust_phase,
    robust_start,
    sizes,
    spread,
    turned_alike,
)
from acx4lib.bundle.unknowns import State
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.intersection import intersect
from acx4lib.least_squares import statistics as least_squares_statistics
from acx4lib.least_squares.covariance import medians, propagate
from acx4lib.least_squares.statistics import (
    CONTROLLED,
    OUT,
    Group,
    statistics,
    tau_limits,
    w_limits,
)

# --- Gross errors: a robust start where there are many, then Baarda's data snooping
#
# Every adjustment is followed by a test of every observation. A used observation is tested by its
# residual, a rejected one by its difference from the prediction by the others.


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
        Adjustment of the block without the rejected observations, with the iterations of all
        adjustments on the way. The statistic of a rejection is the w that the observation would
        have if it alone were put back.

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
    wrong weight is no gross error. A group with more rejections than `within_limits` allows has a
    systematic error: no observation of it is rejected, and `Bundle.stopped` names the group.
    """
    expected.positive("critical", critical)
    expected.one_of("sigma0", sigma0, ("known", "estimated"))
    network = prepared(set_up(block))
    absurd = _absurd_control(network)
    if absurd:
        network = prepared(set_up(without(block, absurd)))
    observed = _observations(network)
    test = partial(_judge, w_limits if sigma0 == "known" else tau_limits, critical)
    bundle, out = _first(network, test)
    search = _Search(out=out, w=np.zeros(len(out)), returned=np.zeros_like(out))
    verdict, iterations = test(bundle, out), bundle.solution.iterations
    for _ in range(MOST_ROUNDS):
        fits = ~(_misfits_after(bundle, search.out) > SUSPECT)
        following = _next(search, observed, verdict, fits)
        if np.array_equal(following.out, search.out):
            break
        try:
            bundle = _adjust_without(network, following.out, bundle.state)
        except AdjustmentError:  # because of what returned
            following = replace(following, out=following.out | search.out)
            bundle = _adjust_without(network, following.out, bundle.state)
        search, verdict = following, test(bundle, following.out)
        iterations += bundle.solution.iterations
    rejections = (*_tested(block, bundle, absurd), *_rejections(search, observed, verdict))
    stopped: tuple[Stopped, ...] = ()
    if rejections:
        rejections, stopped = within_limits(block, network.rows, rejections)
        bundle = _without(prepared(set_up(without(block, rejections))), bundle.state, stopped)
        iterations += bundle.solution.iterations  # often none: it begins at the minimum
    solution = replace(bundle.solution, iterations=iterations)
    return replace(bundle, solution=solution, rejected=rejections, stopped=stopped)


def _first(network: Network, test: Callable[[Bundle, Mask], _Verdict]) -> tuple[Bundle, Mask]:
    """Adjust with all observations; if many fail, without the misfits of a robust state."""
    try:
        bundle = adjust_chosen(network)
    except AdjustmentError:
        state = robust_start(network)
    else:
        none = np.zeros(len(_observations(network).kind), dtype=bool)
        if np.mean(test(bundle, none).failed) <= HEAVY:
            return bundle, none
        state = robust_phase(
            network, bundle.state, [group.redundancy for group in bundle.solution.groups]
        )
    out = _shares_of_spread(network.residuals(state)[: len(KINDS)]) > SUSPECT
    return _adjust_without(network, out, state), out


def _without(network: Network, state: State, stopped: tuple[Stopped, ...]) -> Bundle:
    """Adjust without the rejected observations; an error also names the stopped groups."""
    x_m = np.where(np.isfinite(state.x_m), state.x_m, network.start.x_m)
    try:
        return adjust_chosen(replace(network, start=replace(state, x_m=x_m)))
    except AdjustmentError as error:
        if not stopped:
            raise
        raise AdjustmentError(f"{sentence(stopped)}; with them, {error}") from error


def _adjust_without(network: Network, out: Mask, state: State) -> Bundle:
    """Adjust without the effect of some observations; their predictions are still computed."""
    factors = _by_group(network, np.where(out, OUT, 1.0))
    return adjust_chosen(reweighted(network, factors).beginning_at(state))


def _misfits_after(bundle: Bundle, out: Mask) -> Array:
    """Return the residuals over sigma and spread, after rejected ones had `OUT` times the sigma."""
    factors = _by_group(bundle.network, np.where(out, OUT, 1.0))
    groups = zip(bundle.solution.groups[: len(KINDS)], factors, strict=True)
    return _shares_of_spread([(group.v, group.sigma / factor) for group, factor in groups])


def _shares_of_spread(groups: Sequence[tuple[Array, Array]]) -> Array:
    """Return the residuals divided by their sigma and by the spread of their kind."""
    return _flat([np.nan_to_num(sizes(*group)) / spread(*group) for group in groups])


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


def _next(search: _Search, observed: _Observations, verdict: _Verdict, fits: Mask) -> _Search:
    """Reject observations that fail their test, return those that pass; never both at one point.

    A suspect of the robust start that no other observation controls returns where it fits.
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


def _to_take(observed: _Observations, w: Array) -> Mask:
    """Choose the candidates, w > 0, unless a larger w near them explains theirs."""
    of_point, of_pose = observed.point >= 0, observed.pose >= 0
    posed, tied = of_pose & ~of_point, of_pose & of_point
    row_pose = np.zeros(observed.pose.max(initial=-1) + 2)  # the last place: no pose
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


def _rejections(
    search: _Search, observed: _Observations, verdict: _Verdict
) -> tuple[Rejection, ...]:
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


# --- The test of every single observation of a network at one adjustment


T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Observations:
    """The tested observations, in the order of `KINDS`; of control points each component.

    Attributes
    ----------
    kind : ndarray, shape (n,)
        Indices into `KINDS`.
    row, component : ndarray, shape (n,)
        As in `Rejection`.
    point, pose : ndarray, shape (n,)
        The point and the pose that it observes, -1 for none.
    """

    kind: Index
    row: Index
    component: Index
    point: Index
    pose: Index


def _observations(network: Network) -> _Observations:
    """Return the tested observations of a network."""
    free = np.flatnonzero(~network.held_control)
    in_block = np.flatnonzero(np.isin(network.block.control.point_idx, network.control.point_idx))
    points, poses = network.image_points, np.arange(len(network.pose_names))
    none = np.full(len(network.rows), -1)
    unmeasured = np.full(len(poses), -1)
    parts = [
        (network.rows, none, points.point_idx, network.pose_idx[points.image_idx]),
        (
            np.repeat(in_block[free], 3),
            np.tile(np.arange(3), len(free)),
            np.repeat(network.control.point_idx[free], 3),
            np.full(3 * len(free), -1),
        ),
        (network.exposure_idx, unmeasured, unmeasured, poses),
        (network.exposure_idx, unmeasured, unmeasured, poses),
    ]
    row, component, point, pose = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    kind = np.repeat(np.arange(len(KINDS)), [len(part[0]) for part in parts])
    return _Observations(kind=kind, row=row, component=component, point=point, pose=pose)


def _by_group(network: Network, values: NDArray[T]) -> list[NDArray[T]]:
    """Return values of the observations as columns, to be broadcast to the network's groups."""
    n, k = len(network.rows), int(np.sum(~network.held_control))
    n_poses = len(network.pose_names)
    image, control, *poses = np.split(values, np.cumsum([n, 3 * k, n_poses]))
    return [image[:, None], control.reshape(-1, 3), *(part[:, None] for part in poses)]


def _flat(values: Sequence[NDArray[T]]) -> NDArray[T]:
    """Return one value per observation, the largest of its components."""
    largest = [np.max(value, axis=1) for value in values]
    return np.concatenate([largest[0], values[1].ravel(), *largest[2:]])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Verdict:
    """The test of every observation at one adjustment, the largest of its components.

    Attributes
    ----------
    w : ndarray, shape (n,)
        Zero where no other observation controls it.
    limit : ndarray, shape (n,)
    controlled : ndarray, shape (n,)
    largest : ndarray, shape (n,)
        The component with it.
    """

    w: Array
    limit: Array
    controlled: Mask
    largest: Index

    @property
    def failed(self) -> Mask:
        """Which observations disagree with the others."""
        return self.w > self.limit


Limits = Callable[[Sequence[Group], Sequence[Mask], float], list[float]]


def _judge(limits: Limits, critical: float, bundle: Bundle, out: Mask) -> _Verdict:
    """Test every observation, used or rejected."""
    groups, outs = bundle.solution.groups[: len(KINDS)], _by_group(bundle.network, out)
    tested = [statistics(group, mask) for group, mask in zip(groups, outs, strict=True)]
    limit = [
        np.full(group.v.shape, value)
        for group, value in zip(groups, limits(groups, outs, critical), strict=True)
    ]
    return _Verdict(
        w=_flat([w for w, _ in tested]),
        limit=_flat(limit),
        controlled=_flat([controlled for _, controlled in tested]),
        largest=_flat(
            [np.argmax(w, axis=1)[:, None].repeat(w.shape[1], axis=1) for w, _ in tested]
        ),
    )


def expected_failures(bundle: Bundle, *, critical: float = CRITICAL) -> float:
    """Return how many tests of a bundle fail by chance where all its observations are right.

    Parameters
    ----------
    bundle : Bundle
    critical : float
        Critical value of a normal variable, two-sided.
    """
    groups = bundle.solution.groups[: len(KINDS)]
    n = sum(int(np.sum(g.used & (g.redundancy > CONTROLLED))) for g in groups)
    return n * (2 * least_squares_statistics.norm_sf(critical))


# --- Control points that lie far from all of their rays, unlike the other control points
#
# Statistical tests cannot find an error of kilometres: before any test, it turns cameras or puts
# points behind them. Therefore such points are searched for before an adjustment.


DOUBTFUL = 2 * ASTRAY
"""Median angle between a control point and its rays above which the point is examined."""

BESIDE = np.radians(60.0)
"""Angle that is too large for a wrong measurement in an image that shows the point."""

THROUGH = ASTRAY / 10
"""A ray that misses a point by a smaller angle passes through it: heights may be a little wrong."""

UNLIKE = 5.0
"""It must also exceed this multiple of the median: bad approximate values affect all points."""

SHARE = 4
"""At most one point in so many is absurd, or one alone: if more are, the others may be wrong."""

ENOUGH = 3
"""Number of other points that must remain; fewer do not orient a block."""


def _absurd_control(network: Network) -> tuple[Rejection, ...]:
    """Return the rejections of absurd control points of the block, not tested yet.

    All poses of a camera are first turned alike onto the control points. A single ray that misses
    its point by less than `BESIDE` may itself be wrong.
    """
    if not np.any(control_misfits(network, network.start) > DOUBTFUL):
        return ()
    point_idx = network.control.point_idx
    angles = control_misfits(network, turned_alike(network))
    one_ray = (
        np.bincount(network.image_points.point_idx, minlength=network.n_points)[point_idx] == 1
    )
    absurd = _unlike(np.where(one_ray & (angles < BESIDE), 0.0, angles))
    rows = np.flatnonzero(np.isin(network.block.control.point_idx, point_idx[absurd]))
    return tuple(
        Rejection(kind="control_point", row=int(row), component=-1, statistic=np.inf)
        for row in rows
    )


def _unlike(misfits: Array) -> Mask:
    """Mark the points that miss their rays far more than the others; none if they are many."""
    if len(misfits) <= ENOUGH:
        return np.zeros(len(misfits), dtype=bool)
    out: Mask = misfits > max(DOUBTFUL, UNLIKE * float(np.median(misfits)))
    n, n_all = int(out.sum()), len(out)
    few = n <= max(1, n_all // SHARE) and not too_many(n, n_all)
    return out if few and n_all - n >= ENOUGH else np.zeros_like(out)


def _tested(block: Block, bundle: Bundle, absurd: Sequence[Rejection]) -> Iterator[Rejection]:
    """Yield the rejections of absurd control, with the largest w of each if it were put back."""
    control = block.control[np.array([r.row for r in absurd], dtype=np.intp)]
    estimated = bundle.state.x_m[control.point_idx]
    d = np.einsum("nij,nj->ni", control.R_g_m, estimated - control.x_m)
    cov = propagate(control.R_g_m, bundle.solution.cov_points[control.point_idx])
    predicted = np.diagonal(cov, axis1=1, axis2=2)
    w = np.max(np.abs(d) / np.sqrt(control.sigma_m**2 + predicted), axis=1)
    for rejection, statistic in zip(absurd, w.tolist(), strict=True):
        yield replace(rejection, statistic=statistic)


def elsewhere(origins: Array, directions: Array, point_idx: Index, x_m: Array) -> Mask:
    """Mark points that were surveyed far from the intersection of their rays, unlike the others.

    "Far" is a share of the distance to the cameras. The survey of a point is not blamed where
    most of its rays pass through the surveyed position, or where its rays do not meet.

    Parameters
    ----------
    origins, directions : ndarray, shape (n, 3)
        Start points and directions of the rays, mapping frame.
    point_idx : ndarray, shape (n,)
    x_m : ndarray, shape (k, 3)
        Surveyed coordinates, m.
    """
    to_points = x_m[point_idx] - origins
    distance = np.linalg.norm(to_points, axis=1)
    chord = np.linalg.norm(to_points / distance[:, None] - directions, axis=1)
    miss = medians(chord, point_idx, len(x_m)) > THROUGH
    met_m = intersect(origins, directions, point_idx, len(x_m))
    along = np.sum((met_m[point_idx] - origins) * directions, axis=1)
    meets = np.bincount(point_idx, minlength=len(x_m)) > 1
    meets[point_idx[~(along > 0)]] = False
    offsets = np.linalg.norm(met_m - x_m, axis=1) / np.maximum(
        medians(along, point_idx, len(x_m)), 1
    )
    out = np.zeros(len(x_m), dtype=bool)
    out[meets] = _unlike(offsets[meets])
    return out & miss
