import pytest

from acx4book.chapters.beyond.from_pictures import tables

pytestmark = pytest.mark.repeats


def test_rows_add_up_to_all_measurements(found):
    shown = tables.pictures(found.block)
    total = shown["tie points"].sum() + shown["control points"].sum()
    assert total == len(found.block.image_points)
    assert shown["height (m)"].between(550, 1050).all()
    assert abs(abs(shown["heading (°)"][0] - shown["heading (°)"][2]) - 180) < 5  # opposite


def test_every_parameter_is_within_four_sigma_of_the_truth(measured):
    found, mounting = measured
    table = tables.camera(mounting, found.truth(mounting))
    assert len(table) == 14
    assert (table["difference / σ"].abs() < 4).all()
    off = table["value"] - table["truth"].str.replace("\N{MINUS SIGN}", "-").iloc[:3].astype(float)
    assert (off.dropna().abs() < 0.01).all()
