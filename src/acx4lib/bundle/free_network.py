"""Free networks: adjusted without any datum, then given that of inner constraints on points.

Image points alone leave seven motions of the whole block open: three shifts, three turns, a
scale. Held poses, a few control coordinates or positions leave fewer of them. A minimal
number of held unknowns makes the solution unique; an S-transformation turns this into the
solution in which chosen points keep their place on average. The residuals stay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy import linalg

from acx4lib import expected
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.bundle.network import Network
from acx4lib.bundle.rejections import without
from acx4lib.bundle.unknowns import State, holding
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.frames import Pose, skew, transform
from acx4lib.least_squares.adjustment import Solution
from acx4lib.least_squares.normal_equations import Equations, Problem, gather, point_normals
from acx4lib.least_squares.reduced_system import Inverse, held_at_zero

S = TypeVar("S")


FELT = 1e-6
"""Change of an observation, as a share of the change of the block, that no motion may exceed."""

ROUNDS, STILL = 20, 1e-13
"""Largest number of steps to the datum of inner constraints; share of the block's size that ends
them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeNetwork:
    """A free network, adjusted.

    Attributes
    ----------
    minimal : Bundle
        With as many unknowns held as motions are open. Reliability and variance components,
        which do not depend on the datum, are computed from it.
    inner : Bundle
        The same with all its images and points in the datum of inner constraints.
    n_open : int
        The datum defect: number of motions that the observations leave open.
    """

    minimal: Bundle
    inner: Bundle
    n_open: int


def adjust_free(network: Network, points: Mask | None = None) -> FreeNetwork:
    """Adjust a network whose observations do not fix its datum.

    Parameters
    ----------
    network : Network
        Of `adjust.free_orientation`, or of mounted cameras whose mounting is held, without lever
        arms; without refraction.
    points : ndarray of bool, shape (n_points,), optional
        The points of the inner constraints: those of them that take part; by default all.

    Returns
    -------
    FreeNetwork
        The chosen points lie as near to their approximate coordinates, `Network.start`, as the
        open motions allow. Sigma are relative to this datum: their sum of squares over the chosen
        points is the smallest of all datums. Residuals, variance of unit weight, and interior
        orientation with its sigma are those of every datum.

    Raises
    ------
    AdjustmentError
        Where the network does not converge, or the points do not fix the open motions.
    ValueError
        For another kind of network, or points that are no such mask.

    Notes
    -----
    The network is adjusted with minimal constraints, moved by a similarity transformation, and
    its covariance S-transformed (`with_inner_constraints`).
    """
    _require_free_orientation(network)
    chosen = network.free_points
    if points is not None:
        expected.shape("points", points, (network.n_points,))
        chosen = chosen & points
    move = _Similarity.of(network)
    held = _held_columns(network, move)
    minimal = adjust(replace(network, layout=holding(network.layout, held)))
    if len(held) == 0:
        return FreeNetwork(minimal=minimal, inner=minimal, n_open=0)
    state = _brought_back(minimal, move, chosen)
    minimal = adjust(replace(minimal.network, start=state))
    place = np.full(network.n_columns, -1)
    kept = np.setdiff1d(np.arange(network.n_columns), held)
    place[kept] = np.arange(len(kept))
    solution = with_inner_constraints(
        (minimal.network, minimal.state, minimal.solution),
        _motions(network, minimal.state, move),
        place,
        chosen,
    )
    inner = replace(minimal, network=network, solution=solution)
    return FreeNetwork(minimal=minimal, inner=inner, n_open=len(held))


def adjust_free_rejecting(block: Block, set_up: Callable[[Block], Network]) -> Bundle:
    """Adjust a block whose observations may leave its datum open, and reject gross errors.

    Parameters
    ----------
    block : Block
    set_up : callable
        Makes the network of a block, as `adjust_free` needs it.

    Returns
    -------
    Bundle
        As `FreeNetwork.minimal`: points lie as near to where they began as the open motions
        allow; sigma of poses are those against the unknowns of poses that are held.

    Raises
    ------
    AdjustmentError
        As `adjust_free`.

    Notes
    -----
    Residuals, and so the rejections, are those of every datum: they are found with minimal
    constraints.
    """

    def with_minimal_constraints(block: Block) -> Network:
        network = set_up(block)
        _require_free_orientation(network)
        held = _held_columns(network, _Similarity.of(network))
        return replace(network, layout=holding(network.layout, held))

    minimal = adjust_rejecting(block, with_minimal_constraints)
    clean = set_up(without(block, minimal.rejected))
    fit = adjust_free(clean.beginning_at(minimal.state)).minimal
    return replace(fit, rejected=minimal.rejected, stopped=minimal.stopped)


def datum_defect(network: Network) -> int:
    """Return the number of motions of the whole block that its observations leave open.

    Seven where there are image points only, six with a distance; none with three control points.

    Parameters
    ----------
    network : Network
        Of `adjust.free_orientation`, without refraction.

    Raises
    ------
    ValueError
        For another kind of network.
    """
    _require_free_orientation(network)
    return _Similarity.of(network).open.shape[1]


def _require_free_orientation(network: Network) -> None:
    columns = network.layout
    free = [part >= 0 for part in (columns.mount, columns.shift, columns.drift, columns.delay)]
    if any(map(np.any, free)) or np.any(network.start.T_b_c.r):
        raise ValueError("network: expected one of free_orientation, got one of mounted cameras")
    if network.refraction != "none":
        msg = "network: expected one without refraction, which knows the vertical and the height"
        raise ValueError(msg)


# --- motions ---------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class _Similarity:
    """Similarity transformations: three shifts, three turns and a scale about a middle.

    Their seven parameters are metres by which the edge of the block moves.

    Attributes
    ----------
    middle : ndarray, shape (3,)
    size : float
        m.
    open : ndarray, shape (7, d)
        The d combinations that change no observation.
    """

    middle: Array
    size: float
    open: Array

    @classmethod
    def of(cls, network: Network) -> _Similarity:
        """Return the transformations of a network, with those that its observations leave open."""
        x_m = network.start.x_m[network.free_points]
        middle = x_m.mean(axis=0)
        size = float(np.linalg.norm(x_m - middle, axis=1).max(initial=1.0))
        move = cls(middle=middle, size=size, open=np.eye(7))
        noticed = np.concatenate(list(_noticed(network, move)))
        noticed /= np.linalg.norm(noticed, axis=1, keepdims=True)
        _, s, Vt = np.linalg.svd(noticed)
        return replace(move, open=Vt[int(np.sum(s > FELT * s.max(initial=0.0))) :].T)

    def of_points(self, x_m: Array) -> Array:
        """Return d(points) / d(the seven), shape (n, 3, 7)."""
        p = (x_m - self.middle) / self.size
        shift = np.broadcast_to(np.eye(3), (len(p), 3, 3))
        return np.concatenate([shift, -skew(p), p[:, :, None]], axis=2)

    def of_poses(self, T: Pose) -> Array:
        """Return d(poses) / d(the seven), shape (n, 6, 7); rotations are about the own axes."""
        turned = np.zeros((len(T), 3, 7))
        turned[:, :, 3:6] = np.swapaxes(T.R, 1, 2) / self.size
        return np.concatenate([self.of_points(T.r), turned], axis=1)

    def applied(self, state: State, q: Array) -> State:
        """Return the state moved by a finite transformation, q shape (7,)."""
        generator = np.zeros((4, 4))
        generator[:3, :3] = skew(q[3:6]) + q[6] * np.eye(3)
        generator[:3, 3] = q[:3]
        moved = linalg.expm(generator / self.size)
        M, shift = moved[:3, :3], self.middle + self.size * moved[:3, 3]
        T, R = state.T_m_b, M / np.cbrt(np.linalg.det(M))
        return replace(
            state,
            T_m_b=Pose(R=R @ T.R, r=transform(M, T.r - self.middle) + shift),
            x_m=transform(M, state.x_m - self.middle) + shift,
        )


def _noticed(network: Network, move: _Similarity) -> Iterator[Array]:
    """Yield d(observations besides image points, held unknowns) / d(the seven)."""
    state, poses = network.start, network.layout.pose
    G_poses, G_points = move.of_poses(state.T_m_b), move.of_points(state.x_m)
    yield np.zeros((0, 7))
    yield G_poses[poses < 0]
    yield G_points[network.control.point_idx[network.held_control]].reshape(-1, 7)
    by_column = np.zeros((network.n_columns + 1, 7))
    by_column[poses[poses >= 0]] = G_poses[poses >= 0]
    for e in network.equations(state)[1:]:
        felt = e.A @ by_column[e.columns[e.unit]]
        if e.B is not None and e.point is not None:
            felt = felt + e.B @ G_points[e.point]
        felt = felt[np.isfinite(e.sigma)]
        yield felt[np.linalg.norm(felt, axis=1) > FELT**2]


def _motions(network: Network, state: State, move: _Similarity) -> Motions:
    """Return the derivatives of all unknowns by the motions that are open."""
    columns, poses = np.zeros((network.n_columns, 7)), network.layout.pose
    columns[poses[poses >= 0]] = move.of_poses(state.T_m_b)[poses >= 0]
    points = move.of_points(np.where(network.free_points[:, None], state.x_m, move.middle))
    points[~network.free_points] = 0.0
    return Motions(columns=columns @ move.open, points=points @ move.open)


def _held_columns(network: Network, move: _Similarity) -> Index:
    """Return as many columns of poses as motions are open, which fix these motions best."""
    poses = network.layout.pose
    turns = np.zeros_like(poses, dtype=bool)
    turns[:, 3:] = True
    by_open = _motions(network, network.start, move).columns
    by_open[poses[turns & (poses >= 0)]] *= move.size
    _, _, order = linalg.qr(by_open.T, mode="economic", pivoting=True)
    return np.sort(order[: move.open.shape[1]])


def _brought_back(minimal: Bundle, move: _Similarity, chosen: Mask) -> State:
    """Return the state moved so that the chosen points are nearest to their start values."""
    state, x_m = minimal.state, minimal.network.start.x_m[chosen]
    for _ in range(ROUNDS):
        G = (move.of_points(state.x_m[chosen]) @ move.open).reshape(-1, move.open.shape[1])
        q, _, rank, _ = np.linalg.lstsq(G, (x_m - state.x_m[chosen]).ravel(), rcond=FELT)
        if rank < len(q):
            n, needed = int(chosen.sum()), "three that do not lie on one line"
            msg = f"{n} points do not fix the {len(q)} motions that are open: {needed} are needed"
            raise AdjustmentError(msg)
        state = move.applied(state, move.open @ q)
        if np.abs(q).max() < STILL * move.size:
            break
    return state


# --- from minimal to inner constraints --------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Motions:
    """The d motions of a whole network that change no observation.

    Attributes
    ----------
    columns : ndarray, shape (n_columns, d)
        d(unknowns) / d(motions).
    points : ndarray, shape (n_points, 3, d)
        The same of the points; zero for those that are held.
    """

    columns: Array
    points: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class _DatumInverse:
    """Covariance of the reduced unknowns in the datum of inner constraints: see `Inverse`.

    Attributes
    ----------
    minimal : Inverse
        Covariance where some unknowns are held.
    place : ndarray, shape (n,)
        Place of each unknown in it, -1 where held.
    G : ndarray, shape (n, d)
        d(unknowns) / d(motions).
    R : ndarray, shape (n, d)
        Covariance of the unknowns with the motions, where some unknowns are held.
    W : ndarray, shape (d, d)
        Covariance of the motions there.
    """

    minimal: Inverse
    place: Index
    G: Array
    R: Array
    W: Array

    @property
    def n_kept(self) -> int:
        """Number of unknowns that are not held."""
        return int(np.sum(self.place >= 0))

    @property
    def dense(self) -> Array:
        """The whole covariance matrix, shape (n, n)."""
        each = np.arange(len(self.place))
        return self.at(each[:, None], each)

    @property
    def undetermined(self) -> Mask:
        """Columns that take part in a direction left open, shape (n,); the datum is none."""
        return np.append(self.minimal.undetermined, False)[self.place]

    @property
    def defect(self) -> int:
        """Number of directions that the observations leave open: the datum, and others."""
        return self.minimal.defect + len(self.place) - self.n_kept

    @property
    def condition(self) -> float:
        """Condition of the scaled normal matrix where some unknowns are held."""
        return self.minimal.condition

    @property
    def weakest(self) -> Array:
        """Eigenvector of the smallest eigenvalue of this matrix, zero for held unknowns."""
        return gather(self.minimal.weakest, self.place)

    def at(self, rows: Index, columns: Index) -> Array:
        """Return the entries at two arrays of columns that broadcast against each other."""
        out = held_at_zero(self.minimal, self.place[rows], self.place[columns])
        G, R = self.G, self.R
        out -= np.einsum("...i,...i->...", R[rows], G[columns])
        out -= np.einsum("...i,...i->...", G[rows], R[columns])
        out += np.einsum("...i,...i->...", G[rows] @ self.W, G[columns])
        return out

    def times(self, J: Array) -> Array:
        """Return J times the covariance, shape (..., n) as J."""
        G, R, free = self.G, self.R, self.place >= 0
        kept = np.zeros((*J.shape[:-1], self.n_kept))
        kept[..., self.place[free]] = J[..., free]
        out = np.zeros(J.shape)
        out[..., free] = self.minimal.times(kept)[..., self.place[free]]
        JG = J @ G
        return out - J @ R @ G.T + (JG @ self.W) @ G.T - JG @ R.T


def with_inner_constraints(
    minimal: tuple[Problem[S], S, Solution], motions: Motions, place: Index, chosen: Mask
) -> Solution:
    """Return a solution in the datum that moves the chosen points least.

    Parameters
    ----------
    minimal : Problem, its state, Solution
        Adjusted with as many unknowns held as there are motions.
    motions : Motions
        Of all unknowns, at that state.
    place : ndarray, shape (n_columns,)
        Where all unknowns stand among those of `minimal`, -1 for those that are held.
    chosen : ndarray of bool, shape (n_points,)

    Returns
    -------
    Solution
        Residuals and their tests are the same. The trace of the chosen points' covariance is the
        smallest that a datum can give them.

    Notes
    -----
    With G the derivatives of all unknowns by the motions and H those of the chosen points, zero
    elsewhere, the covariance Q becomes S Q S^T, S = I - G (H^T G)^-1 H^T [1]_.

    References
    ----------
    .. [1] W. Baarda, "S-transformations and criterion matrices", 1973.
    """
    problem, state, solution = minimal
    H = np.where(chosen[:, None, None], motions.points, 0.0)
    to_motions = np.linalg.inv(np.einsum("pik,pil->kl", H, H))
    by_columns, by_points = _covariances_with(problem.equations(state), problem, solution, H)
    W = to_motions @ np.einsum("pik,pil->kl", H, by_points) @ to_motions
    G, R = motions.points, by_points @ to_motions
    crossed = R @ np.swapaxes(G, 1, 2)
    cov = solution.cov_points - crossed - np.swapaxes(crossed, 1, 2) + G @ W @ np.swapaxes(G, 1, 2)
    inverse = _DatumInverse(
        minimal=solution.inverse,
        place=place,
        G=motions.columns,
        R=np.append(by_columns @ to_motions, np.zeros((1, len(W))), axis=0)[place],
        W=W,
    )
    return replace(
        solution,
        inverse=inverse,
        cov_points=cov,
        datum="inner",
        n_unknowns=solution.n_unknowns + int(np.sum(place < 0)),
    )


def _covariances_with(
    equations: Sequence[Equations], problem: Problem[S], solution: Solution, H: Array
) -> tuple[Array, Array]:
    """Return the covariances of columns and points with sums over the points, H^T x."""
    V, _ = point_normals(problem.free_points, equations)
    directly = np.linalg.solve(V, H)
    directly[~problem.free_points] = 0.0
    shared = np.zeros((problem.n_columns + 1, H.shape[2]))
    coupled = [(e, e.B, e.point) for e in equations if e.B is not None and e.point is not None]
    for e, B, point in coupled:
        weighted = B @ directly[point] / e.sigma[:, :, None] ** 2
        np.add.at(shared, e.columns[e.unit], np.swapaxes(e.A, 1, 2) @ weighted)
    by_columns = -solution.inverse.times(shared[:-1].T).T
    padded = np.append(by_columns, np.zeros((1, H.shape[2])), axis=0)
    moved = np.zeros_like(H)
    for e, B, point in coupled:
        weighted = e.A @ padded[e.columns[e.unit]] / e.sigma[:, :, None] ** 2
        np.add.at(moved, point, np.swapaxes(B, 1, 2) @ weighted)
    by_points = directly - np.linalg.solve(V, moved)
    by_points[~problem.free_points] = 0.0
    return by_columns, by_points
