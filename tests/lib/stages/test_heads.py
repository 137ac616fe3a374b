"""The stage of the heads: what it leaves, also where heads fail."""

import json
from dataclasses import replace

import numpy as np
import pytest

from acx4book.paper import errata
from acx4lib.calibration.heads import Heads, relative_orientation
from acx4lib.errors import AdjustmentError
from acx4lib.results import adjustments
from acx4lib.results import folder as results
from acx4lib.stages import attempt, heads, order, synthetic
from support.flights.simulated import HEADS


def oriented(flight, fits):
    return heads.gathered(fits, attempt(relative_orientation, fits, flight.synthetic_camera))


def without_control(block):
    nothing = np.zeros(len(block.control), dtype=bool)
    return replace(block, control=block.control[nothing])


def test_the_stage_leaves_every_head_its_orientation_and_its_correlations(folder):
    found = results.read(folder)
    keys = {f"heads/bundle/{name}" for name in HEADS} | {"heads/relative_orientation"}
    assert set(found.summary) == keys
    assert results.cameras(found, "heads/relative_orientation") == HEADS
    run = errata.read_run(folder)
    largest = run.correlations
    assert {name.split()[0] for name in largest} == set(HEADS)
    assert all(0.1 < value <= 1 for value in largest.values())
    assert "Cannot be the maximum" in errata.audit(run)[10].verdict


def test_a_head_that_fails_leaves_the_orientation_out(flight, stage, tmp_path):
    kept = {name: fit for name, fit in stage.heads.bundles.items() if name != "CAM2"}
    failed = oriented(flight, Heads(bundles=kept, failures={"CAM2": "too few"}))
    adjustments.write(tmp_path, "heads", heads.records(failed))
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["heads/bundle/CAM2"]["not_determined"] == ["heads/bundle/CAM2: too few"]
    assert summary["heads/bundle/CAM1"]["converged"] is True
    (reason,) = summary["heads/relative_orientation"]["left_out"]
    assert reason == "heads/relative_orientation: CAM2 could not be adjusted"
    with pytest.raises(AdjustmentError, match="CAM2 could not be adjusted"):
        synthetic.read_heads(flight, tmp_path)


def test_heads_without_control_points_are_told_so(flight):
    block = without_control(flight.heads)
    said = heads.calibrate(replace(flight, blocks={"heads": block})).heads
    assert set(said.failures) == set(HEADS)
    assert said.failures["CAM1"].startswith("0 control points in images do not orient the block")


@pytest.mark.parametrize("n", [0, 1, 2])
def test_heads_whose_block_has_tie_points_alone_are_taken_as_declared(flight, tmp_path, n):
    """So a flight that `acx4 measure` found tie points for goes on as it did before."""
    control = flight.heads.control
    tied = replace(flight.heads, control=control[np.arange(len(control)) < n])
    flight = replace(flight, blocks={**flight.blocks, "heads": tied})
    reason = order.missing(flight, "heads")
    assert reason.endswith("and three are needed; its heads are as flight.toml has them")
    assert reason.startswith(("no control points are", "1 control point is", "2 control points"))
    declared = synthetic.read_heads(flight, tmp_path)
    assert [head.interior for head in declared.heads] == [
        flight.cameras[name].interior for name in HEADS
    ]


def test_heads_of_which_nothing_is_estimated_go_all_the_way(flight, tmp_path):
    as_declared = replace(flight, estimate_heads=())
    stage = heads.calibrate(as_declared)
    adjustments.write(tmp_path, "heads", heads.records(stage))
    read = synthetic.read_heads(as_declared, tmp_path)
    assert [head.interior.k1 for head in read.heads] == [0.0] * 4
