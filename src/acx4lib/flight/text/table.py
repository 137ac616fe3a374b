"""A table of a flight as it was read."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.problems import Problem


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """A table as it was read.

    Attributes
    ----------
    file : str
        As the user reaches it.
    lines : ndarray of int
        Of every row in the file.
    text : dict
        Cells of every known column that is there.
    numbers : dict
        The same of the numeric columns; NaN where a cell holds no usable number.
    sha256 : str
        Of the file.
    problems : tuple of Problem
    notes : tuple of str
        What is odd but allowed.
    """

    file: str
    lines: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    text: dict[str, tuple[str, ...]] = field(default_factory=dict)
    numbers: dict[str, Array] = field(default_factory=dict)
    sha256: str = ""
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.lines)

    def problem(self, row: int, column: str, found: str, expected: str) -> Problem:
        """Return a problem of a row."""
        line = int(self.lines[row]) if len(self) else 1
        return Problem(file=self.file, line=line, column=column, found=found, expected=expected)

    def has(self, *columns: str) -> bool:
        """Tell whether all these columns are there."""
        return set(columns) <= set(self.text)

    def select(self, keep: Mask) -> Table:
        """Return some of the rows."""
        rows = np.flatnonzero(keep)
        return replace(
            self,
            lines=self.lines[rows],
            text={name: tuple(cells[i] for i in rows) for name, cells in self.text.items()},
            numbers={name: values[keep] for name, values in self.numbers.items()},
        )

    def stack(self, *columns: str) -> Array:
        """Return numeric columns side by side, shape (n, k)."""
        return np.stack([self.numbers[column] for column in columns], axis=-1)
