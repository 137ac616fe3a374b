"""Figures of a comparison show its numbers, in units that are said."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import stability
from acx4book.notebooks import functions, runner
from acx4book.report.campaigns import figures, written
from acx4book.report.campaigns.tables import study
from acx4lib.errors import FlightError
from acx4sim import files
from acx4tools.campaigns import comparison, tables
from support.figures import assert_texts_apart, drawn, panels, quivers, sentence


def test_the_time_line_has_a_panel_for_each_parameter_with_error_bars(three):
    fig = drawn(figures.time_line(three))
    assert_texts_apart(fig)
    shown = [ax for ax in panels(fig) if ax.lines]
    assert len(shown) == 14
    assert shown[0].get_title(loc="left") == "$f$ (µm)"
    dots = shown[0].lines[0]
    mean = comparison.pooled(three.comparison).coefficients[0, 0]
    assert_allclose(dots.get_ydata(), 1e3 * (three.comparison.values[:, 0] - mean))  # noqa: PD011 no frame's
    assert_allclose(dots.get_xdata(), [2021.33, 2022.33, 2024.33], atol=0.01)


def test_without_dates_campaigns_stand_in_their_order(three):
    first, second = three.comparison.campaigns[:2]
    same_day = study([first, first.__class__(**{**vars(second), "session": first.session})])
    ax = panels(drawn(figures.time_line(same_day)))[0]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["2021-05", "2022-05"]


def test_a_year_has_decimals():
    assert figures.year_of(dt.date(2024, 1, 1)) == 2024
    assert 2024.4 < figures.year_of(dt.date(2024, 7, 1)) < 2024.6


def test_arrows_on_the_ground_are_the_difference(three):
    (ax,) = [ax for ax in panels(drawn(figures.on_the_ground(three))) if quivers(ax)]
    (arrows,) = quivers(ax)
    one = min(three.found, key=lambda found: found.test().p)
    moved = three.ground.of["CAM"].moved(one.d)
    drawn_at = np.column_stack([arrows.U, arrows.V])
    ratio = np.hypot(*drawn_at.T) / np.hypot(*moved.T)
    assert_allclose(ratio, ratio[0])
    assert_allclose(drawn_at[:, 0] / ratio[0], -moved[:, 1])  # to the right is minus left


def test_lines_over_temperature_go_through_the_campaigns(three):
    fig = drawn(figures.over(three, "temperature"))
    ax = panels(fig)[0]
    assert ax.get_title(loc="left") == "$f$"
    line = next(one for one in ax.lines if len(one.get_xdata()) == 2)
    assert_allclose(line.get_xdata(), [8, 32])
    slope = np.ptp(line.get_ydata()) / 24
    assert 0.3 < slope < 0.9
    two = study(three.comparison.campaigns[:2])
    assert "no temperatures to fit" in sentence(figures.over(two, "temperature"))


# --- The rig of one flight: a table, a figure, sentences; and folders that have no heads


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of a rig of which one head turned."""
    at = tmp_path_factory.mktemp("rig")
    files.write(stability.turning(stability.flown(1)), at / "flight")
    runner.run(at / "flight", at / "results", way=functions.Functions(), stages=("heads",))
    return at / "results"


@pytest.fixture(scope="module")
def found(folder):
    return figures.read(folder)


def test_the_turned_head_is_named(found):
    table = figures.table(tables.rigidity(found), level=0.05).set_index("Exposure")
    assert table.loc[stability.EXPOSURE, "Turned"] == "yes"
    assert table.loc[stability.EXPOSURE, "Head that turned most"] == stability.HEAD
    assert (table["Turned"] == "yes").sum() == 1
    assert table.index[-1] == "all at once"
    assert f"these exposures deviate: {stability.EXPOSURE}." in figures.verdict(found, level=0.05)
    assert figures.for_terminal(found, level=0.05)[1].startswith(
        f"exposure {stability.EXPOSURE} deviates"
    )


def test_of_many_exposures_those_that_deviate_are_listed(found):
    many = pd.concat([tables.rigidity(found)] * 3)
    shown = figures.table(many, level=0.05)["Exposure"].tolist()
    assert shown == [stability.EXPOSURE, "all at once"] * 3


def test_the_turn_is_that_which_was_planted(found):
    own = stability.planted(found)
    assert own["p_joint"] < 1e-3
    assert abs(own["turn_arcsec"] - stability.ARCSEC) < 4 * own["sigma_arcsec"]


def test_dots_are_the_turns(found):
    ax = panels(drawn(figures.turns(found)))[1]
    heads = [line.get_label() for line in ax.get_legend_handles_labels()[0]]
    assert len(heads) == 3  # the first head is what others turn against
    value = np.degrees(found.turns[found.exposures.index(stability.EXPOSURE), 2, 1]) * 3600
    assert any(np.isclose(line.get_ydata(), value).any() for line in ax.lines)


def test_a_page_and_a_table_are_left(found, tmp_path):
    written.write_rigidity(found, tmp_path / "out", name="<b>", level=0.05)
    text = (tmp_path / "out" / written.PAGE).read_text(encoding="utf-8")
    assert "Rigidity of the rig" in text
    assert "&lt;b&gt;" in text
    assert (tmp_path / "out" / "rigidity.csv").is_file()


def test_a_rigid_rig_is_said_to_be(found):
    still = tuple(
        replace(test, explained=test.dof * 1.0, left=1.0 * test.redundancy) for test in found.tests
    )
    rigid = replace(found, tests=still)
    text = figures.verdict(rigid, level=1e-9)
    assert text.startswith("**The heads keep their places.**")
    assert text.endswith("No exposure by itself deviates at the joint level.")


def test_a_flight_without_heads_has_no_rig(folders):
    with pytest.raises(FlightError, match="name two or more folders to compare campaigns"):
        figures.read(folders[0])
