"""Display of values: as a line, and as tables of numbers with their units and sigma."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar

import numpy as np

from acx4lib.errors import visible

if TYPE_CHECKING:
    import pandas as pd

C = TypeVar("C", bound=type)
K = TypeVar("K")
T = TypeVar("T", bound="Tabled")

LONGEST = 118
"""Most characters of a line."""


class Tabled(Protocol):
    """A value with a table."""

    def table(self) -> pd.DataFrame:
        """Return the table."""


# --- in a line -------------------------------------------------------------------------------


def line(what: str, *parts: str) -> str:
    """Describe a value in one line, a noun and its parts; empty parts are left out."""
    details = ", ".join(part for part in parts if part)
    text = visible(f"{what}: {details}" if details else what)
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"


def count(n: int, noun: str) -> str:
    """Return a number of things: ``1 image``, ``12 images``."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def names(given: Sequence[str], most: int = 6) -> str:
    """Return names with commas between them, the first of them where they are many."""
    if len(given) <= most:
        return ", ".join(given)
    return f"{', '.join(given[: most - 1])} and {len(given) - most + 1} more"


def briefly(kind: C) -> C:
    """Let values of a dataclass show arrays by their shape, and sequences by their length."""
    kind.__repr__ = _brief  # type: ignore[assignment]
    return kind


def _brief(value: object) -> str:
    parts = (f"{f.name} {_part(getattr(value, f.name))}" for f in fields(value))  # type: ignore[arg-type]
    return line(type(value).__name__, *parts)


def _part(value: object) -> str:
    if isinstance(value, np.ndarray):
        return str(value.shape)
    if isinstance(value, Mapping | Sequence) and not isinstance(value, str):
        return f"[{len(value)}]"
    if isinstance(value, float):
        return f"{value:.6g}"
    return repr(value) if isinstance(value, str | int | bool | None) else type(value).__name__


# --- as a table ------------------------------------------------------------------------------


class Row(NamedTuple):
    """A parameter of a camera.

    Attributes
    ----------
    camera, parameter, unit : str
    value, sigma : float
        Sigma a posteriori; NaN where the parameter is held, infinite where it is left open.
    """

    camera: str
    parameter: str
    unit: str
    value: float
    sigma: float


def parameter_table(rows: Iterable[Row]) -> pd.DataFrame:
    """Return parameters as a table.

    Returns
    -------
    DataFrame
        Index levels parameter and unit, before them camera where there are several; columns value
        and sigma.
    """
    import pandas as pd  # noqa: PLC0415 it loads long, and few programs show tables

    levels, columns = ["camera", "parameter", "unit"], ["value", "sigma"]
    frame = pd.DataFrame(list(rows), columns=[*levels, *columns])
    if len(set(frame["camera"])) <= 1:
        frame, levels = frame.drop(columns="camera"), levels[1:]
    return frame.astype(dict.fromkeys(columns, float)).set_index(levels)


def row_table(name: str | Sequence[str], rows: Mapping[K, Mapping[str, object]]) -> pd.DataFrame:
    """Return a table with a row for every name.

    Parameters
    ----------
    name : str or sequence of str
        Name of the index; a sequence where the keys have several parts.
    rows : mapping
        By their names, the values by their columns.
    """
    import pandas as pd  # noqa: PLC0415 it loads long, and few programs show tables

    several = [name] if isinstance(name, str) else list(name)
    keys = [(key,) if isinstance(name, str) else key for key in rows]
    index = pd.DataFrame(keys, columns=several)
    table = pd.concat([index, pd.DataFrame(list(rows.values()))], axis=1)
    return table.set_index(several)


def side_by_side(values: Mapping[str, Tabled]) -> pd.DataFrame:
    """Return the tables of values beside each other; missing rows are empty.

    Parameters
    ----------
    values : mapping
        By the names that stand above their columns.
    """
    import pandas as pd  # noqa: PLC0415 it loads long, and few programs show tables

    return pd.concat({name: value.table() for name, value in values.items()}, axis=1)


class ByName(dict[str, T]):
    """Values by their names, with a short representation."""

    def __repr__(self) -> str:
        """Return the kinds and names of the values in one line."""
        kinds = {type(value).__name__ for value in self.values()}
        return line(f"{' or '.join(sorted(kinds))} by name" if kinds else "nothing", *self)

    def table(self) -> pd.DataFrame:
        """Return the tables of all of them side by side."""
        return side_by_side(self)
