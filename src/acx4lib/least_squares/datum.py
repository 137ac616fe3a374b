"""The datum of a solution: from minimal to inner constraints.

A network that observes no coordinates may be moved as a whole, and its residuals stay. A minimal
number of held unknowns makes its solution unique; an S-transformation turns this into the
solution in which chosen points keep their place on average.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares.adjustment import Solution
from acx4lib.least_squares.dense import Inverse, held_at_zero
from acx4lib.least_squares.normal_equations import Equations, Problem, gather, point_normals

S = TypeVar("S")


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
