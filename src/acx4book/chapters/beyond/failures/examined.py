"""A flight with a planted mistake, run as a user would: what the commands say, what is left."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.failures.mistakes import BLOCK, TRAJECTORY
from acx4book.notebooks import functions, runner
from acx4book.typesetting.plain_text import shown
from acx4lib.conventions import search
from acx4lib.errors import Acx4Error
from acx4lib.flight.reader import read
from acx4lib.results import folder
from acx4sim.earth import Grid
from acx4sim.files import writer
from acx4sim.files.flights import SimulatedFlight

METHOD, TABLES = "single_step", ("residuals", "rejected")
"""Which rows of which tables are kept."""

COUNTED = ("tie points", "control points are not measured", "image points rejected")
"""Words of sentences that count observations and name no mistake."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Examined:
    """What a mistake leaves.

    Attributes
    ----------
    check, run : tuple of str
        What `acx4 check` and `acx4 run` say of the flight; empty where they find nothing odd.
    residuals : DataFrame
        residuals.csv of the single step; empty where it gave no result.
    parameters : DataFrame
        Its rows of parameters.csv with the column ``true``; empty likewise.
    rejected : DataFrame
        rejected.csv of the single step; empty likewise.
    planted : list of dict
        Gross errors of the simulation, with the columns of rejected.csv.
    places_km : DataFrame
        Grid east and north of the exposures, by name.
    """

    check: tuple[str, ...]
    run: tuple[str, ...]
    residuals: pd.DataFrame
    parameters: pd.DataFrame
    rejected: pd.DataFrame
    planted: list[dict[str, Any]]
    places_km: pd.DataFrame

    @property
    def named(self) -> bool:
        """Whether a command says more than numbers of observations: what is wrong."""
        lines = (*self.check, *self.run)
        return any(not any(words in line for words in COUNTED) for line in lines)

    def __repr__(self) -> str:
        """Count what the commands say."""
        return f"Examined: check says {len(self.check)} lines, run {len(self.run)}"

    def _repr_markdown_(self) -> str:
        """Show what the two commands say of the flight, word for word."""
        both = (("check", self.check), ("run", self.run))
        return "\n\n".join(f"`acx4 {name}` says:\n\n{_quoted(lines)}" for name, lines in both)


def _quoted(lines: Sequence[str]) -> str:
    return "\n>\n".join(f"> {shown(line)}" for line in lines) or "> (nothing odd)"


def examine(flight: SimulatedFlight) -> Examined:
    """Write a flight into an empty folder, check it, and run its calibration.

    Parameters
    ----------
    flight : SimulatedFlight
    """
    with tempfile.TemporaryDirectory() as temporary:
        written, results = Path(temporary) / "flight", Path(temporary) / "results"
        writer.write(flight, written)
        check = _checked(written)
        try:
            outcome = runner.run(written, results, way=functions.Functions(), stages=("mounting",))
            run = outcome.not_determined + outcome.notes
            found = folder.read(results)
            residuals, rejected = (_of_method(results / f"{n}.csv") for n in TABLES)
        except Acx4Error as error:
            said = (*getattr(error, "__notes__", ()), *str(error).splitlines())
            run, found, residuals, rejected = said, None, pd.DataFrame(), pd.DataFrame()
    return Examined(
        check=_plain(check, temporary),
        run=_plain(run, temporary),
        residuals=residuals,
        parameters=pd.DataFrame() if found is None else _with_truth(found, flight),
        rejected=rejected,
        planted=flight.truth.get("gross_errors", []),
        places_km=_places(flight),
    )


def _of_method(path: Path) -> pd.DataFrame:
    table = pd.read_csv(path)
    return table[table["method"] == METHOD]


def _checked(path: Path) -> tuple[str, ...]:
    """Return what the command check adds to its summary, or why it refuses the flight."""
    try:
        flight = read(path)
        return (*flight.notes, *search.notes(flight))
    except Acx4Error as error:
        return tuple(str(error).splitlines())


def _plain(lines: tuple[str, ...], temporary: str) -> tuple[str, ...]:
    """Return lines with paths as they are in the flight's folder."""
    return tuple(line.replace(f"{temporary}/flight/", "") for line in lines)


def _with_truth(found: folder.Results, flight: SimulatedFlight) -> pd.DataFrame:
    (camera,) = flight.plan.blocks[BLOCK].cameras
    own = folder.parameters(found, f"mounting/{METHOD}", camera)
    true = flight.truth["cameras"][camera]
    return own.assign(true=[true[name] for name in own.index])


def _places(flight: SimulatedFlight) -> pd.DataFrame:
    """Return where the exposures are, less their mean."""
    table = flight.tables[TRAJECTORY]
    geodetic = np.column_stack([np.radians(table[["lat_deg", "lon_deg"]]), table["height_m"]])
    grid = Grid(crs=flight.plan.crs).grid_from_geodetic(geodetic)[:, :2] / 1000
    return pd.DataFrame(
        grid - grid.mean(axis=0), index=table["exposure"], columns=["east", "north"]
    )


# --- numbers ---------------------------------------------------------------------------------

GROUPS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "image points": ("image_point", ("col_px", "row_px")),
    "control, plan": ("control_point", ("east_m", "north_m")),
    "control, height": ("control_point", ("height_m",)),
    "GNSS, plan": ("gnss", ("east_m", "north_m")),
    "GNSS, height": ("gnss", ("height_m",)),
    "roll, pitch": ("attitude", ("roll_deg", "pitch_deg")),
    "heading": ("attitude", ("heading_deg",)),
}
"""Kinds and components of residuals.csv by the name of their group."""


def of_group(found: Examined, name: str) -> pd.DataFrame:
    """Return the residuals of one of `GROUPS`; no rows where there is no adjustment."""
    if not len(found.residuals):
        return pd.DataFrame(columns=["image_or_exposure", "component", "v", "w"])
    kind, components = GROUPS[name]
    own = found.residuals
    return own[(own["kind"] == kind) & own["component"].isin(components)]


def standardised(found: Examined) -> pd.Series:
    """Return the RMS of the standardised residuals of every group; one where all is right.

    Parameters
    ----------
    found : Examined

    Returns
    -------
    Series
        By the names of `GROUPS`; NaN where there is no adjustment.
    """
    squares = {name: np.mean(np.square(of_group(found, name)["w"])) for name in GROUPS}
    return pd.Series(squares, dtype=float) ** 0.5


def worst(found: Examined) -> pd.Series | None:
    """Return the parameter that is off by most of its sigma; None without an adjustment.

    Returns
    -------
    Series or None
        A row of `Examined.parameters` with its error and ``off``, the error over sigma.
    """
    if not len(found.parameters):
        return None
    error = found.parameters["value"] - found.parameters["true"]
    off = error.abs() / found.parameters["sigma"]
    return found.parameters.assign(error=error, off=off).sort_values("off").iloc[-1]
