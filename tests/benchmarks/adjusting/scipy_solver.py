"""Adjust a problem file with scipy's `least_squares`: ``python scipy_solver.py PROBLEM``.

Trust region reflective, the Jacobian sparse and analytic, steps by lsmr, columns scaled.
"""

import sys
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.optimize import least_squares

from acx4lib.bundle.network import Network
from acx4lib.bundle.unknowns import State
from acx4lib.geometry.frames import log_jacobian
from benchmarks.adjusting import problem_file
from benchmarks.measure import memory_mb, report, timed

EVALUATIONS = 200


def state_at(network: Network, x: np.ndarray) -> State:
    """Return the start moved by x: columns, then three coordinates of every point."""
    n = network.n_columns
    return network.moved(network.start, x[:n], x[n:].reshape(-1, 3))


def residuals(network: Network, x: np.ndarray) -> np.ndarray:
    """Return v / sigma of all observations."""
    return np.concatenate([(v / s).ravel() for v, s in network.residuals(state_at(network, x))])


def jacobian(network: Network, x: np.ndarray) -> sparse.csr_matrix:
    """Return the derivatives of `residuals`."""
    n, n_unknowns = network.n_columns, len(x)
    parts = []
    for e in network.equations(state_at(network, x)):
        m, d = e.v.shape
        rows = np.arange(m * d).reshape(m, d, 1)
        columns = [np.broadcast_to(e.columns[e.unit][:, None], e.A.shape)]
        values = [e.A / e.sigma[:, :, None]]
        if e.B is not None:
            places = n + 3 * e.point[:, None, None] + np.arange(3)
            columns.append(np.broadcast_to(places, e.B.shape))
            values.append(e.B / e.sigma[:, :, None])
        column, value = np.concatenate(columns, axis=2), np.concatenate(values, axis=2)
        row = np.broadcast_to(rows, value.shape)
        at = (value.ravel(), (row.ravel(), column.ravel()))
        parts.append(sparse.coo_matrix(at, shape=(m * d, n_unknowns)))
    return sparse.vstack(parts).tocsr() @ from_start(network, x)


def from_start(network: Network, x: np.ndarray) -> sparse.csr_matrix:
    """Return by how much small turns here vary with the rotation vectors from the start."""
    turns = np.concatenate([network.layout.mount[:, 3:], network.layout.pose[:, 3:]])
    out = sparse.eye(len(x), format="lil")
    for columns, R in zip(turns, np.linalg.inv(log_jacobian(x[turns])), strict=True):
        out[np.ix_(columns, columns)] = R
    return out.tocsr()


def main(path: Path) -> None:
    """Read, adjust, report."""
    baseline_mb = memory_mb("VmRSS")
    network = problem_file.read(path)
    found, seconds = timed(
        lambda: least_squares(
            lambda x: residuals(network, x),
            np.zeros(network.n_columns + 3 * network.n_points),
            jac=lambda x: jacobian(network, x),
            method="trf",
            tr_solver="lsmr",
            x_scale="jac",
            ftol=1e-10,
            xtol=None,
            gtol=None,
            max_nfev=EVALUATIONS,
        )
    )
    peak_mb = memory_mb("VmHWM")
    report(
        {
            **seconds,
            "peak_mb": peak_mb,
            "growth_mb": peak_mb - baseline_mb,
            "cost": 2 * float(found.cost),
            "steps": int(found.nfev),
            "converged": bool(found.success),
        }
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
