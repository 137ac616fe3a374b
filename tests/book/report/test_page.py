"""The report as files: its record, the page, and the PDF; names of a flight are text in all."""

import datetime as dt
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest
from bs4 import BeautifulSoup
from numpy.testing import assert_allclose
from pypdf import PdfReader

from acx4book.report import page
from acx4book.report.findings import findings
from acx4book.report.material import read
from acx4book.report.verdict import statement
from acx4files.flight.settings import Certificate, Device, Session
from acx4files.results import folder as results
from acx4lib.errors import OutputError
from support.flights import payloads
from support.helpers import ROOT
from support.run_results import SINGLE, edit_summary

# --- the record: the values of the results, whole and without NaN ----------------------------


@pytest.fixture(scope="module")
def told(run):
    text = json.dumps(page.record(run, findings(run)), indent=1)
    assert page.MARKS[".json"] in text.encode()[:4096]
    return json.loads(text, parse_constant=pytest.fail)


def test_parameters_and_covariance_are_those_of_the_results(run, told):
    method = told["methods"][told["calibration"]]
    cov = results.covariance(run.found, SINGLE)
    assert method["parameters"] == list(cov.index)
    assert_allclose(method["covariance_matrix"], cov, rtol=1e-15)
    camera = method["cameras"]["CAM"]
    rows = results.parameters(run.found, SINGLE, "CAM")
    assert {k: v["value"] for k, v in camera["parameters"].items()} == dict(rows["value"])
    assert {k: v["standard_deviation"] for k, v in camera["parameters"].items()} == dict(
        rows["sigma"]
    )
    assert camera["interior"]["f_mm"] == rows.loc["f_mm", "value"]
    assert camera["interior"]["b1"] == 0.0  # held


def test_the_statement_is_that_of_the_findings(run, told):
    found = findings(run)
    said = told["statement"]
    assert said["findings"][0].keys() == {"question", "state", "answer", "p", "p_joint", "tests"}
    assert [f["question"] for f in said["findings"]] == [f.question for f in found]
    assert (said["holds"], said["title"]) == (True, statement(found)["title"])
    assert (said["level"], said["procedure"]) == (0.05, "Holm")
    by_question = {f["question"]: f for f in said["findings"]}
    assert by_question["Convergence"]["p"] is None
    tested = by_question["Boresight stable over time"]
    assert tested["p"] == min(test["p"] for test in tested["tests"])
    assert tested["p"] < tested["p_joint"] <= 1
    assert not any(test["fails"] for test in tested["tests"])
    n_points = run.found.summary["validation/single_step"]["n_points"]
    assert told["check_points"]["n_points"] == n_points


def test_a_value_that_the_data_reject_stands_in_the_record_with_its_consequence(folder):
    f = {"value": 25.0, "estimate": 25.4, "sigma": 0.05, "p": 1e-9, "cost": 40.0}
    f["moves"] = {"CAM/lever_z_m": 3.2}
    edit_summary(folder, SINGLE, held={"CAM/f_mm": f}, held_rejected=["CAM/f_mm"])
    material = read(folder)
    said = page.record(material, findings(material))["statement"]
    assert (said["holds"], said["failures"][0]["question"]) == (False, "Held values")
    (finding,) = [one for one in said["findings"] if one["question"] == "Held values"]
    (test,) = finding["tests"]
    assert (test["size"], test["limit"], test["unit"]) == (3.2, 1.0, "σ")
    assert "25.400 ± 0.050 if it is free, which moves lever arm z by +3.2 σ" in finding["answer"]


def test_every_key_is_explained(told):
    text = (ROOT / "book" / "results.md").read_text(encoding="utf-8")
    section = text[text.index("(certificate)=") :]
    camera = told["methods"][told["calibration"]]["cameras"]["CAM"]
    (adjustment, *_), said = told["adjustments"].values(), told["statement"]
    inner = (said, said["findings"][0], told["check_points"], told["groups"][0], adjustment)
    for key in (*told, *camera, *(key for part in inner for key in part)):
        assert f"`{key}`" in section


# --- the texts of the page -------------------------------------------------------------------


@pytest.fixture
def stated(run):
    """The run of a flight with a certificate."""
    said = Certificate(
        number="2026-31",
        imu="POS AV 510",
        imu_serial="4711",
        antenna_lever_m=(0.12, -0.03, 1.284),
        valid_until=dt.date(2028, 11, 22),
        cameras={"CAM": Device(maker="Maker", model="M1", serial="08", lens_serial="77")},
    )
    flown = Session(date=dt.date(2026, 11, 20), temperature_c=-3.5)
    return replace(run, flight=replace(run.flight, certificate=said, session=flown))


def test_only_what_is_stated_stands_there(stated):
    said = dict(page.texts(stated, [])["stated"])
    assert said["Camera CAM"] == "Maker M1 no. 08; lens no. 77"
    assert said["Format of CAM"] == "11608 × 8708 pixels of 4.6 µm"
    assert said["IMU"] == "POS AV 510 no. 4711"
    assert said["GNSS antenna"] == "+0.120, -0.030, +1.284 m from the IMU, along the body's x, y, z"
    assert (said["Flown on"], said["Temperature"]) == ("2026-11-20", "-3.5 °C")
    assert said["Valid until"] == "2028-11-22"
    assert "Flown by" not in said


def test_values_have_the_digits_that_their_sigma_allows(run):
    (table, points) = page.texts(run, [])["values"]
    rows, own = dict(table["rows"]), results.parameters(run.found, SINGLE, "CAM")
    assert len(rows) == len(own)
    value, sigma = rows["f (mm)"].split("±")
    assert float(value) == pytest.approx(own.loc["f_mm", "value"], abs=6e-5)
    assert float(sigma) == pytest.approx(own.loc["f_mm", "sigma"], rel=0.05)
    assert re.fullmatch(r"−?\d\.\d\d·10⁻⁶ ±.\d\.\d·10⁻⁸", rows["k₁ (mm⁻²)"])
    assert "Held: b₁ = 0 and b₂ = 0." in table["note"]
    rms = run.found.summary["validation/single_step"]["points"]["rms"]
    assert [row[2] for row in points["rows"]] == [f"{of:.3f}" for of in rms]


def test_the_identity_is_that_of_flight_files_and_software(run):
    said = dict(page.texts(run, [])["identity"])
    assert said["Flight"] == run.flight.name
    assert said["Coordinate system"] == "WGS 84 / UTM zone 33N (EPSG:32633)"
    assert said["Stages"] == "mounting and validation"
    assert said["Data, SHA-256"] == run.provenance.digest
    assert run.provenance.files.items() <= said.items()
    assert "acx4lib " in said["Software"]


# --- the files -------------------------------------------------------------------------------


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
    given = ("report", made[1], "--out", out, "--pdf")
    done = subprocess.run(
        [sys.executable, "-c", code, *given], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return out, done.stdout.splitlines()


def test_the_report_is_one_file_that_asks_for_nothing(reported, run):
    out, said = reported
    # what adjusts takes longer to load than the report takes to write
    assert said == [str(out), str(out.with_suffix(".pdf")), "loaded []"]
    names = sorted(path.name for path in out.parent.iterdir())
    assert names == ["report.html", "report.json", "report.pdf"]
    text = out.read_text(encoding="utf-8")
    assert not re.search(r"<script|<link|src=|url\(|@import|\{\{|\{%", text)
    soup = BeautifulSoup(text, "html.parser")
    assert soup.find(class_="verdict").h2.get_text() == "The results hold"
    assert soup.find(class_="verdict").find_previous("table") is None
    assert run.flight.name in soup.header.get_text()
    record = json.loads(out.with_suffix(".json").read_text("utf-8"))
    questions = {row.td.get_text() for row in soup.find(class_="questions").tbody.find_all("tr")}
    assert questions == {f["question"] for f in record["statement"]["findings"]}


def squeezed(text):
    """Return text without spaces and places where words may break."""
    return re.sub("[\\s\u200b]", "", text)


def test_the_pdf_says_all_that_the_page_says(reported):
    out, _ = reported
    soup = BeautifulSoup(out.read_text("utf-8"), "html.parser")
    there = squeezed(
        "".join(sheet.extract_text() for sheet in PdfReader(out.with_suffix(".pdf")).pages)
    )
    texts = [
        squeezed(part.get_text()) for part in soup.body.find_all(["h1", "h2", "p", "td", "dd"])
    ]
    # a paragraph may go on behind a foot of a page
    lacking = [t for t in texts if t[:8] not in there and t[-8:] not in there]
    assert len(texts) > 150
    assert len(lacking) < 0.02 * len(texts), lacking
    assert there.startswith("Calibrationreport")
    assert "Theresultshold" in there[:200]


def test_the_same_results_give_the_same_bytes_in_another_process(reported, made, tmp_path):
    again = tmp_path / "again.html"
    page.write(made[1], again, pdf=True)
    for kind in page.MARKS:
        assert again.with_suffix(kind).read_bytes() == reported[0].with_suffix(kind).read_bytes()
    page.write(made[1], again, pdf=True)  # a report is replaced


NAMES = [*payloads.NAMES.values(), '#panic("x")', 'a"b\\"c', "[a] (b) {c} @d //f", "= g", "\\u{41}"]


def test_names_are_text_on_the_page_and_in_the_pdf(run, folder):
    """Every text of a flight and of its results is an attack."""
    evil = [name for name in NAMES if name.isprintable()]
    edit_summary(folder, SINGLE, notes=evil, weak=[f"{SINGLE}: {name}" for name in evil])
    edit_summary(folder, SINGLE, correlated=[[evil[0], evil[1], 0.99]])
    material = read(folder)
    for name in evil[:3]:
        certificate = Certificate(number=name, cameras={"CAM": Device(model=name)})
        flight = replace(material.flight, name=name, certificate=certificate)
        hostile = replace(material, flight=flight)
        shown = page.texts(hostile, findings(hostile))
        soup = BeautifulSoup(page._template().render(shown), "html.parser")
        assert name in soup.title.get_text()
        plain = BeautifulSoup(
            page._template().render(page.texts(run, findings(run))), "html.parser"
        )
        tags = {tag.name for tag in plain.find_all(True)}
        assert {tag.name for tag in soup.find_all(True)} == tags
        assert all(other in soup.get_text() for other in evil)
        assert page._typeset(shown).startswith(b"%PDF")


# --- or a line says why there is none --------------------------------------------------------


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (shutil.rmtree, "no such folder"),
        (lambda f: (f / "residuals.csv").unlink(), "not complete, without residuals.csv"),
        (lambda f: (f / "summary.json").write_text("{}"), "says nothing of the flight"),
        (lambda f: (f / "summary.json").write_text("{"), "summary.json: is not JSON"),
        (lambda f: shutil.rmtree(f / "flight"), "not complete, without flight/flight.toml"),
        (lambda f: [p.unlink() for p in f.glob("*.*")], "no results of a run"),
    ],
)
def test_bad_results_are_one_line_and_leave_an_older_report_alone(acx4, folder, spoil, says):
    spoil(folder)
    out = folder.parent / "report.html"
    out.write_bytes(page.MARKS[".html"])
    status, said, err = acx4("report", folder, "--out", out)
    assert (status, said) == (2, "")
    assert len(err.splitlines()) == 1
    assert says in err
    assert str(folder) in err
    assert out.read_bytes() == page.MARKS[".html"]


def test_a_place_that_cannot_be_written_is_one_line_before_anything_runs(acx4, made, tmp_path):
    for out, says in (
        (tmp_path, "is a folder"),
        (tmp_path / "no" / "x.html", "no such folder"),
        (tmp_path / "x.pdf", "name the page, such as x.html"),
    ):
        status, _, err = acx4("report", made[1], "--out", out)
        assert (status, len(err.splitlines())) == (2, 1)
        assert says in err
    assert list(tmp_path.iterdir()) == []


def test_another_file_is_not_replaced(made, tmp_path):
    (tmp_path / "report.pdf").write_bytes(b"%PDF-1.4 of somebody")
    with pytest.raises(OutputError, match="is not a report of acx4"):
        page.write(made[1], tmp_path / "report.html", pdf=True)
    assert [path.name for path in tmp_path.iterdir()] == ["report.pdf"]


def test_without_typst_a_line_says_what_is_missing(acx4, made, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "typst", None)
    status, _, err = acx4("report", made[1], "--out", tmp_path / "report.html", "--pdf")
    assert (status, len(err.splitlines())) == (1, 1)
    assert "pip install 'acx4lib[pdf]'" in err
    assert list(tmp_path.iterdir()) == []
