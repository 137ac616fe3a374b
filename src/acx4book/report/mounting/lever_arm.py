"""The lever arm: as it was surveyed, and as the calibration estimates it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from acx4book.report.material import Material
from acx4book.report.words import parameter_title
from acx4book.typesetting.labels import p_value, value_and_sigma
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.parameters import LEVER_ARM, REPORTED
from acx4lib.results import folder

AS_SURVEYED = "held as surveyed"


def lever_table(material: Material) -> pd.DataFrame:
    """Return the surveyed components of every lever arm beside the estimated ones, in m.

    The difference is that of all other observations, without the surveyed values that took part as
    observations; *p* is the probability of such differences or larger ones of the whole lever arm,
    and needs the standard deviation of the survey. Empty where nothing was surveyed.
    """
    method = material.calibration
    cameras = folder.cameras(material.found, method) if method else ()
    rows = [row for name in cameras for row in _rows(material, material.flight.cameras[name])]
    table = pd.DataFrame(rows)
    return table.drop(columns="Camera") if len(cameras) < 2 and rows else table


def _rows(material: Material, camera: Camera) -> Iterator[dict[str, str]]:
    found = folder.parameters(material.found, material.calibration, camera.name)
    summary = material.found.summary[material.calibration].get("declared")
    told = summary.get(f"{camera.name}/lever_arm", {}) if isinstance(summary, dict) else {}
    given = told.get("difference") or [None] * 3
    for i, key in enumerate(LEVER_ARM):
        if not camera.prior.lever_declared[i]:
            continue
        label, surveyed = REPORTED[key][0], float(camera.T_b_c.r[i])
        sigma, row = camera.prior.lever_sigma[i], {"Camera": camera.name}
        row |= {"Component": parameter_title(label)}
        row |= {"Surveyed (m)": _surveyed(surveyed, sigma)}
        if label in found.index:
            value = float(found["value"][label])
            difference = value - surveyed if given[i] is None else float(given[i])
            row |= {"Estimated (m)": value_and_sigma(value, float(found["sigma"][label]))}
            row |= {"Difference (m)": f"{difference:+.3f}", "p": _p(told.get("p"))}
        else:
            row |= {"Estimated (m)": AS_SURVEYED, "Difference (m)": "", "p": ""}
        yield row


def _surveyed(value: float, sigma: float) -> str:
    return value_and_sigma(value, sigma) if np.isfinite(sigma) else f"{value:g}, σ not stated"


def _p(p: object) -> str:
    return p_value(float(p)) if isinstance(p, int | float) and np.isfinite(p) else ""


def lever_sentence(material: Material) -> str:
    """Return a sentence where no lever arm was surveyed."""
    if not material.calibration or not lever_table(material).empty:
        return ""
    return "flight.toml states no surveyed lever arm; the estimated one is compared with none."
