"""Comparisons as tables for programs, in the units of results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from acx4lib.calibration.stability import Rigidity
from acx4lib.expected import Array, Index
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import sigmas
from acx4lib.least_squares.statistics import holm
from acx4tools.campaigns import comparison as campaigns_comparison
from acx4tools.campaigns.comparison import (
    Comparison,
    Difference,
    Ground,
    GroundEffects,
    JointTest,
    Trend,
)


def every(
    comparison: Comparison, found: Sequence[Difference], ground: Ground
) -> dict[str, pd.DataFrame]:
    """Return all tables of a comparison by the names of their files."""
    return {
        "campaigns": _campaigns(comparison),
        "tests": _tests(comparison, found, ground),
        "differences": _differences(comparison, found, ground),
        "pooled": _pooled(comparison),
        "trends": _trends(comparison),
        "covariance": _covariances(comparison, found),
    }


def _campaigns(comparison: Comparison) -> pd.DataFrame:
    """Return one row for each campaign, in the order of the comparison."""
    scaled = "a priori" if comparison.apriori else "a posteriori"
    return pd.DataFrame(
        [
            {
                "campaign": c.name,
                "date": str(c.session.date or ""),
                "temperature_c": c.session.temperature_c,
                "method": c.method,
                "flying_height_m": c.height_m,
                "redundancy": c.redundancy,
                "sigma0_squared": c.calibration.sigma0_sq,
                "chi_square_p": c.chi_square_p,
                "sigma": scaled,
            }
            for c in comparison.campaigns
        ]
    )


def _differences(
    comparison: Comparison, found: Sequence[Difference], ground: Ground
) -> pd.DataFrame:
    """Return one row for each parameter of each difference."""
    rows = [row for one in found for row in _difference_rows(comparison, one, ground)]
    table = pd.DataFrame(rows)
    return table.assign(p_joint=holm(table["p"].to_numpy()))[[*DIFFERENCES]]


DIFFERENCES = (
    *("earlier", "later", "camera", "parameter", "unit", "difference", "sigma", "t", "p"),
    *("p_joint", "ground_rms_m"),
)


def _difference_rows(
    comparison: Comparison, one: Difference, ground: Ground
) -> Iterator[dict[str, object]]:
    names = [c.name for c in comparison.campaigns]
    moved = np.full(len(one.d), np.nan)
    for camera, effects in ground.of.items():
        own = comparison.of_camera(camera)
        moved[own] = effects.rms(one.d[own])
    for i, parameter in enumerate(comparison.parameters):
        t = one.d[i] / one.sigma[i]
        yield {
            "earlier": names[one.earlier],
            "later": names[one.later],
            "camera": parameter.camera,
            "parameter": parameter.name,
            "unit": parameter.unit,
            "difference": one.d[i],
            "sigma": one.sigma[i],
            "t": t,
            "p": one.test([i]).p,
            "ground_rms_m": moved[i],
        }


def _tests(comparison: Comparison, found: Sequence[Difference], ground: Ground) -> pd.DataFrame:
    """Return the joint tests: stability, every difference whole and by parts, and trends."""
    rows = [_row(SAME, "", "all", campaigns_comparison.stability(comparison))]
    wholes, parts = [], []
    for one in found:
        title = f"{comparison.campaigns[one.later].name} - {comparison.campaigns[one.earlier].name}"
        wholes.append(_row(title, "", "all", one.test()))
        for camera, part, own in comparison.parts():
            joint = _joint_effect(comparison, one, ground.of[camera], camera, own)
            parts.append({**_row(title, camera, part, one.test(own)), **joint})
    rows += [*_at_joint_level(wholes), *_at_joint_level(parts)]
    for what, line in trends_of(comparison).items():
        rows.append(_row(f"no slope over {NOUN[what]}", "", "all", line.sloping))
        if line.scatter.dof:
            rows.append(_row(f"straight lines over {NOUN[what]}", "", "all", line.scatter))
    return pd.DataFrame(rows, columns=[*TESTS])


TESTS = (
    *("test", "camera", "part", "dof", "chi_square", "p", "p_joint"),
    *("ground_rms_m", "ground_sigma_m"),
)


def _row(test: str, camera: str, part: str, found: JointTest) -> dict[str, object]:
    return {
        "test": test,
        "camera": camera,
        "part": part,
        "dof": found.dof,
        "chi_square": found.chi_square,
        "p": found.p,
        "p_joint": found.p,
    }


def _at_joint_level(rows: Sequence[dict[str, object]]) -> list[dict[str, object]]:
    p = holm(np.array([row["p"] for row in rows], dtype=float))
    return [{**row, "p_joint": float(joint)} for row, joint in zip(rows, p, strict=True)]


def _joint_effect(
    comparison: Comparison, one: Difference, effects: GroundEffects, camera: str, own: Index
) -> dict[str, float]:
    """Return what the parameters of a part move together, and what chance would move."""
    part = effects.of(np.flatnonzero(np.isin(comparison.of_camera(camera), own)))
    moved, sigma = part.moved(one.d[own]), part.sigma(one.cov[np.ix_(own, own)])
    return {
        "ground_rms_m": float(np.sqrt(np.sum(moved**2, axis=1).mean())),
        "ground_sigma_m": float(np.sqrt(np.mean(sigma**2))),
    }


def _pooled(comparison: Comparison) -> pd.DataFrame:
    """Return one row for each parameter: its value from all campaigns, and whether it is stable."""
    found = campaigns_comparison.pooled(comparison)
    sigma = sigmas(found.cov[0, :, 0])
    alone = campaigns_comparison.stable(comparison)
    rows = [
        {
            "camera": p.camera,
            "parameter": p.name,
            "unit": p.unit,
            "value": found.coefficients[0, i],
            "sigma": sigma[i],
            "dof": alone[i].dof,
            "chi_square": alone[i].chi_square,
            "p": alone[i].p,
        }
        for i, p in enumerate(comparison.parameters)
    ]
    table = pd.DataFrame(rows)
    return table.assign(p_joint=holm(table["p"].to_numpy()))


def trends_of(comparison: Comparison) -> dict[str, Trend]:
    """Return the trends that can be computed, by what they are over: ``year``, ``temperature``.

    With two campaigns a line passes through both, and its slope is their difference; it is left
    out.
    """
    over = {
        "year": campaigns_comparison.years(comparison),
        "temperature": campaigns_comparison.temperatures(comparison),
    }
    enough = len(comparison.campaigns) > 2
    return {
        what: campaigns_comparison.trend(comparison, at)
        for what, at in over.items()
        if at is not None and enough
    }


NOUN = {"year": "time", "temperature": "temperature"}
SAME = "all campaigns the same"
"""Names of the tests that concern all campaigns: what is tested, and rejected where p is small."""

PER = {"year": "year", "temperature": "°C"}
"""What a slope is per."""


def _trends(comparison: Comparison) -> pd.DataFrame:
    """Return one row for each slope of each trend."""
    parts = [_slopes(comparison, what, line) for what, line in trends_of(comparison).items()]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*SLOPES])


SLOPES = ("over", "camera", "parameter", "unit", "slope", "sigma", "t", "p", "p_joint")


def _slopes(comparison: Comparison, what: str, line: Trend) -> pd.DataFrame:
    sigma = sigmas(line.cov)
    t = line.slope / sigma
    p = np.array([_two_sided(one, comparison.redundancy()) for one in t])
    return pd.DataFrame(
        {
            "over": what,
            "camera": [p.camera for p in comparison.parameters],
            "parameter": [p.name for p in comparison.parameters],
            "unit": [f"{p.unit} per {PER[what]}" for p in comparison.parameters],
            "slope": line.slope,
            "sigma": sigma,
            "t": t,
            "p": p,
            "p_joint": holm(p),
        }
    )


def _two_sided(t: float, redundancy: float) -> float:
    if np.isinf(redundancy):
        return 2 * statistics.norm_sf(abs(t))
    return 2 * statistics.t_sf(abs(t), redundancy)


def _covariances(comparison: Comparison, found: Sequence[Difference]) -> pd.DataFrame:
    """Return the joint covariances of the pooled values and of every difference."""
    names = [c.name for c in comparison.campaigns]
    listed = {"pooled": campaigns_comparison.pooled(comparison).cov[0, :, 0]}
    listed |= {f"{names[one.later]} - {names[one.earlier]}": one.cov for one in found}
    return pd.concat(
        [_long(of, comparison.names, cov) for of, cov in listed.items()], ignore_index=True
    )


def _long(of: str, names: Sequence[str], cov: Array) -> pd.DataFrame:
    n = len(names)
    return pd.DataFrame(
        {"of": of, "row": np.repeat(names, n), "column": np.tile(names, n), "value": cov.ravel()}
    )


def rigidity(found: Rigidity) -> pd.DataFrame:
    """Return one row for each exposure of a rig, and one for all.

    Returns
    -------
    DataFrame
        exposure (empty: all at once), dof, redundancy, f, p, p_joint (Holm, over the exposures),
        head (that turned by most of its sigma), turn_arcsec, sigma_arcsec (about the axis of
        which this is so).
    """
    rows = []
    for i, (name, test) in enumerate(zip(found.exposures, found.tests, strict=True)):
        with np.errstate(invalid="ignore"):
            t = np.abs(found.turns[i] / found.sigma[i])
        head, axis = np.unravel_index(np.nanargmax(t), t.shape)
        arcsec = np.degrees([found.turns[i, head, axis], found.sigma[i, head, axis]]) * 3600
        rows.append((name, test, found.p_joint[i], found.heads[head], *arcsec))
    rows.append(("", found.whole, found.whole.p, "", np.nan, np.nan))
    return pd.DataFrame(
        [
            (name, test.dof, test.redundancy, test.f, test.p, joint, head, turn, sigma)
            for name, test, joint, head, turn, sigma in rows
        ],
        columns=[
            *("exposure", "dof", "redundancy", "f", "p", "p_joint"),
            *("head", "turn_arcsec", "sigma_arcsec"),
        ],
    )
