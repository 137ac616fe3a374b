"""Flights adjusted with every distortion model, as ``make models`` left them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

STORED = Path(str(resources.files("acx4book.chapters.beyond.distortion_models") / "stored"))
"""Folder of what the project brings."""

REAL = "camcal"
"""The measurements of others: 21 images of a flat sheet by a small camera."""

FIRST = "Brown"
"""The paper's model, with which the others are compared."""

LEVEL = 0.01
"""Of joint tests."""

ERRORS = ("strip_plan_m", "strip_height_m", "direct_plan_m", "direct_height_m")


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """What every model makes of every case.

    Attributes
    ----------
    rows : DataFrame
        case, seed, model, and what `trials.of_model` returns.
    about : mapping
        Date, processor, commit, seeds.
    """

    rows: pd.DataFrame
    about: Mapping[str, Any]

    @property
    def n_flights(self) -> int:
        """Number of simulated flights of each case."""
        return int(self.rows.loc[self.rows["case"] != REAL, "seed"].nunique())


def read(folder: str | Path = "") -> Study:
    """Read what ``make models`` left in a folder; by default, what the project brings.

    Raises
    ------
    FileNotFoundError
        If a file is missing: the message says how to make it.
    """
    place = Path(folder) if folder else STORED
    rows, about = (place / f"distortion_models.{kind}" for kind in ("csv", "json"))
    if not (rows.is_file() and about.is_file()):
        msg = f"no flights with distortion models in {place}: make models"
        raise FileNotFoundError(msg)
    return Study(rows=pd.read_csv(rows), about=json.loads(about.read_text(encoding="utf-8")))


def with_criteria(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with sigma0_sq, and with Schwarz's criterion less that of Brown's model.

    Schwarz's criterion [1]_ is the weighted sum of squares, plus ln(n) for every parameter that is
    estimated of the camera. Simulated weights are true. Those of `REAL` measurements are not known
    so well: there the sum is divided by the smallest variance factor of all models.

    References
    ----------
    .. [1] G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6, 1978.
    """
    out = rows.assign(sigma0_sq=rows["cost"] / rows["redundancy"])
    smallest = out.groupby(["case", "seed"])["sigma0_sq"].transform("min")
    scale = np.where(out["case"] == REAL, smallest, 1.0)
    out["bic"] = out["cost"] / scale + out["estimated"] * np.log(out["observations"])
    first = out[out["model"] == FIRST].set_index(["case", "seed"])["bic"]
    keys = pd.MultiIndex.from_frame(out[["case", "seed"]])
    return out.assign(bic_less_first=out["bic"] - first.reindex(keys).to_numpy())


def summary(study: Study) -> pd.DataFrame:
    """Return the mean over flights of every number, and the root mean square of errors.

    A column significant is the share of flights in which all parameters of distortion but the
    radial ones are together significant at `LEVEL`.

    Returns
    -------
    DataFrame
        One row per case and model, in the order in which they were computed.
    """
    rows = with_criteria(study.rows).assign(significant=study.rows["joint_p"] < LEVEL)
    means = rows.drop(columns="seed").groupby(["case", "model"], sort=False).mean()
    squares = rows.set_index(["case", "model"])[["strip_px", *ERRORS]] ** 2
    means[squares.columns] = np.sqrt(squares.groupby(level=[0, 1], sort=False).mean())
    return means.reset_index()


def over_first(study: Study, name: str) -> pd.DataFrame:
    """Return an error over that of Brown's model: rows are cases, columns models.

    Parameters
    ----------
    study : Study
    name : str
        A column of `summary`.
    """
    wide = summary(study).pivot_table(index="case", columns="model", values=name, sort=False)
    return wide.div(wide[FIRST], axis=0)
