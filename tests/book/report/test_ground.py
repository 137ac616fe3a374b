"""Check points drawn with their predicted sigma."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.report import ground
from acx4book.report.ground import check_points
from acx4lib.georeferencing import budget
from support import figures
from support.helpers import dots

mpl.use("agg")


def test_check_points_stand_on_bars_of_twice_their_sigma():
    table = pd.DataFrame({"point": ["A", "B"]})
    for axis, d in (("east", 0.1), ("north", -0.2), ("height", 0.3)):
        table[f"d_{axis}_m"] = [d, 2 * d]
        table[f"sigma_{axis}_m"] = [0.05, 0.15]
    fig = check_points(table)
    assert [ax.get_ylabel() for ax in fig.axes] == ["east (m)", "north (m)", "height (m)"]
    spans = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in fig.axes[1].patches]
    assert_allclose(spans, [(-0.1, 0.1), (-0.3, 0.3)])
    assert_allclose(dots(fig.axes[1])[:, 1], [-0.2, -0.4])
    assert [label.get_text() for label in fig.axes[2].get_xticklabels()] == ["A", "B"]


def test_no_check_points_are_said():
    assert len(check_points(pd.DataFrame()).axes[0].texts) == 1


# --- The report's budget: of this run, or the reason why there is none


@pytest.fixture(scope="module")
def mapped(run):
    found = ground.mapped(run)
    assert not isinstance(found, str), found
    return found


def test_it_has_the_accuracies_of_the_run(run, mapped):
    block = run.flight.block("validation")
    assert mapped.flight.sigma_position_m == pytest.approx(block.trajectory.sigma_position[0])
    assert mapped.flight.sigma_attitude == pytest.approx(block.trajectory.sigma_attitude[0])
    text = ground.section(mapped).markdown
    assert f"{mapped.flight.height_m:.0f} m over flat ground" in text
    assert f"image points {mapped.flight.sigma_px:.2f} px" in text


def test_the_table_adds_up(mapped):
    table = figures.table(ground.section(mapped).markdown, "tab-report-budget").set_index("Source")
    parts, together = table.iloc[:-1], table.iloc[-1]
    for axis in ("plan", "height"):
        shares = figures.numbers(parts[f"in {axis} (%)"])
        assert sum(shares) == pytest.approx(100.0, abs=0.05 * len(shares))
        sigma = np.array(figures.numbers(parts[f"σ in {axis} (m)"]))
        assert np.sqrt(np.sum(np.sign(sigma) * sigma**2)) == pytest.approx(
            float(together[f"σ in {axis} (m)"]), abs=2e-3
        )
    rms = budget.over_ground(mapped.calibration, mapped.flight).rms
    assert float(together["σ in height (m)"]) == pytest.approx(rms[2], abs=5e-4)
    assert "survey" not in parts.index


def test_the_format_is_drawn(mapped):
    assert len(ground.over_format(mapped).axes) == 6  # panels and their scales


def without(run, **changes):
    """Return the material with another entry of the single step in the summary."""
    name = "mounting/single_step"
    summary = {**run.found.summary, name: {**run.found.summary[name], **changes}}
    return replace(run, found=replace(run.found, summary=summary))


def test_without_a_determined_calibration_the_reason_is_given(run):
    spoilt = without(run, converged=False)
    said = ground.mapped(spoilt)
    assert said == "No error budget: the run has no calibration with all its parameters determined."
    shown = ground.section(said).markdown
    assert shown.startswith(said)
    assert "```{table}" not in shown
    assert len(ground.over_format(said).axes) == 1


def test_a_trajectory_without_sigma_has_no_budget(run):
    block = run.flight.block("validation")
    unknown = replace(
        block.trajectory, sigma_attitude=np.full_like(block.trajectory.sigma_attitude, np.inf)
    )
    blocks = {**run.flight.blocks, "validation": replace(block, trajectory=unknown)}
    flight = replace(run.flight, blocks=blocks)
    assert "no σ of positions or attitudes" in ground.mapped(replace(run, flight=flight))


def test_the_record_has_the_variances_of_the_table(run, mapped):
    recorded = ground.recorded(mapped)
    plan = sum(part["plan_m2"] for part in recorded["sources"])
    table = figures.table(ground.section(mapped).markdown, "tab-report-budget")
    assert np.sqrt(plan) == pytest.approx(float(table["σ in plan (m)"].iloc[-1]), abs=5e-4)
    said = ground.recorded(ground.mapped(without(run, converged=False)))
    assert list(said) == ["reason"]
