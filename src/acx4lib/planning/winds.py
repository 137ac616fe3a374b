"""What a plan determines in several winds: its mean, and by how much one flight differs.

No aircraft flies twice alike. The mean of the variances in many winds is what flights of a plan
have on average; their scatter says by how much that mean, and one flight, may differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array, Mask
from acx4lib.georeferencing import budget, weak
from acx4lib.georeferencing.validation import Validation
from acx4lib.least_squares.covariance import sigmas

PARTS = ("points", "pairs")
"""Differences at check points: from all rays of a point, and from every pair of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What a plan determines in one wind.

    Attributes
    ----------
    covariances : dict of str to ndarray
        By method, of `trajectory_errors.reported_covariance`.
    calibrations : dict of str to ndarray
        By method, the covariances of the calibrations, in the library's units.
    open : dict of str to ndarray of bool
        By method, which columns of the calibrations are left open.
    variances : dict of str to dict of str to ndarray
        By method and `PARTS`, mean variances of differences by their sources, (3, n_sources), m^2.
    counts : dict of str to dict of str to int
        By method and `PARTS`, the number of differences.
    points : dict of str to dict of str to ndarray
        By method and check point, the variances of its differences, shape (3,), m^2.
    n_rays : dict of str to dict of str to int
        By method and check point, the number of its images.
    shares : dict of str to ndarray
        By method, as `weak.shares` returns them.
    """

    covariances: Mapping[str, Array]
    calibrations: Mapping[str, Array]
    open: Mapping[str, Mask]
    variances: Mapping[str, Mapping[str, Array]]
    counts: Mapping[str, Mapping[str, int]]
    points: Mapping[str, Mapping[str, Array]]
    n_rays: Mapping[str, Mapping[str, int]]
    shares: Mapping[str, Array]


def outcome(
    mountings: Mapping[str, Mounting],
    validations: Mapping[str, Validation],
    calibrations: Mapping[str, Calibration],
) -> Outcome:
    """Return what blocks in one wind determine.

    Parameters
    ----------
    mountings, validations : mapping
        By method.
    calibrations : mapping
        Those of the validations, by method.
    """
    named = {method: _names(validation) for method, validation in validations.items()}
    budgets = {
        method: {
            part: budget.of(getattr(v, part).sources, v.georeferenced.layout) for part in PARTS
        }
        for method, v in validations.items()
    }
    shares = {
        method: weak.shares(v.points.sources, calibrations[method])
        for method, v in validations.items()
    }
    return Outcome(
        covariances={
            method: trajectory_errors.reported_covariance(m.bundle)
            for method, m in mountings.items()
        },
        calibrations={method: m.calibration.cov for method, m in mountings.items()},
        open={method: m.calibration.open_columns for method, m in mountings.items()},
        variances={
            method: {part: b.mean for part, b in own.items()} for method, own in budgets.items()
        },
        counts={
            method: {part: len(b) for part, b in own.items()} for method, own in budgets.items()
        },
        points={
            method: dict(zip(named[method], v.points.sigma**2, strict=True))
            for method, v in validations.items()
        },
        n_rays={
            method: dict(zip(named[method], map(int, v.points.n_images), strict=True))
            for method, v in validations.items()
        },
        shares={method: own for method, own in shares.items() if own is not None},
    )


def _names(validation: Validation) -> list[str]:
    block, points = validation.block, validation.points
    return [block.points[i] for i in block.check.point_idx[points.point_idx]]


# --- means -----------------------------------------------------------------------------------


def mean_covariance(outcomes: Sequence[Outcome], method: str) -> Array:
    """Return the mean covariance of the wanted unknowns, shape (n, n)."""
    out: Array = np.mean([one.covariances[method] for one in outcomes], axis=0)
    return out


def spread(outcomes: Sequence[Outcome], method: str) -> Array:
    """Return by what share sigma of the wanted unknowns differs from wind to wind, shape (n,)."""
    found = np.array([sigmas(one.covariances[method]) for one in outcomes])
    mean = found.mean(axis=0)
    out: Array = found.std(axis=0, ddof=1) / mean if len(found) > 1 else np.full(len(mean), np.nan)
    return out


def mean_shares(outcomes: Sequence[Outcome], method: str) -> Array | None:
    """Return the mean of `weak.shares`; None where there are no check points."""
    found = [one.shares[method] for one in outcomes if method in one.shares]
    return np.mean(found, axis=0) if found else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Expected:
    """The RMS of differences at check points that is to be expected.

    Attributes
    ----------
    n : float
        Mean number of differences in a flight.
    variance : ndarray, shape (3, n_sources)
        Mean of all winds, m^2.
    of_winds : ndarray, shape (n_winds, 3)
        Mean variances of each wind, m^2.
    """

    n: float
    variance: Array
    of_winds: Array

    @property
    def rms(self) -> Array:
        """RMS of many flights, shape (3,), m."""
        return np.sqrt(self.variance.sum(axis=-1))

    @property
    def tolerance(self) -> Array:
        """By what share `rms` may be wrong: two standard deviations of the mean of winds, (3,)."""
        return 2 * self.spread / np.sqrt(len(self.of_winds))

    @property
    def spread(self) -> Array:
        """By what share the RMS of one flight differs by its wind, a standard deviation, (3,)."""
        if len(self.of_winds) < 2:
            return np.full(3, np.nan)
        mean = self.of_winds.mean(axis=0)
        out: Array = 0.5 * self.of_winds.std(axis=0, ddof=1) / mean
        return out


def expected_rms(outcomes: Sequence[Outcome], method: str) -> dict[str, Expected]:
    """Return what is to be expected at check points, by `PARTS`."""
    found = {}
    for part in PARTS:
        variances = np.array([one.variances[method][part] for one in outcomes])
        known = variances[np.isfinite(variances).all(axis=(1, 2))]
        found[part] = Expected(
            n=float(np.mean([one.counts[method][part] for one in outcomes])),
            variance=known.mean(axis=0) if len(known) else np.full(variances.shape[1:], np.nan),
            of_winds=known.sum(axis=-1),
        )
    return found
