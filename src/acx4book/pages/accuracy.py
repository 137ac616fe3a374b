"""How accurate direct georeferencing is over many simulated flights, for the front page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.synthetic_cost import study
from acx4book.pages.benchmarks import stored
from acx4book.typesetting.labels import TITLES
from acx4book.typesetting.myst import myst_table
from acx4lib.georeferencing import accuracy, standards

SCALES = (2000, 5000)
"""Denominators of the scales that the paper claims."""

SPREAD = (0.05, 0.95)
"""Quantiles between which nine of ten flights lie."""

METHODS = ("single_step", "two_step")

Flights = pd.DataFrame
"""A row a flight: RMS over the check points in plan and height (m), and whether class A of PEC-PCD
is reached in plan_SCALE and height_SCALE."""


def page(benchmarks: Path) -> str:
    """Return the accuracy over flights as MyST text.

    Parameters
    ----------
    benchmarks : Path
        Folder with what ``make chain`` and ``make coverage`` left.
    """
    found = {"four heads, single-step": of_chain(study.read(benchmarks))}
    found |= {f"ideal camera, {TITLES[m]}": of_ideal(benchmarks, m) for m in METHODS}
    table = pd.DataFrame([_row(title, flights) for title, flights in found.items()])
    caption = "RMS at the check points of many simulated flights, and how many reach class A"
    return (
        "One flight is one draw. {numref}`tab-front-accuracy` has the accuracy of many flights of "
        "the same design: the median of the RMS over the check points, between which values nine "
        "of ten flights lie, and the share of flights that reach class A of the Brazilian standard "
        "PEC-PCD.\n\n" + myst_table(table, caption, name="tab-front-accuracy") + "\n"
    )


def of_chain(found: study.Study) -> Flights:
    """Return the flights whose synthetic images are made of four heads."""
    rms = study.rms_by_flight(found, study.SYNTHETIC)
    own = found.classes[found.classes["way"] == study.SYNTHETIC].set_index("seed")
    parts = [f"{part}_{scale}" for part in ("plan", "height") for scale in SCALES]
    return rms.join(own[parts] == "A")


def of_ideal(benchmarks: Path, method: str) -> Flights:
    """Return the flights whose synthetic images one ideal camera took."""
    _, (points,) = stored.read(benchmarks, "coverage", "points", make="coverage")
    rows = []
    for _, own in points[points["method"] == method].groupby("seed"):
        said = accuracy.from_differences(own[["d_east_m", "d_north_m", "d_height_m"]].to_numpy())
        row: dict[str, float | bool] = {"plan": float(np.hypot(*said.rms[:2]))}
        row["height"] = said.rms[2]
        for scale in SCALES:
            reached = standards.pec_pcd(said, scale)
            row |= {f"plan_{scale}": reached.plan == "A", f"height_{scale}": reached.height == "A"}
        rows.append(row)
    return pd.DataFrame(rows)


def _row(title: str, flights: Flights) -> dict[str, str]:
    row = {"Images and method": title, "Flights": f"{len(flights)}"}
    for part in ("plan", "height"):
        low, high = flights[part].quantile(list(SPREAD))
        row[f"RMS, {part} (m)"] = f"{flights[part].median():.2f} ({low:.2f} to {high:.2f})"
    for scale in SCALES:
        shares = (100 * flights[f"{part}_{scale}"].mean() for part in ("plan", "height"))
        plan, height = (f"{share:.0f}" for share in shares)
        row[f"Class A at 1:{scale}, plan and height (%)"] = f"{plan}, {height}"
    return row
