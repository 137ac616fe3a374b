"""Files of strangers: read within limits, or refused in one line that names file, line and element.

A file is opened once, or a member of a ZIP archive. Text is cut into cells, binary files into
records; JSON and XML become trees whose every node knows its place. No entity is expanded, no
external reference followed, nothing unpacked onto the disk.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from acx4files.flight import table_files
from acx4files.flight.problems import Problem, Range, did_you_mean, quoted
from acx4files.flight.tables import LONGEST_NUMBER, numbers_of
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


def read(path: Path, *, most: int | None = None) -> Opened:
    """Return the content of a regular file.

    Parameters
    ----------
    path : Path
    most : int, optional
        Largest size, bytes; by default what the free memory allows.

    Raises
    ------
    FlightError
        Where it is not there, no regular file, or too large.
    """
    data, problems = table_files.read_bytes(path, str(path), needed_by="the import", most=most)
    if problems:
        raise FlightError([str(problem) for problem in problems])
    if not data:
        raise refusal(str(path), 1, "file", "is empty", "must have content")
    return Opened(file=str(path), data=data)


@dataclass(kw_only=True)
class Together:
    """The files of one import: each is read once, and their sum is limited as one file is.

    A file that names others may name one of them a thousand times, by a thousand links.

    Attributes
    ----------
    size : int
        Bytes that were read so far, unpacked ones among them.
    """

    size: int = 0
    _known: dict[tuple[int, int], Path] = field(default_factory=dict)

    def read(self, path: Path) -> Opened:
        """Return the content of a file, as `read` does; FlightError where it was read before."""
        with suppress(OSError, ValueError):  # `read` says what is wrong with it
            status = path.stat()
            before = self._known.setdefault((status.st_dev, status.st_ino), path)
            if before is not path:
                fault = f"is the same file as {before}"
                raise refusal(str(path), 1, "file", fault, "must be a file of its own")
        return self.add(read(path))

    def add(self, one: Opened) -> Opened:
        """Return a file after its size was counted, such as a member of an archive."""
        self.size += len(one.data)
        if not table_files.fits(self.size):
            fault = f"makes {self.size} bytes of files and what is packed in them"
            raise one.wrong("file", fault, "must fit into free memory together")
        return one


def checksums(sources: Iterable[Opened]) -> dict[str, str]:
    """Return the checksums of files by their names without folders."""
    return {source.name: source.sha256 for source in sources}


# --- A member of a ZIP archive, read in memory; nothing is unpacked onto the disk


MOST_MEMBERS = 10_000
"""Largest number of members of an archive."""

MOST_BYTES = 300_000_000
"""Largest size of a member, bytes; the XML of 100 000 images has that."""

LARGEST_RATIO = 200
"""Largest ratio of a member's size to its packed size; text has about 10, a bomb 1000."""

AT_A_TIME = 50_000
"""Packed bytes between two looks at this ratio."""

UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, struct.error),
    *(NotImplementedError, RuntimeError, OSError, EOFError, ValueError),
)
"""Errors of `zipfile` for damaged archives."""


def member(source: Opened, name: str) -> Opened:
    """Return a member of a ZIP archive.

    Parameters
    ----------
    source : Opened
        The archive.
    name : str
        Of the member, as the archive has it.

    Raises
    ------
    FlightError
        Where it is no archive, has no such member, or one that is too large or encrypted.
    """
    try:
        packed = io.BytesIO(source.data)
        with zipfile.ZipFile(packed) as archive:
            entries = {entry.filename: entry for entry in archive.infolist()[: MOST_MEMBERS + 1]}
            if len(entries) > MOST_MEMBERS:
                expected = f"must have at most {MOST_MEMBERS}"
                raise source.wrong("archive", "has too many members", expected)
            if name not in entries:
                raise source.wrong("archive", f"has no member {name!r}", "required")
            entry = entries[name]
            _require_size(source, entry, entry.file_size, entry.compress_size)
            with archive.open(entry):  # it looks at the member's own header, and stops behind it
                begin = packed.tell()
            data = _unpacked(source, entry, begin)
    except UNREADABLE as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        fault = f"is no ZIP archive that can be read ({reason})"
        raise source.wrong("archive", fault, "must be a whole ZIP archive") from None
    return Opened(file=f"{source.file}/{name}", data=data)


def _unpacked(source: Opened, entry: zipfile.ZipInfo, begin: int) -> bytes:
    """Return a member's content; bytes are counted, since the header may say anything of them."""
    packed = memoryview(source.data)[begin : begin + entry.compress_size]
    if entry.compress_type == zipfile.ZIP_STORED:
        data = bytes(packed)
    elif entry.compress_type == zipfile.ZIP_DEFLATED:
        data = _inflated(source, entry, packed)
    else:
        raise NotImplementedError("neither deflated nor stored")
    if len(data) != entry.file_size or zlib.crc32(data) != entry.CRC:
        raise zipfile.BadZipFile("other bytes than its header says")
    return data


def _inflated(source: Opened, entry: zipfile.ZipInfo, packed: memoryview) -> bytes:
    stream, data = zlib.decompressobj(-zlib.MAX_WBITS), bytearray()
    for begin in range(0, len(packed), AT_A_TIME):
        part: bytes | memoryview = packed[begin : begin + AT_A_TIME]
        while part and not stream.eof:
            data += stream.decompress(part, LARGEST_RATIO * AT_A_TIME)
            part = stream.unconsumed_tail
            taken = begin + AT_A_TIME - len(part)
            _require_size(source, entry, len(data), taken)
    return bytes(data + stream.flush())


def _require_size(source: Opened, entry: zipfile.ZipInfo, size: int, packed: int) -> None:
    """Raise FlightError for a member too large, packed too densely, or with a password."""
    most = min(MOST_BYTES, LARGEST_RATIO * max(packed, 1))
    if size > most or not table_files.fits(size) or entry.flag_bits & 1:
        fault = f"{entry.filename!r} has {size} bytes packed into {packed}"
        expected = (
            f"must have at most {LARGEST_RATIO} times as many, fit into memory with "
            f"{MOST_BYTES} at most, and have no password"
        )
        raise source.wrong("archive", fault, expected)


# --- Text, cut into cells


LONGEST_LINE = 10_000_000
"""Largest number of characters of a line: COLMAP has all points of an image on one."""

_CELL = re.compile(r'"([^"]*+)"|\'([^\']*+)\'|(\S++)')
"""Between white space; a quotation mark without another is a letter."""

_SPACES = re.compile(r"\s*+")


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
        cell = self.cell(k, element)
        value = float(numbers_of([cell])[0]) if len(cell) <= LONGEST_NUMBER else float("nan")
        if not abs(value) < float("inf"):
            raise self.wrong(element, quoted(cell), "must be a finite number, decimal point")
        if allowed is not None and value not in allowed:
            raise self.wrong(element, quoted(cell), str(allowed))
        return value

    def whole_at(self, k: int, element: str) -> int:
        """Return a cell as a whole number."""
        cell = self.cell(k, element)
        if not re.fullmatch(r"[+-]?\d{1,18}", cell, re.ASCII):
            raise self.wrong(element, quoted(cell), "must be a whole number")
        return int(cell)

    def numbers(
        self, first: int, last: int | None, element: str, allowed: Range | None = None
    ) -> Array:
        """Return the cells from `first` to before `last` as finite numbers in a range."""
        if last is not None:
            self.cell(last - 1, element)
        values = numbers_of(self.cells[first:last])
        low, high = (-np.inf, np.inf) if allowed is None else (allowed.low, allowed.high)
        good = (values >= low) & (values <= high) & np.isfinite(values)
        for k in np.flatnonzero(~good)[:1]:
            self.number_at(first + int(k), element, allowed)
            raise self.wrong(element, quoted(self.cells[first + int(k)]), "must be a finite number")
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
        if len(text) > LONGEST_LINE:
            fault = f"has {len(text)} characters"
            raise source.wrong("line", fault, f"must have at most {LONGEST_LINE}", line=number)
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
    return tuple(_between(text, separator))


def _between(text: str, separator: str) -> Iterator[str]:
    """Yield the cells between separators; those inside quotes separate nothing."""
    end = -1
    while end < len(text):
        begin = _SPACES.match(text, end + 1).end()  # type: ignore[union-attr] # it always matches
        close = text.find('"', begin + 1) if text[begin : begin + 1] == '"' else -1
        end = text.find(separator, max(begin, close))
        end = len(text) if end < 0 else end
        quoted_part = text[begin + 1 : close] if close >= 0 else ""
        yield (quoted_part + text[max(begin, close + 1) : end]).strip()


# --- Binary files: records of one layout, or values one after another


LONGEST_NAME = 1000
"""Largest number of bytes of a text in a binary file."""


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
        end = self.source.data.find(b"\0", self.at, self.at + LONGEST_NAME)
        if end < 0:
            fault = f"text at byte {self.at} has no end"
            raise self.source.wrong(element, fault, f"must have at most {LONGEST_NAME} bytes")
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


DEEPEST_JSON = 60
"""Largest number of objects and lists inside each other."""

Key = str | int

# A string without an end goes to that of the file, so that every character is looked at once.
_STRING = r'"(?:[^"\\]|\\.)*+"?'
_TOKEN = re.compile(rf'{_STRING}|[\[\]{{}}:,]|[^\s\[\]{{}}:,"]++', re.DOTALL)
_BRACKET = re.compile(rf"{_STRING}|[\[\]{{}}]", re.DOTALL)


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
                known = node.value if isinstance(node.value, dict) else {}
                hint = did_you_mean(str(key), known.keys())
                raise node.wrong(f"{quoted(key)} is missing{hint}", "required")
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
        if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
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
        sizes = []
        for n in shape:
            values = [below for node in values for below in node._list(n)]
            sizes.append(n)
        flat = np.array([node.number(allowed) for node in values], dtype=float)
        return flat.reshape(sizes) if flat.size else flat.reshape([max(n, 0) for n in sizes])

    def _list(self, n: int) -> Iterator[Node]:
        if not isinstance(self.value, list) or (n >= 0 and len(self.value) != n):
            kind = "numbers" if n < 0 else f"{n} values"
            raise self.wrong(quoted(self.value), f"must be a list of {kind}")
        return self.each()


def json_tree(source: Opened) -> Node:
    """Return the root of a JSON file.

    Raises
    ------
    FlightError
        Where it is no JSON, nested deeper than `DEEPEST`, or a name stands twice in one object.
    """
    text = source.text()
    deep = _too_deep(text)
    if deep:
        fault = f"has more than {DEEPEST_JSON} lists and objects inside each other"
        raise source.wrong("file", fault, "must be less deep", line=deep)
    try:
        value = json.loads(text, object_pairs_hook=_object, parse_constant=_no_number)
    except json.JSONDecodeError as error:
        raise source.wrong("file", error.msg, "must be valid JSON", line=error.lineno) from None
    except ValueError as error:  # of `_object`, `_no_number`, and of a number of too many digits
        raise source.wrong("file", str(error).split(";")[0], "must be valid JSON") from None
    return Node(source=source, value=value)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) != len(pairs):
        seen: set[str] = set()
        again = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]  # add returns None, which is false
        raise ValueError(f"{quoted(again)} stands twice in one object")
    return values


def _no_number(constant: str) -> float:
    raise ValueError(f"{constant} is no number")


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of any length
        return False


def _too_deep(text: str) -> int:
    """Return the line on which brackets are nested too deep, 0 if nowhere."""
    if text.count("[") + text.count("{") <= DEEPEST_JSON:
        return 0
    depth = 0
    for match in _BRACKET.finditer(text):
        mark = match[0]
        if mark in "[{":
            depth += 1
            if depth > DEEPEST_JSON:
                return text.count("\n", 0, match.start()) + 1
        elif mark in "]}":
            depth -= 1
    return 0


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


DEEPEST_XML = 100
"""Largest number of elements inside each other."""

MOST_ELEMENTS = 5_000_000
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


def xml_tree(source: Opened) -> Element:
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
        if self.count > MOST_ELEMENTS or len(self.open) >= DEEPEST_XML:
            fault = f"more than {MOST_ELEMENTS} elements, or {DEEPEST_XML} inside each other"
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
