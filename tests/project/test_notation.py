"""The page of symbols names what there is in the code and in files."""

import re

import pytest

from acx4lib.geometry.parameters import REPORTED
from support.helpers import ROOT

ROWS = re.findall(
    r"^\* - (.*?)(?=^\* - |^```)",
    (ROOT / "book" / "notation.md").read_text(encoding="utf-8"),
    flags=re.MULTILINE | re.DOTALL,
)
SOURCES = "\n".join(
    path.read_text(encoding="utf-8") for path in sorted((ROOT / "src" / "acx4lib").rglob("*.py"))
)
NAMES = sorted({name for row in ROWS for name in re.findall(r"`(\w+)`", row.rpartition("  -")[2])})


def test_rows_have_symbol_meaning_unit_place_and_name():
    assert len(ROWS) > 30
    assert {row.count("\n  -") for row in ROWS} == {4}


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_used_by_the_library(name):
    assert re.search(rf"(?<!\w){name}(?!\w)", SOURCES)


def test_every_parameter_that_is_reported_has_a_row():
    names = set(NAMES)
    assert {name for name, _ in REPORTED.values()} <= names


def test_every_word_of_the_glossary_stands_in_the_table_of_languages():
    page = (ROOT / "book" / "glossary.md").read_text(encoding="utf-8")
    defined = page.partition("```{glossary}")[2].partition("```")[0].split("\n\n")[1:]
    translated = re.findall(r"^\| \{term\}`([^`]+)` \|(?: \S.*? \|){3}$", page, flags=re.MULTILINE)
    assert [*translated] == sorted(translated, key=str.lower)
    for entry in defined:
        assert {*re.findall(r"^\S.*$", entry, flags=re.MULTILINE)} & {*translated}, entry
    assert len(translated) == len(defined)
