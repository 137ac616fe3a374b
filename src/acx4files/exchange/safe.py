"""Files of other programs: read, or refused in one line that names file, line and element.

Text is cut into cells, binary files into records; JSON and XML become trees whose every node knows
its place. No entity is expanded, no external reference followed, nothing unpacked onto the disk.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from acx4files.flight.problems import Problem, Range, quoted
from acx4files.flight.tables import numbers_of
from acx4lib.errors import FlightError
from acx4lib.expected import Array

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
        if not path.is_file():
            fault = "is no file" if path.exists() else "is not there"
            raise refusal(str(path), 1, "file", fault, "the import needs it")
        data = path.read_bytes()
    except OSError as error:
        fault = f"cannot be read ({error.strerror})"
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


UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, struct.error),
    *(NotImplementedError, RuntimeError, OSError, EOFError, ValueError),
)
"""Errors of `zipfile` for damaged archives."""


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
    except UNREADABLE as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        fault = f"is no ZIP archive that can be read ({reason})"
        raise source.wrong("archive", fault, "must be a whole ZIP archive") from None
    return Opened(file=f"{source.file}/{name}", data=data)


def _number(text: str, allowed: Range | None, wrong: Callable[[str, str], FlightError]) -> float:
    """Return a finite number, inside a range if one is given."""
    value = float(numbers_of([text])[0])
    if not math.isfinite(value):
        raise wrong(quoted(text), "must be a finite number, decimal point")
    if allowed is not None and value not in allowed:
        raise wrong(quoted(text), str(allowed))
    return value


def _whole(text: str, wrong: Callable[[str, str], FlightError]) -> int:
    if not re.fullmatch(r"\s*[+-]?\d{1,18}\s*", text, re.ASCII):
        raise wrong(quoted(text), "must be a whole number")
    return int(text)


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

    def number_at(self, k: int, element: str, allowed: Range | None = None) -> float:
        """Return a cell as a finite number, inside a range if one is given."""
        return _number(self.cell(k, element), allowed, partial(self.wrong, element))

    def whole_at(self, k: int, element: str) -> int:
        """Return a cell as a whole number."""
        return _whole(self.cell(k, element), partial(self.wrong, element))

    def numbers(
        self, first: int, last: int | None, element: str, allowed: Range | None = None
    ) -> Array:
        """Return the cells from `first` to before `last` as finite numbers in a range."""
        if last is not None:
            self.cell(last - 1, element)
        values = numbers_of(self.cells[first:last])
        low, high = (-np.inf, np.inf) if allowed is None else (allowed.low, allowed.high)
        good = (values >= low) & (values <= high) & np.isfinite(values)
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


# --- Binary files: records of one layout, or values one after another


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


@dataclass(kw_only=True)
class Cursor:
    """A place in a binary file, from which values are taken.

    Attributes
    ----------
    source : Opened
    at : int
        Bytes before it.
    """

    source: Opened
    at: int = 0

    @property
    def left(self) -> int:
        """Count the bytes that follow."""
        return len(self.source.data) - self.at

    def take(self, layout: str, element: str) -> tuple[Any, ...]:
        """Return the next values, by a layout of `struct`; `element` is their name in messages."""
        begin = self._skip(struct.calcsize(layout), element)
        return struct.unpack_from(layout, self.source.data, begin)

    def array(self, layout: np.dtype[Any], n: int, element: str) -> NDArray[Any]:
        """Return the next `n` records of a layout."""
        begin = self._skip(n * layout.itemsize, element)
        return np.frombuffer(self.source.data, dtype=layout, count=n, offset=begin)

    def text(self, element: str) -> str:
        """Return the next text, which a null byte ends."""
        end = self.source.data.find(b"\0", self.at)
        if end < 0:
            fault = f"text at byte {self.at} has no end"
            raise self.source.wrong(element, fault, "must end with a null byte")
        begin = self._skip(end + 1 - self.at, element)
        try:
            return self.source.data[begin:end].decode("utf-8")
        except UnicodeDecodeError:
            raise self.source.wrong(element, f"text at byte {begin}", "must be UTF-8") from None

    def _skip(self, size: int, element: str) -> int:
        """Move on, and return where that began."""
        if not 0 <= size <= self.left:
            fault = f"at byte {self.at}: {max(size, 0)} bytes, {self.left} are left"
            raise self.source.wrong(element, fault, "must be complete; is the file cut off?")
        self.at += size
        return self.at - size


# --- JSON as a tree whose nodes know their place: the keys that lead to them, and the line


Key = str | int
_LARGEST = float(np.finfo(float).max)

# A string without an end goes to that of the file, so that every character is looked at once.
_STRING = r'"(?:[^"\\]|\\.)*+"?'
_TOKEN = re.compile(rf'{_STRING}|[\[\]{{}}:,]|[^\s\[\]{{}}:,"]++', re.DOTALL)


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

    @property
    def place(self) -> str:
        """Its keys as messages name them."""
        return ".".join(map(str, self.keys)) or "file"

    def wrong(self, found: str, expected: str) -> FlightError:
        """Return the error that says what is wrong with this value."""
        line = _line(self.source.text(), self.keys)
        return refusal(self.source.file, line, self.place, found, expected)

    def maybe(self, *keys: Key) -> Node | None:
        """Return the node below keys; None where it is absent or null."""
        node = self
        for key in keys:
            value = node.value
            if isinstance(value, dict):
                value = value.get(key)
            elif isinstance(value, list) and isinstance(key, int) and key < len(value):
                value = value[key]
            else:
                value = None
            if value is None:
                return None
            node = Node(source=self.source, keys=(*node.keys, key), value=value)
        return node

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
            yield key, Node(source=self.source, keys=(*self.keys, key), value=value)

    def each(self) -> Iterator[Node]:
        """Yield the values of a list."""
        if not isinstance(self.value, list):
            raise self.wrong(quoted(self.value), "must be a list")
        for k, value in enumerate(self.value):
            yield Node(source=self.source, keys=(*self.keys, k), value=value)

    def text(self) -> str:
        """Return a value that must be text; a number counts as its text."""
        if isinstance(self.value, bool) or not isinstance(self.value, str | int):
            raise self.wrong(quoted(self.value), "must be text")
        return str(self.value)

    def number(self, allowed: Range | None = None) -> float:
        """Return a value that must be a finite number, inside a range if one is given."""
        value = self.value
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not abs(value) <= _LARGEST:
            raise self.wrong(quoted(value), "must be a finite number")
        if allowed is not None and value not in allowed:
            raise self.wrong(quoted(value), str(allowed))
        return float(value)

    def whole(self) -> int:
        """Return a value that must be a whole number."""
        value = self.number(Range(-(2.0**53), 2.0**53, "must be a whole number", whole=True))
        return int(value)

    def numbers(self, *shape: int, allowed: Range | None = None) -> Array:
        """Return nested lists of numbers, as in `number`, as an array; a length of -1 is any."""
        values: list[Node] = [self]
        for n in shape:
            for node in values:
                if not isinstance(node.value, list) or (n >= 0 and len(node.value) != n):
                    kind = "numbers" if n < 0 else f"{n} values"
                    raise node.wrong(quoted(node.value), f"must be a list of {kind}")
            values = [below for node in values for below in node.each()]
        flat = np.array([node.number(allowed) for node in values], dtype=float)
        return flat.reshape(shape if flat.size else [max(n, 0) for n in shape])


def json_tree(source: Opened) -> Node:
    """Return the root of a JSON file.

    Raises
    ------
    FlightError
        Where it is no JSON, or nested too deep to be read.
    """
    try:
        value = json.loads(source.text())
    except json.JSONDecodeError as error:
        raise source.wrong("file", error.msg, "must be valid JSON", line=error.lineno) from None
    except RecursionError:
        raise source.wrong("file", "is nested too deep", "must be less deep") from None
    except ValueError as error:  # a number of too many digits
        raise source.wrong("file", str(error).split(";")[0], "must be valid JSON") from None
    return Node(source=source, value=value)


def _line(text: str, keys: tuple[Key, ...]) -> int:
    """Return the line of a value of valid JSON, by the keys that lead to it."""
    path: list[Key] = []
    tokens = list(_TOKEN.finditer(text))
    for k, token in enumerate(tokens):
        mark, after = token[0], tokens[k + 1][0] if k + 1 < len(tokens) else ""
        if path and isinstance(path[-1], str) and after == ":":
            path[-1] = json.loads(mark)
            if tuple(path) == keys:
                return text.count("\n", 0, token.start()) + 1
        elif tuple(path) == keys and mark not in ",:":
            return text.count("\n", 0, token.start()) + 1
        if mark in "[{":
            path.append(0 if mark == "[" else "")
        elif mark in "]}" and path:
            path.pop()
        elif mark == "," and path and isinstance(path[-1], int):
            path[-1] += 1
    return 1


# --- XML as a tree whose elements know their line; without document types, entities and references


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
    below : list of Element
    """

    file: str
    line: int
    tag: str
    attributes: Mapping[str, str] = field(default_factory=dict)
    text: str = ""
    below: list[Element] = field(default_factory=list)

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
                raise element.wrong(f"<{tag}> is missing", "required")
            element = below
        return element

    def attribute(self, name: str) -> str:
        """Return a required attribute."""
        if name not in self.attributes:
            raise self.wrong("is missing", "required", attribute=name)
        return self.attributes[name]

    def number(self, attribute: str = "", allowed: Range | None = None) -> float:
        """Return the text, or an attribute, as a finite number, inside a range if one is given."""
        text = self.attribute(attribute) if attribute else self.text
        return _number(text, allowed, partial(self.wrong, attribute=attribute))

    def whole(self, attribute: str = "") -> int:
        """Return the text, or an attribute, as a whole number."""
        text = self.attribute(attribute) if attribute else self.text
        return _whole(text, partial(self.wrong, attribute=attribute))

    def numbers(self, n: int | None = None) -> Array:
        """Return the text as finite numbers with white space between them, `n` of them."""
        values = numbers_of(self.text.split())
        if (n is not None and len(values) != n) or not all(abs(values) < float("inf")):
            many = "numbers" if n is None else f"{n} numbers"
            raise self.wrong(quoted(self.text), f"must be {many}")
        return values


def xml_tree(source: Opened) -> Element:
    """Return the outermost element of an XML file.

    Parameters
    ----------
    source : Opened
        In an encoding that it declares, or UTF-8.

    Raises
    ------
    FlightError
        Where it is no XML, or has a document type.
    """
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    outside = Element(file=source.file, line=1, tag="")
    opened = [outside]

    def refuse(*_: object) -> None:
        fault, line = "<!DOCTYPE> may name entities and other files", parser.CurrentLineNumber
        raise source.wrong("file", fault, "must be without it", line=line)

    def start(tag: str, attributes: dict[str, str]) -> None:
        line = parser.CurrentLineNumber
        element = Element(file=source.file, line=line, tag=tag, attributes=attributes)
        opened[-1].below.append(element)
        opened.append(element)

    def say(text: str) -> None:
        opened[-1].text += text

    def end(_: str) -> None:
        element = opened.pop()
        element.text = element.text.strip()

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = say
    try:
        parser.Parse(source.data, True)
    except expat.ExpatError as error:
        fault = expat.ErrorString(error.code)
        raise source.wrong("file", fault, "must be valid XML", line=error.lineno) from None
    except (LookupError, ValueError):  # an encoding that Python has not, or not so
        fault = "its encoding is not known"
        raise source.wrong("file", fault, "must be UTF-8") from None
    return outside.below[0]
