"""The rig of a flight: records, tables, sentences and figures, also where there is none."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.beyond.rig import deformations, one_by_one, tables, truth
from acx4book.chapters.beyond.rig.figures import rig_correlations, rig_deformations, rig_gains
from acx4lib.flight.block import select_images
from acx4lib.stages import rig


@pytest.fixture(scope="module")
def ways(flight, stage):
    return one_by_one.oriented(flight, stage)


def test_a_flight_without_truth_has_no_column_of_errors(flight, stage, ways, tmp_path):
    measured = replace(flight, pictures=tmp_path)
    assert truth.true_heads(measured, stage) == ()
    assert truth.true_orientation(measured, stage) is None
    found = deformations.of_all(measured, ways, None)
    table = tables.image(measured, ways, found)
    assert not [column for column in table.columns if "true" in column]
    assert "Farthest from the truth (σ)" not in tables.calibration(stage, ())
    assert rig_deformations(measured, found).axes


def test_tables_set_the_ways_beside_each_other(flight, stage, ways):
    orientation = tables.orientation(ways)
    assert len(orientation) == 24
    assert list(orientation.columns) == [
        "Parameter", "Head", "One by one", "One by one, $f$ estimated", "Rig", "Gain",
    ]  # fmt: skip
    gain = ways["one by one"].sigma[2, 0] / ways["rig"].sigma[2, 0]
    assert orientation["Gain"][2] == f"{gain:.1f}"
    assert orientation["Gain"][8] == ""  # Zc of the first head is held one by one
    found = deformations.of_all(flight, ways, truth.true_orientation(flight, stage))
    image = tables.image(flight, ways, found)
    assert list(image["Heads"]) == list(ways)
    predicted = [float(v) for v in image["Misfit in overlaps, predicted RMS (px)"]]
    assert predicted[-1] == min(predicted)
    far = tables.calibration(stage, truth.true_heads(flight, stage))
    assert max(map(float, far["Farthest from the truth (σ)"])) < 4
    for figure in (
        rig_gains(ways),
        rig_correlations(ways),
        rig_deformations(flight, found),
    ):
        figure.canvas.draw()


def test_sentences_have_the_numbers_of_the_run(flight, stage, ways):
    assert "times by 2" in tables.shared(stage)
    assert "in other exposures too" in tables.shared(stage)
    assert "times smaller for $X_c$ and $Y_c$" in tables.gain(stage, ways)
    found = deformations.of_all(flight, ways, None)
    ratio = found["rig, no shared points"].gap_sigma_mm / found["rig"].gap_sigma_mm
    assert f"{ratio:.1f} times less" in tables.without_shared_points(flight, found)


# --- no rig ----------------------------------------------------------------------------------


def with_block(flight, block):
    return replace(flight, blocks={"heads": block})


def test_a_rig_that_is_not_determined_ends_no_run(flight):
    """From one strip without control points, a lever arm is a shift of all tie points."""
    block = flight.blocks["heads"]
    block = select_images(block, np.array(block.images.strips) == block.images.strips[0])
    points = block.image_points
    kept = ~np.isin(points.point_idx, block.control.point_idx)
    stage = rig.calibrate(with_block(flight, replace(block, image_points=points[kept])))
    entry = rig.records(stage)[0].summary["mounting/rig"]
    assert any("lever" in line and "control points" in line for line in entry["left_out"])
    assert one_by_one.oriented(flight, stage) == {}
    assert "nothing to compare" in tables.gain(stage, {})


def test_a_rig_that_cannot_be_adjusted_is_left_out_with_the_reason(flight, stage):
    failed = replace(stage, rig=None, left_out="it does not converge")
    (record,) = rig.records(failed)
    entry = record.summary["mounting/rig"]
    assert entry["left_out"] == ["mounting/rig: it does not converge"]
    assert not entry["converged"]
    assert tables.gain(failed, {}) == "There is no rig: it does not converge."
    assert len(tables.quality(failed)) == len(tables.calibration(failed, ())) == 1
    assert len(tables.orientation({})) == len(tables.image(flight, {}, {})) == 1
    for figure in (
        rig_gains({}),
        rig_correlations({}),
        rig_deformations(flight, {}),
    ):
        assert len(figure.axes) == 1


def test_a_flight_without_a_synthetic_image_has_a_rig_all_the_same(flight):
    plain = replace(flight, synthetic=None)
    stage = rig.calibrate(plain)
    assert stage.rig is not None
    assert one_by_one.oriented(plain, stage) == {}
    assert deformations.of_all(plain, {}, None) == {}


def test_points_of_one_exposure_only_are_said(flight):
    """A tie point that two heads share loses its measurements at all other exposures."""
    block = flight.blocks["heads"]
    points = block.image_points
    exposure = block.images.exposure_idx[points.image_idx]
    together = exposure * len(block.points) + points.point_idx
    tie = ~np.isin(points.point_idx, block.control.point_idx)
    row = np.flatnonzero(tie & (np.bincount(together)[together] == 2))[0]
    kept = (points.point_idx != points.point_idx[row]) | (exposure == exposure[row])
    stage = rig.calibrate(with_block(flight, replace(block, image_points=points[kept])))
    entry = rig.records(stage)[0].summary["mounting/rig"]
    assert entry["notes"] == [
        "mounting/rig: 1 points that heads share at one exposure only are as high as the nearest"
    ]
    assert entry["n_left_out"] == 0
    assert "1 points are in that exposure only" in tables.shared(stage)


def test_the_answer_has_the_gain_in_the_frame(flight, stage, ways):
    found = deformations.of_all(flight, ways, truth.true_orientation(flight, stage))
    said = tables.answer(flight, stage, ways, found)
    pixel = flight.synthetic_camera.pixel_mm
    apart, together = (found[way].sigma.max() / pixel for way in ("one by one", "rig"))
    assert f"falls from {apart:.2f} to {together:.2f} px" in said
    assert "focal lengths need not be held" in said
    assert "nothing to compare" in tables.answer(flight, stage, ways, {})
