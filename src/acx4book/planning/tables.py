"""Predicted accuracies of a plan, as tables and as text for the screen."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from acx4book.planning.design import Design
from acx4book.planning.flown import flying_time_s
from acx4files.results import sentences as messages
from acx4files.results.folder import COMPONENTS
from acx4files.results.tables import parameter_tables, record, unit_of
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.determination import detectable
from acx4lib.calibration.estimates import (
    Parameter,
    features,
    from_bundle,
    is_determined,
    parameters,
)
from acx4lib.geometry.parameters import REPORTED
from acx4lib.georeferencing import budget
from acx4lib.least_squares.covariance import correlation

AXES = ("east_m", "north_m", "height_m")

HIDDEN = ["stage", "value", "sigma_before"]
"""Columns of parameters.csv that the screen does not show."""


def unknowns(bundle: Bundle) -> list[Parameter]:
    """Return the wanted unknowns of a bundle: those of the cameras, then errors of GNSS."""
    return [*parameters(from_bundle(bundle)), *trajectory_errors.parameters(bundle)]


def parameter_table(design: Design) -> pd.DataFrame:
    """Return the wanted unknowns of all methods, with the columns of parameters.csv and some more.

    Returns
    -------
    DataFrame
        `value` is the plan's, and sigma a priori, infinite where the design says nothing.
        `determined` says whether the design determines it; `correlation` is the largest, and
        `correlated_with` the unknown that it is with.
    """
    parts = [pd.DataFrame()]
    for method, mounting in design.mountings.items():
        cov, bundle = design.covariances(method).mean(axis=0), mounting.bundle
        calibration = design.calibration(method)
        listed = [*parameters(calibration), *trajectory_errors.parameters(bundle, cov)]
        if not listed:
            continue
        related = correlation(cov) - np.eye(len(cov))
        most = np.argmax(np.abs(related), axis=1)
        made = record(f"mounting/{method}", parameter_tables(listed, cov), {}).tables
        of_trajectory = trajectory_errors.is_determined(bundle, cov)
        parts.append(
            made["parameters"].assign(
                determined=[*is_determined(calibration), *of_trajectory],
                correlation=related[np.arange(len(listed)), most],
                correlated_with=[listed[j].full_name for j in most],
            )
        )
    return pd.concat(parts)


def reliability_table(design: Design) -> pd.DataFrame:
    """Return detectable errors of every group of observations, and the effects of smaller ones.

    Returns
    -------
    DataFrame
        A row for each component. Detectable errors have the unit of the component; the effect is
        the largest on a parameter, in its sigmas.
    """
    rows: list[dict[str, Any]] = []
    for method, mounting in design.mountings.items():
        for error in detectable(mounting.bundle):
            camera, _, key = error.on.rpartition("/")
            bias = unit_of(error.kind, error.component) * error.bias
            rows.append(
                {
                    "method": method,
                    "kind": error.kind,
                    "component": COMPONENTS[error.kind][error.component],
                    "n": len(bias),
                    "redundancy": float(np.median(error.redundancy)),
                    "detectable": float(np.median(bias)),
                    "at_worst": float(bias.max()),
                    "effect_sigmas": error.effect,
                    "effect_on": f"{camera}/{REPORTED[key][0]}" if key else "",
                }
            )
    return pd.DataFrame(rows)


def rms_table(design: Design) -> pd.DataFrame:
    """Return the expected RMS of differences at check points, m, and the part of each source.

    Returns
    -------
    DataFrame
        From all rays of a point and from every pair of them; squares of the parts add up.
    """
    rows: list[dict[str, Any]] = []
    for method in design.validations:
        for part in ("points", "pairs"):
            budgets = [
                budget.of(getattr(v, part).sources, v.georeferenced.layout)
                for v in (wind.validations[method] for wind in design.winds)
            ]
            mean = np.nanmean([one.mean for one in budgets], axis=0)
            square = mean.sum(axis=-1)
            shares = {"all": np.ones(len(AXES)), **budget.shares(mean)}
            n = float(np.mean([len(one) for one in budgets]))
            rows += [
                {
                    "method": method,
                    "differences": part,
                    "n": round(n, 1),
                    "of": source,
                    **dict(zip(AXES, np.sqrt(share * square).tolist(), strict=True)),
                }
                for source, share in shares.items()
            ]
    return pd.DataFrame(rows)


def not_determined(design: Design) -> list[str]:
    """Return one sentence per unknown that the design does not determine: why, and the cure."""
    out = []
    for method, mounting in design.mountings.items():
        cov = design.covariances(method).mean(axis=0)
        has = features(mounting.bundle.network.block)
        lines = messages.not_determined(design.calibration(method), has)
        lines += messages.trajectory_not_determined(mounting.bundle, cov)
        out += [f"mounting/{method}: {line}" for line in lines]
    return out


def summary(design: Design) -> dict[str, Any]:
    """Return what the tables do not say, for JSON."""
    minutes = {
        name: flying_time_s(tuple(block.strips.values())) / 60
        for name, block in design.plan.blocks.items()
    }
    return {
        "name": design.plan.setup.name,
        "winds": len(design.winds),
        "flying_time_min": minutes,
        "not_determined": not_determined(design),
    }


def lines(design: Design) -> Iterator[str]:
    """Yield what `acx4 plan` prints."""
    said = summary(design)
    yield f"{said['name']}: predicted from geometry alone, sigma0 = 1, {said['winds']} winds"
    for name, block in design.blocks.items():
        yield (
            f"block {name}: {len(block.images)} images in {len(design.plan.blocks[name].strips)} "
            f"strips, {said['flying_time_min'][name]:.0f} minutes; {len(block.image_points)} "
            f"measurements of {len(block.points)} points; {len(block.control)} control points, "
            f"{len(block.check)} check points"
        )
    for title, table in (
        ("unknowns", parameter_table(design).drop(columns=HIDDEN, errors="ignore")),
        ("errors of observations that would be found", reliability_table(design)),
        ("RMS of differences at check points, m, by source", rms_table(design)),
    ):
        if len(table):
            yield f"\n{title}\n{table.to_string(index=False, float_format='{:.3g}'.format)}"
    if said["not_determined"]:
        yield "\n".join(["\nnot determined", *said["not_determined"]])
