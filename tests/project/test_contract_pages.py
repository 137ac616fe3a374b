"""The pages of the contract have every key, column and command that the program has."""

import re

import pytest

from acx4book.command.acx4 import app
from acx4lib.flight.tables import SCHEMAS
from support.helpers import ROOT, book_extension

key_tables = book_extension("key_tables")


def table_of(page, name):
    """Return the text of a table of a page of the book."""
    text = (ROOT / "book" / f"{page}.md").read_text("utf-8")
    return text.partition(f":name: {name}\n")[2].partition("\n```")[0]


@pytest.mark.parametrize(
    ("page", "name"), [("flight-toml", "flight"), ("planning", "plan"), ("planning", "target")]
)
def test_every_key_of_a_toml_file_is_explained(page, name):
    text = table_of(page, f"tab-{name}-toml")
    listed = [*key_tables.explained(text, key_tables.TABLES[name])]
    assert all(meaning for *_, meaning in listed)
    assert len(listed) == 1 + sum(line.startswith("`") for line in text.splitlines())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("`minutes`\n: Time.", "not explained: sigma.f_mm"),
        ("`hours`\n: Time.", "`hours`: no such key"),
        ("`minutes`, `candidates`\n: Two.", "`minutes`, `candidates`: .* and strips by name"),
    ],
)
def test_a_page_that_does_not_fit_the_declaration_is_refused(text, says):
    with pytest.raises(ValueError, match=says):
        list(key_tables.explained(text, key_tables.TABLES["target"]))


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
