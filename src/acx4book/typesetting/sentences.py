"""Sentences with numbers in the cells of notebooks: templates that a teacher can edit."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from acx4book.typesetting.labels import value_and_sigma
from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup, shown


@dataclass(frozen=True)
class Sentence:
    """Text in Markdown that Jupyter and the book show."""

    text: str

    def _repr_markdown_(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return self.text


def say(template: str, **values: Any) -> Sentence:
    """Fill a Jinja template with values.

    Text of a flight, such as the name of a point, is shown character for character; `Markup` is
    Markdown. The filters are ``fixed`` (decimals), ``signed`` (decimals, with a sign), ``digits``
    (significant ones), ``span`` (the least to the largest, once where they look alike), ``sci``
    (a power of ten), ``pm`` (``{{ value | pm(sigma) }}``), ``plural``
    (``{{ n | plural("point") }}``: 1 point, 2 points) and ``listed`` (text, with commas between);
    sequences of numbers are joined by commas.

    Parameters
    ----------
    template : str
        In Markdown; lines may be indented as the cell is.
    values
        By their names in the template.

    Raises
    ------
    jinja2.UndefinedError
        For a name without a value.
    """
    lines = [line.strip() for line in _jinja().from_string(template).render(values).splitlines()]
    return Sentence("\n".join(lines).strip())


def sections(path: Path) -> dict[str, str]:
    """Return the text below each heading of the second level of a Markdown file, by the heading."""
    parts = [part.partition("\n") for part in path.read_text("utf-8").split("\n## ")[1:]]
    return {heading: text.strip() for heading, _, text in parts}


@cache
def _jinja() -> Environment:
    jinja = Environment(
        undefined=StrictUndefined, finalize=_finalized, trim_blocks=True, lstrip_blocks=True
    )
    jinja.filters |= {
        "fixed": lambda x, n=2: _each(x, f".{n}f"),
        "signed": lambda x, n=2: _each(x, f"+.{n}f"),
        "digits": lambda x, n=3: _each(x, f".{n}g"),
        "span": lambda values, n=2: " to ".join(
            dict.fromkeys(_each(end, f".{n}f") for end in (min(values), max(values)))
        ),
        "sci": lambda x, n=1: Markup(scientific(float(x), digits=n)),
        "plural": _plural,
        "pm": lambda x, sigma: Markup(value_and_sigma(x, sigma).replace("-", "\N{MINUS SIGN}")),
        "listed": lambda texts: Markup(", ".join(shown(text) for text in texts)),
    }
    return jinja


def _finalized(value: object) -> str:
    if isinstance(value, float):
        return _each(value, ".4g")
    return shown(value)


def _each(value: Any, spec: str) -> Markup:
    """Return a number in a format, or several with commas between them."""
    values = value if isinstance(value, Iterable) else (value,)
    return Markup(", ".join(format(float(x), spec) for x in values).replace("-", "\N{MINUS SIGN}"))


def _plural(number: Any, word: str, several: str = "") -> Markup:
    """Return a count with its noun in singular or plural."""
    return Markup(f"{int(number)} {word if int(number) == 1 else several or f'{word}s'}")
