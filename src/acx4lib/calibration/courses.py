"""Test whether errors of recorded headings depend on the course.

The error of a magnetometer in an aircraft depends on the heading. A boresight absorbs its mean
over the courses; on a single course it absorbs the whole error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.observations import deviating
from acx4lib.expected import Array, Index
from acx4lib.flight.design import directions
from acx4lib.geometry.frames import log
from acx4lib.least_squares import statistics

APART = np.radians(20.0)
"""Courses closer to each other than this count as one."""

ALPHA = 0.01
"""Probability of a difference between courses where there is none."""


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
        """Whether heading errors differ significantly between courses."""
        return self.p < ALPHA

    @property
    def sentence(self) -> str:
        """A sentence with the mean heading error of each course, and its likely cause."""
        means = ", ".join(f"{c.off_deg:+.3g}° at {c.course_deg:.0f}°" for c in self.courses)
        return (
            f"recorded headings are off by another amount on another course: {means} (p "
            f"{self.p:.1g}); the deviation of a magnetometer would look like this, and "
            'attitude = ["deviation"] under [stages.mounting] estimates it'
        )


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
    groups = _clusters(course)
    groups = [rows for rows in groups if len(rows) > 1]
    redundancy = sum(map(len, groups)) - len(groups)
    if len(groups) < 2 or redundancy < len(groups):
        return None
    return ByCourse(
        courses=tuple(
            Course(
                course_deg=float(np.degrees(_mean(course[rows])) % 360),
                n=len(rows),
                off_deg=float(np.degrees(error[rows].mean())),
            )
            for rows in groups
        ),
        f_ratio=_f_ratio([error[rows] for rows in groups]),
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


def _mean(angles: Array) -> float:
    return float(np.arctan2(np.sin(angles).sum(), np.cos(angles).sum()))


def _clusters(angles: Array) -> list[Index]:
    """Return groups of rows whose angles have no gap as wide as `APART`, in order of direction."""
    if not len(angles):
        return []
    order = np.argsort(angles % (2 * np.pi), kind="stable")
    ascending = angles[order] % (2 * np.pi)
    gaps = np.diff(ascending, append=ascending[0] + 2 * np.pi) > APART
    if not gaps.any():
        return [order]
    first = int(np.flatnonzero(gaps)[-1]) + 1
    parts = np.split(np.roll(order, -first), np.flatnonzero(np.roll(gaps, -first))[:-1] + 1)
    return [part for part in parts if len(part)]


def _f_ratio(groups: list[Array]) -> float:
    """Return the variance between groups over the variance within them."""
    everything = np.concatenate(groups)
    within = sum(float(np.sum((group - group.mean()) ** 2)) for group in groups)
    between = float(np.sum((everything - everything.mean()) ** 2)) - within
    n, k = len(everything), len(groups)
    return between / (k - 1) / max(within / (n - k), np.finfo(float).tiny)
