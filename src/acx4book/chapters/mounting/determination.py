"""What a calibration determines least, and which flight determines what, as tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import pandas as pd

from acx4book.typesetting.labels import LABELS, TITLES
from acx4book.typesetting.myst import myst_table, scientific
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.calibration.determination import Pair, Part, strong_correlations, weakest_combination
from acx4lib.calibration.estimates import HELP, LIMIT_BORESIGHT_DEG, LIMIT_INTERIOR, LIMIT_LEVER_M
from acx4lib.calibration.mounting import Mounting
from acx4lib.geometry.parameters import REPORTED

NAMES = LABELS | {f"boresight_{axis}": Markup(f"boresight about ${axis}$") for axis in "xyz"}


def determination_table(methods: Mapping[str, Mounting]) -> pd.DataFrame:
    """Return condition, weakest combination and strong correlations of every method."""
    rows = []
    for method, mounting in methods.items():
        several = len(mounting.calibration.cameras) > 1
        label = partial(_label, with_camera=several)
        parts = weakest_combination(mounting.bundle)
        pairs = strong_correlations(mounting.calibration)
        rows.append(
            {
                "Method": TITLES[method],
                "Condition": scientific(mounting.bundle.solution.condition),
                "Weakest combination": Markup("; ".join(_part(part, label) for part in parts)),
                "Correlations above 0.9": Markup("; ".join(_pair(pair, label) for pair in pairs)),
            }
        )
    return pd.DataFrame(rows)


def _part(part: Part, label: Callable[[str], str]) -> str:
    return f"{label(part.unknown)} {100 * part.share:.0f} %"


def _pair(pair: Pair, label: Callable[[str], str]) -> str:
    size = f"{pair.correlation:+.2f}".replace("-", "\N{MINUS SIGN}")
    return f"{label(pair.row)}, {label(pair.column)} {size}"


def _label(name: str, *, with_camera: bool) -> str:
    """Return what a reader sees for ``camera/parameter`` or for an unknown of the poses."""
    camera, _, parameter = name.rpartition("/")
    label = shown(NAMES.get(parameter, parameter))
    return f"{shown(camera)} {label}" if camera and with_camera else label


def geometry_page() -> str:
    """Return which geometry determines which parameter, as MyST text."""
    caption = "What a parameter needs, and the σ above which it counts as not determined"
    return myst_table(geometry_table(), caption, name="tab-geometry") + "\n"


def geometry_table() -> pd.DataFrame:
    """Return limit and geometry for every parameter; neighbours with the same ones in one row."""
    rows: list[dict[str, str]] = []
    for key, (name, _) in REPORTED.items():
        limit, needed = _limit(key), HELP[key]
        if rows and (rows[-1]["Largest σ"], rows[-1]["It needs"]) == (limit, needed):
            rows[-1]["Parameter"] = Markup(f"{rows[-1]['Parameter']}, {LABELS[name]}")
        else:
            rows.append({"Parameter": LABELS[name], "Largest σ": limit, "It needs": needed})
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
