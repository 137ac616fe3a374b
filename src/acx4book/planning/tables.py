"""Predicted accuracies of a plan: as tables, as entries of a summary, as lines for the screen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from acx4book.planning import plan
from acx4book.planning.design import PARTS, Design, Expected, Outcome
from acx4book.planning.flown import flying_time_s
from acx4book.planning.plan import PlannedBlock
from acx4files.flight.reader import area_notes
from acx4files.results.rows import parameter_tables, unit_of
from acx4files.results.table_files import COLUMNS, COMPONENTS
from acx4lib.block import Block
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import determination, trajectory_errors
from acx4lib.calibration.determination import detectable
from acx4lib.calibration.estimates import (
    Calibration,
    Parameter,
    features,
    from_bundle,
    is_determined,
    not_determined,
    parameters,
)
from acx4lib.expected import Array
from acx4lib.geometry.parameters import REPORTED
from acx4lib.georeferencing import budget, weak
from acx4lib.georeferencing.weak import Weak
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


def unknowns(bundle: Bundle) -> list[Parameter]:
    """Return the wanted unknowns of a bundle: those of the cameras, then errors of GNSS."""
    return [*parameters(from_bundle(bundle)), *trajectory_errors.parameters(bundle)]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Predicted:
    """The wanted unknowns of one method, on average over the winds.

    Attributes
    ----------
    bundle : Bundle
        Of one wind.
    calibration : Calibration
    cov : ndarray, shape (n, n)
        As `trajectory_errors.reported_covariance` has it.
    spread : ndarray, shape (n,)
        By what share sigma differs from flight to flight.
    """

    bundle: Bundle
    calibration: Calibration
    cov: Array
    spread: Array

    @property
    def listed(self) -> list[Parameter]:
        """The unknowns, with sigma a priori."""
        of_trajectory = trajectory_errors.parameters(self.bundle, self.cov)
        return [*parameters(self.calibration), *of_trajectory]

    @property
    def determined(self) -> list[bool]:
        """Whether each is determined."""
        of_trajectory = trajectory_errors.is_determined(self.bundle, self.cov)
        return [*is_determined(self.calibration), *of_trajectory]

    @property
    def related(self) -> Array:
        """Correlations, shape (n, n)."""
        return correlation(self.cov)


def _predicted(design: Design, method: str) -> _Predicted:
    """Return the wanted unknowns of a method."""
    bundle = design.mountings[method].bundle
    open_columns = [outcome.open[method] for outcome in design.outcomes]
    cov = np.mean([outcome.calibrations[method] for outcome in design.outcomes], axis=0)
    return _Predicted(
        bundle=bundle,
        calibration=replace(
            from_bundle(bundle), cov=cov, open_columns=np.any(open_columns, axis=0)
        ),
        cov=_mean_covariance(design.outcomes, method),
        spread=_spread(design.outcomes, method),
    )


def _spread(outcomes: Sequence[Outcome], method: str) -> Array:
    """Return the relative spread of the unknowns' sigma over the winds, shape (n,)."""
    sigma = np.array([sigmas(outcome.covariances[method]) for outcome in outcomes])
    mean = sigma.mean(axis=0)
    return sigma.std(axis=0, ddof=1) / mean if len(sigma) > 1 else np.full(len(mean), np.nan)


def _mean_covariance(outcomes: Sequence[Outcome], method: str) -> Array:
    """Return the mean covariance of the wanted unknowns, shape (n, n)."""
    return np.mean([outcome.covariances[method] for outcome in outcomes], axis=0)


def parameter_table(design: Design) -> pd.DataFrame:
    """Return the wanted unknowns of all methods, with the columns of parameters.csv and some more.

    Returns
    -------
    DataFrame
        `value` is the plan's, and sigma a priori, infinite where the design says nothing.
        `determined` says whether the design determines it; `spread` by what share sigma differs
        from flight to flight; `detectable_change` is the smallest that a second campaign of the
        same plan finds in 80 %; `correlation` is the largest, and `correlated_with` the unknown
        that it is with.
    """
    parts = [_parameters(method, _predicted(design, method)) for method in design.mountings]
    return pd.concat(parts) if parts else pd.DataFrame(columns=[*COLUMNS["parameters"], *ADDED])


def _parameters(method: str, predicted: _Predicted) -> pd.DataFrame:
    listed = predicted.listed
    related = predicted.related.copy()
    np.fill_diagonal(related, 0.0)
    most = np.argmax(np.abs(related), axis=1)
    tables = parameter_tables("mounting", method, listed, predicted.cov)
    return tables["parameters"].assign(
        determined=predicted.determined,
        spread=predicted.spread,
        detectable_change=[_smallest_change(p.sigma) for p in listed],
        correlation=related[np.arange(len(listed)), most],
        correlated_with=[listed[j].full_name for j in most],
    )


def _smallest_change(sigma: float) -> float:
    """Return the change of a parameter that a second campaign of the same plan finds in 80 %.

    The difference of two independent campaigns has the variance 2 sigma^2. It is tested alone, two
    sided, at 5 %, with covariances a priori.
    """
    both = -norm_ppf(FOUND_AT / 2) + norm_ppf(POWER)
    return float(both * np.sqrt(2) * sigma)


def correlation_table(design: Design) -> pd.DataFrame:
    """Return the correlations of the wanted unknowns, with the columns of covariance.csv."""
    return _matrices(design, lambda predicted: predicted.related)


def covariance_table(design: Design) -> pd.DataFrame:
    """Return the covariances of the wanted unknowns, with the columns of covariance.csv."""
    return _matrices(design, lambda predicted: predicted.cov)


def _matrices(design: Design, matrix_of: Callable[[_Predicted], Array]) -> pd.DataFrame:
    """Return a matrix of the wanted unknowns of every method as rows."""
    parts = []
    for method in design.mountings:
        predicted = _predicted(design, method)
        tables = parameter_tables("mounting", method, predicted.listed, matrix_of(predicted))
        parts.append(tables["covariance"])
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
                    _reported(error.on),
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
    for method in design.validations:
        by_wind = [outcome.points[method] for outcome in design.outcomes]
        for name in dict.fromkeys(name for points in by_wind for name in points):
            variance = np.mean([points[name] for points in by_wind if name in points], axis=0)
            n = np.mean([outcome.n_rays[method].get(name, 0) for outcome in design.outcomes])
            rows.append((method, name, round(float(n), 1), *np.sqrt(variance)))
    return pd.DataFrame(rows, columns=columns)


def _expected_rms(outcomes: Sequence[Outcome], method: str) -> dict[str, Expected]:
    """Return the expected RMS at check points, by `PARTS`."""
    by_part = {}
    for part in PARTS:
        variances = np.array([outcome.variances[method][part] for outcome in outcomes])
        known = variances[np.isfinite(variances).all(axis=(1, 2))]
        by_part[part] = Expected(
            n=float(np.mean([outcome.counts[method][part] for outcome in outcomes])),
            variance=known.mean(axis=0) if len(known) else np.full(variances.shape[1:], np.nan),
            of_winds=known.sum(axis=-1),
        )
    return by_part


def sentences(design: Design) -> list[str]:
    """Return one sentence per unknown that the design does not determine: why, and the cure."""
    out = []
    for method, mounting in design.mountings.items():
        predicted, has = _predicted(design, method), features(mounting.bundle.network.block)
        lines = not_determined(predicted.calibration, has)
        lines += trajectory_errors.not_determined(predicted.bundle, predicted.cov)
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
        network = mounting.bundle.network
        lines = weak.sentences(
            _weak(design, method),
            features(network.block),
            late=bool(network.layout.delay[0] >= 0),
        )
        out += [f"mounting/{method}: {line}" for line in lines]
    return out


def _weak(design: Design, method: str) -> list[Weak]:
    """Return the weakly determined parameters, with sigma of the mean of winds."""
    bundle, mean = design.mountings[method].bundle, _predicted(design, method)
    shares, where = _mean_shares(design.outcomes, method), weak.CHECK_POINTS
    if shares is None:
        shares = weak.shares_at_corners(mean.calibration, bundle.network.block)
        where = weak.CORNERS
    weaknesses = [
        *weak.of_calibration(mean.calibration, shares, of=where),
        *weak.of_bundle(bundle, from_bundle(bundle)),
    ]
    named = {p.full_name: p for p in mean.listed}
    return [replace(w, parameter=named[w.parameter.full_name]) for w in weak.together(weaknesses)]


def _mean_shares(outcomes: Sequence[Outcome], method: str) -> Array | None:
    """Return the mean of `weak.shares`; None where there are no check points."""
    shares = [outcome.shares[method] for outcome in outcomes if method in outcome.shares]
    return np.mean(shares, axis=0) if shares else None


def summary(design: Design) -> dict[str, Any]:
    """Return the predicted accuracies of a plan, for JSON."""
    return {
        "name": design.plan.setup.name,
        "winds": len(design.outcomes),
        "flying_time_min": {
            name: flying_time_s(tuple(block.strips.values())) / 60
            for name, block in design.plan.blocks.items()
        },
        **{f"mounting/{name}": _adjusted(design, name) for name in design.mountings},
        **{
            f"validation/{name}": {
                part: _of_check_points(expected_rms)
                for part, expected_rms in _expected_rms(design.outcomes, name).items()
            }
            for name in design.validations
        },
        "not_determined": sentences(design),
        "notes": _notes(design),
        "weak": _weak_sentences(design),
    }


def _of_check_points(expected_rms: Expected) -> dict[str, Any]:
    """Return entries of an expected RMS: number, RMS, tolerance, spread, shares, by axis."""
    parts = budget.shares(expected_rms.variance)
    many = len(expected_rms.of_winds) > 1
    return {
        "n": round(expected_rms.n, 1),
        "rms": expected_rms.rms.tolist(),
        "tolerance": expected_rms.tolerance.tolist() if many else None,
        "spread": expected_rms.spread.tolist() if many else None,
        "shares": {group: share.tolist() for group, share in parts.items()},
    }


def _adjusted(design: Design, method: str) -> dict[str, Any]:
    bundle = design.mountings[method].bundle
    block, solution = bundle.network.block, bundle.solution
    return {
        "n_images": len(block.images),
        "n_control_points": len(bundle.network.control),
        "n_observations": solution.n_observations,
        "n_unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        **determination.as_json(bundle, _predicted(design, method).calibration),
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
    n = len(design.outcomes)
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
    weakest = determination.weakest_combination(bundle)
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
        for part, expected_rms in _expected_rms(design.outcomes, method).items():
            rows.append(
                (f"{expected_rms.n:.0f} {part}", *(f"{value:.3f}" for value in expected_rms.rms))
            )
            if len(expected_rms.of_winds) > 1:
                rows.append(
                    ("  of many flights, within", *(f"{x:.0%}" for x in expected_rms.tolerance))
                )
                rows.append(
                    ("  of one flight, by its wind", *(f"{x:.0%}" for x in expected_rms.spread))
                )
            for group, share in budget.shares(expected_rms.variance).items():
                rows.append((f"  of its square, {group}", *(f"{x:.0%}" for x in share)))
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
