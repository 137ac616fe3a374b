"""Turns of pictures of one exposure against each other, as a variance component.

The aircraft turns while heads expose at slightly different moments, or line by line. An error
common to thousands of points of a picture is no matching noise: it is a turn of the picture, an
unknown that is observed as zero. Its standard deviation is estimated from the pictures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.unknowns import State, holding
from acx4lib.calibration.estimates import features
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.geometry.frames import log
from acx4lib.least_squares.covariance import propagate
from acx4lib.least_squares.statistics import chi2_sf

ALPHA = 0.001
"""Probability of finding turns of pictures that share their poses."""

LOOSE, LEAST = float(np.radians(0.1)), 1e-6
"""Standard deviation of turns, radians: so large that they are free; and the smallest one."""

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
    network = set_up(bundle.network.block, turns=np.full(3, LOOSE), start=_of_pictures(bundle))
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


def sentence(sigma: Array | None) -> str:
    """Return a sentence on the turns of an exposure's pictures; empty for None."""
    if sigma is None:
        return ""
    about = ", ".join(f"{value:.4f}" for value in np.degrees(sigma).tolist())
    return (
        f"the pictures of an exposure do not share a pose: they are turned by {about}° about the "
        "body's axes (standard deviation, an unknown of every picture)"
    )


def _of_pictures(bundle: Bundle) -> State:
    """Return the state in which every picture has the pose of its exposure."""
    state = bundle.state
    return replace(state, T_m_b=state.T_m_b[bundle.network.block.images.exposure_idx])


def _sigma(loose: Bundle) -> Array | None:
    """Return the standard deviation of turns, corrected for the noise of image points; or None."""
    images, parts = loose.network.block.images, []
    for exposure in np.unique(images.exposure_idx):
        pictures = np.flatnonzero(images.exposure_idx == exposure)
        turns, noise = _against_each_other(loose, pictures)
        if len(pictures) > 1 and noise.max() < (LOOSE / 10) ** 2:  # its points determine the turns
            parts.append((images.camera_idx[pictures], turns, noise))
    if not parts:
        return None
    camera, turns, noise = map(np.concatenate, zip(*parts, strict=True))
    for k in np.unique(camera):  # a turn common to all exposures of a camera is its boresight
        turns[camera == k] -= turns[camera == k].mean(axis=0)
    dof = len(camera) - len(parts) - (len(np.unique(camera)) - 1)
    if dof < 1:
        return None
    of_noise, squares = noise.sum(axis=0), np.sum(turns**2, axis=0)
    if chi2_sf(float(np.max(squares / of_noise)) * dof, dof) > ALPHA:
        return None
    return np.maximum(np.sqrt(np.maximum(squares - of_noise, 0.0) / dof), LEAST)


def _against_each_other(loose: Bundle, pictures: Index) -> tuple[Array, Array]:
    """Return the turns of an exposure's pictures about their mean, radians, and their variances."""
    R, columns = loose.state.T_m_b.R[pictures], loose.network.layout.pose[pictures, 3:].ravel()
    middle = np.kron(np.eye(len(pictures)) - 1 / len(pictures), np.eye(3))
    turns = middle @ log(np.swapaxes(R[:1], -1, -2) @ R).ravel()
    cov = propagate(middle, loose.solution.inverse.at(columns[:, None], columns))
    return turns.reshape(-1, 3), cov.diagonal().reshape(-1, 3)
