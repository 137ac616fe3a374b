"""Weights that are estimated from the residuals do not certify mistakes."""

import pandas as pd
import pytest

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4lib.bundle.variance_components import BOUNDS, Component
from acx4lib.results import folder
from support.run_results import state

QUESTION = "Estimated weights within bounds"


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Return a function that writes a flight with other control points, or none others."""
    at = tmp_path_factory.mktemp("weights")

    def flown(name, change):
        path = at / name
        acx4sim.write(acx4sim.DESIGNS["single-head"](seed=4), path)
        toml = path / "flight.toml"
        text = toml.read_text()
        assert "[stages.mounting]\n" in text
        toml.write_text(
            text.replace("[stages.mounting]\n", '[stages.mounting]\nweights = "estimated"\n')
        )
        control = pd.read_csv(path / "control_points.csv")
        change(control)
        control.to_csv(path / "control_points.csv", index=False)
        return path

    return flown


def other_epoch(control):
    control[["east_m", "north_m"]] += [0.5, 0.5]


def scaled(control):
    for column in ("east_m", "north_m"):
        middle = control[column].mean()
        control[column] = middle + (control[column] - middle) * (1 + 400e-6)


def too_optimistic(control):
    """State sigma of three quarters of the true ones."""
    for column in ("sigma_east_m", "sigma_north_m", "sigma_height_m"):
        control[column] *= 0.75


def right(control):
    assert len(control)


@pytest.mark.parametrize("mistake", [other_epoch, scaled])
def test_a_mistake_of_control_is_no_sigma(flight, tmp_path, mistake):
    outcome = runner.run(flight(mistake.__name__, mistake), tmp_path / "r", way=Functions())
    assert any("sigma of" in note and "outside 0.33 to 1.5" in note for note in outcome.notes)
    said = state(tmp_path / "r", QUESTION)
    assert said[0] == "fails"
    assert "No result holds" in said[1]
    entry = folder.entries(tmp_path / "r")["mounting/single_step"]
    assert max(one["applied"] for one in entry["sigma_factors"].values()) > BOUNDS[1]


@pytest.mark.parametrize("change", [right, too_optimistic])
def test_sigma_that_are_wrong_are_estimated_within_the_bounds(flight, tmp_path, change):
    runner.run(
        flight(change.__name__, change), tmp_path / "r", way=Functions(), stages=["mounting"]
    )
    assert state(tmp_path / "r", QUESTION)[0] == "holds"
    assert folder.entries(tmp_path / "r")["mounting/single_step"]["sigma_beyond"] == []


def test_a_factor_is_beyond_by_its_size_and_by_more_than_chance():
    """With redundancy 5, chi-square above 20.5 has a probability of 0.1 % (tables): 2.02²."""
    group = {"group": "control plan", "n": 10, "redundancy": 8.0, "effective": 5.0}
    beyond = {
        factor: Component(**group, factor=factor, applied=factor).is_beyond
        for factor in (0.05, 0.3, 1.0, 1.6, 2.2, 48.6)
    }
    assert [factor for factor, is_so in beyond.items() if is_so] == [2.2, 48.6]
    many = {**group, "effective": 500.0, "redundancy": 500.0}
    assert Component(**many, factor=0.3, applied=0.3).is_beyond
    assert not Component(**many, factor=0.4, applied=0.4).is_beyond
