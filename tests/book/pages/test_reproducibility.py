"""What a book names as its sources."""

import subprocess
import tomllib

import pytest
import yaml

from acx4book.pages import reproducibility
from support.helpers import ROOT


def test_only_files_of_the_clone_count_as_changes(tmp_path, monkeypatch):
    def git(*arguments):
        who = ("-c", "user.name=A", "-c", "user.email=a@b.c")
        subprocess.run(["git", *who, *arguments], cwd=tmp_path, check=True, capture_output=True)

    git("init")
    (tmp_path / "a.py").write_text("one\n")
    git("add", "a.py")
    git("commit", "-m", "one")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_flight").mkdir()
    (tmp_path / "my_flight" / "flight.toml").write_text("")
    assert "with changes" not in reproducibility.short(reproducibility.commit())
    assert "differ" not in reproducibility.commit()
    (tmp_path / "a.py").write_text("two\n")
    assert reproducibility.commit().endswith(", 1 files differ")
    assert reproducibility.short(reproducibility.commit()).endswith(" with changes")


# --- What others made of the built book


@pytest.mark.parametrize(
    ("file", "brought_by"),
    [
        ("_static/mathjax/output/chtml/fonts/woff-v2/MathJax_Zero.woff", "sphinx-mathjax-offline"),
        ("_static/scripts/bootstrap.js", "pydata-sphinx-theme"),
        ("_static/searchtools.js", "Sphinx"),
    ],
)
def test_a_file_belongs_to_who_brings_it(file, brought_by):
    assert reproducibility.of(file).brought_by == brought_by


@pytest.mark.parametrize(
    "file", ["_static/moving/block.js", "_static/acx4.css", "_static/logo.svg", "intro.html"]
)
def test_our_own_belong_to_nobody_else(file):
    assert reproducibility.of(file) is None


def test_the_page_names_licences_and_repositories():
    page = reproducibility.licences_page()
    assert "| MathJax with its fonts | Apache-2.0 | sphinx-mathjax-offline " in page
    assert "| `niclasborlin/dbat` | 15 | BSD-like" in page


# --- What pages say of who made them


def test_people_and_groups_have_names_and_addresses_stand_where_they_are_given(tmp_path):
    file = tmp_path / "CITATION.cff"
    file.write_text(
        "title: 'a: b'\nversion: 1.0\nlicense: MIT\ndoi: 10.1/x\nrepository-code: https://h.org/x\n"
        "authors:\n - {given-names: Ada, family-names: Lovelace}\n - {name: Others}\n"
    )
    assert reproducibility.footer(file) == {
        "name": "a",
        "version": "1.0",
        "authors": "Ada Lovelace, Others",
        "licence": "MIT",
        "doi": "10.1/x",
        "repository": "https://h.org/x",
    }


def test_two_licences_are_those_of_code_and_text_and_the_sentence_has_title_and_version(tmp_path):
    file = tmp_path / "CITATION.cff"
    file.write_text(
        "title: 'a: b'\nversion: 1.0\nlicense: [MIT, CC-BY-4.0]\nauthors: [{name: Others}]\n"
    )
    assert reproducibility.footer(file)["licence"] == "code MIT, text CC BY 4.0"
    assert reproducibility.sentence(file) == "Others, *a: b*, version 1.0.\n"


def test_the_version_and_the_authors_are_those_of_the_package_and_of_the_book():
    said = reproducibility.footer(ROOT / "CITATION.cff")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    config = yaml.safe_load((ROOT / "book" / "_config.yml").read_text("utf-8"))
    assert said["version"] == project["version"]
    assert said["authors"] == config["author"] == project["authors"][0]["name"]
