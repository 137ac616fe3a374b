"""The part of the page on coverage that shows what errors leave in the mean."""

import pandas as pd
import pytest

from acx4book.pages.benchmarks.coverage import bias


def pairs(f=0.01, k1=0.0, *, scatter=0.001):
    """Biases of f and k1 in four pairs, at measured points ten times as large."""
    rows = []
    for where, factor in (("adjusted", 1), ("measured", 10)):
        for seed, off in enumerate((-scatter, scatter, -scatter, scatter), start=1):
            for name, mean, sigma in (("f_mm", f, 0.02), ("k1", k1, 1e-8)):
                row = {"seed": seed, "distortion_at": where, "parameter": name}
                rows.append(row | {"error": (factor * mean + off) * sigma, "sigma": sigma})
    return pd.DataFrame(rows)


def test_bias_is_the_mean_over_sigma_and_its_error_that_of_a_mean():
    adjusted, measured = (bias.biases(pairs(), where) for where in bias.HEADINGS)
    assert adjusted["bias"].tolist() == pytest.approx([0.01, 0.0])
    assert measured["bias"].tolist() == pytest.approx([0.1, 0.0])
    # four values one scatter from their mean: sqrt(4 / 3) / sqrt(4) of it
    assert adjusted["error"].tolist() == pytest.approx([0.001 / 3**0.5] * 2)


def test_the_table_has_both_ways_side_by_side():
    table = bias.table(pairs(f=-0.01))
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
    assert said in bias.verdict(made)


def test_the_largest_bias_is_named():
    assert "In 4 pairs the largest bias of the single step is −0.0300 ± 0.0006 σ, of $k_1$" in (
        bias.verdict(pairs(k1=-0.03))
    )


def test_files_that_are_missing_are_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="make coverage"):
        bias.read(tmp_path)


def test_the_stored_pairs_reach_the_goal_and_measured_points_would_not(pytestconfig):
    stored = bias.read(pytestconfig.rootpath / "data" / "benchmarks")
    assert sorted(stored["seed"].unique()) == list(range(1, 251))
    assert stored["parameter"].nunique() == 14
    assert "is reached" in bias.verdict(stored)
    measured = bias.biases(stored, "measured")
    assert {"f_mm", "k1", "k2", "k3"} == set(measured.index[measured["bias"].abs() > bias.GOAL])
    assert bias.page(stored).count("±") == 1 + 2 * 14  # sentence, table
