"""Chapter 4, direct georeferencing on an independent block (section 4.3, Table 4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy import special

from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.myst import TITLES, inside
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import Flight
from acx4files.results import folder
from acx4lib.design import ground_sample_m
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy, error_sources
from acx4lib.georeferencing.accuracy import Accuracy, AxisTest, NormalisedTest
from acx4lib.georeferencing.validation import Validation
from acx4lib.least_squares.covariance import sigmas
from acx4lib.shown import count

LEAST_FOR_NORMAL = 3
"""Smallest number of check points for a drawn distribution of their differences."""


def predicted(results_path: str | Path) -> str:
    """Return the fit of exposures that took no part in the calibrations, in a sentence.

    Parameters
    ----------
    results_path : path
        With the results of stage validation, of a block without check points.
    """
    entries = {
        name.partition("/")[2]: entry
        for name, entry in folder.entries(Path(results_path)).items()
        if name.startswith("validation/") and entry.get("rays_rms_px") is not None
    }
    sentences = [
        f"{TITLES[method]}: rays meet within {entry['rays_rms_px']:.2f} px, positions are off by "
        f"{', '.join(f'{v:.2f}' for v in np.array(entry['position_rms_m'], dtype=float))} m (east, "
        f"north, height; RMS), σ0² {entry['sigma0_squared']:.2f}"
        for method, entry in entries.items()
    ]
    start = "there are no check points, but exposures that took no part in the calibration"
    return f"{start}. {'; '.join(sentences)}" if sentences else "there are no check points"


# --- Figures of the validation: where the check points are off, and whether the sigma is honest


def difference_map(validation: Validation) -> Figure:
    """Draw the differences of all check points: arrows in plan, colours in height."""
    block, points = validation.block, validation.points
    enh = block.frame.to_grid(block.check.x_m[points.point_idx])
    cameras = block.frame.to_grid(block.T_m_b_images.r)
    km = 1e-3
    limit = max(float(np.abs(points.d[:, 2]).max(initial=0.0)), 1e-3)
    with style.applied():
        fig, ax = style.subplots(figsize=(5.6, 5.2))
        ax.plot(
            *(km * cameras[:, :2].T), ".", ms=1.6, color=style.SOFT, alpha=0.6, label="exposures"
        )
        east, north = km * enh[:, :2].T
        dots = ax.scatter(
            east,
            north,
            s=34,
            c=points.d[:, 2],
            cmap=style.BOTH_WAYS,
            vmin=-limit,
            vmax=limit,
            zorder=3,
            edgecolors=style.INK,
            linewidths=0.5,
        )
        arrows = ax.quiver(
            *(km * enh[:, :2].T),
            *points.d[:, :2].T,
            angles="xy",
            color=style.INK,
            width=0.0028,
            zorder=4,
        )
        longest = float(np.hypot(*points.d[:, :2].T).max(initial=0.01))
        text = f"{longest:.2f} m in plan"
        ax.quiverkey(arrows, 0.98, 0.04, longest, text, labelpos="W", coordinates="axes")
        ax.set_aspect("equal")
        ax.set(xlabel="grid east (km)", ylabel="grid north (km)")
        ax.ticklabel_format(useOffset=False)
        bar = fig.colorbar(dots, ax=ax, shrink=0.7, aspect=28)
        bar.set_label("difference in height (m)")
        bar.outline.set_visible(False)
        style.north_arrow(ax, at=(0.03, 0.98))
        style.scale_bar(ax, per_axis_unit=1.0, unit="km", at=(0.04, 0.03))
    return fig


def normalised_differences(validations: Mapping[str, Validation]) -> Figure:
    """Draw the points' differences over their predicted sigma against the normal distribution.

    Parameters
    ----------
    validations : mapping of str to Validation
        By their titles.

    Returns
    -------
    Figure
        A sentence where there are too few points for a distribution.
    """
    most = max((len(validation.points) for validation in validations.values()), default=0)
    if most < LEAST_FOR_NORMAL:
        return style.nothing(
            f"{count(most, 'check point').capitalize()} cannot show a distribution: it takes "
            f"{LEAST_FOR_NORMAL} or more."
        )
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.7), sharey=True)
        for i, (title, validation) in enumerate(validations.items()):
            z = np.sort(validation.points.d / validation.points.sigma, axis=0)
            expected = special.ndtri((np.arange(len(z)) + 0.5) / max(len(z), 1))
            for axis, ax in enumerate(axes):
                ax.plot(
                    *(expected, z[:, axis], "o"),
                    ms=3,
                    color=style.colour(i),
                    alpha=0.8,
                    label=title,
                )
        for name, ax in zip(AXES, axes, strict=True):
            ax.axline((0, 0), slope=1, color=style.INK, lw=0.8)
            ax.set_title(name)
            ax.set_xlabel("expected, normal (σ)")
        axes[0].set_ylabel("difference / predicted σ")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig


def pair_histograms(validation: Validation) -> Figure:
    """Draw the differences of all pairs with the distribution that their sigma predict."""
    pairs = validation.pairs
    limit = 3.2 * float(np.quantile(pairs.sigma, 0.9)) if len(pairs) else 1.0
    grid = np.linspace(-limit, limit, 201)
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.5), sharey=True)
        for axis, ax in enumerate(axes):
            bins = np.linspace(-limit, limit, 41)
            ax.hist(
                pairs.d[:, axis],
                bins,
                color=style.BLUE,
                alpha=0.75,
                density=True,
                label="pairs found",
            )
            ax.plot(
                *(grid, _density(grid, pairs.sigma[:, axis])),
                color=style.ORANGE,
                label="predicted by their σ",
            )
            ax.set_title(AXES[axis])
            ax.set_xlabel("estimated less surveyed (m)")
        axes[0].set_ylabel("density (1/m)")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig


def _density(places: Array, sigma: Array) -> Array:
    """Return the mean of the densities of normal distributions about zero, shape (n,)."""
    highest = 1 / (np.sqrt(2 * np.pi) * sigma)
    return np.array([np.mean(highest * np.exp(-0.5 * (x / sigma) ** 2)) for x in places])


def mistakes(validations: Mapping[str, Validation]) -> Figure:
    """Draw the RMS of the check points' differences, three marks for each validation.

    Parameters
    ----------
    validations : mapping of str to Validation
        By the forgotten step.
    """
    rows = np.arange(len(validations))
    rms = np.array([_rms(validation.points.d) for validation in validations.values()]).reshape(
        -1, 3
    )
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 0.9 + 0.36 * len(rows)))
        for axis, name in enumerate(AXES):
            places, colour = rows + 0.26 * (axis - 1), style.colour(axis)
            ax.plot(rms[:, axis], places, "osD"[axis], ms=5, color=colour, label=name)
        ax.set_xscale("log")
        ax.set_yticks(rows, [*validations])
        ax.invert_yaxis()
        ax.set_xlabel("RMS of the check points' differences (m, logarithmic)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0])
    return fig


def _rms(d: Array) -> Array:
    """Return the RMS along every axis, NaN without differences: a mistake may leave none."""
    rms: Array = np.sqrt(np.mean(d**2, axis=0)) if len(d) else np.full(3, np.nan)
    return rms


# --- Tables of chapter 4: several validations side by side, and the paper's Table 4


MEAN, RMS, RMS_PX = "mean (m)", "RMS (m)", "RMS (px)"
PAIRS, FAILED, POINTS = "pairs of images", "pairs that failed", "check points"
WITHIN, SHARE = "points within 3 GSD in XYZ", "share of them (%)"


def _formatted(table: pd.DataFrame, formats: Mapping[str, str]) -> pd.DataFrame:
    table.attrs["formats"] = dict(formats)
    return table


def _stacked(rows: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(rows, names=["method"]) if rows else pd.DataFrame()


def differences(
    validations: Mapping[str, Validation], paper: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Return mean, scatter and RMS of each coordinate, over pairs as Table 4 and over points.

    Parameters
    ----------
    validations : mapping of str to Validation
        By their titles.
    paper : DataFrame, optional
        Rows of `printed_differences`.

    Returns
    -------
    DataFrame
        As `Validation.table`, and the RMS in ground pixels; m.
    """
    rows = {
        title: validation.table()
        .droplevel("unit")
        .assign(
            **{
                RMS_PX: lambda table, outcome=validation: (
                    table["RMS"] / ground_sample_m(outcome.block)
                )
            }
        )
        for title, validation in validations.items()
    }
    table = pd.concat([_stacked(rows), paper])
    columns = {name: f"{name} (m)" for name in ("mean", "scatter", "RMS", "expected RMS")}
    formats = {**dict.fromkeys(columns.values(), ".2f"), MEAN: "+.2f", RMS_PX: ".1f"}
    return _formatted(table.rename(columns=columns), formats)


def printed_differences(flight: Flight, titles: Mapping[str, str]) -> pd.DataFrame | None:
    """Return rows of the paper's Table 4, exactly as printed; None for other cameras.

    Parameters
    ----------
    flight : Flight
    titles : mapping of str to str
        Titles of the rows, by the paper's method.
    """
    if not printed.applies(flight):
        return None
    rows = {
        (title, "pairs", axis): {
            "n": printed.shown(4, "n_pairs", column),
            "mean": _digits(f"mean_{axis}_m", column),
            "scatter": _digits(f"mean_{axis}_m", column, sigma=True),
            "RMS": _digits(f"rms_{axis}_m", column),
            RMS_PX: _digits(f"rms_{axis}_px", column),
        }
        for column, title in titles.items()
        for axis in AXES
    }
    table = pd.DataFrame.from_dict(rows, orient="index")
    return table.set_axis(pd.MultiIndex.from_tuples(rows, names=["method", "of", "coordinate"]))


def _digits(name: str, column: str, *, sigma: bool = False) -> Markup:
    number = (printed.sigma if sigma else printed.value)(4, name, column)
    return Markup(printed.digits(printed.printed(4, name, column), number).replace("-", "\u2212"))


def counts(
    validations: Mapping[str, Validation], paper: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Return how many pairs and points there are, and how many points are near their survey.

    Parameters
    ----------
    validations : mapping of str to Validation
        By their titles.
    paper : DataFrame, optional
        Rows of `printed_counts`.
    """
    rows = {title: _counts(validation) for title, validation in validations.items()}
    table = pd.concat([pd.DataFrame.from_dict(rows, orient="index"), paper])
    return _formatted(table.rename_axis("method"), {SHARE: ".1f"})


def _counts(validation: Validation) -> dict[str, float]:
    size = np.linalg.norm(validation.points.d, axis=1)
    within = int(np.sum(size <= 3 * ground_sample_m(validation.block)))
    return {
        PAIRS: len(validation.pairs),
        FAILED: validation.n_failed,
        POINTS: len(validation.points),
        WITHIN: within,
        SHARE: 100 * within / max(len(validation.points), 1),
    }


def printed_counts(flight: Flight, titles: Mapping[str, str]) -> pd.DataFrame | None:
    """Return rows of the paper's Table 4 for `counts`, exactly as printed; None for other cameras.

    Parameters
    ----------
    flight : Flight
    titles : mapping of str to str
        Titles of the rows, by the paper's method.
    """
    if not printed.applies(flight):
        return None
    names = {
        PAIRS: "n_pairs",
        FAILED: "n_fail",
        POINTS: "n_points",
        WITHIN: "n_within_3_gsd",
        SHARE: "within_3_gsd_percent",
    }
    rows = {
        title: {key: printed.shown(4, name, column) for key, name in names.items()}
        for column, title in titles.items()
    }
    return pd.DataFrame.from_dict(rows, orient="index")


def normalised(tests: Mapping[str, NormalisedTest]) -> pd.DataFrame:
    """Return the tests of predicted standard deviations, by their titles, judged together."""
    table = accuracy.spread_table(tests)
    three = ("RMS of d / σ", "lower limit", "upper limit", "p", "p joint")
    return _formatted(table, {**dict.fromkeys(three, ".3f"), "counts as": ".0f"})


def together(validations: Mapping[str, Validation]) -> pd.DataFrame:
    """Return the joint tests of all differences of a method, with their full covariance."""
    rows = {
        title: {
            "points": len(validation.points),
            "degrees of freedom": validation.joint_dof,
            "χ²": validation.joint_chi_square,
            "p": validation.joint_chi_square_p,
            "χ² as if independent": float(
                np.sum((validation.points.d / validation.points.sigma) ** 2)
            ),
        }
        for title, validation in validations.items()
    }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("method")
    return _formatted(table, {"χ²": ".1f", "p": ".3f", "χ² as if independent": ".1f"})


def bias(
    validations: Mapping[str, Validation],
    sizes: Mapping[str, Accuracy],
    tests: Mapping[str, AxisTest],
) -> pd.DataFrame:
    """Return the tests of the means, one difference per point, and confidence limits of the RMS.

    Parameters
    ----------
    validations, sizes, tests : mapping of str to Validation, Accuracy and AxisTest
        By their titles.
    """
    rows = {}
    for title, test in tests.items():
        validation, size = validations[title], sizes[title]
        spread = sigmas(validation.mean_cov)
        among = error_sources.axis_covariances(validation.points.sources)
        for axis, name in enumerate(AXES):
            low, high = accuracy.rms_interval(
                size.rms[axis], accuracy.effective_number(among[axis])
            )
            rows[title, name] = {
                "points": size.n,
                MEAN: size.mean[axis],
                "σ of the mean (m)": spread[axis],
                "mean / σ": test.statistic[axis],
                "critical": test.critical,
                "bias": "none seen" if test.accepted[axis] else "significant",
                RMS: size.rms[axis],
                "RMS, from (m)": low,
                "RMS, to (m)": high,
            }
    table = pd.DataFrame(rows.values())
    if rows:
        table.index = pd.MultiIndex.from_tuples(rows, names=["method", "coordinate"])
    formats = dict.fromkeys((MEAN, "σ of the mean (m)", RMS), ".3f")
    formats |= dict.fromkeys(("critical", "RMS, from (m)", "RMS, to (m)"), ".2f")
    return _formatted(table, {**formats, "mean / σ": "+.2f"})


def most_shared(validations: Mapping[str, Validation]) -> dict[str, object]:
    """Return the mean whose sigma grows most by the points' correlation, by method and axis.

    Parameters
    ----------
    validations : mapping of str to Validation
        By their titles; with points.

    Returns
    -------
    dict of str to object
        The ``method`` and ``axis``, its number ``n`` of points, and the standard deviation of
        their mean, ``sigma``, and ``if_independent``, m; empty without validations.
    """
    if not validations:
        return {}
    checked = [*validations.values()]
    mean = np.array([sigmas(validation.mean_cov) for validation in checked])
    apart = np.array(
        [
            np.sqrt(np.sum(validation.points.sigma**2, axis=0)) / len(validation.points)
            for validation in checked
        ]
    )
    k, axis = np.unravel_index(np.argmax(mean / apart), mean.shape)
    return {
        "method": inside([*validations][k]),
        "axis": AXES[axis],
        "n": len(checked[k].points),
        "sigma": mean[k, axis],
        "if_independent": apart[k, axis],
    }


def classes(
    validations: Mapping[str, Validation], sizes: Mapping[str, Accuracy], scales: Sequence[int]
) -> pd.DataFrame:
    """Return the accuracy classes that every method reaches under each standard.

    Parameters
    ----------
    validations, sizes : mapping of str to Validation and Accuracy
        By their titles.
    scales : sequence of int
        Denominators of the map scales of PEC-PCD.
    """
    columns: dict[str, dict[str, str]] = {}
    for title, size in sizes.items():
        validation = validations[title]
        sigma = validation.survey_sigma
        cells: dict[str, str] = {}
        for scale in scales:
            reached = accuracy.pec_pcd(size, scale)
            cells[f"PEC-PCD 1:{scale}, plan / height"] = f"{reached['plan']} / {reached['height']}"
        cells["NSSDA"] = accuracy.nssda(size)["statement"]
        old = accuracy.asprs_2014(size, survey_sigma=sigma)
        new = accuracy.asprs_2023(size, survey_sigma=sigma)
        cells["ASPRS 2014, horizontal / vertical"] = f"{old['horizontal']} / {old['vertical']}"
        cells["ASPRS 2023, horizontal / vertical / 3D"] = (
            f"{new['horizontal']} / {new['vertical']} / {new['three_d']}"
        )
        columns[title] = cells
    return pd.DataFrame(columns).rename_axis("standard")
