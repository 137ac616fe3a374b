"""The table of the failure clinic: what every mistake leaves in residuals and parameters."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from acx4book.chapters.beyond.failures.examined import Examined, standardised, worst
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup


def table(found: Mapping[str, Examined]) -> pd.DataFrame:
    """Return what every mistake leaves in residuals and parameters, as text.

    Parameters
    ----------
    found : mapping of str to Examined
    """
    return pd.DataFrame([{"Mistake": name, **_cells(one)} for name, one in found.items()])


def _cells(one: Examined) -> dict[str, str]:
    off = worst(one)
    if off is None:
        return {
            "Largest residuals": "refused when it is read",
            "Rejected": "",
            "Parameter that is most wrong": "",
            "wrong by": "",
            "in its own σ": "",
        }
    rms = standardised(one)
    return {
        "Largest residuals": f"{rms.idxmax()}, {rms.max():.3g} σ",
        "Rejected": f"{len(one.rejected)}",
        "Parameter that is most wrong": Markup(LABELS[str(off.name)]),
        "wrong by": _with_unit(float(off["error"]), str(off["unit"])),
        "in its own σ": f"{off['off']:.3g}",
    }


def _with_unit(value: float, unit: str) -> Markup:
    if unit == "deg":
        return Markup(f"{value:+.3g}°")
    number = scientific(value, digits=1) if abs(value) < 1e-3 else f"{value:+.3g}"
    return Markup(f"{number} {unit}")
