"""What can be wrong in a flight's files, and how it is said: one line per problem."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

SHOWN = 10
"""So many problems of one kind in one file are written out; the others are counted."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One thing that is wrong in one place.

    Attributes
    ----------
    file : str
        As the user reaches it.
    line : int
        From 1, the header's number; 1 as well where the whole file is meant.
    column : str
        Of a table, or the key in flight.toml.
    found, expected : str
        What stands there, and what should.
    """

    file: str
    line: int
    column: str
    found: str
    expected: str

    def __str__(self) -> str:
        line = f"{self.file}:{self.line}: {self.column}: {self.found}; {self.expected}"
        return " ".join(line.splitlines())  # a name may hold anything


def lines_of(problems: Iterable[Problem]) -> tuple[str, ...]:
    """Return one line per problem, sorted by file and line; more than ten alike are counted."""
    problems = tuple(dict.fromkeys(problems))
    files = list(dict.fromkeys(p.file for p in problems))
    order = {file: i for i, file in enumerate(files)}
    alike = Counter((p.file, p.column, p.expected) for p in problems)
    seen: Counter[tuple[str, str, str]] = Counter()
    lines = []
    for p in sorted(problems, key=lambda p: (order[p.file], p.line)):
        kind = (p.file, p.column, p.expected)
        seen[kind] += 1
        if seen[kind] <= SHOWN:
            lines.append(str(p))
        elif seen[kind] == SHOWN + 1:
            more = f"and {alike[kind] - SHOWN} more from here on"
            lines.append(f"{p.file}:{p.line}: {p.column}: {more}; {p.expected}")
    return tuple(lines)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean 'x'?)", or nothing where no known name is close."""
    known = list(known)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    close = close or [longer for longer in known if name and longer.startswith(name)]
    return f" (did you mean {close[0]!r}?)" if close else ""


@dataclass(frozen=True)
class Range:
    """Where a number must lie.

    Attributes
    ----------
    low, high : float
        Inclusive.
    says : str
        The rule as a sentence; made from low and high where it is empty.
    whole : bool
        No fractions.
    """

    low: float
    high: float
    says: str = ""
    whole: bool = False

    def __contains__(self, value: float) -> bool:
        """Tell whether a number lies here; NaN never does."""
        return self.low <= value <= self.high and (not self.whole or float(value).is_integer())

    def __str__(self) -> str:
        return self.says or f"must lie between {self.low:g} and {self.high:g}"


TINY = 1e-9
"""A smaller standard deviation is no weight that an adjustment can use."""

POSITIVE = Range(TINY, 1e6, "must be positive, at most 1e6")
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
    "b1": Range(-0.5, 0.5),
    **dict.fromkeys(("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"), ANGLE),
    **dict.fromkeys(("lever_x_m", "lever_y_m", "lever_z_m"), Range(-100.0, 100.0)),
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
"""Every number of a flight by its column or key; what is not here is text."""
