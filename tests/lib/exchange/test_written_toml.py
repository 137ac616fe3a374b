"""TOML that is written is read back as it was."""

import datetime as dt
import tomllib

from acx4lib.exchange import written_toml


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
