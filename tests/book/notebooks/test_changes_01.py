"""Chapter 1 changed as it suggests: one line, and everything below follows."""

import numpy as np
import pytest

import acx4sim
from support.changed_notebook import changed

CHOICES = "names, model = flight.head_names, flight.heads_model\n"
BLOCK = "block = flight.heads\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What the cells define, by a changed cell; each into results of its own."""
    flight = tmp_path_factory.mktemp("flight") / "heads"
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 100})
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=1, options=options), flight)

    def one(after=BLOCK, line=""):
        results = tmp_path_factory.mktemp("results")
        change = {after: f"{after}{line}\n"}
        return changed("01", change, flight_path=flight, results_path=results)

    return one


@pytest.fixture(scope="module")
def as_it_is(run):
    return run()


def sigmas(table, parameter):
    return table["sigma"].xs(parameter, level="parameter").to_numpy()


def test_the_equations_by_hand_are_the_librarys(as_it_is):
    np.testing.assert_allclose(as_it_is["left"], as_it_is["right"], atol=1e-6)
    hand = as_it_is["hand"]
    np.testing.assert_allclose(
        hand.loc["mean"].astype(float), hand.loc["library"].astype(float), atol=1e-9
    )


def test_an_estimated_focal_length_comes_near_the_one_that_gnss_asks_for(run, as_it_is):
    free = run(CHOICES, 'model = replace(model, free=("f", *model.free))')
    found = free["interior"].xs("f", level="parameter")
    assert np.all((found["sigma"] > 0.02) & (found["sigma"] < 0.5))
    asked = [as_it_is["asked"][head] for head in found.index.get_level_values("camera")]
    assert np.all(np.abs(found["value"] - asked) < 4 * found["sigma"])
    for table, parameter in (("relative", "Zc"), ("interior", "xp")):
        before, after = (sigmas(names[table], parameter) for names in (as_it_is, free))
        assert np.all(after > 1.02 * np.nan_to_num(before))
    assert np.all(np.isnan(sigmas(as_it_is["interior"], "f")))


def test_from_one_height_all_standard_deviations_grow(run, as_it_is):
    lowest = run(BLOCK, "block = design.lowest_height(block)")
    assert lowest["quality"]["measured points"].sum() < as_it_is["quality"]["measured points"].sum()
    before, after = (names["interior"]["sigma"].dropna() for names in (as_it_is, lowest))
    assert np.all(after > before)
