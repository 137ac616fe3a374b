"""What is given away, and what must be said of it."""

import ast
import re
import subprocess
import zipfile

import nbformat
import pytest

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.pages import release
from acx4lib.flight import settings
from acx4lib.results import folder, own_folder
from acx4sim.designs import DESIGNS

FLIGHTS, RESULTS = f"flights is {settings.FORMAT}", f"results is {own_folder.FORMAT}"
SAID = (
    f"# Changelog\n\n## 1.2.0, 2026-01-02\n\n- The format of {FLIGHTS}.\n- The format of\n"
    f"  {RESULTS}; all older ones are read.\n\n## 1.1.0\n\n- x\n"
)


def test_a_changelog_that_says_it_all_has_no_problems():
    assert release.problems(SAID, "1.2.0") == []


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        (SAID.replace("## 1.2.0", "## 1.1.9"), "begins with '1.1.9, 2026-01-02'; the version is 1"),
        (SAID.replace("2026-01-02", "unreleased"), "calls 1.2.0 unreleased"),
        (SAID.replace(FLIGHTS, "flights is 2"), f'"The format of {FLIGHTS}"'),
        (SAID.replace(RESULTS, "results is x"), f'"The format of {RESULTS}"'),
    ],
)
def test_what_it_does_not_say_is_named(said, expected):
    (line,) = release.problems(said, "1.2.0")
    assert expected in line


def test_a_project_is_packed_as_it_is_tracked_and_can_be_packed_again(tmp_path, monkeypatch):
    clone, unpacked = tmp_path / "clone", tmp_path / "unpacked"
    (clone / "src").mkdir(parents=True)
    (clone / "run").write_text("#!/bin/sh\n")
    (clone / "run").chmod(0o755)
    (clone / "src" / "one.py").write_text("x = 1\n")
    (clone / "link").symlink_to("src")
    (clone / "left_by_a_run").write_text("no\n")
    for command in ("init -q", "add run src link"):
        subprocess.run(["git", *command.split()], cwd=clone, check=True)
    monkeypatch.chdir(clone)
    release.offered(tmp_path, 315_532_800)
    with zipfile.ZipFile(tmp_path / "acx4lib.zip") as held:
        held.extractall(unpacked)
        modes = {one.filename: one.external_attr >> 16 for one in held.infolist()}
    assert [*modes] == [f"acx4lib/{n}" for n in ("link", "run", "src/one.py", "FILES.txt")]
    assert modes["acx4lib/link"] == release.LINK
    assert modes["acx4lib/run"] & 0o111
    folder = unpacked / "acx4lib"
    (folder / "link").unlink()  # zipfile, other than unzip, makes a file of a link
    (folder / "link").symlink_to("src")
    (folder / "run").chmod(0o755)
    monkeypatch.chdir(folder)
    (tmp_path / "again").mkdir()
    release.offered(tmp_path / "again", 315_532_800)
    first, second = tmp_path / "acx4lib.zip", tmp_path / "again" / "acx4lib.zip"
    assert first.read_bytes() == second.read_bytes()
    (folder / release.LIST).unlink()
    assert "not made from a clone" in release.offered(tmp_path, 315_532_800)


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A working copy of a package of one module, committed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["setuptools"]\nbuild-backend = "setuptools.build_meta"\n'
        '[project]\nname = "acx4lib"\nversion = "1.2.0"\n[tool.setuptools]\npy-modules = ["one"]\n'
    )
    (tmp_path / "one.py").write_text("")
    (tmp_path / "CHANGELOG.md").write_text(SAID.replace("2026-01-02", "unreleased"))
    (tmp_path / "CITATION.cff").write_text(
        "title: acx4lib\nversion: 1.2.0\nlicense: MIT\nauthors: [{name: us}]\n"
    )
    (tmp_path / ".gitignore").write_text("build/\nhtml/\n")
    (tmp_path / "html" / "a").mkdir(parents=True)
    for name in ("index.html", "a/x.html"):
        (tmp_path / "html" / name).write_text("book")
    monkeypatch.setenv("GIT_COMMITTER_DATE", "1700000000 +0000")
    who = ("-c", "user.name=us", "-c", "user.email=us@example.org")
    for arguments in (("init", "-q"), ("add", "."), (*who, "commit", "-qm", "all")):
        subprocess.run(["git", *arguments], check=True)
    return tmp_path


@pytest.mark.slow
def test_wheel_and_book_are_the_same_from_the_same_commit(clone):
    first = release.make(clone / "html", clone / "build")
    (clone / "html" / "index.html").chmod(0o600)
    second = release.make(clone / "html", clone / "build")
    assert first == second
    version, wheel, book, problem = first
    assert version.startswith("acx4lib 1.2.0, commit ")
    assert book.endswith("acx4lib-book-1.2.0.zip")
    assert wheel.endswith("acx4lib-1.2.0-py3-none-any.whl")
    assert "calls 1.2.0 unreleased" in problem
    with zipfile.ZipFile(clone / "build" / "acx4lib-book-1.2.0.zip") as held:
        names = [f"acx4lib-book-1.2.0/{name}" for name in ("a/x.html", "index.html")]
        assert held.namelist() == names
        assert {entry.date_time for entry in held.infolist()} == {(2023, 11, 14, 22, 13, 20)}


def test_changed_files_are_not_released(clone):
    (clone / "one.py").write_text("changed = True")
    with pytest.raises(release.ReleaseError, match="1 files differ from the last commit"):
        release.make(clone / "html", clone / "build")


# --- Notebooks as they are downloaded


SOURCES = {
    path.stem: path
    for pattern in ("[0-9]*.ipynb", "foundations/*.ipynb", "template/study.ipynb")
    for path in sorted(NOTEBOOKS_PATH.glob(pattern))
}


@pytest.fixture(scope="module")
def copies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("copies")
    release.write(folder)
    return {path.relative_to(folder): nbformat.read(path, 4) for path in folder.rglob("*.ipynb")}


def code(copies, name):
    notebook = copies[SOURCES[name].relative_to(NOTEBOOKS_PATH)]
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def test_every_notebook_has_a_copy_without_outputs(copies):
    assert set(copies) == {path.relative_to(NOTEBOOKS_PATH) for path in SOURCES.values()}
    for copy in copies.values():
        nbformat.validate(copy)
        assert all(not cell.get("outputs") for cell in copy.cells)
        assert "acx4lib.zip" in copy.cells[0].source
        assert copy.cells[1].source == release.INSTALL


def test_no_copy_reads_below_the_project(copies):
    for name in SOURCES:
        source = "\n".join(code(copies, name))
        assert not re.search(r"\.\./|[\"'](data|build)/", source), name
        ast.parse(source)


@pytest.mark.parametrize("name", release.BEFORE)
def test_a_notebook_with_a_flight_makes_it_after_its_parameters(copies, name):
    _, parameters, start, *_ = code(copies, name)
    values = {node.target.id: node.value.value for node in ast.parse(parameters).body}
    (call,) = (
        node
        for node in ast.walk(ast.parse(start))
        if isinstance(node, ast.Call) and node.func.attr == "prepare"
    )
    given = {word.arg: eval(ast.unparse(word.value), values) for word in call.keywords}
    assert given["design"] in DESIGNS
    assert set(given["stages"]) <= set(folder.STAGES)
    assert values["results_path"] == f"results-{name}"
    assert values.get("flight_path", f"flight-{given['design']}") == f"flight-{given['design']}"
    flight, results = map(ast.unparse, call.args)
    assert results == "results_path"
    if "flight_path" in values:
        assert flight == "flight_path"
    else:
        assert f'if results_path == "results-{name}"' in start


def test_notebooks_that_read_a_flight_or_results_are_those_that_make_them():
    reads = {
        n for n, p in SOURCES.items() if re.search(r"(flight|results)_path: str", p.read_text())
    }
    assert reads == set(release.BEFORE)
