"""What notebook 02 says of its changes is seen in its tables."""

import shutil

import pytest

from acx4book.chapters.synthetic_image import tables
from acx4book.typesetting.tables import markdown
from acx4lib import flight as flights
from acx4lib.stages import heads
from support.changed_notebook import changed
from support.flights import in_heads, pictured
from support.helpers import repeats

READ = "orientation = synthetic.read_heads(flight, results_path)"
TIED = "ties = matched.ties if matched else shared_points(flight.heads, orientation)"
MATCHED = "matched = find(pictures, orientation) if pictures else None"
TURNED = (
    "orientation = replace(orientation, opk=orientation.opk"
    " + np.radians(0.01) * np.eye(len(orientation.opk), 3, -1))"
)


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    folder = tmp_path_factory.mktemp("changed")
    flight = pictured.write_flight(folder / "flight")
    return flight, pictured.write_results(folder / "results", flight)


@pytest.fixture
def run(paths, tmp_path):
    """Return what the notebook has in the end, with cells changed."""
    results = shutil.copytree(paths[1], tmp_path / "results")
    given = {"flight_path": paths[0], "results_path": results}
    return lambda changes: changed("02", changes, **given)


@pytest.fixture(scope="module")
def unchanged(paths, tmp_path_factory):
    results = shutil.copytree(paths[1], tmp_path_factory.mktemp("unchanged") / "results")
    return changed("02", flight_path=paths[0], results_path=results)


def turns(found):
    return tables.turns(found["refinement"]).xs("value", axis=1, level=1).loc["RIGHT"]


def test_a_pixel_by_hand_is_the_librarys(unchanged):
    assert abs(unchanged["by_hand"] - unchanged["library"]).max() < 1e-4


def test_heads_that_are_turned_are_turned_back(unchanged, run):
    other = run({READ: f"{READ}\n{TURNED}"})
    before, after = unchanged["left"][tables.RMS], other["left"][tables.RMS]
    assert after["as calibrated"] > 3 * before["as calibrated"]
    assert after["three rotations"] == pytest.approx(before["three rotations"], rel=0.01)
    back = turns(other) - turns(unchanged)
    assert back.tolist() == pytest.approx([-10, 0, 0], abs=0.05)


def test_tie_points_that_are_believed_less_halve_sigma0(unchanged, run):
    other = run({TIED: f"{TIED}\nties = replace(ties, sigma_px=2 * ties.sigma_px)"})
    before, after = (found["left"].loc["three rotations"] for found in (unchanged, other))
    assert after["σ₀"] == pytest.approx(before["σ₀"] / 2, rel=1e-6)
    assert after[tables.RMS] == pytest.approx(before[tables.RMS], rel=1e-6)


def test_points_that_were_measured_are_fewer_than_those_of_the_pictures(unchanged, run):
    other = run({MATCHED: "matched = None"})
    assert other["numbers"]["n"] < unchanged["numbers"]["n"]
    assert other["left"][tables.RMS]["three rotations"] < 0.001  # they are exact in this flight
    assert tables.EACH in unchanged["left"].index
    assert tables.EACH not in other["left"].index


# --- flights that lack something ---------------------------------------------------------------

FLIGHT = "flight = acx.read(flight_path, pictures=pictures_path)"
BLOCK = (
    f"{FLIGHT}\nblock = flight.blocks['heads']\nflight = replace(flight, blocks={{'heads': %s}})"
)
LACKING = {
    "nothing is measured": "replace(block, image_points=block.image_points[:0])",
    "one head is measured": (
        "replace(block, image_points=block.image_points["
        "block.images.camera_idx[block.image_points.image_idx] == 0])"
    ),
    "no control": "replace(block, control=block.control[:0])",
}


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """A flight of two heads that are not the paper's, without pictures; and results of them."""
    folder = tmp_path_factory.mktemp("other")
    flight = in_heads.write_other_heads(folder / "flight")
    heads.run(flights.read(flight), folder / "results")
    return flight, folder / "results"


@pytest.mark.parametrize(
    "lacking", [repeats(one) if one == "no control" else one for one in LACKING]
)
def test_flights_that_lack_something_go_through(other, tmp_path, lacking):
    results = shutil.copytree(other[1], tmp_path / "results")
    change = {FLIGHT: BLOCK % LACKING[lacking]}
    found = changed("02", change, flight_path=other[0], results_path=results)
    assert (found["numbers"]["n"] > 0) == (lacking == "no control")
    assert bool(found["apart"]) == (lacking != "no control")  # heights over control points
    assert "ended" not in found
    for table in (found["left"], (found["matched"] or found["ties"]).table()):
        assert len(table) > 0 or found["numbers"]["n"] == 0
        assert markdown(table).startswith("|") or not len(table)
