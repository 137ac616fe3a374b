"""What exposures that are left out change: sigma that contain what points of an exposure share.

Thousands of points of a picture share what moves them together: heads that expose at slightly
different moments, relief and branches in all windows, what the lens leaves. Sigma that take them
for independent are too small. Where sigma are right, an estimate without an exposure differs from
that with all by the covariance of the one less that of the other [1]_.

References
----------
.. [1] J. A. Hausman, "Specification tests in econometrics", Econometrica 46, 1978.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.estimates import Calibration, features
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block, ImagePoints
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.covariance import propagate
from acx4lib.least_squares.statistics import chi2_sf

LEAST, MOST = 6, 20
"""Number of groups of exposures, of which one after the other is left out."""

ALPHA, WORTH = 0.001, 1.1
"""Probability of enlarging right sigma, and the smallest factor that matters."""

_LEFT_OUT = 1e3
"""Factor of the sigma of measurements that are left out: their points and poses stay."""


def enlarged(calibration: Calibration, bundle: Bundle) -> Calibration:
    """Return a calibration whose covariance contains what the points of an exposure share.

    The bundle is that from which the calibration comes. It is as it was where control points are,
    where fewer than six exposures have measurements and observed positions, and where its sigma
    explain what the exposures change.

    Notes
    -----
    One factor holds for all interior orientations, and one for the heads against each other beyond
    what follows from the first. The mounting of the first head rests on the trajectory, whose sigma
    have variance components of their own, and keeps its sigma.
    """
    groups = _groups(bundle.network.block, bundle.network.image_points)
    if len(groups) < LEAST or calibration.open_columns.any():
        return calibration
    lens, between, T = between_heads(calibration, bundle.network.layout)
    own = np.concatenate([lens, between])
    rest = np.setdiff1d(np.arange(len(T)), own)
    T = T[np.concatenate([rest, own])]
    if not len(own):
        return calibration
    try:
        moved, cov = _without_each(bundle, groups, calibration.layout, T[len(rest) :])
        factors = _factors(moved, cov, len(lens))
        L = _root(propagate(T, calibration.cov))
    except (AdjustmentError, np.linalg.LinAlgError):  # what is left does not determine everything
        return calibration
    more = np.repeat([0.0, *np.square(factors) - 1], [len(rest), len(lens), len(between)])
    if not more.any():
        return calibration
    back = np.linalg.solve(T, L)
    return replace(
        calibration, cov=calibration.cov + back * more @ back.T, enlarged=(factors[0], factors[1])
    )


def sentence(calibration: Calibration) -> str:
    """Return by how much sigma were enlarged, and why; empty where they were not."""
    what = ("interior orientations", "heads against each other")
    said = [
        f"{k:.1f} ({name})" for k, name in zip(calibration.enlarged, what, strict=True) if k > 1
    ]
    if not said:
        return ""
    return (
        f"sigma are enlarged by {' and '.join(said)}: exposures that are left out change the "
        "estimates by so much more than independent image points would; points of an exposure "
        "share errors"
    )


def _groups(block: Block, points: ImagePoints) -> list[Index]:
    """Return the exposures that are left out together: neighbours, where they are many."""
    exposures = np.unique(block.images.exposure_idx[points.image_idx])
    positions = np.isfinite(block.trajectory.sigma_position[exposures]).all(axis=1)
    if positions.sum() < LEAST or "control" in features(block):
        return []
    return np.array_split(exposures, min(len(exposures), MOST))


def between_heads(calibration: Calibration, there: Layout) -> tuple[Index, Index, Array]:
    """Return which columns are interior orientations, which are heads after the first, and a basis.

    Applied to changes of the columns, the basis, shape (n, n), makes the latter changes of
    differences from the first head, along and about the body's axes. Mountings that the layout
    `there` holds are not among them.
    """
    columns, cameras = calibration.layout, calibration.cameras
    T = np.eye(calibration.n_columns)
    between: list[Index] = [np.zeros(0, dtype=np.intp)]
    shifts, turns = [np.eye(3)] * len(cameras), [camera.T_b_c.R for camera in cameras]
    for part, R in ((slice(0, 3), shifts), (slice(3, 6), turns)):
        first = columns.mount[0, part]
        for k in range(1, len(cameras)):
            own = columns.mount[k, part]
            if np.all([own >= 0, first >= 0, there.mount[k, part] >= 0]):
                T[np.ix_(own, own)], T[np.ix_(own, first)] = R[k], -R[0]
                between.append(own)
    return columns.interior[columns.interior >= 0], np.concatenate(between), T


def _without_each(
    bundle: Bundle, groups: Sequence[Index], columns: Layout, J: Array
) -> tuple[Array, Array]:
    """Return what J of the calibration changes by without each group, and its covariance."""
    network, points = bundle.network, bundle.network.image_points
    both = np.hstack([columns.interior, columns.mount]).ravel()
    at = np.hstack([network.layout.interior, network.layout.mount]).ravel()
    known = (both >= 0) & (at >= 0)
    J, at = J[:, both[known]], at[known]
    whole = adjustment.covariance(network, bundle.state, at)
    exposure = network.block.images.exposure_idx[points.image_idx]
    moved, cov = [], []
    for group in groups:
        sigma_px = np.where(np.isin(exposure, group), _LEFT_OUT, 1.0) * points.sigma_px
        rest = network.with_sigma(
            image_points=replace(points, sigma_px=sigma_px),
            control=network.control,
            observed=network.observed,
            distances=network.distances,
        )
        moved.append(J @ adjustment.normals(rest, bundle.state).step()[0][at])
        cov.append(propagate(J, adjustment.covariance(rest, bundle.state, at) - whole))
    return np.array(moved), bundle.solution.sigma0_sq * np.array(cov)


def _factors(moved: Array, cov: Array, n: int) -> tuple[float, float]:
    """Return the factors of the sigma of the first n quantities, and of the others beyond these."""
    total = cov.sum(axis=0)
    scale = np.sqrt(total.diagonal())
    total = total / scale[:, None] / scale
    follow = np.eye(len(total))
    follow[n:, :n] = -np.linalg.solve(total[:n, :n], total[:n, n:]).T
    moved, cov = moved / scale @ follow.T, propagate(follow, cov / scale[:, None] / scale)
    return _factor(moved[:, :n], cov[:, :n, :n]), _factor(moved[:, n:], cov[:, n:, n:])


def _factor(moved: Array, cov: Array) -> float:
    """Return the factor of sigma that explains changes by groups; one where theirs may do."""
    n = moved.shape[1]
    if n == 0:
        return 1.0
    inverse = np.linalg.inv(cov.sum(axis=0))
    variance = float(np.einsum("ei,ij,ej->", moved, inverse, moved)) / n
    share = np.einsum("ij,eji->e", inverse, cov) / n
    dof = n / float(np.sum(share**2))
    is_more = variance > WORTH**2 and chi2_sf(variance * dof, dof) < ALPHA
    return float(np.sqrt(variance)) if is_more else 1.0


def _root(cov: Array) -> Array:
    """Return L with L L^T = cov, computed without units."""
    scale = np.sqrt(cov.diagonal())
    return scale[:, None] * np.linalg.cholesky(cov / scale[:, None] / scale)
