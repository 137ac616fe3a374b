"""Chapter 0 changed as it suggests: one line, and everything below follows."""

import numpy as np
import pytest

import acx4sim
from support.changed_notebook import changed

READ = "flight = acx.read(flight_path, pictures=pictures_path)\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What the cells define, by what happens to every block."""
    path = tmp_path_factory.mktemp("flight") / "small"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)

    def one(part="", *arguments):
        blocks = f"{{n: design.{part}({', '.join(('b', *arguments))}) for n, b in flight.blocks.items()}}"  # noqa: E501
        line = f"flight = replace(flight, blocks={blocks})\n" if part else ""
        return changed("00", {READ: READ + line}, flight_path=path)

    return one


@pytest.fixture(scope="module")
def as_it_is(run):
    return run()


def test_the_height_by_hand_is_the_librarys(as_it_is):
    block = as_it_is["flight"].calibration
    heights = as_it_is["flying_heights"](block)
    assert as_it_is["by_hand"]["H by hand (m)"] == pytest.approx(heights[0], abs=1e-6)


def test_from_one_height_every_block_has_one_level(run, as_it_is):
    lowest = run("lowest_height")
    assert list(as_it_is["flown"].loc["calibration"].index) == [1, 2]
    assert list(lowest["flown"].index) == [("calibration", 1), ("validation", 1)]
    seen = [names["contents"]["images per point"]["calibration"] for names in (as_it_is, lowest)]
    assert seen[1] < seen[0]


def test_without_the_first_strip_a_level_of_every_block_has_one_less(run, as_it_is):
    fewer = run("without_strips", "{b.images.strips[0]}")
    before, after = (names["flown"]["strips"].groupby("block").sum() for names in (as_it_is, fewer))
    assert (before - after == 1).all()


def test_without_control_its_points_are_tie_points_and_heights_are_not_known(run, as_it_is):
    without = run("without_control")
    before, after = (names["contents"].loc["calibration"] for names in (as_it_is, without))
    assert after["control points"] == 0
    assert after["tie points"] == before["tie points"] + before["control points"]
    heights = without["flown"]["height above ground (m)"]
    assert np.isnan(heights["calibration"]).all()
    assert heights["validation"].notna().all()  # it has check points
