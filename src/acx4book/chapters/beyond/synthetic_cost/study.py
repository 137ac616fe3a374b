"""Flights with a synthetic image and without one, as ``make chain`` left them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from acx4lib.expected import Array

STORED = Path(str(resources.files("acx4book.chapters.beyond.synthetic_cost") / "stored"))
"""Folder of the flights that the project brings."""

SYNTHETIC, RIG = "synthetic", "rig"
"""The two ways: a single step of carried points, and a rig of four heads."""

PARTS = ("parameters", "points", "classes", "shared", "noise", "sweep", "pattern", "centres")


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """What both ways make of many flights, and of exact ones.

    Attributes
    ----------
    parameters : DataFrame
        seed, way, camera, parameter, value, sigma.
    points : DataFrame
        seed, way, over (points or pairs), axis, n, rms_m, mean_m, sigma_m.
    classes : DataFrame
        seed, way, and the class of PEC-PCD in plan and in height by scale.
    shared : DataFrame
        Single steps of flights that are carried through the heads of one: seed, heads_of (the
        seed of these), camera, parameter, value, sigma.
    noise : DataFrame
        Single steps of flights with noise, with the sigma that heads add, beside those of exact
        data of the same geometry: seed, camera, parameter, value, sigma, sigma_of_heads, exact.
    sweep : DataFrame
        Of exact data: f_1_mm, heads (calibrated or refined), camera, parameter, value, sigma.
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
    sweep: pd.DataFrame
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
        own = self.centres
        return own[(own["method"] == "single_step") & (own["lowered_m"] == 0)]


def read(folder: str | Path = "") -> Study:
    """Read what ``make chain`` left in a folder; by default, what the project brings.

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


def variance_factors(study: Study, way: str) -> Array:
    """Return the variance factor of every flight."""
    own = study.parameters
    chosen = (own["way"] == way) & (own["parameter"] == "sigma0_squared")
    return own.loc[chosen, "value"].to_numpy()


def scatter(study: Study, way: str) -> pd.DataFrame:
    """Return how estimates scatter over flights, beside their a posteriori sigma.

    Returns
    -------
    DataFrame
        One row per camera and parameter: mean, scatter (standard deviation over flights), sigma
        (root mean square), ratio of the last two and the ratio's own standard deviation.
    """
    own = study.parameters[(study.parameters["way"] == way) & study.parameters["sigma"].notna()]
    grouped = own.assign(variance=own["sigma"] ** 2).groupby(["camera", "parameter"], sort=False)
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
    """Return how estimates scatter over their sigma among flights carried through the same heads.

    Returns
    -------
    Series
        By parameter, from the variances within groups of such flights.
    """
    own = study.shared[study.shared["sigma"].notna()]
    grouped = own.assign(variance=own["sigma"] ** 2).groupby(["parameter", "heads_of"], sort=False)
    within = grouped["value"].var() / grouped["variance"].mean()
    return within.groupby("parameter", sort=False).mean() ** 0.5


def rms_by_flight(study: Study, way: str, over: str = "points") -> pd.DataFrame:
    """Return the RMS at check points of every flight: a column for plan and one for height, m."""
    own = study.points[(study.points["way"] == way) & (study.points["over"] == over)]
    wide = own.pivot_table(index="seed", columns="axis", values="rms_m")
    return pd.DataFrame(
        {"plan": np.hypot(wide["east_m"], wide["north_m"]), "height": wide["height_m"]}
    )


def accuracy(study: Study) -> pd.DataFrame:
    """Return the accuracy at check points of both ways, over all flights.

    Returns
    -------
    DataFrame
        One row per over and axis: for either way RMS and predicted sigma (m); and by how many
        percent the synthetic image's RMS is larger, with the standard error of that, for which
        both ways of a flight are a pair.
    """
    squared = study.points.assign(
        rms=study.points["rms_m"] ** 2, predicted=study.points["sigma_m"] ** 2
    )
    rows = []
    for (over, axis), own in squared.groupby(["over", "axis"], sort=False):
        squares, predicted = (
            own.pivot_table(index="seed", columns="way", values=name)
            for name in ("rms", "predicted")
        )
        row: dict[str, Any] = {"over": over, "axis": axis}
        for way in (SYNTHETIC, RIG):
            row |= {f"rms_{way}": np.sqrt(squares[way].mean())}
            row |= {f"sigma_{way}": np.sqrt(predicted[way].mean())}
        rows.append(row | _percent_larger(squares[SYNTHETIC].to_numpy(), squares[RIG].to_numpy()))
    return pd.DataFrame(rows)


def _percent_larger(first: Array, second: Array) -> dict[str, float]:
    """Return by how many percent one RMS over flights is larger, from squares by flight.

    To first order the ratio of two RMS is one plus half of the relative difference of squares.
    """
    ratio = float(np.mean(first) / np.mean(second))
    error = np.std(first - ratio * second, ddof=1) / np.sqrt(len(first)) / np.mean(second)
    root = np.sqrt(ratio)
    return {"percent": 100 * (root - 1), "sigma_percent": float(100 * error / (2 * root))}


def exact(sweep: pd.DataFrame, camera: str, parameter: str) -> pd.DataFrame:
    """Return a parameter over the focal length of head 1: a column for each kind of heads."""
    own = sweep[(sweep["camera"] == camera) & (sweep["parameter"] == parameter)]
    return own.pivot_table(index="f_1_mm", columns="heads", values="value")


def excess(study: Study) -> dict[str, float]:
    """Return how much larger variance factors are with the synthetic image.

    Returns
    -------
    dict of str to float
        Their means over flights, ``rig`` and ``synthetic``; the mean ``difference`` on the same
        flight and its standard error ``sigma``; and in how many flights that of the synthetic
        image is ``beyond`` one by more than twice its scatter.
    """
    single, rig = (variance_factors(study, way) for way in (SYNTHETIC, RIG))
    difference = single - rig
    return {
        "rig": float(rig.mean()),
        "synthetic": float(single.mean()),
        "difference": float(difference.mean()),
        "sigma": float(np.std(difference, ddof=1) / np.sqrt(len(difference))),
        "beyond": int(np.sum(single > 1 + 2 * np.std(single, ddof=1))),
    }


def scatter_with_heads(study: Study, *, alpha: float = 0.01) -> pd.DataFrame:
    """Return how the synthetic camera scatters over a sigma that has its heads' part.

    Parameters
    ----------
    study : Study
    alpha : float
        Probability that the noise of any parameter lies outside its bounds, if sigma is right.

    Returns
    -------
    DataFrame
        By parameter: sigma, and that of the heads (root mean squares over flights); the scatter
        over flights over the root of the sum of both squares: of the flights as they are
        (``ratio``), of their noise alone (``noise``), which is what they differ by from exact data
        of the same geometry, and of these exact data (``exact``); the bounds of noise, ``low`` and
        ``high``, from the chi-square distribution.
    """
    own = study.noise.assign(
        noise=study.noise["value"] - study.noise["exact"],
        variance=study.noise["sigma"] ** 2,
        of_heads=study.noise["sigma_of_heads"] ** 2,
    )
    grouped = own.groupby("parameter", sort=False)
    mean = grouped[["variance", "of_heads"]].mean()
    both = np.sqrt(mean.sum(axis=1))
    dof, tail = study.noise["seed"].nunique() - 1, alpha / len(mean) / 2
    low, high = np.sqrt(stats.chi2.ppf([tail, 1 - tail], dof) / dof)
    return pd.DataFrame(
        {
            "sigma": np.sqrt(mean["variance"]),
            "sigma_of_heads": np.sqrt(mean["of_heads"]),
            "ratio": grouped["value"].std() / both,
            "noise": grouped["noise"].std() / both,
            "exact": grouped["exact"].std() / both,
            "low": low,
            "high": high,
        }
    )
