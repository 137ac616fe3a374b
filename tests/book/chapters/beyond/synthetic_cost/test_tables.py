"""Tables of what the synthetic image costs."""

import pytest

from acx4book.chapters.beyond.synthetic_cost import study, tables


@pytest.fixture(scope="module")
def found():
    return study.read()


def test_accuracy_has_points_and_pairs_by_axis(found):
    table = tables.accuracy(found)
    assert [over for over, _ in table.index] == ["points"] * 3 + ["pairs"] * 3
    own = study.accuracy(found)
    assert list(table["larger by (%)", "value"]) == list(own["percent"])
    assert list(table["RMS (m)", "rig"]) == list(own["rms_rig"])


def test_parameters_are_those_over_flights(found):
    table = tables.parameters(found)
    assert len(table) == 14
    own = study.scatter(found, study.SYNTHETIC).set_index("parameter").loc["lever_z_m"]
    row = table.loc[("lever z", "m")]
    assert row["mean and scatter over flights", "value"] == own["mean"]
    assert row["scatter over stated σ", "value"] == own["ratio"]


def test_both_parts_of_sigma_stand_beside_the_scatter(found):
    table = tables.with_heads(found)
    own = study.scatter_with_heads(found).loc["xp_mm"]
    row = table.loc[("xp", "mm")]
    assert row["σ of the heads"] == own["sigma_of_heads"]
    assert row["of noise alone"] == own["noise"]


def test_a_step_on_the_ground_is_its_pixels_times_the_ground_pixel(found):
    row = tables.heights(found, [1000.0]).iloc[0]
    step, ground = row["largest step at a seam (px)"], row["that step on the ground (cm)"]
    assert ground / step == pytest.approx(100 * 1000 * 5.6e-3 / 74.4404)


def test_the_best_height_is_between_those_of_the_table(found):
    table = tables.heights(found)
    assert table["flying height (m)"][table["RMS (px)"].idxmin()] == 1500.0


def test_squares_lead_to_the_flown_one(found):
    table = tables.squares(found)
    titles = ["square of 0 cm", "square of 8 cm", "square of 16 cm"]
    assert list(dict.fromkeys(title for title, _ in table.columns)) == titles
    assert list(tables.factors(found)) == titles


def test_a_shift_follows_the_lever_arm_wherever_the_lens_centres_are(found):
    table = tables.shifts(found)
    assert table["lever_z_m"].between(-0.21, 0.05).all()
    for name in tables.SHIFTED:
        assert table[name].to_numpy() == pytest.approx(table[f"expected_{name}"], abs=5e-5)  # mm
    # at one flying height it would be -f z / H, with H between those of the block
    ratio = -table["f_mm"] / table["lever_z_m"] / 74.44
    assert ratio[table["lever_z_m"].abs() > 0.1].between(1 / 1500, 1 / 1000).all()


def test_the_papers_shifts_stand_in_the_last_row(found):
    last = tables.shifts_beside_print(found).loc["paper"]
    assert last["f (mm)"] == pytest.approx(0.0107)
    assert last["lever arm z (m)"] == -0.201
