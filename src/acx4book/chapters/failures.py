"""Chapter 14, the failure clinic.

Common mistakes planted in a flight, and the signs of each.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from acx4book.notebooks import runner
from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS, scientific
from acx4book.typesetting.plain_text import Markup, shown
from acx4files import conventions
from acx4files.flight.reader import read
from acx4files.results import folder
from acx4lib.errors import Acx4Error
from acx4lib.expected import Array
from acx4sim import files
from acx4sim.designs import single_head
from acx4sim.earth import Grid
from acx4sim.files import SimulatedFlight
from acx4sim.plan import GrossErrors, Options

# --- One flight of an ordinary camera, and functions that plant mistakes in its tables


BLOCK = "calibration"
TRAJECTORY, CONTROL = f"{BLOCK}/trajectory.csv", "control_points.csv"


def flown(seed: int, *, gross_errors: bool = False) -> SimulatedFlight:
    """Return the flight without a systematic mistake.

    Parameters
    ----------
    seed : int
    gross_errors : bool
        Whether single observations are wrong.
    """
    wrong = GrossErrors() if gross_errors else None
    return single_head(seed=seed, options=Options(blocks=(BLOCK,), gross_errors=wrong))


def changed(
    flight: SimulatedFlight, tables: Mapping[str, Mapping[str, pd.Series]]
) -> SimulatedFlight:
    """Return a flight with other columns in some of its tables.

    Parameters
    ----------
    flight : SimulatedFlight
    tables : mapping of str to mapping of str to Series
        Columns by their names, by the file of the table.
    """
    changed_tables = {
        path: flight.tables[path].assign(**columns) for path, columns in tables.items()
    }
    return replace(flight, tables={**flight.tables, **changed_tables})


def convergence_deg(flight: SimulatedFlight) -> Array:
    """Return the convergence of the meridians at the exposures, degrees, shape (n,)."""
    table = flight.tables[TRAJECTORY]
    geodetic = np.column_stack([np.radians(table[["lat_deg", "lon_deg"]]), table["height_m"]])
    out: Array = np.degrees(Grid(crs=flight.plan.crs).convergence(geodetic))
    return out


def late(flight: SimulatedFlight, by_s: float) -> pd.DataFrame:
    """Return the positions that the aircraft has a little later, strip by strip.

    Returns
    -------
    DataFrame
        lat_deg, lon_deg, height_m.
    """
    table = flight.tables[TRAJECTORY]
    names = ["lat_deg", "lon_deg", "height_m"]
    rates = [
        strip[names].apply(lambda column, t=strip["time_s"]: np.gradient(column, t))
        for _, strip in table.groupby(table["exposure"].str.partition("-")[0], sort=False)
    ]
    return table[names] + by_s * pd.concat(rates)


def only(flight: SimulatedFlight, strips: Sequence[str]) -> SimulatedFlight:
    """Return a flight with only some of its strips."""
    images = flight.tables[f"{BLOCK}/images.csv"]
    images = images[images["strip"].isin(strips)]
    points = flight.tables[f"{BLOCK}/image_points.csv"]
    track = flight.tables[TRAJECTORY]
    kept = {
        f"{BLOCK}/images.csv": images,
        f"{BLOCK}/image_points.csv": points[points["image"].isin(images["image"])],
        TRAJECTORY: track[track["exposure"].isin(images["exposure"])],
    }
    return replace(flight, tables={**flight.tables, **kept})


# --- A flight with a planted mistake, run as a user would: messages and residuals


METHOD, TABLES = "single_step", ("residuals", "rejected")
"""Method and tables whose rows are kept."""

COUNTED = ("tie points", "control points are not measured", "image points rejected")
"""Words of sentences that count observations and name no mistake."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Examined:
    """The effects of a mistake on a flight and its calibration.

    Attributes
    ----------
    check, run : tuple of str
        Messages of `acx4 check` and `acx4 run` on the flight; empty where nothing is odd.
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
        """Whether a message of a command names a mistake, beside counts of observations."""
        lines = (*self.check, *self.run)
        return any(not any(words in line for words in COUNTED) for line in lines)

    def __repr__(self) -> str:
        """Count the messages of the commands."""
        return f"Examined: check says {len(self.check)} lines, run {len(self.run)}"

    def _repr_markdown_(self) -> str:
        """Show the messages of the two commands on the flight, word for word."""
        commands = (("check", self.check), ("run", self.run))
        return "\n\n".join(f"`acx4 {name}` says:\n\n{_quoted(lines)}" for name, lines in commands)


def _quoted(lines: Sequence[str]) -> str:
    return "\n>\n".join(f"> {shown(line)}" for line in lines) or "> (nothing odd)"


def examine(flight: SimulatedFlight) -> Examined:
    """Write a flight into an empty folder, check it, and run its calibration."""
    with tempfile.TemporaryDirectory() as temporary:
        written, results = Path(temporary) / "flight", Path(temporary) / "results"
        files.write(flight, written)
        check = _checked(written)
        try:
            outcome = runner.run(written, results, stages=("mounting",))
            run = outcome.not_determined + outcome.notes
            stored = folder.read(results)
            residuals, rejected = (_of_method(results / f"{n}.csv") for n in TABLES)
        except Acx4Error as error:
            lines = (*getattr(error, "__notes__", ()), *str(error).splitlines())
            run, stored, residuals, rejected = lines, None, pd.DataFrame(), pd.DataFrame()
    return Examined(
        check=_plain(check, temporary),
        run=_plain(run, temporary),
        residuals=residuals,
        parameters=pd.DataFrame() if stored is None else _with_truth(stored, flight),
        rejected=rejected,
        planted=flight.truth.get("gross_errors", []),
        places_km=_places(flight),
    )


def _of_method(path: Path) -> pd.DataFrame:
    table = pd.read_csv(path)
    return table[table["method"] == METHOD]


def _checked(path: Path) -> tuple[str, ...]:
    """Return the notes of the command check, or its reasons to refuse the flight, line by line."""
    try:
        flight = read(path)
        return (*flight.notes, *conventions.notes(flight))
    except Acx4Error as error:
        return tuple(str(error).splitlines())


def _plain(lines: tuple[str, ...], temporary: str) -> tuple[str, ...]:
    """Return lines with paths as they are in the flight's folder."""
    return tuple(line.replace(f"{temporary}/flight/", "") for line in lines)


def _with_truth(stored: folder.Results, flight: SimulatedFlight) -> pd.DataFrame:
    (camera,) = flight.plan.blocks[BLOCK].cameras
    estimates = folder.parameters(stored, f"mounting/{METHOD}", camera)
    true = flight.truth["cameras"][camera]
    return estimates.assign(true=[true[name] for name in estimates.index])


def _places(flight: SimulatedFlight) -> pd.DataFrame:
    """Return the places of the exposures, less their mean."""
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


def _of_group(examined: Examined, name: str) -> pd.DataFrame:
    """Return the residuals of one of `GROUPS`; no rows where there is no adjustment."""
    if not len(examined.residuals):
        return pd.DataFrame(columns=["image_or_exposure", "component", "v", "w"])
    kind, components = GROUPS[name]
    residuals = examined.residuals
    return residuals[(residuals["kind"] == kind) & residuals["component"].isin(components)]


def standardised(found: Examined) -> pd.Series:
    """Return the RMS of the standardised residuals of every group; one where all is right.

    Returns
    -------
    Series
        By the names of `GROUPS`; NaN where there is no adjustment.
    """
    squares = {name: np.mean(np.square(_of_group(found, name)["w"])) for name in GROUPS}
    return pd.Series(squares, dtype=float) ** 0.5


def worst(found: Examined) -> pd.Series | None:
    """Return the parameter with the largest error over sigma; None without an adjustment.

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


# --- Figures of the failure clinic: one panel for each mistake, all in the same scale and layout


COLUMNS = 3
SEEN, LARGEST = 2.0, 3000.0
"""RMS of standardised residuals from which a group is marked; end of the axis."""

ARROW_KM = 0.3
"""Length in the map of the longest arrow of a panel."""

REFUSED = "refused when it is read:\nno adjustment"

Draw = Callable[[Axes, Examined], object]


def fingerprints(found: Mapping[str, Examined]) -> Figure:
    """Draw the standardised residuals of every group of observations, mistake by mistake."""
    with style.applied():
        fig, axes = _panels(found, _draw_fingerprint, height=1.75, sharex=True, sharey=True)
        first = axes[0, 0]
        first.set(xscale="log", xlim=(0.3, LARGEST))
        first.set_yticks(range(len(GROUPS)), [*GROUPS])
        first.invert_yaxis()
        for ax in axes[-1]:
            ax.set_xlabel("RMS of $w$ (1)")
    return fig


def _draw_fingerprint(ax: Axes, examined: Examined) -> None:
    rms = standardised(examined)
    colours = [style.BRICK if value > SEEN else style.BLUE for value in rms]
    ax.barh(np.arange(len(rms)), rms - 0.3, left=0.3, color=colours, height=0.68)
    ax.axvline(1.0, color=style.INK, lw=0.8)
    ax.grid(axis="y", visible=False)


def maps(found: Mapping[str, Examined]) -> Figure:
    """Draw residuals in plan: of positions as arrows, of attitudes as colours."""
    with style.applied():
        fig, axes = _panels(found, _draw_map, height=2.2)
        reach = 1.35 * max(
            float(examined.places_km.abs().to_numpy().max()) for examined in found.values()
        )
        for ax in axes.flat:
            ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=[], yticks=[])
        marks = axes[0, 0].collections[0]
        label = "residual of the attitude, RMS of $w$ (1)"
        fig.colorbar(
            marks, ax=axes, location="bottom", shrink=0.5, aspect=40, pad=0.02, label=label
        )
    return fig


def _draw_map(ax: Axes, examined: Examined) -> None:
    names = examined.places_km.index
    places = examined.places_km.to_numpy()
    turned = np.sqrt(
        _by_exposure(examined, "roll, pitch", names) ** 2
        + _by_exposure(examined, "heading", names) ** 2
    )
    east, north = places.T
    ax.scatter(
        east,
        north,
        c=turned,
        s=16,
        cmap=style.SHADES,
        norm=LogNorm(0.5, 500.0),
        zorder=3,
        edgecolor=style.SOFT,
        lw=0.4,
    )
    v = _of_group(examined, "GNSS, plan").pivot_table(
        index="image_or_exposure", columns="component", values="v"
    )
    moved = v.reindex(names)[["east_m", "north_m"]].to_numpy()
    longest = float(np.nanmax(np.hypot(*moved.T)))
    arrows: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "width": 0.008, "zorder": 4}
    ax.quiver(*places.T, *moved.T, scale=longest / ARROW_KM, color=style.ORANGE, **arrows)
    ax.annotate(
        f"longest arrow {_length(longest)}", (0.02, 0.03), xycoords="axes fraction", fontsize=7.5
    )


def _by_exposure(examined: Examined, group: str, names: pd.Index) -> np.ndarray:
    """Return the RMS of the standardised residuals of a group, by exposure."""
    residuals = _of_group(examined, group)
    mean = (
        residuals.assign(square=residuals["w"] ** 2).groupby("image_or_exposure")["square"].mean()
    )
    out: np.ndarray = np.sqrt(mean.reindex(names).to_numpy())
    return out


def _length(metres: float) -> str:
    return f"{metres:.1f} m" if metres >= 1 else f"{100 * metres:.0f} cm"


def _panels(
    flights: Mapping[str, Examined], draw: Draw, *, height: float, **shared: bool
) -> tuple[Figure, Any]:
    """Return a figure with a panel for every mistake; a refused flight has a note in its panel."""
    n_rows = -(-len(flights) // COLUMNS)
    fig, axes = style.subplots(
        n_rows, COLUMNS, figsize=(style.WIDTH, height * n_rows + 0.5), squeeze=False, **shared
    )
    for ax in axes.flat[len(flights) :]:
        ax.axis("off")
    for ax, (name, examined) in zip(axes.flat, flights.items(), strict=False):
        ax.set_title(name)
        if len(examined.residuals):
            draw(ax, examined)
        else:
            ax.text(
                *(0.5, 0.5, REFUSED), ha="center", va="center", color=style.SOFT,
                transform=ax.transAxes,
            )  # fmt: skip
    return fig, axes


# --- The table of the failure clinic: residuals and parameters for every mistake


def table(found: Mapping[str, Examined]) -> pd.DataFrame:
    """Return the effect of every mistake on residuals and parameters, as text."""
    return pd.DataFrame([{"Mistake": name, **_cells(examined)} for name, examined in found.items()])


def _cells(examined: Examined) -> dict[str, str]:
    off = worst(examined)
    if off is None:
        return {
            "Largest residuals": "refused when it is read",
            "Rejected": "",
            "Parameter that is most wrong": "",
            "wrong by": "",
            "in its own σ": "",
        }
    rms = standardised(examined)
    return {
        "Largest residuals": f"{rms.idxmax()}, {rms.max():.3g} σ",
        "Rejected": f"{len(examined.rejected)}",
        "Parameter that is most wrong": Markup(LABELS[str(off.name)]),
        "wrong by": _with_unit(float(off["error"]), str(off["unit"])),
        "in its own σ": f"{off['off']:.3g}",
    }


def _with_unit(value: float, unit: str) -> Markup:
    if unit == "deg":
        return Markup(f"{value:+.3g}°")
    number = scientific(value, digits=1) if abs(value) < 1e-3 else f"{value:+.3g}"
    return Markup(f"{number} {unit}")
