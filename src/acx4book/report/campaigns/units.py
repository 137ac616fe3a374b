"""Rows, labels and units for readers; small changes have small units."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pandas as pd

from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import POWER, SUPERSCRIPTS
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.calibration.estimates import Parameter

SMALL = {"mm": (1e3, "µm"), "m": (1e3, "mm"), "deg": (3600.0, "″")}
"""Factor and sign of the unit for changes, by the unit of results."""


def rows_of(table: pd.DataFrame) -> Iterator[Any]:
    """Yield the rows of a table with its columns as attributes."""
    yield from table.itertuples(index=False)


def scale(unit: str) -> tuple[float, str]:
    """Return the factor to the unit for changes, and its sign."""
    return SMALL.get(unit, (1.0, unit))


def fine(unit: str, size: float) -> tuple[float, str]:
    """Return factor and unit for a figure; small numbers have a power of ten in the unit.

    Parameters
    ----------
    unit : str
        Of results.
    size : float
        Of what is drawn, in this unit.
    """
    factor, sign = scale(unit)
    power = math.floor(math.log10(size)) if unit not in SMALL and size > 0 else 0
    text = POWER.sub(lambda m: m[1].translate(SUPERSCRIPTS), "" if sign == "1" else sign)
    if not power:
        return factor, text
    return factor / 10.0**power, f"10{str(power).translate(SUPERSCRIPTS)} {text}".strip()


def label(name: str, camera: str = "") -> Markup:
    """Return the label of a parameter, after its camera where this must be said."""
    said = shown(LABELS.get(name, name))
    return Markup(f"{shown(camera)} {said}" if camera else said)


def cameras_to_say(parameters: tuple[Parameter, ...]) -> bool:
    """Tell whether parameters are of several cameras, so that each must be named."""
    return len({p.camera for p in parameters}) > 1
