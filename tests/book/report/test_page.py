"""The report as JSON: the values of the results, whole and without NaN."""

import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
from bs4 import BeautifulSoup
from numpy.testing import assert_allclose
from pypdf import PdfReader

from acx4book.report import findings, page, typeset
from acx4book.report.material import image_residuals, read
from acx4book.report.page import DIRECTIVE, PAGE_MARK, TEXT, computed
from acx4files.results import folder
from acx4lib.errors import FlightError, OutputError
from support.helpers import ROOT
from support.run_results import SINGLE, edit


@pytest.fixture(scope="module")
def told(run):
    text = page.text(run, findings.findings(run))
    assert page.MARK in text.encode()[:4096]
    return json.loads(text, parse_constant=pytest.fail)


def test_parameters_and_covariance_are_those_of_the_results(run, told):
    method = told["methods"][told["calibration"]]
    cov = folder.covariance(run.found, SINGLE)
    assert method["parameters"] == list(cov.index)
    assert_allclose(method["covariance_matrix"], cov, rtol=1e-15)
    sigma = np.sqrt(np.diag(cov))
    assert_allclose(method["correlation_matrix"], cov / sigma / sigma[:, None], atol=1e-12)
    camera = method["cameras"]["CAM"]
    rows = folder.parameters(run.found, SINGLE, "CAM")
    assert {k: v["value"] for k, v in camera["parameters"].items()} == dict(rows["value"])
    assert camera["interior"]["f_mm"] == rows.loc["f_mm", "value"]
    assert camera["corners"][0]["x_mm"] < 0 < camera["corners"][0]["y_mm"]


def test_the_statement_is_that_of_the_page(run, told):
    found = findings.findings(run)
    assert [f["question"] for f in told["statement"]["findings"]] == [f.question for f in found]
    assert told["statement"]["holds"] is True
    assert (told["statement"]["level"], told["statement"]["procedure"]) == (0.05, "Holm")
    by_question = {f["question"]: f for f in told["statement"]["findings"]}
    assert by_question["Convergence"]["p"] is None
    tested = by_question["Boresight stable over time"]
    assert tested["p"] == min(test["p"] for test in tested["tests"])
    assert tested["p"] < tested["p_joint"] <= 1
    assert not any(test["fails"] for test in tested["tests"])
    assert any("MTF" in one for one in told["statement"]["not_examined"])
    assert (
        told["check_points"]["n_points"] == run.found.summary["validation/single_step"]["n_points"]
    )
    assert told["certificate"] == {}


def test_every_key_is_explained(told):
    page = (ROOT / "book" / "results.md").read_text(encoding="utf-8")
    section = page[page.index("(certificate)=") :]
    camera = told["methods"][told["calibration"]]["cameras"]["CAM"]
    budget, (adjustment, *_) = told["error_budget"], told["adjustments"].values()
    inner = (budget, budget["sources"][0], told["check_points"], told["groups"][0], adjustment)
    for key in (*told, *camera, *camera["distortion"][0], *(key for part in inner for key in part)):
        assert f"`{key}`" in section


# --- The report is one file, or a line says why there is none


@pytest.fixture(scope="module")
def reported(made, tmp_path_factory):
    """A report by a process of its own, what it said, and what it loaded of what adjusts."""
    code = (
        "import atexit, sys\n"
        "unwanted = {'numba', 'cv2', 'scipy.linalg', 'scipy.spatial', 'matplotlib.pyplot'}\n"
        "atexit.register(lambda: print('loaded', sorted(unwanted & set(sys.modules))))\n"
        "from acx4book.command.acx4 import main\n"
        "main()"
    )
    out = tmp_path_factory.mktemp("reported") / "report.html"
    given = ("report", made[1], "--out", out)
    done = subprocess.run(
        [sys.executable, "-c", code, *given], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return out, done.stdout.splitlines()


@pytest.mark.slow
def test_the_report_is_one_file_that_asks_for_nothing(reported, run):
    out, said = reported
    assert said[:2] == ["report: done", str(out)]
    assert sorted(path.name for path in out.parent.iterdir()) == ["report.html", "report.json"]
    text = out.read_text(encoding="utf-8")
    assert not re.search(r"<script|<link|src=\"(?!data:)|url\(|@import", text)
    assert text.count("data:image/svg+xml;base64,") >= 6
    assert "<code class" not in text
    assert "import acx4lib" not in text
    assert run.flight.name in text
    assert "<b>Table 1.</b> The calibration" in text
    assert "standard deviations and correlation matrix" in text.lower()
    assert not re.search(r"\{(numref|eq|doc)\}|\\varphi|\$", re.sub(r"<style>.*</style>", "", text))


@pytest.mark.slow
def test_the_same_results_give_the_same_bytes_in_another_process(acx4, reported, made, tmp_path):
    again, (first, _) = tmp_path / "again.html", reported
    status, said, err = acx4("report", made[1], "--out", again)
    assert (status, said.splitlines(), err) == (0, ["report: done", str(again)], "")
    assert again.read_bytes() == first.read_bytes()
    assert again.with_suffix(".json").read_bytes() == first.with_suffix(".json").read_bytes()


def test_what_adjusts_is_not_loaded_for_a_report(reported):
    """It takes longer to load than the report takes to compute its tables."""
    assert reported[1][-1] == "loaded []"


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (shutil.rmtree, "no such folder"),
        (lambda f: (f / "residuals.csv").unlink(), "not complete, without residuals.csv"),
        (lambda f: (f / "summary.json").write_text("{}"), "no stage left results"),
        (lambda f: (f / "summary.json").write_text("{"), "summary.json:1: file: not JSON"),
        (lambda f: shutil.rmtree(f / "flight"), "not complete, without flight/flight.toml"),
        (lambda f: [p.unlink() for p in f.glob("*.*")], "no results of a run"),
    ],
)
def test_bad_results_are_one_line_and_leave_an_older_report_alone(acx4, folder, spoil, says):
    spoil(folder)
    out = folder.parent / "report.html"
    out.write_bytes(PAGE_MARK)
    status, said, err = acx4("report", folder, "--out", out)
    assert (status, said) == (2, "")
    assert len(err.splitlines()) == 1
    assert says in err
    assert str(folder) in err
    assert out.read_bytes() == PAGE_MARK


def test_a_flight_in_place_of_its_results_is_told_what_is_missing(acx4, made):
    status, _, err = acx4("report", made[0])
    assert (status, err) == (
        2,
        f"{made[0]}: no results of a run; acx4 run FLIGHT --results makes them\n",
    )


def test_a_place_that_cannot_be_written_is_one_line_before_anything_runs(acx4, made, tmp_path):
    for out, says in (
        (tmp_path, "is a folder"),
        (tmp_path / "no" / "x.html", "no such folder"),
        (tmp_path / "x.pdf", "name the page, such as x.html"),
    ):
        status, _, err = acx4("report", made[1], "--out", out)
        assert status == 2
        assert len(err.splitlines()) == 1
        assert says in err
    assert list(tmp_path.iterdir()) == []


def test_residuals_of_another_flight_are_refused(folder):
    def rename(table):
        table["point"] = table["point"].str.replace("T0", "X0")

    edit(folder, "residuals", rename)
    with pytest.raises(FlightError, match=r"are not of the points in flight; run all"):
        image_residuals(read(folder), SINGLE)


# --- The report as PDF/A beside it, or one line on what to install


REPORT = """<!DOCTYPE html><html><head><meta name="generator" content="acx4 report">
<meta name="dcterms.date" content="2026-02-03"><title>Calibration report: 飛</title></head>
<body><h1>Calibration report</h1><p>one</p></body></html>"""


@pytest.fixture
def report(tmp_path):
    path = tmp_path / "report.html"
    path.write_text(REPORT, encoding="utf-8")
    return path


def test_without_typst_the_report_is_written_and_the_command_says_what_is_missing(
    acx4, made, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "typst", None)
    out = tmp_path / "report.html"
    status, said, err = acx4("report", made[1], "--out", out, "--pdf")
    assert (status, said.splitlines()) == (1, ["report: done", str(out)])
    assert "pip install 'acx4lib[pdf]'" in err
    assert {path.name for path in tmp_path.iterdir()} == {"report.html", "report.json"}


def test_another_pdf_is_not_replaced(report):
    report.with_suffix(".pdf").write_bytes(b"%PDF-1.4 of somebody")
    with pytest.raises(OutputError, match="is not a report of acx4"):
        page.check_pdf(report)


def test_a_report_is_set_beside_it_and_set_again(report):
    made = page.write_pdf(report)
    assert made == report.with_suffix(".pdf")
    first = made.read_bytes()
    assert PdfReader(made).pages[0].extract_text().split()[:3] == ["Calibration", "report", "one"]
    assert page.write_pdf(report).read_bytes() == first
    assert {path.name for path in report.parent.iterdir()} == {"report.html", "report.pdf"}


# --- The text of the report, and what is computed between its paragraphs


def test_every_part_that_is_computed_has_its_place_in_the_text():
    text = TEXT.read_text(encoding="utf-8")
    assert sorted(one["name"] for one in DIRECTIVE.finditer(text)) == sorted(computed(None, []))
    assert "```{" not in DIRECTIVE.sub("", text)


# --- The report as PDF: what the page says, archival, with all of its fonts ------------------


PAGE = """<html><head><meta name="dcterms.date" content="2026-02-03"><title>no</title></head>
<body>{}</body></html>"""


def reader(html, path):
    path.write_bytes(typeset.pdf(html))
    return PdfReader(path)


def said(pdf):
    return squeezed("".join(sheet.extract_text() for sheet in pdf.pages))


def squeezed(text):
    """Return text without spaces, the marks around names, and places where words may break."""
    return re.sub("[\\s\u200b\u2066-\u2069]", "", text)


@pytest.fixture(scope="module")
def html(made, tmp_path_factory):
    out = tmp_path_factory.mktemp("page") / "report.html"
    page.write(made[1], out)
    return out.read_text("utf-8")


@pytest.fixture(scope="module")
def pdf(html, tmp_path_factory):
    return reader(html, tmp_path_factory.mktemp("set") / "report.pdf")


def test_it_says_all_that_the_page_says(html, pdf):
    soup, there = BeautifulSoup(html, "html.parser"), said(pdf)
    parts = soup.find("body").find_all(["h1", "p", "caption", "figcaption", "th", "td"])
    texts = [squeezed(part.get_text()) for part in parts]
    # a paragraph may go on behind a foot of a page, and letters above others come in any order
    lacking = [t for t in texts if t[:8] not in there and t[-8:] not in there]
    assert len(texts) > 300
    assert len(lacking) < 0.02 * len(texts), lacking
    assert len(soup.find_all("img")) == sum(t.startswith("Figure") for t in texts)


@pytest.mark.parametrize(
    "name",
    ['#panic("x")', 'a"b\\"c', "$x$ _y_ *z* `w`", "[a] (b) {c} @d <e> //f", "= g", "\\u{41}"],
)
def test_a_name_is_shown_as_it_is(name, tmp_path):
    escaped = name.replace("&", "&amp;").replace("<", "&lt;")
    found = reader(PAGE.format(f"<h1>t</h1><p>{escaped}</p>"), tmp_path / "x.pdf")
    assert squeezed(name) in said(found)
