"""The built book as files: links, images, equations; nothing left over, nothing from outside."""

import json
import posixpath
import re
import zipfile
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from pypdf import PdfReader

from acx4book.pages import reproducibility
from acx4book.report.page import write
from built_book.conftest import parse
from support.helpers import ROOT, book_extension, repeats

HEAVY, HEAVY_BOOK = 1.5e6, 32e6
"""Bytes of a page and of the whole book."""

OUTSIDE = re.compile(r"^(https?:)?//", re.IGNORECASE)


def article(page):
    """The text of a chapter, without the navigation around it."""
    return page.select_one("article") or page


def test_every_executed_notebook_is_a_page(html):
    # a stage that the flight does not have has a page in Markdown that says so
    executed = {path.stem for path in (ROOT / "book" / "_executed").glob("[!.]*.*")}
    assert executed
    forwards = {name.removeprefix("_executed/") for name in book_extension("forwards").NOW}
    assert {path.stem for path in (html / "_executed").glob("*.html")} - forwards == executed


def test_internal_links_and_anchors_resolve(html, pages):
    anchors = {name: {e["id"] for e in page.select("[id]")} for name, page in pages.items()}
    files = {path.relative_to(html).as_posix() for path in html.rglob("*") if path.is_file()}
    broken = []
    for name, page in pages.items():
        for address in {link["href"] for link in page.select("a[href]")}:
            url = urlsplit(address)
            if url.scheme or url.netloc:
                continue
            beside = posixpath.join(posixpath.dirname(name), unquote(url.path))
            target = posixpath.normpath(beside) if url.path else name
            fragment = unquote(url.fragment)
            if target not in files or (
                fragment and fragment not in anchors.get(target, {fragment})
            ):
                broken.append(f"{name}: {address}")
    assert broken == []


def test_every_image_says_what_it_shows(pages):
    silent = [
        f"{name}: {image.get('src')}: {alt!r}"
        for name, page in pages.items()
        for image in page.select("img, svg[role=img]")
        if len((alt := image.get("alt") or image.get("aria-label", "")).split()) < 3
        or re.search(r"<Figure|\.(svg|png)$", alt)
    ]
    assert silent == []


def test_nothing_is_asked_of_another_host(html, pages):
    asked = [
        f"{name}: {url}"
        for name, page in pages.items()
        for element in page.select("script, link, img, iframe, source, video, audio, object, embed")
        for key in ("src", "href", "data", "srcset")
        if OUTSIDE.match(url := element.get(key, "")) and "canonical" not in element.get("rel", [])
    ]
    for sheet in html.rglob("*.css"):
        found = re.findall(r"(?:url\(|@import\s+)['\"]?((?:https?:)?//[^'\")]+)", sheet.read_text())
        asked += [f"{sheet.name}: {url}" for url in found]
    assert asked == []


def test_no_page_is_heavy_and_neither_is_the_book(html, pages):
    """Apart from scripts and style sheets, which all pages share."""
    heavy = {}
    for name, page in pages.items():
        folder = (html / name).parent
        images = {folder / image["src"] for image in page.select("img[src]")}
        own = [html / name, *(image for image in images if "_static" not in image.parts)]
        size = sum(path.stat().st_size for path in own)
        if size > HEAVY:
            heavy[name] = size
    assert heavy == {}
    assert sum(path.stat().st_size for path in html.rglob("*") if path.is_file()) < HEAVY_BOOK


LEFT_OVER = {
    "a role": r"\{[a-z:]+\}`",
    "a reference": r"\{(numref|eq|ref|doc|cite|func|class|term)\b",
    "an unresolved number": r"\?\?",
    "display math": r"\$\$",
    "an option": r"(^|\s):(name|label|alt|width|header-rows):\s",
    "a substitution": r"\{\{|\}\}",
}


@pytest.mark.parametrize("what", LEFT_OVER)
def test_no_markup_is_left_over(chapters, what):
    pattern = re.compile(LEFT_OVER[what])
    found = []
    for name, page in chapters.items():
        for text in article(page).find_all(string=pattern):
            if not text.find_parent(["pre", "code", "script", "style"]) and not text.find_parent(
                class_="math"
            ):
                found.append(f"{name}: {text.strip()[:80]}")
    assert found == []


def test_no_directive_is_shown_as_code(chapters):
    shown = [name for name, page in chapters.items() if "```{" in article(page).get_text()]
    assert shown == []


def test_no_notebook_shows_an_error_or_a_warning(chapters):
    bad = ".output.traceback, .output.stderr, #papermill-error-cell"
    assert [name for name, page in chapters.items() if page.select(bad)] == []


# --- what every page of the book offers besides its text, and what the book carries ------------


def test_every_notebook_can_be_taken_along_as_it_was_executed_and_to_run(html, chapters):
    notebooks = [name for name in chapters if (ROOT / "notebooks" / source(name)).is_file()]
    assert notebooks
    for name in notebooks:
        links = chapters[name].select(".dropdown-download-buttons a[href*='downloads/']")
        to_run, executed = ((html / name).parent / link["href"] for link in links)
        assert to_run.resolve() == html / "downloads" / "notebooks" / source(name)
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


def test_on_paper_everything_is_open(browser, html, tmp_path):
    page = browser.new_page()
    page.goto((html / "_executed/foundations/2-rotations.html").as_uri(), wait_until="load")
    page.pdf(path=tmp_path / "page.pdf", prefer_css_page_size=True)
    page.close()
    text = "\n".join(sheet.extract_text() for sheet in PdfReader(tmp_path / "page.pdf").pages)
    assert "??" not in text
    assert "Solution to Exercise" in text
    assert "assert np.allclose" in text  # of a solution


# --- the printable report of the run that the book was made from -------------------------------


SEEN = """() => ({
    overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    broken: [...document.images].filter(i => !i.complete || !i.naturalWidth).length,
    ground: getComputedStyle(document.body).backgroundColor,
    code: document.querySelectorAll('pre').length,
})"""


@pytest.fixture(scope="module")
def report_path(html, tmp_path_factory):
    folder = html.parents[2] / "build" / "results" / "data-flights-acx4"
    if not (folder / "summary.json").is_file():
        pytest.skip("the book was made from another flight")
    out = tmp_path_factory.mktemp("report") / "report.html"
    write(folder, out)
    return out


@pytest.mark.parametrize(
    ("width", "colours"),
    [(1280, "light"), (390, "dark"), repeats(1280, "dark"), repeats(390, "light")],
)
def test_the_report_is_drawn_whole_and_asks_for_nothing(browser, report_path, width, colours):
    context = browser.new_context(
        viewport={"width": width, "height": 900}, color_scheme=colours, java_script_enabled=True
    )
    page = context.new_page()
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report_path.as_uri(), wait_until="load")
    seen = page.evaluate(SEEN)
    context.close()
    assert [url for url in asked if not url.startswith("data:")] == [report_path.as_uri()]
    assert (seen["overflow"], seen["broken"], seen["code"]) == (0, 0, 0)
    assert (seen["ground"] == "rgb(255, 255, 255)") == (colours == "light")


def test_the_report_prints_on_a4_in_a_handful_of_pages(browser, report_path):
    page = browser.new_page()
    page.goto(report_path.as_uri(), wait_until="load")
    printed = page.pdf(prefer_css_page_size=True)
    page.close()
    assert printed.startswith(b"%PDF")
    assert b"/MediaBox [0 0 594" in printed or b"/MediaBox [0 0 595" in printed  # 210 mm
    assert 2 <= printed.count(b"/Type /Page\n") <= 5
