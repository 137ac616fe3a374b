"""Check points: their differences, in a table and drawn, and the accuracy classes reached."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.report.material import Material, validated
from acx4book.report.shown import Text, show, table
from acx4book.report.words import heading
from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy

LABELLED = 40
"""Number of check points up to which all names are on the axis."""


def section(material: Material) -> Text:
    """Return the section on the differences at check points, and the classes reached."""
    name, told = "tab-report-classes", "the differences of the calibration, by the standards named"
    return show(
        table(check_table(material), DIFFERENCES, name="tab-report-check", obtained=FROM_POINTS),
        table(class_table(material), "Accuracy classes reached", name=name, obtained=told),
    )


DIFFERENCES = "Differences at check points"
FROM_POINTS = (
    "check_points.csv: rays of the images intersected, less the surveyed coordinates; predicted: "
    "the root of the mean variance"
)


def check_table(material: Material) -> pd.DataFrame:
    """Return statistics of the differences at check points, by method and axis."""
    rows = []
    found = material.found.check_points
    for (stage, method), own in found.groupby(["stage", "method"], sort=False):
        d = own[["d_east_m", "d_north_m", "d_height_m"]].to_numpy()
        sigma = own[["sigma_east_m", "sigma_north_m", "sigma_height_m"]].to_numpy()
        said = accuracy.from_differences(d)
        mean_sigma = _mean_sigma(material, f"{stage}/{method}")
        for i, axis in enumerate(AXES):
            rows.append(
                {
                    "Differences": heading(f"{stage}/{method}"),
                    "Axis": axis,
                    "Points": said.n,
                    "Mean (m)": said.mean[i],
                    "Std (m)": said.std[i],
                    "RMS (m)": said.rms[i],
                    "Predicted (m)": float(np.sqrt(np.mean(sigma[:, i] ** 2))),
                    "Mean / σ": said.mean[i] / mean_sigma[i],
                }
            )
    return pd.DataFrame(rows)


def _mean_sigma(material: Material, stage_method: str) -> Array:
    """Return the sigma of the mean differences with all correlations; NaN where not known."""
    points = material.found.summary.get(stage_method, {}).get("points")
    found = points.get("mean_sigma") if isinstance(points, dict) else None
    return np.array([np.nan] * 3 if found is None else found, dtype=float)


def class_table(material: Material) -> pd.DataFrame:
    """Return the accuracy classes that the validation reaches."""
    entry = material.found.summary.get(validated(material), {})
    points = entry.get("points")
    classes = points.get("classes", {}) if isinstance(points, dict) else {}
    rows: list[tuple[str, str]] = []
    for name, one in classes.get("pec_pcd", {}).items():
        rows.append((f"PEC-PCD {name}, plan / height", f"{one['plan']} / {one['height']}"))
    if "nssda" in classes:
        rows.append(("NSSDA", classes["nssda"]["statement"]))
    if "asprs_2014" in classes:
        one = classes["asprs_2014"]
        rows.append(
            ("ASPRS 2014, horizontal / vertical", f"{one['horizontal']} / {one['vertical']}")
        )
    if "asprs_2023" in classes:
        one = classes["asprs_2023"]
        text = f"{one['horizontal']} / {one['vertical']} / {one['three_d']}"
        rows.append(("ASPRS 2023, horizontal / vertical / 3D", text))
    rows.sort(key=lambda row: _scale(row[0]))
    return pd.DataFrame(rows, columns=["Standard", "Reached"])


def _scale(standard: str) -> int:
    """Return the denominator of a row's map scale, for sorting; other rows come last."""
    digits = standard.partition("1:")[2].partition(",")[0]
    return int(digits) if standard.startswith("PEC") and digits.isdigit() else 10**9


def check_points(points: pd.DataFrame) -> Figure:
    """Draw the differences at check points with twice their predicted sigma.

    Parameters
    ----------
    points : DataFrame
        Rows of check_points.csv of one method.
    """
    if points.empty:
        return style.nothing("There are no check points.")
    at = np.arange(len(points))
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 4.6), sharex=True)
        for i, (ax, axis) in enumerate(zip(axes, AXES, strict=True)):
            d, sigma = points[f"d_{axis}_m"], points[f"sigma_{axis}_m"]
            ax.bar(at, 4 * sigma, bottom=-2 * sigma, width=0.7, color=style.SOFT, alpha=0.16, lw=0)
            ax.plot(at, d, "o", ms=3.4, color=style.colour(0))
            ax.axhline(0, color=style.INK, lw=0.7)
            ax.set_ylabel(f"{axis} (m)")
            ax.grid(visible=False, axis="x")
            if i == 2 and len(points) <= LABELLED:
                ax.set_xticks(at, [style.plain(name) for name in points["point"]], rotation=90)
        axes[-1].set_xlabel("check point")
        axes[-1].set_xlim(-0.8, len(points) - 0.2)
    return fig
