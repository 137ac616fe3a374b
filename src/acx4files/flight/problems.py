"""Problems of a flight's files, and the sentences that say them: one line for each."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from acx4lib.errors import visible
from acx4lib.expected import Index

SHOWN = 10
"""Number of problems of one kind in one file that are written out; the others are counted."""

QUOTED = 80
"""Largest number of characters of a file that a message repeats."""

MANY = 50_000
"""Number of names above which no similar name is searched for."""

_JOINT = re.compile(r"(?<=[^\W\d_])[ _-](?=\d)|(?<=\d)[ _-](?=[^\W\d_])")
_ZEROS = re.compile(r"(?<!\d)0+(?=\d)")
"""Between letters and digits, and before a number: what `same_but_for_writing` passes over."""


@dataclass(frozen=True)
class Problem:
    """One problem at one place of a file or table.

    Attributes
    ----------
    file : str
        Path of the file for the user.
    line : int
        Line number; the header is line 1, and so is the whole file. Of a table in memory the row,
        from 0; -1 is the whole table.
    column : str
        Column of a table, or key in flight.toml.
    found, expected : str
        What is there, and what should be there.
    times : int
        Number of problems of this kind, from this line on, that it represents.
    in_memory : bool
        Whether it is in a table that was read from no file.
    """

    file: str
    line: int
    column: str
    found: str
    expected: str
    times: int = 1
    in_memory: bool = False

    @property
    def place(self) -> str:
        """The file and the line, or the table and the row."""
        if not self.in_memory:
            return f"{self.file}:{self.line}"
        return self.file if self.line < 0 else f"{self.file}, row {self.line}"

    def __str__(self) -> str:
        return visible(f"{self.place}: {self.column}: {self.found}; {self.expected}")


def whole(of: str | Path, column: str, fault: str, cure: str) -> Problem:
    """Return a problem of a folder, or of a table in memory, as a whole."""
    in_memory = isinstance(of, str)
    return Problem(str(of), -1 if in_memory else 1, column, fault, cure, in_memory=in_memory)


def counted(rows: Sequence[int] | Index, problem: Callable[[int], Problem]) -> Iterator[Problem]:
    """Yield the problem of each row, up to `SHOWN`, and one problem for all further rows."""
    for row in rows[:SHOWN]:
        yield problem(int(row))
    if len(rows) > SHOWN:
        yield replace(problem(int(rows[SHOWN])), times=len(rows) - SHOWN)


def lines_of(problems: Iterable[Problem]) -> tuple[str, ...]:
    """Return one message per problem, sorted by file and line; more than ten alike are counted."""
    problems = tuple(dict.fromkeys(problems))
    order = {file: i for i, file in enumerate(dict.fromkeys(p.file for p in problems))}
    alike: Counter[tuple[str, str, str]] = Counter()
    for p in problems:
        alike[p.file, p.column, p.expected] += p.times
    seen: Counter[tuple[str, str, str]] = Counter()
    lines = []
    for p in sorted(problems, key=lambda p: (order[p.file], p.line)):
        kind = (p.file, p.column, p.expected)
        seen[kind] += 1
        if seen[kind] <= SHOWN:
            lines.append(str(p))
        elif seen[kind] == SHOWN + 1:
            more = f"and {alike[kind] - SHOWN} more from here on"
            lines.append(str(replace(p, found=more)))
    return tuple(lines)


ABSENT, NO_ROWS = "is not there", "has no rows"
"""Messages on a missing table, and on a table with a header alone."""


def quoted(value: object) -> str:
    """Return a value of a file as quoted in a message, shortened if it is long."""
    if isinstance(value, str):
        return repr(value[:QUOTED]) + ("…" if len(value) > QUOTED else "")
    try:
        text = repr(value)
    except ValueError:  # Python writes no integer of more than 4300 digits
        text = "a number of thousands of digits"
    return text if len(text) <= QUOTED else f"{text[:QUOTED]}…"


def kind_of(value: object) -> str:
    """Return what a value is, such as "a list"."""
    return "None" if value is None else f"a {type(value).__name__}"


def did_you_mean(name: object, known: Collection[str]) -> str:
    """Return " (did you mean 'x'?)", or nothing where no known name is close."""
    if not isinstance(name, str) or not 0 < len(name) <= QUOTED or len(known) > MANY:
        return ""
    near = [k for k in known if len(known) <= 500 or k[:2] == name[:2] or k[-2:] == name[-2:]][:500]
    close = difflib.get_close_matches(name, [k for k in near if len(k) <= QUOTED], n=1)
    close = close or [longer for longer in near if longer.startswith(name)]
    return f" (did you mean {close[0]!r}?)" if close else ""


def same_but_for_writing(names: Collection[str], known: Iterable[str]) -> dict[str, str]:
    """Return the known name that a name seems to be, for names that have one.

    They differ by case, blanks or hyphens between letters and digits, zeros before digits, the
    ".0" of a spreadsheet, or the way in which accents are coded.
    """
    written = {_bare(other): other for other in islice(known, MANY)} if names else {}
    pairs = ((name, written.get(_bare(name))) for name in names)
    return {name: other for name, other in pairs if other is not None}


def _bare(name: str) -> str:
    """Return a name without what is often written otherwise."""
    folded = " ".join(unicodedata.normalize("NFKC", name).casefold().split())
    return _ZEROS.sub("", _JOINT.sub("", folded)).removesuffix(".0")


@dataclass(frozen=True)
class Range:
    """The range in which a number must lie.

    Attributes
    ----------
    low, high : float
        Inclusive.
    says : str
        The rule as a sentence; if empty, it is made from low and high.
    whole : bool
        Whether only whole numbers are allowed.
    """

    low: float
    high: float
    says: str = ""
    whole: bool = False

    def __contains__(self, value: float) -> bool:
        """Tell whether a number lies in the range; NaN never does."""
        return self.low <= value <= self.high and (not self.whole or float(value).is_integer())

    def __str__(self) -> str:
        return self.says or f"must lie between {self.low:g} and {self.high:g}"


# A smaller standard deviation gives an adjustment no useful weight.
POSITIVE = Range(1e-9, 1e6, "must be positive, at most 1e6")
NOT_NEGATIVE = Range(0.0, 1e6, "must be zero or positive, at most 1e6")
ANGLE = Range(-360.0, 360.0)
METRES = Range(-1e8, 1e8)
PIXELS = Range(1, 1_000_000, "must be a positive whole number", whole=True)
COEFFICIENT = Range(-1.0, 1.0)

RANGES = {
    "width_px": PIXELS,
    "height_px": PIXELS,
    "pixel_um": Range(0.1, 1000.0),
    "focal_mm": Range(1.0, 10_000.0),
    "xp_mm": Range(-100.0, 100.0),
    "yp_mm": Range(-100.0, 100.0),
    **dict.fromkeys(("k1", "k2", "k3", "p1", "p2"), COEFFICIENT),
    **dict.fromkeys(("b1", "b2"), Range(-0.5, 0.5)),
    **dict.fromkeys(("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"), ANGLE),
    **dict.fromkeys(("lever_x_m", "lever_y_m", "lever_z_m"), Range(-100.0, 100.0)),
    "sigma_m": POSITIVE,
    "col_px": METRES,
    "row_px": METRES,
    "sigma_px": POSITIVE,
    "east_m": METRES,
    "north_m": METRES,
    "height_m": Range(-12_000.0, 100_000.0),
    "lat_deg": Range(-90.0, 90.0),
    "lon_deg": Range(-180.0, 180.0),
    **dict.fromkeys(("roll_deg", "pitch_deg", "heading_deg"), ANGLE),
    **dict.fromkeys(("omega_deg", "phi_deg", "kappa_deg"), ANGLE),
    "time_s": Range(-1e12, 1e12),
    **dict.fromkeys(("sigma_east_m", "sigma_north_m", "sigma_height_m"), POSITIVE),
    **dict.fromkeys(("sigma_roll_deg", "sigma_pitch_deg", "sigma_heading_deg"), POSITIVE),
}
"""Range of every number of a flight, by its column or key; other columns are text."""
