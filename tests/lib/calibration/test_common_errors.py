"""Errors common to the points of a picture: turns of pictures, and larger sigma by a jackknife."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4files.results import sentences
from acx4lib.block import NO_POINTS
from acx4lib.bundle.adjust import mounted_orientation
from acx4lib.calibration import rig
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import single_step
from acx4lib.geometry.camera import colrow_from_xy, correct, distort, mountings, xy_from_colrow
from acx4lib.geometry.frames import exp, log, rotation_from_opk
from acx4lib.least_squares.covariance import sigmas
from acx4lib.model import Model
from support import blocks
from support.flights.in_heads import SYNTHETIC, simulated
from support.helpers import numeric_jacobian

SIGMA = np.radians([0.02, 0.03, 0.04])
FREE = ("xp", "yp", "k1")


def free_of_control(seed=5):
    exact = simulated(3, ties=150)
    return replace(blocks.noisy(exact, np.random.default_rng(seed)), control=NO_POINTS)


@pytest.fixture(scope="module")
def rigid():
    return free_of_control()


@pytest.fixture(scope="module")
def turned(rigid):
    """Return the block with pictures that turn about the body's axes."""
    rng, R_b_c = np.random.default_rng(2), mountings(rigid.cameras).R[rigid.images.camera_idx]
    turns = np.swapaxes(R_b_c, 1, 2) @ exp(SIGMA * rng.normal(size=(len(R_b_c), 3))) @ R_b_c
    colrow = rigid.image_points.colrow.copy()
    camera_of = rigid.images.camera_idx[rigid.image_points.image_idx]
    for k, camera in enumerate(rigid.cameras):
        own = np.flatnonzero(camera_of == k)
        xy = correct(camera.interior, xy_from_colrow(camera, colrow[own]))
        ray = np.column_stack([xy, np.full(len(own), -camera.interior.f)])
        ray = np.einsum("nji,nj->ni", turns[rigid.image_points.image_idx[own]], ray)
        ideal = -camera.interior.f * ray[:, :2] / ray[:, 2:]
        colrow[own] = colrow_from_xy(camera, distort(camera.interior, ideal))
    return replace(rigid, image_points=replace(rigid.image_points, colrow=colrow))


@pytest.fixture(scope="module")
def found(turned):
    return single_step(turned, Model(free=FREE, fix=("lever_arm",)))


def test_pictures_that_share_a_pose_are_not_turned(rigid):
    found = single_step(rigid, Model(free=FREE, fix=("lever_arm",)))
    assert found.calibration.turns is None
    assert len(found.bundle.state.T_m_b) == len(rigid.trajectory)
    assert sentences.turned(found.calibration.turns) == ""


def test_turns_are_found_with_their_size(found):
    assert_allclose(found.calibration.turns, SIGMA, rtol=0.4)
    assert 0.8 < found.bundle.solution.sigma0_sq < 1.25
    assert len(found.bundle.rejected) < 0.01 * len(found.bundle.network.block.image_points)
    about = f"{np.degrees(found.calibration.turns[2]):.4f}° about the body's axes"
    assert about in sentences.turned(found.calibration.turns)


def test_heads_are_oriented_as_well_as_their_sigma_say(found, rigid):
    cov = found.calibration.cov
    columns, true = found.calibration.layout.mount[:, 3:], rigid.cameras
    turn = [
        one.T_b_c.R @ log(there.T_b_c.R.T @ one.T_b_c.R)
        for one, there in zip(found.calibration.cameras, true, strict=True)
    ]
    J = np.zeros((3, len(cov)))
    J[:, columns[1]] = found.calibration.cameras[1].T_b_c.R
    J[:, columns[0]] = -found.calibration.cameras[0].T_b_c.R
    off, of = turn[1] - turn[0], J @ cov @ J.T
    assert off @ np.linalg.solve(of, off) < 16.3  # chi-square of 3, exceeded by 0.1 %
    n = len(rigid.trajectory)
    assert_allclose(np.sqrt(of.diagonal()), np.sqrt(2 / n) * SIGMA, rtol=0.7)


def test_the_first_head_may_look_as_it_is_declared(found):
    by_imu = rig.relative_orientation(found, SYNTHETIC)
    declared = rig.relative_orientation(found, SYNTHETIC, as_declared=True)
    first = slice(3, 6)
    assert np.all(declared.cov[first, first] == 0)
    R, R_imu = rotation_from_opk(declared.opk), rotation_from_opk(by_imu.opk)
    assert_allclose(R[0].T @ R, R_imu[0].T @ R_imu, atol=1e-12)
    first_head = found.bundle.network.block.cameras[0]
    assert_allclose(SYNTHETIC.T_b_c.R @ R[0], first_head.T_b_c.R, atol=1e-12)
    assert_allclose(declared.turns**2 @ np.ones(3), found.calibration.turns**2 @ np.ones(3))


def test_derivatives_of_places_and_turns_are_those_of_their_residuals(rigid):
    few = replace(rigid, image_points=rigid.image_points[rigid.image_points.point_idx < 12])
    network = mounted_orientation(few, Model(fix=("lever_arm", "boresight")), turns=SIGMA)
    wide = np.random.default_rng(0).normal(size=network.n_columns) * 0.01
    still = np.zeros_like(network.start.x_m)
    start = network.moved(network.start, wide, still)

    def equations(step):
        state = network.moved(start, step, still)
        return [e for e in network.besides_rays(state) if e.kind in ("place", "turn")]

    at = np.zeros(network.n_columns)
    for k, one in enumerate(equations(at)):
        J = np.zeros((*one.v.shape, network.n_columns))
        for i, columns in enumerate(one.columns):
            J[i][:, columns] = one.A[i]
        numeric = numeric_jacobian(lambda step, k=k: equations(step)[k].v.ravel(), at)
        assert_allclose(J.reshape(len(numeric), -1), numeric, atol=1e-6)


def test_a_row_of_the_trajectory_that_is_wrong_stays_rejected(turned):
    attitudes = turned.trajectory.T_m_b
    R = attitudes.R.copy()
    R[4] = R[4] @ exp(np.array([0.0, 0.0, 0.05]))
    wrong = replace(turned, trajectory=replace(turned.trajectory, T_m_b=replace(attitudes, R=R)))
    found = single_step(wrong, Model(free=FREE, fix=("lever_arm",)))
    assert found.calibration.turns is not None
    rows = {(one.kind, one.row) for one in found.bundle.rejected if one.kind != "image_point"}
    assert ("attitude", 4) in rows
    assert not np.isfinite(found.bundle.network.observed.sigma_attitude[12:15]).any()


# --- jackknife over exposures ----------------------------------------------------------------


JACKKNIFE_FREE = ("k1", "p1", "p2")


@pytest.fixture(scope="module")
def block():
    return replace(blocks.balanced(), control=NO_POINTS)


def breathing(block):
    """Return the block with a lens whose distortion is another one at every exposure."""
    points, (camera,) = block.image_points, block.cameras
    half = np.array([camera.width_px, camera.height_px]) / 2
    r = (points.colrow - half) / half[0]
    size = 2 * points.sigma_px.mean() * np.random.default_rng(0).normal(size=len(block.trajectory))
    moved = size[block.images.exposure_idx[points.image_idx], None] * r**3
    return replace(block, image_points=replace(points, colrow=points.colrow + moved))


def test_independent_errors_leave_sigma_as_they_are(block):
    found = single_step(block, Model(free=JACKKNIFE_FREE), snooping=False)
    assert found.calibration.enlarged == (1.0, 1.0)
    assert np.array_equal(found.calibration.cov, from_bundle(found.bundle).cov)


def test_errors_that_points_share_enlarge_sigma_of_the_lens_and_no_others(block):
    found = single_step(breathing(block), Model(free=JACKKNIFE_FREE), snooping=False)
    lens, between = found.calibration.enlarged
    assert (lens > 1.5, between) == (True, 1.0)
    ratio = sigmas(found.calibration.cov) / sigmas(from_bundle(found.bundle).cov)
    assert ratio[0] == pytest.approx(lens, rel=0.1)  # k1, which the mounting does not know of
    assert np.allclose(ratio[3:], 1.0)
    assert f"{lens:.1f} (interior orientations):" in sentences.enlarged(found.calibration)
