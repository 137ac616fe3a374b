"""A flight whose every name is a payload goes through all commands and comes out as text.

Searched are the pages of its book, as `acx4 book` builds them for any flight, and the report: first
as files, then in the browser.
"""

import contextlib
import io
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup, Comment
from docutils.nodes import make_id

from acx4book.command import acx4
from acx4files.flight.problems import QUOTED
from support.flights import payloads

pytestmark = pytest.mark.slow


@dataclass(frozen=True, kw_only=True)
class Made:
    """What the commands left of the flight."""

    flight: payloads.Written
    results: Path
    images: Path
    html: Path


def call(folder, *command):
    """Run a command in a folder."""
    said = io.StringIO()
    with (
        contextlib.chdir(folder),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        pytest.raises(SystemExit) as ended,
    ):
        acx4.main([*map(str, command)])
    assert ended.value.code == 0, said.getvalue()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("payloads")
    written = payloads.write(folder)
    found, images, html = (
        folder / f"{what} {{x}} <i>zq71</i>" for what in ("results", "images", "book")
    )
    call(folder, "check", written.path)
    call(folder, "run", written.path, "--results", found)
    call(folder, "render", written.path, "--results", found, "--out", images)
    call(folder, "book", found, "--out", html, "--strict")
    return Made(flight=written, results=found, images=images, html=html)


@pytest.fixture(scope="module")
def documents(made):
    """The pages, the report among them, parsed, by their names."""
    files = [path for path in made.html.rglob("*.html") if "_static" not in path.parts]
    return {path.name: BeautifulSoup(path.read_text("utf-8"), "html.parser") for path in files}


def test_nothing_was_executed(made):
    folder = made.flight.path.parent
    assert list(folder.rglob("*PWNED*")) == []
    assert list(Path.cwd().glob("*PWNED*")) == []


PICTURE = re.compile(r"(?<=;base64,)[\w+/=]+")
"""May hold by chance what looks like a mark."""

DATA = "script[type='application/json']"
"""Holds what a figure shows: a browser runs nothing of it and reads it as text."""


TITLE = {payloads.FLIGHT, make_id(payloads.FLIGHT), f"#{make_id(payloads.FLIGHT)}"}
"""Attributes by which the first page is called: the whole name, and its plain letters."""


def attributes(element):
    """Return the attributes of an element, but for those with the book's title."""
    return {key: value for key, value in element.attrs.items() if str(value) not in TITLE}


def inside(element):
    """Return the text of an element that is more than text to a browser."""
    lives = element.name in ("script", "style", "math") and not element.css.match(DATA)
    return element.get_text() if lives or "math" in element.get("class", []) else ""


def test_no_part_of_a_name_is_alive(documents):
    alive = []
    for page, soup in documents.items():
        for element in soup.find_all(True):
            if payloads.marks(PICTURE.sub("", f"{attributes(element)} {inside(element)}")):
                alive.append((page, str(element)[:200]))
        alive += [
            (page, c) for c in soup.find_all(string=Comment.__instancecheck__) if payloads.marks(c)
        ]
    assert alive == []
    data = [one.string for soup in documents.values() for one in soup.select(DATA)]
    assert [text for text in data if "<" in text] == []  # nor </script>, nor <!--


def test_every_name_is_found_again_as_text(made, documents):
    names = made.flight.names
    of_flight = {name for own in names.values() for name in own.values()}
    every = {*payloads.NAMES.values(), *of_flight, payloads.FOLDER, "<i>zq71</i>"}
    found, left = set(), []
    for page, soup in documents.items():
        text = soup.get_text()
        for name in sorted(every, key=len, reverse=True):
            # a note quotes the beginning of what is long
            for said in {name, repr(name)[1:-1], re.sub(r"\s+", " ", name), name[:QUOTED]}:
                found |= {name} if said in text else set()
                text = text.replace(said, "")
        left += [(page, m, text[max(0, text.index(m) - 80) :][:160]) for m in payloads.marks(text)]
    assert left == []
    shown = {*names["camera"].values(), *names["strip"].values(), *made.flight.columns}
    shown |= {payloads.FLIGHT, names["exposure"]["E0"], names["exposure"]["E1"]}
    assert shown - found == set()


def test_no_notebook_warns(made, documents):
    said = [(page, one) for page, soup in documents.items() for one in soup.select(".stderr")]
    assert said == []
    files = [*(made.results / "notebooks").glob("*.ipynb")]
    assert len(files) == 6
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cells = [(p.name, c) for p in files for c in nbformat.read(p, as_version=4).cells]
    outputs = [(name, output) for name, cell in cells for output in cell.get("outputs", ())]
    drawn = [n for n, o in outputs if "image/svg+xml" in o.get("data", ())]
    assert drawn.count("02-synthetic-image.ipynb") >= 7  # of its pictures
    assert [(name, o.text) for name, o in outputs if o.get("name") == "stderr"] == []
    papers = {name for name, o in outputs if "CAM1" in str(o)}  # of heads that this flight lacks
    assert not papers & {path.name for path in (made.results / "notebooks").glob("0[0-4]-*")}


def test_nothing_happens_in_the_browser(browser, made):
    page = browser.new_page()
    happened = []
    page.on("dialog", lambda dialog: (happened.append(dialog.message), dialog.dismiss()))
    page.on("pageerror", lambda error: happened.append(str(error)))
    page.on(
        "request",
        lambda r: None if r.url.startswith(("file:", "data:", "blob:")) else happened.append(r.url),
    )
    for path in [*made.html.glob("*.html"), *made.html.glob("_executed/*.html")]:
        page.goto(path.as_uri(), wait_until="load")
        page.evaluate("async () => { await window.MathJax?.startup?.promise; }")
        seen = page.evaluate(
            "() => [typeof window.pwned, document.querySelectorAll('mjx-merror').length]"
        )
        if seen != ["undefined", 0]:
            happened.append((path.name, seen))
    page.close()
    assert happened == []
