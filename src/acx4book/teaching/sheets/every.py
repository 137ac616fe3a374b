"""All lab sheets."""

from acx4book.teaching.flights import Sheet
from acx4book.teaching.sheets import (
    design,
    estimates,
    gross_errors,
    intersection,
    lens,
    mounting,
    pixels,
    planning,
    rotations,
)

_ORDER = (
    pixels,
    rotations,
    intersection,
    lens,
    gross_errors,
    mounting,
    estimates,
    design,
    planning,
)

SHEETS: dict[str, Sheet] = {module.SHEET.name: module.SHEET for module in _ORDER}
"""By name, in the order of the course."""


def sheet_of(text: str) -> Sheet:
    """Return the sheet of a number or a name, such as ``6`` or ``lab-6``; ValueError if unknown."""
    name = text if text.startswith("lab-") else f"lab-{text}"
    if name not in SHEETS:
        msg = f"unknown sheet {text!r}; known: {', '.join(SHEETS)}"
        raise ValueError(msg)
    return SHEETS[name]
