"""What a plan determines, as tables and as entries of a summary."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import (
    Parameter,
    from_bundle,
    is_determined,
    not_determined,
    parameters,
)
from acx4lib.calibration.trust import determination
from acx4lib.calibration.trust.detectable import detectable
from acx4lib.calibration.trust.needs import features
from acx4lib.expected import Array
from acx4lib.flight.checks.oddities import area_notes
from acx4lib.geometry.parameters import REPORTED
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.budget import Budget
from acx4lib.georeferencing.validation import Validation
from acx4lib.least_squares.covariance import correlation
from acx4lib.planning import ground
from acx4lib.planning.design import Design
from acx4lib.planning.exposures import flying_time_s
from acx4lib.results.files.table_files import COLUMNS
from acx4lib.results.rows import COMPONENTS, parameter_tables, unit_of

AXES = ("east_m", "north_m", "height_m")

ADDED = ("determined", "correlation", "correlated_with")
"""Columns of `parameter_table` that parameters.csv of a run does not have."""

RELIABILITY = (
    "method",
    "kind",
    "component",
    "n",
    "redundancy_least",
    "redundancy_median",
    "detectable_median",
    "detectable_largest",
    "effect_sigmas",
    "effect_on",
)
"""Columns of `reliability_table`."""


def unknowns(bundle: Bundle) -> list[Parameter]:
    """Return the wanted unknowns of a bundle: those of the cameras, then errors of GNSS."""
    return [*parameters(from_bundle(bundle)), *trajectory_errors.parameters(bundle)]


def parameter_table(design: Design) -> pd.DataFrame:
    """Return the wanted unknowns of all methods, with the columns of parameters.csv and three more.

    Returns
    -------
    DataFrame
        `value` is the plan's, and sigma a priori, infinite where the design says nothing.
        `determined` says whether the design determines it; `correlation` is the largest, and
        `correlated_with` the unknown that it is with.
    """
    parts = [_parameters(name, m.bundle) for name, m in design.mountings.items()]
    return pd.concat(parts) if parts else pd.DataFrame(columns=[*COLUMNS["parameters"], *ADDED])


def _parameters(method: str, bundle: Bundle) -> pd.DataFrame:
    listed = unknowns(bundle)
    related = correlations(bundle).to_numpy(copy=True)
    np.fill_diagonal(related, 0.0)
    most = np.argmax(np.abs(related), axis=1)
    tables = parameter_tables(
        "mounting", method, listed, trajectory_errors.reported_covariance(bundle)
    )
    return tables["parameters"].assign(
        determined=[*is_determined(from_bundle(bundle)), *trajectory_errors.is_determined(bundle)],
        correlation=related[np.arange(len(listed)), most],
        correlated_with=[listed[j].full_name for j in most],
    )


def correlations(bundle: Bundle) -> pd.DataFrame:
    """Return the correlation matrix of the wanted unknowns, with their names."""
    names = [p.full_name for p in unknowns(bundle)]
    related = correlation(trajectory_errors.reported_covariance(bundle))
    return pd.DataFrame(related, index=names, columns=names)


def correlation_table(design: Design) -> pd.DataFrame:
    """Return the correlations of the wanted unknowns, with the columns of covariance.csv."""
    return _matrices(design, lambda bundle: correlations(bundle).to_numpy())


def covariance_table(design: Design) -> pd.DataFrame:
    """Return the covariances of the wanted unknowns, with the columns of covariance.csv."""
    return _matrices(design, trajectory_errors.reported_covariance)


def _matrices(design: Design, of: Callable[[Bundle], Array]) -> pd.DataFrame:
    """Return a matrix of the wanted unknowns of every method as rows."""
    parts = [
        parameter_tables("mounting", method, unknowns(m.bundle), of(m.bundle))["covariance"]
        for method, m in design.mountings.items()
    ]
    return pd.concat(parts) if parts else pd.DataFrame(columns=[*COLUMNS["covariance"]])


def reliability_table(design: Design) -> pd.DataFrame:
    """Return what tests find in every group of observations, and what they leave.

    Returns
    -------
    DataFrame
        A row for each component. Detectable errors have the unit of the component; the effect is
        the largest on a parameter, in its sigmas.
    """
    rows = []
    for method, mounting in design.mountings.items():
        for found in detectable(mounting.bundle):
            bias = unit_of(found.kind, found.component) * found.bias
            rows.append(
                (
                    method,
                    found.kind,
                    COMPONENTS[found.kind][found.component],
                    len(bias),
                    float(found.redundancy.min()),
                    float(np.median(found.redundancy)),
                    float(np.median(bias)),
                    float(bias.max()),
                    found.effect,
                    _reported(found.on),
                )
            )
    return pd.DataFrame(rows, columns=list(RELIABILITY))


def _reported(name: str) -> str:
    """Return a column's name as results have it."""
    camera, _, key = name.rpartition("/")
    return f"{camera}/{REPORTED[key][0]}" if name else ""


def check_point_table(design: Design) -> pd.DataFrame:
    """Return the predicted sigma of the differences at check points, from all their rays."""
    columns = ["method", "point", "n_images", *(f"sigma_{axis}" for axis in AXES)]
    rows = []
    for method, validation in design.validations.items():
        block, points = validation.block, validation.points
        names = [block.points[i] for i in block.check.point_idx[points.point_idx]]
        rows += [
            (method, name, int(n), *sigma)
            for name, n, sigma in zip(names, points.n_images, points.sigma, strict=True)
        ]
    return pd.DataFrame(rows, columns=columns)


def predicted(validation: Validation) -> dict[str, Budget]:
    """Return the error budgets of differences at check points: of all rays, and of pairs of rays.

    Returns
    -------
    dict of str to Budget
        ``points`` and ``pairs``; the `rms` of each is what is expected.
    """
    layout = validation.georeferenced.layout
    parts = {"points": validation.points, "pairs": validation.pairs}
    return {name: budget.of(found.sources, layout) for name, found in parts.items()}


def sentences(design: Design) -> list[str]:
    """Return one sentence per unknown that the design does not determine: why, and the cure."""
    out = []
    for method, mounting in design.mountings.items():
        bundle = mounting.bundle
        lines = not_determined(from_bundle(bundle), features(bundle.network.block))
        lines += trajectory_errors.not_determined(bundle)
        out += [f"mounting/{method}: {line}" for line in lines]
    return out


def notes(design: Design) -> list[str]:
    """Return a sentence on each block that is not where its CRS is meant for, or misses points.

    Surveyed points that no image shows, and that so determine nothing.
    """
    out = [*area_notes(design.plan.setup.grid, dict(design.blocks))]
    for name, planned in design.plan.blocks.items():
        block, n = design.blocks[name], len(ground.places(planned.points))
        what = "check points" if name == "validation" else "control points"
        shown = len(block.check if name == "validation" else block.control)
        if shown < n:
            out.append(f"{name}: {n - shown} of {n} planned {what} are in no image")
    return out


def summary(design: Design) -> dict[str, Any]:
    """Return what a plan determines, for JSON."""
    return {
        "name": design.plan.setup.name,
        "flying_time_min": {
            name: flying_time_s(tuple(block.strips.values())) / 60
            for name, block in design.plan.blocks.items()
        },
        **{f"mounting/{name}": _adjusted(m.bundle) for name, m in design.mountings.items()},
        **{
            f"validation/{name}": {part: _predicted(b) for part, b in predicted(v).items()}
            for name, v in design.validations.items()
        },
        "not_determined": sentences(design),
        "notes": notes(design),
    }


def _predicted(found: Budget) -> dict[str, Any]:
    """Return the entries of a budget: number, RMS and shares of its groups, by axis."""
    parts = budget.shares(found.mean)
    return {
        "n": len(found),
        "rms": found.rms.tolist(),
        "shares": {group: share.tolist() for group, share in parts.items()},
    }


def _adjusted(bundle: Bundle) -> dict[str, Any]:
    block, solution = bundle.network.block, bundle.solution
    return {
        "n_images": len(block.images),
        "n_control_points": len(bundle.network.control),
        "n_observations": solution.n_observations,
        "n_unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        **determination.as_json(bundle, from_bundle(bundle)),
    }
