"""The comparisons as they are stored for machines that do not have the measurements."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest

from acx4book.notebooks import execute
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.reference import comparisons, dbat_files, nist
from acx4book.reference.heads import FIVE, TEN
from support.helpers import needs

NOTEBOOK = NOTEBOOKS_PATH / "05-reference-data.ipynb"

NOISY = ("digits", "units", "difference", "iterations")
"""Differences of nearly equal numbers: their own digits mean nothing."""

MATCHED = {"ten_parallax": 1e-4}
"""Tolerances, mm: float32 correlations are rounded otherwise by another processor."""


@pytest.fixture
def nowhere(tmp_path, monkeypatch):
    monkeypatch.setenv("ACX4_REFERENCE_DATA", str(tmp_path))
    return tmp_path


def stored(name):
    found = comparisons.computed_or_stored(name)
    assert "computed on" in found.origin
    return found.table


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[needs(files), *[pytest.mark.repeats] * (files in {TEN, FIVE})])
        for name, (files, _) in comparisons.COMPARISONS.items()
    ],
)
def test_stored_results_are_the_computed_ones(name, tmp_path):
    """Else `python -m acx4book.reference` was forgotten after a change."""
    computed = comparisons.COMPARISONS[name][1]()
    before = stored_in(name, tmp_path)
    if name == "nist":  # where a solution is open, nothing says what is left of it
        known = computed["outcome"] == nist.CONVERGED
        computed, before = computed[known], before[known]
    assert list(before.columns) == list(computed.columns)
    atol = MATCHED.get(name, 2e-6)
    for column in computed.columns.difference(NOISY):
        if pd.api.types.is_float_dtype(computed[column]):
            np.testing.assert_allclose(before[column], computed[column], rtol=1e-6, atol=atol)
        else:
            assert before[column].tolist() == computed[column].tolist(), column


def stored_in(name, folder):
    """Return what is stored, whatever is on this machine."""
    found = comparisons.computed_or_stored(name, folder=str(folder))
    assert re.search(r"computed on \d{4}-\d\d-\d\d with acx4lib \d", found.origin)
    return found.table


@pytest.mark.parametrize("name", comparisons.COMPARISONS)
def test_without_the_measurements_the_date_is_said(name, nowhere):
    assert len(stored(name)) > 0


def test_summary_counts_every_value_once(nowhere):
    table = stored("camcal")
    summary = dbat_files.summary(table).set_index("kind")
    assert summary.loc["all", "values"] == len(table)
    assert summary["values"].sum() == 2 * len(table)
    assert summary.loc["all", "agree"] == len(table)


def test_figures_have_a_dot_for_every_number(nowhere):
    table = stored("camcal")
    fig = comparisons.last_digits({"camcal": table})
    dots = sum(len(line.get_xdata()) for line in fig.axes[0].lines)
    assert dots == (table["kind"] != "statement").sum()


def test_angles_agree_after_full_turns():
    printed = {("Kappa",): dbat_files.Line(path=("Kappa",), statement="{} deg", numbers=("182.6",))}
    ours = {("Kappa",): dbat_files.say("{} deg", dbat_files.Angle(-177.4))}
    assert dbat_files.compare(printed, ours)["agrees"].all()
    ours = {("Kappa",): dbat_files.say("{} deg", -177.4)}
    assert not dbat_files.compare(printed, ours)["agrees"].any()


def test_counts_and_names_agree_exactly():
    printed = {("a",): dbat_files.Line(path=("a",), statement="OP {}", numbers=("65",))}
    assert dbat_files.compare(printed, {("a",): dbat_files.say("OP {}", 65)})["agrees"].all()
    assert not dbat_files.compare(printed, {("a",): dbat_files.say("OP {}", 66)})["agrees"].any()


@pytest.mark.slow
def test_notebook_runs_without_the_measurements(nowhere):
    executed = nowhere / "executed" / NOTEBOOK.name
    values = execute.with_defaults(NOTEBOOK, {"reference_path": str(nowhere)})
    execute.execute(NOTEBOOK, executed, parameters=values, on_cell=lambda *_: None)
    assert "these are the results computed on" in executed.read_text()


def test_the_answer_counts_what_is_stored(nowhere):
    names = ("camcal", "sxb", "nist", "noaa", "ign")
    found = {name: comparisons.computed_or_stored(name) for name in names}
    said = comparisons.answer(**found)
    values = sum(len(found[name].table) for name in ("camcal", "sxb"))
    assert re.findall(r"(\d+) of (\d+)", said) == [
        (f"{values}", f"{values}"),
        ("39", "40"),  # BoxBOD does not converge from its far start
    ]
    assert "680 tie points" in said
