"""The heads that are simulated give Table 1, and the synthetic images made of them Table 3's f."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.paper import printed
from acx4files.stages.synthetic import refine
from acx4lib.block import Block
from acx4lib.calibration import mounting
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.model import Model
from acx4lib.synthetic_image.rendering import render_into, render_plan
from acx4lib.synthetic_image.transferred_points import TransferredPoints, transfer
from acx4sim.designs import acx4_plan
from acx4sim.pictures import Tiles, landscape, picture, station
from benchmarks import find_head_truth
from support.flights import simulated
from support.flights.simulated import HEADS
from support.pictures.measured import cut_out, middle_of_disc


@pytest.fixture(scope="module")
def exact():
    return find_head_truth.exact_chain()


@pytest.fixture(scope="module")
def noisy():
    blocks = ("heads", "calibration")
    return find_head_truth.chain(simulated.fly("acx4", seed=1, blocks=blocks).flight)


def half_a_unit(value, digits):
    """Return half a unit of the last of some significant digits."""
    return 0.5 * 10.0 ** (np.floor(np.log10(abs(value))) + 1 - digits)


@pytest.mark.parametrize("head", HEADS)
def test_exact_heads_round_to_what_table_1_prints(exact, head):
    missing = find_head_truth.missing_to_table_1(exact.orientation)[head]
    lens = [half_a_unit(printed.value(1, name, head), 3) for name in ("k1", "p1", "p2")]
    allowed = [0.5e-4, 0.5e-4, *lens, 0.5e-3, 0.5e-6, 0.5e-6, 0.5e-6]
    assert np.all(np.abs(missing) < allowed)


def test_exact_images_of_the_heads_have_the_focal_length_of_table_3(exact):
    found = exact.single_step.calibration.cameras[0].interior.f
    assert abs(found - printed.value(3, "f_mm", "single_step")) < 0.0005


def test_the_heads_give_table_1_in_the_ideal_design_as_well():
    """A frame turned by 0.05 degrees changes what a wrong f does, by less than a tenth of sigma."""
    flight = simulated.fly("acx4-ideal", seed=1, blocks=("heads",), exact=True).flight
    found = find_head_truth.calibrated_heads(flight)
    for missing in find_head_truth.missing_to_table_1(found).values():
        assert np.all(np.abs(missing) < [2e-4, 2e-4, 1e-9, 5e-9, 5e-9, 1e-4, 1e-4, 1e-4, 1e-4])


def test_steps_at_the_seams_are_model_errors_and_the_test_says_so(exact, noisy):
    """Without noise some hundredths of the variance are left; with it, chi-square sees them.

    The heads stand 16 cm apart and look outward. They are oriented from 1600 m and more; from
    1000 m, what they see jumps by a pixel at a seam. The ideal camera has no seams.
    """
    assert 0.03 < exact.single_step.bundle.solution.sigma0_sq < 0.1
    assert noisy.single_step.bundle.solution.chi_square_p < 1e-6
    flight = simulated.fly("acx4-ideal", seed=1).flight
    ideal = mounting.single_step(flight.calibration, Model(free=flight.estimate_mounting))
    assert ideal.bundle.solution.chi_square_p > 0.01


# --- pixels ----------------------------------------------------------------------------------

EXPOSURE = "C2-05"
HALF = 16  # px; half of what is photographed around a target


@dataclass(frozen=True, kw_only=True)
class Targets:
    """Targets of one exposure, as the heads measured them, transferred, and photographed.

    Attributes
    ----------
    orientation : RelativeOrientation
    colrow : ndarray, shape (n, 2)
        Carried.
    pictures : list of ndarray
        Of the heads; dark but around the targets.
    """

    orientation: RelativeOrientation
    colrow: np.ndarray
    pictures: list[np.ndarray]


@pytest.fixture(scope="module")
def targets():
    flight = simulated.fly("acx4", seed=1, blocks=("heads", "calibration"), exact=True).flight
    orientation = refine(flight, find_head_truth.calibrated_heads(flight), None).orientation
    transferred = transfer(flight.calibration, orientation, flight.cameras["SYN"])
    rows = _of_the_exposure(flight.calibration, transferred)
    return Targets(
        orientation=orientation,
        colrow=transferred.colrow[rows],
        pictures=_photographed(flight.calibration),
    )


def _of_the_exposure(block: Block, transferred: TransferredPoints):
    here = transferred.exposure_idx == block.trajectory.exposures.index(EXPOSURE)
    return here & np.array([block.points[i].startswith("P") for i in transferred.point_idx])


def _photographed(block: Block):
    plan = acx4_plan()
    at = station(plan, f"calibration/{EXPOSURE}")
    ground = Tiles(ground=landscape(at))
    pictures = []
    for head in HEADS:
        camera = plan.cameras[head]
        whole = np.zeros((camera.height_px, camera.width_px, 1), np.uint16)
        own = block.image_points.image_idx == block.images.names.index(f"{EXPOSURE}_{head}")
        for row in np.flatnonzero(own):
            if block.points[block.image_points.point_idx[row]].startswith("P"):
                left, top = block.image_points.colrow[row].astype(int) - HALF
                size = 2 * HALF + 1
                part = picture(at, cut_out(camera, left, top, size, size), ground)
                whole[top : top + size, left : left + size] = part[..., 1:2]
        pictures.append(whole)
    return pictures


@pytest.mark.slow
def test_targets_measured_in_the_rendered_image_are_where_they_were_carried(targets):
    """Centroids of discs of 8 px in pictures, transferred measurements from image_points.csv.

    Bilinear interpolation blurs a disc by up to half a pixel, differently at its two edges.
    """
    synthetic = simulated.fly("acx4", seed=1, blocks=("heads",)).flight.cameras["SYN"]
    plan = render_plan(targets.orientation, synthetic, feather_px=0.0)
    assert len(targets.colrow) >= 6
    for at in targets.colrow:
        left, top = at.astype(int) - 12
        rows = np.empty((25, plan.width_px, 1), np.uint16)
        render_into(rows, plan, targets.pictures, top)
        found = middle_of_disc(rows[:, left : left + 25, 0], at - [left, top], 7.0)
        assert_allclose(found, at - [left, top], atol=0.03)
