"""Chapter 12, what the synthetic image costs: the same measurements with it and without it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy import stats

from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.estimates import parameters as parameters_of
from acx4lib.expected import Array
from acx4lib.geometry.parameters import REPORTED, SHOWN
from acx4sim import optics

# --- Flights with a synthetic image and without one, as ``make chain`` left them


STORED = Path(str(resources.files("acx4book.chapters") / "stored"))
"""Folder of the project's stored flights."""

SYNTHETIC, RIG = "synthetic", "rig"
"""The two ways: a single step of transferred points, and a rig of four heads."""

ALPHA = 0.01
"""Probability that the noise of any parameter lies outside its bounds, if sigma is right."""

PARTS = ("parameters", "points", "classes", "shared", "noise", "pattern", "centres")


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """Results of both ways for many flights, and for exact ones.

    Attributes
    ----------
    parameters : DataFrame
        seed, way, camera, parameter, value, and sigma as the adjustment gives it by itself.
    points : DataFrame
        seed, way, over (points or pairs), axis, n, rms_m, mean_m, sigma_m.
    classes : DataFrame
        seed, way, and the class of PEC-PCD in plan and in height by scale.
    shared : DataFrame
        Single steps of flights that share the heads of one flight: seed, heads_of (the
        seed of that one), camera, parameter, value, sigma by itself.
    noise : DataFrame
        Single steps of flights with noise beside those of exact data of the same geometry: seed,
        camera, parameter, value, sigma as a run has it, and of it sigma_before, the part of the
        heads, exact.
    pattern : DataFrame
        Of exact data: height_m, head, col_px, row_px, d_col_px, d_row_px.
    centres : DataFrame
        Of exact data by the places of the lens centres: side_m of their square, lowered_m (by how
        much it is lower than on the simulated rig), method, camera, parameter, value, sigma. The
        method *expected* has the shift of f, x_p, y_p that the single step's lever arm must cause.
    about : mapping
        Date, processor, commit, seeds; the same of `noise`.
    """

    parameters: pd.DataFrame
    points: pd.DataFrame
    classes: pd.DataFrame
    shared: pd.DataFrame
    noise: pd.DataFrame
    pattern: pd.DataFrame
    centres: pd.DataFrame
    about: Mapping[str, Any]

    @property
    def n_flights(self) -> int:
        """Number of flights."""
        return int(self.parameters["seed"].nunique())

    @property
    def squares(self) -> pd.DataFrame:
        """The single step of `centres` by side, at the height that the simulated rig has."""
        estimates = self.centres
        return estimates[(estimates["method"] == "single_step") & (estimates["lowered_m"] == 0)]


def read(folder: str | Path = "") -> Study:
    """Read the output of ``make chain`` from a folder; by default, the project's stored one.

    Raises
    ------
    FileNotFoundError
        If a file is missing: the message says how to make it.
    """
    place = Path(folder) if folder else STORED
    files = {part: place / f"closed_chain_{part}.csv" for part in PARTS}
    abouts = place / "closed_chain.json", place / "closed_chain_noise.json"
    if not all(path.is_file() for path in (*abouts, *files.values())):
        msg = f"no flights of the closed chain in {place}: make chain"
        raise FileNotFoundError(msg)
    tables = {part: pd.read_csv(path) for part, path in files.items()}
    about, of_noise = (json.loads(path.read_text(encoding="utf-8")) for path in abouts)
    return Study(about={**about, "noise": of_noise}, **tables)


def scatter(study: Study, way: str) -> pd.DataFrame:
    """Return the scatter of estimates over flights, beside the sigma of their adjustment.

    Returns
    -------
    DataFrame
        One row per camera and parameter: mean, scatter (standard deviation over flights), sigma
        (root mean square), ratio of the last two and the ratio's own standard deviation.
    """
    estimates = study.parameters[
        (study.parameters["way"] == way) & study.parameters["sigma"].notna()
    ]
    grouped = estimates.assign(variance=estimates["sigma"] ** 2).groupby(
        ["camera", "parameter"], sort=False
    )
    table = pd.DataFrame(
        {
            "mean": grouped["value"].mean(),
            "scatter": grouped["value"].std(),
            "sigma": np.sqrt(grouped["variance"].mean()),
        }
    )
    table["ratio"] = table["scatter"] / table["sigma"]
    table["sigma_ratio"] = table["ratio"] / np.sqrt(2 * (grouped.size() - 1))
    return table.reset_index()


def scatter_of_shared(study: Study) -> pd.Series:
    """Return scatter over sigma among flights whose points went through the same heads.

    Returns
    -------
    Series
        By parameter, from the variances within groups of such flights.
    """
    estimates = study.shared[study.shared["sigma"].notna()]
    grouped = estimates.assign(variance=estimates["sigma"] ** 2).groupby(
        ["parameter", "heads_of"], sort=False
    )
    within = grouped["value"].var() / grouped["variance"].mean()
    return within.groupby("parameter", sort=False).mean() ** 0.5


def rms_by_flight(study: Study, way: str) -> pd.DataFrame:
    """Return the RMS at check points of every flight: a column for plan and one for height, m."""
    points = study.points[(study.points["way"] == way) & (study.points["over"] == "points")]
    wide = points.pivot_table(index="seed", columns="axis", values="rms_m")
    return pd.DataFrame(
        {"plan": np.hypot(wide["east_m"], wide["north_m"]), "height": wide["height_m"]}
    )


def _percent_larger(first: Array, second: Array) -> dict[str, float]:
    """Return by how many percent one RMS over flights is larger, from squares by flight.

    To first order the ratio of two RMS is one plus half of the relative difference of squares.
    """
    ratio = float(np.mean(first) / np.mean(second))
    error = np.std(first - ratio * second, ddof=1) / np.sqrt(len(first)) / np.mean(second)
    root = np.sqrt(ratio)
    return {"percent": 100 * (root - 1), "sigma_percent": float(100 * error / (2 * root))}


def excess(study: Study) -> dict[str, float]:
    """Return the excess of the variance factors with the synthetic image.

    Returns
    -------
    dict of str to float
        Their means over flights, ``rig`` and ``synthetic``; the mean ``difference`` on the same
        flight and its standard error ``sigma``; and in how many flights that of the synthetic
        image is ``beyond`` one by more than twice its scatter.
    """
    single, rig = (_variance_factors(study, way) for way in (SYNTHETIC, RIG))
    difference = single - rig
    return {
        "rig": float(rig.mean()),
        "synthetic": float(single.mean()),
        "difference": float(difference.mean()),
        "sigma": float(np.std(difference, ddof=1) / np.sqrt(len(difference))),
        "beyond": int(np.sum(single > 1 + 2 * np.std(single, ddof=1))),
    }


def _variance_factors(study: Study, way: str) -> Array:
    """Return the variance factor of every flight."""
    estimates = study.parameters
    chosen = (estimates["way"] == way) & (estimates["parameter"] == "sigma0_squared")
    return estimates.loc[chosen, "value"].to_numpy()


def scatter_with_heads(study: Study) -> pd.DataFrame:
    """Return the synthetic camera's scatter over sigma, in flights with noise and without.

    Returns
    -------
    DataFrame
        By parameter: sigma, its part ``alone`` from the single step by itself and ``sigma_before``
        from the heads (root mean squares over flights); the scatter over flights over sigma: of
        the flights as they are (``ratio``), of their noise alone (``noise``), which is what they
        differ by from exact data of the same geometry, and of these exact data (``exact``); the
        bounds of noise, ``low`` and ``high``, from the chi-square distribution.
    """
    estimates = study.noise.assign(
        noise=study.noise["value"] - study.noise["exact"],
        variance=study.noise["sigma"] ** 2,
        before=study.noise["sigma_before"] ** 2,
    )
    grouped = estimates.groupby("parameter", sort=False)
    mean = grouped[["variance", "before"]].mean()
    sigma = np.sqrt(mean["variance"])
    dof, tail = study.noise["seed"].nunique() - 1, ALPHA / len(mean) / 2
    low, high = np.sqrt(stats.chi2.ppf([tail, 1 - tail], dof) / dof)
    return pd.DataFrame(
        {
            "sigma": sigma,
            "alone": np.sqrt(mean["variance"] - mean["before"]),
            "sigma_before": np.sqrt(mean["before"]),
            "ratio": grouped["value"].std() / sigma,
            "noise": grouped["noise"].std() / sigma,
            "exact": grouped["exact"].std() / sigma,
            "low": low,
            "high": high,
        }
    )


# --- Effects of four lens centres on one synthetic camera
#
# The residual pattern: a ray of a head starts d beside the lens centre of the synthetic camera. On
# ground at distance H it is f d / H beside where that camera expects it, and the adjustment takes
# up a part that does not depend on H: the pattern is linear in 1 / H. Two heights determine it.
#
# The lever arm: the centres of four heads form a square, and each head looks outward over its
# corner. Its footprint is shifted outward on the ground by as much as its centre lies beside the
# square's. A camera in the middle sees ground at the distances t H from below it; if it were
# higher by c, at t (H + c). The shift does not depend on H, and at all flying heights it looks
# like a higher camera, with the factor of least squares over the image: c = sum(d t) / sum(t t).


# --- the pattern of residuals -----------------------------------------------------------------

D = ["d_col_px", "d_row_px"]
AT = ["row_px", "col_px"]


def at_height(pattern: pd.DataFrame, height_m: float) -> pd.DataFrame:
    """Return the pattern at a flying height above the ground.

    Parameters
    ----------
    pattern : DataFrame
        As `Study` has it, of two flying heights.
    height_m : float

    Returns
    -------
    DataFrame
        head, col_px, row_px, d_col_px, d_row_px.
    """
    low, high = np.unique(pattern["height_m"])
    lower, higher = (
        pattern[pattern["height_m"] == h].sort_values(AT, ignore_index=True) for h in (low, high)
    )
    share = (1 / height_m - 1 / high) / (1 / low - 1 / high)
    return higher.assign(**{d: higher[d] + share * (lower[d] - higher[d]) for d in D}).drop(
        columns="height_m"
    )


def rms_px(found: pd.DataFrame) -> float:
    """Return the root mean square of a pattern's vectors, by coordinate, px."""
    return float(np.sqrt(np.mean(found[D].to_numpy() ** 2)))


def _grid(field: pd.DataFrame, name: str) -> Array:
    """Return a column of a pattern as rows and columns of the image; None where no head sees it."""
    return field.pivot_table(
        index="row_px", columns="col_px", values=name, aggfunc="first"
    ).to_numpy()


def _steps(head: Array, d: Array) -> float:
    """Return the largest step over seams between the rows of a grid."""
    seam = (head[1:] != head[:-1]) & ~pd.isna(head[1:]) & ~pd.isna(head[:-1])
    lengths = np.hypot(*(d[1:] - d[:-1])[seam].T)
    return float(lengths.max(initial=0.0))


# --- the lever arm -----------------------------------------------------------------------------


def apparent_rise_m(side_m: float, f_mm: float, size_mm: Array) -> float:
    """Return the apparent rise of the synthetic camera's lens centre, m.

    Parameters
    ----------
    side_m : float
        Of the square of the heads' lens centres, parallel to the image.
    f_mm : float
    size_mm : ndarray, shape (2,)
        Of the image, evenly filled with points, each head in its quarter.
    """
    mean_t = size_mm / 4 / f_mm
    mean_t_t = size_mm**2 / 12 / f_mm**2
    return float(side_m / 2 * mean_t.sum() / mean_t_t.sum())


def true_centre_m() -> Array:
    """Return the mean of the lens centres of the simulated heads in the body frame, shape (3,)."""
    centre: Array = np.mean([head.lever_m for head in optics.HEADS.values()], axis=0)
    return centre


# --- Figures of the synthetic image's cost: scatter over sigma, patterns


TINTS = {SYNTHETIC: style.ORANGE, RIG: style.BLUE}
NAMES = {SYNTHETIC: "synthetic camera", RIG: "heads of the rig"}


def scatter_over_sigma(found: Study) -> Figure:
    """Draw, for every parameter, the scatter over flights over the sigma of its adjustment."""
    ways = {way: scatter(found, way) for way in (RIG, SYNTHETIC)}
    names = list(dict.fromkeys(ways[SYNTHETIC]["parameter"]))
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.3))
        for way, table in ways.items():
            known = table[table["parameter"].isin(names)]
            _draw_ratios(ax, known, names, TINTS[way])
        ax.axhline(1, color=style.INK, lw=0.7)
        ax.set_xticks(range(len(names)), [LABELS[n] for n in names], rotation=40, ha="right")
        ax.set(ylabel="scatter over σ of the adjustment (1)", xlim=(-0.6, len(names) - 0.4))
        ax.set_ylim(bottom=0)
        style.heading(ax, "What σ promises, and what flights keep", "one: σ is right; bars ±2σ")
        handles = [
            Line2D([], [], ls="", marker="o", color=TINTS[way], label=NAMES[way])
            for way in (SYNTHETIC, RIG)
        ]
        style.legend_below(fig, handles)
    return fig


def _draw_ratios(ax: Axes, table: pd.DataFrame, names: list[str], tint: str) -> None:
    """Draw ratios with bars; the cameras of a parameter stand beside each other."""
    cameras = list(dict.fromkeys(table["camera"]))
    for k, (_, ratios) in enumerate(table.groupby("camera", sort=False)):
        beside = 0.11 * (k - (len(cameras) - 1) / 2) + (0.0 if len(cameras) > 1 else -0.32)
        places = [names.index(name) + beside for name in ratios["parameter"]]
        bars = 2 * ratios["sigma_ratio"]
        ax.errorbar(
            places, ratios["ratio"], yerr=bars, color=tint, fmt="o", ms=4, lw=1.0, capsize=1.5
        )


# --- the pattern of residuals -----------------------------------------------------------------

EVERY = 2
"""Every n-th node in a row or column has an arrow."""


def pattern(found: Study) -> Figure:
    """Draw the residuals of a single step of exact data over the synthetic image."""
    width, height = (printed.value(2, name, "SYN") for name in ("width_px", "height_px"))
    flown = np.unique(found.pattern["height_m"])
    fields = {h: found.pattern[found.pattern["height_m"] == h] for h in flown}
    key = style.round_length(
        max(float(np.hypot(field[D[0]], field[D[1]]).max()) for field in fields.values())
    )
    names = sorted(found.pattern["head"].unique())
    with style.applied():
        fig, axes = style.subplots(1, len(fields), figsize=(style.WIDTH, 4.9), sharey=True)
        for ax, (height_m, field) in zip(np.atleast_1d(axes), fields.items(), strict=True):
            _draw_vectors(ax, field, names, key)
            _draw_seams(ax, field, names)
            ax.set(xlim=(0, width), ylim=(height, 0), aspect="equal")
            ax.set(xlabel="column (px)")
            ax.locator_params(nbins=5)
            rms = rms_px(field)
            style.heading(ax, f"From {height_m:.0f} m", f"RMS {rms:.2f} px")
        np.atleast_1d(axes)[0].set_ylabel("row (px)")
        handles = [Line2D([], [], color=style.colour(k), label=n) for k, n in enumerate(names)]
        style.legend_below(fig, handles)
    return fig


def _draw_vectors(ax: Axes, field: pd.DataFrame, names: list[str], key: float) -> None:
    """Draw the vectors of every `EVERY`-th node, in the colours of the heads."""
    places = [np.unique(field[name], return_inverse=True)[1] for name in AT]
    some = field[(places[0] % EVERY == 0) & (places[1] % EVERY == 0)]
    gap = EVERY * float(np.min(np.diff(np.unique(field["col_px"]))))
    arrows = ax.quiver(
        *(some["col_px"], some["row_px"]),
        *(gap / key * some[name] for name in D),
        color=[style.colour(names.index(head)) for head in some["head"]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.005,
        zorder=3,
    )
    label, place = f"{key:g} px", (0.86, 1.03)
    ax.quiverkey(
        arrows, *place, gap, label, labelpos="W", color=style.INK, fontproperties=style.LETTERS
    )


def _draw_seams(ax: Axes, field: pd.DataFrame, names: list[str]) -> None:
    """Draw the seams, where the used head changes."""
    head = _grid(field, "head")
    rows, cols = (np.unique(field[name]) for name in AT)
    for name in names:
        inside = (head == name).astype(float)
        ax.contour(cols, rows, inside, levels=[0.5], colors=style.SOFT, linewidths=0.9)


# --- Tables of the same measurements with a synthetic image and without one


SQUARE_ROWS = ("f_mm", "k1", "k2", "k3", "p1", "p2", "lever_x_m", "lever_y_m", "lever_z_m")
"""Parameters of the table of squares; a boresight does not depend on them."""

HEIGHTS_M = (700.0, 1000.0, 1250.0, 1500.0, 2000.0, 3000.0)
"""Flying heights of the table."""

_NAMES = {name: SHOWN[key] for key, (name, _) in REPORTED.items()}
"""Names and units in tables that values show, by the names of results."""


def _formatted(table: pd.DataFrame, formats: Mapping[Any, str]) -> pd.DataFrame:
    table.attrs["formats"] = dict(formats)
    return table


def _index(names: Iterable[str]) -> pd.MultiIndex:
    return pd.MultiIndex.from_tuples([_NAMES[n] for n in names], names=["parameter", "unit"])


def accuracy_table(found: Study) -> pd.DataFrame:
    """Return RMS and predicted sigma at check points for both ways, and how much larger one is."""
    accuracy = _accuracy(found)
    columns = {
        (title, way): accuracy[f"{part}_{way}"]
        for title, part in (("RMS (m)", "rms"), ("predicted (m)", "sigma"))
        for way in (SYNTHETIC, RIG)
    }
    columns |= {
        ("larger by (%)", "value"): accuracy["percent"],
        ("larger by (%)", "sigma"): accuracy["sigma_percent"],
    }
    table = pd.DataFrame(columns)
    axes = [axis.removesuffix("_m") for axis in accuracy["axis"]]
    table.index = pd.MultiIndex.from_arrays([accuracy["over"], axes], names=["over", "axis"])
    return _formatted(table, {f"{title}, {way}": ".3f" for title, way in list(columns)[:4]})


def _accuracy(study: Study) -> pd.DataFrame:
    """Return the accuracy at check points of both ways, over all flights."""
    squared = study.points.assign(
        rms=study.points["rms_m"] ** 2, predicted=study.points["sigma_m"] ** 2
    )
    rows = []
    for (over, axis), group in squared.groupby(["over", "axis"], sort=False):
        squares, predicted = (
            group.pivot_table(index="seed", columns="way", values=name)
            for name in ("rms", "predicted")
        )
        row: dict[str, Any] = {"over": over, "axis": axis}
        for way in (SYNTHETIC, RIG):
            row |= {f"rms_{way}": np.sqrt(squares[way].mean())}
            row |= {f"sigma_{way}": np.sqrt(predicted[way].mean())}
        rows.append(row | _percent_larger(squares[SYNTHETIC].to_numpy(), squares[RIG].to_numpy()))
    return pd.DataFrame(rows)


def parameters(found: Study) -> pd.DataFrame:
    """Return the synthetic camera: mean and scatter over flights, and that over its own sigma."""
    spread = scatter(found, SYNTHETIC)
    columns = {
        ("mean and scatter over flights", "value"): spread["mean"],
        ("mean and scatter over flights", "sigma"): spread["scatter"],
        ("scatter over σ of the single step", "value"): spread["ratio"],
        ("scatter over σ of the single step", "sigma"): spread["sigma_ratio"],
    }
    return pd.DataFrame(columns).set_index(_index(spread["parameter"]))


def both_sigma(alone: Calibration, total: Calibration) -> pd.DataFrame:
    """Return sigma of a calibration without and with the part of its heads, and this part."""
    estimates = parameters_of(total)
    table = pd.DataFrame(
        {
            "σ of the single step": [p.sigma for p in parameters_of(alone)],
            "σ of the heads": [p.sigma_before for p in estimates],
            "σ": [p.sigma for p in estimates],
        }
    )
    return _formatted(
        table.set_index(_index(p.name for p in estimates)), dict.fromkeys(table, ".2g")
    )


def with_heads(found: Study) -> pd.DataFrame:
    """Return sigma and its two parts, and the scatter over flights over sigma."""
    spread = scatter_with_heads(found)
    columns = {
        "σ of the single step": spread["alone"],
        "σ of the heads": spread["sigma_before"],
        "σ": spread["sigma"],
        "scatter over σ": spread["ratio"],
        "of noise alone": spread["noise"],
        "of exact data": spread["exact"],
    }
    table = pd.DataFrame(columns).set_index(_index(spread.index))
    return _formatted(
        table, dict.fromkeys(list(columns)[:3], ".2g") | dict.fromkeys(list(columns)[3:], ".2f")
    )


def heights(found: Study, heights_m: Iterable[float] = HEIGHTS_M) -> pd.DataFrame:
    """Return the residuals of the synthetic camera at several flying heights.

    Parameters
    ----------
    found : Study
    heights_m : iterable of float
        Above the ground.
    """
    rows = []
    for height_m in heights_m:
        field = at_height(found.pattern, height_m)
        step = _largest_step_px(field)
        ground_cm = 100 * height_m * printed.pixel_mm("SYN") / printed.value(3, "f_mm", PAPERS)
        rows.append(
            {
                "flying height (m)": height_m,
                "RMS (px)": rms_px(field),
                "largest (px)": float(np.hypot(field[D[0]], field[D[1]]).max()),
                "largest step at a seam (px)": step,
                "that step on the ground (cm)": step * ground_cm,
            }
        )
    table = pd.DataFrame(rows)
    whole = dict.fromkeys(("flying height (m)", "that step on the ground (cm)"), ".0f")
    return _formatted(table, dict.fromkeys(table, ".2f") | whole)


def _largest_step_px(field: pd.DataFrame) -> float:
    """Return the largest step between neighbouring nodes of different heads, px."""
    head = _grid(field, "head")
    d = np.stack([_grid(field, name).astype(float) for name in D], axis=-1)
    return float(max(_steps(head, d), _steps(head.T, np.swapaxes(d, 0, 1))))


PAPERS = "single_step"
"""Method whose printed values are compared."""


def squares(found: Study) -> pd.DataFrame:
    """Return the estimates of exact data for squares of lens centres of different size."""
    estimates = found.squares.set_index(["side_m", "parameter"])
    columns = {
        (f"square of {100 * side:.0f} cm", part): [
            estimates[part][side, name] for name in SQUARE_ROWS
        ]
        for side in np.unique(found.squares["side_m"])
        for part in ("value", "sigma")
    }
    return pd.DataFrame(columns, index=_index(SQUARE_ROWS))


def factors(found: Study) -> pd.DataFrame:
    """Return the variance factors of exact data for squares of lens centres of different size."""
    sigma0_sq = found.squares[found.squares["parameter"] == "sigma0_squared"].set_index("side_m")[
        "value"
    ]
    columns = {f"square of {100 * side:.0f} cm": [sigma0_sq[side]] for side in sigma0_sq.index}
    table = pd.DataFrame(columns, index=["variance of unit weight"])
    return _formatted(table, dict.fromkeys(table, ".4f"))


SHIFTED = {"f_mm": "f", "xp_mm": "x_p", "yp_mm": "y_p"}
"""Parameters that the two-step method shifts where it holds a lever arm at zero; symbols."""


def shifts(found: Study) -> pd.DataFrame:
    """Return how far the two-step method with GNSS moves f, x_p, y_p, by place of lens centres.

    Returns
    -------
    DataFrame
        A row for each place: side_m, lowered_m, lever_z_m of the single step, and for each name of
        `SHIFTED` the shift against the single step and, as expected_NAME, the one that its lever
        arm must cause; all mm.
    """
    rows = []
    for (side, lowered), group in found.centres.groupby(["side_m", "lowered_m"]):
        by_method = group.pivot_table(index="parameter", columns="method", values="value")
        shift = by_method["two_step_gnss"] - by_method[PAPERS]
        row = {"side_m": side, "lowered_m": lowered, "lever_z_m": by_method[PAPERS]["lever_z_m"]}
        row |= {name: shift[name] for name in SHIFTED}
        rows.append(row | {f"expected_{name}": by_method["expected"][name] for name in SHIFTED})
    return pd.DataFrame(rows)


def shifts_beside_print(found: Study) -> pd.DataFrame:
    """Return `shifts` by the place of the lens centres, with the paper's in the last row."""
    by_place = shifts(found)
    places = [_place(row["side_m"], row["lowered_m"]) for row in by_place.to_dict("records")]
    table = by_place.drop(columns=["side_m", "lowered_m"]).set_index(
        pd.Index(places, name="lens centres")
    )
    table.loc["paper", "lever_z_m"] = printed.value(3, "lever_z_m", PAPERS)
    for name in SHIFTED:
        table.loc["paper", name] = print_shift(name)
    table = table.rename(
        columns={"lever_z_m": "lever arm z (m)"}
        | {name: f"{name[:-3]} (mm)" for name in SHIFTED}
        | {f"expected_{name}": f"{name[:-3]}, expected (mm)" for name in SHIFTED}
    )
    return _formatted(table, dict.fromkeys(table, "+.4f") | {"lever arm z (m)": "+.3f"})


def print_shift(name: str) -> float:
    """Return the printed two-step value of a parameter less the single-step one."""
    two, single = (printed.value(3, name, method) for method in ("two_step", PAPERS))
    return two - single


def _place(side_m: float, lowered_m: float) -> str:
    if not side_m:
        return "in one point"
    lower = f", {100 * lowered_m:.0f} cm lower" if lowered_m else ""
    return f"square of {100 * side_m:.0f} cm{lower}"
