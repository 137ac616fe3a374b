"""Tables on standard deviations: of a flight under other assumptions, and of simulated flights."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS
from acx4lib.attempts import Failed
from acx4lib.bundle.variance_components import Components
from acx4lib.calibration.estimates import Calibration, parameters
from acx4lib.calibration.mounting import Mounting
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy, error_sources
from acx4lib.georeferencing.differences import Differences

RATIO = "ratio"
"""Heading of the column that compares two standard deviations."""


def promised(geometry: Calibration, found: Calibration) -> pd.DataFrame:
    """Return the sigma that a geometry promises, and those of an adjustment, by parameter.

    Parameters
    ----------
    geometry : Calibration
        Of the network without its measurements.
    found : Calibration
    """
    return _beside({"promised": geometry.table(), "stated": found.table()})


def side_by_side(found: Mapping[str, Mounting | Failed | None]) -> pd.DataFrame:
    """Return the sigma of two adjustments and their ratio; empty where one has no outcome."""
    tables = {title: one.table() for title, one in found.items() if one}
    return _beside(tables) if len(tables) == len(found) else pd.DataFrame()


def _beside(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return the sigma of two tables of parameters, of those that both estimate."""
    sigma = pd.DataFrame({f"σ, {title}": own["sigma"] for title, own in tables.items()})
    order = next(iter(tables.values())).index
    estimated = sigma.replace(np.inf, np.nan).mask(sigma <= 0).dropna()
    both = estimated.reindex([key for key in order if key in estimated.index])
    first, second = both.columns
    both[RATIO] = both[second] / both[first]
    both.attrs["formats"] = {first: ".2g", second: ".2g", RATIO: ".2f"}
    return both


def of_boresight(table: pd.DataFrame) -> tuple[float, float] | None:
    """Return the smallest and the largest ratio of the boresight's sigma; None where it is held."""
    if table.empty:
        return None
    ratio = table[RATIO][[name.startswith("boresight") for name in _names(table)]]
    return (float(ratio.min()), float(ratio.max())) if len(ratio) else None


def _names(table: pd.DataFrame) -> list[str]:
    return [str(name) for name in table.index.get_level_values("parameter")]


def changes(without: Mounting | Failed, given: Mounting | Failed) -> pd.DataFrame:
    """Return by how much the parameters of one adjustment differ from those of another.

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
    """Return the RMS at check points that a geometry predicts, and that of the differences.

    Parameters
    ----------
    points : mapping of str to Differences
        Of the same check points, by the calibration that a geometry promises and by the one that
        was found; empty where there are none.

    Returns
    -------
    DataFrame
        By coordinate: points, RMS in m, that of d / σ, and the limits of this one that chance
        leaves in 95 % of all cases. Empty where the points are not the same.
    """
    if len({len(one) for one in points.values()} - {0}) != 1:
        return pd.DataFrame()
    said, found = points.values()
    axes = error_sources.axis_covariances(said.sources)
    test = accuracy.normalised_test(found.d, said.sigma, axes, probability=0.95)
    table = pd.DataFrame(
        {
            "points": len(found),
            "predicted RMS (m)": np.sqrt(np.mean(said.sigma**2, axis=0)),
            "found RMS (m)": np.sqrt(np.mean(found.d**2, axis=0)),
            D_OVER_SIGMA: test.rms,
            "lower limit": test.limits[:, 0],
            "upper limit": test.limits[:, 1],
        },
        index=pd.Index(AXES, name="coordinate"),
    )
    table.attrs["formats"] = {name: ".3f" if "(m)" in name else ".2f" for name in table.columns[1:]}
    return table


D_OVER_SIGMA = "RMS of d / σ"


def outside(table: pd.DataFrame) -> list[str]:
    """Return the coordinates of `reached` whose differences chance does not leave."""
    if table.empty:
        return []
    ratio = table[D_OVER_SIGMA]
    wrong = (ratio < table["lower limit"]) | (ratio > table["upper limit"])
    return [str(axis) for axis in table.index[wrong]]


def wrong_sigma(
    given: Components,
    mistaken: Components,
    wrong: Mapping[str, float],
    estimated: Mapping[str, float],
) -> pd.DataFrame:
    """Return the factors of a flight as it is and with wrong sigma, and what undoes the mistake.

    Parameters
    ----------
    given, mistaken : Components
    wrong : mapping of str to float
        What the sigma were multiplied by, by group.
    estimated : mapping of str to float
        With what the iteration ends, by group; one for those that keep theirs.
    """
    own, factor = given.table(), mistaken.table()
    table = pd.DataFrame(
        {
            "as it is": own["factor of σ", "value"],
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
    """Return how large errors are against their sigma, a column for each kind.

    Parameters
    ----------
    scatter : DataFrame
        `study.scatter` of calibrations.

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


def height_noise(adjusted: Mapping[float, Mounting | Failed]) -> pd.DataFrame:
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
        found = {p.name: p.sigma / unit for p in listed if p.sigma > 0}
        rows.append((sigma_m, *(found.get(name, np.nan) for name in ("f_mm", "lever_z_m"))))
    return pd.DataFrame(rows, columns=["gnss_height_m", "sigma_f_mm", "sigma_lever_z_m"])


def met_at_cm(table: pd.DataFrame, name: str) -> float:
    """Return the noise of heights at which the sigma of a parameter is the printed one, cm.

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
