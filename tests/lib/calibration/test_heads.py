"""Heads in the synthetic frame: recovery, Table 1's convention, and covariances carried over."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import adjust, free_orientation
from acx4lib.calibration import heads
from acx4lib.errors import AdjustmentError
from acx4lib.geometry import frames
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, exp, rotation_from_opk
from acx4lib.model import Model
from support import blocks
from support.helpers import numeric_jacobian

SYNTHETIC = replace(
    blocks.CAMERA,
    name="SYN",
    interior=Interior(f=50.0),
    T_b_c=Pose(R=rotation_from_opk(np.radians([0.5, -1.6, 2.0])), r=np.zeros(3)),
)
R_H_S_OPK = np.radians([[-6.0, 5.0, 91.0], [5.5, -4.0, -92.0]])  # omega, phi, kappa of eq. (6)
LEVERS = np.array([[0.10, -0.05, 0.02], [-0.20, 0.15, 0.08]])  # m, body axes


def head(k):
    """A head whose angles against the synthetic frame are eq. (6)'s: R_s_h = M(opk)^T."""
    return replace(
        blocks.CAMERA,
        name=f"CAM{k + 1}",
        interior=Interior(f=50.0, xp=0.05 * k, yp=-0.03),
        T_b_c=Pose(R=SYNTHETIC.T_b_c.R @ rotation_from_opk(R_H_S_OPK[k]), r=LEVERS[k]),
    )


def simulated(*, strips=((1000.0, -60.0, 0.0), (1300.0, 60.0, 180.0)), per_strip=3, ties=10):
    return blocks.simulate(
        blocks.fly(strips, per_strip=per_strip),
        cameras=(head(0), head(1)),
        control=blocks.crosses(),
        ties=blocks.terrain(ties),
    )


@pytest.fixture(scope="module")
def block():
    return simulated()


def adjusted(block, free=("xp", "yp")):
    """Self-calibrate every head, without looking for gross errors."""
    return {
        camera.name: adjust(
            free_orientation(heads.select_cameras(block, [camera.name]), Model(free=free))
        )
        for camera in block.cameras
    }


def oriented(fits):
    return heads.relative_orientation(heads.Heads(bundles=fits, failures={}), SYNTHETIC)


@pytest.fixture(scope="module")
def bundles(block):
    return adjusted(block)


# --- recovery --------------------------------------------------------------------------------


def test_angles_of_exact_heads_come_back(bundles):
    found = oriented(bundles)
    assert_allclose(found.opk, R_H_S_OPK, atol=1e-10)  # rad
    assert [camera.name for camera in found.heads] == ["CAM1", "CAM2"]
    assert found.n_exposures == 6


def test_places_of_exact_heads_are_their_distances_in_millimetres_of_the_first(bundles, block):
    """S times the distance between the lenses in the synthetic frame, s = f_1 over the height."""
    found = oriented(bundles)
    fit = bundles["CAM1"]
    s = []
    for image, pose in enumerate(fit.T_m_c.r):
        own = fit.network.image_points.image_idx == image
        ground = fit.state.x_m[fit.network.image_points.point_idx[own], 2].mean()
        s.append(50.0 / (pose[2] - ground))
    d = np.mean(s) * SYNTHETIC.T_b_c.R.T @ (LEVERS[1] - LEVERS[0])
    assert_allclose(found.xyz_mm[1] - found.xyz_mm[0], d, atol=1e-8)  # mm
    assert found.xyz_mm[0, 2] == 50.0  # f_1, by definition
    assert_allclose(found.xyz_mm[:, :2].mean(axis=0), 0.0, atol=1e-12)  # counted from all heads
    assert_allclose(found.sigma[0, 2], 0.0, atol=0)


def test_a_wrong_focal_length_goes_into_zc(block):
    """With f held at 50 mm, a head of 50.2 mm stands lower by 0.2 mm: Table 1's Zc arise so."""
    longer = replace(
        block, cameras=(head(0), replace(head(1), interior=Interior(f=50.2, yp=-0.03)))
    )
    exact = blocks.simulate(
        longer.trajectory.T_m_b,
        cameras=(
            replace(head(0), T_b_c=Pose(R=head(0).T_b_c.R, r=np.zeros(3))),
            replace(longer.cameras[1], T_b_c=Pose(R=head(1).T_b_c.R, r=np.zeros(3))),
        ),
        control=blocks.crosses(),
        ties=blocks.terrain(20, relief_m=5.0),
    )
    held = replace(exact, cameras=(head(0), replace(head(1), interior=Interior(f=50.0, yp=-0.03))))
    found = oriented(adjusted(held, free=()))
    # f held too short by 0.4 % puts the camera lower: Z_1 = Z (50.0 / 50.2), Zc less by 0.2 mm
    assert found.xyz_mm[1, 2] - found.xyz_mm[0, 2] == pytest.approx(-0.2, abs=0.02)


def test_heads_are_calibrated_one_by_one(block):
    found = heads.calibrate_heads(block, ["CAM2", "CAM1"], Model(free=("xp", "yp")))
    assert list(found.bundles) == ["CAM2", "CAM1"]
    assert found.failures == {}
    for name, fit in found.bundles.items():
        interior = fit.cameras[0].interior
        assert interior.xp == pytest.approx(0.05 if name == "CAM2" else 0.0, abs=1e-9)


def test_a_head_that_cannot_be_adjusted_is_named(block):
    points = block.image_points
    camera = block.images.camera_idx[points.image_idx]
    blind = replace(block, image_points=points[camera == 0])
    found = heads.calibrate_heads(blind, ["CAM1", "CAM2"], Model(free=("xp", "yp")))
    assert list(found.bundles) == ["CAM1"]
    assert "0 control points in images do not orient" in found.failures["CAM2"]


# --- which exposures -------------------------------------------------------------------------


def without_images(block, images):
    keep = ~np.isin(block.image_points.image_idx, images)
    return replace(block, image_points=block.image_points[keep])


def test_only_exposures_that_all_heads_have_are_averaged(block):
    some = without_images(block, [2, 7])  # CAM1 of exposure 1, CAM2 of exposure 3
    assert oriented(adjusted(some)).n_exposures == 4


def test_weak_interior_orientations_orient_nothing_unless_they_may(block, rng):
    heights = np.tile([0.03, 0.03, 20.0], (len(block.control), 1))  # of which f is a share
    control = replace(block.control, sigma_m=heights)
    noisy = blocks.noisy(replace(block, control=control), rng)
    weak = adjusted(noisy, free=("f", "xp", "yp"))
    with pytest.raises(AdjustmentError, match="the interior orientation of CAM1, CAM2 is not"):
        oriented(weak)
    fits = heads.Heads(bundles=weak, failures={})
    assert heads.relative_orientation(fits, SYNTHETIC, weak=True).n_exposures == 6


def test_heads_that_share_no_exposure_are_an_error(block):
    halves = without_images(block, [0, 2, 4, 7, 9, 11])
    with pytest.raises(AdjustmentError, match="share no exposure"):
        oriented(adjusted(halves))


# --- covariances -----------------------------------------------------------------------------


def values(found):
    """Xc, Yc, Zc, omega, phi, kappa head by head, then the interiors: `cov_joint`'s order."""
    outer = np.concatenate([np.column_stack([found.xyz_mm, found.opk]).ravel()])
    return np.concatenate([outer, *(camera.interior.to_array() for camera in found.heads)])


def certain(fit, cov):
    """A bundle with a covariance of its columns, on control without error, unit weight one."""
    control = fit.network.control
    network = replace(fit.network, control=replace(control, sigma_m=np.zeros_like(control.sigma_m)))
    inverse = replace(fit.solution.inverse, dense=cov)
    solution = replace(fit.solution, inverse=inverse, cost=float(fit.solution.redundancy))
    return replace(fit, network=network, solution=solution)


def without_trajectory_noise(fits):
    out = {}
    for name, fit in fits.items():
        block = fit.network.block
        none = np.zeros_like(block.trajectory.sigma_position)
        trajectory = replace(block.trajectory, sigma_position=none, sigma_attitude=none)
        network = replace(fit.network, block=replace(block, trajectory=trajectory))
        out[name] = replace(fit, network=network)
    return out


@pytest.mark.parametrize("free", [("xp", "yp"), ("f", "xp", "yp")])
@pytest.mark.parametrize("which", ["CAM1", "CAM2"])
def test_what_a_heads_bundle_has_wrong_is_carried_over(block, rng, which, free):
    """The covariance of one random error is its effect times itself: the Jacobian, numerically."""
    fits = without_trajectory_noise(adjusted(block, free))
    fit = fits[which]
    n = fit.network.n_columns
    size = np.array(
        [1e-3 if "rotation" not in name else 1e-6 for name in fit.network.column_names()]
    )
    u = size * rng.normal(size=n)
    zero = np.zeros((n, n))
    uncertain = {
        name: certain(other, np.outer(u, u) if name == which else zero)
        for name, other in fits.items()
    }

    def at(share):
        state = fit.network.moved(fit.state, share * u, np.zeros((fit.network.n_points, 3)))
        return values(oriented({**fits, which: replace(fit, state=state)}))

    effect = (at(1.0) - at(-1.0)) / 2
    found = oriented(uncertain).cov_joint
    largest = np.abs(effect).max()
    # errors of a millimetre over 1000 m: curvature is a millionth
    assert_allclose(found, np.outer(effect, effect), atol=1e-5 * largest**2)


def test_what_the_trajectory_has_wrong_is_carried_over(bundles):
    fits = {
        name: certain(fit, np.zeros((fit.network.n_columns,) * 2)) for name, fit in bundles.items()
    }
    trajectory = bundles["CAM1"].network.block.trajectory

    def at(steps):
        steps = steps.reshape(-1, 6)
        T = trajectory.T_m_b
        T = Pose(R=T.R @ exp(steps[:, 3:]), r=T.r + steps[:, :3])
        moved = {}
        for name, fit in fits.items():
            block = replace(fit.network.block, trajectory=replace(trajectory, T_m_b=T))
            moved[name] = replace(fit, network=replace(fit.network, block=block))
        return values(oriented(moved))

    J = numeric_jacobian(at, np.zeros(36), step=np.tile([1e-2] * 3 + [1e-5] * 3, 6))
    numeric = np.zeros((32, 32))
    for e, cov in enumerate(trajectory.cov):
        own = J[:, 6 * e : 6 * e + 6]
        numeric += own @ cov @ own.T
    found = oriented(fits)
    assert np.all(found.sigma[:, 3:] > 1e-6)  # attitude noise, averaged over six exposures
    scale = np.sqrt(np.diag(numeric)) + 1e-30
    difference = (found.cov_joint - numeric) / np.outer(scale, scale)
    assert np.abs(difference[numeric != 0]).max() < 1e-5


def test_heads_share_the_errors_of_their_control_points():
    """Every observation moved by a share of its sigma: control points move both heads at once.

    What is neglected: the mean height of the ground that a head sees, which scales millimetres.
    """
    block = simulated(strips=((1000.0, -60.0, 0.0), (1300.0, 60.0, 180.0)), per_strip=1, ties=0)
    sigma = np.tile([0.3, 0.3, 0.6], (9, 1))  # poor control, so that its share is the larger one
    block = replace(block, control=replace(block.control, sigma_m=sigma))

    def estimate(changed):
        return values(oriented(adjusted(changed, free=())))[:12]

    fits = {
        name: replace(fit, solution=replace(fit.solution, cost=float(fit.solution.redundancy)))
        for name, fit in adjusted(block, free=()).items()
    }
    found = oriented(fits)
    numeric = blocks.numeric_covariance(block, estimate, kinds=("image_point", "control_point"))
    calm = without_trajectory_noise(fits)
    cov = oriented(calm).cov
    scale = np.sqrt(np.diag(numeric))
    scale[2] = 1.0  # Zc of the first head has no error
    assert_allclose(cov / np.outer(scale, scale), numeric / np.outer(scale, scale), atol=0.01)
    # the heads' errors belong together through the control points, and not a little
    correlation = cov[6:, :6] / np.outer(scale[6:], scale[:6])
    assert np.abs(correlation).max() > 0.3
    assert np.all(np.diag(found.cov) >= np.diag(cov) - 1e-15)


def test_heads_as_declared_are_turned_against_the_frame_of_the_synthetic_image():
    body = frames.rotation_from_opk(np.radians([[1.0, -2.0, 90.0], [3.0, 0.5, 88.0]]))
    cameras = [
        Camera(
            name=name,
            width_px=100,
            height_px=80,
            pixel_mm=0.01,
            interior=Interior(f=f),
            T_b_c=Pose(R=R, r=np.zeros(3)),
        )
        for name, f, R in zip("AB", (5.0, 6.0), body, strict=True)
    ]
    found = heads.declared_orientation(cameras, cameras[0])
    R = rotation_from_opk(found.opk)
    assert_allclose(R, body[0].T @ body, atol=1e-12)
    assert_allclose(found.xyz_mm, [[0, 0, 5.0]] * 2)
    assert not found.cov_joint.any()


# --- What is read from a lens: distortion at border and corners


def test_border_distortion_is_the_papers_15_pixels(fits):
    r, px, sigma = heads.radial_profile(fits["CAM1"])
    assert r[-1] == pytest.approx(np.hypot(8984, 6732) / 2 * 0.006)
    assert px[-1] == pytest.approx(15.0, abs=1.0)  # "approximately 15 pixels"
    assert 0 < sigma[-1] < 0.3


def test_the_worst_corner_has_the_decentring_too(fits):
    camera = fits["CAM1"].cameras[0]
    radial = replace(camera, interior=Interior(f=74.0, k1=2.27e-6))
    assert heads.largest_at_corners(radial) == pytest.approx(14.45, abs=0.01)
    assert heads.largest_at_corners(camera) == pytest.approx(18.3, abs=0.5)
