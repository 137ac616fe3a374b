"""Tables of an adjusted bundle, against what follows from its unknowns one by one."""

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.bundle.network import camera_poses
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.results import folder, rows
from support.helpers import numeric_jacobian


def _in_grid(network, state):
    """Return E, N, h, omega, phi, kappa (degrees) of every image, flat."""
    enh, opk = network.block.frame.pose_to_grid(camera_poses(network, state))
    return np.hstack([enh, np.degrees(opk)]).ravel()


def test_exterior_orientations_have_the_sigma_of_all_unknowns_together(mounted):
    network, state = mounted.network, mounted.state
    still = np.zeros_like(state.x_m)
    J = numeric_jacobian(
        lambda dx: _in_grid(network, network.moved(state, dx, still)),
        np.zeros(network.n_columns),
        step=1e-3,  # coordinates of 7000 km are rounded to 1e-9 m
    )
    cov = propagate(J, mounted.solution.cov) * mounted.solution.sigma0_sq
    found = rows.exterior_orientations(mounted)
    assert list(found.columns) == list(folder.COLUMNS["exterior_orientation"][2:])
    assert tuple(found["image"]) == network.block.images.names
    values, sigma = found.iloc[:, 1:7].to_numpy(), found.iloc[:, 7:].to_numpy()
    assert_allclose(values.ravel(), _in_grid(network, state), rtol=1e-14)
    expected = sigmas(cov).reshape(-1, 6)
    assert_allclose(sigma[:, 2:], expected[:, 2:], rtol=1e-5)
    # sigma in plan are metres, of which the grid's scale makes a little less
    assert_allclose(sigma[:, :2], expected[:, :2], rtol=5e-4)
    # the mounting's part cannot be neglected: the bodies' attitudes alone are known worse
    bodies = network.layout.pose[:, 3:]
    alone = np.degrees(np.sqrt(np.diagonal(mounted.solution.cov)[bodies]))
    assert not np.allclose(np.sort(alone, axis=1), np.sort(sigma[:, 3:], axis=1), rtol=1e-2)
