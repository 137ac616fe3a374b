"""The comparison of campaigns: tables, figures, and the page."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import stability
from acx4book.notebooks import runner
from acx4book.report import comparison
from acx4book.report import comparison_tables as campaigns_tables
from acx4book.report.comparison import ADDED
from acx4book.report.comparison_tables import study
from acx4book.typesetting import style
from acx4book.typesetting.myst import SUPERSCRIPTS
from acx4lib.errors import FlightError, OutputError
from acx4lib.results.own_folder import MARK
from acx4sim import files
from acx4tools import campaigns
from support.figures import assert_texts_apart, drawn, panels, quivers, sentence
from support.helpers import ROOT

# --- written ---------------------------------------------------------------------------------
#
# The folder of a comparison: its files, replaced by a later one, and nothing of others.


TABLES = {"campaigns", "tests", "differences", "pooled", "trends", "covariance"}


@pytest.fixture(scope="module")
def folder(three, tmp_path_factory):
    out = tmp_path_factory.mktemp("campaigns") / "out"
    comparison.write(three, out)
    return out


def test_a_folder_has_a_page_and_tables(three, folder):
    files = {path.name for path in folder.iterdir()}
    assert files == {comparison.PAGE, MARK, *(f"{name}.csv" for name in TABLES)}
    found = pd.read_csv(folder / "differences.csv")
    columns = ["difference", "sigma", "p"]
    np.testing.assert_allclose(found[columns], three.tables["differences"][columns], rtol=1e-9)
    text = (folder / comparison.PAGE).read_text(encoding="utf-8")
    assert "2022-05 less 2021-05" in text
    assert text.count('<svg role="img"') == 4
    assert "{numref}" not in text


def test_the_same_comparison_gives_the_same_bytes_and_replaces_the_old_one(three, folder, tmp_path):
    comparison.write(study(three.comparison.campaigns[:2]), tmp_path / "out")
    comparison.write(three, tmp_path / "out")
    for path in folder.iterdir():
        if path.name != MARK:
            assert path.read_bytes() == (tmp_path / "out" / path.name).read_bytes()
    said = json.loads((tmp_path / "out" / MARK).read_text())
    assert comparison.COMMAND in str(said)


def test_a_folder_of_somebody_else_is_left_alone(three, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds what acx4 compare did not write"):
        comparison.write(three, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


# --- The page: one file that asks for nothing, in the book's colours by day and by night


def test_texts_tables_and_figures_are_numbered(folder):
    text = (folder / comparison.PAGE).read_text(encoding="utf-8")
    assert "<b>Figure 2.</b>" in text
    assert "<b>Table 2.</b>" in text
    assert not re.search(r"<script|<link|src=|url\(http|@import", text)


def test_colours_of_the_night_are_those_of_the_book():
    of_book = (ROOT / "book/_static/acx4.css").read_text(encoding="utf-8")
    night = re.findall(r"(--figure-[\w-]+): (#\w+);", ADDED.read_text(encoding="utf-8"))
    assert {name.removeprefix("--figure-") for name, _ in night} == set(style.NAMES.values())
    own = of_book[of_book.index('data-theme="dark"') :]
    assert dict(night).items() <= dict(re.findall(r"(--figure-[\w-]+): (#\w+);", own)).items()


# --- tables for readers: in small units, with an answer in words -----------------------------


def test_campaigns_say_when_how_warm_and_which_sigma(three):
    table = campaigns_tables.campaigns(three)
    assert table["Date"].tolist() == ["2021-05-01", "2022-05-01", "2024-05-01"]
    assert table["Temperature (°C)"].tolist() == ["8", "32", "20"]
    assert set(table["σ used"]) == {"a posteriori"}


def test_hypotheses_are_rejected_where_the_camera_changed(three):
    table = campaigns_tables.tests(three).set_index("Hypothesis")["Rejected"]
    assert table["all campaigns the same"] == "yes"
    assert table["2022-05 = 2021-05"] == "yes"
    assert table["no slope over temperature"] == "yes"
    assert table["straight lines over temperature"] == "no"


def test_parts_and_parameters_have_differences_in_small_units(three):
    parts = campaigns_tables.parts(three, three.found[0]).set_index("Part")
    assert list(parts.index) == ["interior orientation", "lever arm", "boresight"]
    assert parts.loc["interior orientation", "Significant"] == "yes"
    assert parts.loc["lever arm", "Significant"] == "no"
    singles = campaigns_tables.singles(three, three.found[0]).set_index("Parameter")
    assert singles.loc["$f$ (µm)", "Significant"] == "yes"
    value, sigma = map(float, singles.loc["$f$ (µm)", "Difference"].split(" ± "))
    assert abs(value - 0.6 * 24) < 4 * sigma
    assert "boresight $\\omega$ (″)" in singles.index


def test_pooled_values_have_their_own_units(three):
    table = campaigns_tables.pooled(three).set_index("Parameter")
    assert table.loc["$f$ (mm)", "Significant"] == "yes"
    assert set(table["Degrees of freedom"]) == {2}


def test_slopes_are_per_degree_and_per_year(three):
    warm = campaigns_tables.trends(three, "temperature").set_index("Parameter")
    slope, sigma = map(float, warm.loc["$f$ (µm)", "Slope per °C"].split(" ± "))
    assert abs(slope - 0.6) < 4 * sigma
    assert "Slope per year" in campaigns_tables.trends(three, "year").columns


# --- Campaigns read by their folders, and named by what differs in their paths


def test_names_are_the_shortest_ends_that_differ(folders, tmp_path):
    two = [tmp_path / name / "results" for name in "ab"]
    for one in two:
        shutil.copytree(folders[0], one)
    assert [c.name for c in campaigns_tables.read(two)] == ["a/results", "b/results"]
    assert [c.name for c in campaigns_tables.read([two[0]] * 2)] == ["results", "results"]
    assert [c.name for c in campaigns_tables.read(two[:1])] == ["results"]


def test_campaigns_are_read_with_date_and_temperature(folders):
    found = campaigns_tables.read(folders)
    assert [c.name for c in found] == ["year2021", "year2024"]
    assert [str(c.session.date) for c in found] == ["2021-05-01", "2024-05-01"]
    assert [c.session.temperature_c for c in found] == [8.0, 32.0]
    methods = [c.method for c in campaigns_tables.read(folders, methods=["two_step"])]
    assert methods == ["two_step", "two_step"]
    methods = [
        c.method for c in campaigns_tables.read(folders, methods=["single_step", "two_step"])
    ]
    assert methods == ["single_step", "two_step"]


def test_everything_wrong_is_told_at_once(folders, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(FlightError) as error:
        campaigns_tables.read([tmp_path / "empty", folders[0], tmp_path / "none"])
    assert len(error.value.problems) == 2


def test_a_study_knows_what_has_changed(three):
    assert three.title(three.found[0]) == "2022-05 - 2021-05"
    assert all(map(three.changed, three.found))
    assert three.ground.height_m == 610.0
    assert len(campaigns_tables.study(three.comparison.campaigns, against="first").found) == 2


def test_cameras_are_named_where_there_are_several(three):
    first, *others = three.comparison.parameters
    parameters = (replace(first, camera="A*"), *others)
    differences = three.tables["differences"].copy()
    differences.loc[differences["parameter"] == first.name, "camera"] = "A*"
    several = replace(
        three,
        comparison=replace(three.comparison, parameters=parameters),
        tables={**three.tables, "differences": differences},
    )
    names = campaigns_tables.singles(several, three.found[0])["Parameter"].tolist()
    assert names[:2] == ["A&#42; $f$ (µm)", "CAM $x_p$ (µm)"]


# --- The verdict of a comparison, for readers and in the terminal


def test_a_change_is_said_with_its_size_and_what_it_does(three):
    text = campaigns_tables.verdict(three)
    assert text.startswith("**The 3 campaigns are not the same.** All 14 parameters together: χ²")
    assert "the level is 0.05" in text
    assert "$f$ by " in text
    assert "µm (2021-05 to 2022-05)" in text
    assert "From 610 m above the ground a pixel of CAM that is georeferenced with" in text


def test_campaigns_that_agree_are_said_to(three):
    a, b = three.comparison.campaigns[:2]
    same = replace(a, name="copy", session=b.session)
    text = campaigns_tables.verdict(study([a, same]))
    assert text.startswith("**The 2 campaigns agree within their errors.**")
    assert "No parameter by itself has changed at the joint level." in text
    lines = campaigns_tables.for_terminal(study([a, same]))
    assert lines == [
        "2 campaigns agree within their errors: chi-square 0.0, 14 degrees of freedom, p = 1.000"
    ]


def test_a_change_that_no_parameter_shows_by_itself_is_said(three):
    tables = {name: table.copy() for name, table in three.tables.items()}
    tables["differences"]["p_joint"] = 1.0
    text = campaigns_tables.verdict(replace(three, tables=tables))
    assert "2021-05 and 2022-05; 2022-05 and 2024-05: all parameters together differ" in text


def test_a_trend_is_said_or_what_it_would_need(three):
    assert "Over temperature the slopes of all parameters together are significant" in (
        campaigns_tables.trend(three)
    )
    assert "The campaigns lie on the lines within their errors." in campaigns_tables.trend(three)
    two = study(three.comparison.campaigns[:2])
    assert campaigns_tables.trend(two).startswith(
        "There is no regression: it needs three campaigns"
    )


def test_what_sigma_was_used_is_said(three, folder, tmp_path):
    text = (folder / comparison.PAGE).read_text(encoding="utf-8")
    assert "multiplied by the root of each campaign" in text
    comparison.write(study(three.comparison.campaigns[:2], apriori=True), tmp_path / "out")
    text = (tmp_path / "out" / comparison.PAGE).read_text(encoding="utf-8")
    assert "as they were stated before the adjustments" in text


def test_notes_are_shown_as_they_are(three, tmp_path):
    noted = replace(three.comparison, notes=("*a* is <b>",))
    comparison.write(replace(three, comparison=noted), tmp_path / "out")
    text = (tmp_path / "out" / comparison.PAGE).read_text(encoding="utf-8")
    assert "<li>*a* is &lt;b&gt;.</li>" in text


# --- figures of a comparison show its numbers, in units that are said ------------------------


def test_the_time_line_has_a_panel_for_each_parameter_with_error_bars(three):
    fig = drawn(comparison.time_line(three))
    assert_texts_apart(fig)
    shown = [ax for ax in panels(fig) if ax.lines]
    assert len(shown) == 14
    assert shown[0].get_title(loc="left") == "$f$ (µm)"
    dots = shown[0].lines[0]
    pooled = campaigns.pooled(three.comparison)
    mean = pooled.coefficients[0, 0]
    assert_allclose(dots.get_ydata(), 1e3 * (three.comparison.values[:, 0] - mean))  # noqa: PD011 no frame's
    assert_allclose(dots.get_xdata(), [2021.33, 2022.33, 2024.33], atol=0.01)
    k1, k2 = (three.comparison.names.index(f"CAM/{name}") for name in ("k1", "k2"))
    for i, unit in ((k1, "mm⁻²"), (k2, "mm⁻⁴")):
        power = int(np.floor(np.log10(np.sqrt(np.diag(pooled.cov[0, :, 0]))[i])))
        exponent = str(power).translate(SUPERSCRIPTS)
        assert shown[i].get_title(loc="left").endswith(f"$ (10{exponent} {unit})")
        value = three.comparison.values[:, i] - pooled.coefficients[0, i]  # noqa: PD011 no frame's
        assert_allclose(shown[i].lines[0].get_ydata(), 10.0**-power * value)


def test_without_dates_campaigns_stand_in_their_order(three):
    first, second = three.comparison.campaigns[:2]
    same_day = study([first, first.__class__(**{**vars(second), "session": first.session})])
    ax = panels(drawn(comparison.time_line(same_day)))[0]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["2021-05", "2022-05"]


def test_arrows_on_the_ground_are_the_difference(three):
    (ax,) = [ax for ax in panels(drawn(comparison.on_the_ground(three))) if quivers(ax)]
    (arrows,) = quivers(ax)
    one = min(three.found, key=lambda found: found.test().p)
    moved = three.ground.of["CAM"].moved(one.d)
    drawn_at = np.column_stack([arrows.U, arrows.V])
    ratio = np.hypot(*drawn_at.T) / np.hypot(*moved.T)
    assert_allclose(ratio, ratio[0])
    assert_allclose(drawn_at[:, 0] / ratio[0], -moved[:, 1])  # to the right is minus left


def test_lines_over_temperature_go_through_the_campaigns(three):
    fig = drawn(comparison.over(three, "temperature"))
    ax = panels(fig)[0]
    assert ax.get_title(loc="left") == "$f$"
    line = next(one for one in ax.lines if len(one.get_xdata()) == 2)
    assert_allclose(line.get_xdata(), [8, 32])
    slope = np.ptp(line.get_ydata()) / 24
    assert 0.3 < slope < 0.9
    two = study(three.comparison.campaigns[:2])
    assert "no temperatures to fit" in sentence(comparison.over(two, "temperature"))


# --- The rig of one flight: a table, a figure, sentences; and folders that have no heads


@pytest.fixture(scope="module")
def figures_folder(tmp_path_factory):
    """Results of a rig of which one head turned."""
    at = tmp_path_factory.mktemp("rig")
    files.write(stability.turning(stability.flown(1)), at / "flight")
    runner.run(at / "flight", at / "results", stages=("heads",))
    return at / "results"


@pytest.fixture(scope="module")
def found(figures_folder):
    return comparison.read_rigidity(figures_folder)


def test_the_turned_head_is_named(found):
    table = comparison.rigidity_table(campaigns.rigidity(found), level=0.05).set_index("Exposure")
    assert table.loc[stability.EXPOSURE, "Turned"] == "yes"
    assert table.loc[stability.EXPOSURE, "Head that turned most"] == stability.HEAD
    assert (table["Turned"] == "yes").sum() == 1
    assert table.index[-1] == "all at once"
    assert f"these exposures deviate: {stability.EXPOSURE}." in comparison.rigidity_verdict(
        found, level=0.05
    )
    assert comparison.rigidity_lines(found, level=0.05)[1].startswith(
        f"exposure {stability.EXPOSURE} deviates"
    )


def test_of_many_exposures_those_that_deviate_are_listed(found):
    many = pd.concat([campaigns.rigidity(found)] * 3)
    shown = comparison.rigidity_table(many, level=0.05)["Exposure"].tolist()
    assert shown == [stability.EXPOSURE, "all at once"] * 3


def test_the_turn_is_that_which_was_planted(found):
    own = stability.planted(found)
    assert own["p_joint"] < 1e-3
    assert abs(own["turn_arcsec"] - stability.ARCSEC) < 4 * own["sigma_arcsec"]


def test_dots_are_the_turns(found):
    ax = panels(drawn(comparison.turns(found)))[1]
    heads = [line.get_label() for line in ax.get_legend_handles_labels()[0]]
    assert len(heads) == 3  # the first head is what others turn against
    value = np.degrees(found.turns[found.exposures.index(stability.EXPOSURE), 2, 1]) * 3600
    assert any(np.isclose(line.get_ydata(), value).any() for line in ax.lines)


def test_a_page_and_a_table_are_left(found, tmp_path):
    comparison.write_rigidity(found, tmp_path / "out", name="<b>", level=0.05)
    text = (tmp_path / "out" / comparison.PAGE).read_text(encoding="utf-8")
    assert "Rigidity of the rig" in text
    assert "&lt;b&gt;" in text
    assert (tmp_path / "out" / "rigidity.csv").is_file()


def test_a_rigid_rig_is_said_to_be(found):
    still = tuple(
        replace(test, explained=test.dof * 1.0, left=1.0 * test.redundancy) for test in found.tests
    )
    rigid = replace(found, tests=still)
    text = comparison.rigidity_verdict(rigid, level=1e-9)
    assert text.startswith("**The heads keep their places.**")
    assert text.endswith("No exposure by itself deviates at the joint level.")


def test_a_flight_without_heads_has_no_rig(folders):
    with pytest.raises(FlightError, match="name two or more folders to compare campaigns"):
        comparison.read_rigidity(folders[0])
