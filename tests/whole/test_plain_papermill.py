"""The notebooks of the stages, run by papermill itself with the usual kernel."""

import itertools
import re
import shutil

import nbformat
import papermill
import pytest

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4book.pages import release
from acx4lib.flight import reader
from acx4lib.results import provenance
from acx4lib.results.folder import STAGES
from acx4lib.results.table_files import NOTEBOOKS
from support.flights import in_heads
from support.helpers import ROOT, repeats

pytestmark = pytest.mark.slow

WITHOUT_HEADS = {
    "01-head-calibration": "the flight has no block heads",
    "02-synthetic-image": "the flight has no block heads",
    "08-rig": "there are no heads",
}
USUAL = {"mounting": "03-mounting-calibration"}
"""Notebooks that are run in the usual tests, on a flight of one camera, by their stages.

What is downloaded below runs that of the validation."""

DIRECTIVE = re.compile(r"^\s*(`{3,}|:{3,})\{", re.MULTILINE)


@pytest.fixture(scope="module", params=["single", repeats("heads"), repeats("single, all")])
def ran(request, tmp_path_factory):
    """The name of a flight, a folder with its results, and the outputs of every notebook."""
    at = tmp_path_factory.mktemp(request.param)
    heads = request.param == "heads"
    flown = in_heads.small() if heads else acx4sim.DESIGNS["single-head"](seed=1)
    acx4sim.write(flown, at / "flight")
    (at / "empty").mkdir()
    stages = USUAL if request.param == "single" else NOTEBOOKS
    outputs = {name: run(at, name, "results") for name in stages.values()}
    assert not list((at / "empty").iterdir())
    return request.param, at, outputs


def run(at, name, results, **parameters):
    """Run a notebook in an empty folder; return the outputs of its cells."""
    given = {"flight_path": str(at / "flight"), "results_path": str(at / results)}
    out = at / f"{name}.ipynb"
    papermill.execute_notebook(
        ROOT / "notebooks" / f"{name}.ipynb",
        out,
        parameters={**given, **parameters},
        cwd=at / "empty",
        kernel_name="python3",
        progress_bar=False,
    )
    cells = nbformat.read(out, as_version=4).cells
    return [output for cell in cells for output in cell.get("outputs", [])]


def test_every_figure_is_an_image_and_nothing_is_an_error(ran):
    for output in itertools.chain(*ran[2].values()):
        assert output.output_type in ("display_data", "execute_result")
        if "<Figure" in output.data.get("text/plain", ""):
            assert "image/png" in output.data


def test_no_output_has_a_directive(ran):
    shown = itertools.chain(*ran[2].values())
    text = [o.data[kind] for o in shown for kind in o.data if kind.startswith("text/")]
    assert not [one for one in text if DIRECTIVE.search(one)]


def test_a_block_that_is_not_there_ends_a_notebook_in_one_sentence(ran):
    name, _, outputs = ran
    for notebook, reason in WITHOUT_HEADS.items() if name == "single, all" else ():
        (shown,) = outputs[notebook]
        assert shown.data["text/markdown"] == f"This notebook ends here: {reason}."


def test_the_results_are_those_of_a_run_and_name_the_flight(ran):
    kind, at, _ = ran
    stages = [*USUAL] if kind == "single" else STAGES
    runner.run(at / "flight", at / "by_run", way=Functions(), stages=stages)
    plain, by_run = (
        {p.relative_to(at / name): p.read_bytes() for p in (at / name).rglob("*") if p.is_file()}
        for name in ("results", "by_run")
    )
    assert plain == by_run
    said = provenance.read_run(at / "results")
    assert said.provenance.files == provenance.checksums(reader.read(at / "flight"))


def test_report_export_and_compare_take_the_results(ran, acx4, tmp_path):
    kind, at, _ = ran
    results = shutil.copytree(at / "results", tmp_path / "results")
    assert acx4("report", results, "--out", tmp_path / "report.html")[0] in (0, 1)  # by its verdict
    assert (tmp_path / "report.html").is_file()
    assert acx4("export", results, "--to", "toml", "--out", tmp_path / "exported")[0] == 0
    if kind == "single, all":
        acx4sim.write(acx4sim.DESIGNS["single-head"](seed=2), tmp_path / "flight2")
        runner.run(tmp_path / "flight2", tmp_path / "results2", way=Functions())
        assert acx4("compare", results, tmp_path / "results2", "--out", tmp_path / "c")[0] in (0, 1)


@pytest.mark.parametrize("name", ["04-validation", repeats("02-synthetic-image")])
def test_a_stage_alone_says_in_its_last_line_what_to_run_first(ran, name):
    kind, at, _ = ran
    if kind != "heads" and name in WITHOUT_HEADS:
        pytest.skip("ends in a sentence")
    with pytest.raises(papermill.PapermillExecutionError) as caught:
        run(at, name, "none")
    assert "run first: notebook 0" in str(caught.value).strip().splitlines()[-1]


@pytest.mark.repeats
@pytest.mark.parametrize("name", NOTEBOOKS.values())
def test_an_unknown_parameter_is_named_in_the_last_line(ran, name):
    kind, at, _ = ran
    if kind != "heads":
        pytest.skip("shown with the other flight")
    with pytest.raises(papermill.PapermillExecutionError) as caught:
        run(at, name, "none", flight=str(at / "flight"))
    last = str(caught.value).strip().splitlines()[-1]
    assert last.startswith("ValueError: unknown parameter flight; this notebook has flight_path")


def test_a_download_of_the_book_makes_what_it_lacks_and_its_results_are_a_run(tmp_path):
    release.write(tmp_path / "downloads")
    (tmp_path / "empty").mkdir()
    out = tmp_path / "out.ipynb"
    papermill.execute_notebook(
        tmp_path / "downloads" / "04-validation.ipynb",
        out,
        cwd=tmp_path / "empty",
        kernel_name="python3",
        progress_bar=False,
    )
    assert "image/png" in out.read_text(encoding="utf-8")
    said = provenance.read_run(tmp_path / "empty" / "results-04-validation").provenance
    assert set(said.stages) == {"mounting", "validation"}
