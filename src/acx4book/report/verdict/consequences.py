"""What a finding that fails means for the user of a calibration, and what to do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple


class Consequence(NamedTuple):
    """What it means, and what to do; both continue a sentence."""

    means: str
    cure: str


CONSEQUENCES: Mapping[str, Consequence] = {
    "One state of the data": Consequence(
        "the stages were computed from different files, so these results must not be used",
        "run all stages again",
    ),
    "Convergence": Consequence(
        "an adjustment has no solution, and what it should have estimated is missing",
        "read what the run said of it, correct the data, and run again",
    ),
    "Observations agree with each other": Consequence(
        "a whole group of observations contradicts the others, so the calibration must not be used",
        "find what this group has wrong (unit, axes, names, times, σ), correct it, and run again",
    ),
    "Estimated weights within bounds": Consequence(
        "weights that were estimated hide a mistake of a whole group of observations, so the "
        "calibration must not be used",
        "find the mistake in the group that is named (datum, epoch, scale, unit, names), correct "
        "it, and run again",
    ),
    "Heights of one system": Consequence(
        "heights or the focal length have a wrong scale, so the calibration must not be used",
        "check heights in flight.toml, the geoid model and focal_mm, and run again",
    ),
    "Declared mounting confirmed": Consequence(
        "the survey and the flight exclude each other; a delay, heights of another system or "
        "another north may be hidden in the mounting, so the calibration must not be used for "
        "other flights",
        "find out which of the two is wrong, correct it, and run again",
    ),
    "Independent check points": Consequence(
        "points on the ground are not as accurate as predicted, so the calibration must not be "
        "used for direct georeferencing",
        "look at the differences of the check points: a wrong point, another datum or height "
        "system, or a camera that changed",
    ),
    "Boresight stable over time": Consequence(
        "camera and IMU turned against each other, or the attitudes have errors that change "
        "slowly; the interior orientation can be used, the boresight cannot be used for other "
        "flights",
        "check the mount and the processing of the INS; state slow errors in flight.toml, or fly "
        "again",
    ),
    "All parameters determined": Consequence(
        "what is named is not known; the other parameters can be used, with their covariance",
        "hold it at a surveyed value by fix in flight.toml, or fly what the explanation names",
    ),
    "A priori standard deviations": Consequence(
        "a group of observations has wrong weights; the values can be used as approximations, "
        "their standard deviations cannot",
        "look for a systematic error in this group; if there is none, correct its σ or set weights "
        '= "estimated", and run again',
    ),
    "Global χ² test": Consequence(
        "the observations are not as accurate as their σ say; the values can be used as "
        "approximations, their standard deviations cannot",
        "look for the wrong σ or the systematic error in the groups below, correct it, and run "
        "again",
    ),
    "Gross errors": Consequence(
        "the results were computed without the observations that were taken out, and can be used "
        "if everything else holds",
        "look at the largest in the table of rejected observations: a wrong name, target or row; "
        "correct or remove it, and run again",
    ),
}
"""By the question of a finding, the gravest first: what it means holds for those behind it, too."""

UNKNOWN = Consequence("the results must not be used before the cause is known", "see below")


def by_gravity(questions: Iterable[str]) -> list[str]:
    """Return questions that fail, the gravest first; those not known are the gravest."""
    order = list(CONSEQUENCES)
    return sorted(questions, key=lambda q: order.index(q) if q in order else -1)
