"""Which flight determines which parameter."""

from __future__ import annotations

import pandas as pd

from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import myst_table
from acx4book.typesetting.plain_text import Markup
from acx4lib.calibration.estimates import LIMIT_BORESIGHT_DEG, LIMIT_INTERIOR, LIMIT_LEVER_M
from acx4lib.calibration.trust.needs import needed
from acx4lib.geometry.parameters import REPORTED


def geometry_page() -> str:
    """Return which geometry determines which parameter, as MyST text."""
    caption = "What a parameter needs, and the σ above which it counts as not determined"
    return myst_table(geometry_table(), caption, name="tab-geometry") + "\n"


def geometry_table() -> pd.DataFrame:
    """Return limit and geometry for every parameter; neighbours with the same ones in one row."""
    rows: list[dict[str, str]] = []
    for key, (name, _) in REPORTED.items():
        limit, geometry = _limit(key), needed(key)
        if rows and (rows[-1]["Largest σ"], rows[-1]["It needs"]) == (limit, geometry):
            rows[-1]["Parameter"] = Markup(f"{rows[-1]['Parameter']}, {LABELS[name]}")
        else:
            rows.append({"Parameter": LABELS[name], "Largest σ": limit, "It needs": geometry})
    return pd.DataFrame(rows)


def _limit(key: str) -> str:
    """Return the sigma above which a parameter is not determined; any is accepted of a lens."""
    if key.startswith("lever"):
        return f"{LIMIT_LEVER_M:g} m"
    if key.startswith("boresight"):
        return f"{LIMIT_BORESIGHT_DEG:g}°"
    if key in ("f", "xp", "yp"):
        return Markup(f"{100 * LIMIT_INTERIOR:g} % of $f$")
    return "any"
