"""The one reader of lists: texts with a row for each image, event or point, in declared columns.

Words for columns, their units and their ranges are declared here once. The delimiter and the
decimal sign are the text's own; what is taken for granted of a text is said.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from acx4files.exchange.safe import Line, Opened, lines
from acx4files.flight.problems import Range, lines_of, quoted
from acx4files.flight.table_files import checked, width_problems
from acx4files.flight.tables import NUMBER, Schema, Table
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Mask

UNITS = {"deg": 1.0, "gon": 0.9, "grad": 0.9, "rad": float(np.degrees(1.0)), "arcmin": 1 / 60}
"""Of angles, in degrees."""

ATTITUDES = ("omega", "phi", "kappa", "roll", "pitch", "heading")
SIGMA_ANGLES = ("sigma_roll", "sigma_pitch", "sigma_heading")
SKIP = "skip"
TEXTS = ("image", "exposure", "camera", "strip", "point", "role")
"""Columns that hold no numbers."""

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
OF_POINTS = {
    "point": "point pointname point_name point_id pointid id name nom n pt gcp marker target label"
}
SHARED = ("east", "north", "height", "lat", "lon", "sigma_east", "sigma_north", "sigma_height")


def _words_of(synonyms: Mapping[str, str]) -> dict[str, str]:
    """Return the names of columns by the words for them."""
    return {word: name for name, words in synonyms.items() for word in words.split()}


KNOWN = _words_of(SYNONYMS)
"""Words for the columns of orientations and events."""

MEASURED = _words_of(
    OF_POINTS
    | {
        "image": "image imagename image_name filename file photo photoid cliche",
        "col": "col column sample c u x",
        "row": "row line lin l v y",
        "sigma": "sigma",
        SKIP: SYNONYMS[SKIP],
    }
)
"""Words for the columns of points measured in images."""

SURVEYED = _words_of(
    OF_POINTS | {"role": "role"} | {name: SYNONYMS[name] for name in (*SHARED, SKIP)}
)
"""Words for the columns of surveyed points."""

IN_UNIT = re.compile(r"(.+?)_?[_\[(](deg|gon|grad|rad|arcmin|m|s|px)[\])]?")
MOST_BEFORE = 100
"""Lines among which a heading is looked for."""

SPOILT = re.compile(r"[-+*.,]?\d|(nan|inf|infinity|na|n/a|null|none|[-*?.]+)$", re.IGNORECASE)
"""A cell with a number or with a mark in its place, not a word of a heading."""

COMMA = re.compile(r"[-+]?\d+,\d+")
THOUSANDS = re.compile(r"[-+]?\d{1,3},\d{3}")
"""Numbers with a decimal comma, and those of which it may also set thousands apart."""

WEEKS = Range(0, 100_000, "must be the GPS week, a whole number", whole=True)
MORE = "blanks in a name, degrees and minutes, or decimal commas?"
"""Why a row may have more cells than its heading."""

MARKS = {";": "semicolons", "\t": "tabs", ",": "commas"}
"""What may separate cells."""

CURE = "declare them by --columns, in their order"


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

    @property
    def allowed(self) -> Range:
        """Range of its numbers."""
        if self.name == "lat":
            return Range(-90.0, 90.0, "must lie between -90 and 90 degrees")
        if self.name == "lon" or self.name in ATTITUDES:
            turn = 360.0 / UNITS[self.unit]
            return Range(-turn, turn, f"must be an angle in {self.unit}, within a turn")
        return WEEKS if self.name == "week" else Range(-1e12, 1e12)


@dataclass(frozen=True, kw_only=True, eq=False)
class Listed:
    """A list as it was read: names, and numbers with angles in degrees.

    Attributes
    ----------
    source : Opened
    columns : tuple of Column
    table : Table
        Its rows; the columns of angles are in degrees.
    cells : dict of str to list of str
        The cells of every column, as they stand there but for decimal commas.
    heading : tuple of str
        Cells of the line that is a heading and no row; none where there is no such line.
    heading_line : int
    n_before, n_beyond : int
        Lines before the heading that are not blank; cells of a row after the declared ones.
    between : str
        What separates its cells.
    declared : bool
        Whether the columns are declared, and not those of the heading.
    commas : bool
        Whether the numbers of the text have decimal commas.
    """

    source: Opened
    columns: tuple[Column, ...]
    table: Table
    cells: Mapping[str, Sequence[str]]
    heading: tuple[str, ...] = ()
    heading_line: int = 1
    n_before: int = 0
    n_beyond: int = 0
    between: str = "blanks"
    declared: bool = False
    commas: bool = False

    def has(self, *names: str) -> bool:
        """Tell whether all these columns are there."""
        return set(names) <= {column.name for column in self.columns}

    def stack(self, *names: str) -> Array:
        """Return columns of numbers side by side, shape (n, k)."""
        return self.table.stack(*names)

    @property
    def is_located(self) -> bool:
        """Whether it has a position in the grid, or a geographic one, with its height."""
        return self.has("height") and (self.has("east", "north") or self.has("lat", "lon"))

    @property
    def said(self) -> str:
        """Which columns it has, and by what; how it is written."""
        by = "declaration" if self.declared else "its heading"
        names = " ".join(column.name for column in self.columns)
        encoding = " The text is in Windows-1252: it is not UTF-8." * bool(self.source.encoding)
        commas = " Its numbers have decimal commas." * self.commas
        return f"The columns, by {by}, between {self.between}, are: {names}.{encoding}{commas}"

    def left_out(self, what: str, known: Mapping[str, str] = KNOWN) -> tuple[str, ...]:
        """Return sentences on unread lines and columns; `what` is the noun for those read."""
        sentences = []
        if self.n_before:
            sentences.append(f"Lines before the heading: {self.n_before}.")
        if self.heading and self.declared:
            pairs = [
                (cell, _column(cell, known), column.name)
                for cell, column in zip(self.heading, self.columns, strict=False)
            ]
            others = [
                f"{quoted(cell)} over {name}"
                for cell, said, name in pairs
                if said is not None and SKIP not in (said.name, name) and said.name != name
            ]
            against = f"; it contradicts the declared columns: {', '.join(others)}" * bool(others)
            sentences.append(
                f"The heading in line {self.heading_line}, since the columns are declared{against}."
            )
        skipped = [k for k, column in enumerate(self.columns) if column.name == SKIP]
        named = [self.heading[k] if k < len(self.heading) else f"column {k + 1}" for k in skipped]
        named += [f"{self.n_beyond} after those declared"] * bool(self.n_beyond)
        if named:
            sentences.append(f"Columns that are no {what}: {', '.join(named)}.")
        return tuple(sentences)

    def undeclared(self, fault: str, expected: str) -> FlightError:
        """Return the error of wrong columns."""
        cure = f"{expected}; declare them by --columns"
        return self.source.wrong("columns", fault, cure, line=self.heading_line)

    def require(self, *names: str, says: str) -> None:
        """Refuse a list that lacks columns; `says` are all that it must have."""
        for name in names:
            if not self.has(name):
                raise self.undeclared(f"have no {name}", f"must be {says}, in any order")

    def refuse(self, name: str, wrong: Mask, found: Sequence[str], expected: str) -> None:
        """Refuse a list that has wrong rows; what is found there is given for every row."""
        rows = np.flatnonzero(wrong).tolist()
        problems = [self.table.problem(k, name, found[k], expected) for k in rows]
        if problems:
            raise FlightError(lines_of(problems))


def read_list(
    source: Opened,
    columns: str,
    *,
    known: Mapping[str, str] = KNOWN,
    keys: Sequence[tuple[str, ...]] = (),
    texts: Collection[str] = TEXTS,
    angle: str = "deg",
) -> Listed:
    """Return the rows of a text, by declared columns or by those that its heading names.

    Parameters
    ----------
    source : Opened
    columns : str
        As the user declares them; empty: the heading names them.
    known : mapping of str to str
        Names of columns by the words for them.
    keys : sequence of tuple of str
        Sets of columns; the cells of the first set that is there must differ between rows.
    texts : collection of str
        Columns that hold no numbers.
    angle : str
        Unit of angles of attitude whose column does not say it, one of `UNITS`.

    Raises
    ------
    FlightError
        Where columns are not known, there are no rows, or cells are wrong: each with its line.
    """
    before = _before_heading(source, known)
    separator = _separator(source, before)
    rows = [
        line
        for line in lines(source, separator=separator, comment="#")
        if line.number > before and not line.cells[0].startswith("(")  # units below a heading
    ]
    if not rows:
        raise source.wrong("file", "has no rows", "must have rows")
    named = _declared(source, columns, known) if columns else _of_heading(rows[0], known)
    named = tuple(replace(column, unit=_unit(column, angle)) for column in named)
    numeric = [k for k, column in enumerate(named) if column.name not in (*texts, SKIP)]
    heading = rows.pop(0) if not columns or _is_heading(rows[0], numeric) else None
    if not rows:
        raise source.wrong("file", "has a heading and no rows", "must have rows")
    n_beyond = max(len(rows[-1]) - len(named), 0) if columns else 0
    lines_at, widths = [row.number for row in rows], [len(row) for row in rows]
    width = len(named) + n_beyond
    if problems := [*width_problems(source.file, lines_at, widths, width, MORE)]:
        raise FlightError(lines_of(problems))
    cells = {
        column.name: [row.cells[k] for row in rows]
        for k, column in enumerate(named)
        if column.name != SKIP
    }
    numbers = [named[k].name for k in numeric]
    commas = _has_commas([cell for name in numbers for cell in cells[name]])
    if commas:
        cells |= {name: [cell.replace(",", ".") for cell in cells[name]] for name in numbers}
    schema = Schema(
        required=(),
        may_be_empty=("role",),
        keys=tuple(key for key in keys if cells.keys() >= set(key))[:1],
        ranges={named[k].name: named[k].allowed for k in numeric},
    )
    table = checked(Table(file=source.file, lines=np.array(lines_at)), cells, schema)
    if table.problems:
        raise FlightError(lines_of(table.problems))
    scales = {column.name: UNITS[column.unit] for column in named if column.unit}
    in_degrees = {name: scales.get(name, 1.0) * table.numbers[name] for name in numbers}
    return Listed(
        source=source,
        columns=named,
        table=replace(table, numbers=in_degrees),
        cells=cells,
        heading=heading.cells if heading else (),
        heading_line=heading.number if heading else 1,
        n_before=sum(bool(line.strip()) for line in source.text().split("\n")[:before]),
        n_beyond=n_beyond,
        between=MARKS.get(separator or "", "blanks"),
        declared=bool(columns),
        commas=commas,
    )


# --- Columns, by their words


def _column(word: str, known: Mapping[str, str]) -> Column | None:
    """Return the column that a word means, such as ``omega``, ``kappa_gon``, ``x``; or None."""
    plain = re.sub(r"\s+", "_", word.strip().lower())
    if plain in known:
        return Column(name=known[plain])
    match = IN_UNIT.fullmatch(plain)
    name = known.get(match[1].strip("_")) if match else None
    if match is None or name is None:
        return None
    is_angle = name in (*ATTITUDES, *SIGMA_ANGLES, "lat", "lon")
    return Column(name=name, unit=match[2] if is_angle and match[2] in UNITS else "")


def _unit(column: Column, angle: str) -> str:
    """Return the unit of an angle, and none of other columns."""
    if column.name in (*ATTITUDES, *SIGMA_ANGLES):
        return column.unit or angle
    return (column.unit or "deg") if column.name in ("lat", "lon") else ""


def _declared(source: Opened, text: str, known: Mapping[str, str]) -> tuple[Column, ...]:
    """Return the columns that a user declares: words with commas or spaces between."""
    columns: list[Column] = []
    for word in filter(None, re.split(r"[\s,;]+", text)):
        column = _column(word, known)
        if column is None:
            expected = f"known are {', '.join(dict.fromkeys(known.values()))}"
            raise source.wrong("--columns", f"column {word!r} is not known", expected)
        if column.name in {other.name for other in columns} - {SKIP}:
            raise source.wrong("--columns", f"column {column.name!r} stands twice", "must be once")
        columns.append(column)
    return tuple(columns)


def _of_heading(line: Line, known: Mapping[str, str]) -> tuple[Column, ...]:
    columns = [_column(cell, known) or Column(name=SKIP) for cell in line.cells]
    names = [column.name for column in columns if column.name != SKIP]
    if len(names) < 2:
        raise line.wrong("columns", f"is no heading: {quoted(' '.join(line.cells))}", CURE)
    ((name, times),) = Counter(names).most_common(1)
    if times > 1:
        raise line.wrong("columns", f"two columns may be {name!r}", CURE)
    return tuple(columns)


# --- How a text is written


def _before_heading(source: Opened, known: Mapping[str, str]) -> int:
    """Return the number of lines before the heading, if none of them is a row; else 0.

    A heading has two different columns at least, and half of its words are columns. A row is a
    line that has numbers in half of its words.
    """
    for k, line in enumerate(source.text().split("\n")[:MOST_BEFORE]):
        words = [word for word in re.split(r"[\s;,]+", line.strip()) if word]
        if not words or words[0].startswith("#"):
            continue
        columns = {column.name for word in words if (column := _column(word, known))} - {SKIP}
        if len(columns) >= max(2, len(words) / 2):
            return k
        if sum(bool(NUMBER.fullmatch(word)) for word in words) >= len(words) / 2:
            break
    return 0


def _separator(source: Opened, before: int) -> str | None:
    """Return the separator of cells: the mark in both of the first two lines, or None."""
    text = (line for line in source.text().split("\n")[before:] if line.strip())
    first = list(islice((line for line in text if not line.lstrip().startswith("#")), 2))
    bare = [re.sub(r"\"[^\"]*\"", "", line) for line in first]
    return next((mark for mark in MARKS if all(mark in line for line in bare)), None)


def _is_heading(line: Line, numeric: Sequence[int]) -> bool:
    """Tell whether a line has words where every row has numbers; nan and 1,5 are no words."""
    cells = [cell for k in numeric if k < len(line) and (cell := line.cells[k])]
    return bool(cells) and not any(SPOILT.match(cell) for cell in cells)


def _has_commas(cells: Sequence[str]) -> bool:
    """Tell whether numbers have decimal commas.

    They have them where none has a point, and one comma at least is no mark between thousands.
    """
    with_comma = [cell for cell in cells if "," in cell]
    return (
        all(COMMA.fullmatch(cell) for cell in with_comma)
        and not all(THOUSANDS.fullmatch(cell) for cell in with_comma)
        and not any("." in cell and NUMBER.fullmatch(cell) for cell in cells)
    )
