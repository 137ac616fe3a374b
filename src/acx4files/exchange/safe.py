"""Files of other programs: read, or refused in one line that names file, line and element.

Text is cut into cells, binary files into records; JSON and XML become trees whose every node knows
its place. No entity is expanded, no external reference followed, nothing unpacked onto the disk.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, cast
from xml.etree import ElementTree as ET
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from acx4files.flight.problems import Problem, Range, quoted
from acx4files.flight.tables import numbers_of
from acx4lib.errors import FlightError
from acx4lib.expected import Array

LARGEST = float(np.finfo(float).max)
FINITE = Range(-LARGEST, LARGEST, "must be a finite number, decimal point")

TEXT_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Byte-order marks of UTF-16, which spreadsheets on Windows write."""


@dataclass(frozen=True, kw_only=True)
class Opened:
    """The content of a file.

    Attributes
    ----------
    file : str
        Its path, as messages name it.
    data : bytes
    encoding : str
        Of its text, where it is neither UTF-8 nor UTF-16 with its mark; empty otherwise.
    """

    file: str
    data: bytes
    encoding: str = ""

    @property
    def name(self) -> str:
        """Its name without folders."""
        return Path(self.file).name

    @property
    def sha256(self) -> str:
        """Its checksum."""
        return hashlib.sha256(self.data).hexdigest()

    def wrong(self, element: str, found: str, expected: str, *, line: int = 1) -> FlightError:
        """Return the error that says what is wrong at an element, and what should be there."""
        return refusal(self.file, line, element, found, expected)

    def text(self) -> str:
        r"""Return the content as text, ends of lines as ``\n``.

        Raises
        ------
        FlightError
            Where it is neither UTF-8 nor, with its mark, UTF-16.
        """
        code = self.encoding or ("utf-16" if self.data[:2] in TEXT_MARKS else "utf-8-sig")
        try:
            text = self.data.decode(code)
        except UnicodeDecodeError as error:
            line = self.data.count(b"\n", 0, error.start) + 1
            fault = f"byte 0x{self.data[error.start]:02x} is not {code[:6].rstrip('-').upper()}"
            raise self.wrong("file", fault, "must be UTF-8 text", line=line) from None
        null = text.find("\0")
        if null >= 0:
            fault, line = "holds a null character", text.count("\n", 0, null) + 1
            raise self.wrong("file", fault, "must be text", line=line)
        return text.replace("\r\n", "\n").replace("\r", "\n")


def of_windows(source: Opened) -> Opened:
    """Return a file as text of Windows-1252 if it is not UTF-8 nor UTF-16, else as it is."""
    try:
        source.data.decode("utf-16" if source.data[:2] in TEXT_MARKS else "utf-8")
    except UnicodeDecodeError:
        return replace(source, encoding="cp1252")
    return source


def refusal(file: str, line: int, element: str, found: str, expected: str) -> FlightError:
    """Return the error for a problem at one place of a file."""
    problem = Problem(file=file, line=line, column=element, found=found, expected=expected)
    return FlightError([str(problem)])


def read(path: Path) -> Opened:
    """Return the content of a regular file.

    Raises
    ------
    FlightError
        Where it is not there, no regular file, or empty.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        why = {FileNotFoundError: "is not there", IsADirectoryError: "is no file"}
        fault = why.get(type(error), f"cannot be read ({error.strerror})")
        raise refusal(str(path), 1, "file", fault, "the import needs it") from None
    if not data:
        raise refusal(str(path), 1, "file", "is empty", "must have content")
    return Opened(file=str(path), data=data)


def inside(folder: Path, name: str, wrong: Callable[[str, str], FlightError]) -> Path:
    """Return the path of a file that another one names; it must lie below a folder.

    Raises
    ------
    FlightError
        By `wrong`, from what is wrong and what is expected, for any other path.
    """
    parts = PurePosixPath(name.replace("\\", "/"))
    if parts.is_absolute() or ".." in parts.parts or ":" in name or "\0" in name:
        raise wrong(quoted(name), "must lie below the project's folder")
    return folder / parts


@contextmanager
def told(wrong: Callable[[str, str], FlightError], expected: str) -> Iterator[None]:
    """Make what a library says of a value, a ValueError, the error of a place in a file."""
    try:
        yield
    except ValueError as error:
        raise wrong(" ".join(str(error).split()), expected) from None


def checksums(sources: Iterable[Opened]) -> dict[str, str]:
    """Return the checksums of files by their names without folders."""
    return {source.name: source.sha256 for source in sources}


def member(source: Opened, name: str) -> Opened:
    """Return a member of a ZIP archive, read in memory.

    Parameters
    ----------
    source : Opened
        The archive.
    name : str
        Of the member, as the archive has it.

    Raises
    ------
    FlightError
        Where it is no archive, or has no such member.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(source.data)) as archive:
            data = archive.read(name)
    except KeyError:
        raise source.wrong("archive", f"has no member {name!r}", "required") from None
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, ValueError) as error:
        fault = f"is no ZIP archive that can be read ({str(error) or type(error).__name__})"
        raise source.wrong("archive", fault, "must be a whole ZIP archive") from None
    return Opened(file=f"{source.file}/{name}", data=data)


def _number(text: str, allowed: Range, wrong: Callable[[str, str], FlightError]) -> float:
    """Return a finite number inside a range."""
    value = float(numbers_of([text])[0])
    for rule in (FINITE, allowed):
        if value not in rule:
            raise wrong(quoted(text), str(rule))
    return value


# --- Text, cut into cells


_CELL = re.compile(r'"([^"]*+)"|\'([^\']*+)\'|(\S++)')
"""Between white space; a quotation mark without another is a letter."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Line:
    """A line of a text file.

    Attributes
    ----------
    file : str
    number : int
        From 1.
    cells : tuple of str
        Without the quotes and spaces around them.
    """

    file: str
    number: int
    cells: tuple[str, ...]

    def __len__(self) -> int:
        """Count the cells."""
        return len(self.cells)

    def wrong(self, element: str, found: str, expected: str) -> FlightError:
        """Return the error that says what is wrong in this line."""
        return refusal(self.file, self.number, element, found, expected)

    def cell(self, k: int, element: str) -> str:
        """Return a cell that must be there; `element` is its name in messages."""
        if k >= len(self.cells):
            fault = f"is missing, the line has {len(self.cells)} cells"
            raise self.wrong(element, fault, f"must be cell {k + 1}")
        return self.cells[k]

    def number_at(self, k: int, element: str, allowed: Range = FINITE) -> float:
        """Return a cell as a finite number inside a range."""
        return _number(self.cell(k, element), allowed, partial(self.wrong, element))

    def whole_at(self, k: int, element: str) -> int:
        """Return a cell as a whole number."""
        text = self.cell(k, element)
        if not re.fullmatch(r"[+-]?\d{1,18}", text, re.ASCII):
            raise self.wrong(element, quoted(text), "must be a whole number")
        return int(text)

    def numbers(self, first: int, last: int | None, element: str, allowed: Range = FINITE) -> Array:
        """Return the cells from `first` to before `last` as finite numbers in a range."""
        if last is not None:
            self.cell(last - 1, element)
        values = numbers_of(self.cells[first:last])
        good = (values >= allowed.low) & (values <= allowed.high)
        if not good.all():
            self.number_at(first + int(np.argmin(good)), element, allowed)
        return values


def lines(source: Opened, *, separator: str | None = None, comment: str = "") -> Iterator[Line]:
    """Yield the lines of a text that are not blank, cut into cells.

    Parameters
    ----------
    source : Opened
    separator : str, optional
        A character; by default white space. Cells in quotes may contain it.
    comment : str
        What lines begin with that are left out, such as "#"; none by default.
    """
    for number, text in enumerate(source.text().split("\n"), start=1):
        if text.strip() and not (comment and text.lstrip().startswith(comment)):
            yield Line(file=source.file, number=number, cells=cut(text, separator))


def cut(text: str, separator: str | None = None) -> tuple[str, ...]:
    """Return the cells of one line, without the quotes and spaces around them."""
    if separator is None:
        if '"' not in text and "'" not in text:
            return tuple(text.split())
        return tuple("".join(match.groups("")) for match in _CELL.finditer(text))
    if '"' not in text:
        return tuple(cell.strip() for cell in text.split(separator))
    (row,) = csv.reader([text], delimiter=separator, skipinitialspace=True)
    return tuple(cell.strip() for cell in row)


# --- Binary files


def records(source: Opened, layout: np.dtype[Any]) -> NDArray[Any]:
    """Return the records of a file that has one layout throughout, shape (n,).

    Parameters
    ----------
    source : Opened
    layout : dtype
        Of one record, with its byte order.

    Raises
    ------
    FlightError
        Where the file does not hold a whole number of records.
    """
    size = len(source.data)
    if size % layout.itemsize:
        expected = f"must be a multiple of {layout.itemsize}, one record; is it cut off?"
        raise source.wrong("file", f"has {size} bytes", expected)
    return np.frombuffer(source.data, dtype=layout)


# --- JSON as a tree whose nodes know their place: the keys that lead to them, and the line


Key = str | int


@dataclass(frozen=True, kw_only=True)
class Node:
    """A value in a JSON file.

    Attributes
    ----------
    source : Opened
    keys : tuple
        Names and numbers that lead to it.
    value : object
        As `json` gives it.
    """

    source: Opened
    keys: tuple[Key, ...] = ()
    value: Any = None

    def wrong(self, found: str, expected: str) -> FlightError:
        """Return the error that says what is wrong with this value."""
        place = ".".join(map(str, self.keys)) or "file"
        return self.source.wrong(place, found, expected, line=_line(self.source.text(), self.keys))

    def maybe(self, *keys: Key) -> Node | None:
        """Return the node below keys; None where it is absent or null."""
        value = self.value
        for key in keys:
            try:
                value = value[key]
            except (KeyError, IndexError, TypeError):
                return None
        if value is None:
            return None
        return replace(self, keys=(*self.keys, *keys), value=value)

    def one(self, *keys: Key) -> Node:
        """Return the node below keys; FlightError where it is absent or null."""
        node = self
        for key in keys:
            below = node.maybe(key)
            if below is None:
                raise node.wrong(f"{quoted(key)} is missing", "required")
            node = below
        return node

    def items(self) -> Iterator[tuple[str, Node]]:
        """Yield names and values of an object."""
        if not isinstance(self.value, dict):
            raise self.wrong(quoted(self.value), "must be an object")
        for key, value in self.value.items():
            yield key, replace(self, keys=(*self.keys, key), value=value)

    def each(self) -> Iterator[Node]:
        """Yield the values of a list."""
        if not isinstance(self.value, list):
            raise self.wrong(quoted(self.value), "must be a list")
        for k, value in enumerate(self.value):
            yield replace(self, keys=(*self.keys, k), value=value)

    def all(self, *keys: Key) -> Iterator[Node]:
        """Yield the values of a list below keys, which may be absent."""
        listed = self.maybe(*keys)
        yield from () if listed is None else listed.each()

    def text(self) -> str:
        """Return a value that must be text; a number counts as its text."""
        if isinstance(self.value, bool) or not isinstance(self.value, str | int):
            raise self.wrong(quoted(self.value), "must be text")
        return str(self.value)

    def number(self, allowed: Range = FINITE) -> float:
        """Return a value that must be a finite number inside a range."""
        is_number = isinstance(self.value, int | float) and not isinstance(self.value, bool)
        if not is_number or self.value not in allowed:
            raise self.wrong(quoted(self.value), str(allowed))
        return float(self.value)

    def numbers(self, n: int = -1, allowed: Range = FINITE) -> Array:
        """Return a list of `n` numbers, as in `number`, as an array; -1 is any length."""
        values = [node.number(allowed) for node in self.each()]
        if n not in (-1, len(values)):
            raise self.wrong(quoted(self.value), f"must be a list of {n} values")
        return np.array(values, dtype=float)


def json_tree(source: Opened) -> Node:
    """Return the root of a JSON file.

    Raises
    ------
    FlightError
        Where it is no JSON, or nested too deep to be read.
    """
    try:
        return Node(source=source, value=json.loads(source.text()))
    except (ValueError, RecursionError) as error:  # or a number of too many digits
        line, fault = getattr(error, "lineno", 1), getattr(error, "msg", "cannot be read")
        raise source.wrong("file", fault, "must be valid JSON", line=line) from None


_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*+"|[\[\]{}:,]|[^\s\[\]{}:,"]++', re.DOTALL)


def _line(text: str, keys: tuple[Key, ...]) -> int:
    """Return the line of a value of valid JSON, by the keys that lead to it."""
    path: list[Key] = []
    tokens = list(_TOKEN.finditer(text))
    for token, after in zip(tokens, [*tokens[1:], None], strict=True):
        mark = token[0]
        if path and isinstance(path[-1], str) and after and after[0] == ":":
            path[-1] = json.loads(mark)
        if tuple(path) == keys and mark not in ",:":
            return text.count("\n", 0, token.start()) + 1
        if mark in "[{":
            path.append(0 if mark == "[" else "")
        elif mark in "]}":
            path.pop()
        elif mark == "," and isinstance(path[-1], int):
            path[-1] += 1
    return 1


# --- XML as a tree whose elements know their line; without document types, entities and references


class Element(ET.Element):
    """An element of an XML file: its text has no spaces around it.

    Attributes
    ----------
    file : str
    line : int
    """

    file: str
    line: int

    def wrong(self, found: str, expected: str, *, attribute: str = "") -> FlightError:
        """Return the error that says what is wrong with this element, or an attribute of it."""
        name = self.tag.rpartition(" ")[2]
        return refusal(self.file, self.line, f"{name} {attribute}".strip(), found, expected)

    def each(self, path: str) -> Iterator[Element]:
        """Yield all elements below along a path of names, as ``cameras/camera``."""
        yield from cast("Iterator[Element]", self.iterfind(path))

    def maybe(self, path: str) -> Element | None:
        """Return the first element below along a path of names, or None."""
        return next(self.each(path), None)

    def one(self, path: str) -> Element:
        """Return the element that must lie below along a path of names."""
        element = self
        for tag in path.split("/"):
            below = element.maybe(tag)
            if below is None:
                raise element.wrong(f"<{tag}> is missing", "required")
            element = below
        return element

    @property
    def content(self) -> str:
        """Its own text."""
        return self.text or ""

    def attribute(self, name: str) -> str:
        """Return a required attribute."""
        if name not in self.attrib:
            raise self.wrong("is missing", "required", attribute=name)
        return self.attrib[name]

    def number(self, attribute: str = "", allowed: Range = FINITE) -> float:
        """Return the text, or an attribute, as a finite number inside a range."""
        text = self.attribute(attribute) if attribute else self.content
        return _number(text, allowed, partial(self.wrong, attribute=attribute))

    def numbers(self, n: int | None = None, allowed: Range = FINITE) -> Array:
        """Return the text as finite numbers with white space between them, `n` of them."""
        values = numbers_of(self.content.split())
        if (n is not None and len(values) != n) or not np.isfinite(values).all():
            many = "numbers" if n is None else f"{n} numbers"
            raise self.wrong(quoted(self.content), f"must be {many}")
        if not all(value in allowed for value in values):
            raise self.wrong(quoted(self.content), str(allowed))
        return values


def xml_tree(source: Opened) -> Element:
    """Return the outermost element of an XML file.

    Parameters
    ----------
    source : Opened
        In an encoding that it declares, or UTF-8. A name has its name space and a space before it.

    Raises
    ------
    FlightError
        Where it is no XML, or has a document type.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    builder = ET.TreeBuilder(element_factory=Element)

    def refuse(*_: object) -> None:
        fault, line = "<!DOCTYPE> may name entities and other files", parser.CurrentLineNumber
        raise source.wrong("file", fault, "must be without it", line=line)

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = cast("Element", builder.start(tag, attributes))
        element.file, element.line = source.file, parser.CurrentLineNumber

    def end(tag: str) -> None:
        element = builder.end(tag)
        element.text = (element.text or "").strip()

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(source.data, True)
    except expat.ExpatError as error:
        fault = expat.ErrorString(error.code)
        raise source.wrong("file", fault, "must be valid XML", line=error.lineno) from None
    except (LookupError, ValueError):  # an encoding that Python has not, or not so
        fault = "its encoding is not known"
        raise source.wrong("file", fault, "must be UTF-8") from None
    return cast("Element", builder.close())
