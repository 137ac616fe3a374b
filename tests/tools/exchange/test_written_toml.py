"""TOML that is written is read back as it was."""

import datetime as dt
import tomllib

from acx4tools.exchange import written_toml


def test_nested_tables_come_back():
    values = {
        "name": 'a "quoted"\nname \x7f',
        "n": 3,
        "x": 1e-12,
        "yes": True,
        "day": dt.date(2025, 1, 2),
        "cameras": {"C 1": {"f": 1.5}, "é": {"heads": ["a", "b"]}},
        "points": [[float(i), 0.5] for i in range(12)],
        "empty": {},
    }
    assert tomllib.loads(written_toml.written(values)) == values


def test_tables_of_one_name_may_stand_on_a_line_each():
    values = {"block": {"strips": {"a": {"n": 1}, "b": {"n": 2}}}}
    text = written_toml.written(values, inline="strips")
    assert "a = {n = 1}\n" in text
    assert tomllib.loads(text) == values


REMARKS = """\
# A flight.
crs = "EPSG:1"  # the map

[cameras.CAM]  # the only one
# focal_mm = 74.0  # about
pixel_um = 5.0

[apriori]
image_point_px = 0.5
"""


def test_values_are_added_between_the_remarks():
    values = {
        "crs": "EPSG:2",
        "heights": 1.5,
        "cameras": {"CAM": {"focal_mm": 50.5, "k1": 1e-6}, "B 2": {"pixel_um": 4.0}},
    }
    assert (
        written_toml.added(REMARKS, values)
        == """\
# A flight.
crs = "EPSG:2"  # the map
heights = 1.5

[cameras.CAM]  # the only one
focal_mm = 50.5  # about
pixel_um = 5.0
k1 = 1e-06

[apriori]
image_point_px = 0.5

[cameras."B 2"]
pixel_um = 4.0
"""
    )


def test_a_form_that_is_not_edited_line_by_line_is_written_anew():
    before = 'cameras = {A = {b1 = 1}}  # inline\nname = """a\nheights = 2\n"""\n'
    values = {"cameras": {"A": {"k1": 2.0}}, "heights": 3.0}
    after = tomllib.loads(written_toml.added(before, values))
    name = "a\nheights = 2\n"
    assert after == {"cameras": {"A": {"b1": 1, "k1": 2.0}}, "name": name, "heights": 3.0}
