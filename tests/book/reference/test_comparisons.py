"""Data sets of others, and the comparisons with their reports."""

from __future__ import annotations

import hashlib
import re
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pandas as pd
import pytest

from acx4book.notebooks import execute
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.reference import comparisons, data, dbat_files, nist
from acx4book.reference.heads import FIVE, TEN
from support.helpers import needs

# --- The comparisons as they are stored for machines that do not have the measurements -------


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


def test_angles_agree_after_full_turns():
    printed = {("Kappa",): dbat_files.Line(text="182.6 deg", numbers=("182.6",))}
    for ours, agrees in ((dbat_files.Angle(-177.4), True), (-177.4, False)):
        assert dbat_files.compare(printed, {("Kappa",): (ours,)})["agrees"].all() == agrees


@pytest.mark.slow
def test_notebook_runs_without_the_measurements(nowhere):
    executed = nowhere / "executed" / NOTEBOOK.name
    execute.execute(NOTEBOOK, executed, parameters={"reference_path": str(nowhere)})
    assert "these are the results computed on" in executed.read_text()


# --- Where other people's files are found, and how they are fetched --------------------------


SETS = (
    *(
        "applanix_pdal",
        "dbat-camcal",
        "dbat-sxb",
        "formats",
        "ign-uce-m3",
        "nist-strd",
        "noaa-dss-dg",
        "opensfm_berlin",
    ),
    *("rededge-dual", "rededge3-flight", "sequoia-flight", "sxb-photos"),
)


class Quiet(SimpleHTTPRequestHandler):
    """Serves files without a line per request."""

    def log_message(self, *args):
        pass


@pytest.fixture
def server(tmp_path):
    """A server on this machine, and the folder that it serves."""
    folder = tmp_path / "server"
    folder.mkdir()
    httpd = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=folder))
    thread = threading.Thread(target=httpd.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{httpd.server_port}", folder
    httpd.shutdown()
    thread.join()
    httpd.server_close()


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """An empty folder in the place of the reference data."""
    folder = tmp_path / "files"
    folder.mkdir()
    monkeypatch.setenv("ACX4_REFERENCE_DATA", str(folder))
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    return folder


def publish(folder, entry, content):
    """Put a file where the repositories would have it."""
    place = folder / entry.repository / entry.commit / entry.path
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(content)


def test_index_is_complete():
    entries = data.index()
    assert {entry.file.split("/")[0] for entry in entries} == set(SETS)
    for entry in entries:
        assert len(entry.sha256) == 64
        assert entry.licence
        assert len(entry.commit) == 40
        assert entry.path


def test_a_missing_file_is_one_line_with_the_way_out(empty):
    with pytest.raises(data.ReferenceDataError) as raised:
        data.path("nist-strd/BoxBOD.dat")
    message = str(raised.value)
    assert "\n" not in message
    assert message.startswith(f"nist-strd/BoxBOD.dat is missing in {empty}: run `make reference")
    assert not data.is_here("nist-strd")


def test_another_file_of_the_same_name_is_refused(empty):
    file = empty / "nist-strd" / "BoxBOD.dat"
    file.parent.mkdir()
    file.write_text("NIST/ITL StRD\n")
    with pytest.raises(data.ReferenceDataError, match="is not the file that was indexed"):
        data.path("nist-strd/BoxBOD.dat")


@needs("ign-uce-m3")
@needs("nist-strd")
def test_files_are_fetched_selected_and_verified(server, tmp_path, monkeypatch):
    url, folder = server
    entries = {entry.file: entry for entry in data.index()}
    for file, entry in entries.items():
        if file.startswith(("ign-uce-m3/", "nist-strd/")):
            content = data.path(file).read_bytes()
            if file in data.TIE_POINTS:
                # the flight's own files: other images, points seen once, blanks at the line ends
                other = (
                    b"MES_1 23FD1305x00001_00001 1.0 2.0 \nMES_2 23FD1305x00026_01306 1.0 2.0 \n"
                )
                content = other + content.replace(b"\n", b" \n")
            publish(folder, entry, content)
    publish(folder, entries["nist-strd/Rat42.dat"], b"something else")

    files = tmp_path / "files"
    monkeypatch.setenv("ACX4_REFERENCE_DATA", str(files))
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    failed = {outcome.text.split()[0] for outcome in data.fetch(base=url) if not outcome.is_here}
    expected = {"nist-strd/Rat42.dat"} | {
        file for file in entries if not file.startswith(("ign-uce-m3/", "nist-strd/"))
    }
    assert failed == expected
    assert data.is_here("ign-uce-m3")
    for file in set(entries) - expected:
        found = hashlib.sha256(data.path(file).read_bytes()).hexdigest()
        assert found == entries[file].sha256
