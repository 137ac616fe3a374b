"""Chapter 16, the error budget.

The sources of the error of a map, for a run and from the paper's numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.myst import TITLES, inside
from acx4lib.bundle.unknowns import Layout, layout
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.parameters import AXES, MOUNT, REPORTED
from acx4lib.georeferencing import budget, direct, validation
from acx4lib.georeferencing.budget import Budget
from acx4lib.georeferencing.error_sources import ErrorSources
from acx4lib.georeferencing.validation import Differences, Validation

# --- Figures of the error budget: shares, flying heights, and the format


STACKED = {
    "image points": ("image points",),
    "survey": ("survey",),
    "GNSS": ("GNSS",),
    "roll": ("roll",),
    "pitch": ("pitch",),
    "heading": ("heading",),
    "calibration": budget.CALIBRATION,
}
"""Sources by the name of their part of a bar; the parts of the calibration are one."""

COLOURS = (style.BLUE, style.INK, style.TEAL, style.ORANGE, style.BRICK, style.SKY, style.PLUM)


def stacked(budgets: Mapping[str, Budget]) -> Figure:
    """Draw the shares of all sources, a bar for every method and coordinate.

    Parameters
    ----------
    budgets : mapping of str to Budget
        By method.
    """
    methods = [*budgets]
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.5), sharey=True)
        means = [split.mean for split in budgets.values()]
        for axis, ax in enumerate(axes):
            start = np.zeros(len(methods))
            for (name, sources), colour in zip(STACKED.items(), COLOURS, strict=True):
                share = np.array([percent(mean[axis], *sources) for mean in means])
                ax.barh(np.arange(len(methods)), share, 0.62, start, color=colour, label=name)
                start = start + share
            ax.set_title(AXES[axis])
            ax.set(xlim=(0, 100), xlabel="share of the variance (%)")
            ax.grid(axis="y", visible=False)
        axes[0].set_yticks(range(len(methods)), [TITLES[m].replace(", ", ",\n") for m in methods])
        axes[0].invert_yaxis()
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0], ncols=7)
    return fig


def calibration(budgets: Mapping[str, Budget]) -> Figure:
    """Draw the parts of the calibration, groups and correlations, which may be negative.

    Parameters
    ----------
    budgets : mapping of str to Budget
        Of two methods.
    """
    names = [*budget.CALIBRATION, "together"]
    rows = np.arange(len(names))
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 2.9), sharey=True)
        for k, (ax, title) in enumerate(zip(axes, COORDINATES, strict=True)):
            for i, (method, split) in enumerate(budgets.items()):
                part = plan_and_height(split.mean)[k]
                share = [percent(part, name) for name in names[:-1]]
                share.append(percent(part, *budget.CALIBRATION))
                label = TITLES[method]
                ax.barh(rows + 0.4 * i - 0.2, share, 0.36, color=style.colour(i), label=label)
            ax.axvline(0, color=style.INK, lw=0.8)
            ax.set_title(title)
            ax.set_xlabel("share of the variance (%)")
            ax.grid(axis="y", visible=False)
        axes[0].set_yticks(rows, names)
        axes[0].invert_yaxis()
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig


def over_heights(
    heights_m: Array, budgets: Mapping[str, Sequence[Budget]], *, method: str
) -> Figure:
    """Draw the standard deviations of the groups of sources over the flying height.

    Parameters
    ----------
    heights_m : ndarray, shape (n,)
    budgets : mapping of str to sequence of Budget
        By method, one for each height. Of the others, the part of the calibration is drawn.
    method : str
        Of which all is drawn.
    """
    by_method = {
        name: np.array([plan_and_height(split.mean) for split in each])
        for name, each in budgets.items()
    }
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.0))
        for k, (ax, title) in enumerate(zip(axes, COORDINATES, strict=True)):
            _draw_heights(ax, heights_m, by_method[method][:, k])
            for dashed in by_method.keys() - {method}:
                part = by_method[dashed][:, k, -len(budget.CALIBRATION) :].sum(axis=-1)
                ax.plot(
                    *(heights_m, np.sqrt(np.maximum(part, 0.0)), "--"),
                    color=style.colour(2),
                    label=f"calibration, {inside(TITLES[dashed])}",
                )
            ax.set_title(title)
            ax.set(xlabel="flying height over ground (m)", ylim=(0, None))
        axes[0].set_ylabel("σ of a ground point (m)")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0], ncols=3)
    return fig


def _draw_heights(ax: Axes, heights_m: Array, variances: Array) -> None:
    ax.plot(heights_m, np.sqrt(variances.sum(axis=-1)), color=style.INK, label="all together")
    for i, (name, sources) in enumerate(budget.GROUPS.items()):
        columns = [budget.SOURCES.index(source) for source in sources]
        ax.plot(
            *(heights_m, np.sqrt(variances[:, columns].sum(axis=-1))),
            color=style.colour(i),
            label=name,
        )


# --- Tables of the error budget


COORDINATES = ("plan", "height")


def plan_and_height(variance: Array) -> Array:
    """Return variances in plan, east and north together, and in height.

    Parameters
    ----------
    variance : ndarray, shape (3, n_sources)

    Returns
    -------
    ndarray, shape (2, n_sources)
    """
    return np.stack([variance[0] + variance[1], variance[2]])


def percent(variance: Array, *sources: str) -> float:
    """Return the share of some sources in a variance, %.

    Parameters
    ----------
    variance : ndarray, shape (n_sources,)
    *sources : str
        Names of `budget.SOURCES`.
    """
    columns = [budget.SOURCES.index(source) for source in sources]
    return float(100 * variance[columns].sum() / variance.sum())


def groups(
    validations: Mapping[str, Validation],
    points: Mapping[str, Budget],
    pairs: Mapping[str, Budget],
) -> pd.DataFrame:
    """Return the predicted RMS at the check points, whether it holds, and the shares of groups.

    Parameters
    ----------
    validations : mapping of str to Validation
        By method.
    points, pairs : mapping of str to Budget
        Of their points, each from all its rays, and of their pairs.
    """
    rows = {}
    for method, checks in validations.items():
        for rays, split, differences in (
            ("all", points[method], checks.points),
            ("pairs", pairs[method], checks.pairs),
        ):
            for name, row in _by_coordinate(split, differences).items():
                rows[TITLES[method], rays, name] = row
    table = pd.DataFrame(rows.values())
    table.index = pd.MultiIndex.from_tuples(rows, names=["method", "rays", "coordinate"])
    sizes = {"RMS predicted (m)": ".2f", "RMS of d / σ": ".3f"}
    table.attrs["formats"] = sizes | dict.fromkeys(table.columns[2:], ".1f")
    return table


def _by_coordinate(split: Budget, differences: Differences) -> dict[str, dict[str, float]]:
    square = np.mean((differences.d / differences.sigma) ** 2, axis=0)
    normalised = np.sqrt([square[:2].mean(), square[2]])
    return {
        name: {
            "RMS predicted (m)": float(np.sqrt(part.sum())),
            "RMS of d / σ": float(normalised[k]),
            **{f"{group} (%)": 100 * float(v) for group, v in budget.shares(part).items()},
        }
        for k, (name, part) in enumerate(zip(COORDINATES, plan_and_height(split.mean), strict=True))
    }


def printed_flight(cases: Sequence[Assumed], budgets: Sequence[Budget]) -> pd.DataFrame:
    """Return the RMS predicted from the paper's accuracies, and the unexplained rest of its RMS.

    Parameters
    ----------
    cases : sequence of Assumed
    budgets : sequence of Budget
        Of pairs of rays, one for each case.
    """
    rms_, rows = rms(), []
    for assumed, split in zip(cases, budgets, strict=True):
        unexplained_rms = unexplained(rms_, split.rms)
        row = {"image σ (px)": assumed.sigma_px, "GNSS σ (m)": assumed.sigma_gnss_m}
        for axis, predicted, rest in zip(AXES, split.rms, unexplained_rms, strict=True):
            row[f"{axis}: predicted (m)"] = predicted
            row[f"{axis}: left (m)"] = rest if rest > 0 else np.nan
        rows.append(row)
    table = pd.DataFrame(rows)
    table.attrs["formats"] = dict.fromkeys(table, ".2f") | {"image σ (px)": ".1f"}
    return table


def suspects(found: Sequence[Suspect]) -> pd.DataFrame:
    """Return the single errors that each explain the rest in plan, with their effect on heights."""
    rows = {suspect.name: dict(zip(AXES, suspect.rms, strict=True)) for suspect in found}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("error")
    table.insert(0, "size needed", [suspect.needed for suspect in found])
    table.columns = ["size needed", *(f"{axis} (m)" for axis in AXES)]
    table.attrs["formats"] = dict.fromkeys(table.columns[1:], ".2f")
    return table


# --- The budget of the paper's own flight, from the accuracies that the paper states
#
# The rays are those of the simulated flight, whose independent block has the paper's height,
# overlaps, number of targets and, nearly, number of pairs. Every standard deviation is the
# paper's.


PAPERS = "single_step"
"""Method whose printed numbers are used."""

NOT_PRINTED = ("b1", "b2")
"""Parameters that the paper does not have."""

SHARED = {
    "lever arm, forward": ("lever_x", "m", 1.0),
    "lever arm, left": ("lever_y", "m", 1.0),
    "boresight ω": ("boresight_x", "°", float(np.degrees(1.0))),
    "boresight φ": ("boresight_y", "°", float(np.degrees(1.0))),
    "boresight κ": ("boresight_z", "°", float(np.degrees(1.0))),
}
"""Errors that all images share: the unknown, and the unit of a table with what one of the library's
units is in it."""


@dataclass(frozen=True, kw_only=True)
class Assumed:
    """Assumptions on the paper's flight where the paper gives a range, or nothing.

    Attributes
    ----------
    sigma_px : float
        Of a natural target in an image.
    sigma_gnss_m : float
        Of a position, each coordinate.
    """

    sigma_px: float
    sigma_gnss_m: float


def assumptions() -> tuple[Assumed, ...]:
    """Return the cases: the paper's best, poorer targets, and poorer positions as well."""
    best, worst = (printed.statement(f"gnss_{name}_m") for name in ("best", "worst"))
    half = printed.statement("synthetic_quality_px")
    return (
        Assumed(sigma_px=half, sigma_gnss_m=best),
        Assumed(sigma_px=3 * half, sigma_gnss_m=best),
        Assumed(sigma_px=3 * half, sigma_gnss_m=worst),
    )


def rms() -> Array:
    """Return the RMS that the paper prints for the single-step method, shape (3,), m."""
    return np.array([printed.value(4, f"rms_{axis}_m", PAPERS) for axis in AXES])


def sources(
    found: Validation, calibration: Calibration, assumed: Assumed
) -> tuple[ErrorSources, Layout]:
    """Return the sources of the errors of pairs of rays with the standard deviations of the paper.

    Parameters
    ----------
    found : Validation
        Its rays and pairs are used.
    calibration : Calibration
        With the standard deviations of Table 3, as `as_calibrated` returns it.
    assumed : Assumed

    Returns
    -------
    sources : ErrorSources
    layout : Layout
        Columns of the calibration, as `budget.of` takes both.
    """
    n, pairs = len(found.block.trajectory), found.pairs
    angle = np.radians(
        [printed.statement(f"{name}_deg") for name in ("roll_pitch", "roll_pitch", "heading")]
    )
    trajectory = replace(
        found.block.trajectory,
        sigma_position=np.full((n, 3), assumed.sigma_gnss_m),
        sigma_attitude=np.tile(angle, (n, 1)),
    )
    plan, height = (printed.statement(f"check_{name}_m") for name in ("horizontal", "vertical"))
    survey = np.tile([plan, plan, height], (len(found.block.check), 1))
    block = replace(
        found.block, trajectory=trajectory, check=replace(found.block.check, sigma_m=survey)
    )
    georeferenced = direct.georeference(block, calibration)
    rays = validation.rays_of_pairs(block, pairs)
    rays = replace(rays, sigma_px=np.full(len(rays.group), assumed.sigma_px))
    differences = validation.differences_at(block, georeferenced, rays, pairs.point_idx)
    return differences.sources, georeferenced.layout


def as_calibrated(calibration: Calibration) -> Calibration:
    """Return a calibration with the standard deviations of Table 3 and no correlations.

    The paper prints no correlations.
    """
    sigma = {
        key: printed.sigma(3, REPORTED[key][0], PAPERS)
        for key in (*INTERIOR, *MOUNT)
        if key not in NOT_PRINTED
    }
    sigma |= {key: np.radians(value) for key, value in sigma.items() if key in MOUNT[3:]}
    free = tuple(key for key in INTERIOR if key in sigma)
    return Calibration(
        cameras=calibration.cameras,
        layout=layout(1, 0, free=free, free_mount=MOUNT),
        cov=np.diag([sigma[key] ** 2 for key in (*free, *MOUNT)]),
        sigma0_sq=1.0,
        open_columns=np.zeros(len(sigma), dtype=bool),
    )


def unexplained(found_rms: Array, predicted_rms: Array) -> Array:
    """Return the unexplained part of an RMS, shape (3,), m; zero where the prediction is larger."""
    unexplained_rms: Array = np.sqrt(np.maximum(found_rms**2 - predicted_rms**2, 0.0))
    return unexplained_rms


# --- which error leaves heights alone ----------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Suspect:
    """A single error that explains the rest of the printed RMS in plan.

    Attributes
    ----------
    name, unit : str
    size : float
        How large it has to be, in the unit; of random errors their standard deviation.
    rms : ndarray, shape (3,)
        Its RMS in the pairs' differences: east, north, height, m.
    """

    name: str
    unit: str
    size: float
    rms: Array

    @property
    def needed(self) -> str:
        """The size with its unit, two digits."""
        gap = "" if self.unit == "°" else " "
        return f"{self.size:#.2g}{gap}{self.unit}"


def printed_suspects(sources: ErrorSources, columns: Layout, assumed: Assumed) -> list[Suspect]:
    """Return each error that alone explains the rest of the RMS in plan, with its RMS of the pairs.

    Every error is scaled until its RMS in plan is the part of the printed one left unexplained.

    Parameters
    ----------
    sources, columns
        As `sources` returns them.
    assumed : Assumed
        Assumed accuracies of these sources.
    """
    split = budget.of(sources, columns).mean
    unexplained_rms = unexplained(rms(), np.sqrt(split.sum(axis=-1)))
    size = float(np.sum(unexplained_rms[:2] ** 2))
    degrees = {name: printed.statement(f"{name}_deg") for name in ("roll_pitch", "heading")}
    sigma_of_source = {
        "image points": (assumed.sigma_px, "px"),
        "GNSS": (assumed.sigma_gnss_m, "m"),
        "roll": (degrees["roll_pitch"], "°"),
        "pitch": (degrees["roll_pitch"], "°"),
        "heading": (degrees["heading"], "°"),
    }
    squares = [
        (name, unit, unity, split[:, budget.SOURCES.index(name)])
        for name, (unity, unit) in sigma_of_source.items()
    ]
    by_column = np.mean(sources.by_parameters**2, axis=0)
    squares += [
        (name, unit, unity, by_column[:, columns.mount[0][MOUNT.index(key)]])
        for name, (key, unit, unity) in SHARED.items()
    ]
    squares.append(("the targets themselves, in plan", "m", 1.0, np.array([0.5, 0.5, 0.0])))
    errors = []
    for name, unit, unity, square in squares:
        factor = np.sqrt(size / square[:2].sum())
        errors.append(
            Suspect(name=name, unit=unit, size=factor * unity, rms=factor * np.sqrt(square))
        )
    return errors
