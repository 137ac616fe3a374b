"""Does the boresight stay? Steps between strips and a drift, as added unknowns of an adjustment.

Boresights of single images share the errors of the bundle: of one strip, they are off together.
So their differences are tested with the covariance of the attitudes' residuals, which has these
errors, and not with the scatter within the strips.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.bundle.observations.strips import has_times
from acx4lib.bundle.observations.trajectory import attitude_equations
from acx4lib.expected import Array, Index
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.least_squares.problem import Equations
from acx4lib.least_squares.statistical import distributions

OPEN = 1e-3
"""Share of a turn that shows in the residuals, below which it is a boresight or not determined."""

COMMON = 1e-5
"""That share of a turn of all exposures, below which the boresight takes it up whole."""

LEAST_REDUNDANCY = 1.0
"""Redundancy of the attitudes, beside the turns, from which their scatter is known at all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Turns:
    """Turns of the cameras against the body, tested together.

    Attributes
    ----------
    names : tuple of str
        Strips; of a drift, one name: what is given is the change from the first exposure to the
        last.
    turns, sigma : ndarray, shape (n, 3)
        About the body's axes, less the mean of all exposures; radians, sigma from the attitudes'
        residuals that are left. Infinite where a turn does not show in the residuals.
    f : float
        (T / dof) / s^2; T is the sum of squares that the turns explain, s^2 the variance factor of
        the attitudes beside them.
    dof : int
    redundancy : float
        Of the attitudes, beside the turns.
    """

    names: tuple[str, ...]
    turns: Array
    sigma: Array
    f: float
    dof: int
    redundancy: float

    @property
    def p(self) -> float:
        """Probability of such turns, or larger ones, where the boresight stays."""
        return distributions.f_sf(self.f, self.dof, self.redundancy)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Residuals:
    """The attitudes' residuals, with what turns would do to them.

    Attributes
    ----------
    equations : Equations
    redundancy : float
    shown : ndarray, shape (m, 3, k)
        By how much a turn of each kind shows in the residuals: Q_vv P C.
    normal, right : ndarray, shape (k, k) and (k,)
        C^T P Q_vv P C and C^T P v.
    scale : ndarray, shape (k,)
        Roots of the diagonal of C^T P C.
    """

    equations: Equations
    redundancy: float
    shown: Array
    normal: Array
    right: Array
    scale: Array


def between_strips(bundle: Bundle) -> Turns | None:
    """Test whether the boresight differs between strips.

    Parameters
    ----------
    bundle : Bundle
        With attitudes as observations, such as that of the single step.

    Returns
    -------
    Turns or None
        None where there are no two strips with attitudes that the images control.

    Notes
    -----
    With the residuals v = estimated - observed, their weights P and covariance Q_vv, and C the
    derivatives of the observed attitudes by the turns, the turns are M^+ C^T P v with
    M = C^T P Q_vv P C, and the sum of squares falls by T = v^T P C M^+ C^T P v [1]_. That is what
    the adjustment gives with the turns as unknowns, where it is linear in them. Turns that all
    exposures share are no part of it.

    References
    ----------
    .. [1] K.-R. Koch, "Parameter Estimation and Hypothesis Testing in Linear Models", 2nd
       edition, 1999, chapters 3.4 and 4.2.
    """
    expected.instance("bundle", bundle, Bundle)
    block = bundle.network.block
    strip = np.full(len(block.trajectory), "", dtype=object)
    strip[block.images.exposure_idx] = block.images.strips
    names = tuple(filter(None, dict.fromkeys(strip)))
    if len(names) < 2:
        return None
    own = np.stack([strip == name for name in names], axis=1).astype(float)
    mean = own.mean(axis=0)
    return _tested(bundle, names, own - mean, np.eye(len(names)) - mean)


def over_time(bundle: Bundle) -> Turns | None:
    """Test whether the boresight drifts, linearly over time or over the order of the exposures.

    Parameters
    ----------
    bundle : Bundle
        As in `between_strips`; so is the test.
    """
    expected.instance("bundle", bundle, Bundle)
    trajectory = bundle.network.block.trajectory
    time = trajectory.time_s if has_times(trajectory) else np.arange(len(trajectory), dtype=float)
    if not np.ptp(time) > 0:
        return None
    share = (time - time.mean()) / np.ptp(time)
    return _tested(bundle, ("drift",), share[:, None], np.eye(1))


def _tested(bundle: Bundle, names: tuple[str, ...], shares: Array, told: Array) -> Turns | None:
    """Test turns beside one that all exposures share.

    `shares`, shape (m, n), says how far each exposure has each turn, with the mean zero; `told`,
    shape (n, n), is how far what is given has each of them.
    """
    if not _observes_attitudes(bundle.network):
        return None
    common_and_each = np.column_stack([np.ones(len(shares)), shares])
    k = 3 * common_and_each.shape[1]
    C = np.einsum("mn,ab->manb", common_and_each, np.eye(3)).reshape(-1, 3, k)
    common, each = np.arange(3), np.arange(3, k)
    r = _beside(_residuals(bundle, C), common, each)
    _, of_common, _ = _solved(r, common, COMMON)
    explained, of_each, dof = _solved(r, each, OPEN)
    inverse = np.zeros_like(r.normal)
    inverse[:3, :3], inverse[3:, 3:] = of_common, of_each
    left = r.equations.v - r.shown @ (inverse @ r.right)
    weighed = r.equations.weighed(r.shown)
    redundancy = r.redundancy - float(np.sum(inverse * np.einsum("mdk,mdl->kl", r.shown, weighed)))
    if dof < 1 or redundancy < LEAST_REDUNDANCY:
        return None
    variance = float(np.sum(left * r.equations.weighed(left[:, :, None])[:, :, 0])) / redundancy
    if not variance > 0:
        return None
    by_turns = np.kron(told, np.eye(3))
    sigma = sigmas(variance * propagate(by_turns, of_each))
    return Turns(
        names=names,
        turns=(by_turns @ of_each @ r.right[each]).reshape(-1, 3),
        sigma=np.where(sigma > 0, sigma, np.inf).reshape(-1, 3),
        f=explained / dof / variance,
        dof=dof,
        redundancy=redundancy,
    )


def _beside(r: _Residuals, common: Index, each: Index) -> _Residuals:
    """Return turns that change what they have in common, so that they are independent of it.

    A boresight without sigma takes up a turn of all exposures whole, a declared one nearly so:
    neither is a step.
    """
    _, inverse, _ = _solved(r, common, COMMON)
    K = np.eye(len(r.right))
    K[np.ix_(common, each)] = -inverse @ r.normal[np.ix_(common, each)]
    return replace(r, shown=r.shown @ K, normal=K.T @ r.normal @ K, right=K.T @ r.right)


def _observes_attitudes(network: Network) -> bool:
    rows = len(network.pose_names) == len(network.block.trajectory)
    return rows and bool(np.isfinite(network.observed.sigma_attitude).any())


def _residuals(bundle: Bundle, C: Array) -> _Residuals:
    """Return what turns C, shape (m, 3, k), do to the residuals of the attitudes."""
    network, solution = bundle.network, bundle.solution
    e = attitude_equations(network.observed, bundle.state, network.layout)
    weighed = e.weighed(C)
    columns, held = e.columns[e.unit], e.columns[e.unit] < 0
    A = np.where(held[:, None, :], 0.0, e.A)
    by_columns = np.zeros((network.n_columns, C.shape[2]))
    np.add.at(by_columns, columns, np.einsum("mda,mdk->mak", A, weighed))
    gain = solution.inverse.times(by_columns.T).T
    shown = C - np.einsum("mda,mak->mdk", A, gain[columns])
    group = solution.group("attitude")
    return _Residuals(
        equations=e,
        redundancy=float(np.nansum(group.redundancy)),
        shown=np.where(np.isfinite(e.sigma)[:, :, None], shown, 0.0),
        normal=np.einsum("mdk,mdl->kl", C, weighed) - by_columns.T @ gain,
        right=np.einsum("mdk,md->k", weighed, e.v),
        scale=np.sqrt(np.einsum("mdk,mdk->k", C, weighed)),
    )


def _solved(r: _Residuals, own: Index, least: float) -> tuple[float, Array, int]:
    """Return what some of the turns explain, the inverse of their normal matrix, and its rank."""
    scale = np.where(r.scale[own] > 0, r.scale[own], 1.0)
    values, vectors = np.linalg.eigh(r.normal[np.ix_(own, own)] / scale[:, None] / scale)
    kept = values > least
    part = vectors[:, kept] / scale[:, None]
    along = part.T @ r.right[own]
    return float(np.sum(along**2 / values[kept])), (part / values[kept]) @ part.T, int(kept.sum())


def as_json(bundle: Bundle) -> Mapping[str, object]:
    """Return both tests as values for JSON, angles in degrees; null for one that is not made."""
    made = {"strips": between_strips(bundle), "drift": over_time(bundle)}
    return {name: None if found is None else _told(found) for name, found in made.items()}


def _told(found: Turns) -> dict[str, object]:
    return {
        "names": list(found.names),
        "turns_deg": np.degrees(found.turns).tolist(),
        "sigma_deg": np.degrees(found.sigma).tolist(),
        "f": found.f,
        "dof": found.dof,
        "redundancy": found.redundancy,
        "p": found.p,
    }
