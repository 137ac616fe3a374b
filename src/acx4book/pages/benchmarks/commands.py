"""What a user waits for: whole commands, from start to end, as the speed page opens.

The numbers are those of ``make bench``, which leaves them in ``data/benchmarks``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.pages.benchmarks import stored
from acx4book.typesetting.myst import at_commit, myst_table
from acx4book.typesetting.plain_text import Markup

IMPORTS = "imports"
"""What stands for a command where the packages are only imported."""

GROWTH = "run --numbers-only"
"""The command of which it is said how it grows with the number of images."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Commands:
    """Measured commands.

    Attributes
    ----------
    runs : DataFrame
        ``commands.csv``: a row for each run of a command on a flight.
    about : dict
        ``commands.json``: date, machine, versions.
    """

    runs: pd.DataFrame
    about: Mapping[str, Any]

    @property
    def medians(self) -> pd.DataFrame:
        """Medians of all runs, a row for each flight and command, in the file's order."""
        groups = self.runs.groupby(["flight", "command"], sort=False)
        sizes = dict.fromkeys(("images", "measurements"), "first")
        return groups.agg({**sizes, **dict.fromkeys(("wall_s", "cpu_s", "tree_mb"), "median")})


def read(folder: Path) -> Commands:
    """Read what ``make bench`` left in a folder."""
    about, (runs,) = stored.read(folder, "commands")
    return Commands(runs=runs, about=about)


def page(commands: Commands) -> str:
    """Return the measured seconds and megabytes as MyST text."""
    about = commands.about
    machine = (
        f"Measured on {about['date']} at {at_commit(about['commit'])}: {about['processor']}, "
        f"{about['cores']} cores, {about['memory_gb']:g} GB of memory."
    )
    sizes = commands.medians.groupby("flight", sort=False)["measurements"].first().astype(int)
    measured = ", ".join(f"{n:,} in {flight}" for flight, n in sizes.items())
    parts = (machine, _table(commands), f"Image points: {measured}.", _growth(commands))
    return "\n\n".join(part for part in parts if part) + "\n"


def _table(commands: Commands) -> str:
    """Return a row for each command; CPU beyond the imports that every run needs."""
    medians = commands.medians.reset_index()
    alone = medians[medians["command"] == IMPORTS].set_index("flight")["cpu_s"]
    own = medians[medians["command"] != IMPORTS]
    beyond = own["cpu_s"] - own["flight"].map(alone)
    table = pd.DataFrame(
        {
            "Flight": own["flight"].to_numpy(),
            "Command": [Markup(f"`acx4 {name}`") for name in own["command"]],
            "Images": own["images"].astype(int).to_numpy(),
            "Seconds": own["wall_s"].to_numpy(),
            "CPU seconds": own["cpu_s"].to_numpy(),
            "beyond imports": beyond.where(beyond > 0).to_numpy(),  # some import less than a run
            "MB": own["tree_mb"].to_numpy(),
        }
    )
    formats = {"Images": ",d", "MB": ",.0f"}
    formats |= dict.fromkeys(("Seconds", "CPU seconds", "beyond imports"), ".1f")
    caption = (
        "Whole commands: the time that passes, CPU time of all processes, the part of it beyond "
        f"{commands.about['imports']}, and the largest memory of all processes together"
    )
    return myst_table(table, caption, name="tab-speed-commands", formats=formats)


def _growth(commands: Commands) -> str:
    """Say how CPU time and memory grow from one to the other of the two largest flights."""
    medians = commands.medians
    own = medians[medians.index.get_level_values("command") == GROWTH]
    own = own.sort_values("measurements")
    if len(own) < 2:
        return ""
    smaller, larger = (own.iloc[i] for i in (-2, -1))
    times = {key: larger[key] / smaller[key] for key in ("images", "cpu_s", "tree_mb")}
    power = np.log(times["cpu_s"]) / np.log(times["images"])
    return (
        f"With {times['images']:.1f} times the images `acx4 {GROWTH}` takes {times['cpu_s']:.1f} "
        f"times the CPU time, the power {power:.2f} of their number, and "
        f"{times['tree_mb']:.1f} times the memory."
    )
