"""The stored flights of the closed chain, and their sums over flights."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters import synthetic_cost
from acx4book.paper import printed


@pytest.fixture(scope="module")
def found():
    return synthetic_cost.read()


def test_the_rig_keeps_its_promises(found):
    table = synthetic_cost.scatter(found, synthetic_cost.RIG)
    assert len(table) == 48
    # a ratio of 48 flights is known to a tenth; those of one head are correlated
    assert table["ratio"].to_numpy() == pytest.approx(1, abs=0.33)
    assert np.sqrt(np.mean(table["ratio"] ** 2)) == pytest.approx(1, abs=0.1)
    own = found.parameters[found.parameters["way"] == synthetic_cost.RIG]
    own = own[own["parameter"] == "sigma0_squared"]
    assert own["value"].mean() == pytest.approx(1, abs=0.005)


def made(first, second):
    """Return a study of one axis: RMS by flight of both ways."""
    rows = [
        {"seed": i, "way": way, "over": "points", "axis": "east_m", "rms_m": v, "sigma_m": 2 * v}
        for way, values in ((synthetic_cost.SYNTHETIC, first), (synthetic_cost.RIG, second))
        for i, v in enumerate(values)
    ]
    empty = pd.DataFrame()
    parts = dict.fromkeys(synthetic_cost.PARTS, empty) | {"points": pd.DataFrame(rows)}
    return synthetic_cost.Study(**parts, about={})


def test_what_is_a_tenth_larger_in_every_flight_has_no_error():
    rig = np.array([0.1, 0.2, 0.3])
    row = synthetic_cost.accuracy_table(made(1.1 * rig, rig)).iloc[0]
    assert row["larger by (%)", "value"] == pytest.approx(10)
    assert row["larger by (%)", "sigma"] == pytest.approx(0, abs=1e-9)
    assert row["RMS (m)", "rig"] == pytest.approx(np.sqrt(np.mean(rig**2)))
    assert row["predicted (m)", "rig"] == pytest.approx(2 * row["RMS (m)", "rig"])


def test_the_standard_error_of_a_percentage_is_that_of_repeated_studies():
    rng = np.random.default_rng(1)
    found = []
    for _ in range(400):
        common = rng.normal(1, 0.3, 50)
        first, second = np.sqrt((common + rng.normal(0.1, 0.1, (2, 50))).clip(0.01))
        table = synthetic_cost.accuracy_table(made(first, second))
        found.append(table["larger by (%)"].iloc[0][["value", "sigma"]])
    percent, sigma = np.array(found, dtype=float).T
    assert sigma.mean() == pytest.approx(percent.std(), rel=0.1)  # 3.5 % of 400


def test_what_is_stated_holds_among_flights_with_the_same_heads(found):
    assert synthetic_cost.scatter_of_shared(found).between(0.6, 1.3).all()
    assert 3 < synthetic_cost.scatter(found, synthetic_cost.SYNTHETIC)["ratio"].max() < 4


def test_noise_scatters_by_the_sigma_that_has_the_part_of_the_heads(found):
    both = synthetic_cost.scatter_with_heads(found)
    assert found.noise["seed"].nunique() >= 60
    assert both["noise"].between(both["low"], both["high"]).all()
    alone = both["noise"] * both["sigma"] / both["alone"]
    assert (alone > both["high"]).sum() > 5  # without that part they do not
    assert np.sqrt(np.mean(both["noise"] ** 2)) == pytest.approx(1, abs=0.07)


def test_scatter_with_heads_is_that_of_planted_noise(found):
    """Normal noise of known size, in 2000 flights of two parameters, beside a scatter of model."""
    rng = np.random.default_rng(3)
    sigma, of_heads = np.array([1.0, 2.0]), np.array([3.0, 0.5])
    exact = rng.normal(0, 4, (2000, 2))
    value = exact + rng.normal(0, 1, (2000, 2)) * np.hypot(sigma, of_heads)
    rows = [
        {"seed": i, "parameter": name, "value": value[i, k], "exact": exact[i, k]}
        | {"sigma": np.hypot(sigma[k], of_heads[k]), "sigma_before": of_heads[k]}
        for i in range(2000)
        for k, name in enumerate("ab")
    ]
    both = synthetic_cost.scatter_with_heads(replace(found, noise=pd.DataFrame(rows)))
    assert both["noise"].to_numpy() == pytest.approx(1, abs=0.06)
    assert both["exact"].to_numpy() == pytest.approx(4 / np.hypot(sigma, of_heads), rel=0.06)
    assert both["alone"].to_numpy() == pytest.approx(sigma)
    assert both["low"].iloc[0] == pytest.approx(1 - 2.81 / np.sqrt(2 * 1999), abs=0.002)


# --- the pattern of residuals


def two_heights(at_1000, at_1500, heads=("CAM1", "CAM2")):
    """Return a pattern of two nodes beside each other."""
    return pd.DataFrame(
        [
            {
                "height_m": h,
                "head": head,
                "col_px": c,
                "row_px": 0.0,
                "d_col_px": d,
                "d_row_px": 0.0,
            }
            for h, values in ((1000.0, at_1000), (1500.0, at_1500))
            for head, c, d in zip(heads, (0.0, 1.0), values, strict=True)
        ]
    )


def left(pattern, height_m):
    """What a pattern leaves at a height, as the table says."""
    study = replace(synthetic_cost.read(), pattern=pattern)
    return synthetic_cost.heights(study, [height_m]).iloc[0]


def test_a_pattern_in_proportion_to_1_over_h_is_followed_to_any_height():
    pattern = two_heights((3.0, -6.0), (2.0, -4.0))
    found = synthetic_cost.at_height(pattern, 3000.0)
    assert found["d_col_px"].tolist() == pytest.approx([1.0, -2.0])
    row = left(pattern, 3000.0)
    assert row["largest (px)"] == pytest.approx(2.0)
    assert row["largest step at a seam (px)"] == pytest.approx(3.0)
    assert row["RMS (px)"] == pytest.approx(np.sqrt(5 / 4))


# --- the lever arm


def test_it_is_the_least_squares_factor_over_the_frame():
    size, f, side = np.array([60.0, 80.0]), 70.0, 0.2
    axes = [(np.arange(n) + 0.5) / n - 0.5 for n in (200, 300)]
    t = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2) * size / f
    d = np.sign(t) * side / 2
    expected = np.linalg.lstsq(t.reshape(-1, 1), d.ravel(), rcond=None)[0][0]
    assert synthetic_cost.apparent_rise_m(side, f, size) == pytest.approx(expected, rel=1e-4)


def test_it_explains_the_exact_lever_arm_but_for_an_eighth():
    z = synthetic_cost.read().squares.query("parameter == 'lever_z_m'").set_index("side_m")["value"]
    size = np.ptp(printed.corners("SYN"), axis=0)
    rise = synthetic_cost.apparent_rise_m(0.16, 74.44, size)
    # the points do not fill the frame evenly, and GNSS positions have a say
    assert z.loc[0.16] - z.loc[0] == pytest.approx(rise, rel=0.15)
    assert z.loc[0.08] - z.loc[0] == pytest.approx((z.loc[0.16] - z.loc[0]) / 2, abs=0.001)
    assert z.loc[0] == pytest.approx(synthetic_cost.true_centre_m()[2], abs=0.01)


# --- Tables of what the synthetic image costs


def test_a_step_on_the_ground_is_its_pixels_times_the_ground_pixel(found):
    row = synthetic_cost.heights(found, [1000.0]).iloc[0]
    step, ground = row["largest step at a seam (px)"], row["that step on the ground (cm)"]
    assert ground / step == pytest.approx(100 * 1000 * 5.6e-3 / 74.4404)


def test_a_shift_follows_the_lever_arm_wherever_the_lens_centres_are(found):
    table = synthetic_cost.shifts(found)
    assert table["lever_z_m"].between(-0.21, 0.05).all()
    for name in synthetic_cost.SHIFTED:
        assert table[name].to_numpy() == pytest.approx(table[f"expected_{name}"], abs=5e-5)  # mm
    # at one flying height it would be -f z / H, with H between those of the block
    ratio = -table["f_mm"] / table["lever_z_m"] / 74.44
    assert ratio[table["lever_z_m"].abs() > 0.1].between(1 / 1500, 1 / 1000).all()


def test_the_papers_shifts_stand_in_the_last_row(found):
    last = synthetic_cost.shifts_beside_print(found).loc["paper"]
    assert last["f (mm)"] == pytest.approx(0.0107)
    assert last["lever arm z (m)"] == -0.201
