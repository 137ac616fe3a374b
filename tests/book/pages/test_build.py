"""The pages are built: what is executed, the programming interface, and how it is reproduced."""

import re
import subprocess
import tomllib

import nbformat
import pytest
import yaml

from acx4book.pages import build, reproducibility
from support.helpers import ROOT

# --- executed notebooks as pages of the book -------------------------------------------------


def test_what_a_flight_has_nothing_of_is_left_out_with_its_heading(tmp_path):
    v4 = nbformat.v4
    figure = {"mystnb": {"figure": {"caption": "A figure.", "name": "fig-a"}}}
    instead = {"text/markdown": "The flight has no such block.", "text/plain": "Nothing"}

    def cell(source, data, **metadata):
        outputs = [v4.new_output("display_data", data=data)] if data else []
        return v4.new_code_cell(source, outputs=outputs, metadata=metadata)

    cells = [
        v4.new_markdown_cell("# Title"),
        v4.new_markdown_cell("## There\n\nThe next figure shows it."),
        cell("drawn", {"image/svg+xml": "<svg/>"}, **figure),
        v4.new_markdown_cell("It is a disc.", metadata={"tags": ["introduces"]}),
        cell("target", None, **figure),
        v4.new_markdown_cell("### Below\n\nThe next figure shows more."),
        cell("nothing", instead, **figure),
        v4.new_markdown_cell("## Not there\n\nThe next figure shows it."),
        cell("x = 1", None),
        cell("nothing", instead, **figure),
        cell('say("")', {"text/markdown": "", "text/plain": ""}, tags=["hide-input"]),
        v4.new_markdown_cell("## Told\n\nA table and a figure."),
        cell(
            "table",
            {"text/markdown": "| 1 |", "text/html": "1"},
            acx4={"caption": "T", "name": "t"},
        ),
        cell("nothing", instead, **figure),
    ]
    nbformat.write(v4.new_notebook(cells=cells), tmp_path / "a.ipynb")
    build.fold(tmp_path / "a.ipynb", tmp_path / "b.ipynb")
    page = nbformat.read(tmp_path / "b.ipynb", as_version=4)
    said = [c.source.splitlines()[0] for c in page.cells if c.cell_type == "markdown"]
    assert said == ["# Title", "## There", "## Told"]
    assert page.cells[-1].outputs[0].data["text/markdown"] == "The flight has no such block."
    assert "figure" not in page.cells[-1].metadata.get("mystnb", {})  # a sentence has no caption


# --- the pages of the programming interface: every room has one, cellars have none -----------


HOUSES = ("acx4lib", "acx4files", "acx4sim")
FILES = (
    *("acx4lib/block", "acx4lib/design", "acx4lib/model"),
    *("acx4files/conventions", "acx4sim/scenery"),
)
"""Rooms of one file."""


def test_every_room_has_a_page_in_the_book():
    toc = (ROOT / "book" / "_toc.yml").read_text("utf-8")
    listed = re.findall(r"_generated/api/([\w/]+)", toc)
    rooms = [
        path.parent for house in HOUSES for path in (ROOT / "src" / house).glob("*/__init__.py")
    ]
    folders = [*HOUSES, *(f"{r.parent.name}/{r.name}" for r in rooms)]
    assert sorted(listed) == sorted([*folders, *FILES])


@pytest.fixture
def written(tmp_path):
    """Return what writes the pages of some houses and rooms, and reads the first."""

    def pages(*names):
        files = [name.replace(".", "/") for name in names]
        (tmp_path / "_generated").mkdir()
        contents = "\n".join(f"- file: _generated/api/{file}" for file in files)
        (tmp_path / "_generated" / "_toc.yml").write_text(contents)
        build.write_api(tmp_path)
        texts = [(tmp_path / "_generated/api" / f"{file}.md").read_text("utf-8") for file in files]
        return texts[0]

    return pages


def test_a_page_has_the_docstring_a_table_and_a_section_for_every_module(written):
    """In the order of the room's docstring; cellars are left out."""
    page = written("acx4lib.bundle")
    assert page.startswith("# bundle\n")
    assert ".. automodule:: acx4lib.bundle\n   :no-members:\n" in page
    assert ".. autosummary:: \n   \n   unknowns\n" in page
    assert "\n## adjust\n" in page
    assert "\n## gross_errors\n" in page
    assert page.index("\n## network\n") < page.index("\n## adjust\n")
    assert "compiled" not in page


# --- what a book names as its sources --------------------------------------------------------


def test_stored_numbers_name_their_commit_and_what_changed_since(tmp_path, monkeypatch):
    def git(*arguments):
        who = ("-c", "user.name=A", "-c", "user.email=a@b.c")
        command = ["git", *who, *arguments]
        done = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)
        return done.stdout.strip()

    def committed(file):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(file)
        git("add", file)
        git("commit", "-m", file)
        return git("rev-parse", "HEAD")

    git("init")
    monkeypatch.chdir(tmp_path)
    first, second = committed("src/acx4lib/a.py"), committed("src/acx4lib/b.py")
    last = committed("book/page.md")
    said = reproducibility.of_stored
    assert said(last) == f"stored numbers of commit {last[:10]}"
    assert said(second) == f"stored numbers of commit {second[:10]}"
    assert said(f"{first}, 2 files differ") == (
        f"stored numbers of commit {first[:10]} with changes; "
        "the library has changed in 1 later commit"
    )
    assert said("0" * 40) == "stored numbers of commit 0000000000; not in this history"


# --- What others made of the built book


def test_the_page_names_licences_and_repositories():
    page = reproducibility.licences_page()
    assert "| MathJax with its fonts | Apache-2.0 | sphinx-mathjax-offline " in page
    assert "| `niclasborlin/dbat` | 15 | BSD-like" in page


# --- What pages say of who made them


def test_the_version_and_the_authors_are_those_of_the_package_and_of_the_book():
    said = reproducibility.footer(ROOT / "CITATION.cff")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    config = yaml.safe_load((ROOT / "book" / "_config.yml").read_text("utf-8"))
    assert said["version"] == project["version"]
    assert said["authors"] == config["author"] == project["authors"][0]["name"]


# --- Every line of the pages on a first flight and the library runs; its output stands under it


PAGE = (ROOT / "book" / "library.md").read_text("utf-8")
FILES_EXAMPLE = (ROOT / "book" / "your-files.md").read_text("utf-8")
FIRST_FLIGHT = (ROOT / "book" / "first-flight.md").read_text("utf-8")


@pytest.fixture(scope="module")
def printed():
    return list(build.outputs(PAGE))


@pytest.fixture(scope="module")
def flown():
    return list(build.outputs(FIRST_FLIGHT))


def places(page):
    """Return an empty text for every piece of code, and the names of included outputs."""
    place = r"^```(?:(?:python|shell)$|\{literalinclude\} _generated/(.*)$)"
    return re.findall(place, page, re.MULTILINE)


def expected(name, outputs):
    named = ([""] + [f"{name}-{n}.txt"] * bool(text) for n, text in enumerate(outputs, 1))
    return [one for piece in named for one in piece]


def test_the_output_of_every_piece_of_code_stands_under_it(printed, flown):
    assert places(PAGE) == expected("library", printed)
    assert places(FIRST_FLIGHT) == expected("first-flight", flown)


@pytest.mark.repeats
def test_other_programs_files_become_a_calibration():
    said = list(build.outputs(FILES_EXAMPLE))
    own = [name for name in places(FILES_EXAMPLE) if not name.startswith("imports-")]
    shown = [name for name in own if name]
    assert shown == [name for name in expected("your-files", said) if name]
    assert "still to do: my_flight/flight.toml:9: cameras.CAM.focal_mm: missing" in said[4]
    assert "check: " not in said[4]
    assert "notes" not in said[6]
    assert "results in my_results" in said[7]
    assert "for_opencv: CAM.yaml" in said[7]


def test_a_first_flight_keeps_the_promise_of_its_sigma(flown):
    errors = [float(line.split()[-1]) for line in flown[3].splitlines()[1:]]
    assert len(errors) == 14
    assert max(map(abs, errors)) < 3
    assert sum(abs(error) > 1 for error in errors) < 0.5 * len(errors)


def test_the_planted_sign_is_named(flown):
    assert "with pitch of opposite sign" in flown[5].split("notes")[1]


def test_the_estimate_from_tables_is_that_from_the_folder(printed):
    f = re.search(r"^f\s+mm\s+(\S+)", printed[2], re.MULTILINE)[1]
    assert printed[8] == f"f = {float(f):.4f} mm, as from the folder: True\n"


def test_mistakes_are_told_by_table_row_and_column(printed):
    begin = [line.split(";")[0] for line in printed[9].splitlines()]
    assert begin == [
        "calibration.image_points, row 7: sigma_px: 0.0",
        "calibration.image_points, row 7: image: 'C1_02' is unknown (did you mean 'C1-02'?)",
        "calibration.image_points, row 7: col_px: 'nan'",
    ]


def test_the_test_field_is_calibrated_within_its_sigma(printed):
    found, sigma = (
        [float(n) for n in re.findall(r"-?\d+\.\d+", line)[:3]]
        for line in printed[10].splitlines()[:2]
    )
    for value, true, own in zip(found, (50.4, 0.03, -0.02), sigma, strict=True):
        assert abs(value - true) < 4 * own


def test_a_free_network_has_seven_motions_open(printed):
    n_open, f, sigma = (float(n) for n in re.findall(r"\d+(?:\.\d+)?", printed[11]))
    assert n_open == 7
    assert abs(f - 50.4) < 4 * sigma


def test_pixels_have_sigma_near_what_the_height_alone_gives(printed):
    lines = printed[5].splitlines()
    sigma = [float(n) for n in lines[1].split()[4:]]
    assert sigma[2] == pytest.approx(0.5, abs=1e-3)
    assert all(0.01 < s < 1.0 for s in sigma[:2])
