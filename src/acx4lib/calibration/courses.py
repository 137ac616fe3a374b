"""Whether recorded headings are off by another amount on another course.

A magnetometer in an aircraft shows a heading that is wrong by an amount that depends on the
heading. A boresight takes the mean of it and nothing more, and in a single course all of it.
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
        """Probability of such a ratio or a larger one where no course is off by another amount."""
        return statistics.f_sf(self.f_ratio, len(self.courses) - 1, self.redundancy)

    @property
    def differs(self) -> bool:
        """Whether headings are off by another amount on another course."""
        return self.p < ALPHA

    @property
    def sentence(self) -> str:
        """What differs by how much, and what would look like it."""
        means = ", ".join(f"{c.off_deg:+.3g}° at {c.course_deg:.0f}°" for c in self.courses)
        return (
            f"recorded headings are off by another amount on another course: {means} (p "
            f"{self.p:.1g}); the deviation of a magnetometer would look like this, and "
            'attitude = ["deviation"] under [stages.mounting] estimates it'
        )


def by_course(bundle: Bundle) -> ByCourse | None:
    """Test whether recorded headings are off by another amount on another course.

    The scatter within the courses is the measure, whatever sigma the attitudes have; valid where
    errors of different exposures are independent.

    Parameters
    ----------
    bundle : Bundle
        Of `uses.mounted_orientation`. A deviation that it estimated is taken off.

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
    course, off = headings(bundle)
    course, off = course[np.isfinite(off)], off[np.isfinite(off)]
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
                off_deg=float(np.degrees(off[rows].mean())),
            )
            for rows in groups
        ),
        f_ratio=_f_ratio([off[rows] for rows in groups]),
        redundancy=redundancy,
    )


def headings(bundle: Bundle) -> tuple[Array, Array]:
    """Return the courses of the exposures, and what their recorded headings are off.

    Parameters
    ----------
    bundle : Bundle
        Of `uses.mounted_orientation`. A deviation that it estimated is taken off.

    Returns
    -------
    course, off : ndarray, shape (n,)
        From north over east, and recorded minus adjusted, NaN where no attitude is used; radians.
    """
    network, state = bundle.network, bundle.state
    observed = network.observed
    known = np.isfinite(observed.sigma_attitude).all(axis=1)
    expected = deviating(observed, state) @ state.T_m_b.R
    off = log(expected @ np.swapaxes(observed.T_m_b.R, -1, -2))[:, 2]
    first = network.first_poses
    course = np.arctan2(*directions(network.block).T)[network.exposure_idx[first]]
    return course, np.where(known, off, np.nan)[first]


def _mean(angles: Array) -> float:
    return float(np.arctan2(np.sin(angles).sum(), np.cos(angles).sum()))


def _clusters(angles: Array) -> list[Index]:
    """Return the rows of angles that no gap as wide as `APART` separates, by their directions."""
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
    within = sum(float(np.sum((own - own.mean()) ** 2)) for own in groups)
    between = float(np.sum((everything - everything.mean()) ** 2)) - within
    n, k = len(everything), len(groups)
    return between / (k - 1) / max(within / (n - k), np.finfo(float).tiny)
