"""The report for machines: the same values as JSON, with units in the names of the keys."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from acx4book.report import ground
from acx4book.report.adjustment import decisive_qualities
from acx4book.report.estimates import correlations
from acx4book.report.findings import FAILS, LEVEL, Finding
from acx4book.report.material import Material, validated
from acx4book.report.parameters import Lens, balanced, corners, lenses, profile
from acx4book.report.verdict import NOT_EXAMINED
from acx4lib.geometry.camera import INTERIOR, Camera, xy_from_colrow
from acx4lib.geometry.parameters import LEVER_ARM, REPORTED
from acx4lib.results import folder

FORMAT = 1
"""Of the file; raised when a key changes its meaning or goes."""

MARK = b'"made_by": "acx4 report"'
"""Mark of such a file, which may be replaced by a newer one."""

TESTS = (
    *("n_observations", "n_unknowns", "redundancy", "sigma0_squared", "chi_square_p"),
    *("n_rejected", "expected_rejections", "condition", "weakest", "declared"),
)
"""Entries of summary.json that are told of every adjustment."""


def text(material: Material, found: Sequence[Finding]) -> str:
    """Return the report as JSON; a number that is not known is null."""
    return json.dumps(_plain(record(material, found)), indent=1, ensure_ascii=False) + "\n"


def record(material: Material, found: Sequence[Finding]) -> dict[str, Any]:
    """Return the content of the report; book/results.md explains the keys."""
    flight, summary = material.flight, material.found.summary
    return {
        "made_by": "acx4 report",
        "format": FORMAT,
        "results_of": material.date.isoformat(),
        "flight": {
            "name": flight.name,
            "date": flight.session.date,
            "temperature_c": flight.session.temperature_c,
            "crs": flight.grid.crs,
            "sha256": material.provenance.digest,
            "files_sha256": dict(material.provenance.files),
        },
        "software": {n: dict(s["versions"]) for n, s in material.provenance.stages.items()},  # type: ignore[call-overload] # read from JSON
        "certificate": _stated(asdict(flight.certificate)),
        "statement": {
            "holds": not any(f.state == FAILS for f in found),
            "level": LEVEL,
            "procedure": "Holm",
            "findings": [_finding(f) for f in found],
            "not_examined": NOT_EXAMINED,
        },
        "calibration": material.calibration or None,
        "methods": {name: _method(material, name) for name in _methods(material)},
        "adjustments": {
            name: {key: summary[name].get(key) for key in TESTS} for name in material.adjustments
        },
        "groups": [asdict(quality) for quality in decisive_qualities(material)],
        "check_points": _checked(summary.get(validated(material), {})),
        "error_budget": ground.recorded(ground.mapped(material)),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    """Return a finding with its tests; p is the smallest, by itself and among all tests."""
    return {
        "question": finding.question,
        "state": finding.state,
        "p": finding.p,
        "p_joint": finding.p_joint,
        "tests": [
            {"name": t.name, "p": t.p, "p_joint": t.p_joint, "fails": t.fails}
            for t in finding.tests
        ],
    }


def _stated(value: dict[str, Any]) -> dict[str, Any]:
    """Return what is stated, without what is empty."""
    inner = {k: _stated(v) if isinstance(v, dict) else v for k, v in value.items()}
    return {key: one for key, one in inner.items() if one}


def _methods(material: Material) -> list[str]:
    heads = ["heads/bundle"] if folder.has(material.found, "heads/bundle") else []
    return [name for name in (material.calibration, *heads) if name]


def _method(material: Material, name: str) -> dict[str, Any]:
    cov, rho = folder.covariance(material.found, name), correlations(material, name)
    return {
        "cameras": {
            lens.camera.name: {**_camera(lens), "parameters": _parameters(material, name, lens)}
            for lens in lenses(material, name)
        },
        "parameters": list(cov.index),
        "covariance_matrix": cov.to_numpy(),
        "correlation_matrix": rho.to_numpy(),
    }


def _camera(lens: Lens) -> dict[str, Any]:
    camera, balance = lens.camera, balanced(lens)
    keys = ("col_px", "row_px", "x_mm", "y_mm")
    places = np.hstack([corners(camera), xy_from_colrow(camera, corners(camera))])
    return {
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "pixel_um": 1000 * camera.pixel_mm,
        "corners": pd.DataFrame(places, columns=keys),
        "interior": {REPORTED[key][0]: getattr(lens.interior, key) for key in INTERIOR},
        "balanced_f_mm": {"value": balance.f, "standard_deviation": balance.sigma},
        "distortion": profile(lens),
        "lever_surveyed_m": _surveyed(camera),
    }


def _surveyed(camera: Camera) -> dict[str, Any]:
    """Return the surveyed components of the lever arm by their names."""
    told = zip(LEVER_ARM, camera.prior.lever_declared, camera.T_b_c.r, strict=True)
    return {REPORTED[key][0]: float(value) for key, declared, value in told if declared}


def _parameters(material: Material, name: str, lens: Lens) -> dict[str, Any]:
    rows = folder.parameters(material.found, name, lens.camera.name)
    return {
        str(label): {
            "value": row["value"],
            "standard_deviation": row["sigma"],
            "unit": row["unit"],
        }
        for label, row in rows.iterrows()
    }


def _checked(entry: Mapping[str, Any]) -> dict[str, Any] | None:
    points = entry.get("points")
    if not isinstance(points, dict):
        return None
    return {
        "n_points": entry.get("n_points"),
        **{key: points.get(key) for key in ("mean", "std", "rms", "mean_sigma", "classes")},
        "joint_chi_square_p": entry.get("joint_chi_square_p"),
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it; numbers that are not finite become None."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, pd.DataFrame):
        return _plain(value.to_dict("records"))
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if isinstance(value, int | str | None) else str(value)  # a date
