"""The estimated parameters, their significance and their correlations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from acx4book.report.material import Material
from acx4lib.calibration.joint_tests import GroupTest, group_tests, undistorted
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.parameters import BORESIGHT_ANGLES, MOUNT, REPORTED
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import correlation
from acx4lib.results import folder
from acx4lib.results.read_back import read_calibration

STRONG = 0.9
"""Correlation above which two parameters can hardly be separated."""

SIGNIFICANCE = 0.05
"""Error probability of every test of the report, two-sided; divided among combined tests."""

FROM_DECLARED = ("f", *MOUNT)
"""Parameters for which zero has no meaning: they stand beside their declared values.

Without sigma these are approximations, and a difference from them is no mistake; with sigma the
verdict tests them.
"""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One estimated parameter with its test.

    Attributes
    ----------
    camera, parameter, unit : str
        Names as in the results.
    value, sigma : float
    reference : float
        Zero, or the declared value of `FROM_DECLARED`.
    t, critical : float
        (value - reference) / sigma, and its critical value.
    strongest : str
        ``camera/parameter`` with the largest correlation; empty if there is no other parameter.
    rho : float
        This correlation.
    """

    camera: str
    parameter: str
    unit: str
    value: float
    sigma: float
    reference: float
    t: float
    critical: float
    strongest: str
    rho: float

    @property
    def significant(self) -> bool | None:
        """Whether it differs from zero by more than chance explains; None beside a declared one."""
        declared = any(REPORTED[key][0] == self.parameter for key in FROM_DECLARED)
        return None if declared else abs(self.t) > self.critical


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two parameters, ``camera/parameter``, and their correlation."""

    one: str
    other: str
    rho: float


def estimates(material: Material, stage_method: str) -> list[Estimate]:
    """Return a method's parameters with their tests.

    Parameters
    ----------
    material : Material
    stage_method : str
    """
    rows = folder.rows(material.found, "parameters", stage_method)
    related = correlations(material, stage_method)
    critical = statistics.t_ppf(1 - SIGNIFICANCE / 2, _redundancy(material, stage_method))
    return [
        _estimate(material, row, related=related, critical=critical) for _, row in rows.iterrows()
    ]


def _estimate(
    material: Material, row: pd.Series, *, related: pd.DataFrame, critical: float
) -> Estimate:
    camera, name = str(row["camera"]), str(row["parameter"])
    value, sigma = float(row["value"]), float(row["sigma"])
    reference = _reference(material, camera, name)
    off = value - reference
    if name in BORESIGHT_ANGLES:
        off = (off + 180.0) % 360.0 - 180.0
    strongest, rho = _strongest(related, f"{camera}/{name}" if camera else name)
    return Estimate(
        camera=camera,
        parameter=name,
        unit=str(row["unit"]),
        value=value,
        sigma=sigma,
        reference=reference,
        t=off / sigma if sigma > 0 else np.nan,
        critical=critical,
        strongest=strongest,
        rho=rho,
    )


def _reference(material: Material, camera: str, name: str) -> float:
    """Return the value against which a parameter is tested."""
    key = next((key for key, (reported, _) in REPORTED.items() if reported == name), "")
    return _declared(material, camera, key) if key in FROM_DECLARED else 0.0


def _declared(material: Material, name: str, key: str) -> float:
    camera = material.flight.cameras[name]
    if key in INTERIOR:
        return float(camera.interior.to_array()[INTERIOR.index(key)])
    mounting = np.concatenate([camera.T_b_c.r, np.degrees(camera.T_b_c.opk)])
    return float(mounting[MOUNT.index(key)]) + 0.0  # avoids minus zero


def _redundancy(material: Material, stage_method: str) -> int:
    """Return the smallest redundancy of a method's adjustments, but at least one."""
    said = [
        int(str(material.found.summary[name]["redundancy"]))
        for name in material.adjustments
        if f"{name}/".startswith(f"{stage_method}/")
    ]
    return max(1, min(said, default=1))


def joint_tests(material: Material, stage_method: str) -> list[GroupTest]:
    """Return the tests of a method's parameters by groups, against zero."""
    names = folder.cameras(material.found, stage_method)
    cameras = [material.flight.cameras[name] for name in names]
    calibration = read_calibration(material.found, stage_method, cameras)
    found = group_tests(
        calibration,
        [undistorted(camera) for camera in cameras],
        redundancy=_redundancy(material, stage_method),
    )
    return [test for test in found if not set(test.keys) <= set(FROM_DECLARED)]


def _strongest(related: pd.DataFrame, label: str) -> tuple[str, float]:
    """Return the parameter with the largest correlation with another, and this correlation."""
    if label not in related.index or len(related) < 2:
        return "", np.nan
    names = list(related.index)
    own = names.index(label)
    rho = related.to_numpy()[own].copy()
    rho[own] = 0.0
    k = int(np.argmax(np.abs(rho)))
    return str(names[k]), float(rho[k])


def correlations(material: Material, stage_method: str) -> pd.DataFrame:
    """Return the correlations of a method's parameters, named ``camera/parameter``."""
    cov = folder.covariance(material.found, stage_method)
    values = correlation(cov.to_numpy()) if len(cov) else np.zeros((0, 0))
    return pd.DataFrame(values, index=cov.index, columns=cov.index)


def strong_pairs(material: Material, stage_method: str) -> list[Pair]:
    """Return the pairs of parameters that correlate by more than `STRONG`, the largest first."""
    related = correlations(material, stage_method)
    values, names = related.to_numpy(), [str(name) for name in related.index]
    found = [
        Pair(one=names[i], other=names[j], rho=float(values[i, j]))
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True)
        if abs(values[i, j]) > STRONG
    ]
    return sorted(found, key=lambda pair: -abs(pair.rho))
