"""The lever arm that an interior orientation took up: two-step against single step (section 4.2).

A bundle that observes positions and holds a lever arm must put what is wrong with it somewhere:
into f, x_p, y_p, into the tilts of the images, into the ground and the residuals of the
positions. Least squares says how much goes where, and so what the two methods must differ by.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network
from acx4lib.bundle.observations import PoseObservations
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.mounting import Mountings
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR
from acx4lib.least_squares import adjustment, processors
from acx4lib.least_squares.covariance import propagate
from acx4lib.least_squares.dense import Inverse

ABSORBING = ("f", "xp", "yp")
"""The parameters of an interior orientation that take up a lever arm."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Absorption:
    """What the interior orientation of `two_step_gnss` took up, and what it should have.

    With n cameras, m = 3 n.

    Attributes
    ----------
    cameras : tuple of str
    by_lever : ndarray, shape (m, m)
        d(f, x_p, y_p of every camera) / d(lever arm of every camera beyond what was held), along
        the body's axes, mm per m.
    shift_mm : ndarray, shape (m,)
        Interior orientation of `two_step_gnss` less that of `single_step`.
    lever_m : ndarray, shape (m,)
        Lever arm of `single_step` less what `two_step_gnss` held, body's axes.
    cov_mm : ndarray, shape (m, m)
        A priori covariance of `shift_mm` - `by_lever` @ `lever_m`.
    """

    cameras: tuple[str, ...]
    by_lever: Array
    shift_mm: Array
    lever_m: Array
    cov_mm: Array

    @property
    def lever_seen_m(self) -> Array:
        """The lever arm that the shift means, in the form of `lever_m`."""
        seen: Array = np.linalg.solve(self.by_lever, self.shift_mm)
        return seen

    @property
    def cov_lever_m(self) -> Array:
        """A priori covariance of `lever_seen_m` - `lever_m`, shape (m, m)."""
        return propagate(np.linalg.inv(self.by_lever), self.cov_mm)


def absorption(mountings: Mountings) -> Absorption | None:
    """Compare the two methods; None where they cannot be compared.

    They can where both have an outcome and estimate f, x_p and y_p, and GNSS positions have no
    unknown errors in the single step.

    Notes
    -----
    By Gauss and Markov the single step, which uses the same observations and the attitudes
    besides, is uncorrelated with what any other unbiased estimate differs from it by. So the
    covariance of the difference is the difference of the covariances [1]_. Both methods share
    nearly all of their errors, and it is far smaller than either. Both are therefore taken at one
    state, that of the single step: at the two estimates they would differ by as
    much from the derivatives alone.

    References
    ----------
    .. [1] J. A. Hausman, "Specification tests in econometrics", Econometrica 46, 1978.
    """
    if not {"single_step", "two_step_gnss"} <= set(mountings.methods):
        return None
    single, gnss = mountings["single_step"], mountings["two_step_gnss"]
    one, two = single.calibration, gnss.calibration
    if np.any(_columns(one.layout) < 0) or np.any(_columns(two.layout) < 0):
        return None
    if trajectory_errors.parameters(single.bundle):
        return None
    network, inverse = gnss.bundle.network, _inverse_at(single.bundle, gnss.bundle)
    J, rows = by_lever_arms(network, inverse), _columns(network.layout)
    held = np.concatenate([camera.T_b_c.r for camera in two.cameras])
    return Absorption(
        cameras=tuple(camera.name for camera in one.cameras),
        by_lever=J,
        shift_mm=_interior(two) - _interior(one),
        lever_m=np.concatenate([camera.T_b_c.r for camera in one.cameras]) - held,
        cov_mm=inverse.at(rows[:, None], rows) - _covariance(one, J),
    )


def _inverse_at(single: Bundle, gnss: Bundle) -> Inverse:
    """Return the covariance of the two-step bundle's unknowns at the single step's estimates."""
    state = replace(
        gnss.state, interiors=single.state.interiors, T_m_b=single.T_m_c, x_m=single.state.x_m
    )
    with processors.on_one_thread():
        return adjustment.normals(gnss.network, state).precision().inverse


def by_lever_arms(network: Network, inverse: Inverse) -> Array:
    """Return d(interior orientation) / d(lever arms beyond those held) of a two-step bundle.

    Parameters
    ----------
    network : Network
        Free exterior orientations whose positions are observed.
    inverse : Inverse
        Covariance of its unknowns.

    Returns
    -------
    ndarray, shape (3 n_cameras, 3 n_cameras)
        f, x_p, y_p of every camera by the lever arm of every camera along the body's axes, mm/m.

    Notes
    -----
    An observed position that is off by e changes the unknowns by Q A^T P e. A lever arm that is
    longer than the one held by l has every position observed short of the camera by R_m_b l.
    """
    observed, block = network.observed, network.block
    rows, positions = _columns(network.layout), network.layout.pose[:, :3]
    Q = inverse.at(rows[:, None, None], positions)
    n_cameras = len(block.cameras)
    J = np.zeros((len(rows), n_cameras, 3))
    for k in range(n_cameras):
        own = block.images.camera_idx == k
        seen = own if observed.of_positions is None else np.ones_like(own)
        by_image = _weighed(observed, block.T_m_b_images.R * own[:, None, None])
        J[:, k] = -np.einsum("rna,nab->rb", Q[:, seen], by_image[seen])
    return J.reshape(len(rows), -1)


def _weighed(observed: PoseObservations, off: Array) -> Array:
    """Return the weights of observed positions times what these are off by, (n, 3, k)."""
    if observed.of_positions is None:
        weight = 1 / observed.sigma_position**2
        P = np.einsum("nai,na,naj->nij", observed.R_g_m, weight, observed.R_g_m)
        return np.asarray(P @ off)
    sigma = observed.sigma_position[:, :, None]
    along_grid = observed.of_positions.times(observed.R_g_m @ off / sigma) / sigma
    weighed: Array = np.swapaxes(observed.R_g_m, -1, -2) @ along_grid
    return weighed


def effective_heights(calibration: Calibration, by_lever: Array) -> Array:
    """Return the heights from which a lever arm alone would look like what was taken up of it.

    Parameters
    ----------
    calibration : Calibration
    by_lever : ndarray, shape (3 n_cameras, 3 n_cameras)
        As `by_lever_arms` returns it.

    Returns
    -------
    ndarray, shape (n_cameras, 3)
        Of the components along each camera's own x, y, z, which x_p, y_p and f take up, m.
    """
    heights = []
    for k, camera in enumerate(calibration.cameras):
        own = by_lever[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] @ camera.T_b_c.R
        heights.append([-camera.interior.f / own[row, axis] for axis, row in enumerate((1, 2, 0))])
    return np.array(heights)


def _columns(layout: Layout) -> Index:
    """Return the columns of f, x_p, y_p of every camera, shape (3 n_cameras,)."""
    return layout.interior[:, [INTERIOR.index(name) for name in ABSORBING]].ravel()


def _interior(calibration: Calibration) -> Array:
    interiors = [camera.interior for camera in calibration.cameras]
    return np.array([getattr(i, name) for i in interiors for name in ABSORBING])


def _covariance(calibration: Calibration, by_lever: Array) -> Array:
    """Return the covariance of interior orientation + by_lever @ lever arm, a priori."""
    layout = calibration.layout
    columns = np.concatenate([_columns(layout), layout.mount[:, :3].ravel()])
    J = np.hstack([np.eye(len(by_lever)), by_lever])[:, columns >= 0]
    free = columns[columns >= 0]
    return propagate(J, calibration.cov[np.ix_(free, free)])
