"""The PDF of a book, of which links lead inside."""

import os
from pathlib import Path

import pytest
from pypdf import PdfReader

from acx4book.pages import pdf
from acx4book.pages.pdf import PrintError, chromium

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


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ("file:///b/html/a%20b.html#x%20y", ("a b.html", "x y")),
        ("file:///b/html/a/b.html", ("a/b.html", "")),
        ("file:///b/html2/a.html", None),
        ("https://example.org/#a", None),
    ],
)
def test_an_address_is_a_place_in_the_book_or_elsewhere(address, expected):
    assert pdf.place("file:///b/html", address) == expected


def test_places_are_those_that_any_page_links(html):
    assert pdf.wanted(html, list(PAGES)) == {
        "a/one.html": {"far"},
        "a/two.html": {"own"},
        "glossary.html": {"w ü"},
    }


def test_the_book_itself_is_not_changed(html):
    before = {path: path.read_bytes() for path in html.rglob("*.html")}
    pdf.prepared(html, html.parent / "copy", list(PAGES))
    assert {path: path.read_bytes() for path in html.rglob("*.html")} == before
    assert '<a href="#far"></a>' in (html.parent / "copy" / "a" / "one.html").read_text("utf-8")


def test_without_chromium_a_line_says_what_to_install(html, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(PrintError, match="install the package chromium"):
        pdf.make(html, html.parent / "toc.yml", html.parent / "book.pdf")


@pytest.mark.slow
def test_links_lead_inside_and_out(html, tmp_path):
    try:
        chromium()
    except PrintError as error:
        (pytest.fail if os.environ.get("ACX4_REQUIRE_BROWSER") else pytest.skip)(str(error))
    file = tmp_path / "book.pdf"
    assert pdf.make(html, tmp_path / "toc.yml", file) == 5
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


def test_half_a_page_is_no_page(tmp_path, monkeypatch):
    """As a browser leaves it on a full disk; it is started in another folder."""
    browser = tmp_path / "chromium"
    browser.write_text(
        '#!/bin/sh\nfor a; do case $a in --print-to-pdf=*) printf half > "${a#*=}";; esac; done\n'
    )
    browser.chmod(0o755)
    (tmp_path / "page.html").write_text("one")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(PrintError, match="no whole PDF"):
        pdf.printed(str(browser), Path("page.html"), Path("page.pdf"))
    assert (tmp_path / "page.pdf").read_text() == "half"
