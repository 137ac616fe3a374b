"""Tables on standard deviations of simulated flights."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import Mounting


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


def height_noise(adjusted: Mapping[float, Mounting]) -> pd.DataFrame:
    """Return the sigma of f and of the lever arm's z, a row for each noise of GNSS heights.

    Parameters
    ----------
    adjusted : mapping of float to Mounting
        By the standard deviation of the heights, m.

    Returns
    -------
    DataFrame
        Columns gnss_height_m, sigma_f_mm and sigma_lever_z_m; a priori: what such noise would do,
        whatever the noise of this flight.
    """
    rows = []
    for sigma_m, mounting in adjusted.items():
        unit = np.sqrt(mounting.bundle.solution.sigma0_sq)
        found = {p.name: p.sigma / unit for p in parameters(mounting.calibration)}
        rows.append((sigma_m, found["f_mm"], found["lever_z_m"]))
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
