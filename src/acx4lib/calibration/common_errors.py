"""Errors common to the points of a picture or an exposure: turns of pictures, and larger sigma.

Thousands of points of a picture share errors: heads expose at slightly different moments or line
by line while the aircraft turns, relief and branches lie in all windows, the lens model leaves a
remainder. Sigma of independent points are too small.

The turn of a picture is an unknown that is observed as zero (`turned`); its standard deviation
is a variance component. Whatever remains is found by a jackknife over exposures (`enlarged`):
where sigma are right, the covariance of the difference between the estimates without an exposure
and with all is the difference of their covariances [1]_.

References
----------
.. [1] J. A. Hausman, "Specification tests in econometrics", Econometrica 46, 1978.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.unknowns import Layout, State, holding
from acx4lib.calibration.estimates import Calibration, features
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.geometry.frames import log
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.covariance import propagate
from acx4lib.least_squares.statistics import chi2_sf

_LOOSE_TURN = float(np.radians(0.1))
"""Standard deviation of turns, radians, so large that they are free."""

SetUp = Callable[..., Network]
"""Takes a block, `turns` and `start`, as `adjust.mounted_orientation` does."""


def turned(block: Block, bundle: Bundle, set_up: SetUp) -> tuple[Bundle, Array | None]:
    """Return a block's adjustment with turned pictures, and the standard deviation of the turns.

    The given bundle and None are returned where there are control points, where no exposure has two
    pictures, and where the noise of image points explains the turns.

    Parameters
    ----------
    block : Block
    bundle : Bundle
        Its adjustment in which the pictures of an exposure share a pose.
    set_up : callable
        Makes the network of a block.

    Returns
    -------
    Bundle
    ndarray, shape (3,), or None
        About the body's axes, radians.
    """
    n_exposures = len(np.unique(block.images.exposure_idx))
    if "control" in features(block) or len(block.images) == n_exposures:
        return bundle, None
    try:
        sigma = _sigma(freely_turned(bundle, set_up))
        if sigma is None:
            return bundle, None
        return by_turns(bundle, set_up, sigma), sigma
    except (AdjustmentError, np.linalg.LinAlgError):  # too few points for a pose of every picture
        return bundle, None


def freely_turned(bundle: Bundle, set_up: SetUp) -> Bundle:
    """Adjust a block whose pictures turn freely; its cameras are held at a bundle's estimates.

    Parameters
    ----------
    bundle : Bundle
        Adjustment with shared poses; its rejections are kept.
    set_up : callable
        As in `turned`.

    Raises
    ------
    AdjustmentError
        Where it does not converge.
    """
    network = set_up(
        bundle.network.block, turns=np.full(3, _LOOSE_TURN), start=_of_pictures(bundle)
    )
    cameras = np.hstack([network.layout.interior, network.layout.mount])
    return adjust(replace(network, layout=holding(network.layout, cameras[cameras >= 0])))


def by_turns(bundle: Bundle, set_up: SetUp, sigma: Array) -> Bundle:
    """Adjust a block with turned pictures, without the rejections of another adjustment.

    With a pose for every picture, points of one good ray slide away: a search for gross errors
    would not converge.

    Parameters
    ----------
    bundle, set_up
        As in `freely_turned`.
    sigma : ndarray, shape (3,)
        Standard deviation of the turns, radians.
    """
    adjusted = adjust(set_up(bundle.network.block, turns=sigma, start=_of_pictures(bundle)))
    return replace(adjusted, rejected=bundle.rejected)


def _of_pictures(bundle: Bundle) -> State:
    """Return the state in which every picture has the pose of its exposure."""
    state = bundle.state
    return replace(state, T_m_b=state.T_m_b[bundle.network.block.images.exposure_idx])


def _sigma(loose: Bundle) -> Array | None:
    """Return the standard deviation of turns, corrected for the noise of image points; or None."""
    images, parts = loose.network.block.images, []
    for exposure in np.unique(images.exposure_idx):
        pictures = np.flatnonzero(images.exposure_idx == exposure)
        R, columns = loose.state.T_m_b.R[pictures], loose.network.layout.pose[pictures, 3:].ravel()
        middle = np.kron(np.eye(len(pictures)) - 1 / len(pictures), np.eye(3))
        turns = middle @ log(np.swapaxes(R[:1], -1, -2) @ R).ravel()
        noise = propagate(middle, loose.solution.inverse.at(columns[:, None], columns)).diagonal()
        if len(pictures) > 1 and noise.max() < (_LOOSE_TURN / 10) ** 2:  # its points tell the turns
            camera = images.camera_idx[pictures]
            parts.append((camera, turns.reshape(-1, 3), noise.reshape(-1, 3)))
    if not parts:
        return None
    camera, turns, noise = map(np.concatenate, zip(*parts, strict=True))
    for k in np.unique(camera):  # a turn common to all exposures of a camera is its boresight
        turns[camera == k] -= turns[camera == k].mean(axis=0)
    dof = len(camera) - len(parts) - (len(np.unique(camera)) - 1)
    if dof < 1:
        return None
    of_noise, squares = noise.sum(axis=0), np.sum(turns**2, axis=0)
    if chi2_sf(float(np.max(squares / of_noise)) * dof, dof) > 0.001:
        return None
    return np.maximum(np.sqrt(np.maximum(squares - of_noise, 0.0) / dof), 1e-6)


# --- jackknife over exposures -----------------------------------------------------------------


def enlarged(calibration: Calibration, bundle: Bundle) -> Calibration:
    """Return a calibration whose covariance includes errors common to the points of an exposure.

    The calibration is that of the bundle. It is returned unchanged where there are control points,
    where fewer than six exposures have measurements and observed positions, and where its sigma
    explain the changes between exposures.

    Notes
    -----
    One factor holds for all interior orientations, another for the heads against each other given
    the interior orientations. The mounting of the first head rests on the trajectory, whose sigma
    have variance components of their own, and keeps its sigma.
    """
    block, points = bundle.network.block, bundle.network.image_points
    exposures = np.unique(block.images.exposure_idx[points.image_idx])
    positions = np.isfinite(block.trajectory.sigma_position[exposures]).all(axis=1)
    few = positions.sum() < 6 or "control" in features(block)
    if few or calibration.open_columns.any():
        return calibration
    groups = np.array_split(exposures, min(len(exposures), 20))  # neighbours, where they are many
    lens, between, T = between_heads(calibration, bundle.network.layout)
    chosen = np.concatenate([lens, between])
    others = np.setdiff1d(np.arange(len(T)), chosen)
    T = T[np.concatenate([others, chosen])]
    if not len(chosen):
        return calibration
    try:
        moved, cov = _without_each(bundle, groups, calibration.layout, T[len(others) :])
        factors = _factors(moved, cov, len(lens))
        covariance = propagate(T, calibration.cov)
        scale = np.sqrt(covariance.diagonal())  # without units
        L = scale[:, None] * np.linalg.cholesky(covariance / scale[:, None] / scale)
    except (AdjustmentError, np.linalg.LinAlgError):  # the rest does not determine all unknowns
        return calibration
    more = np.repeat([0.0, *np.square(factors) - 1], [len(others), len(lens), len(between)])
    if not more.any():
        return calibration
    back = np.linalg.solve(T, L)
    return replace(
        calibration, cov=calibration.cov + back * more @ back.T, enlarged=(factors[0], factors[1])
    )


def between_heads(calibration: Calibration, there: Layout) -> tuple[Index, Index, Array]:
    """Return columns of interior orientations, of mountings after the first, and a basis.

    The basis, shape (n, n), transforms changes of the mountings into changes of their differences
    from the first head, along and about the body's axes. Mountings that the layout `there` holds
    are left out.
    """
    columns, cameras = calibration.layout, calibration.cameras
    T = np.eye(calibration.n_columns)
    between: list[Index] = [np.zeros(0, dtype=np.intp)]
    shifts, turns = [np.eye(3)] * len(cameras), [camera.T_b_c.R for camera in cameras]
    for part, R in ((slice(0, 3), shifts), (slice(3, 6), turns)):
        first = columns.mount[0, part]
        for k in range(1, len(cameras)):
            mount = columns.mount[k, part]
            if np.all([mount >= 0, first >= 0, there.mount[k, part] >= 0]):
                T[np.ix_(mount, mount)], T[np.ix_(mount, first)] = R[k], -R[0]
                between.append(mount)
    return columns.interior[columns.interior >= 0], np.concatenate(between), T


def _without_each(
    bundle: Bundle, groups: Sequence[Index], columns: Layout, J: Array
) -> tuple[Array, Array]:
    """Return the changes of J x without each group of exposures, and their covariances."""
    network, points = bundle.network, bundle.network.image_points
    calibration_columns = np.hstack([columns.interior, columns.mount]).ravel()
    bundle_columns = np.hstack([network.layout.interior, network.layout.mount]).ravel()
    known = (calibration_columns >= 0) & (bundle_columns >= 0)
    J, bundle_columns = J[:, calibration_columns[known]], bundle_columns[known]
    whole = adjustment.covariance(network, bundle.state, bundle_columns)
    exposure = network.block.images.exposure_idx[points.image_idx]
    moved, cov = [], []
    for group in groups:
        sigma_px = np.where(np.isin(exposure, group), 1e3, 1.0) * points.sigma_px
        without_group = network.with_sigma(
            image_points=replace(points, sigma_px=sigma_px),
            control=network.control,
            observed=network.observed,
        )
        moved.append(J @ adjustment.normals(without_group, bundle.state).step()[0][bundle_columns])
        cov.append(
            propagate(J, adjustment.covariance(without_group, bundle.state, bundle_columns) - whole)
        )
    return np.array(moved), bundle.solution.sigma0_sq * np.array(cov)


def _factors(moved: Array, cov: Array, n: int) -> tuple[float, float]:
    """Return the factors of sigma of the first n quantities, and of the others given these."""
    total = cov.sum(axis=0)
    scale = np.sqrt(total.diagonal())
    total = total / scale[:, None] / scale
    follow = np.eye(len(total))
    follow[n:, :n] = -np.linalg.solve(total[:n, :n], total[:n, n:]).T
    moved, cov = moved / scale @ follow.T, propagate(follow, cov / scale[:, None] / scale)
    return _factor(moved[:, :n], cov[:, :n, :n]), _factor(moved[:, n:], cov[:, n:, n:])


def _factor(moved: Array, cov: Array) -> float:
    """Return the factor of sigma that explains the changes; one where sigma explain them."""
    n = moved.shape[1]
    if n == 0:
        return 1.0
    inverse = np.linalg.inv(cov.sum(axis=0))
    variance = float(np.einsum("ei,ij,ej->", moved, inverse, moved)) / n
    share = np.einsum("ij,eji->e", inverse, cov) / n
    dof = n / float(np.sum(share**2))
    is_more = variance > 1.1**2 and chi2_sf(variance * dof, dof) < 0.001
    return float(np.sqrt(variance)) if is_more else 1.0
