"""The errors of the trajectory that a bundle estimated with its cameras.

A shift, drifts and a delay of GNSS positions, and a deviation of headings. A test tells whether
errors of recorded headings depend on the course.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from acx4lib import shown
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.observations import deviating
from acx4lib.calibration.estimates import (
    LIMIT_BORESIGHT_DEG,
    LIMIT_LEVER_M,
    Parameter,
    from_bundle,
    to_reported,
)
from acx4lib.design import directions
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.frames import log
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import propagate, sigmas

if TYPE_CHECKING:
    import pandas as pd


LIMIT_DELAY_S = 1.0
"""Standard deviation above which a delay counts as not determined, even if it has no effect."""


class _Unknown(NamedTuple):
    """One unknown error of the trajectory.

    `key`, `name`, `unit` and `value` are as in `Parameter`; `scale` converts the library's units.
    `reach` is the largest effect of one unit on the trajectory, as a share of the limit: an error
    is not determined if its effect may exceed the limit of a lever arm or a boresight.
    """

    key: str
    name: str
    unit: str
    value: float
    column: int
    scale: float
    reach: float


def _unknowns(bundle: Bundle) -> list[_Unknown]:
    """Return the estimated errors of the trajectory, in the order of their columns."""
    layout, state, observed = bundle.network.layout, bundle.state, bundle.network.observed
    unknowns = [
        _Unknown("shift", f"gnss_shift_{axis}_m", "m", value, column, 1.0, 1 / LIMIT_LEVER_M)
        for axis, value, column in zip(AXES, state.shift, layout.shift, strict=True)
    ]
    strips = observed.strips
    per, scale = ("min", 60.0) if strips.unit == "s" else ("exposure", 1.0)
    for k, strip in enumerate(strips.names):
        at_end = float(np.abs(strips.elapsed[strips.idx == k]).max())
        unknowns += [
            _Unknown(
                *("drift", f"gnss_drift_{strip}_{axis}_m_per_{per}", f"m/{per}"),
                *(scale * state.drift[k, a], layout.drift[k, a], scale),
                at_end / scale / LIMIT_LEVER_M,
            )
            for a, axis in enumerate(AXES)
        ]
    if observed.velocity is not None:
        speed = float(np.linalg.norm(observed.velocity, axis=1).max())
        reach = max(speed / LIMIT_LEVER_M, 1 / LIMIT_DELAY_S)
        at = layout.delay[0]
        unknowns.append(_Unknown("delay", "gnss_delay_s", "s", state.delay[0], at, 1.0, reach))
    # a deviation may be as uncertain as a single heading, where this is more than a boresight
    sigma = np.degrees(observed.sigma_attitude[np.isfinite(observed.sigma_attitude[:, 2]), 2])
    limit = max(LIMIT_BORESIGHT_DEG, float(np.median(sigma)) if len(sigma) else 0.0)
    for part, value, at in zip(("sin", "cos"), state.deviation, layout.deviation, strict=True):
        name, degrees = f"deviation_{part}_deg", float(np.degrees(1.0))
        angle = float(np.degrees(value))
        unknowns.append(_Unknown("deviation", name, "deg", angle, at, degrees, 1 / limit))
    return [unknown for unknown in unknowns if unknown.column >= 0]


def parameters(bundle: Bundle, cov: Array | None = None) -> list[Parameter]:
    """Return the estimated errors of the trajectory with a posteriori standard deviations.

    They belong to no camera, so their camera's name is empty. A drift is in m per minute, or per
    exposure where the trajectory has no times; a delay in s, positive where the values recorded for
    an exposure are of a later time; a deviation in degrees, positive where the recorded heading is
    larger than the true heading.

    Parameters
    ----------
    bundle : Bundle
    cov : ndarray, shape (n, n), optional
        Another one than `reported_covariance`.
    """
    sigma = sigmas(reported_covariance(bundle) if cov is None else cov)
    is_open = bundle.solution.undetermined
    return [
        Parameter(
            camera="",
            name=u.name,
            key=u.key,
            unit=u.unit,
            value=float(u.value),
            sigma=np.inf if is_open[u.column] else float(sigma[u.column]),
        )
        for u in _unknowns(bundle)
    ]


def table(bundle: Bundle) -> pd.DataFrame:
    """Return the estimated errors of the trajectory with their units and sigma."""
    return shown.parameter_table(
        shown.Row("", _title(p), p.unit, p.value, p.sigma) for p in parameters(bundle)
    )


def _title(parameter: Parameter) -> str:
    """Return ``GNSS shift east``, ``GNSS drift S1 east``, ``GNSS delay``."""
    name = parameter.name.removesuffix(f"_{parameter.unit.replace('/', '_per_')}")
    if parameter.key == "drift":
        strip, _, axis = name.removeprefix("gnss_drift_").rpartition("_")
        return f"GNSS drift {strip} {axis}"
    return name.replace("gnss", "GNSS").replace("_", " ")


def reported_covariance(bundle: Bundle) -> Array:
    """Return the joint a posteriori covariance of camera and trajectory parameters.

    Returns
    -------
    ndarray, shape (n, n)
        First those of `estimates.parameters`, then those of `parameters`, in their units.
    """
    J, solution = jacobian(bundle), bundle.solution
    first = np.arange(len(J))
    return solution.sigma0_sq * propagate(J, solution.inverse.at(first[:, None], first))


def jacobian(bundle: Bundle) -> Array:
    """Return d(parameters of `reported_covariance`) / d(first columns of the bundle), (n, n)."""
    scale = [unknown.scale for unknown in _unknowns(bundle)]
    return scipy.linalg.block_diag(to_reported(from_bundle(bundle)), np.diag(scale))


def is_determined(bundle: Bundle, cov: Array | None = None) -> Mask:
    """Tell for every error of the trajectory whether the data determine it, shape (n,).

    Arguments are those of `parameters`.
    """
    listed = zip(parameters(bundle, cov), _unknowns(bundle), strict=True)
    return np.array([p.sigma * unknown.reach <= 1 for p, unknown in listed], dtype=bool)


# --- headings by course -----------------------------------------------------------------------
#
# The error of a magnetometer in an aircraft depends on the heading. A boresight absorbs its mean
# over the courses; on a single course it absorbs the whole error.


@dataclass(frozen=True, kw_only=True)
class Course:
    """The exposures that were flown on one course.

    Attributes
    ----------
    course_deg : float
        Mean, from north over east.
    n : int
        Number of exposures.
    off_deg : float
        Mean of recorded minus adjusted headings.
    """

    course_deg: float
    n: int
    off_deg: float


@dataclass(frozen=True, kw_only=True)
class ByCourse:
    """A test of recorded headings, grouped by course.

    Attributes
    ----------
    courses : tuple of Course
        In the order of their directions.
    f_ratio : float
        Variance between courses over the variance within them.
    redundancy : int
        Of the variance within them.
    """

    courses: tuple[Course, ...]
    f_ratio: float
    redundancy: int

    @property
    def p(self) -> float:
        """Probability of such a ratio or a larger one if the error is the same on all courses."""
        return statistics.f_sf(self.f_ratio, len(self.courses) - 1, self.redundancy)

    @property
    def differs(self) -> bool:
        """Whether heading errors differ between courses, by more than chance in one of 100."""
        return self.p < 0.01


def by_course(bundle: Bundle) -> ByCourse | None:
    """Test whether errors of recorded headings depend on the course.

    The difference is compared with the scatter within the courses, not with sigma of the attitudes;
    valid where errors of different exposures are independent.

    Parameters
    ----------
    bundle : Bundle
        Of `adjust.mounted_orientation`. A deviation that it estimated is taken off.

    Returns
    -------
    ByCourse or None
        None where there are less than two courses of two exposures, or errors are declared as
        correlated.
    """
    trajectory = bundle.network.block.trajectory
    is_observed = np.isfinite(bundle.network.observed.sigma_attitude).any()
    if trajectory.slow_attitudes.share > 0 or not is_observed:
        return None
    course, error = headings(bundle)
    course, error = course[np.isfinite(error)], error[np.isfinite(error)]
    groups = [rows for rows in _clusters(course) if len(rows) > 1]
    redundancy = sum(map(len, groups)) - len(groups)
    if len(groups) < 2 or redundancy < len(groups):
        return None
    errors = [error[rows] for rows in groups]
    everything = np.concatenate(errors)
    within = sum(float(np.sum((group - group.mean()) ** 2)) for group in errors)
    between = float(np.sum((everything - everything.mean()) ** 2)) - within
    variance = max(within / redundancy, np.finfo(float).tiny)
    mean = [np.arctan2(np.sin(course[rows]).sum(), np.cos(course[rows]).sum()) for rows in groups]
    return ByCourse(
        courses=tuple(
            Course(
                course_deg=float(np.degrees(direction) % 360),
                n=len(group),
                off_deg=float(np.degrees(group.mean())),
            )
            for direction, group in zip(mean, errors, strict=True)
        ),
        f_ratio=between / (len(groups) - 1) / variance,
        redundancy=redundancy,
    )


def headings(bundle: Bundle) -> tuple[Array, Array]:
    """Return the courses of the exposures, and the errors of their recorded headings.

    Parameters
    ----------
    bundle : Bundle
        Of `adjust.mounted_orientation`. A deviation that it estimated is taken off.

    Returns
    -------
    course, error : ndarray, shape (n,)
        From north over east, and recorded minus adjusted, NaN where no attitude is used; radians.
    """
    network, state = bundle.network, bundle.state
    observed = network.observed
    known = np.isfinite(observed.sigma_attitude).all(axis=1)
    expected = deviating(observed, state) @ state.T_m_b.R
    error = log(expected @ np.swapaxes(observed.T_m_b.R, -1, -2))[:, 2]
    first = network.first_poses
    course = np.arctan2(*directions(network.block).T)[network.exposure_idx[first]]
    return course, np.where(known, error, np.nan)[first]


def _clusters(angles: Array) -> list[Index]:
    """Return groups of rows whose angles have no gap of 20 degrees, in order of direction."""
    if not len(angles):
        return []
    order = np.argsort(angles % (2 * np.pi), kind="stable")
    ascending = angles[order] % (2 * np.pi)
    gaps = np.diff(ascending, append=ascending[0] + 2 * np.pi) > np.radians(20.0)
    if not gaps.any():
        return [order]
    first = int(np.flatnonzero(gaps)[-1]) + 1
    parts = np.split(np.roll(order, -first), np.flatnonzero(np.roll(gaps, -first))[:-1] + 1)
    return [part for part in parts if len(part)]
