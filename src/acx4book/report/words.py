"""Names of adjustments and parameters for readers of a report, as plain text."""

from __future__ import annotations

import re
from collections.abc import Sequence

from acx4book.typesetting.myst import LABELS, SUPERSCRIPTS, TITLES, UNITS, inside

STAGES = {"heads": "", "mounting": "", "validation": "validation, ", "synthetic": "synthetic "}

DRIFT = re.compile(r"gnss_drift_(.+)_(east|north|height)_m_per_(?:min|exposure)", re.DOTALL)
TEX = {"\\omega": "ω", "\\varphi": "φ", "\\kappa": "κ", "$": ""}
INDICES = str.maketrans("p123", "ₚ₁₂₃")


def adjustment_title(name: str) -> str:
    """Return the title of ``stage/method`` or ``heads/bundle/CAM1``, for use in a sentence."""
    stage, method, *camera = name.split("/", 2)
    if camera:
        return f"head {camera[0]}"
    return STAGES.get(stage, "") + inside(TITLES.get(method, method.replace("_", " ")))


def parameter_title(name: str, with_camera: bool = False) -> str:
    """Return the title of ``camera/parameter``, or of a parameter alone, such as k₁."""
    camera = name.rpartition("/")[0]
    if with_camera and camera:
        return f"{parameter_title(name)} of {camera}"
    if drift := DRIFT.fullmatch(name):
        return f"GNSS drift of strip {drift[1]}, {drift[2]}"
    parameter = name.rpartition("/")[2]
    if parameter not in LABELS:
        return name
    title = str(LABELS[parameter])
    for tex, sign in TEX.items():
        title = title.replace(tex, sign)
    return re.sub("_(.)", lambda index: index[1].translate(INDICES), title)


def with_unit(title: str, unit: str) -> str:
    """Return a title with its unit in brackets."""
    shown = UNITS.get(unit, re.sub(r"\^(-\d)", lambda m: m[1].translate(SUPERSCRIPTS), unit))
    return f"{title} ({shown})" if unit not in ("", "1") else title


def begun(text: str) -> str:
    """Return a text with a capital at its beginning; the rest does not change."""
    return text[:1].upper() + text[1:]


def listed(names: Sequence[str]) -> str:
    """Return names as part of a sentence: a, b and c."""
    return " and ".join([part for part in (", ".join(names[:-1]), *names[-1:]) if part])


def plural(n: int, noun: str) -> str:
    """Return a number with its noun; zero as a word."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}" if n else f"no {noun}s"
