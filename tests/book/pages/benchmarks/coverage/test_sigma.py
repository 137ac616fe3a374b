"""The page on coverage says what the errors of the simulated flights are, and nothing else."""

import html

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from acx4book.pages.benchmarks.coverage import sigma
from acx4book.pages.benchmarks.coverage.figure_sigma import normalised_errors

ABOUT = {
    "date": "2026-01-02",
    "processor": "a processor",
    "system": "a system",
    "commit": "abc",
    "design": "acx4-ideal",
    "heads_design": "acx4",
    "versions": {"python": "3.11", "numpy": "2"},
}
NAMES = ("f_mm", "lever_z_m")
AXES = sigma.AXES


def errors(*, shift=0.0, factor=1.0, height=0.0, seed=5):
    """Errors of 100 flights: standard normal ones, those of f changed, heights shifted."""
    rng = np.random.default_rng(seed)
    parameters, points = [], []
    for flight in range(1, 101):
        z = rng.standard_normal(2)
        for name, e in zip(NAMES, z * [factor, 1] + [shift, 0], strict=True):
            row = {"seed": flight, "method": "single_step", "parameter": name}
            parameters.append(row | {"error": 0.01 * e, "sigma": 0.01, "decorrelated": e})
        common = rng.standard_normal(3)
        for point in ("A", "B", "C"):
            d = np.sqrt([0.5, 0.5]) @ [common, rng.standard_normal(3)] + [0, 0, height]
            row = {"seed": flight, "method": "single_step", "point": point}
            row |= {f"d_{axis}_m": 0.2 * x for axis, x in zip(AXES, d, strict=True)}
            points.append(row | {f"sigma_{axis}_m": 0.2 for axis in AXES})
    return sigma.Errors(
        parameters=pd.DataFrame(parameters), points=pd.DataFrame(points), about=ABOUT
    )


def failing(found):
    tests = found.tests
    return {(row.quantity, row.test) for row in tests[tests["joint_p"] < sigma.ALPHA].itertuples()}


def test_honest_errors_pass():
    found = errors()
    assert failing(found) == set()
    assert len(found.tests) == 2 * 2 + 2 + 2 * 3
    assert sigma.verdict(found).startswith("None of the 12 tests fails.")


def test_a_biased_parameter_is_named():
    found = errors(shift=0.8)
    assert ("f_mm", "mean") in failing(found)
    assert ("f_mm", "spread") not in failing(found)
    assert "mean of $f$ (single-step)" in sigma.verdict(found)
    assert " of the 12 tests fail" in sigma.verdict(found)


@pytest.mark.parametrize("factor", [0.6, 1.6])
def test_a_sigma_that_is_wrong_is_named(factor):
    assert ("f_mm", "spread") in failing(errors(factor=factor))
    assert ("f_mm", "mean") not in failing(errors(factor=factor))


def test_biased_validation_points_are_named():
    found = errors(height=1.0)
    assert failing(found) == {("height", "mean"), ("height", "spread")}
    assert "mean of height at validation points (single-step)" in sigma.verdict(found)


def test_the_tables_hold_means_spreads_and_their_p_values():
    found = errors(shift=0.3)
    z = found.normalised("single_step")
    table = sigma.parameter_table(found, "single_step")
    assert list(table["Parameter"]) == ["$f$", "lever arm $z$"]
    assert table["Mean"].to_numpy() == pytest.approx(z.mean().to_numpy())
    assert table["Standard deviation"].to_numpy() == pytest.approx(z.std().to_numpy())
    joint = sigma.joint_table(found).iloc[0]
    assert joint["Flights"] == 100
    assert joint["Degrees of freedom"] == 200
    assert joint["Sum of χ²"] == pytest.approx((found.parameters["decorrelated"] ** 2).sum())
    points = sigma.point_table(found)
    squares = (found.points["d_north_m"] / 0.2) ** 2
    assert list(points["Axis"]) == list(AXES)
    assert points["Mean square"][1] == pytest.approx(squares.mean())


def test_shares_are_counted_for_parameters_flights_and_points():
    found = errors()
    table = sigma.share_table(found).set_index("Quantity")
    within = (found.normalised("single_step")["f_mm"].abs() <= 2).mean()
    assert table.loc["normal distribution"].tolist() == ["68.3", "95.4", "99.7"]
    assert table.loc["$f$", "within 2 σ (%)"].startswith(f"{100 * within:.1f} (")
    assert "all 2 parameters, single-step" in table.index
    heights = (found.points["d_height_m"].abs() <= 0.2).mean()
    cell = table.loc["validation points, height", "within 1 σ (%)"]
    assert cell.startswith(f"{100 * heights:.1f} (")


def test_a_method_without_validation_has_a_page():
    one = errors()
    other = one.parameters.assign(method="two_step_gnss")
    both = sigma.Errors(
        parameters=pd.concat([one.parameters, other]), points=one.points, about=ABOUT
    )
    text = sigma.page(both)
    assert both.methods == ["single_step", "two_step_gnss"]
    assert len(both.tests) == 12 + 6
    assert "Two-step, GNSS positions: normalised errors" in html.unescape(text)
    assert list(sigma.point_table(both)["Method"].unique()) == ["Single-step"]


def test_of_heads_only_what_is_independent_is_counted_in_the_chi_square():
    """The second head's Xc is the first one's with the other sign."""
    mounted, z = errors(), np.random.default_rng(6).standard_normal(50)
    rows = [
        {"seed": seed, "method": "relative_orientation", "parameter": f"{head} Xc_mm"}
        | {"error": 0.003 * sign * e, "sigma": 0.003, "decorrelated": e if sign > 0 else np.nan}
        for seed, e in enumerate(z, start=1)
        for head, sign in (("CAM1", 1), ("CAM2", -1))
    ]
    both = sigma.Errors(
        parameters=pd.concat([mounted.parameters, pd.DataFrame(rows)]),
        points=mounted.points,
        about=ABOUT,
    )
    squares, n = both.chi_squares("relative_orientation")
    assert n == 1
    assert squares == pytest.approx(z**2)
    joint = sigma.joint_table(both).set_index("Method").loc["Relative orientation"]
    assert joint["Flights"] == joint["Degrees of freedom"] == 50
    table = sigma.parameter_table(both, "relative_orientation")
    assert list(table["Parameter"]) == ["CAM1 $X_c$", "CAM2 $X_c$"]
    assert table["Mean"].to_numpy() == pytest.approx([z.mean(), -z.mean()])


def test_date_seeds_and_commit_are_said():
    text = sigma.page(errors())
    assert (
        "2026-01-02 at commit `abc`: 100 flights of the design `acx4-ideal`, of the heads `acx4`, "
        "seeds 1 to 100;" in text
    )


def test_the_figure_has_a_panel_for_every_parameter_axis_and_the_joint_chi_square():
    found = errors(shift=0.5)
    figure = normalised_errors(found.parameters, found.points)
    FigureCanvasAgg(figure).draw()
    shown = [ax for ax in figure.axes if ax.get_visible()]
    assert [ax.get_title("center") for ax in shown] == [
        "$f$",
        "lever arm $z$",
        "all 2: χ²",
        *(f"validation, {axis}" for axis in AXES),
    ]
    z = found.normalised("single_step")["f_mm"]
    assert shown[0].texts[0].get_text() == f"{z.mean():+.2f} ± {z.std():.2f}"


def test_files_that_are_missing_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="make coverage"):
        sigma.read(tmp_path)


# --- the flights of the repository -----------------------------------------------------------


@pytest.fixture(scope="module")
def stored(pytestconfig):
    return sigma.read(pytestconfig.rootpath / "data" / "benchmarks")


def test_the_stored_flights_are_seeds_1_to_200(stored):
    assert stored.parameters["seed"].unique().tolist() == list(range(1, 201))
    assert stored.points["seed"].unique().tolist() == list(range(1, 201))
    assert stored.normalised("single_step").shape == (200, 14)
    assert not stored.normalised("single_step").isna().any(axis=None)
    assert stored.normalised("relative_orientation").shape == (200, 23)
    assert not stored.normalised("relative_orientation").isna().any(axis=None)
    assert stored.chi_squares("relative_orientation")[1] == 21


def test_none_of_the_tests_on_the_stored_flights_fails(stored):
    assert stored.tests["joint_p"].min() > sigma.ALPHA


def test_the_stored_flights_make_a_page(stored):
    text = sigma.page(stored) + sigma.shares(stored)
    assert f"commit `{stored.about['commit'][:7]}`" in text
    assert "nan" not in text
