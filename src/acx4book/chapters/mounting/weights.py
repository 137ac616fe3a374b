"""Whether the given standard deviations agree with the residuals: variance components."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.bundle.variance_components import Component, components, sentences
from acx4lib.calibration.mounting import Mounting

NOTHING = "There is no single step, and so no residuals to compare with their sigma."
TOO_FEW = "too little redundancy"
FORMATS = {"Redundancy": ".1f", "Effective": ".1f", "Used": ".2f"}


def found(single: Mounting | None, applied: Mapping[str, float]) -> Sequence[Component]:
    """Return the variance components of the single step.

    Parameters
    ----------
    single : Mounting or None
        None where the single step has no outcome; it then has no components.
    applied : mapping of str to float
        By what the given sigma were multiplied for it.
    """
    return () if single is None else components(single.bundle, applied=applied)


def table(found: Sequence[Component]) -> pd.DataFrame:
    """Return the variance components as a table."""
    if not found:
        nothing = dict.fromkeys(("Number", *FORMATS), np.nan)
        return pd.DataFrame([{"Observations": "no single step", **nothing}])
    return pd.DataFrame([_row(c) for c in found])


def _row(c: Component) -> dict[str, object]:
    return {
        "Observations": c.group,
        "Number": c.n,
        "Redundancy": c.redundancy,
        "Effective": c.effective,
        "Factor of σ": factor(c.factor, c.sigma) if c.estimable else TOO_FEW,
        "Used": c.applied,
    }


def factor(factor: float, sigma: float) -> Markup:
    """Return a factor with its standard deviation."""
    return Markup(f"{factor:.2f} ± {sigma:.2f}")


def sentence(found: Sequence[Component]) -> str:
    """Say which sigma are wrong or were multiplied, as a list; or that none is."""
    if not found:
        return NOTHING
    lines = [f"- {shown(line[0].upper() + line[1:])}." for line in sentences(found)]
    if lines:
        return "\n".join(lines)
    judged = "; ".join(shown(c.group) for c in found if c.estimable)
    return f"The residuals contradict no standard deviation that they can judge: {judged}."
