"""The stored flight of four real heads: what is in it, and what it says beside everything."""

import numpy as np
import pandas as pd
import pytest

from acx4book.reference import four_heads
from acx4files.flight import reader
from acx4files.results.sentences import not_determined
from acx4lib.block import select_images
from acx4lib.calibration.mounting import single_step
from acx4lib.calibration.rig import relative_orientation
from acx4lib.georeferencing.validation import predict
from acx4lib.model import Model


@pytest.fixture(scope="module")
def flight():
    return reader.read(four_heads.FLIGHT)


@pytest.fixture(scope="module")
def block(flight):
    return four_heads.heads_of(flight)


@pytest.fixture(scope="module")
def rig(flight):
    return four_heads.rig(flight)


# --- What is stored


def test_it_is_small_and_of_all_heads_of_all_exposures(block):
    size = sum(path.stat().st_size for path in four_heads.FLIGHT.rglob("*") if path.is_file())
    assert size < 600_000
    assert len(block.images) == len(block.cameras) * len(block.trajectory)
    assert np.bincount(block.image_points.image_idx).min() > 30


def test_strips_are_cut_where_the_camera_paused():
    images, flown = (
        pd.read_csv(four_heads.FLIGHT / "heads" / f"{name}.csv", dtype={"exposure": str})
        for name in ("images", "trajectory")
    )
    strip = flown["exposure"].map(images.groupby("exposure")["strip"].first())
    assert (strip.diff()[1:] == (flown["time_s"].diff()[1:] > four_heads.APART_S)).all()
    assert images["image"].str.len().max() <= 8


# --- What it says


def test_the_thinned_flight_says_what_all_measurements_say(rig):
    every = pd.read_csv(four_heads.ALL).set_index(["camera", "parameter", "unit"])
    thin = rig.table().loc[every.index]
    off = (thin["value"] - every["value"]) / thin["sigma"]
    assert len(off) == 36
    assert np.sqrt(np.mean(off**2)) < 1
    assert off.abs().max() < 2
    assert (thin["sigma"] > 0.5 * every["sigma"]).all()  # both rest on the same exposures


@pytest.mark.parametrize("half", [1, pytest.param(0, marks=pytest.mark.repeats)])
def test_self_calibrated_heads_predict_pictures_that_the_factorys_do_not(flight, block, half):
    out = block.images.exposure_idx % 2 == half
    rest, held_out = select_images(block, ~out), select_images(block, out)
    found = {}
    for free in ((), ("f", *flight.estimate_heads)):
        calibration = single_step(rest, Model(free=free, fix=("lever_arm",))).calibration
        found[free] = predict(held_out, calibration, method="rig")
    factory, own = found.values()
    assert own.chi_square_p > 0.01
    assert own.effective < 0.1 * own.bundle.solution.redundancy  # pictures share errors
    assert factory.chi_square_p < 1e-6
    assert own.rays_rms_px < 0.9 * factory.rays_rms_px


def test_what_the_heads_have_in_common_may_be_open_if_their_differences_are_not(flight, block):
    free = ("f", *flight.estimate_heads)
    levers = single_step(block, Model(free=free, gnss=("deviation",)))
    (open_,) = not_determined(levers.calibration)
    assert open_.startswith("lever_z_m of 1 Green, 2 Red, 3 Red edge, 4 NIR is not determined")
    oriented = relative_orientation(levers, flight.synthetic_camera)
    assert np.all(np.abs(oriented.xyz_mm[:, :2]) < 0.02)


# --- Figures


def test_the_bands_fit_once_the_heads_are_turned():
    """Red and green of a car park have the same edges."""
    apart = []
    for ax in four_heads.registers().axes:
        _, red, green = np.moveaxis(np.asarray(ax.images[0].get_array()), -1, 0)
        apart.append(np.corrcoef(red.ravel(), green.ravel())[0, 1])
    assert apart[0] < 0.7
    assert apart[0] + 0.1 < apart[1] < apart[2]
