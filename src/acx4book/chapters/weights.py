"""Chapter 9, standard deviations: given wrong, estimated, and errors that change slowly."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.notebooks import simulated
from acx4book.notebooks.simulated import Flown, fly_and_read
from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS
from acx4lib.attempts import Failed
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.variance_components import Components
from acx4lib.calibration.estimates import Calibration, parameters
from acx4lib.calibration.mounting import Mounting, single_step
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import SHOWN
from acx4lib.georeferencing import accuracy, error_sources
from acx4lib.georeferencing.validation import Differences, compare
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.model import Model
from acx4sim.plan import Options, SlowErrors

# --- Effects of the trajectory's errors on the calibrations of many simulated flights


TIES = MappingProxyType({"calibration": 150})
"""Tie points of the simulated blocks: enough to show errors of the trajectory, and quick."""

SLOWLY_BY_DEFAULT = SlowErrors()
WHITE = Options(tie_points=TIES)
SLOW = Options(tie_points=TIES, slow_errors=SLOWLY_BY_DEFAULT)
EXACT = replace(simulated.EXACT, tie_points=TIES)
"""Errors of a flight: independent; of the same size, but slowly changing; and none."""

SHIFT_M = (0.30, -0.20, 0.15)
"""East, north and height of the shift of GNSS, as by another reference station."""

SHIFTED = Options(tie_points=TIES, gnss_shift_m=SHIFT_M)

MODELLED = "modelled"
"""Kind of calibrations of slow flights whose weights model the correlation of the errors."""

DESIGN = "acx4-ideal"


def _adjusted(
    flown: Flown,
    block: Block | None = None,
    *,
    fix: Sequence[str] = (),
    gnss: Sequence[str] = (),
) -> Mounting:
    """Return the single step of a simulated flight, without a search for gross errors."""
    model = Model(free=flown.flight.estimate_mounting, fix=fix, gnss=gnss)
    return single_step(flown.block if block is None else block, model, snooping=False)


def errors(flown: Flown, mounting: Mounting) -> pd.DataFrame:
    """Return the errors of a calibration beside their standard deviations.

    Parameters
    ----------
    flown : Flown
        Whose truth is known.
    mounting : Mounting
        Its calibration.

    Returns
    -------
    DataFrame
        By ``parameter`` and ``unit``, as `Mounting.table` has them: the error as ``value``, its
        ``sigma``, and ``error / σ``.
    """
    estimates = parameters(mounting.calibration)
    error = [p.value - flown.truth[p.name] for p in estimates]
    names = [SHOWN[p.key] for p in estimates]
    index = pd.MultiIndex.from_tuples(names, names=["parameter", "unit"])
    table = pd.DataFrame({"value": error, "sigma": [p.sigma for p in estimates]}, index=index)
    table["error / σ"] = table["value"] / table["sigma"]
    table.attrs["formats"] = {"error / σ": "+.1f"}
    return table


def modelled(block: Block, slow: SlowErrors = SLOWLY_BY_DEFAULT) -> Block:
    """Return the block with correlation in time of its trajectory's errors."""
    positions = GaussMarkov(share=slow.gnss, time_constant_s=slow.gnss_constant_s)
    attitudes = GaussMarkov(share=slow.attitude, time_constant_s=slow.attitude_constant_s)
    trajectory = replace(block.trajectory, slow_positions=positions, slow_attitudes=attitudes)
    return replace(block, trajectory=trajectory)


def with_height_noise(block: Block, sigma_m: float) -> Block:
    """Return the block with another standard deviation of the GNSS heights."""
    trajectory = block.trajectory
    sigma = trajectory.sigma_position * [1, 1, 0] + np.array([0.0, 0.0, sigma_m])
    return replace(block, trajectory=replace(trajectory, sigma_position=sigma))


def surveyed(flown: Flown) -> Block:
    """Return the block of a flight with its true lever arm declared."""
    (camera,) = flown.block.cameras
    lever = np.array([flown.truth[f"lever_{axis}_m"] for axis in "xyz"])
    return replace(flown.block, cameras=(replace(camera, T_b_c=Pose(R=camera.T_b_c.R, r=lever)),))


# --- many flights ----------------------------------------------------------------------------

Case = Callable[[Flown], Mounting]

SHIFTS: Mapping[str, tuple[Options, Case]] = MappingProxyType(
    {
        "shifted, none": (SHIFTED, _adjusted),
        "shifted, shift": (SHIFTED, lambda flown: _adjusted(flown, gnss=("shift",))),
        "shifted, shift with lever arm held": (
            SHIFTED,
            lambda flown: _adjusted(flown, surveyed(flown), fix=("lever_arm",), gnss=("shift",)),
        ),
        "slow, none": (SLOW, _adjusted),
        "slow, shift and drift": (SLOW, lambda flown: _adjusted(flown, gnss=("shift", "drift"))),
    }
)
"""Errors of a flight, and the adjustment with some of them as unknowns."""

SLOWLY: Mapping[str, tuple[Options, Case]] = MappingProxyType(
    {
        "white": (WHITE, _adjusted),
        "slow": (SLOW, _adjusted),
        MODELLED: (SLOW, lambda flown: _adjusted(flown, modelled(flown.block))),
    }
)
"""Errors of the same size, with weights that model their changes or do not."""


def calibrated(seeds: Iterable[int], cases: Mapping[str, tuple[Options, Case]]) -> pd.DataFrame:
    """Compare the errors of calibrations with their sigma, over flights.

    Parameters
    ----------
    seeds : iterable of int
        One flight each, and for every case.
    cases : mapping of str to (Options, callable)
        By kind: the errors of a flight, and the function that calibrates it.

    Returns
    -------
    DataFrame
        One row per kind, seed and parameter: error and a posteriori sigma in the parameter's
        unit, and the variance factor of the adjustment.
    """
    rows = []
    for seed in seeds:
        for kind, (options, case) in cases.items():
            flown = fly_and_read(DESIGN, seed, options)
            mounting = case(flown)
            sigma0_sq = mounting.bundle.solution.sigma0_sq
            rows += [
                (kind, seed, p.name, p.value - flown.truth[p.name], p.sigma, sigma0_sq)
                for p in parameters(mounting.calibration)
            ]
    columns = ["kind", "seed", "parameter", "error", "sigma", "sigma0_squared"]
    return pd.DataFrame(rows, columns=columns)


def scatter(found: pd.DataFrame) -> pd.DataFrame:
    """Return the ratio of errors to their sigma, by kind and parameter.

    Parameters
    ----------
    found : DataFrame
        As `calibrated` returns it.

    Returns
    -------
    DataFrame
        Columns kind, parameter, rms, sigma (root mean square), ratio and the ratio's own
        standard deviation, 1/sqrt(2 n).
    """
    squared = found.assign(error=found["error"] ** 2, sigma=found["sigma"] ** 2)
    grouped = squared.groupby(["kind", "parameter"], sort=False)
    table = grouped[["error", "sigma"]].mean().pow(0.5).rename(columns={"error": "rms"})
    table["ratio"] = table["rms"] / table["sigma"]
    table["sigma_ratio"] = table["ratio"] / np.sqrt(2 * grouped.size())
    return table.reset_index()


def spans(ratios: pd.DataFrame, kind: str) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest ratio of boresight and lever arm.

    Parameters
    ----------
    ratios : DataFrame
        As `scatter` returns it.
    kind : str
    """
    rows = ratios[ratios["kind"] == kind]
    ranges = {}
    for group in ("boresight", "lever"):
        ratio = rows["ratio"][rows["parameter"].str.startswith(group)]
        ranges[group] = (float(ratio.min()), float(ratio.max()))
    return ranges


def height_errors(seed: int) -> pd.DataFrame:
    """Return the height error of every exposure of one flight, for white and for slow noise.

    Returns
    -------
    DataFrame
        Columns kind, exposure (number), strip and error_m.
    """
    true, white, slow = (
        _heights(fly_and_read(DESIGN, seed, noise)) for noise in (EXACT, WHITE, SLOW)
    )
    parts = [
        true.assign(kind=kind, error_m=heights["height_m"] - true["height_m"])
        for kind, heights in (("white", white), ("slow", slow))
    ]
    return pd.concat(parts, ignore_index=True)[["kind", "exposure", "strip", "error_m"]]


def _heights(flown: Flown) -> pd.DataFrame:
    block = flown.block
    strips = dict(zip(block.images.exposure_idx, block.images.strips, strict=True))
    height = block.frame.to_grid(block.trajectory.T_m_b.r)[:, 2]
    numbers = np.arange(len(height))
    return pd.DataFrame(
        {"exposure": numbers + 1, "strip": [strips[i] for i in numbers], "height_m": height}
    )


# --- Figures of trajectory errors and their effect on a calibration and its sigma


TINTS = {"white": style.BLUE, "slow": style.ORANGE, MODELLED: style.TEAL}
NAMES = {
    "white": "independent errors",
    "slow": "slowly changing errors, as large",
    MODELLED: "the same, correlation in the weights",
}


def trajectory_errors(heights: pd.DataFrame, scatter: pd.DataFrame) -> Figure:
    """Draw slow and white errors of a trajectory, and their effect on calibrations.

    Parameters
    ----------
    heights : DataFrame
        As `height_errors` returns it.
    scatter : DataFrame
        As `scatter` returns it.
    """
    shown = [name for name in dict.fromkeys(scatter["parameter"]) if name in LABELS]
    shown = [name for name in shown if name[0] not in "kp"]  # distortion is the images' alone
    with style.applied():
        fig, (left, right) = style.subplots(
            1, 2, figsize=(style.WIDTH, 3.5), width_ratios=(1, 1.15)
        )
        for kind, group in heights.groupby("kind", sort=False):
            _draw_by_strip(left, group, TINTS[str(kind)])
        left.axhline(0, color=style.INK, lw=0.7)
        left.set(xlabel="exposure number", ylabel="error in height (cm)")
        style.heading(left, "The same size, another course", "one flight; lines join a strip")
        rows = np.arange(len(shown))
        for offset, (kind, group) in zip(
            (-0.22, 0.0, 0.22), scatter.groupby("kind", sort=False), strict=True
        ):
            ratio = group.set_index("parameter").loc[shown]
            right.errorbar(
                *(ratio["ratio"], rows + offset),
                xerr=2 * ratio["sigma_ratio"],
                fmt="o",
                capsize=2.5,
                lw=1.2,
                ms=5,
                color=TINTS[str(kind)],
                label=NAMES[str(kind)],
            )
        right.axvline(1, color=style.INK, lw=0.7)
        right.set_yticks(rows, [LABELS[name] for name in shown])
        right.set(ylim=(len(rows) - 0.5, -0.5), xlabel="RMS of the error over stated σ (1)")
        right.set_xlim(left=0)
        style.heading(right, "What σ then says", "one: σ is right; bars ±2σ of the ratio")
        style.legend_below(fig, right.get_legend_handles_labels()[0], ncols=2)
    return fig


def _draw_by_strip(ax: Axes, errors: pd.DataFrame, tint: str) -> None:
    for _, strip in errors.groupby("strip", sort=False):
        ax.plot(strip["exposure"], 100 * strip["error_m"], "o-", color=tint, ms=2.6, lw=1.0)


def height_noise(table: pd.DataFrame, *, beside_print: bool) -> Figure:
    """Draw the sigma of f and of the lever arm's z over the noise of GNSS heights.

    Parameters
    ----------
    table : DataFrame
        As `tables.height_noise` returns it.
    beside_print : bool
        Whether the printed ones are of the same camera.
    """
    noise_cm = 100 * table["gnss_height_m"]
    drawn = [
        (name, *scaled)
        for name, scaled in {"f_mm": (1000.0, "µm"), "lever_z_m": (100.0, "cm")}.items()
        if table[f"sigma_{name}"].notna().any()
    ]
    if not drawn:
        return style.nothing("Focal length and lever arm are held.")
    with style.applied():
        fig, axes = style.subplots(
            1, len(drawn), figsize=(style.WIDTH, 2.7), sharex=True, squeeze=False
        )
        for ax, (name, scale, unit) in zip(axes[0], drawn, strict=True):
            ax.plot(noise_cm, scale * table[f"sigma_{name}"], "o-", color=style.BLUE)
            if beside_print:
                _draw_printed(ax, scale * printed.sigma(3, name, "single_step"))
            ax.set(xlabel="white noise of GNSS heights (cm)", ylabel=f"σ ({unit})")
            ax.set_title(LABELS[name])
            ax.set(xlim=(0, 1.04 * noise_cm.max()), ylim=(0, 1.1 * ax.get_ylim()[1]))
    return fig


def _draw_printed(ax: Axes, sigma: float) -> None:
    ax.axhline(sigma, color=style.PRINTED, lw=1.0, ls="--")
    ax.annotate(
        "paper",
        xy=(1.0, sigma),
        xytext=(0, 3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        fontsize=style.SMALL,
        color=style.SOFT,
    )


# --- Tables on standard deviations: of a flight under other assumptions, and of simulated flights


RATIO = "ratio"
"""Heading of the column that compares two standard deviations."""


def promised(geometry: Calibration, found: Calibration) -> pd.DataFrame:
    """Return the sigma predicted from a geometry and those of an adjustment, by parameter.

    Parameters
    ----------
    geometry : Calibration
        Of the network without its measurements.
    found : Calibration
    """
    return _beside({"promised": geometry.table(), "stated": found.table()})


def side_by_side(found: Mapping[str, Mounting | Failed | None]) -> pd.DataFrame:
    """Return the sigma of two adjustments and their ratio; empty where one has no outcome."""
    tables = {title: mounting.table() for title, mounting in found.items() if mounting}
    return _beside(tables) if len(tables) == len(found) else pd.DataFrame()


def _beside(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the sigma of the parameters that two tables both estimate, and their ratio."""
    sigma = pd.DataFrame({f"σ, {title}": table["sigma"] for title, table in tables.items()})
    order = next(iter(tables.values())).index
    estimated = sigma.replace(np.inf, np.nan).mask(sigma <= 0).dropna()
    shared = estimated.reindex([key for key in order if key in estimated.index])
    first, second = shared.columns
    shared[RATIO] = shared[second] / shared[first]
    shared.attrs["formats"] = {first: ".2g", second: ".2g", RATIO: ".2f"}
    return shared


def of_boresight(table: pd.DataFrame) -> tuple[float, float] | None:
    """Return the smallest and the largest ratio of the boresight's sigma; None where it is held."""
    if table.empty:
        return None
    ratio = table[RATIO][[name.startswith("boresight") for name in _names(table)]]
    return (float(ratio.min()), float(ratio.max())) if len(ratio) else None


def _names(table: pd.DataFrame) -> list[str]:
    return [str(name) for name in table.index.get_level_values("parameter")]


def changes(without: Mounting | Failed, given: Mounting | Failed) -> pd.DataFrame:
    """Return the differences of the parameters of two adjustments, second less first.

    Parameters
    ----------
    without, given : Mounting
        Of the same measurements.

    Returns
    -------
    DataFrame
        The change, in the parameter's unit and in its sigma; empty where one has no outcome.
    """
    if not (without and given):
        return pd.DataFrame()
    first, second = without.table(), given.table()
    change = pd.DataFrame({"change": second["value"] - first["value"], "σ": first["sigma"]})
    estimated = change[np.isfinite(change["σ"]) & (change["σ"] > 0)]
    table = estimated.assign(**{IN_SIGMA: (estimated["change"] / estimated["σ"]).round(3) + 0.0})
    table.attrs["formats"] = {"change": "+.2g", "σ": ".2g", IN_SIGMA: "+.3f"}
    return table


IN_SIGMA = "change / σ"


def largest_change(table: pd.DataFrame) -> float:
    """Return the largest change of `changes` in standard deviations; zero where there is none."""
    return 0.0 if table.empty else float(table[IN_SIGMA].abs().max())


def reached(points: Mapping[str, Differences]) -> pd.DataFrame:
    """Return the RMS at check points: predicted with each of several sigma, and found.

    Parameters
    ----------
    points : mapping of str to Differences
        Of the same check points, by whose sigma they are: that which a geometry promises, and last
        that which was found. Empty where there are none.

    Returns
    -------
    DataFrame
        By sigma and coordinate: points, RMS in m, and as `accuracy.spread_table`. All differences
        are those of the last calibration. Empty where the points are not the same.
    """
    if len({len(differences) for differences in points.values()} - {0}) != 1:
        return pd.DataFrame()
    *_, actual = points.values()
    return _reached(
        actual.d,
        {
            f"σ {title}": (of.sigma, error_sources.axis_covariances(of.sources))
            for title, of in points.items()
        },
    )


def reached_in_block(bundle: Bundle) -> pd.DataFrame:
    """Return the same for the check points of a block that are tie points in its adjustment.

    Returns
    -------
    DataFrame
        As `reached` has it, with the sigma found; the limits take the points for independent.
        Empty without points.
    """
    block, point_idx = bundle.network.block, bundle.network.image_points.point_idx
    rays = np.bincount(point_idx, minlength=bundle.network.n_points)
    check = np.flatnonzero(rays[block.check.point_idx] >= 2)
    if not len(check):
        return pd.DataFrame()
    idx = block.check.point_idx[check]
    d, sigma = compare(block, bundle.state.x_m[idx], bundle.solution.cov_points[idx], check)
    return _reached(d, {"σ found": (sigma, np.stack([np.diag(axis**2) for axis in sigma.T]))})


def _reached(d: Array, predicted: Mapping[str, tuple[Array, Array]]) -> pd.DataFrame:
    """Return the table of differences beside sigma and covariances of every axis, by titles."""
    table = (
        accuracy.spread_table(
            {
                title: accuracy.normalised_test(d, sigma, axes, probability=0.95)
                for title, (sigma, axes) in predicted.items()
            }
        )
        .drop(columns="counts as")
        .rename_axis(["predicted with", "coordinate"])
    )
    sigmas = [sigma for sigma, _ in predicted.values()]
    table.insert(0, "points", len(d))
    table.insert(
        1, "predicted RMS (m)", np.hstack([np.sqrt(np.mean(s**2, axis=0)) for s in sigmas])
    )
    table.insert(2, "found RMS (m)", np.tile(np.sqrt(np.mean(d**2, axis=0)), len(sigmas)))
    numbers = table.select_dtypes("float").columns
    table.attrs["formats"] = dict.fromkeys(numbers, ".3f")
    return table


def wrong_sigma(
    given: Components,
    mistaken: Components,
    wrong: Mapping[str, float],
    estimated: Mapping[str, float],
) -> pd.DataFrame:
    """Return the factors of a flight's sigma, given right and wrong, and those that correct them.

    Parameters
    ----------
    given, mistaken : Components
    wrong : mapping of str to float
        Factors of the wrong sigma, by group.
    estimated : mapping of str to float
        Factors at the end of the iteration, by group; one where sigma stays.
    """
    as_given, factor = given.table(), mistaken.table()
    table = pd.DataFrame(
        {
            "as it is": as_given["factor of σ", "value"],
            "factor": factor["factor of σ", "value"],
            "its σ": factor["factor of σ", "sigma"],
        }
    )
    table["expected"] = table["as it is"] / pd.Series(
        {group: wrong.get(group, 1.0) for group in table.index}
    )
    last = pd.Series({group: estimated.get(group, 1.0) for group in table.index})
    table["estimated"] = last.where(last != 1)
    table.attrs["formats"] = dict.fromkeys(table.columns, ".2f")
    return table


def ratios(scatter: pd.DataFrame) -> pd.DataFrame:
    """Return the ratio of errors to their sigma, a column for each kind.

    Parameters
    ----------
    scatter : DataFrame
        `scatter` of calibrations.

    Returns
    -------
    DataFrame
        Without distortion, which is the images' alone; NaN where a parameter is held.
    """
    kinds = list(scatter["kind"].unique())
    wide = scatter.pivot_table(index="parameter", columns="kind", values="ratio", sort=False)
    names = [name for name in wide.index if name in LABELS and name[0] not in "kp"]
    table = wide.loc[names, kinds]
    table.index = pd.Index([LABELS[name] for name in names], name="parameter")
    table.columns = [_title(kind) for kind in kinds]
    table.attrs["formats"] = dict.fromkeys(table, ".1f")
    return table


def _title(kind: str) -> str:
    """Return the heading of a column."""
    flight, _, unknown = kind.partition(", ")
    return f"{flight.capitalize()}; unknown: {unknown}"


def height_noise_table(adjusted: Mapping[float, Mounting | Failed]) -> pd.DataFrame:
    """Return the sigma of f and of the lever arm's z, a row for each noise of GNSS heights.

    Parameters
    ----------
    adjusted : mapping of float to Mounting
        By the standard deviation of the heights, m.

    Returns
    -------
    DataFrame
        Columns gnss_height_m, sigma_f_mm and sigma_lever_z_m of the first camera, NaN where they
        are held; a priori: what such noise would do, whatever the noise of this flight.
    """
    rows = []
    for sigma_m, mounting in adjusted.items():
        if isinstance(mounting, Failed):
            continue
        unit = np.sqrt(mounting.bundle.solution.sigma0_sq)
        listed = reversed(parameters(mounting.calibration))
        sigma = {p.name: p.sigma / unit for p in listed if p.sigma > 0}
        rows.append((sigma_m, *(sigma.get(name, np.nan) for name in ("f_mm", "lever_z_m"))))
    return pd.DataFrame(rows, columns=["gnss_height_m", "sigma_f_mm", "sigma_lever_z_m"])


def met_at_cm(table: pd.DataFrame, name: str) -> float:
    """Return the noise of heights at which a parameter has its printed sigma, cm.

    Parameters
    ----------
    table : DataFrame
        Of `height_noise`, noise ascending.
    name : str
        ``f_mm`` or ``lever_z_m``.

    Returns
    -------
    float
        NaN where no noise between the first and the last gives it.
    """
    noise_cm, sigma = 100 * table["gnss_height_m"], table[f"sigma_{name}"]
    wanted = printed.sigma(3, name, "single_step")
    if not sigma.min() <= wanted <= sigma.max():
        return float("nan")
    return float(np.interp(wanted, sigma, noise_cm))
