"""How long many flights take on one process, on two and on a cluster, as a page of the book.

The numbers are those of ``make bench``, which leaves them in ``data/benchmarks``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from acx4book.pages.benchmarks import stored
from acx4book.typesetting.myst import at_commit, myst_table
from acx4book.typesetting.plain_text import Markup

FIRST = "one process"
"""The way with which the others are compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Many:
    """Measured runs of many flights.

    Attributes
    ----------
    runs : DataFrame
        ``many.csv``: a row for each way.
    about : dict
        ``many.json``: date, machine, versions, design.
    """

    runs: pd.DataFrame
    about: Mapping[str, Any]


def read(folder: Path) -> Many:
    """Read what ``make bench`` left in a folder."""
    about, (runs,) = stored.read(folder, "many")
    return Many(runs=runs, about=about)


def page(many: Many) -> str:
    """Return times, speed-up and memory as MyST text."""
    about, runs = many.about, many.runs
    alone = float(runs.loc[runs["way"] == FIRST, "wall_s"].iloc[0])
    table = pd.DataFrame(
        {
            "Way": runs["way"],
            "At a time": runs["workers"],
            "Flights": runs["flights"],
            "Seconds": runs["wall_s"],
            "Speed-up": alone / runs["wall_s"],
            "CPU seconds a flight": runs["cpu_s"] / runs["flights"],
            "MB of a worker": runs["worker_mb"],
        }
    )
    formats = {"Seconds": ".0f", "Speed-up": ".2f", "CPU seconds a flight": ".2f"}
    caption = Markup(
        f"Seeds of the design {about['design']}, simulated and run: time that passes, the time "
        f"of {FIRST} over it, processor time, and the largest memory of a worker"
    )
    machine = (
        f"Measured on {about['date']} at {at_commit(about['commit'])}: {about['processor']}, "
        f"{about['cores']} cores, {about['memory_gb']:g} GB of memory. The workers of the cluster "
        "are on the same computer, as is the scheduler. All ways left the same bytes."
    )
    shown = myst_table(
        table, caption, name="tab-many-speed", formats={**formats, "MB of a worker": ".0f"}
    )
    return f"{machine}\n\n{shown}\n"
