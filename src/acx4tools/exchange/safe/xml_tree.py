"""XML as a tree whose elements know their line; without document types, entities and references."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from xml.parsers import expat

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.problems import Range, did_you_mean, quoted
from acx4lib.flight.tables import LONGEST_NUMBER, numbers_of
from acx4tools.exchange.safe.opened import Opened, refusal

DEEPEST = 100
"""Largest number of elements inside each other."""

MOST = 5_000_000
"""Largest number of elements of a file."""

NONE: Mapping[str, str] = MappingProxyType({})
"""Attributes of an element that has none: a file may have millions of them."""


@dataclass(kw_only=True, eq=False, slots=True)
class Element:
    """An element of an XML file.

    Attributes
    ----------
    file : str
    line : int
    tag : str
        Its name; with a name space, that and a space before it.
    attributes : mapping of str to str
    text : str
        Its own text, without spaces around it.
    below : sequence of Element
    """

    file: str
    line: int
    tag: str
    attributes: Mapping[str, str] = field(default_factory=lambda: NONE)
    text: str = ""
    below: Sequence[Element] = ()

    def wrong(self, found: str, expected: str, *, attribute: str = "") -> FlightError:
        """Return the error that says what is wrong with this element, or an attribute of it."""
        name = self.tag.rpartition(" ")[2]
        place = f"{name} {attribute}" if attribute else name
        return refusal(self.file, self.line, place, found, expected)

    def each(self, *tags: str) -> Iterator[Element]:
        """Yield all elements below this one along a path of names."""
        if not tags:
            yield self
            return
        for element in self.below:
            if element.tag == tags[0]:
                yield from element.each(*tags[1:])

    def everywhere(self, tag: str) -> Iterator[Element]:
        """Yield all elements of a name at any depth, in the order of the file."""
        for element in self.below:
            if element.tag == tag:
                yield element
            yield from element.everywhere(tag)

    def maybe(self, *tags: str) -> Element | None:
        """Return the first element below by these names, or None."""
        return next(self.each(*tags), None)

    def one(self, *tags: str) -> Element:
        """Return the element that must lie below by these names."""
        element = self
        for tag in tags:
            below = element.maybe(tag)
            if below is None:
                hint = did_you_mean(tag, {other.tag for other in element.below})
                raise element.wrong(f"<{tag}> is missing{hint}", "required")
            element = below
        return element

    def attribute(self, name: str) -> str:
        """Return a required attribute."""
        if name not in self.attributes:
            hint = did_you_mean(name, self.attributes.keys())
            raise self.wrong(f"is missing{hint}", "required", attribute=name)
        return self.attributes[name]

    def number(self, attribute: str = "", allowed: Range | None = None) -> float:
        """Return the text, or an attribute, as a finite number, inside a range if one is given."""
        text = self.attribute(attribute) if attribute else self.text
        value = float(numbers_of([text])[0]) if len(text) <= LONGEST_NUMBER else float("nan")
        if not abs(value) < float("inf"):
            raise self.wrong(quoted(text), "must be a finite number", attribute=attribute)
        if allowed is not None and value not in allowed:
            raise self.wrong(quoted(text), str(allowed), attribute=attribute)
        return value

    def whole(self, attribute: str = "") -> int:
        """Return the text, or an attribute, as a whole number."""
        text = self.attribute(attribute) if attribute else self.text
        if not re.fullmatch(r"\s*[+-]?\d{1,18}\s*", text, re.ASCII):
            raise self.wrong(quoted(text), "must be a whole number", attribute=attribute)
        return int(text)

    def numbers(self, n: int | None = None) -> Array:
        """Return the text as finite numbers with white space between them, `n` of them."""
        cells = self.text.split()
        values = numbers_of([cell if len(cell) <= LONGEST_NUMBER else "" for cell in cells])
        if (n is not None and len(values) != n) or not all(abs(values) < float("inf")):
            many = "numbers" if n is None else f"{n} numbers"
            raise self.wrong(quoted(self.text), f"must be {many}")
        return values


def tree(source: Opened) -> Element:
    """Return the outermost element of an XML file.

    Parameters
    ----------
    source : Opened
        In an encoding that it declares, or UTF-8.

    Raises
    ------
    FlightError
        Where it is no XML, has a document type, or more or deeper elements than are read.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    builder = _Builder(source=source, parser=parser)
    parser.StartDoctypeDeclHandler = builder.refuse_document_type
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.say
    try:
        parser.Parse(source.data, True)
    except expat.ExpatError as error:
        fault = expat.ErrorString(error.code)
        raise source.wrong("file", fault, "must be valid XML", line=error.lineno) from None
    except (LookupError, ValueError):  # an encoding that Python has not, or not so
        fault = "its encoding is not known"
        raise source.wrong("file", fault, "must be UTF-8") from None
    return builder.root


@dataclass(kw_only=True, eq=False)
class _Builder:
    """The handlers of the parser, and the tree that they build."""

    source: Opened
    parser: expat.XMLParserType
    open: list[Element] = field(default_factory=list)
    below: list[list[Element]] = field(default_factory=list)
    said: list[list[str]] = field(default_factory=list)
    count: int = 0

    def __post_init__(self) -> None:
        self.root = Element(file=self.source.file, line=1, tag="")

    def refuse_document_type(self, *_: object) -> None:
        line = self.parser.CurrentLineNumber
        fault, expected = "<!DOCTYPE> may name entities and other files", "must be without it"
        raise self.source.wrong("file", fault, expected, line=line)

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self.count += 1
        if self.count > MOST or len(self.open) >= DEEPEST:
            fault = f"more than {MOST} elements, or {DEEPEST} inside each other"
            raise self.source.wrong("file", fault, "must have fewer", line=line)
        file = self.source.file
        element = Element(file=file, line=line, tag=tag, attributes=attributes or NONE)
        if self.open:
            self.below[-1].append(element)
        else:
            self.root = element
        self.open.append(element)
        self.below.append([])
        self.said.append([])

    def say(self, text: str) -> None:
        self.said[-1].append(text)

    def end(self, _: str) -> None:
        element = self.open.pop()
        element.text = "".join(self.said.pop()).strip()
        element.below = self.below.pop() or ()  # an empty list would need memory
