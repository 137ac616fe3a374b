"""Names and short texts of the report."""

from __future__ import annotations

import re
from collections.abc import Sequence

from acx4book.report.parameters.estimates import Pair
from acx4book.typesetting.labels import LABELS, TITLES, inside
from acx4book.typesetting.plain_text import Markup, shown

STAGES = {"heads": "head", "mounting": "", "validation": "validation,", "synthetic": "synthetic"}

_DRIFT = re.compile(r"gnss_drift_(.+)_(east|north|height)_m_per_(?:min|exposure)", re.DOTALL)


def adjustment_title(name: str) -> str:
    """Return the title for readers of ``stage/method`` or ``heads/bundle/CAM1``."""
    stage, method, *camera = name.split("/", 2)
    if stage == "heads":
        return f"head {camera[0]}" if camera else method.replace("_", " ")
    title = TITLES.get(method, method.replace("_", " "))
    return " ".join([STAGES[stage], inside(title)]).strip()


def heading(name: str) -> str:
    """Return the title of an adjustment for the beginning of a line."""
    return begun(adjustment_title(name))


def begun(text: str) -> str:
    """Return a text with a capital at its beginning; the rest does not change."""
    return text[:1].upper() + text[1:]


def parameter_title(name: str) -> str:
    """Return the title for readers of ``camera/parameter``, or of a parameter alone."""
    if drift := _DRIFT.fullmatch(name):
        return f"GNSS drift of strip {drift[1]}, {drift[2]}"
    return LABELS.get(name.rpartition("/")[2], name)


def pair_texts(pairs: Sequence[Pair]) -> list[Markup]:
    """Return pairs of parameters with their correlations, and their camera where several occur."""
    cameras = {name.rpartition("/")[0] for pair in pairs for name in (pair.one, pair.other)}
    return [_pair_text(pair, whose=len(cameras) > 1) for pair in pairs]


def _pair_text(pair: Pair, *, whose: bool) -> Markup:
    one, other = (shown(parameter_title(name)) for name in (pair.one, pair.other))
    first, last = (name.rpartition("/")[0] for name in (pair.one, pair.other))
    if whose and last:
        other = Markup(f"{other} of {shown(last)}")
    if whose and first and first != last:
        one = Markup(f"{one} of {shown(first)}")
    return Markup(f"{one} and {other} ({pair.rho:+.2f})")


def listed(names: Sequence[str]) -> str:
    """Return names as part of a sentence: a, b and c."""
    return " and ".join([part for part in (", ".join(names[:-1]), *names[-1:]) if part])


def plural(n: int, noun: str) -> str:
    """Return a number with its noun; zero as a word."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}" if n else f"no {noun}s"
