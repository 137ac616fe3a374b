"""Tables of what the synthetic image costs."""

import pytest

from acx4book.chapters.beyond.synthetic_cost import study, tables


@pytest.fixture(scope="module")
def found():
    return study.read()


def test_accuracy_has_points_and_pairs_by_axis(found):
    table = tables.accuracy_table(found)
    assert table["Over"].tolist() == ["points"] * 3 + ["pairs"] * 3
    assert set(tables.ACCURACY_FORMATS) <= set(table)


def test_parameters_stand_beside_the_printed_ones(found):
    table = tables.parameter_table(found)
    row = table[table["Parameter"].str.contains("f\\$")].iloc[0]
    assert row["Paper's Table 3"] == "74.4404 ± 0.0010"
    assert len(table) == 14


def test_a_step_on_the_ground_is_its_pixels_times_the_ground_pixel(found):
    row = tables.height_table(found, [1000.0]).iloc[0]
    step, ground = row["Largest step at a seam (px)"], row["That step on the ground (cm)"]
    assert ground / step == pytest.approx(100 * 1000 * 5.6e-3 / 74.4404)


def test_squares_lead_to_the_flown_one(found):
    table = tables.square_table(found)
    assert list(table) == [
        *("Parameter", "Square of 0 cm", "Square of 8 cm", "Square of 16 cm", "Paper's Table 3")
    ]


def test_a_shift_follows_the_lever_arm_wherever_the_lens_centres_are(found):
    table = tables.shifts(found)
    assert table["lever_z_m"].between(-0.21, 0.05).all()
    for name in tables.SHIFTED:
        assert table[name].to_numpy() == pytest.approx(table[f"expected_{name}"], abs=5e-5)  # mm
    # at one flying height it would be -f z / H, with H between those of the block
    ratio = -table["f_mm"] / table["lever_z_m"] / 74.44
    assert ratio[table["lever_z_m"].abs() > 0.1].between(1 / 1500, 1 / 1000).all()


def test_the_papers_shifts_stand_in_the_last_row(found):
    last = tables.shift_table(found).iloc[-1]
    assert last["$f$ (mm)"] == "+0.0107"
    assert last["Lever arm $z$ (m)"] == "\N{MINUS SIGN}0.201"
