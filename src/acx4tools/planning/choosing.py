"""The cheapest strips, of many candidates, that reach the accuracy wanted.

A target states the accuracy. The normal matrix of each strip is reduced to the unknowns that all
strips share; that of a choice is their sum. The search knows of no strips. Begin with `choose`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import linalg, sparse

from acx4lib import expected
from acx4lib.bundle.network import Network
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import Parameter, features, needed, parameters, to_reported
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.flight.design import strip_of_exposure
from acx4lib.flight.problems import POSITIVE, Problem, Range, lines_of, quoted
from acx4lib.flight.toml_file import Keys, Table, Toml, Value, number, read_toml
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.georeferencing.error_sources import ErrorSources
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.least_squares.statistics import Correlation
from acx4tools.planning import design
from acx4tools.planning import plan as plans
from acx4tools.planning.design import Design
from acx4tools.planning.flown import flying_time_s
from acx4tools.planning.plan import TURN_S, Plan

# --- The target of a flight: standard deviations, check points, time, and candidate strips


BLOCK = "calibration"
"""The block whose strips are chosen."""

SIGMAS = (
    *(name for name, _ in REPORTED.values()),
    *(f"gnss_shift_{axis}_m" for axis in AXES),
    *(trajectory_errors.DELAY, trajectory_errors.ATTITUDE_DELAY, *trajectory_errors.DEVIATION),
)
"""Parameters whose sigma a target can limit, named as in parameters.csv."""

CHECK_POINTS = tuple(f"{axis}_m" for axis in AXES)
"""RMS at check points that a target can limit, along the grid's axes, m."""

ANY_SIZE = Range(1e-30, 1e6, "must be positive, at most 1e6")
"""Range of a wanted sigma; those of k1, k2, k3 are small numbers, since r is in mm."""

MOST_CANDIDATES = 200

_EXAMPLE = "{flying_height_m = [600, 900], course_deg = [0, 180], length_m = 600, overlap = 0.8}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """The accuracy wanted of a flight, and its candidate strips.

    Attributes
    ----------
    plan : Plan
        With every candidate as a strip of its block `BLOCK`.
    sigma : mapping of str to float
        Largest standard deviation, of every camera, by the name in results.
    check_m : mapping of str to float
        Largest RMS of the check points of block ``validation``, by `CHECK_POINTS`.
    minutes : float
        Longest flying time of the block.
    """

    plan: Plan
    sigma: Mapping[str, float]
    check_m: Mapping[str, float]
    minutes: float = np.inf


def read(path: str | Path, plan: Plan) -> Target:
    """Return the target in a TOML file, for a plan whose strips are candidates as well.

    Raises
    ------
    FlightError
        With all problems, one line each.
    """
    return _checked(read_toml(expected.path("path", path), needed_by="planning"), plan)


def from_values(values: Mapping[str, Any], plan: Plan) -> Target:
    """Return the target of a nested dict with the keys of the file; FlightError as `read`."""
    return _checked(Toml(folder=Path(), file="target", values=dict(values), in_memory=True), plan)


def _checked(toml: Toml, plan: Plan) -> Target:
    if problems := [*_problems(toml, plan)]:
        raise FlightError(lines_of(problems))
    sigma, check_m = toml.table("sigma"), toml.table("check_points")
    return Target(
        plan=plans.checked(_with_candidates(toml, plan)),
        sigma={name: float(value) for name, value in sigma.items()},
        check_m={name: float(value) for name, value in check_m.items()},
        minutes=float(toml.get("minutes") or np.inf),
    )


def _problems(toml: Toml, plan: Plan) -> Iterator[Problem]:
    if toml.problems:
        yield from toml.problems
        return
    yield from TARGET.problems(toml)
    if BLOCK not in plan.blocks:
        yield toml.problem((), f"a plan without block {BLOCK}", "strips of that block are chosen")
    if toml.table("check_points") and "validation" not in plan.blocks:
        cure = "the plan needs a block validation: what is mapped, and its check points"
        yield toml.problem(("check_points",), "a plan without block validation", cure)


def _nothing_wanted(toml: Toml, _: Keys) -> Iterator[Problem]:
    if not (toml.table("sigma") or toml.table("check_points")):
        example = "needs [sigma] with f_mm = 0.002, or [check_points] with height_m = 0.1"
        yield toml.problem(("sigma",), "nothing is wanted", example)


def _candidate_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield problems of the table of candidates; the strips are checked later, as a plan's."""
    tables = toml.get(*keys)
    if not isinstance(tables, dict):
        yield toml.problem(keys, quoted(tables), "must be a table of strips by name")
    for name, table in toml.table(*keys).items():
        if not isinstance(table, dict):
            yield toml.problem((*keys, name), quoted(table), f"must be a table, as {_EXAMPLE}")
            continue
        for key, value in table.items():
            if isinstance(value, list) and not 0 < len(value) <= MOST_CANDIDATES:
                cure = f"must be a value, or a list of 1 to {MOST_CANDIDATES}"
                yield toml.problem((*keys, name, key), quoted(value), cure)
    n = sum(_count(table) for table in toml.table(*keys).values())
    if n > MOST_CANDIDATES:
        yield toml.problem(keys, f"{n} strips", f"must be at most {MOST_CANDIDATES}")


TARGET = Table(
    keys={
        "minutes": number(POSITIVE),
        "sigma": Table(keys=dict.fromkeys(SIGMAS, number(ANY_SIZE))),
        "check_points": Table(keys=dict.fromkeys(CHECK_POINTS, number(POSITIVE))),
        "candidates": Value("strips by name", _candidate_problems),
    },
    rules=[_nothing_wanted],
)
"""The keys of a target."""


def _count(table: Any) -> int:
    lists = (
        [values for values in table.values() if isinstance(values, list)]
        if isinstance(table, dict)
        else []
    )
    return int(np.prod([len(values) for values in lists], dtype=float).clip(max=1e9))


def _with_candidates(toml: Toml, plan: Plan) -> Toml:
    """Return the plan's document with all candidates as strips; lines are the target file's."""
    strips = dict(plan.values[BLOCK]["strips"])  # noqa: PD011 no frame's
    lines: dict[tuple[str, ...], int] = {}
    for name, table in toml.table("candidates").items():
        for strip_name, strip in _combined(name, table):
            strips[strip_name] = strip
            lines[BLOCK, "strips", strip_name] = toml.lines.get(("candidates", name), 1)
    values = {**plan.values, BLOCK: {**plan.values[BLOCK], "strips": strips}}  # noqa: PD011 no frame's
    return replace(toml, values=values, lines=lines)


def _combined(name: str, table: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield a strip for every combination of listed values, which go into its name."""
    lists = {key: value for key, value in table.items() if isinstance(value, list)}
    for values in product(*lists.values()):
        strip_name = "-".join([name, *map(_short, values)])
        yield strip_name, {**table, **dict(zip(lists, values, strict=True))}


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)


# --- All candidates of a target: the accuracy of all together, and of any choice of them


AT_CHECK_POINTS = "check points"
"""Stands in the place of a camera where an RMS is wanted."""

Key = tuple[str, str]
"""Camera, and name in results."""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """A standard deviation or an RMS, and its wanted limit.

    Attributes
    ----------
    camera, name : str
        A parameter as results name it, of no camera for GNSS; or `AT_CHECK_POINTS` and an axis.
    limit : float
        Largest standard deviation, or RMS.
    with_all : float
        With all candidates.
    needs : str
        Geometry that would determine a parameter better and that no candidate has.
    """

    camera: str
    name: str
    limit: float
    with_all: float
    needs: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidates:
    """All candidates of a target.

    Attributes
    ----------
    target : Target
    information : StripInformation
    wanted : tuple of Wanted
        Standard deviations, then RMS.
    by_common : ndarray, shape (n_sigma, k)
        d(wanted parameter) / d(common unknowns).
    own_m2 : ndarray, shape (n_rms,)
        Mean variance of check points from all but the calibration, m^2.
    by_calibration : ndarray, shape (n_rms, k, k)
        The sum of its products with the covariance is the mean variance from the calibration.
    """

    target: Target
    information: StripInformation
    wanted: tuple[Wanted, ...]
    by_common: Array
    own_m2: Array
    by_calibration: Array

    @property
    def limits(self) -> Array:
        """Limits of all goals, shape (n,)."""
        return np.array([goal.limit for goal in self.wanted])

    @property
    def failing(self) -> tuple[Wanted, ...]:
        """Goals that even all candidates together do not meet."""
        return tuple(goal for goal in self.wanted if not goal.with_all <= goal.limit)

    @cached_property
    def seconds(self) -> Array:
        """Flying time of every strip with the turn after it, s, shape (n,)."""
        strips = self.target.plan.blocks[BLOCK].strips.values()
        return np.array([flying_time_s((strip,)) + TURN_S for strip in strips])

    def minutes(self, chosen: Choice) -> float:
        """Return the flying time from the first exposure to the last."""
        return max(0.0, float(self.seconds[list(chosen)].sum()) - TURN_S) / 60.0

    def given(self, chosen: Choice) -> Array:
        """Return the wanted sigmas and RMS of a choice, from the tie points that take part."""
        cov = self.information.covariance(chosen)
        sigma = sigmas(propagate(self.by_common, cov))
        rms = np.sqrt(self.own_m2 + np.sum(self.by_calibration * cov, axis=(1, 2)))
        return np.append(sigma, rms)

    def planned(self, plan: Plan) -> Array:
        """Return the wanted sigmas and RMS of a plan, from all of its tie points."""
        predicted = _found(_designed(self.target, plan))
        return np.array([predicted[goal.camera, goal.name] for goal in self.wanted])


def of(target: Target) -> Candidates:
    """Return the candidates of a target.

    Raises
    ------
    FlightError
        Where something is wanted that the plan does not estimate.
    """
    full = _designed(target, target.plan)
    mounting = _mounting(full)
    information = of_strips(mounting.bundle.network)
    listed = _shared(mounting)
    wanted = [i for name in target.sigma for i in _places(name, listed)]
    n, k = mounting.calibration.n_columns, len(information.names)
    J = np.eye(k)
    J[:n, :n] = to_reported(mounting.calibration)
    own_m2, by_calibration = _at_check_points(target, full, k)
    return Candidates(
        target=target,
        information=information,
        wanted=_wanted(target, full, [listed[i] for i in wanted]),
        by_common=J[wanted],
        own_m2=own_m2,
        by_calibration=by_calibration,
    )


def _designed(target: Target, plan: Plan) -> Design:
    """Return the design of the blocks that a target concerns."""
    names = (BLOCK, "validation") if target.check_m else (BLOCK,)
    return design.of(replace(plan, blocks={name: plan.blocks[name] for name in names}))


def _mounting(designed: Design) -> Mounting:
    return designed.mountings[design.methods(designed.plan)[BLOCK]]


def _shared(mounting: Mounting) -> list[Parameter]:
    """Return the parameters that belong to no strip, in the order of their columns."""
    of_gnss = [p for p in trajectory_errors.parameters(mounting.bundle) if p.key != "drift"]
    return [*parameters(mounting.calibration), *of_gnss]


def _places(name: str, listed: list[Parameter]) -> list[int]:
    places = [i for i, p in enumerate(listed) if p.name == name]
    if not places:
        known = ", ".join(dict.fromkeys(p.name for p in listed))
        raise FlightError([f"target: sigma.{name}: the plan does not estimate it, but {known}"])
    return places


def _found(designed: Design) -> dict[Key, float]:
    """Return standard deviations and RMS by their names."""
    predicted = {(p.camera, p.name): p.sigma for p in _shared(_mounting(designed))}
    for validation in designed.validations.values():
        rms = np.sqrt(np.mean(validation.points.sigma**2, axis=0))
        predicted |= {
            (AT_CHECK_POINTS, name): float(component)
            for name, component in zip(CHECK_POINTS, rms, strict=True)
        }
    return predicted


def _wanted(target: Target, full: Design, listed: list[Parameter]) -> tuple[Wanted, ...]:
    predicted, has = _found(full), features(full.blocks[BLOCK])
    return (
        *(
            Wanted(
                camera=p.camera,
                name=p.name,
                limit=target.sigma[p.name],
                with_all=predicted[p.camera, p.name],
                needs=needed(p.key, has) if p.camera else "",
            )
            for p in listed
        ),
        *(
            Wanted(
                camera=AT_CHECK_POINTS,
                name=name,
                limit=limit,
                with_all=predicted[AT_CHECK_POINTS, name],
            )
            for name, limit in target.check_m.items()
        ),
    )


def _at_check_points(target: Target, full: Design, k: int) -> tuple[Array, Array]:
    """Return the mean variances at check points, without the calibration and by it."""
    axes = [CHECK_POINTS.index(name) for name in target.check_m]
    if not axes:
        return np.zeros(0), np.zeros((0, k, k))
    (validation,) = full.validations.values()
    sources: ErrorSources = validation.points.sources
    without = replace(sources, cov_parameters=np.zeros_like(sources.cov_parameters))
    own_m2 = np.diagonal(without.cov, axis1=1, axis2=2).mean(axis=0)
    G, n = sources.by_parameters, sources.by_parameters.shape[2]
    by_calibration = np.zeros((len(axes), k, k))
    by_calibration[:, :n, :n] = (np.einsum("pai,paj->aij", G, G) / len(G))[axes]
    return own_m2[axes], by_calibration


# --- The information of every strip of a block on the unknowns that all strips share
#
# Strips share the unknowns of cameras and of GNSS, and the points on the ground. Poses and drifts
# belong to one strip. So the normal equations of each strip are reduced to shared unknowns, once,
# and those of any choice of strips are a sum. This is exact for the points that take part; so that
# it is quick, a part of the tie points takes part, with the weight of all. Where errors of the
# trajectory change slowly, their correlation is kept along each strip, and neglected from one to
# the next.


TIE_POINTS = 120
"""Tie points that take part, of a block that has more."""

FAR_M = 1000.0
"""Standard deviation of a point's coordinates before it is measured."""

UNSEEN = 1e-12
"""Share of the information on a common unknown that is there without any strip. So the covariance
exists where a choice leaves the unknown open, and is very large."""

GOLDEN = 0.6180339887498949


@dataclass(frozen=True, kw_only=True, eq=False)
class StripInformation:
    """Normal matrices of points and common unknowns, in this order; poses are eliminated.

    Attributes
    ----------
    names : tuple of str
        The common unknowns, as `Network.column_names` has them.
    strips : tuple of str
    given : ndarray, shape (n, n)
        What belongs to no strip: control points, declared mountings.
    by_strip : ndarray, shape (n_strips, n, n)
    """

    names: tuple[str, ...]
    strips: tuple[str, ...]
    given: Array
    by_strip: Array

    def covariance(self, chosen: Sequence[int]) -> Array:
        """Return the covariance of the common unknowns from some of the strips, shape (k, k)."""
        N, k = self.given + self.by_strip[list(chosen)].sum(axis=0), len(self.names)
        L = linalg.cholesky(N, lower=True, overwrite_a=True, check_finite=False)[-k:, -k:]
        H = linalg.solve_triangular(L, np.eye(k), lower=True, check_finite=False)
        return H.T @ H


def of_strips(network: Network, *, tie_points: int = TIE_POINTS) -> StripInformation:
    """Return the reduced normal matrix of every strip, linearised at the approximate values.

    Parameters
    ----------
    network : Network
        As `adjust.mounted_orientation` makes it.
    tie_points : int
        Largest number of tie points that take part.

    Raises
    ------
    ValueError
        Where an exposure belongs to no strip.
    """
    strips = tuple(dict.fromkeys(strip_of_exposure(network.block)))
    if "" in strips:
        raise ValueError("every image must have a strip")
    owner = _owners(network, strips)
    common = np.flatnonzero(owner[:-1] < 0)
    points, weight = _taking_part(network, tie_points)
    rows, strip_of_row = _whitened(network, points, weight, owner)
    shared = np.append(np.arange(3 * len(points)), 3 * len(points) + common)
    own_columns = [3 * len(points) + np.flatnonzero(owner[:-1] == k) for k in range(len(strips))]
    by_strip = [
        _reduced(rows[strip_of_row == k], shared, own_columns[k]) for k in range(len(strips))
    ]
    given = (rows[strip_of_row < 0].T @ rows[strip_of_row < 0]).toarray()[np.ix_(shared, shared)]
    total = np.diagonal(given + sum(by_strip))[3 * len(points) :]
    given[np.diag_indices(len(given))] += np.append(
        np.full(3 * len(points), FAR_M**-2), UNSEEN * total
    )
    names = network.column_names()
    return StripInformation(
        names=tuple(names[column] for column in common),
        strips=strips,
        given=given,
        by_strip=np.array(by_strip),
    )


def _owners(network: Network, strips: Sequence[str]) -> Index:
    """Return the strip of each column; -1 for unknowns that the strips share."""
    owner = np.full(network.n_columns + 1, -1)  # column -1 is held
    of_pose = np.array([strips.index(name) for name in strip_of_exposure(network.block)])
    of_drift = [strips.index(name) for name in network.observed.strips.names]
    for columns, owners in ((network.layout.pose, of_pose), (network.layout.drift, of_drift)):
        for column, strip in zip(columns, owners, strict=True):
            owner[column[column >= 0]] = strip
    return owner


def _taking_part(network: Network, most: int) -> tuple[Index, Array]:
    """Return points that take part, spread over all, and the weight of the rays to each."""
    is_control = np.zeros(network.n_points, dtype=bool)
    is_control[network.control.point_idx] = True
    free = network.free_points
    ties = np.flatnonzero(free & ~is_control)
    order = np.argsort(np.arange(len(ties)) * GOLDEN % 1.0, kind="stable")
    chosen = np.sort(ties[order[:most]])
    points = np.concatenate([np.flatnonzero(is_control), chosen])
    weight = np.zeros(network.n_points)
    weight[points] = 1.0
    weight[chosen] = len(ties) / max(len(chosen), 1)
    return points, weight


def _whitened(
    network: Network, points: Index, weight: Array, owner: Index
) -> tuple[sparse.csr_array, Index]:
    """Return all equations, each of unit variance, and the strip to which each belongs.

    Columns are the coordinates of the points that take part, then the columns of the network.
    """
    first = np.full((network.n_points, 3), -1)
    first[points] = np.arange(3 * len(points)).reshape(-1, 3)
    first[~network.free_points] = -1
    parts, strips = [], []
    for e in network.equations(network.start):
        point = np.full(len(e.v), -1) if e.point is None else e.point
        rows = np.flatnonzero((point < 0) | (weight[point] > 0))
        A, columns = e.A[rows], e.columns[e.unit[rows]]
        strip = owner[columns].max(axis=1, initial=-1)
        strips.append(np.repeat(strip, e.v.shape[1]))
        columns = np.where(columns < 0, -1, 3 * len(points) + columns)
        if e.B is not None:
            A = np.concatenate([A, e.B[rows]], axis=2)
            columns = np.concatenate([columns, first[point[rows]]], axis=1)
        by_rays = np.sqrt(weight[point[rows]]) if e.kind == "image_point" else np.ones(len(rows))
        A = A * by_rays[:, None, None] / e.sigma[rows][:, :, None]
        part = _sparse(A, columns, 3 * len(points) + network.n_columns)
        parts.append(part if e.correlation is None else _uncorrelated(e.correlation, strip) @ part)
    return sparse.vstack(parts, format="csr"), np.concatenate(strips)


def _sparse(A: Array, columns: Index, n: int) -> sparse.csr_array:
    """Return rows with their columns in a sparse matrix, those of held unknowns left out."""
    m, d, _ = A.shape
    row = np.broadcast_to(np.arange(m * d).reshape(m, d, 1), A.shape)
    column = np.broadcast_to(columns[:, None, :], A.shape)
    free = column >= 0
    return sparse.csr_array((A[free], (row[free], column[free])), shape=(m * d, n))


def _uncorrelated(correlation: Correlation, strip: Index) -> sparse.csr_array:
    """Return the matrix that decorrelates rows which are correlated along their strips."""
    factors = correlation.factors
    d, m = len(factors), len(factors[0])
    row, column = np.nonzero(np.triu(np.equal.outer(strip, strip)))
    parts = [(U[row, column], (d * row + c, d * column + c)) for c, U in enumerate(factors)]
    values, places = zip(*parts, strict=True)
    row_column = tuple(np.concatenate(indices) for indices in zip(*places, strict=True))
    return sparse.csr_array((np.concatenate(values), row_column), shape=(m * d, m * d))


def _reduced(rows: sparse.csr_array, shared: Index, eliminated: Index) -> Array:
    """Return the normal matrix of the shared unknowns, the strip's own unknowns eliminated."""
    N = rows.T @ rows
    N_so = N[shared][:, eliminated].toarray()
    L = linalg.cholesky(N[eliminated][:, eliminated].toarray(), lower=True)
    half = linalg.solve_triangular(L, N_so.T, lower=True)
    return N[shared][:, shared].toarray() - half.T @ half


# --- The cheapest choice of candidates that meets a target: greedy, then by exchange
#
# What a candidate is does not matter here. A choice has a *lack*, which says how far it is from
# the target and never grows when a candidate is added, and a cost, the sum of those of its
# candidates.


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
        raise ValueError(f"cost must be positive, got {cost.min()}")
    search = _Search(lack=lack, cost=cost, most=most)
    choices = [search.exchanged(search.grown(by)) for by in (cost, np.ones_like(cost))]
    return min(choices, key=search.rank)


def in_order(chosen: Choice, lack: Callable[[Choice], float], cost: Array) -> Choice:
    """Return a choice in order: each candidate takes off most of the lack left, for its cost."""
    order: Choice = ()
    while remaining := [k for k in chosen if k not in order]:
        now, taken = lack(order), order
        order = (*taken, max(remaining, key=lambda k: (now - lack((*taken, k))) / cost[k]))
    return order


@dataclass(frozen=True, kw_only=True, eq=False)
class _Search:
    """A search for the cheapest choice; the lack of a choice is computed once."""

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
        """Return the sort key of a choice: its lack, then its cost."""
        return self.lacks(chosen), self.price(chosen)

    def grown(self, by: Array) -> Choice:
        """Add candidates one by one until the target is met, or no other helps or is affordable."""
        chosen: Choice = ()
        while now := self.lacks(chosen):
            remaining_cost = self.most - self.price(chosen)
            others = [
                k for k in range(len(by)) if k not in chosen and self.cost[k] <= remaining_cost
            ]
            gain = [(now - self.lacks((*chosen, k))) / by[k] for k in others]
            if max(gain, default=0.0) <= 0:
                break
            chosen = (*chosen, others[int(np.argmax(gain))])
        return chosen

    def exchanged(self, chosen: Choice) -> Choice:
        """Exchange one or two candidates at a time for as long as the choice gets better."""
        while (better := self._better(chosen)) is not None:
            chosen = better
        return chosen

    def _better(self, chosen: Choice) -> Choice | None:
        """Return the best choice near this one; None where no choice is better."""
        if self.lacks(chosen):
            near = [choice for choice in self._near(chosen, 1) if self.price(choice) <= self.most]
            best = min(near, key=self.rank, default=chosen)
            return best if self.lacks(best) < self.lacks(chosen) - MET else None
        least = self.price(chosen) * (1 - MET)
        cheaper = (choice for choice in self._near(chosen, 2) if self.price(choice) < least)
        return next(
            (choice for choice in sorted(cheaper, key=self.price) if not self.lacks(choice)), None
        )

    def _near(self, chosen: Choice, most: int) -> Iterator[Choice]:
        """Yield choices with so many candidates left out or taken, three in all at most."""
        others = [k for k in range(len(self.cost)) if k not in chosen]
        for left_out in range(min(most, len(chosen)) + 1):
            for kept in combinations(chosen, len(chosen) - left_out):
                for taken in range(min(most, 3 - left_out) + 1):
                    yield from ((*kept, *new) for new in combinations(others, taken))


# --- The strips chosen for a target: the accuracy of their flight, and the gain by each strip


TRIALS = 5
"""Largest number of searches."""

SAFE = 0.999
"""Factor on the limits of a repeated search, so that rounding does not miss them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chosen:
    """Chosen strips, and the accuracy of a plan with them alone.

    Attributes
    ----------
    wanted : tuple of Wanted
    plan : Plan
        Its block `BLOCK` has the chosen strips, first the one that buys most for its time.
    given : ndarray, shape (n,)
        What is wanted, as the plan gives it.
    after : ndarray, shape (n_strips, n)
        Wanted sigmas and RMS by every strip together with those before it.
    without : ndarray, shape (n_strips, n)
        Wanted sigmas and RMS without each single strip.
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
        """Largest ratio of a predicted sigma or RMS to its limit."""
        return float(np.max(self.given / np.array([goal.limit for goal in self.wanted])))

    @property
    def met(self) -> bool:
        """Whether the target is met."""
        return self.excess <= 1.0


def choose(candidates: Candidates, *, minutes: float = np.inf) -> Chosen:
    """Return cheap strips that meet the target, or come near to it in so many minutes.

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
        return _lack_of(tried[order], wanted), candidates.minutes(order)

    return _of(candidates, min(tried, key=rank), tried)


def _of(candidates: Candidates, order: Choice, tried: Mapping[Choice, Array]) -> Chosen:
    scale = tried[order] / candidates.given(order)
    firsts = [order[: k + 1] for k in range(len(order))]
    others = [order[:k] + order[k + 1 :] for k in range(len(order))]
    return Chosen(
        wanted=candidates.wanted,
        plan=with_strips(candidates.target.plan, order),
        given=tried[order],
        after=scale * [candidates.given(choice) for choice in firsts],
        without=scale * [candidates.given(choice) for choice in others],
        minutes_after=np.array([candidates.minutes(choice) for choice in firsts]),
    )


def _lack_of(predicted: Array, limits: Array) -> float:
    """Return how far limits are exceeded: zero, or the sum of logarithmic excesses."""
    return float(np.log(np.maximum(predicted / limits, 1.0)).sum())


def searched(candidates: Candidates, limits: Array, minutes: float) -> Choice:
    """Return strips that keep limits, or come near to them, predicted from part of the tie points.

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
        return _lack_of(candidates.given(chosen), limits)

    seconds = candidates.seconds
    choice = cheapest(lack, seconds, most=60.0 * minutes + TURN_S)  # no turn after the last strip
    return in_order(choice, lack, seconds)


def with_strips(plan: Plan, chosen: Choice) -> Plan:
    """Return the plan with some of its strips only.

    Parameters
    ----------
    plan : Plan
    chosen : tuple of int
        Their places among those of its block `BLOCK`.
    """
    listed = [*plan.blocks[BLOCK].strips.items()]
    return plan.with_strips(dict(listed[k] for k in chosen), BLOCK)


# --- A choice of strips as tables


def wanted(chosen: Chosen) -> pd.DataFrame:
    """Return a row for every goal: the limit, with all candidates, and as chosen."""
    return pd.DataFrame(
        {
            "camera": [goal.camera for goal in chosen.wanted],
            "wanted": [goal.name for goal in chosen.wanted],
            "limit": [goal.limit for goal in chosen.wanted],
            "all_candidates": [goal.with_all for goal in chosen.wanted],
            "chosen": chosen.given,
        }
    )


def strips(chosen: Chosen) -> pd.DataFrame:
    """Return a row for every chosen strip and every goal.

    Columns are the strip, its flying height and course, the flying time up to its end, what is
    wanted, and what the flight gives after this strip and where it alone is left out.
    """
    listed = chosen.plan.blocks[BLOCK].strips
    n, k = len(listed), len(chosen.wanted)

    def each(values: list[object]) -> list[object]:
        return [value for value in values for _ in range(k)]

    return pd.DataFrame(
        {
            "strip": each([*listed]),
            "flying_height_m": each([strip.flying_height_m for strip in listed.values()]),
            "course_deg": each([strip.course_deg for strip in listed.values()]),
            "minutes": each([*chosen.minutes_after]),
            "camera": [goal.camera for goal in chosen.wanted] * n,
            "wanted": [goal.name for goal in chosen.wanted] * n,
            "after": np.ravel(chosen.after),
            "without": np.ravel(chosen.without),
        }
    )
