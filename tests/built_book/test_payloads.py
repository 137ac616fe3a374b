"""A flight whose every name is a payload goes through all commands and comes out as text.

Searched are the pages of the book, built as `make book` builds them from the pages of the flight
alone, and the report: first as files, then in the browser.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import nbformat
import pytest
from bs4 import BeautifulSoup, Comment

from acx4book.pages import flight_book
from acx4book.typesetting.plain_text import shown
from acx4lib import flight
from acx4lib.flight.problems import QUOTED
from acx4lib.results import folder as results
from support.flights import of_payloads, payloads
from support.helpers import ROOT

pytestmark = pytest.mark.slow

BIN = Path(sys.executable).parent
PAGES = """
import os
import sys
sys.modules["rfc3987_syntax"] = None
from pathlib import Path

from acx4book.pages import build

flight, results, book, copy = map(Path, sys.argv[1:5])
os.chdir(copy)
build.fill(flight, results, book)
"""
STUBS = ("coverage", "first-flight", "library", "many-flights", "notation", "speed", "your-files")
"""Pages that show nothing of a flight, but are referred to."""

OTHERS = (
    *(
        "11-ten-heads",
        "13-four-real-heads",
        "15-which-flight",
        "16-error-budget",
        "18-over-the-years",
    ),
    *("19-from-pictures", "07-exercises", "foundations/1-image", "foundations/3-collinearity"),
    *("foundations/4-distortion", "foundations/5-least-squares", "foundations/6-bundle"),
    *("foundations/7-direct-georeferencing", "foundations/9-block-design"),
)
"""Chapters that are referred to, and left out of this book."""

CHAPTERS = (
    *("_executed/00-flight", "_executed/01-head-calibration", "_executed/02-synthetic-image"),
    *("_executed/03-mounting-calibration", "_executed/04-validation", "_executed/06-errata"),
    *("certificate", "_executed/08-rig", "scorecard", "reproducibility"),
    *("frames-and-notation", "bibliography", "your-own-flight", "flight-toml", "flight-tables"),
    *("commands", "planning", "results", *STUBS),
)
"""The pages that show something of a flight, and those that they refer to."""

SHOWN = ("flight", "camera", "strip")
"""What has its name on some page in any case."""


@dataclass(frozen=True, kw_only=True)
class Made:
    """What the commands left of the flight."""

    flight: of_payloads.Written
    results: Path
    report: Path
    images: Path
    html: Path
    said: str


def call(folder, *command, status=0):
    """Run a program in a folder and return what it says."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src"), "PYTHONUTF8": "1"}
    done = subprocess.run(
        [*map(str, command)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("payloads")
    written = of_payloads.write(folder)
    found, images = (folder / f"{what} {{x}} <i>zq71</i>" for what in ("results", "images"))
    report, acx4 = folder / "report.html", BIN / "acx4"
    said = call(folder, acx4, "check", written.path)
    said += call(folder, acx4, "run", written.path, "--results", found)
    said += call(folder, acx4, "report", found, "--out", report)
    said += call(folder, acx4, "render", written.path, "--results", found, "--out", images)
    html = build_book(folder, written.path, found)
    return Made(flight=written, results=found, report=report, images=images, html=html, said=said)


def build_book(folder, flown, found):
    """Build the pages of a flight as the Makefile does, warnings being errors."""
    book = folder / "book"
    without = shutil.ignore_patterns("_build", "_executed", "_generated")
    shutil.copytree(ROOT / "book", book, ignore=without)
    for name in ("_executed", "_generated"):
        (book / name).mkdir()
    (book / "intro.md").write_text("# The flight\n\n```{include} _generated/roles.md\n```\n")
    for name in STUBS:
        (book / f"{name}.md").write_text(f"# {name}\n")
    chapters = "".join(f"  - file: {name}\n" for name in CHAPTERS)
    (book / "_toc.yml").write_text(f"format: jb-book\nroot: intro\nchapters:\n{chapters}")
    call(folder, sys.executable, "-c", PAGES, flown, found, book, ROOT)
    toc, left_out = (book / "_generated" / name for name in ("_toc.yml", "left_out.json"))
    titles = {f"_executed/{name}": name for name in OTHERS}
    left_out.write_text(json.dumps(json.loads(left_out.read_text()) | titles))
    build = (sys.executable, "-c", flight_book.BUILD, "build", book, "--toc", toc)
    call(folder, *build, "--quiet", "-W", "--keep-going")
    return book / "_build" / "html"


@pytest.fixture(scope="module")
def documents(made):
    """The pages and the report, parsed, by their names."""
    files = [path for path in made.html.rglob("*.html") if "_static" not in path.parts]
    return {
        path.name: BeautifulSoup(path.read_text("utf-8"), "html.parser")
        for path in [*files, made.report]
    }


def test_all_pages_are_there(documents):
    assert {f"{Path(name).name}.html" for name in CHAPTERS} < set(documents)


def test_nothing_was_executed(made):
    folder = made.html.parents[2]
    assert list(folder.rglob("*PWNED*")) == []
    assert list(Path.cwd().glob("*PWNED*")) == []


PICTURE = re.compile(r"(?<=;base64,)[\w+/=]+")
"""May hold by chance what looks like a mark."""

DATA = "script[type='application/json']"
"""Holds what a figure shows: a browser runs nothing of it and reads it as text."""


def inside(element):
    """Return the text of an element that is more than text to a browser."""
    lives = element.name in ("script", "style", "math") and not element.css.match(DATA)
    return element.get_text() if lives or "math" in element.get("class", []) else ""


def test_no_part_of_a_name_is_alive(documents):
    alive = []
    for page, soup in documents.items():
        for element in soup.find_all(True):
            if payloads.marks(PICTURE.sub("", f"{element.attrs} {inside(element)}")):
                alive.append((page, str(element)[:200]))
        alive += [
            (page, c) for c in soup.find_all(string=Comment.__instancecheck__) if payloads.marks(c)
        ]
    assert alive == []


def test_data_of_figures_hold_names_and_nothing_that_ends_them(made, documents):
    data = [one.string for soup in documents.values() for one in soup.select(DATA)]
    assert [text for text in data if "<" in text] == []  # nor </script>, nor <!--
    labels = [
        name
        for text in data
        for layer in json.loads(text).get("layers", ())
        for name in layer["labels"]
    ]
    assert payloads.marks(" ".join(labels))
    assert {*labels} <= {shown(name, "terminal") for name in made.flight.names["point"].values()}


def test_every_name_is_found_again_as_text(made, documents):
    names = made.flight.names
    every = {*payloads.NAMES.values(), of_payloads.FOLDER, "<i>zq71</i>"}
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
    shown = {of_payloads.FLIGHT, of_payloads.FILE.replace("/", " ")}
    shown |= {*names["camera"].values(), *names["strip"].values(), *made.flight.columns}
    shown |= {names["exposure"]["E0"], names["exposure"]["E1"]}
    assert shown - found == set()


def test_no_notebook_warns(made):
    folders = (made.results / "notebooks", made.html.parents[1] / "_executed")
    files = [path for folder in folders for path in folder.glob("*.ipynb")]
    assert len(files) >= 12
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cells = [(p.name, c) for p in files for c in nbformat.read(p, as_version=4).cells]
    outputs = [(name, output) for name, cell in cells for output in cell.get("outputs", ())]
    drawn = [n for n, o in outputs if "image/svg+xml" in o.get("data", ())]
    assert drawn.count("02-synthetic-image.ipynb") >= 2 * 7  # of its pictures; run, and page
    assert [(name, o.text) for name, o in outputs if o.get("name") == "stderr"] == []
    papers = {name for name, o in outputs if "CAM1" in str(o)}  # of heads that this flight lacks
    assert not papers & {path.name for path in (made.results / "notebooks").glob("0[0-4]-*")}


def test_results_have_the_names_as_they_are(made):
    found, flown = results.read(made.results), flight.read(made.flight.path)
    names = {column: set(own.values()) for column, own in made.flight.names.items()}
    assert set(found.parameters["camera"]) == {"", *names["camera"]}
    assert set(flown.cameras) == names["camera"]
    assert set(found.residuals["image_or_exposure"]) - {""} <= names["image"] | names["exposure"]
    assert set(found.check_points["point"]) == names["point"]
    assert {f"heads/bundle/{name}" for name in names["camera"] - {flown.synthetic.camera}} <= set(
        found.summary
    )


def test_commands_say_names_without_control_characters(made):
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", made.said)
    assert made.flight.names["exposure"]["E0"] + ": done" in made.said


def test_images_are_rendered_into_their_folder(made):
    assert {path.parent for path in made.images.rglob("*")} == {made.images}
    assert len(list(made.images.glob("*.tif"))) == 2


def forwards(page):
    """Whether a page stands at an old address, and leads on."""
    return 'http-equiv="refresh"' in page.read_text("utf-8")


def test_nothing_happens_in_the_browser(browser, made):
    page = browser.new_page()
    happened = []
    page.on("dialog", lambda dialog: (happened.append(dialog.message), dialog.dismiss()))
    page.on("pageerror", lambda error: happened.append(str(error)))
    page.on(
        "request",
        lambda r: None if r.url.startswith(("file:", "data:", "blob:")) else happened.append(r.url),
    )
    for path in [
        *(page for page in made.html.glob("_executed/*.html") if not forwards(page)),
        made.html / "intro.html",
        made.html / "scorecard.html",
        made.html / "reproducibility.html",
        made.report,
    ]:
        page.goto(path.as_uri(), wait_until="load")
        page.evaluate("async () => { await window.MathJax?.startup?.promise; }")
        seen = page.evaluate(
            "() => [typeof window.pwned, document.querySelectorAll('mjx-merror').length]"
        )
        if seen != ["undefined", 0]:
            happened.append((path.name, seen))
    page.close()
    assert happened == []
