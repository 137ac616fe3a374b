"""The stage of the synthetic image: heads refined by tie points, or left as they are."""

import shutil
from dataclasses import replace

import pytest

from acx4lib.errors import FlightError
from acx4lib.results import folder as results
from acx4lib.stages import synthetic
from support.flights.simulated import HEADS


@pytest.fixture(scope="module")
def refined(flight, folder, tmp_path_factory):
    copy = shutil.copytree(folder, tmp_path_factory.mktemp("refined") / "results")
    return synthetic.run(flight, copy), copy


@pytest.fixture(scope="module")
def refinement(refined):
    return refined[0].refinement


def test_results_of_the_heads_are_asked_for(flight, tmp_path):
    with pytest.raises(FlightError, match="no results of stage heads; run first"):
        synthetic.read_heads(flight, tmp_path)


def test_the_refined_heads_are_written(refinement, refined):
    found = results.read(refined[1])
    assert results.cameras(found, "synthetic/refined") == HEADS
    said = found.summary["synthetic/refined"]
    assert said["n_unknowns"] == 9
    assert said["n_observations"] == 2 * (len(refinement.ties) - said["n_rejected"])
    assert 0.3 < said["sigma0_squared"] < 3
    (note,) = said["notes"]
    assert "beyond the noise of tie points" in note  # parallax of two flying heights


def test_weights_that_did_not_settle_are_a_note(refinement):
    fit = replace(refinement.fits["rotations"], settled=False)
    (record,) = synthetic.records(replace(refinement, fits={"rotations": fit}))
    (note,) = record.summary["synthetic/refined"]["notes"]
    assert note.startswith("synthetic/refined: the weights of tie points did not settle")


def test_without_tie_points_the_refinement_is_left_out(flight, folder, tmp_path):
    block = flight.blocks["heads"]
    rows = block.images.camera_idx[block.image_points.image_idx] == 0
    alone = replace(block, image_points=block.image_points[rows])
    bare = replace(flight, blocks={"heads": alone})
    copy = shutil.copytree(folder, tmp_path / "results")
    stage = synthetic.run(bare, copy)
    entry = results.read(copy).summary["synthetic/refined"]
    (reason,) = results.messages(entry, "left_out")
    assert reason.startswith("synthetic/refined: ")
    assert list(stage.refinement.orientations) == ["before"]
