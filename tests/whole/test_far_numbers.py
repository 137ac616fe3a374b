"""Flights of which one number is far from all others: a run ends with its results, or in words."""

import csv
import shutil

import pandas as pd
import pytest

from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4lib.errors import Acx4Error
from acx4lib.results import folder
from support.fuzz.flights import write_good


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return {path.name: path for path in write_good(tmp_path_factory.mktemp("good") / "flights")}


def spoilt(good, folder, table, row, column, cell):
    """Return a copy of a flight with another number in a table."""
    flight = shutil.copytree(good, folder / "flight")
    path = flight / table
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    rows[row][rows[0].index(column)] = cell
    with path.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)
    return flight


def ended(flight, results):
    """Return the sentences with which a run ends."""
    try:
        outcome = runner.run(flight, results, way=Functions())
    except Acx4Error as error:
        return [*getattr(error, "__notes__", ()), *str(error).splitlines()]
    return list(outcome.not_determined)


@pytest.mark.repeats
def test_a_position_on_the_equator_stops_data_snooping_and_no_linear_algebra(good, tmp_path):
    """Variance components of the two-step method met points without coordinates."""
    row = ("calibration/trajectory.csv", 4, "lat_deg", "0")
    said = " ".join(ended(spoilt(good["simulated"], tmp_path, *row), tmp_path / "results"))
    assert "C1-04" in said
    assert "did not converge" not in said


def test_check_points_that_rays_meet_off_the_map_are_counted_and_the_others_compared(
    good, tmp_path
):
    row = ("validation/trajectory.csv", 3, "east_m", "0")
    ended(spoilt(good["in_heads"], tmp_path, *row), tmp_path / "results")
    pairs = pd.read_csv(tmp_path / "results/validation.csv")
    assert len(pairs)
    assert pairs.notna().all(axis=None)
    entries = folder.entries(tmp_path / "results")
    assert all(e["n_failed_pairs"] for n, e in entries.items() if n.startswith("validation/"))


def test_a_camera_that_looks_at_the_horizon_leaves_the_other_images_compared(good, tmp_path):
    """The joint covariance of the check points was singular in numbers."""
    row = ("validation/trajectory.csv", 5, "phi_deg", "-45")
    assert ended(spoilt(good["in_heads"], tmp_path, *row), tmp_path / "results") == []
    assert len(pd.read_csv(tmp_path / "results/check_points.csv"))
