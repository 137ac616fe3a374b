"""Tables of an adjusted bundle, against what follows from its unknowns one by one."""

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.bundle import uses
from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.network import camera_poses
from acx4lib.bundle.rejections import Rejection
from acx4lib.calibration import estimates
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.results import folder, rows
from support import blocks
from support.helpers import numeric_jacobian


def test_distances_have_rows_of_their_own_kind(noisy_block):
    block = blocks.taped(noisy_block, [[11, 20], [3, 42]], sigma=0.1, off=[0.05, -0.02])
    bundle = adjust(uses.mounted_orientation(block, free=("f",)))
    calibration = estimates.from_bundle(bundle)
    table = rows.bundle_tables("mounting", "single_step", bundle, calibration)["residuals"]
    found = table[table["kind"] == "distance"]
    group = bundle.solution.group("distance")
    assert found["point"].tolist() == ["P11", "P3"]
    assert found["image_or_exposure"].tolist() == ["P20", "P42"]
    assert set(found["component"]) == {"distance_m"}
    for column in ("v", "sigma", "redundancy", "w"):
        assert_allclose(found[column], getattr(group, column).ravel())
    out = Rejection(kind="distance", row=1, component=-1, statistic=7.0)
    (row,) = rows.rejected_table(
        "mounting", "single_step", block, [out], pose_names=block.trajectory.exposures
    ).to_dict("records")
    assert (row["point"], row["image_or_exposure"]) == ("P3", "P42")
    assert row["reason"] == "distance: w = 7.0 exceeds 3.9"


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
