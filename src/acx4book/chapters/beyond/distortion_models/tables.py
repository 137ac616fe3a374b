"""Tables of the chapter: what every model makes of every case, and of the seams."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.distortion_models import seams
from acx4book.chapters.beyond.distortion_models.families import MODELS
from acx4book.chapters.beyond.distortion_models.seams import Pattern
from acx4book.chapters.beyond.distortion_models.study import REAL, Study, summary

FIT_FORMATS = {
    "Number": ".0f",
    "σ₀²": ".2f",
    "BIC less Brown's": "+.0f",
    "Joint χ²/k": ".1f",
    "Flights (%)": ".0f",
    "Max. |ρ|": ".3f",
}
ERROR_FORMATS = {
    "Strip: residuals (px)": ".3f",
    "Strip: plan (m)": ".3f",
    "Strip: height (m)": ".3f",
    "Direct: plan (m)": ".3f",
    "Direct: height (m)": ".3f",
}


def fits(study: Study) -> pd.DataFrame:
    """Return how every model fits every case: means over flights."""
    found = summary(study)
    return pd.DataFrame(
        {
            **_names(found),
            "Number": found["parameters"],
            "σ₀²": found["sigma0_sq"],
            "BIC less Brown's": found["bic_less_first"],
            "Joint χ²/k": found["joint"],
            "Flights (%)": 100 * found["significant"],
            "Max. |ρ|": found["correlation"],
        }
    )


def errors(study: Study) -> pd.DataFrame:
    """Return what strips left out and direct georeferencing show: root mean squares."""
    found = summary(study)
    found = found[found["case"] != REAL]
    names = ("strip_px", "strip_plan_m", "strip_height_m", "direct_plan_m", "direct_height_m")
    numbers = {title: found[name] for title, name in zip(ERROR_FORMATS, names, strict=True)}
    return pd.DataFrame(_names(found) | numbers)


def _names(found: pd.DataFrame) -> dict[str, pd.Series]:
    """Return the names of cases and models, those of models in one line."""
    unbroken = found["model"].str.replace(" ", "\N{NO-BREAK SPACE}")
    return {"Case": found["case"], "Model": unbroken}


def pattern(found: Pattern) -> pd.DataFrame:
    """Return what every model leaves of the pattern of the synthetic image, RMS by height, px."""
    rows = {model.name: seams.left(found, model) for model in MODELS}
    rows[seams.HEADS] = seams.left_by_heads(found, MODELS[0])
    rows = {"nothing fitted": found.d_px} | rows
    return pd.DataFrame(
        [
            {"Fitted": name}
            | {f"From {h:.0f} m (px)": rms(d[found.height_m == h]) for h in heights(found)}
            for name, d in rows.items()
        ]
    )


def heights(found: Pattern) -> list[float]:
    """Return the flying heights of a pattern."""
    return [float(h) for h in np.unique(found.height_m)]


def rms(d: np.ndarray) -> float:
    """Return the root mean square by coordinate."""
    return float(np.sqrt(np.mean(d**2)))
