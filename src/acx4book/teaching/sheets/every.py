"""All lab sheets."""

from acx4book.teaching.flights import Sheet
from acx4book.teaching.sheets import calibrations, images, plans

_ORDER = (
    images.LAB_1,
    images.LAB_2,
    images.LAB_3,
    calibrations.LAB_4,
    calibrations.LAB_5,
    calibrations.LAB_6,
    calibrations.LAB_7,
    plans.LAB_8,
    plans.LAB_9,
)

SHEETS: dict[str, Sheet] = {sheet.name: sheet for sheet in _ORDER}
"""By name, in the order of the course."""


def sheet_of(text: str) -> Sheet:
    """Return the sheet of a number or a name, such as ``6`` or ``lab-6``; ValueError if unknown."""
    name = text if text.startswith("lab-") else f"lab-{text}"
    if name not in SHEETS:
        msg = f"unknown sheet {text!r}; known: {', '.join(SHEETS)}"
        raise ValueError(msg)
    return SHEETS[name]
