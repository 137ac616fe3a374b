"""What the parts of the report show beside figures: texts with tables."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from acx4book.report.material import Material, image_residuals
from acx4book.report.parameters.estimates import correlations
from acx4book.report.words import heading
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import myst_table

FORMATS = {
    "σ₀²": ".3f",
    "p": ".3g",
    "Redundancy": ",.0f",
    "Observations": ",",
    "Unknowns": ",",
    "Expected by chance": ".1f",
    "Found and rejected": ",",
    "Number": ",",
    "A priori σ": ",.9g",
    "A posteriori σ": ",.9g",
    "Detectable, median": ",.9g",
    "Detectable, largest": ",.9g",
    "Ratio": ".2f",
    "Mean redundancy": ".2f",
    "Below 0.1": ",",
    "t": ".1f",
    "Largest single t": ".1f",
    "F": ".1f",
    "Mean (m)": "+.3f",
    "Std (m)": ".3f",
    "RMS (m)": ".3f",
    "Predicted (m)": ".3f",
    "Mean / σ": ".1f",
    "σ in plan (m)": ".3f",
    "σ in height (m)": ".3f",
    "in plan (%)": "z.1f",
    "in height (%)": "z.1f",
    "p of the drift": ".2g",
    "p of the strips": ".2g",
}
"""Formats of the numbers, by the name of the column."""


OBTAINED = "How obtained"
"""Begins the line under a table that says where its numbers come from."""


@dataclass(frozen=True, repr=False)
class Text:
    """Markdown of a part of the report."""

    markdown: str


def table(frame: pd.DataFrame, caption: str, *, name: str, obtained: str = "") -> str:
    """Return a table with its caption and how its numbers were obtained.

    A table without rows is a sentence.
    """
    if frame.empty:
        return f"{caption}: this run has none."
    formats = {column: FORMATS[column] for column in frame.columns if column in FORMATS}
    numbers = frame.columns[frame.columns.str.startswith("w (")]
    drawn = myst_table(
        frame, caption, name=name, formats={**formats, **dict.fromkeys(numbers, ".1f")}
    )
    return f"{drawn}\n\n*{OBTAINED}: {obtained}*" if obtained else drawn


def show(*parts: str) -> Text:
    """Return sentences and tables as the output of a cell."""
    return Text("\n\n".join(part for part in parts if part))


def planes(material: Material, stage: str) -> dict[str, pd.DataFrame]:
    """Return the image residuals of a stage's decisive adjustments, by their titles.

    Parameters
    ----------
    material : Material
    stage : str
        ``mounting`` or ``heads``.
    """
    names = [name for name in material.decisive if name.startswith(f"{stage}/")]
    return {heading(name): image_residuals(material, name) for name in names}


def correlation_picture(material: Material) -> pd.DataFrame:
    """Return the correlations of the calibration, for `matrix.correlation_matrix`."""
    if not material.calibration:
        return pd.DataFrame()
    related = correlations(material, material.calibration)
    names = [str(name) for name in related.index]
    parts = [name.rpartition("/") for name in names]  # a parameter has no slash, a strip may have
    if len({camera for camera, _, _ in parts}) == 1 and all(name in LABELS for *_, name in parts):
        names = [name for *_, name in parts]
    return pd.DataFrame(related.to_numpy(), index=names, columns=names)
