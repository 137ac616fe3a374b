"""Accuracy of the calibration on the ground: check points and error budget."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.report.markdown import Text, adjustment_title, heading, show, table
from acx4book.report.material import Material, validated
from acx4book.typesetting import style
from acx4book.typesetting.matrix import sigma_figure
from acx4files.results import folder
from acx4files.results.read_back import calibrated_methods, read_calibration
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy, budget
from acx4lib.georeferencing.budget import SOURCES, MappingFlight

# --- Check points: their differences, in a table and drawn, and the accuracy classes reached


LABELLED = 40
"""Number of check points up to which all names are on the axis."""


def check_points_section(material: Material) -> Text:
    """Return the section on the differences at check points, and the classes reached."""
    name, obtained = (
        "tab-report-classes",
        "the differences of the calibration, by the standards named",
    )
    return show(
        table(_check_table(material), DIFFERENCES, name="tab-report-check", obtained=FROM_POINTS),
        table(_class_table(material), "Accuracy classes reached", name=name, obtained=obtained),
    )


DIFFERENCES = "Differences at check points"
FROM_POINTS = (
    "check_points.csv: rays of the images intersected, less the surveyed coordinates; predicted: "
    "the root of the mean variance"
)


def _check_table(material: Material) -> pd.DataFrame:
    """Return statistics of the differences at check points, by method and axis."""
    rows = []
    points = material.found.check_points
    for (stage, method), group in points.groupby(["stage", "method"], sort=False):
        d = group[["d_east_m", "d_north_m", "d_height_m"]].to_numpy()
        sigma = group[["sigma_east_m", "sigma_north_m", "sigma_height_m"]].to_numpy()
        statistics = accuracy.from_differences(d)
        mean_sigma = _mean_sigma(material, f"{stage}/{method}")
        for i, axis in enumerate(AXES):
            rows.append(
                {
                    "Differences": heading(f"{stage}/{method}"),
                    "Axis": axis,
                    "Points": statistics.n,
                    "Mean (m)": statistics.mean[i],
                    "Std (m)": statistics.std[i],
                    "RMS (m)": statistics.rms[i],
                    "Predicted (m)": float(np.sqrt(np.mean(sigma[:, i] ** 2))),
                    "Mean / σ": statistics.mean[i] / mean_sigma[i],
                }
            )
    return pd.DataFrame(rows)


def _mean_sigma(material: Material, stage_method: str) -> Array:
    """Return the sigma of the mean differences, with all correlations; NaN if unknown."""
    points = material.found.summary.get(stage_method, {}).get("points")
    sigma = points.get("mean_sigma") if isinstance(points, dict) else None
    return np.array([np.nan] * 3 if sigma is None else sigma, dtype=float)


def _class_table(material: Material) -> pd.DataFrame:
    """Return the accuracy classes that the validation reaches."""
    entry = material.found.summary.get(validated(material), {})
    points = entry.get("points")
    classes = points.get("classes", {}) if isinstance(points, dict) else {}
    rows: list[tuple[str, str]] = []
    for name, reached in classes.get("pec_pcd", {}).items():
        rows.append((f"PEC-PCD {name}, plan / height", f"{reached['plan']} / {reached['height']}"))
    if "nssda" in classes:
        rows.append(("NSSDA", classes["nssda"]["statement"]))
    if "asprs_2014" in classes:
        reached = classes["asprs_2014"]
        rows.append(
            (
                "ASPRS 2014, horizontal / vertical",
                f"{reached['horizontal']} / {reached['vertical']}",
            )
        )
    if "asprs_2023" in classes:
        reached = classes["asprs_2023"]
        text = f"{reached['horizontal']} / {reached['vertical']} / {reached['three_d']}"
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
    x = np.arange(len(points))
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 4.6), sharex=True)
        for i, (ax, axis) in enumerate(zip(axes, AXES, strict=True)):
            d, sigma = points[f"d_{axis}_m"], points[f"sigma_{axis}_m"]
            ax.bar(x, 4 * sigma, bottom=-2 * sigma, width=0.7, color=style.SOFT, alpha=0.16, lw=0)
            ax.plot(x, d, "o", ms=3.4, color=style.colour(0))
            ax.axhline(0, color=style.INK, lw=0.7)
            ax.set_ylabel(f"{axis} (m)")
            ax.grid(visible=False, axis="x")
            if i == 2 and len(points) <= LABELLED:
                ax.set_xticks(x, [style.plain(name) for name in points["point"]], rotation=90)
        axes[-1].set_xlabel("check point")
        axes[-1].set_xlim(-0.8, len(points) - 0.2)
    return fig


# --- The error budget: predicted errors of ground points by their sources, and over the format


WITHOUT = "No error budget: "
"""First words of the reason for a missing budget."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mapped:
    """A calibration and a mapping flight with the accuracies of this run.

    Attributes
    ----------
    calibration : Calibration
        Of one camera.
    flight : MappingFlight
    title : str
        Of the method, inside a sentence.
    """

    calibration: Calibration
    flight: MappingFlight
    title: str


def mapped(material: Material) -> Mapped | str:
    """Return calibration and flight for the budget, or the reason for its absence.

    The flight has the median height of the independent block, or else of the calibration block,
    its accuracies, and the usual overlaps.
    """
    name = material.calibration
    if name.partition("/")[2] not in calibrated_methods(material.found):
        return f"{WITHOUT}the run has no calibration with all its parameters determined."
    cameras = folder.cameras(material.found, name)
    if len(cameras) != 1:
        return f"{WITHOUT}it is made for one camera, and this calibration has {len(cameras)}."
    camera = material.flight.cameras[cameras[0]]
    calibration = read_calibration(material.found, name, [camera])
    if not budget.looks_down(calibration.cameras[0]):
        return f"{WITHOUT}it is made for a camera that looks down with all of its format."
    block = next(
        material.flight.block(kind)
        for kind in ("validation", "calibration")
        if kind in material.flight.blocks
    )
    flight = budget.like(block, calibration.cameras[0])
    if flight is None:
        return f"{WITHOUT}the flight states no flying height, or no σ of positions or attitudes."
    return Mapped(calibration=calibration, flight=flight, title=adjustment_title(name))


def section(found: Mapped | str) -> Text:
    """Return the section on the error budget: assumptions and sources."""
    drawn = table(_source_table(found), SOURCES_OF, name="tab-report-budget", obtained=PREDICTED)
    return show(_assumed(found), "" if isinstance(found, str) else drawn)


def _source_table(basis: Mapped | str) -> pd.DataFrame:
    """Return every source of the error with σ and share of the variance, in plan and in height."""
    if isinstance(basis, str):
        return pd.DataFrame()
    mean = budget.over_ground(basis.calibration, basis.flight).mean
    rows = []  # a correlation term can be negative: signed root of its absolute value
    parts = {name: mean[:, i] for i, name in enumerate(SOURCES) if name != "survey"}
    for name, part in {**parts, "together": mean.sum(axis=-1)}.items():
        plan, height = part[:2].sum(), part[2]
        rows.append(
            (
                name,
                *(_root(plan), 100 * plan / mean[:2].sum()),
                *(_root(height), 100 * height / mean[2].sum()),
            )
        )
    head = ("Source", "σ in plan (m)", "in plan (%)", "σ in height (m)", "in height (%)")
    return pd.DataFrame(rows, columns=list(head))


def _assumed(basis: Mapped | str) -> str:
    """Return the assumptions of the budget, or the reason for its absence."""
    if isinstance(basis, str):
        return basis
    flight, degrees = basis.flight, np.degrees(basis.flight.sigma_attitude)
    east, north, up = (100 * sigma for sigma in flight.sigma_position_m)
    return (
        f"The budget holds for a regular mapping flight with the calibration {basis.title}: "
        f"vertical images {flight.height_m:.0f} m over flat ground, overlaps of "
        f"{100 * flight.forward:.0f} and {100 * flight.side:.0f} %, neighbouring strips flown in "
        f"opposite directions, every point intersected from all images that show it. A priori σ, "
        f"those of this flight: image points {flight.sigma_px:.2f} px; positions {east:.1f}, "
        f"{north:.1f} and {up:.1f} cm in east, north and height; roll {degrees[0]:.4f}°, pitch "
        f"{degrees[1]:.4f}°, heading {degrees[2]:.4f}°, independent from exposure to exposure."
    )


SOURCES_OF = "Predicted error of ground points by its sources, mean over the ground"
PREDICTED = (
    "the derivatives of intersected points by image points, trajectory and calibration, with their "
    "covariances a priori"
)


def _root(variance: float) -> float:
    return float(np.sign(variance) * np.sqrt(abs(variance)))


def over_format(found: Mapped | str) -> Figure:
    """Draw the σ of ground points over the format: in plan, in height, and of the calibration."""
    if isinstance(found, str):
        return style.nothing(found)
    return sigma_figure(budget.over_format(found.calibration, found.flight))


def recorded(found: Mapped | str) -> dict[str, Any]:
    """Return the budget for the report's JSON: accuracies, and variances in m^2 by source."""
    if isinstance(found, str):
        return {"reason": found}
    flight = found.flight
    mean = budget.over_ground(found.calibration, flight).mean
    return {
        "height_m": flight.height_m,
        "forward_overlap": flight.forward,
        "side_overlap": flight.side,
        "sigma_px": flight.sigma_px,
        "sigma_position_m": flight.sigma_position_m,
        "sigma_attitude_deg": np.degrees(flight.sigma_attitude),
        "sources": [
            {"source": name, "plan_m2": part[0] + part[1], "height_m2": part[2]}
            for name, part in zip(SOURCES, mean.T, strict=True)
        ],
    }
