"""Predicted accuracies of a plan: as tables, as entries of a summary, as lines for the screen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from acx4book.planning import plan
from acx4book.planning.design import Design
from acx4book.planning.flown import flying_time_s
from acx4book.planning.plan import PlannedBlock
from acx4files.flight.reader import area_notes
from acx4files.results import sentences as messages
from acx4files.results.folder import COLUMNS, COMPONENTS
from acx4files.results.tables import parameter_tables, record, unit_of
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import diagnosis, trajectory_errors
from acx4lib.calibration.determination import detectable
from acx4lib.calibration.estimates import (
    Parameter,
    features,
    from_bundle,
    is_determined,
    parameters,
)
from acx4lib.expected import Array
from acx4lib.geometry.parameters import REPORTED
from acx4lib.georeferencing import budget
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.least_squares.statistics import norm_ppf

# --- Predicted accuracies as tables and as entries of a summary


AXES = ("east_m", "north_m", "height_m")

ADDED = ("determined", "spread", "detectable_change", "correlation", "correlated_with")
"""Columns of `parameter_table` that parameters.csv of a run does not have."""

FOUND_AT, POWER = 0.05, 0.8
"""Significance and power with which a later campaign finds a change."""

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

PARTS = ("points", "pairs")
"""Differences at check points: from all rays of a point, and from every pair of them."""


def unknowns(bundle: Bundle) -> list[Parameter]:
    """Return the wanted unknowns of a bundle: those of the cameras, then errors of GNSS."""
    return [*parameters(from_bundle(bundle)), *trajectory_errors.parameters(bundle)]


def _listed(design: Design, method: str, cov: Array) -> list[Parameter]:
    """Return the unknowns of a method with sigma a priori, the mean of winds."""
    of_trajectory = trajectory_errors.parameters(design.mountings[method].bundle, cov)
    return [*parameters(design.calibration(method)), *of_trajectory]


def parameter_table(design: Design) -> pd.DataFrame:
    """Return the wanted unknowns of all methods, with the columns of parameters.csv and some more.

    Returns
    -------
    DataFrame
        `value` is the plan's, and sigma a priori, infinite where the design says nothing.
        `determined` says whether the design determines it; `spread` by what share sigma differs
        from flight to flight; `detectable_change` is the smallest that a second campaign of the
        same plan finds in 80 %, tested alone at 5 %; `correlation` is the largest, and
        `correlated_with` the unknown that it is with.
    """
    parts = [_parameters(design, method) for method in design.mountings]
    return pd.concat(parts) if parts else pd.DataFrame(columns=[*COLUMNS["parameters"], *ADDED])


def _parameters(design: Design, method: str) -> pd.DataFrame:
    of_winds = design.covariances(method)
    cov = of_winds.mean(axis=0)
    listed = _listed(design, method, cov)
    table = record(f"mounting/{method}", parameter_tables(listed, cov), {}).tables["parameters"]
    if not listed:
        return table.reindex(columns=[*table.columns, *ADDED])
    related = correlation(cov) - np.eye(len(cov))
    most = np.argmax(np.abs(related), axis=1)
    sigma = np.array([sigmas(one) for one in of_winds])
    several = len(sigma) > 1
    # the difference of two campaigns has the variance 2 sigma^2
    change = np.sqrt(2) * (norm_ppf(POWER) - norm_ppf(FOUND_AT / 2))
    bundle = design.mountings[method].bundle
    return table.assign(
        determined=[
            *is_determined(design.calibration(method)),
            *trajectory_errors.is_determined(bundle, cov),
        ],
        spread=sigma.std(axis=0, ddof=1) / sigma.mean(axis=0) if several else np.nan,
        detectable_change=change * table["sigma"],
        correlation=related[np.arange(len(listed)), most],
        correlated_with=[listed[j].full_name for j in most],
    )


def covariance_table(design: Design) -> pd.DataFrame:
    """Return the covariances of the wanted unknowns, with the columns of covariance.csv."""
    parts = []
    for method in design.mountings:
        cov = design.covariances(method).mean(axis=0)
        listed = _listed(design, method, cov)
        made = record(f"mounting/{method}", parameter_tables(listed, cov), {})
        parts.append(made.tables["covariance"])
    return pd.concat(parts) if parts else pd.DataFrame(columns=[*COLUMNS["covariance"]])


def reliability_table(design: Design) -> pd.DataFrame:
    """Return detectable errors of every group of observations, and the effects of smaller ones.

    Returns
    -------
    DataFrame
        A row for each component. Detectable errors have the unit of the component; the effect is
        the largest on a parameter, in its sigmas.
    """
    rows = []
    for method, mounting in design.mountings.items():
        for error in detectable(mounting.bundle):
            camera, _, key = error.on.rpartition("/")
            bias = unit_of(error.kind, error.component) * error.bias
            rows.append(
                (
                    method,
                    error.kind,
                    COMPONENTS[error.kind][error.component],
                    len(bias),
                    float(error.redundancy.min()),
                    float(np.median(error.redundancy)),
                    float(np.median(bias)),
                    float(bias.max()),
                    error.effect,
                    f"{camera}/{REPORTED[key][0]}" if key else "",
                )
            )
    return pd.DataFrame(rows, columns=list(RELIABILITY))


def check_point_table(design: Design) -> pd.DataFrame:
    """Return the predicted sigma of the differences at check points, from all their rays."""
    rows = []
    for method in design.validations:
        found: dict[str, list[Array]] = {}
        for wind in design.winds:
            validation = wind.validations[method]
            block, points = validation.block, validation.points
            for k, i in enumerate(block.check.point_idx[points.point_idx]):
                row = np.append(points.n_images[k], points.sigma[k] ** 2)
                found.setdefault(block.points[i], []).append(row)
        for name, of_winds in found.items():
            n = sum(one[0] for one in of_winds) / len(design.winds)
            variance = np.mean(of_winds, axis=0)[1:]
            rows.append((method, name, round(float(n), 1), *np.sqrt(variance)))
    columns = ["method", "point", "n_images", *(f"sigma_{axis}" for axis in AXES)]
    return pd.DataFrame(rows, columns=columns)


def _expected_rms(design: Design, method: str, part: str) -> dict[str, Any]:
    """Return the expected RMS of differences at check points, m, by axis.

    Returns
    -------
    dict
        Number of differences, `rms` of many flights, its `tolerance` (two relative standard
        deviations of the mean of winds; None in one wind), `spread` of single flights by their
        wind, and `shares` of the square by group of sources.
    """
    budgets = [
        budget.of(getattr(v, part).sources, v.georeferenced.layout)
        for v in (wind.validations[method] for wind in design.winds)
    ]
    variances = np.array([one.mean for one in budgets])
    known = variances[np.isfinite(variances).all(axis=(1, 2))]
    mean = known.mean(axis=0) if len(known) else np.full(variances.shape[1:], np.nan)
    of_winds = known.sum(axis=-1)
    spread = None
    if len(of_winds) > 1:  # the relative error of a root is half of that of its square
        spread = 0.5 * of_winds.std(axis=0, ddof=1) / of_winds.mean(axis=0)
    return {
        "n": round(float(np.mean([len(one) for one in budgets])), 1),
        "rms": np.sqrt(mean.sum(axis=-1)).tolist(),
        "tolerance": None if spread is None else (2 * spread / np.sqrt(len(of_winds))).tolist(),
        "spread": None if spread is None else spread.tolist(),
        "shares": {group: share.tolist() for group, share in budget.shares(mean).items()},
    }


def sentences(design: Design) -> list[str]:
    """Return one sentence per unknown that the design does not determine: why, and the cure."""
    out = []
    for method, mounting in design.mountings.items():
        cov = design.covariances(method).mean(axis=0)
        has = features(mounting.bundle.network.block)
        lines = messages.not_determined(design.calibration(method), has)
        lines += messages.trajectory_not_determined(mounting.bundle, cov)
        out += [f"mounting/{method}: {line}" for line in lines]
    return out


def _notes(design: Design) -> list[str]:
    """Return a sentence on each block that is not where its CRS is meant for, or misses points."""
    out = [*area_notes(design.plan.setup.grid, dict(design.blocks))]
    for name, planned in design.plan.blocks.items():
        block, n = design.blocks[name], len(plan.places(planned.points))
        kind = "check points" if name == "validation" else "control points"
        shown = len(block.check if name == "validation" else block.control)
        if shown < n:
            out.append(f"{name}: {n - shown} of {n} planned {kind} are in no image")
    return out


def _weak_sentences(design: Design) -> list[str]:
    """Return one sentence per unknown that is determined, but weakly: why, and the cure."""
    out = []
    for method, mounting in design.mountings.items():
        network, mean = mounting.bundle.network, design.calibration(method)
        of_winds = [
            budget.parameter_shares(
                wind.validations[method].points.sources, wind.calibrations[method]
            )
            for wind in design.winds
            if method in wind.validations
        ]
        known = [share for share in of_winds if share is not None]
        if known:
            shares, where = np.mean(known, axis=0), diagnosis.CHECK_POINTS
        else:
            shares, where = budget.shares_at_corners(mean, network.block), diagnosis.CORNERS
        weaknesses = diagnosis.of(mounting.bundle).weak(shares, of=where)
        listed = _listed(design, method, design.covariances(method).mean(axis=0))
        named = {p.full_name: p for p in listed}
        weaknesses = [replace(w, parameter=named[w.parameter.full_name]) for w in weaknesses]
        late = bool(network.layout.delay[0] >= 0)
        lines = messages.weak(weaknesses, features(network.block), late=late)
        out += [f"mounting/{method}: {line}" for line in lines]
    return out


def summary(design: Design) -> dict[str, Any]:
    """Return the predicted accuracies of a plan, for JSON."""
    return {
        "name": design.plan.setup.name,
        "winds": len(design.winds),
        "flying_time_min": {
            name: flying_time_s(tuple(block.strips.values())) / 60
            for name, block in design.plan.blocks.items()
        },
        **{f"mounting/{name}": _counts(design, name) for name in design.mountings},
        **{
            f"validation/{name}": {part: _expected_rms(design, name, part) for part in PARTS}
            for name in design.validations
        },
        "not_determined": sentences(design),
        "notes": _notes(design),
        "weak": _weak_sentences(design),
    }


def _counts(design: Design, method: str) -> dict[str, Any]:
    bundle = design.mountings[method].bundle
    found = diagnosis.of(bundle, design.calibration(method))
    return {
        "n_images": len(bundle.network.block.images),
        "n_control_points": len(bundle.network.control),
        "n_observations": bundle.solution.n_observations,
        "n_unknowns": bundle.solution.n_unknowns,
        "redundancy": bundle.solution.redundancy,
        "condition": bundle.solution.condition,
        "weakest": {part.unknown: part.share for part in found.weakest},
        "correlated": [[pair.row, pair.column, pair.correlation] for pair in found.correlated],
    }


# --- Predicted accuracies as lines of text for the screen


SAID = {
    "image_point": "image points",
    "control_point": "control points",
    "gnss": "GNSS positions",
    "attitude": "attitudes",
    "lever_arm": "surveyed lever arm",
    "boresight": "declared boresight",
    "interior": "declared interior orientation",
}
"""Names of the groups of observations."""


def lines(design: Design) -> Iterator[str]:
    """Yield the lines that `acx4 plan` prints."""
    n = len(design.winds)
    over = f"the mean of {n} winds" if n > 1 else "one wind"
    yield f"{design.plan.setup.name}: predicted from geometry alone, sigma0 = 1, {over}"
    for name, block in design.plan.blocks.items():
        yield from _block_lines(block, design.blocks[name])
    parameters, reliability = parameter_table(design), reliability_table(design)
    for method in design.mountings:
        yield from _method_lines(design, method, parameters[parameters["method"] == method])
        yield ""
        yield from _reliability_lines(reliability[reliability["method"] == method])
    yield from _validation_lines(design)
    for title, texts in (
        ("notes", _notes(design)),
        ("not determined", sentences(design)),
        ("weak", _weak_sentences(design)),
    ):
        if texts:
            yield from ("", title, *(f"  {line}" for line in texts))


def _block_lines(planned: PlannedBlock, block: Block) -> Iterator[str]:
    minutes = flying_time_s(tuple(planned.strips.values())) / 60
    yield ""
    yield f"block {planned.name}"
    yield (
        f"  {len(block.images)} images in {len(planned.strips)} strips, {minutes:.0f} minutes from "
        "the first to the last"
    )
    points = f"{len(block.control)} control points, {len(block.check)} check points"
    yield f"  {len(block.image_points)} measurements of {len(block.points)} points; {points}"


def _method_lines(design: Design, method: str, table: pd.DataFrame) -> Iterator[str]:
    bundle = design.mountings[method].bundle
    yield ""
    yield f"mounting/{method}"
    yield from _aligned(
        ("", "sigma", "detectable change", "unit", "correlation", "with"),
        [
            (
                _name(row["camera"], row["parameter"]),
                f"{row['sigma']:.3g}" + ("" if row["determined"] else " !"),
                f"{row['detectable_change']:.2g}",
                row["unit"],
                f"{round(row['correlation'], 2) + 0.0:+.2f}",
                row["correlated_with"],
            )
            for row in table.to_dict("records")
        ],
    )
    weakest = diagnosis.of(bundle).weakest
    parts = ", ".join(f"{part.unknown} {100 * part.share:.0f} %" for part in weakest)
    yield f"  weakest direction: {parts or 'several are left open altogether'}"


def _name(camera: str, parameter: str) -> str:
    return f"{camera} {parameter}" if camera else parameter


def _reliability_lines(table: pd.DataFrame) -> Iterator[str]:
    """Yield the errors that tests find with a probability of 80 %, and effects of smaller ones."""
    rows = []
    for row in table.to_dict("records"):
        axis, _, unit = row["component"].rpartition("_")
        rows.append(
            (
                f"{SAID[row['kind']]}, {axis}",
                f"{row['redundancy_median']:.2f}",
                f"{row['detectable_median']:.2g}",
                f"{row['detectable_largest']:.2g}",
                unit,
                f"{row['effect_sigmas']:.2f}",
                row["effect_on"],
            )
        )
    header = ("error of", "redundancy", "detectable", "at worst", "unit", "moves by sigma", "of")
    yield from _aligned(header, rows)


def _validation_lines(design: Design) -> Iterator[str]:
    """Yield the RMS of check points in metres, its tolerance, and the shares of its sources."""
    for method in design.validations:
        yield ""
        yield f"validation/{method}: predicted RMS of differences at check points, m"
        rows = []
        for part in PARTS:
            found = _expected_rms(design, method, part)
            rows.append((f"{found['n']:.0f} {part}", *(f"{value:.3f}" for value in found["rms"])))
            shown = {f"of its square, {group}": share for group, share in found["shares"].items()}
            if found["spread"]:
                shown = {
                    "of many flights, within": found["tolerance"],
                    "of one flight, by its wind": found["spread"],
                    **shown,
                }
            rows += [(f"  {name}", *(f"{x:.0%}" for x in values)) for name, values in shown.items()]
        yield from _aligned(("", "east", "north", "height"), rows)


def _aligned(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Yield a table with its first and last columns to the left if they are text."""
    whole = [header, *rows]
    widths = [max(len(row[k]) for row in whole) for k in range(len(header))]
    numeric = [all(_is_number(row[k]) for row in rows) for k in range(len(header))]
    for row in whole:
        cells = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width, right in zip(row, widths, numeric, strict=True)
        )
        yield f"  {'  '.join(cells)}".rstrip()


def _is_number(cell: str) -> bool:
    try:
        float(cell.removesuffix(" !").removesuffix("%"))
    except ValueError:
        return False
    return True
