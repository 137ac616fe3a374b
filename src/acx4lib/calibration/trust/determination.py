"""What an adjustment determines worst: condition, weakest combination, strong correlations."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.estimates import Calibration, parameters, reported_covariance
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES, BORESIGHT, POSE, REPORTED
from acx4lib.least_squares.covariance import correlation

STRONG = 0.9
"""Absolute correlation above which a pair of parameters is named."""

SHARE = 0.05
"""Share of the weakest combination below which an unknown is not named."""

ALIKE = 0.8
"""Common share of the poses' part above which all poses are said to change alike."""

CARRIED = float(1 / np.finfo(float).eps)
"""Condition above which double precision has no digit left of the weakest direction, 4.5e15."""

NAMED = 3
"""Images that are named of those without a position and attitude."""

POSES = dict(
    zip(
        POSE,
        (
            *(f"{axis} of {{}}positions" for axis in AXES),
            *(f"{{}}attitudes about {axis}" for axis in "xyz"),
        ),
        strict=True,
    )
)
"""Name of an unknown of many poses, by its name in one; ``all`` where poses change alike."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """One unknown of the weakest combination, or the same one of all poses.

    Attributes
    ----------
    unknown : str
        ``camera/parameter``, or one of `POSES`.
    share : float
        Square of its component in the eigenvector; all squares add up to one.
    """

    unknown: str
    share: float


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two parameters that are determined only together.

    Attributes
    ----------
    row, column : str
        ``camera/parameter``.
    correlation : float
    """

    row: str
    column: str
    correlation: float


def weakest_combination(bundle: Bundle) -> tuple[Part, ...]:
    """Return the unknowns that could change together with the least effect on all residuals.

    They form the eigenvector of the smallest eigenvalue of the normal matrix, after the points
    are eliminated and the unknowns are scaled to a diagonal of one. Empty where several
    directions are left open altogether: none of them is the weakest.

    Returns
    -------
    tuple of Part
        The largest first, down to a share of 5 %.
    """
    solution, layout = bundle.solution, bundle.network.layout
    if solution.defect > 1 or layout.n_columns == 0:
        return ()
    v, names = solution.weakest, bundle.network.column_names()
    parts = [
        _of_poses(label, v[columns[columns >= 0]])
        for label, columns in zip(POSES.values(), layout.pose.T, strict=True)
    ]
    for column in np.setdiff1d(np.arange(len(v)), [*layout.pose.ravel(), *layout.joint]):
        parts.append(Part(unknown=_reported(names[column]), share=float(v[column] ** 2)))
    named = (part for part in parts if part.share >= SHARE)
    return tuple(sorted(named, key=lambda part: -part.share))


def beyond_precision(bundle: Bundle) -> str:
    """Return a sentence on a condition above `CARRIED`, and on the images that make it; or none.

    Their positions and attitudes are not known. What all images share is, as long as it has a
    standard deviation.
    """
    network = bundle.network
    if not bundle.solution.condition > CARRIED:
        return ""
    n_points = np.bincount(network.image_points.image_idx, minlength=len(bundle.oriented))
    names = [
        f"{network.block.images.names[k]} (measured points: {n_points[k]})"
        for k in np.flatnonzero(~bundle.oriented & (n_points > 0))
    ]
    of = f"the position and attitude of {', '.join(names[:NAMED])}" if names else "all unknowns"
    of += f" and {len(names) - NAMED} more" * (len(names) > NAMED)
    return (
        "the condition of the normal matrix is more than double precision can carry: the "
        f"observations do not determine {of}"
    )


def _of_poses(label: str, v: Array) -> Part:
    """Sum up one unknown of all poses."""
    share = float(v @ v)
    alike = len(v) > 1 and np.sum(v) ** 2 > ALIKE * len(v) * share
    return Part(unknown=label.format("all " if alike else ""), share=share)


def _reported(name: str) -> str:
    """Return a column's name in results; a boresight column, about camera axes, keeps its own."""
    owner, key = name.rsplit("/", 1)
    if key in REPORTED and key not in BORESIGHT:
        key = REPORTED[key][0]
    return f"{owner}/{key}"


def strong_correlations(calibration: Calibration) -> tuple[Pair, ...]:
    """Return the pairs of reported parameters that correlate by more than 0.9, largest first.

    Parameters that the observations leave open altogether have no correlations.
    """
    listed = parameters(calibration)
    known = [i for i, p in enumerate(listed) if np.isfinite(p.sigma)]
    names = [f"{p.camera}/{p.name}" for p in listed]
    related = correlation(reported_covariance(calibration))
    pairs = [
        Pair(row=names[i], column=names[j], correlation=float(related[i, j]))
        for i, j in combinations(known, 2)
        if abs(related[i, j]) > STRONG
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair.correlation)))


def as_json(bundle: Bundle, calibration: Calibration) -> dict[str, object]:
    """Return condition, weakest combination and strong correlations for a summary."""
    return {
        "condition": bundle.solution.condition,
        "weakest": {part.unknown: part.share for part in weakest_combination(bundle)},
        "correlated": [
            [pair.row, pair.column, pair.correlation] for pair in strong_correlations(calibration)
        ],
    }
