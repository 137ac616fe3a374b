"""The page on coverage says what the errors of the simulated flights are, and nothing else."""

import html

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.pages.benchmarks import sigma
from acx4book.pages.benchmarks.sigma import normalised_errors

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


# --- Statistics of errors over their sigma, against printed tables and published examples


def test_normal_errors_stay_within_sigma_as_often_as_everyone_knows():
    found = [sigma.nominal(level) for level in sigma.LEVELS]
    assert_allclose(found, [0.6827, 0.9545, 0.9973], atol=5e-5)  # the digits printed


def test_holms_method_adjusts_as_in_the_textbook_example():
    """Four p values, of which alpha 0.05 rejects two (Holm 1979's method, by hand)."""
    assert_allclose(sigma.holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])


def test_an_adjusted_p_value_is_at_most_one():
    assert sigma.holm([0.9, 0.8]).tolist() == [1.0, 1.0]


def test_the_mean_is_tested_against_students_table():
    """With 10 values and t = 2.262, the probability of more is 5 % (any table of t)."""
    z = np.array([-1.0, 1.0] * 5)
    shift = 2.262 * z.std(ddof=1) / np.sqrt(10)
    assert sigma.mean_p(z + shift) == pytest.approx(0.05, abs=1e-4)
    assert sigma.mean_p(z - shift) == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize("chi_square", [2.700, 19.023])
def test_the_spread_is_tested_against_the_table_of_chi_square(chi_square):
    """2.5 % of each side with 9 degrees of freedom; a mean that is off does not matter."""
    z = np.arange(10.0)
    z *= np.sqrt(chi_square / np.sum((z - z.mean()) ** 2))
    assert sigma.spread_p(z + 5) == pytest.approx(0.05, abs=1e-4)


def test_the_sum_has_the_freedoms_of_all_flights():
    """34.170 is the 97.5 % point of 20 degrees of freedom."""
    squares = np.full(4, 34.170 / 4)
    assert sigma.sum_p(squares, 5) == pytest.approx(0.05, abs=1e-4)


def test_chi_squares_that_are_all_alike_have_the_wrong_distribution(rng):
    """Their sum says nothing against them."""
    alike = np.full(200, 14.0)
    assert sigma.sum_p(alike, 14) > 0.9
    assert sigma.distribution_p(alike, 14) < 1e-6
    assert sigma.distribution_p(rng.chisquare(14, 200), 14) > 0.01


def test_a_binomial_interval_is_clopper_and_pearsons():
    """None of ten: up to 30.85 % (Clopper and Pearson 1934)."""
    share = sigma.share_within(np.full(10, 1.5), 1)
    assert (share.value, share.low) == (0.0, 0.0)
    assert share.high == pytest.approx(0.3085, abs=5e-5)


def test_an_error_of_just_one_sigma_is_within_it():
    assert sigma.share_within(np.array([1.0, -1.0]), 1).value == 1.0


# --- bootstrap over flights ------------------------------------------------------------------


def test_of_many_normal_flights_the_bootstrap_says_what_student_says(rng):
    shifts = np.array([0.0, 0.05, 0.1, 0.15, -0.15])
    of_flights = rng.standard_normal((200, 5)) + shifts
    found = sigma.flight_mean_p(of_flights, np.zeros(5))
    # the two differ by some 1/n of the sample, and by sqrt(p / 20 000) of chance
    assert_allclose(found, stats.ttest_1samp(of_flights, 0.0).pvalue, atol=0.02)


def test_a_mean_is_compared_with_what_is_expected(rng):
    of_flights = 1.0 + 0.1 * rng.standard_normal((100, 1))
    assert sigma.flight_mean_p(of_flights, np.array([1.0]))[0] > 0.01
    assert sigma.flight_mean_p(of_flights, np.array([0.0]))[0] < 1e-4


def test_points_that_repeat_each_other_add_nothing(rng):
    """36 errors of a flight that are one error leave the interval that one has."""
    single = rng.standard_normal((100, 1))
    one = sigma.share_within_by_flights(single, 1)
    assert sigma.share_within_by_flights(np.repeat(single, 36, axis=1), 1) == one
    many = sigma.share_within_by_flights(rng.standard_normal((100, 36)), 1)
    assert one.high - one.low > 4 * (many.high - many.low)  # 6 times as wide, sqrt(36)


def test_the_interval_of_single_errors_is_nearly_the_binomial_one(rng):
    z = rng.standard_normal(400)
    exact, drawn = (
        sigma.share_within(z, 1),
        sigma.share_within_by_flights(z[:, None], 1),
    )
    assert drawn.value == exact.value
    # Clopper and Pearson is wider by 1 / (2 n) on each side, about
    assert_allclose([drawn.low, drawn.high], [exact.low, exact.high], atol=0.006)


def test_points_that_a_flight_does_not_have_are_not_counted():
    z = np.array([[0.5, np.nan], [0.5, 1.5]])
    assert sigma.share_within_by_flights(z, 1).value == 0.75


def test_what_is_said_to_be_found_is_found_in_19_of_20_samples():
    n, alpha = 50, 1e-3
    z = np.random.default_rng(1).normal(size=(1000, n))
    low, high = sigma.found_scales(n, alpha)
    for samples, p in (
        (z + sigma.found_bias(n, alpha), sigma.mean_p),
        (z * low, sigma.spread_p),
        (z * high, sigma.spread_p),
    ):
        share = np.mean([p(sample) < alpha for sample in samples])
        assert share == pytest.approx(0.95, abs=0.03)  # 4 sigma of 1000 trials


# --- The part of the page on coverage that shows what errors leave in the mean


def pairs(f=0.01, k1=0.0, *, scatter=0.001):
    """Biases of f and k1 in four pairs, at measured points ten times as large."""
    rows = []
    for where, factor in (("adjusted", 1), ("measured", 10)):
        for seed, off in enumerate((-scatter, scatter, -scatter, scatter), start=1):
            for name, mean, size in (("f_mm", f, 0.02), ("k1", k1, 1e-8)):
                row = {"seed": seed, "distortion_at": where, "parameter": name}
                rows.append(row | {"error": (factor * mean + off) * size, "sigma": size})
    return pd.DataFrame(rows)


def test_bias_is_the_mean_over_sigma_and_its_error_that_of_a_mean():
    adjusted, measured = (sigma.biases(pairs(), where) for where in sigma.HEADINGS)
    assert adjusted["bias"].tolist() == pytest.approx([0.01, 0.0])
    assert measured["bias"].tolist() == pytest.approx([0.1, 0.0])
    # four values one scatter from their mean: sqrt(4 / 3) / sqrt(4) of it
    assert adjusted["error"].tolist() == pytest.approx([0.001 / 3**0.5] * 2)


def test_the_table_has_both_ways_side_by_side():
    table = sigma.table(pairs(f=-0.01))
    assert list(table["Parameter"]) == ["$f$", "$k_1$"]
    assert list(table["Adjusted point"]) == ["−10.00 ± 0.58", "+0.00 ± 0.58"]
    assert list(table["Measured point"]) == ["−100.00 ± 0.58", "+0.00 ± 0.58"]


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (pairs(f=0.019), "is reached"),
        (pairs(f=-0.021), "is not reached"),
        (pairs(f=0.01, k1=-0.03), "is not reached"),
        (pairs(scatter=0.009), "is not reached"),  # known to 0.0052
    ],
)
def test_the_goal_is_for_the_largest_bias_and_for_how_well_it_is_known(made, said):
    assert said in sigma.bias_verdict(made)


def test_the_largest_bias_is_named():
    assert "In 4 pairs the largest bias of the single step is −0.0300 ± 0.0006 σ, of $k_1$" in (
        sigma.bias_verdict(pairs(k1=-0.03))
    )


def test_bias_files_that_are_missing_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="make coverage"):
        sigma.bias_read(tmp_path)


def test_the_stored_pairs_reach_the_goal_and_measured_points_would_not(pytestconfig):
    stored = sigma.bias_read(pytestconfig.rootpath / "data" / "benchmarks")
    assert sorted(stored["seed"].unique()) == list(range(1, 251))
    assert stored["parameter"].nunique() == 14
    assert "is reached" in sigma.bias_verdict(stored)
    measured = sigma.biases(stored, "measured")
    assert {"f_mm", "k1", "k2", "k3"} == set(measured.index[measured["bias"].abs() > sigma.GOAL])
    assert sigma.bias_page(stored).count("±") == 1 + 2 * 14  # sentence, table
