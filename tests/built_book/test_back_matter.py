"""What every page of the book offers besides its text, and what the book carries."""

import json
import re
import zipfile
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import yaml
from pypdf import PdfReader

from acx4book.pages import pdf, release, reproducibility
from built_book.conftest import parse
from support.helpers import ROOT, book_extension

PRINTED = ("_executed/foundations/2-rotations.html", "glossary.html")
ADDRESS = re.compile(r"https?://([a-z0-9-]+\.)+[a-z]{2,}(:\d+)?(/[^\s<>\"{}|\\^`]*)?")


def test_every_page_says_version_and_authors(chapters):
    said = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    line = f"acx4lib {said['version']} · © "
    silent = [
        name
        for name, page in chapters.items()
        if not (foot := page.select_one(".extra_footer"))
        or not foot.get_text().strip().startswith(line)
        or said["authors"][0]["name"] not in foot.get_text()
    ]
    assert silent == []


def test_every_notebook_can_be_taken_along_as_it_was_executed_and_to_run(html, chapters):
    notebooks = [name for name in chapters if (ROOT / "notebooks" / source(name)).is_file()]
    assert notebooks
    for name in notebooks:
        links = chapters[name].select(".dropdown-download-buttons a[href*='downloads/']")
        to_run, executed = ((html / name).parent / link["href"] for link in links)
        assert to_run.resolve() == html / release.FOLDER / source(name)
        with zipfile.ZipFile(executed) as packed:
            whole = packed.read(Path(source(name)).name)
        for content, has in ((to_run.read_bytes(), False), (whole, True)):
            cells = json.loads(content)["cells"]
            assert any(cell.get("outputs") for cell in cells) is has


def source(name):
    return name.removeprefix("_executed/").replace(".html", ".ipynb")


def test_old_addresses_lead_to_pages_with_the_content(html, pages):
    for old, new in book_extension("forwards").NOW.items():
        assert f"{new}.html" in pages, new
        found = parse(html / f"{old}.html")
        place = found.a["href"]
        assert found.meta.find_next("meta")["content"] == f"0; url={place}"
        assert ((html / old).parent / place).resolve() == html / f"{new}.html"


def test_terms_lead_to_the_glossary_and_every_term_is_used(chapters):
    terms = {entry["id"] for entry in chapters["glossary.html"].select("dl.glossary dt")}
    used = {
        link["href"].partition("#")[2]
        for page in chapters.values()
        for link in page.select("a.glossary-term")
    }
    assert terms - used == set()
    assert used - terms == set()


def test_a_term_is_linked_once_on_a_page_and_never_in_a_heading(chapters):
    for name, page in chapters.items():
        links = [link["href"] for link in page.select("a.glossary-term")]
        assert len(links) == len(set(links)), name
        assert page.select(":is(h1, h2, h3, pre, a) a.glossary-term") == [], name


def test_every_file_that_others_made_has_its_licence(html):
    ours = {"acx4.css", "accessible.js", "favicon.svg", "logo.svg", "print.css"}
    ours |= {
        "scrolling.css",
        "scrolling.js",
        "moving/block.js",
        "moving/explorer.js",
        "moving/moving.css",
    }
    files = [path.relative_to(html).as_posix() for path in (html / "_static").rglob("*.*")]
    nobodys = {name for name in files if reproducibility.of(name) is None}
    assert {name.removeprefix("_static/") for name in nobodys} <= ours


def test_addresses_outside_are_well_formed(pages):
    wrong = [
        f"{name}: {address}"
        for name, page in pages.items()
        for address in {link["href"] for link in page.select("a[href]")}
        if urlsplit(address).scheme in {"http", "https"} and not ADDRESS.fullmatch(address)
    ]
    assert wrong == []


def prints(html, folder, names):
    """Print some pages of the book into one PDF."""
    contents = {
        "root": "intro",
        "chapters": [{"file": name.removesuffix(".html")} for name in names],
    }
    (folder / "toc.yml").write_text(yaml.safe_dump(contents))
    pdf.make(html, folder / "toc.yml", folder / "book.pdf")
    return PdfReader(folder / "book.pdf")


def test_on_paper_everything_is_open_and_a_term_leads_to_its_definition(browser, html, tmp_path):
    reader = prints(html, tmp_path, PRINTED)
    text = "\n".join(sheet.extract_text() for sheet in reader.pages)
    assert "??" not in text
    assert "Solution to Exercise" in text
    assert "assert np.allclose" in text  # of a solution
    glossary = reader.get_destination_page_number(reader.outline[2])
    places = {page.indirect_reference.idnum: n for n, page in enumerate(reader.pages)}
    led = [
        places[entry["/Dest"][0].idnum]
        for sheet in reader.pages[:glossary]
        for entry in (one.get_object() for one in sheet.get("/Annots", []))
        if "/Dest" in entry
    ]
    assert any(number >= glossary for number in led)


@pytest.mark.slow
@pytest.mark.repeats
def test_the_whole_book_is_printed_without_an_unresolved_number(browser, html, tmp_path):
    contents = ROOT / "book" / "_generated" / "_toc.yml"
    pdf.make(html, contents, tmp_path / "book.pdf")
    reader = PdfReader(tmp_path / "book.pdf")
    assert len(reader.outline) == len(pdf.order(contents))
    assert [n for n, sheet in enumerate(reader.pages) if "??" in sheet.extract_text()] == []
