"""A stage cell by cell, as its notebook goes through it, is the stage as a run computes it."""

import pytest

import acx4sim
from acx4files import flight as flights
from acx4files.stages import attempt, heads, mounting, rig, synthetic, validation
from acx4lib.calibration.heads import calibrate_heads, relative_orientation
from acx4lib.calibration.mounting import (
    single_step,
    together,
    two_step,
    two_step_gnss,
    weighted,
)
from acx4lib.calibration.rig import calibrate as calibrate_rig
from acx4lib.georeferencing.validation import validate
from acx4lib.model import Model
from acx4lib.synthetic_image.transferred_points import transfer
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.ties import refine_by_mean_differences, shared_points
from support.flights import in_heads


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    path = tmp_path_factory.mktemp("in_heads") / "flight"
    acx4sim.write(in_heads.small(), path)
    return flights.read(path)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)
    return flights.read(path)


def run(flight, results):
    for stage in (
        (heads, synthetic, mounting, rig, validation)
        if flight.heads
        else (
            mounting,
            validation,
        )
    ):
        stage.run(flight, results)


def heads_by_hand(flight, results):
    fits = calibrate_heads(flight.heads, flight.head_names, Model(free=flight.estimate_heads))
    heads.write(flight, results, fits, attempt(relative_orientation, fits, flight.synthetic_camera))


def synthetic_by_hand(flight, results):
    oriented = synthetic.read_heads(flight, results)
    ties = shared_points(flight.heads, oriented)
    turned = attempt(refine_by_rotations, oriented, ties)
    six = attempt(refine_by_rotations, oriented, ties, free="six")
    shifted = refine_by_mean_differences(oriented, synthetic.kept(ties, turned))
    ways = {"rotations": turned, "six": six}
    refinement = synthetic.gathered(oriented, ties, ways, shifted)
    camera, refined = flight.synthetic_camera, refinement.orientation
    transferred = {
        name: transfer(flight.block(name), refined, camera) for name in flight.transferred
    }
    synthetic.write(flight, results, refinement, transferred)


def mounting_by_hand(flight, results):
    free, fix, gnss = flight.estimate_mounting, flight.fix, flight.gnss
    block = mounting.measured(flight, results)
    block, factors = weighted(block, Model(free=free, fix=fix, gnss=gnss), weights=flight.weights)
    single = attempt(single_step, block, Model(free=free, fix=fix, gnss=gnss))
    two = attempt(two_step, block, Model(free=free, fix=fix), after=single)
    with_gnss = attempt(two_step_gnss, block, Model(free=free, fix=fix), after=single)
    found = [mounting.with_heads(flight, results, one) for one in (single, two, with_gnss)]
    methods = together(found)
    mounting.write(flight, results, methods, factors)


def rigs_by_hand(flight, results):
    rigs = {}
    for method in ("rig", "rig_calibration"):
        block = rig.measured(flight, method)
        rigs[method] = attempt(calibrate_rig, block, Model(free=flight.estimate_heads))
    rig.write(flight, results, rigs)


def validation_by_hand(flight, results):
    block, methods, rigs, _ = validation.read(flight, results)
    found = {name: validate(block, one, method=name) for name, one in methods.items()}
    in_heads = {name: validate(flight.validation, one, method=name) for name, one in rigs.items()}
    validation.write(flight, results, {**found, **in_heads}, {**methods, **rigs})


def written(path):
    return {file.name: file.read_bytes() for file in sorted(path.rglob("*")) if file.is_file()}


@pytest.mark.repeats  # `book/notebooks/test_functions` has heads, whose notebooks call the same
def test_open_calls_leave_the_bytes_of_a_run_of_a_flight_of_heads(flown, tmp_path):
    assert (flown.refraction, flown.weights) == ("none", "given")
    run(flown, tmp_path / "run")
    for stage in (
        heads_by_hand,
        synthetic_by_hand,
        mounting_by_hand,
        rigs_by_hand,
        validation_by_hand,
    ):
        stage(flown, tmp_path / "by_hand")
    assert written(tmp_path / "by_hand") == written(tmp_path / "run")


def test_open_calls_leave_the_bytes_of_a_run_of_a_single_head(alone, tmp_path):
    run(alone, tmp_path / "run")
    for stage in (mounting_by_hand, validation_by_hand):
        stage(alone, tmp_path / "by_hand")
    assert written(tmp_path / "by_hand") == written(tmp_path / "run")
