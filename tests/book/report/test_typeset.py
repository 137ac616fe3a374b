"""The report as PDF: what the page says, archival, with all of its fonts."""

import re

import pytest
from bs4 import BeautifulSoup
from pypdf import PdfReader

from acx4book.report import page, typeset

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


def test_it_is_archival_and_accessible(html, pdf):
    told = pdf.xmp_metadata.rdf_root.toxml()
    for name, value in (("pdfaid:part", "2"), ("pdfaid:conformance", "A"), ("pdfuaid:part", "1")):
        assert f"<{name}>{value}</{name}>" in told
    root = pdf.trailer["/Root"]
    assert root["/MarkInfo"]["/Marked"]
    assert root["/Lang"] == "en"
    assert len(root["/OutputIntents"]) == 1
    assert typeset.pdf(html) == typeset.pdf(html)
    assert page.PDF_MARK in typeset.pdf(html)[:4096]


def test_all_fonts_are_in_it(pdf):
    fonts = {
        font["/BaseFont"]: font.get_object()["/DescendantFonts"][0].get_object()["/FontDescriptor"]
        for sheet in pdf.pages
        for font in (one.get_object() for one in sheet["/Resources"].get("/Font", {}).values())
    }
    assert len(fonts) >= 3
    assert all({"/FontFile2", "/FontFile3"} & {*one.get_object()} for one in fonts.values()), fonts
    assert all("DejaVu" in name for name in fonts)


@pytest.mark.parametrize(
    "name",
    ['#panic("x")', 'a"b\\"c', "$x$ _y_ *z* `w`", "[a] (b) {c} @d <e> //f", "= g", "\\u{41}"],
)
def test_a_name_is_shown_as_it_is(name, tmp_path):
    escaped = name.replace("&", "&amp;").replace("<", "&lt;")
    found = reader(PAGE.format(f"<h1>t</h1><p>{escaped}</p>"), tmp_path / "x.pdf")
    assert squeezed(name) in said(found)


def test_letters_that_no_font_has_are_escaped(tmp_path):
    found = reader(PAGE.format("<h1>t</h1><p>\u98db\U0001f9ec</p>"), tmp_path / "x.pdf")
    assert r"\u98db\U0001f9ec" in said(found)


def test_a_long_word_breaks_and_stays_on_the_sheet(tmp_path):
    word = "x" * 400
    found = reader(PAGE.format(f"<h1>t</h1><p>{word}</p>"), tmp_path / "x.pdf")
    lines = [line for line in found.pages[0].extract_text().splitlines() if "xx" in line]
    assert len(lines) > 2
    assert word in said(found)
