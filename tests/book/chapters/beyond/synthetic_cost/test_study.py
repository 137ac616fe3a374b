"""The stored flights of the closed chain, and their sums over flights."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.synthetic_cost import study


@pytest.fixture(scope="module")
def found():
    return study.read()


def test_the_stored_study_has_all_flights_both_ways_and_through_the_heads_of_one(found):
    assert found.n_flights == 48
    assert found.shared.groupby("heads_of")["seed"].nunique().tolist() == [16, 16, 16]
    for way in (study.SYNTHETIC, study.RIG):
        assert len(study.variance_factors(found, way)) == 48
    assert found.about["design"] == "acx4"


def test_a_missing_file_names_the_target_of_make(tmp_path):
    with pytest.raises(FileNotFoundError, match="make chain"):
        study.read(tmp_path)


def test_the_rig_keeps_its_promises(found):
    table = study.scatter(found, study.RIG)
    assert len(table) == 48
    # a ratio of 48 flights is known to a tenth; those of one head are correlated
    assert table["ratio"].to_numpy() == pytest.approx(1, abs=0.33)
    assert np.sqrt(np.mean(table["ratio"] ** 2)) == pytest.approx(1, abs=0.1)
    assert study.variance_factors(found, study.RIG).mean() == pytest.approx(1, abs=0.005)


def made(first, second):
    """Return a study of one axis: RMS by flight of both ways."""
    rows = [
        {"seed": i, "way": way, "over": "points", "axis": "east_m", "rms_m": v, "sigma_m": 2 * v}
        for way, values in ((study.SYNTHETIC, first), (study.RIG, second))
        for i, v in enumerate(values)
    ]
    empty = pd.DataFrame()
    parts = dict.fromkeys(study.PARTS, empty) | {"points": pd.DataFrame(rows)}
    return study.Study(**parts, about={})


def test_what_is_a_tenth_larger_in_every_flight_has_no_error():
    rig = np.array([0.1, 0.2, 0.3])
    row = study.accuracy(made(1.1 * rig, rig)).iloc[0]
    assert row["percent"] == pytest.approx(10)
    assert row["sigma_percent"] == pytest.approx(0, abs=1e-9)
    assert row["rms_rig"] == pytest.approx(np.sqrt(np.mean(rig**2)))
    assert row["sigma_rig"] == pytest.approx(2 * row["rms_rig"])


def test_the_standard_error_of_a_percentage_is_that_of_repeated_studies():
    rng = np.random.default_rng(1)
    found = []
    for _ in range(400):
        common = rng.normal(1, 0.3, 50)
        first, second = np.sqrt((common + rng.normal(0.1, 0.1, (2, 50))).clip(0.01))
        found.append(study.accuracy(made(first, second)).iloc[0][["percent", "sigma_percent"]])
    percent, sigma = np.array(found, dtype=float).T
    assert sigma.mean() == pytest.approx(percent.std(), rel=0.1)  # 3.5 % of 400


def test_an_excess_that_is_planted_is_found(found):
    own = found.parameters.copy()
    factor = own["parameter"] == "sigma0_squared"
    rig = own[factor & (own["way"] == study.RIG)].set_index("seed")["value"]
    planted = factor & (own["way"] == study.SYNTHETIC)
    own.loc[planted, "value"] = (rig.loc[own.loc[planted, "seed"]] + 0.5).to_numpy()
    said = study.excess(replace(found, parameters=own))
    assert said["difference"] == pytest.approx(0.5)
    assert said["sigma"] == pytest.approx(0.0, abs=1e-9)
    assert said["beyond"] == found.n_flights


def test_what_is_stated_holds_among_flights_with_the_same_heads(found):
    assert study.scatter_of_shared(found).between(0.6, 1.3).all()
    assert 3 < study.scatter(found, study.SYNTHETIC)["ratio"].max() < 4


def test_noise_scatters_by_the_sigma_that_has_the_part_of_the_heads(found):
    both = study.scatter_with_heads(found)
    assert found.noise["seed"].nunique() >= 60
    assert both["noise"].between(both["low"], both["high"]).all()
    stated = both["noise"] * np.hypot(1, both["sigma_of_heads"] / both["sigma"])
    assert (stated > both["high"]).sum() > 5  # without that part they do not


def test_scatter_with_heads_is_that_of_planted_noise(found):
    """Normal noise of known size, in 2000 flights of two parameters, beside a scatter of model."""
    rng = np.random.default_rng(3)
    sigma, of_heads = np.array([1.0, 2.0]), np.array([3.0, 0.5])
    exact = rng.normal(0, 4, (2000, 2))
    value = exact + rng.normal(0, 1, (2000, 2)) * np.hypot(sigma, of_heads)
    rows = [
        {"seed": i, "parameter": name, "value": value[i, k], "exact": exact[i, k]}
        | {"sigma": sigma[k], "sigma_of_heads": of_heads[k]}
        for i in range(2000)
        for k, name in enumerate("ab")
    ]
    both = study.scatter_with_heads(replace(found, noise=pd.DataFrame(rows)))
    assert both["noise"].to_numpy() == pytest.approx(1, abs=0.06)
    assert both["exact"].to_numpy() == pytest.approx(4 / np.hypot(sigma, of_heads), rel=0.06)
    assert both["sigma"].to_numpy() == pytest.approx(sigma)
    assert both["low"].iloc[0] == pytest.approx(1 - 2.81 / np.sqrt(2 * 1999), abs=0.002)
