"""Words for the columns of a list of orientations, events or points, and their units."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from acx4files.exchange.safe import Line, Opened, lines
from acx4files.flight.problems import Problem, Range, lines_of, quoted
from acx4files.flight.tables import NUMBER, name_fault
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Mask

UNITS = {"deg": 1.0, "gon": 0.9, "grad": 0.9, "rad": float(np.degrees(1.0)), "arcmin": 1 / 60}
"""Of angles, in degrees."""

ANGLES = ("omega", "phi", "kappa", "roll", "pitch", "heading", "lat", "lon")
SIGMA_M = ("sigma_east", "sigma_north", "sigma_height")
SIGMA_ANGLES = ("sigma_roll", "sigma_pitch", "sigma_heading")
NUMBERS = (*ANGLES, "east", "north", "height", *SIGMA_M, *SIGMA_ANGLES)
SKIP = "skip"

SYNONYMS = {
    "image": "image imagename image_name filename file label photoid photo id name nom n",
    "exposure": "exposure event #event",
    "camera": "camera cam c",
    "strip": "strip line run",
    "time": "time time(s) gpstime gps_time t",
    "week": "week gpsweek gps_week",
    "east": "east easting x e",
    "north": "north northing y",
    "height": "height altitude alt z h elevation",
    "lat": "lat latitude",
    "lon": "lon long longitude lng",
    "omega": "omega o",
    "phi": "phi p",
    "kappa": "kappa k",
    "roll": "roll r",
    "pitch": "pitch",
    "heading": "heading yaw azimuth",
    "sigma_east": "sigma_east sigma_x",
    "sigma_north": "sigma_north sigma_y",
    "sigma_height": "sigma_height sigma_z",
    "sigma_roll": "sigma_roll",
    "sigma_pitch": "sigma_pitch",
    "sigma_heading": "sigma_heading sigma_yaw",
    SKIP: "skip s - _ other",
}


def _words_of(synonyms: Mapping[str, str]) -> dict[str, str]:
    """Return the names of columns by the words for them."""
    return {word: name for name, words in synonyms.items() for word in words.split()}


KNOWN = _words_of(SYNONYMS)
"""Words for the columns of orientations and events."""

POINT = "point pointname point_name point_id pointid id name nom n pt gcp marker target label"
SKIPPED = {SKIP: SYNONYMS[SKIP]}
SHARED = ("east", "north", "height", "lat", "lon", *SIGMA_M)

MEASURED = _words_of(
    {
        "point": POINT,
        "image": "image imagename image_name filename file photo photoid cliche",
        "col": "col column sample c u x",
        "row": "row line lin l v y",
        "sigma": "sigma",
        **SKIPPED,
    }
)
"""Words for the columns of points measured in images."""

SURVEYED = _words_of(
    {"point": POINT, "role": "role", **{one: SYNONYMS[one] for one in SHARED}, **SKIPPED}
)
"""Words for the columns of surveyed points."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a list.

    Attributes
    ----------
    name : str
        What it holds, such as one of the keys of `SYNONYMS`.
    unit : str
        Of an angle, one of `UNITS`; empty where the word does not say.
    """

    name: str
    unit: str = ""


def _column(word: str, known: Mapping[str, str]) -> Column | None:
    """Return the column that a word means, such as ``omega``, ``kappa_gon``, ``x``; or None."""
    plain = re.sub(r"\s+", "_", word.strip().lower())
    for unit in UNITS:
        stem = plain.removesuffix(f"_{unit}").removesuffix(f"[{unit}]").removesuffix(f"({unit})")
        name = known.get(stem.strip("_"))
        if stem != plain and (name in ANGLES or name in SIGMA_ANGLES):
            return Column(name=str(name), unit=unit)
    for unit in ("_m", "[m]", "(m)", "_s", "_px", "[px]", "(px)"):
        stem = plain.removesuffix(unit).strip("_")
        plain = stem if stem in known else plain
    name = known.get(plain)
    return Column(name=name) if name else None


def _declared(source: Opened, text: str, known: Mapping[str, str]) -> tuple[Column, ...]:
    """Return the columns that a user declares: words with commas or spaces between."""
    columns = []
    for word in filter(None, re.split(r"[\s,;]+", text)):
        column = _column(word, known)
        if column is None:
            expected = f"known are {', '.join(dict.fromkeys(known.values()))}"
            raise source.wrong("--columns", f"column {word!r} is not known", expected)
        if column.name != SKIP and column in columns:
            raise source.wrong("--columns", f"column {column.name!r} stands twice", "must be once")
        columns.append(column)
    return tuple(columns)


def position_of(columns: Sequence[Column], name: str) -> int | None:
    """Return the first position of a column; None where it is absent."""
    return next((k for k, column in enumerate(columns) if column.name == name), None)


# --- The rows of a text with declared columns: a list of events, of orientations, or of points


COMMENTS = "#"
QUOTED_CELL = re.compile(r"\"[^\"]*\"")
_NUMBER = Range(-1e12, 1e12)
SPOILT = re.compile(r"[-+*.,]?\d|(nan|inf|infinity|na|n/a|null|none|[-*?.]+)$", re.IGNORECASE)
"""A cell with a number or with a mark in its place, not a word of a heading."""

MOST = 10_000_000
"""Largest number of rows."""
MOST_BEFORE = 100
"""Lines among which a heading is looked for."""

MOST_WORDS = 1000
"""Number of words of a line that decide whether it is a heading."""

TEXTS = ("image", "exposure", "camera", "strip", "point", "role", SKIP)
"""Columns that hold no numbers."""

COMMA = re.compile(r"[-+]?\d+,\d+")
THOUSANDS = re.compile(r"[-+]?\d{1,3},\d{3}")
"""Numbers with a decimal comma, and those of which it may also set thousands apart."""


@dataclass(frozen=True, kw_only=True)
class Listed:
    """Rows with the columns that they have.

    Attributes
    ----------
    source : Opened
    columns : tuple of Column
    rows : tuple of Line
    heading : Line or None
        The line that is a heading and no row, if there is one.
    before : int
        Lines before the heading, which are not read.
    declared : bool
        Whether the columns are declared, and not those of the heading.
    commas : bool
        Whether the numbers of the text have decimal commas; those of `rows` have points.
    """

    source: Opened
    columns: tuple[Column, ...]
    rows: tuple[Line, ...]
    heading: Line | None = None
    before: int = 0
    declared: bool = False
    commas: bool = False

    def has(self, *names: str) -> bool:
        """Tell whether all these columns are there."""
        return all(position_of(self.columns, name) is not None for name in names)

    def at(self, name: str) -> int:
        """Return the position of a column that is present."""
        return int(position_of(self.columns, name) or 0)

    def numbers(self, name: str) -> Array:
        """Return a column of finite numbers, shape (n,)."""
        k = self.at(name)
        return np.array([row.number_at(k, name, _NUMBER) for row in self.rows], dtype=float)

    def unit(self, name: str, otherwise: str = "deg") -> str:
        """Return the unit of an angle, one of `UNITS`, by its column or else the other."""
        return self.columns[self.at(name)].unit or otherwise

    def scaled(self, name: str, otherwise: str = "deg") -> Array:
        """Return a column of angles in degrees."""
        return self.numbers(name) * UNITS[self.unit(name, otherwise)]

    def degrees(self, name: str, otherwise: str = "deg") -> Array:
        """Return a column of angles in degrees, refused where one is more than a turn."""
        values = self.scaled(name, otherwise)
        expected = f"must be an angle in {self.unit(name, otherwise)}, within a turn"
        self.refuse(name, np.abs(values) > 360, expected)
        return values

    def names(self, name: str) -> list[str]:
        """Return a column of names that a flight may use."""
        cells = [(row, row.cell(self.at(name), name)) for row in self.rows]
        for row, cell in cells:
            if fault := name_fault(cell) if cell else ("is empty", "must be a name"):
                raise row.wrong(name, *fault)
        return [cell for _, cell in cells]

    def unique(self, name: str) -> list[str]:
        """Return a column of names that are all different."""
        names = self.names(name)
        first: dict[str, Line] = {}
        for row, cell in zip(self.rows, names, strict=True):
            before = first.setdefault(cell, row)
            if before is not row:
                fault = f"{quoted(cell)} stands in line {before.number} already"
                raise row.wrong(name, fault, "every one once")
        return names

    @property
    def is_located(self) -> bool:
        """Whether it has a position in the grid, or a geographic one, with its height."""
        return self.has("height") and (self.has("east", "north") or self.has("lat", "lon"))

    @property
    def said(self) -> str:
        """Which columns it has, and by what."""
        by = "declaration" if self.declared else "its heading"
        return f"The columns, by {by}, are: {' '.join(column.name for column in self.columns)}"

    def undeclared(self, fault: str, expected: str) -> FlightError:
        """Return the error of wrong columns."""
        line = self.heading.number if self.heading else 1
        cure = f"{expected}; declare them by --columns"
        return self.source.wrong("columns", fault, cure, line=line)

    def require(self, *names: str, says: str) -> None:
        """Refuse a list that lacks columns; `says` are all that it must have."""
        for name in names:
            if not self.has(name):
                raise self.undeclared(f"have no {name}", f"must be {says}, in any order")

    def problems(
        self, name: str, wrong: Mask, expected: str, found: Callable[[int], str] | None = None
    ) -> list[Problem]:
        """Return a problem for each wrong row: what is found, else the cell, else the row."""
        k_name = position_of(self.columns, name)

        def cell(k: int) -> str:
            cells = self.rows[k].cells
            return quoted(" ".join(cells) if k_name is None else cells[k_name])

        return [
            Problem(
                file=self.source.file,
                line=self.rows[k].number,
                column=name,
                found=(found or cell)(k),
                expected=expected,
            )
            for k in np.flatnonzero(wrong).tolist()
        ]

    def refuse(self, name: str, wrong: Mask, expected: str) -> None:
        """Refuse a list that has wrong rows."""
        if problems := self.problems(name, wrong, expected):
            raise FlightError(lines_of(problems))


def left_out(listed: Listed, what: str, known: Mapping[str, str] = KNOWN) -> tuple[str, ...]:
    """Return sentences on unread lines and columns; `what` is the noun for the columns read."""
    k_skipped = [k for k, column in enumerate(listed.columns) if column.name == SKIP]
    heading = listed.heading.cells if listed.heading else ()
    named = [heading[k] if k < len(heading) else f"column {k + 1}" for k in k_skipped]
    longest = max(listed.rows, key=len)
    beyond = len(longest) - len(listed.columns)
    if beyond > 0:
        named.append(f"{beyond} after the last in line {longest.number}")
    sentences = [f"Lines before the heading: {listed.before}."] if listed.before else []
    if listed.declared and listed.heading:
        others = [
            f"{quoted(cell)} over {column.name}"
            for cell, column in zip(heading, listed.columns, strict=False)
            if (word := _column(cell, known)) is not None
            and SKIP not in (word.name, column.name)
            and word.name != column.name
        ]
        against = f"; it contradicts the declared columns: {', '.join(others)}" if others else ""
        line = listed.heading.number
        sentences.append(f"The heading in line {line}, since the columns are declared{against}.")
    if named:
        sentences.append(f"Columns that are no {what}: {', '.join(named)}.")
    return tuple(sentences)


def read_list(
    source: Opened,
    columns: str,
    *,
    numbers: Sequence[str],
    known: Mapping[str, str] = KNOWN,
) -> Listed:
    """Return the rows of a text, by declared columns or by those that its heading names.

    Parameters
    ----------
    source : Opened
    columns : str
        As the user declares them; empty: the heading names them.
    numbers : sequence of str
        Columns of numbers, by which a heading is told from a row.
    known : mapping of str to str
        Names of columns by the words for them.

    Raises
    ------
    FlightError
        Where the columns are not known, or there are no rows.
    """
    before = _before_heading(source, known)
    mark = _separator(source, len(before))
    every = lines(source, separator=mark, comment=COMMENTS)
    kept = [line for line in every if line.number > len(before)]
    if not kept or len(kept) > MOST:
        raise source.wrong("file", f"has {len(kept)} rows", f"must have 1 to {MOST}")
    if columns:
        named = _declared(source, columns, known)
        heading = kept[0] if _is_heading(kept[0], named, numbers) else None
    else:
        heading, named = kept[0], _of_heading(kept[0], known)
    rows = tuple(kept[heading is not None :])
    if not rows:
        raise source.wrong("file", "has a heading and no rows", "must have rows")
    numeric = {k for k, column in enumerate(named) if column.name not in TEXTS}
    rows, commas = _with_points(rows, numeric)
    return Listed(
        source=source,
        columns=named,
        rows=rows,
        heading=heading,
        before=len(before),
        declared=bool(columns),
        commas=commas,
    )


def _with_points(rows: tuple[Line, ...], numeric: Container[int]) -> tuple[tuple[Line, ...], bool]:
    """Return rows whose numbers have points for decimal commas, and whether they had commas.

    Numbers have them where none has a point, and at least one comma is no mark between thousands.
    """
    cells = [cell for row in rows for k, cell in enumerate(row.cells) if k in numeric]
    with_comma = [cell for cell in cells if "," in cell and ":" not in cell]
    if (
        not all(COMMA.fullmatch(cell) for cell in with_comma)
        or any("." in cell and NUMBER.fullmatch(cell) for cell in cells)
        or all(THOUSANDS.fullmatch(cell) for cell in with_comma)
    ):
        return rows, False
    return tuple(
        replace(
            row,
            cells=tuple(
                cell.replace(",", ".") if k in numeric and COMMA.fullmatch(cell) else cell
                for k, cell in enumerate(row.cells)
            ),
        )
        for row in rows
    ), True


def text_said(listed: Listed) -> tuple[str, ...]:
    """Return sentences on the encoding of a text, and on its decimal commas."""
    return (
        *(["The text is in Windows-1252: it is not UTF-8."] if listed.source.encoding else []),
        *(["Its numbers have decimal commas."] if listed.commas else []),
    )


def _before_heading(source: Opened, known: Mapping[str, str]) -> tuple[str, ...]:
    """Return the lines before the heading, if none of them is a row; else none.

    Such a line has two different columns at least, and half of its words are columns. A row is a
    line that has numbers in half of its words.
    """
    text = source.text().split("\n")
    for k, line in enumerate(text[:MOST_BEFORE]):
        words = [word for word in re.split(r"[\s;,]+", line.strip()) if word][:MOST_WORDS]
        if not words or words[0].startswith(COMMENTS):
            continue
        columns = {column.name for word in words if (column := _column(word, known))} - {SKIP}
        if len(columns) >= max(2, len(words) / 2):
            return tuple(text[:k])
        if sum(bool(NUMBER.fullmatch(word)) for word in words) >= len(words) / 2:
            break
    return ()


def _separator(source: Opened, before: int) -> str | None:
    """Return the separator of cells: the mark in both of the first two lines, or None."""
    text = (line for line in source.text().split("\n")[before:] if line.strip())
    first = list(islice((line for line in text if not line.lstrip().startswith(COMMENTS)), 2))
    bare = [QUOTED_CELL.sub("", line) for line in first]
    return next((mark for mark in (";", "\t", ",") if all(mark in line for line in bare)), None)


def _is_heading(line: Line, columns: Sequence[Column], numbers: Sequence[str]) -> bool:
    """Tell whether a line has words where every row has numbers; nan and 1,5 are no words."""
    positions = (k for name in numbers if (k := position_of(columns, name)) is not None)
    cells = [line.cells[k].strip() for k in positions if k < len(line.cells)]
    return any(cells) and not any(SPOILT.match(cell) for cell in cells if cell)


def _of_heading(line: Line, known: Mapping[str, str]) -> tuple[Column, ...]:
    columns = [_column(cell, known) for cell in line.cells]
    named = [column for column in columns if column is not None and column.name != SKIP]
    cure = "declare them by --columns, in their order"
    if len(named) < 2:
        raise line.wrong("columns", f"is no heading: {quoted(' '.join(line.cells))}", cure)
    ((name, times),) = Counter(column.name for column in named).most_common(1)
    if times > 1:
        raise line.wrong("columns", f"two columns may be {name!r}", cure)
    return tuple(column or Column(name=SKIP) for column in columns)
