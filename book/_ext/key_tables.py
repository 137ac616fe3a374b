"""Tables of the keys of a TOML file: the page says what a key means, the library what it may be."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from acx4book.planning.plan import PLAN
from acx4files.flight.settings import FLIGHT
from acx4files.flight.toml_file import NAME, Keys, Table, rows

TABLES = {"flight": FLIGHT, "plan": Table(keys=PLAN)}

FORM = "* - {}\n  - {}\n  - {}"


class KeyTable(SphinxDirective):
    """A table of keys, from lines of names in backticks, each followed by ``: `` and its meaning.

    Names in brackets are those of tables, to which the keys below them belong.
    """

    required_arguments = 1
    option_spec: ClassVar[dict[str, object]] = {
        "name": directives.unchanged_required,
        "caption": directives.unchanged_required,
    }
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the table; an error where a key is not explained, or is none."""
        try:
            listed = [*explained("\n".join(self.content), TABLES[self.arguments[0]])]
        except ValueError as error:
            raise self.error(str(error)) from error
        head = f"```{{list-table}} {self.options['caption']}\n:name: {self.options['name']}\n"
        head += ":header-rows: 1\n:widths: 22 26 52\n"
        text = "\n".join([head, *(FORM.format(*row) for row in listed), "```"])
        made = nodes.Element()
        self.state.nested_parse(StringList(text.split("\n"), "keys"), self.content_offset, made)
        return made.children


def explained(text: str, table: Table) -> Iterator[tuple[str, str, str]]:
    """Yield the head of a table of keys and its rows: the keys, what they may be, what they mean.

    Raises
    ------
    ValueError
        Where a key is not explained, does not exist, or keys of one row may be different things.
    """
    declared = {keys: says for keys, _, says in rows(table)}
    left, tables = dict(declared), [()]
    yield "key", "value", "meaning"
    for names, meaning in re.findall(r"^(`.*)\n: ((?:.|\n(?!`))*)", text, re.MULTILINE):
        listed = re.findall(r"`([^`]+)`", names)
        if listed[0].startswith("["):
            tables = [tuple(name.strip("[]").split(".")) for name in listed]
            keys = [_place(one, declared) for one in tables]
            says = {declared[one] for one in keys if one in declared}
        else:
            keys = [_place((*one, name), declared) for one in tables for name in listed]
            says = {declared.get(one, "") for one in keys}
        if len(says) > 1 or says == {""}:
            message = f"{names}: {' and '.join(sorted(says)) or 'no such key'}"
            raise ValueError(message)
        for one in keys:
            left.pop(one, None)
        yield names, "".join(says), " ".join(meaning.split())
    if left:
        message = f"not explained: {', '.join(map('.'.join, left))}"
        raise ValueError(message)


def _place(keys: Keys, declared: Mapping[Keys, str]) -> Keys:
    """Return dotted keys as they are declared; names that users give may be left out."""
    known = {tuple(key for key in one if key != NAME): one for one in declared}
    return known.get(tuple(key for key in keys if key != NAME), keys)


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("keys", KeyTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
