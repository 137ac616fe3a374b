"""The error budget: predicted errors of ground points by their sources, and over the format."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.report.material import Material
from acx4book.report.shown import Text, show, table
from acx4book.report.words import adjustment_title
from acx4book.typesetting import style
from acx4book.typesetting.field import sigma_figure
from acx4lib.calibration.estimates import Calibration
from acx4lib.georeferencing import mapping_flight
from acx4lib.georeferencing.budget import SOURCES
from acx4lib.georeferencing.mapping_flight import MappingFlight
from acx4lib.results import folder
from acx4lib.results.read_back import calibrated_methods, read_calibration

WITHOUT = "No error budget: "
"""How the reason begins why there is none."""


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
    """Return what the budget is computed from, or the reason why there is none.

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
    if not mapping_flight.looks_down(calibration.cameras[0]):
        return f"{WITHOUT}it is made for a camera that looks down with all of its format."
    block = next(
        material.flight.block(kind)
        for kind in ("validation", "calibration")
        if kind in material.flight.blocks
    )
    flight = mapping_flight.like(block, calibration.cameras[0])
    if flight is None:
        return f"{WITHOUT}the flight states no flying height, or no σ of positions or attitudes."
    return Mapped(calibration=calibration, flight=flight, title=adjustment_title(name))


def section(found: Mapped | str) -> Text:
    """Return the section on the error budget: what it holds for, and every source."""
    drawn = table(source_table(found), SOURCES_OF, name="tab-report-budget", obtained=PREDICTED)
    return show(assumed(found), "" if isinstance(found, str) else drawn)


SOURCES_OF = "Predicted error of ground points by its sources, mean over the ground"
PREDICTED = (
    "the derivatives of intersected points by image points, trajectory and calibration, with their "
    "covariances a priori"
)


def assumed(found: Mapped | str) -> str:
    """Return what the budget holds for, or why there is none."""
    if isinstance(found, str):
        return found
    flight, degrees = found.flight, np.degrees(found.flight.sigma_attitude)
    east, north, up = (100 * sigma for sigma in flight.sigma_position_m)
    return (
        f"The budget holds for a regular mapping flight with the calibration {found.title}: "
        f"vertical images {flight.height_m:.0f} m over flat ground, overlaps of "
        f"{100 * flight.forward:.0f} and {100 * flight.side:.0f} %, neighbouring strips flown in "
        f"opposite directions, every point intersected from all images that show it. A priori σ, "
        f"those of this flight: image points {flight.sigma_px:.2f} px; positions {east:.1f}, "
        f"{north:.1f} and {up:.1f} cm in east, north and height; roll {degrees[0]:.4f}°, pitch "
        f"{degrees[1]:.4f}°, heading {degrees[2]:.4f}°, independent from exposure to exposure."
    )


def source_table(found: Mapped | str) -> pd.DataFrame:
    """Return every source of the error: its σ in plan and in height, and its share of the variance.

    Of a correlation, σ is the root of the size of its variance, with the sign of the variance.
    """
    if isinstance(found, str):
        return pd.DataFrame()
    mean = mapping_flight.over_ground(found.calibration, found.flight).mean
    rows = []
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


def _root(variance: float) -> float:
    return float(np.sign(variance) * np.sqrt(abs(variance)))


def over_format(found: Mapped | str) -> Figure:
    """Draw the σ of ground points over the format: in plan, in height, and of the calibration."""
    if isinstance(found, str):
        return style.nothing(found)
    return sigma_figure(mapping_flight.over_format(found.calibration, found.flight))


def recorded(found: Mapped | str) -> dict[str, Any]:
    """Return the budget for the report's JSON: accuracies, and variances in m^2 by source."""
    if isinstance(found, str):
        return {"reason": found}
    flight = found.flight
    mean = mapping_flight.over_ground(found.calibration, flight).mean
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
