"""The truth of a simulated flight, beside its estimates."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pandas as pd

from acx4book.typesetting.myst import MISSING, scientific
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import Flight
from acx4lib.geometry.parameters import REPORTED, SHOWN
from acx4sim.files import truth_path

DECIMALS = {"mm": 4, "m": 3, "°": 4}
"""Decimals of true values by their unit; others have a power of ten."""

IN_TRUTH = {SHOWN[key][0]: name for key, (name, _) in REPORTED.items()} | {
    letter: f"{name}_deg" for letter, name in (("ω", "omega"), ("φ", "phi"), ("κ", "kappa"))
}
"""Names of parameters in the file of the truth, by those in tables."""


def values(flight: Flight, table: pd.DataFrame, camera: str = "") -> pd.Series:
    """Return the true values of the parameters in the rows of a table.

    Parameters
    ----------
    flight : Flight
        If its truth does not lie beside its folder, there are no values.
    table : DataFrame
        With the levels ``camera`` (or without, of one camera), ``parameter``, ``unit``.
    camera : str
        Name of the one camera.

    Returns
    -------
    Series
        NaN for a parameter without a true value, as the places of heads in the image.
    """
    path = truth_path(flight.pictures.resolve())
    index = table.index
    if not path.is_file() or "parameter" not in index.names:
        return pd.Series(np.nan, index=index)
    told = json.loads(path.read_text("utf-8"))
    parts = [told["cameras"], told.get("heads_in_synthetic_frame", {})]
    names = [camera] * len(index)
    if "camera" in index.names:
        names = list(index.get_level_values("camera"))
    keys = [IN_TRUTH.get(parameter) for parameter in index.get_level_values("parameter")]
    true = [
        next((part[name][key] for part in parts if key in part.get(name, {})), np.nan)
        for name, key in zip(names, keys, strict=True)
    ]
    return pd.Series(true, index=index, dtype=float)


def beside_truth(flight: Flight, table: pd.DataFrame, camera: str = "") -> pd.DataFrame:
    """Return the truth beside estimates, to be joined to their table.

    Parameters
    ----------
    flight, table, camera
        As `values` takes them; the table has the columns ``value`` and ``sigma``.

    Returns
    -------
    DataFrame
        ``truth``, as text, and ``error (σ)``, estimate minus truth over the standard deviation;
        no columns where no true value is known.
    """
    true = values(flight, table, camera)
    if true.isna().all():
        return pd.DataFrame(index=table.index)
    units = table.index.get_level_values("unit")
    known = pd.DataFrame(
        {
            "truth": [_exactly(value, unit) for value, unit in zip(true, units, strict=True)],
            "error (σ)": (table["value"] - true) / table["sigma"],
        },
        index=table.index,
    )
    known.attrs["formats"] = {"error (σ)": ".1f"}
    return known


def beside_truths(
    flight: Flight, tables: Mapping[str, pd.DataFrame], camera: str = ""
) -> pd.DataFrame:
    """Return the truth once, and the errors of several ways to estimate the same parameters.

    Parameters
    ----------
    flight, camera
        As `values` takes them.
    tables : mapping of str to DataFrame
        At least one, by the words above their columns; each as `beside_truth` takes it.

    Returns
    -------
    DataFrame
        Columns of two levels: ``truth``, and ``error (σ)`` below the words of each way.
    """
    known = {words: beside_truth(flight, table, camera) for words, table in tables.items()}
    longest = max(known.values(), key=len)
    if "truth" not in longest:
        return pd.DataFrame(index=longest.index, columns=pd.MultiIndex.from_arrays([[], []]))
    errors = {(words, "error (σ)"): beside["error (σ)"] for words, beside in known.items()}
    out = pd.DataFrame({("truth", ""): longest["truth"]} | errors)
    out.attrs["formats"] = {f"{words}, error (σ)": ".1f" for words in tables}
    return out


def _exactly(value: float, unit: str) -> str:
    if np.isnan(value):
        return MISSING
    return Markup(
        f"{value:.{DECIMALS[unit]}f}" if unit in DECIMALS else scientific(value, digits=2)
    )
