"""A table of a flight: its cells as text and as numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
        Path of the file for the user; of a table in memory its name.
    lines : ndarray of int
        Line number of every row in the file; of a table in memory the rows themselves, from 0.
    text : dict
        Cells of every known column of the file.
    numbers : dict
        Numeric columns; NaN where a cell is no usable number.
    sha256 : str
        Checksum of the file.
    problems : tuple of Problem
    notes : tuple of str
        Strange but allowed content, one sentence each.
    in_memory : bool
        Whether it was read from no file.
    """

    file: str
    lines: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    text: Mapping[str, Sequence[str]] = field(default_factory=dict)
    numbers: dict[str, Array] = field(default_factory=dict)
    sha256: str = ""
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    in_memory: bool = False

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.lines)

    @property
    def counts(self) -> str:
        """What `lines` counts."""
        return "row" if self.in_memory else "line"

    def problem(self, row: int, column: str, found: str, expected: str) -> Problem:
        """Return a problem of a row."""
        return Problem(
            file=self.file,
            line=int(self.lines[row]) if len(self) else 1,
            column=column,
            found=found,
            expected=expected,
            in_memory=self.in_memory,
        )

    def has(self, *columns: str) -> bool:
        """Tell whether the table has all these columns."""
        return set(columns) <= set(self.text)

    def select(self, keep: Mask) -> Table:
        """Return some of the rows."""
        rows = np.flatnonzero(keep)
        return replace(
            self,
            lines=self.lines[rows],
            text={
                name: tuple(cells[i] for i in rows.tolist()) for name, cells in self.text.items()
            },
            numbers={name: values[keep] for name, values in self.numbers.items()},
        )

    def stack(self, *columns: str) -> Array:
        """Return numeric columns side by side, shape (n, k)."""
        return np.stack([self.numbers[column] for column in columns], axis=-1)
