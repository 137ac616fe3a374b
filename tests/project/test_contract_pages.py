"""The pages of the contract have every key, column and command that the program has."""

import re

import pytest

from acx4book.command.acx4 import app
from acx4lib.flight.settings import CHOICES, KEYS
from acx4lib.flight.tables import SCHEMAS
from support.helpers import ROOT


def table_of(page, name):
    """Return the text of a table of a page of the book."""
    text = (ROOT / "book" / f"{page}.md").read_text("utf-8")
    return text.partition(f":name: {name}\n")[2].partition("\n```")[0]


@pytest.mark.parametrize("where", KEYS, ids=".".join)
def test_every_key_of_flight_toml_is_explained(where):
    explained = table_of("flight-toml", "tab-flight-toml")
    for key in KEYS[where]:
        as_table = "[" + ".".join((*where, key))
        assert f"`{key}`" in explained or as_table in explained, key


@pytest.mark.parametrize("where", CHOICES, ids=".".join)
def test_every_choice_of_a_key_is_on_the_page(where):
    page = (ROOT / "book" / "flight-toml.md").read_text("utf-8")
    for value in CHOICES[where]:
        assert f'"{value}"' in page or f"`{value}`" in page, value


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_column_is_explained(name):
    row = table_of("flight-tables", "tab-flight-tables").partition(f"* - `{name}`")[2]
    row = row.partition("\n* - ")[0]
    required, optional = re.sub(r"\[.*?\]", "", row, flags=re.DOTALL), row
    schema = SCHEMAS[name]
    assert all(f"`{column}`" in required for column in schema.required)
    assert all(f"`{column}`" in optional for column in schema.known)


def test_every_command_is_in_the_table():
    listed = table_of("commands", "tab-commands")
    for command in app.registered_commands:
        name = command.name or command.callback.__name__
        assert f"`acx4 {name} " in listed, name
