"""Free networks: adjusted without any datum, then given that of inner constraints on points.

Image points alone leave seven motions of the whole block open: three shifts, three turns, a
scale. Held poses or a few control points leave fewer of them. A minimal number of held unknowns
makes the solution unique; an S-transformation turns its covariances into those in which all
points keep their place on average. The residuals stay. All matrices are whole ones, for blocks
of some dozen images.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.unknowns import State, holding
from acx4lib.expected import Array
from acx4lib.geometry.frames import skew
from acx4lib.least_squares.reduced_system import Dense, DenseInverse

FELT = 1e-6
"""Share of the observations' change by the unknowns above which they notice a motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeNetwork:
    """A free network, adjusted.

    Attributes
    ----------
    minimal : Bundle
        With as many unknowns of poses held as motions are open. Reliability and variance
        components, which do not depend on the datum, are computed from it.
    inner : Bundle
        The same estimates and residuals, with all covariances in the datum of inner constraints
        on all points.
    n_open : int
        The datum defect: number of motions that the observations leave open.
    """

    minimal: Bundle
    inner: Bundle
    n_open: int


def adjust_free(network: Network) -> FreeNetwork:
    """Adjust a network whose observations do not fix its datum.

    Parameters
    ----------
    network : Network
        Of `adjust.free_orientation`, without refraction.

    Raises
    ------
    AdjustmentError
        Where the network does not converge.

    Notes
    -----
    With G the derivatives of all unknowns by the open motions and H those of the points, zero
    elsewhere, the covariance Q of the minimal constraints becomes S Q S^T,
    S = I - G (H^T G)^-1 H^T [1]_. The sum of the points' variances is the smallest of all datums.

    References
    ----------
    .. [1] W. Baarda, "S-transformations and criterion matrices", 1973.
    """
    n, size = network.n_columns, _size(network.start.x_m[network.free_points])
    by_columns = _open_motions(network, network.start)[:n]
    turns = network.layout.pose[:, 3:]
    by_columns[turns[turns >= 0]] *= size
    _, _, order = linalg.qr(by_columns.T, mode="economic", pivoting=True)
    held = np.sort(order[: by_columns.shape[1]])
    minimal = adjust(replace(network, layout=holding(network.layout, held)))
    J, G = _jacobian(network, minimal.state), _open_motions(network, minimal.state)
    N = J.T @ J
    kept, Q = np.setdiff1d(np.arange(len(N)), held), np.zeros_like(N)
    Q[np.ix_(kept, kept)] = (
        Dense(N=N[np.ix_(kept, kept)], diagonal=N.diagonal()[kept]).inverse().dense
    )
    H = np.where(np.arange(len(G))[:, None] < n, 0.0, G)
    S = np.eye(len(G)) - G @ np.linalg.solve(H.T @ G, H.T)
    Q = S @ Q @ S.T
    free = np.flatnonzero(network.free_points)
    cov_points, each = np.zeros((network.n_points, 3, 3)), np.arange(len(free))
    cov_points[free] = Q[n:, n:].reshape(len(free), 3, len(free), 3)[each, :, each]
    inverse = DenseInverse(
        dense=Q[:n, :n],
        undetermined=np.zeros(n, dtype=bool),
        system=Dense(N=N[:n, :n], diagonal=N.diagonal()[:n]),
        defect=len(held),
    )
    solution = replace(minimal.solution, inverse=inverse, cov_points=cov_points, n_unknowns=len(N))
    inner = replace(minimal, network=network, solution=solution)
    return FreeNetwork(minimal=minimal, inner=inner, n_open=len(held))


def datum_defect(network: Network) -> int:
    """Return the number of motions of the whole block that its observations leave open.

    Seven where there are image points only; none with three control points.

    Parameters
    ----------
    network : Network
        Of `adjust.free_orientation`, without refraction.
    """
    return _open_motions(network, network.start).shape[1]


def _open_motions(network: Network, state: State) -> Array:
    """Return d(unknowns) / d(the motions that change no observation), shape (n_unknowns, d).

    Motions are three shifts, three turns and a scale about the middle of the points, in metres by
    which the edge of the block moves. Rotations of poses are about their own axes.
    """
    x_m, T = state.x_m[network.free_points], state.T_m_b
    middle, size = x_m.mean(axis=0), _size(x_m)

    def of_points(x_m: Array) -> Array:
        p = (x_m - middle) / size
        return np.concatenate([np.tile(np.eye(3), (len(p), 1, 1)), -skew(p), p[:, :, None]], axis=2)

    turned = np.zeros((len(T), 3, 7))
    turned[:, :, 3:6] = np.swapaxes(T.R, 1, 2) / size
    by_pose, pose = np.concatenate([of_points(T.r), turned], axis=1), network.layout.pose
    G = np.zeros((network.n_columns, 7))
    G[pose[pose >= 0]] = by_pose[pose >= 0]
    G = np.concatenate([G, of_points(x_m).reshape(-1, 7)])
    J = _jacobian(network, state)
    _, s, Vt = np.linalg.svd(J @ G)
    felt = FELT * np.linalg.norm(np.abs(J) @ np.abs(G))
    return np.asarray(G @ Vt[int(np.sum(s > felt)) :].T)


def _size(x_m: Array) -> float:
    """Return the largest distance of points from their middle, m."""
    return float(np.linalg.norm(x_m - x_m.mean(axis=0), axis=1).max(initial=1.0))


def _jacobian(network: Network, state: State) -> Array:
    """Return d(observations over their sigma) / d(columns, then free points), whole."""
    n, free = network.n_columns, network.free_points
    place = np.where(free, n + 3 * (np.cumsum(free) - 1), -1)
    parts = []
    for e in network.equations(state):
        m, d, _ = e.A.shape
        J = np.zeros((m, d, n + 3 * int(free.sum()) + 1))  # the last column is that of held ones
        np.put_along_axis(J, np.broadcast_to(e.columns[e.unit][:, None], e.A.shape), e.A, axis=2)
        if e.B is not None and e.point is not None:
            at = place[e.point][:, None, None]
            where = np.where(at < 0, -1, at + np.arange(3))
            np.put_along_axis(J, np.broadcast_to(where, e.B.shape), e.B, axis=2)
        parts.append((J[:, :, :-1] / e.sigma[:, :, None]).reshape(-1, J.shape[2] - 1))
    return np.concatenate(parts)
