"""Tables for readers: in small units, with an answer in words."""

from dataclasses import replace
from pathlib import Path

import pytest

from acx4book.report.campaigns import tables as campaigns_tables
from acx4book.report.campaigns.tables import study
from acx4lib.calibration.estimates import Parameter
from acx4lib.errors import FlightError


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


def test_names_are_the_shortest_ends_that_differ():
    assert campaigns_tables.names_of(["/x/a", "/x/b"]) == ["a", "b"]
    assert campaigns_tables.names_of(["/x/a/results", "/x/b/results"]) == ["a/results", "b/results"]
    assert campaigns_tables.names_of(["/x/a", "/x/a"]) == ["a", "a"]
    assert campaigns_tables.names_of([Path("a")]) == ["a"]


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


# --- Units for small changes, and labels


def test_changes_have_small_units():
    assert campaigns_tables.scale("mm") == (1e3, "µm")
    assert campaigns_tables.scale("deg") == (3600.0, "″")
    assert campaigns_tables.scale("mm^-2") == (1.0, "mm^-2")


@pytest.mark.parametrize(
    ("unit", "size", "said"),
    [
        ("mm", 2e-3, (1e3, "µm")),
        ("mm^-4", 3e-11, (1e11, "10⁻¹¹ mm⁻⁴")),
        ("1", 0.002, (1e3, "10⁻³")),
        ("mm^-2", 0.0, (1.0, "mm⁻²")),
    ],
)
def test_small_numbers_have_a_power_of_ten_in_their_unit(unit, size, said):
    factor, text = campaigns_tables.fine(unit, size)
    assert (pytest.approx(factor), text) == said


def test_cameras_are_named_where_there_are_several():
    one, other = (
        Parameter(camera=c, name="f_mm", key="f", unit="mm", value=1.0, sigma=1.0) for c in "AB"
    )
    assert campaigns_tables.cameras_to_say((one, other))
    assert not campaigns_tables.cameras_to_say((one, one))
    assert campaigns_tables.label("f_mm", "A*") == "A&#42; $f$"
    assert campaigns_tables.label("f_mm") == "$f$"


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


def test_what_sigma_was_used_is_said(three):
    assert "multiplied by the root of each campaign's own σ₀²" in campaigns_tables.how(three)
    plain = study(three.comparison.campaigns, apriori=True)
    assert "as they were stated before the adjustments" in campaigns_tables.how(plain)


def test_notes_are_shown_as_they_are(three):
    noted = replace(three.comparison, notes=("*a* is b",))
    assert campaigns_tables.notes(replace(three, comparison=noted)) == "- &#42;a&#42; is b."
