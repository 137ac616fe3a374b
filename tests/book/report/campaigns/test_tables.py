"""Tables for readers: in small units, with an answer in words."""

from acx4book.report.campaigns import tables


def test_campaigns_say_when_how_warm_and_which_sigma(three):
    table = tables.campaigns(three)
    assert table["Date"].tolist() == ["2021-05-01", "2022-05-01", "2024-05-01"]
    assert table["Temperature (°C)"].tolist() == ["8", "32", "20"]
    assert set(table["σ used"]) == {"a posteriori"}


def test_hypotheses_are_rejected_where_the_camera_changed(three):
    table = tables.tests(three).set_index("Hypothesis")["Rejected"]
    assert table["all campaigns the same"] == "yes"
    assert table["2022-05 = 2021-05"] == "yes"
    assert table["no slope over temperature"] == "yes"
    assert table["straight lines over temperature"] == "no"


def test_parts_and_parameters_have_differences_in_small_units(three):
    parts = tables.parts(three, three.found[0]).set_index("Part")
    assert list(parts.index) == ["interior orientation", "lever arm", "boresight"]
    assert parts.loc["interior orientation", "Significant"] == "yes"
    assert parts.loc["lever arm", "Significant"] == "no"
    singles = tables.singles(three, three.found[0]).set_index("Parameter")
    assert singles.loc["$f$ (µm)", "Significant"] == "yes"
    value, sigma = map(float, singles.loc["$f$ (µm)", "Difference"].split(" ± "))
    assert abs(value - 0.6 * 24) < 4 * sigma
    assert "boresight $\\omega$ (″)" in singles.index


def test_pooled_values_have_their_own_units(three):
    table = tables.pooled(three).set_index("Parameter")
    assert table.loc["$f$ (mm)", "Significant"] == "yes"
    assert set(table["Degrees of freedom"]) == {2}


def test_slopes_are_per_degree_and_per_year(three):
    warm = tables.trends(three, "temperature").set_index("Parameter")
    slope, sigma = map(float, warm.loc["$f$ (µm)", "Slope per °C"].split(" ± "))
    assert abs(slope - 0.6) < 4 * sigma
    assert "Slope per year" in tables.trends(three, "year").columns
