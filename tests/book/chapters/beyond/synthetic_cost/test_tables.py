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
    assert row["Table 3"] == "74.4404 ± 0.0010"
    assert len(table) == 14


def test_a_step_on_the_ground_is_its_pixels_times_the_ground_pixel(found):
    row = tables.height_table(found, [1000.0]).iloc[0]
    step, ground = row["Largest step at a seam (px)"], row["That step on the ground (cm)"]
    assert ground / step == pytest.approx(100 * 1000 * 5.6e-3 / 74.4404)


def test_squares_lead_to_the_flown_one(found):
    table = tables.square_table(found)
    assert list(table) == [
        *("Parameter", "Square of 0 cm", "Square of 8 cm", "Square of 16 cm", "Table 3")
    ]
