"""The list of what was chosen is complete, and its values are those of the flight."""

import html
import json
import re

import nbformat
import numpy as np
import pandas as pd
import pytest

from acx4book.chapters import synthetic_cost
from acx4book.pages import study
from acx4book.paper import printed
from acx4book.typesetting.myst import LABELS
from acx4files.results import folder
from acx4lib.geometry.parameters import REPORTED
from support import run_results
from support.flights.simulated import fly
from support.helpers import ROOT, write_notebook


@pytest.fixture(scope="module")
def acx4():
    flown = fly("acx4-ideal", seed=1)
    return study.simulation_page(flown.flight, flown.truth)


# --- The accuracy that the front page tells is that of all stored flights


STORED = synthetic_cost.STORED


@pytest.fixture(scope="module")
def ideal():
    return study.of_ideal(STORED, "single_step")


def test_the_median_is_that_of_all_flights_and_not_of_one(ideal):
    assert len(ideal) == 200
    assert np.median(ideal["height"]) == pytest.approx(0.314, abs=0.001)
    assert np.sqrt(np.mean(ideal["height"] ** 2)) == pytest.approx(0.335, abs=0.001)


def test_class_a_is_reached_in_part_of_the_flights(ideal):
    assert ideal["height_5000"].mean() == pytest.approx(0.56, abs=0.01)
    assert study.of_ideal(STORED, "two_step")["height_5000"].mean() == pytest.approx(0.48, abs=0.01)


# --- One verdict on the two methods, from a run and from stored flights


def test_the_verdict_has_the_ratios_of_sigma_and_slow_errors_of_all_stored_flights(tmp_path):
    results = run_results.leave_results(tmp_path)[1]
    found = folder.read(results)
    said = study.methods_page(found, "CAM", synthetic_cost.STORED)
    sigma = {
        m: folder.parameters(found, f"mounting/{m}", "CAM")["sigma"]
        for m in ("two_step", "single_step")
    }
    ratio = sigma["two_step"]["f_mm"] / sigma["single_step"]["f_mm"]
    assert f"{ratio:.0f} times smaller" in said
    rms = json.loads((results / "summary.json").read_text())["validation/single_step"]
    assert f"{rms['points']['rms'][2]:.2f} m in height with the single step" in said
    middle = study.of_ideal(STORED, "single_step")["height"].median()
    assert f"and {middle:.2f} m in height with the single step" in said
    errors = pd.read_csv(synthetic_cost.STORED / "slow_errors.csv")
    assert f"Over {errors['seed'].nunique()} flights" in said
    assert "2.3 to 4.9 times its standard deviation" in said


# --- What a simulated flight was given is said from its truth, and from nothing else


def test_the_true_values_are_those_of_the_truth(acx4):
    f = printed.value(3, "f_mm", "single_step")
    assert f"| {f:.4f} |" in acx4
    f = fly("acx4-ideal", seed=1).truth["cameras"]["CAM1"]["f_mm"]
    assert f"{f:.4f} mm, follows from the paper's Table 3" in acx4


def test_a_flight_without_truth_is_not_said_to_be_simulated():
    flight = fly("single-head", seed=1).flight
    page = study.simulation_page(flight, None)
    assert "no truth beside it" in page
    assert "is simulated" not in page


# --- The page on which geometry determines which parameter


@pytest.fixture(scope="module")
def geometry():
    """The limit of sigma and the geometry of the page, by the parameters of a row."""
    page = html.unescape(study.geometry_page()).replace("\N{NO-BREAK SPACE}", " ")
    assert ":name: tab-geometry" in page
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("|")]
    return {names: told for names, *told in rows[2:]}


def test_every_parameter_stands_once_among_those_that_need_a_geometry(geometry):
    listed = ", ".join(geometry).split(", ")
    assert sorted(listed) == sorted(LABELS[name] for name, _ in REPORTED.values())


# --- Chapters that depend on no flight, with two small ones in the place of the book's


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """A working copy with two chapters; each run of one leaves a line in its file."""
    for name in ("01-one", "02-two"):
        ran = f"from pathlib import Path\nprint('a', file=Path('ran-{name}').open('a'))"
        write_notebook(tmp_path / "notebooks" / f"{name}.ipynb", "seed: int = 1", ran)
    (tmp_path / "environment.lock").write_text("numpy==2\n")
    (tmp_path / "data.csv").write_text("1\n")
    (tmp_path / "executed").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(study, "NOTEBOOKS_PATH", tmp_path / "notebooks")
    monkeypatch.setattr(study, "CHAPTERS", {"01-one": ("data.csv",), "02-two": ()})
    return tmp_path


def runs(copy):
    return [
        len(path.read_text().splitlines()) if (path := copy / f"ran-{name}").is_file() else 0
        for name in ("01-one", "02-two")
    ]


def test_they_run_once_until_what_they_depend_on_changes(copy):
    for _ in range(2):
        assert study.bring(copy / "executed", copy / "ideal") == []
    assert runs(copy) == [1, 1]
    (copy / "data.csv").write_text("2\n")
    assert study.bring(copy / "executed", copy / "ideal") == []
    assert runs(copy) == [2, 1]
    assert len(list((copy / study.KEPT).iterdir())) == 2
    page = nbformat.read(copy / "executed" / "01-one.ipynb", as_version=4)
    assert page.cells[0].metadata.tags == ["parameters"]


def contents(folder):
    """Return the pages that a table of contents lists, in its order."""
    return re.findall(r"(?m)^\W*file: (\S+)$", (folder / "_toc.yml").read_text("utf-8"))


def test_every_chapter_is_in_the_contents_and_reads_files_that_are_there(monkeypatch):
    monkeypatch.chdir(ROOT)
    contents = (ROOT / "book" / "_toc.yml").read_text("utf-8")
    for name, patterns in study.CHAPTERS.items():
        assert f"_executed/{name}\n" in contents
        for pattern in patterns:
            assert pattern == "measured" or list(ROOT.glob(pattern))
