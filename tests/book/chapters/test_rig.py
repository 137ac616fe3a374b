"""The heads of a simulated flight as a rig, the truth beside them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4book.chapters import rig
from acx4book.chapters.rig import (
    deformation,
    median_gains,
)
from acx4book.notebooks.truth import beside_truth, beside_truths
from acx4files import flight as flights
from acx4files.stages import rig as stages_rig
from acx4lib.calibration import heads
from acx4lib.calibration import rig as calibration_rig
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.design import unshared
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk
from acx4lib.model import Model
from acx4lib.tie_points.ties import refine_by_mean_differences, shared_points
from acx4sim import optics
from support import blocks
from support.flights import in_heads


@pytest.fixture(scope="session")
def flight(tmp_path_factory):
    """The heads of a simulated flight, its truth beside it."""
    path = tmp_path_factory.mktemp("rig") / "flight"
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 60})
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=3, options=options), path)
    return flights.read(path)


@pytest.fixture(scope="session")
def stage(flight):
    return stages_rig.calibrate(flight)


# --- Figures of the heads together beside the heads one by one


@pytest.fixture(scope="module")
def ways():
    """The orientations of two heads, by each way to find them."""
    block = blocks.noisy(in_heads.simulated(ties=60), np.random.default_rng(8))
    names = [camera.name for camera in block.cameras]
    held, with_f = (
        heads.relative_orientation(
            heads.calibrate_heads(block, names, Model(free=free)), in_heads.SYNTHETIC, weak=True
        )
        for free in (in_heads.FREE, ("f", *in_heads.FREE))
    )
    rigid, apart = (
        calibration_rig.relative_orientation(
            calibration_rig.calibrate(one, Model(free=in_heads.FREE)), in_heads.SYNTHETIC, weak=True
        )
        for one in (block, unshared(block))
    )
    refined = refine_by_mean_differences(held, shared_points(block, held))
    return SimpleNamespace(
        held=held, refined=refined, with_f=with_f, apart=apart, rigid=rigid, block=block
    )


def test_more_knowledge_makes_smaller_sigmas(ways):
    """The rig has all observations of the heads one by one, and the trajectory besides."""
    for before in (ways.with_f, ways.apart):
        assert np.all(before.sigma > ways.rigid.sigma)
        assert min(median_gains(before, ways.rigid).values()) > 1


# --- What errors of the heads do to the synthetic image


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
        cov_joint=np.zeros((32, 32)) if cov is None else cov,
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
    sigma = np.zeros(32)
    sigma[[1, 8, 9, 12, 22 + 1]] = [0.003, 0.002, 2e-5, 0.004, 0.001]
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


@pytest.mark.repeats
@pytest.mark.slow
def test_misfits_and_deformations_are_as_large_as_predicted():
    """Some ten ways to deform an image matter, in ten flights: squares are known to 14 %."""
    squares = []
    for seed in in_heads.SEEDS:
        one = in_heads.flown(seed)
        synthetic = one.flight.cameras["SYN"]
        found = calibration_rig.calibrate(one.flight.heads, Model(free=one.flight.estimate_heads))
        heads = tuple(as_they_are(c, one.truth) for c in found.calibration.cameras)
        exact = replace(found, calibration=replace(found.calibration, cameras=heads))
        error = deformation(
            calibration_rig.relative_orientation(found, synthetic),
            synthetic,
            truth=calibration_rig.relative_orientation(exact, synthetic),
        )
        squares.append(
            [np.sum(a) for a in (error.gap**2, error.gap_variance, error.d**2, error.variance)]
        )
    gap, gap_predicted, d, d_predicted = np.sum(squares, axis=0)
    assert gap / gap_predicted == pytest.approx(1.0, abs=0.42)  # three of their sigma
    assert d / d_predicted == pytest.approx(1.0, abs=0.42)


# --- What a simulated flight knows of its heads


def test_estimates_lie_within_four_standard_deviations_of_the_truth_beside_them(flight, stage):
    table = stage.table()
    beside = beside_truth(flight, table)
    assert beside["error (σ)"].notna().sum() == 48
    assert beside["error (σ)"].abs().max() < 4
    known = optics.HEADS["CAM2"]
    for parameter, unit, told in (("f", "mm", known.f_mm), ("lever z", "m", known.lever_m[2])):
        at = ("CAM2", parameter, unit)
        error = (table.loc[at, "value"] - told) / table.loc[at, "sigma"]
        assert beside.loc[at, "error (σ)"] == pytest.approx(error)
        assert float(beside.loc[at, "truth"].replace("−", "-")) == pytest.approx(told, abs=6e-5)


def test_a_flight_that_was_not_simulated_has_no_truth(flight, stage, tmp_path):
    measured = replace(flight, pictures=tmp_path)
    assert rig.true_orientation(measured, stage) is None
    assert beside_truth(measured, stage.table()).shape == (48, 0)
    assert beside_truths(measured, {"rig": stage.table()}).shape == (48, 0)
