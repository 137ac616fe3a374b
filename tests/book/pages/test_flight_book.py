"""The book of a flight, and books printed."""

import json
import re

import pytest
from bs4 import BeautifulSoup

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.pages import flight_book
from acx4lib.errors import OutputError
from support.helpers import repeats

# --- The book of a flight: about that flight alone, complete, and safe to be written anew ----


NAME = "Of *one* camera <b>|</b>"


@pytest.fixture(scope="module", params=["numbers", repeats("notebooks")])
def results(request, tmp_path_factory):
    """Results; those without notebooks have no chapter. One with all is built in test_payloads."""
    folder = tmp_path_factory.mktemp("flown")
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=5), folder / "flight")
    toml = folder / "flight" / "flight.toml"
    text = toml.read_text("utf-8")
    name = re.search(r'(?m)^name = "(.*)"$', text)[1]
    toml.write_text(text.replace(name, NAME), encoding="utf-8")
    notebooks = NOTEBOOKS_PATH if request.param == "notebooks" else None
    runner.run(folder / "flight", folder / "results", notebooks=notebooks)
    return folder / "results"


@pytest.fixture(scope="module")
def site(results, tmp_path_factory):
    folder = tmp_path_factory.mktemp("book") / "site"
    flight_book.write(results, folder, strict=True)
    return folder


def page(site, name):
    return BeautifulSoup((site / name).read_text("utf-8"), "html.parser")


def test_the_name_of_the_flight_is_in_the_title_of_every_page_as_it_is_written(site):
    html = [p.relative_to(site) for p in site.rglob("*.html")]
    pages = [site / p for p in html if "static" not in p.parts[0] and p.name != "report.html"]
    assert len(pages) > 6
    for path in pages:
        found = BeautifulSoup(path.read_text("utf-8"), "html.parser")
        assert NAME in found.title.text
        assert not [b for b in found.find_all("b") if b.text == "|"]
    assert page(site, "index.html").h1.text.startswith(NAME)


def test_it_has_the_chapters_that_the_flight_has_data_for_and_none_of_the_study(site, results):
    here = {p.relative_to(site).as_posix() for p in site.rglob("*.html")}
    of_one_camera = {"00-flight", "03-mounting-calibration", "04-validation"}
    of_one_camera |= {"16-error-budget", "09-weights"}
    chapters = {p.stem for p in (site / "_executed").glob("*.html")}
    assert chapters == (of_one_camera if (results / "notebooks").exists() else set())
    for name in chapters & {"16-error-budget", "09-weights"}:
        found = page(site, f"_executed/{name}.html")
        headings = [h.text.rstrip("#") for h in found.select("h2")]
        assert headings[-2:] == ["The answer", "Change it"]
        assert "ends here" not in found.text
    assert {"certificate.html", "report.html", "frames-and-notation.html", "glossary.html"} <= here
    assert not {
        n for n in here if re.search(r"head-calib|synthetic|errata|scorecard|lab-|speed", n)
    }


def test_the_certificate_says_what_the_report_says_and_leads_to_it(site):
    text = page(site, "certificate.html")
    assert text.find("a", href="report.html")
    holds = json.loads((site / "report.json").read_text())["statement"]["holds"]
    assert ("The results hold." in text.text) == holds


def test_the_first_page_names_every_table_that_was_read(site, results):
    told = json.loads((results / "summary.json").read_text())["run"]["files"]
    text = page(site, "index.html").text
    assert all(name in text and digest in text for name, digest in told.items())


def test_no_page_asks_another_host_or_speaks_of_the_study(site):
    for path in [*site.rglob("*.html")]:
        found = BeautifulSoup(path.read_text("utf-8"), "html.parser")
        for tag in found.find_all(["script", "img", "link"]):
            assert not str(tag.get("src") or tag.get("href") or "").startswith(("http", "//"))


def test_it_replaces_nothing_of_others(results, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "index.html").write_text("mine")
    with pytest.raises(OutputError, match="other"):
        flight_book.write(results, other)
    assert (other / "index.html").read_text() == "mine"
    assert [p.name for p in other.iterdir()] == ["index.html"]


def test_a_chapter_that_is_not_there_is_a_line_and_leaves_nothing(tmp_path):
    with pytest.raises(flight_book.BookError, match="99: no such notebook"):
        flight_book.write_chapter("99", tmp_path, tmp_path / "site")
    assert not (tmp_path / "site").exists()


@pytest.mark.repeats
def test_a_chapter_of_the_foundations_is_a_page_with_its_exercises(tmp_path, capsys):
    flight_book.write_chapter("foundations/2-rotations", tmp_path / "none", tmp_path / "site")
    found = page(tmp_path / "site", "_executed/foundations/2-rotations.html")
    assert found.select(".exercise")
    assert found.select("div.drawing, img")
    assert "WARNING" not in capsys.readouterr().err
