"""Chapters that depend on no flight, with two small ones in the place of the book's."""

import json
import re
import shutil

import nbformat
import pytest
import yaml

from acx4book.pages import api, independent
from support.helpers import ROOT, write_notebook


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """A working copy with two chapters; each run of one leaves a line in its file."""
    for name in ("01-one", "02-two"):
        ran = f"from pathlib import Path\nprint('a', file=Path('ran-{name}').open('a'))"
        write_notebook(tmp_path / "notebooks" / f"{name}.ipynb", "seed: int = 1", ran)
    (tmp_path / "environment.lock").write_text("numpy==2\n")
    (tmp_path / "data.csv").write_text("1\n")
    (tmp_path / "executed").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(independent, "NOTEBOOKS_PATH", tmp_path / "notebooks")
    monkeypatch.setattr(independent, "CHAPTERS", {"01-one": ("data.csv",), "02-two": ()})
    return tmp_path


def runs(copy):
    return [
        len(path.read_text().splitlines()) if (path := copy / f"ran-{name}").is_file() else 0
        for name in ("01-one", "02-two")
    ]


def test_they_run_once_until_what_they_depend_on_changes(copy):
    for _ in range(2):
        assert independent.bring(copy / "executed", copy / "ideal") == []
    assert runs(copy) == [1, 1]
    (copy / "data.csv").write_text("2\n")
    assert independent.bring(copy / "executed", copy / "ideal") == []
    assert runs(copy) == [2, 1]
    assert len(list((copy / independent.KEPT).iterdir())) == 2
    page = nbformat.read(copy / "executed" / "01-one.ipynb", as_version=4)
    assert page.cells[0].metadata.tags == ["injected-parameters", "hide-input"]


def test_for_another_flight_they_never_run_and_only_those_that_hold_are_there(copy):
    independent.bring(copy / "executed", copy / "ideal")
    (copy / "data.csv").write_text("2\n")
    (copy / "executed" / "01-one.ipynb").unlink()
    assert independent.bring(copy / "executed", None) == ["01-one"]
    assert runs(copy) == [1, 1]
    assert [path.name for path in (copy / "executed").iterdir()] == ["02-two.ipynb"]


def contents(folder):
    """Return the pages that a table of contents lists, in its order."""
    return re.findall(r"(?m)^\W*file: (\S+)$", (folder / "_toc.yml").read_text("utf-8"))


def test_what_is_left_out_is_in_no_contents_and_has_its_title_for_links(tmp_path):
    generated = tmp_path / "_generated"
    generated.mkdir()
    shutil.copy(ROOT / "book" / "_toc.yml", tmp_path)
    independent.leave_out(tmp_path, ["_executed/14-failure-clinic", api.FOLDER])
    left = [page for page in contents(ROOT / "book") if not page.startswith(api.FOLDER)]
    left.remove("_executed/14-failure-clinic")
    assert contents(generated) == left
    assert json.loads((generated / "left_out.json").read_text("utf-8")) == {
        "_executed/14-failure-clinic": "The failure clinic",
        api.FOLDER: "",
    }
    independent.leave_out(tmp_path, [])
    assert yaml.safe_load((generated / "_toc.yml").read_text("utf-8")) == yaml.safe_load(
        (tmp_path / "_toc.yml").read_text("utf-8")
    )


def test_every_chapter_is_in_the_contents_and_reads_files_that_are_there(monkeypatch):
    monkeypatch.chdir(ROOT)
    contents = (ROOT / "book" / "_toc.yml").read_text("utf-8")
    for name, patterns in independent.CHAPTERS.items():
        assert f"_executed/{name}\n" in contents
        for pattern in patterns:
            assert pattern == "measured" or list(ROOT.glob(pattern))


def test_a_part_of_which_no_page_is_left_is_not_there(tmp_path):
    (tmp_path / "_generated").mkdir()
    (tmp_path / "_toc.yml").write_text((ROOT / "book" / "_toc.yml").read_text("utf-8"))
    independent.leave_out(tmp_path, [f"_executed/{name}" for name in independent.CHAPTERS])
    left = yaml.safe_load((tmp_path / "_generated" / "_toc.yml").read_text("utf-8"))
    assert all(part["chapters"] for part in left["parts"])
    captions = [part["caption"] for part in left["parts"]]
    assert "Foundations" not in captions
    assert "The paper" in captions
