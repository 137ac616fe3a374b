"""What pages say of who made them."""

import tomllib

import yaml

from acx4book.pages.back import citation
from support.helpers import ROOT


def test_people_and_groups_have_names_and_addresses_stand_where_they_are_given(tmp_path):
    file = tmp_path / "CITATION.cff"
    file.write_text(
        "title: 'a: b'\nversion: 1.0\nlicense: MIT\ndoi: 10.1/x\nrepository-code: https://h.org/x\n"
        "authors:\n - {given-names: Ada, family-names: Lovelace}\n - {name: Others}\n"
    )
    assert citation.footer(file) == {
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
    assert citation.footer(file)["licence"] == "code MIT, text CC BY 4.0"
    assert citation.sentence(file) == "Others, *a: b*, version 1.0.\n"


def test_the_version_and_the_authors_are_those_of_the_package_and_of_the_book():
    said = citation.footer(ROOT / "CITATION.cff")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    config = yaml.safe_load((ROOT / "book" / "_config.yml").read_text("utf-8"))
    assert said["version"] == project["version"]
    assert said["authors"] == config["author"] == project["authors"][0]["name"]
