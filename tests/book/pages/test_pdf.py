"""The PDF of a book, of which links lead inside."""

import os
import shutil

import pytest
from pypdf import PdfReader

from acx4book.pages import pdf
from acx4book.pages.pdf import PrintError

CONTENTS = """root: intro
parts:
  - chapters:
      - file: a/one
        sections: [{file: a/two}]
  - chapters: [{file: glossary}]
"""
PAGES = {
    "intro.html": '<p><a href="a/one.html#far">far</a> <a href="a/one.html">one</a></p>',
    "a/one.html": '<p>one</p><h2 id="far" style="break-before: page">Far</h2>'
    '<a href="../glossary.html#w%20%C3%BC">word</a> <a href="files/x.ipynb">file</a>',
    "a/two.html": '<a href="https://example.org/">out</a> <a href="#own">own</a><p id="own">o</p>',
    "glossary.html": '<p id="w ü">word</p>',
}


@pytest.fixture
def html(tmp_path):
    """A small book, and its table of contents beside it."""
    (tmp_path / "toc.yml").write_text(CONTENTS)
    for name, body in PAGES.items():
        path = tmp_path / "html" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        title = f"<title>{name} — the book</title>"
        path.write_text(f"<html><head>{title}</head><body>{body}</body></html>", encoding="utf-8")
    return tmp_path / "html"


def test_pages_come_in_the_order_of_the_contents(html):
    assert pdf.order(html.parent / "toc.yml") == [
        "intro.html",
        "a/one.html",
        "a/two.html",
        "glossary.html",
    ]


def test_without_chromium_a_line_says_what_to_install(html, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(PrintError, match="install the package chromium"):
        pdf.make(html, html.parent / "toc.yml", html.parent / "book.pdf")


@pytest.mark.slow
def test_links_lead_inside_and_out(html, tmp_path):
    if not any(map(shutil.which, pdf.BROWSERS)):
        (pytest.fail if os.environ.get("ACX4_REQUIRE_BROWSER") else pytest.skip)(pdf.MISSING)
    file, before = tmp_path / "book.pdf", {p: p.read_bytes() for p in html.rglob("*.html")}
    assert pdf.make(html, tmp_path / "toc.yml", file) == 5
    assert {path: path.read_bytes() for path in html.rglob("*.html")} == before
    reader = PdfReader(file)
    assert [entry.title for entry in reader.outline] == list(PAGES)
    assert leads(reader, 0) == [2, 1]
    assert leads(reader, 2) == [4]  # and not to the file
    assert leads(reader, 3) == ["https://example.org/", 3]


def leads(reader, number):
    """Where the links of a sheet lead: a sheet, or an address."""
    found = [entry.get_object() for entry in reader.pages[number]["/Annots"]]
    sheets = {page.indirect_reference.idnum: n for n, page in enumerate(reader.pages)}
    return [
        sheets[entry["/Dest"][0].idnum] if "/Dest" in entry else entry["/A"]["/URI"]
        for entry in found
    ]


def test_half_a_page_is_no_page(html, tmp_path, monkeypatch):
    """As a browser leaves it on a full disk."""
    browser = tmp_path / "bin" / "chromium"
    browser.parent.mkdir()
    browser.write_text(
        '#!/bin/sh\nfor a; do case $a in --print-to-pdf=*) printf half > "${a#*=}";; esac; done\n'
    )
    browser.chmod(0o755)
    monkeypatch.setenv("PATH", str(browser.parent), prepend=os.pathsep)
    with pytest.raises(PrintError, match="no whole PDF"):
        pdf.make(html, tmp_path / "toc.yml", tmp_path / "book.pdf")
    assert not (tmp_path / "book.pdf").exists()
