"""What errors of the heads do to the synthetic image, and the heads oriented in every way."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.rig import one_by_one
from acx4book.chapters.rig.deformations import deformation
from acx4book.chapters.rig.one_by_one import (
    ONE_BY_ONE,
    REFINED,
    RIG,
    UNSHARED,
    WITH_F,
    gains,
    unshared,
)
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


# --- every way to orient heads ---------------------------------------------------------------


@pytest.fixture(scope="module")
def block():
    return blocks.noisy(rigs.simulated(ties=60), np.random.default_rng(8))


@pytest.fixture(scope="module")
def ways(block):
    together = rig.calibrate(block, free=rigs.FREE)
    return one_by_one.oriented(block, together, rigs.SYNTHETIC, free=rigs.FREE)


def test_heads_are_oriented_in_every_way(ways):
    assert list(ways) == [ONE_BY_ONE, REFINED, WITH_F, UNSHARED, RIG]
    f = {title: [head.interior.f for head in one.heads] for title, one in ways.items()}
    assert f[ONE_BY_ONE] == f[REFINED] == [50.0, 50.1]  # held at the declared values
    assert all(0 < abs(f[title][0] - 50.0) < 0.1 for title in (WITH_F, UNSHARED, RIG))


def test_more_knowledge_makes_smaller_sigmas(ways):
    """The rig has all observations of the heads one by one, and the trajectory besides."""
    assert np.all(gains(ways[WITH_F], ways[RIG]) > 1)
    assert np.all(gains(ways[UNSHARED], ways[RIG]) > 1)
    assert np.isnan(gains(ways[ONE_BY_ONE], ways[RIG])[0, 2])  # Zc of the first head is held


def test_heads_that_cannot_be_adjusted_alone_still_make_a_rig(block):
    """One head sees no control point: alone it has no datum, on the rig it needs none."""
    points = block.image_points
    blind = (block.images.camera_idx[points.image_idx] == 1) & np.isin(
        points.point_idx, block.control.point_idx
    )
    some = replace(block, image_points=points[~blind])
    together = rig.calibrate(some, free=rigs.FREE)
    found = one_by_one.oriented(some, together, rigs.SYNTHETIC, free=rigs.FREE)
    assert ONE_BY_ONE not in found
    assert RIG in found


def test_heads_without_shared_points_keep_every_measurement(block):
    alone = unshared(block)
    points, before = alone.image_points, block.image_points
    assert_allclose(points.colrow, before.colrow)
    assert len(set(alone.points)) == len(alone.points)
    head = alone.images.camera_idx[points.image_idx]
    ties = ~np.isin(points.point_idx, block.control.point_idx)
    for point in np.unique(points.point_idx[ties]):
        assert len(set(head[points.point_idx == point])) == 1
    said = [alone.points[i].partition(" ")[0] for i in points.point_idx]
    assert said == [block.points[i] for i in before.point_idx]
    assert np.all(points.point_idx[~ties] == before.point_idx[~ties])


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
