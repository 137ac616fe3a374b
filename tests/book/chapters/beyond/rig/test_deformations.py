"""What errors of the heads do to the synthetic image."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.rig.deformations import deformation
from acx4lib.calibration import rig
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk
from support import blocks
from support.flights import rigs

SYNTHETIC = replace(
    blocks.CAMERA, name="SYN", width_px=3000, height_px=3000, interior=Interior(f=50.0)
)


def oriented(cov=None):
    """Two heads over the whole frame, without distortion, in the middle of the image."""
    return RelativeOrientation(
        heads=tuple(
            replace(blocks.CAMERA, name=f"CAM{k}", interior=Interior(f=50.0)) for k in (1, 2)
        ),
        xyz_mm=np.array([[0.0, 0.0, 50.0], [0.0, 0.0, 50.0]]),
        opk=np.zeros((2, 3)),
        cov_joint=np.zeros((30, 30)) if cov is None else cov,
        n_exposures=1,
    )


def shifted(orientation, k, by):
    xyz = orientation.xyz_mm.copy()
    xyz[k] += by
    return replace(orientation, xyz_mm=xyz)


def test_a_shifted_head_misfits_by_its_shift():
    """Half of it is taken up with the whole image, and the rest remains with opposite signs."""
    wrong = shifted(oriented(), 1, [0.010, -0.004, 0.0])
    found = deformation(wrong, SYNTHETIC, truth=oriented())
    assert_allclose(found.gap, np.tile([0.010, -0.004], (len(found.gap), 1)), atol=1e-12)
    inner = np.abs(found.xy).max(axis=1) < 10  # both heads see these nodes
    signs = np.where(found.head == 1, 0.5, -0.5)[:, None]
    assert_allclose(found.d[inner], (signs * [0.010, -0.004])[inner], atol=1e-9)
    assert found.gap_rms_mm == pytest.approx(np.hypot(0.010, 0.004), rel=1e-9)
    assert found.largest_mm == pytest.approx(np.hypot(0.010, 0.004) / 2, rel=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_of_all_heads_together_is_no_deformation(axis):
    angle = np.zeros(3)
    angle[axis] = 1e-4
    turn, right = rotation_from_opk(angle), oriented()
    poses = Pose(R=rotation_from_opk(right.opk), r=right.xyz_mm)
    # about the perspective centre of the synthetic image, where the heads are
    wrong = replace(right, opk=opk_from_rotation(turn @ poses.R))
    found = deformation(wrong, SYNTHETIC, truth=right)
    # second order: 1e-8 of the focal length, beside the 5e-3 mm that it moves the image
    assert found.largest_mm < 2e-6
    assert_allclose(found.gap, 0.0, atol=1e-12)


def test_a_longer_focal_length_of_all_heads_is_no_deformation():
    longer = replace(
        oriented(),
        heads=tuple(h.with_interior(Interior(f=50.1)) for h in oriented().heads),
        xyz_mm=np.array([[0.0, 0.0, 50.1], [0.0, 0.0, 50.1]]),
    )
    assert deformation(longer, SYNTHETIC, truth=oriented()).largest_mm < 1e-9


def test_the_predicted_deformation_is_the_effect_of_one_sigma():
    """A covariance of one random error: its effect is the standard deviation, node by node."""
    sigma = np.zeros(30)
    sigma[[1, 8, 9, 12, 21 + 1]] = [0.003, 0.002, 2e-5, 0.004, 0.001]
    found = deformation(oriented(np.outer(sigma, sigma)), SYNTHETIC)
    assert np.all(np.isnan(found.d))
    moved = shifted(shifted(oriented(), 0, [0, 0.003, 0]), 1, [0, 0, 0.002])
    opk = moved.opk.copy()
    opk[1, 0] += 2e-5
    one, two = (h.interior.to_array() for h in moved.heads)
    one[0] += 0.004  # cov_joint has the interiors after the places and angles of all heads
    two[1] += 0.001
    moved = replace(
        moved,
        opk=opk,
        heads=tuple(
            h.with_interior(Interior.from_array(i))
            for h, i in zip(moved.heads, (one, two), strict=True)
        ),
    )
    effect = deformation(moved, SYNTHETIC, truth=oriented())
    # the errors are 1e-4 of the image's size, and so is what a derivative leaves of them
    assert_allclose(found.sigma, np.hypot(*effect.d.T), rtol=2e-3, atol=1e-6)
    assert found.gap_sigma_mm == pytest.approx(effect.gap_rms_mm, rel=1e-3)


def as_they_are(camera, truth):
    told = truth["cameras"][camera.name]
    angles = [told[f"boresight_{angle}_deg"] for angle in ("omega", "phi", "kappa")]
    lens = {name: told[name] for name in ("k1", "k2", "k3", "p1", "p2")}
    return replace(
        camera,
        interior=Interior(f=told["f_mm"], xp=told["xp_mm"], yp=told["yp_mm"], **lens),
        T_b_c=Pose(
            R=rotation_from_opk(np.radians(angles)),
            r=np.array([told[f"lever_{axis}_m"] for axis in "xyz"]),
        ),
    )


@pytest.mark.slow
def test_misfits_and_deformations_are_as_large_as_predicted():
    """Some ten ways to deform an image matter, in ten flights: squares are known to 14 %."""
    squares = []
    for seed in rigs.SEEDS:
        one = rigs.flown(seed)
        synthetic = one.flight.cameras["SYN"]
        found = rig.calibrate(one.flight.heads, free=one.flight.estimate_heads)
        heads = tuple(as_they_are(c, one.truth) for c in found.calibration.cameras)
        exact = replace(found, calibration=replace(found.calibration, cameras=heads))
        error = deformation(
            rig.relative_orientation(found, synthetic),
            synthetic,
            truth=rig.relative_orientation(exact, synthetic),
        )
        squares.append(
            [np.sum(a) for a in (error.gap**2, error.gap_variance, error.d**2, error.variance)]
        )
    gap, gap_predicted, d, d_predicted = np.sum(squares, axis=0)
    assert gap / gap_predicted == pytest.approx(1.0, abs=0.42)  # three of their sigma
    assert d / d_predicted == pytest.approx(1.0, abs=0.42)
