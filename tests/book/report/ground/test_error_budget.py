"""The report's budget: of this run, or the reason why there is none."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.report.ground import error_budget
from acx4lib.georeferencing import mapping_flight


@pytest.fixture(scope="module")
def mapped(run):
    found = error_budget.mapped(run)
    assert not isinstance(found, str), found
    return found


def test_it_has_the_accuracies_of_the_run(run, mapped):
    block = run.flight.block("validation")
    assert mapped.flight.sigma_position_m == pytest.approx(block.trajectory.sigma_position[0])
    assert mapped.flight.sigma_attitude == pytest.approx(block.trajectory.sigma_attitude[0])
    text = error_budget.assumed(mapped)
    assert f"{mapped.flight.height_m:.0f} m over flat ground" in text
    assert f"image points {mapped.flight.sigma_px:.2f} px" in text


def test_the_table_adds_up(mapped):
    table = error_budget.source_table(mapped)
    parts, together = table.iloc[:-1], table.iloc[-1]
    for axis in ("plan", "height"):
        assert parts[f"in {axis} (%)"].sum() == pytest.approx(100.0)
        sigma = parts[f"σ in {axis} (m)"].to_numpy()
        assert np.sqrt(np.sum(np.sign(sigma) * sigma**2)) == pytest.approx(
            together[f"σ in {axis} (m)"]
        )
    rms = mapping_flight.over_ground(mapped.calibration, mapped.flight).rms
    assert together["σ in height (m)"] == pytest.approx(rms[2])
    assert "survey" not in parts["Source"].tolist()


def test_the_format_is_drawn(mapped):
    assert len(error_budget.over_format(mapped).axes) == 6  # panels and their scales


def without(run, **changes):
    """Return the material with another entry of the single step in the summary."""
    name = "mounting/single_step"
    summary = {**run.found.summary, name: {**run.found.summary[name], **changes}}
    return replace(run, found=replace(run.found, summary=summary))


def test_without_a_determined_calibration_the_reason_is_given(run):
    spoilt = without(run, converged=False)
    said = error_budget.mapped(spoilt)
    assert said == "No error budget: the run has no calibration with all its parameters determined."
    assert error_budget.assumed(said) == said
    assert error_budget.source_table(said).empty
    assert len(error_budget.over_format(said).axes) == 1


def test_a_trajectory_without_sigma_has_no_budget(run):
    block = run.flight.block("validation")
    unknown = replace(
        block.trajectory, sigma_attitude=np.full_like(block.trajectory.sigma_attitude, np.inf)
    )
    blocks = {**run.flight.blocks, "validation": replace(block, trajectory=unknown)}
    flight = replace(run.flight, blocks=blocks)
    assert "no σ of positions or attitudes" in error_budget.mapped(replace(run, flight=flight))


def test_the_record_has_the_variances_of_the_table(run, mapped):
    recorded = error_budget.recorded(mapped)
    plan = sum(part["plan_m2"] for part in recorded["sources"])
    together = error_budget.source_table(mapped).iloc[-1]
    assert np.sqrt(plan) == pytest.approx(together["σ in plan (m)"])
    said = error_budget.recorded(error_budget.mapped(without(run, converged=False)))
    assert list(said) == ["reason"]
