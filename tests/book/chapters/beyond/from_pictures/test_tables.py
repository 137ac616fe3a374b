import pytest

from acx4book.chapters.beyond.from_pictures import tables

pytestmark = pytest.mark.repeats


def test_rows_add_up_to_all_measurements(found):
    shown = tables.pictures(found)
    total = shown["tie points"].sum() + shown["control points"].sum()
    assert total == len(found.block.image_points)
    assert shown["height (m)"].between(550, 1050).all()
    assert abs(abs(shown["heading (°)"][0] - shown["heading (°)"][2]) - 180) < 5  # opposite


def test_the_camera_has_all_parameters(found):
    assert len(tables.camera(found)) == 14
