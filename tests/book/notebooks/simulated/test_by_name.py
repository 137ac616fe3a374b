"""Simulated flights by the name of a design or the file of a plan."""

import pytest

from acx4book.notebooks.simulated import by_name
from acx4lib.errors import FlightError
from acx4lib.planning import text
from acx4sim.plan import Options
from support.flights.planned import values


def test_a_design_and_a_plan_are_flown_by_their_seed(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(text.written(values()))
    by_name.check("single-head")
    by_name.check(str(path))
    for name in ("single-head", str(path)):
        first, again, other = (by_name.fly(name, seed=seed) for seed in (1, 1, 2))
        table = "calibration/trajectory.csv"
        assert first.tables[table].equals(again.tables[table])
        assert not first.tables[table].equals(other.tables[table])


def test_what_is_neither_is_named(tmp_path):
    with pytest.raises(ValueError, match="unknown flight 'acx5'; known: acx4, "):
        by_name.fly("acx5", seed=1)
    with pytest.raises(FlightError, match=r"none\.toml"):
        by_name.check(str(tmp_path / "none.toml"))


def test_refraction_by_an_option_is_for_designs(tmp_path):
    path = tmp_path / "p.toml"
    path.write_text(text.written(values()))
    with pytest.raises(ValueError, match='in a plan write refraction = "standard"'):
        by_name.fly(str(path), seed=1, options=Options(refraction="standard"))
