"""Sentences of the error budget, with the numbers of a run."""

from __future__ import annotations

import numpy as np

from acx4book.chapters.beyond.error_budget import as_printed
from acx4book.chapters.beyond.error_budget.examined import BARE, PAPERS, Examined, plan_and_height
from acx4book.chapters.beyond.error_budget.heights import Heights
from acx4book.paper import printed
from acx4book.typesetting.labels import TITLES, inside
from acx4lib.expected import Array
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.mapping_flight import Format

TOGETHER = "lever arm with interior orientation"
HIGH = -1
"""The greatest of the heights."""


def _percent(variance: Array, *sources: str) -> float:
    own = [budget.SOURCES.index(source) for source in sources]
    return float(100 * variance[own].sum() / variance.sum())


def _signed(number: float) -> str:
    return f"{number:.0f}".replace("-", "\N{MINUS SIGN}")


def correlations(found: Examined) -> str:
    """Say what the calibration's parts of the height would be without their correlations."""
    height = plan_and_height(found.points(BARE).mean)[1]
    lever, interior, both, all_of_it = (
        _percent(height, *sources)
        for sources in (
            ("lever arm",),
            ("interior orientation",),
            (TOGETHER,),
            budget.CALIBRATION,
        )
    )
    return (
        f"For the height and the {inside(TITLES[BARE])} method, the lever arm has "
        f"{lever:.0f} % of the variance, the interior orientation {interior:.0f} %, and the "
        f"correlation of both {_signed(both)} %. All parts of the calibration together are "
        f"{all_of_it:.1f} %."
    )


def heights(flown: Heights) -> str:
    """Say how the share of the calibration in height depends on the flying height."""
    share = {
        method: 100 * budget.shares(variance[:, 1])["calibration"]
        for method, variance in flown.variance.items()
    }
    least = int(np.argmin(share[BARE]))
    return (
        f"With the {inside(TITLES[BARE])} method, the calibration has {share[BARE][least]:.1f} % "
        f"of the variance of the height at {flown.height_m[least]:.0f} m, and "
        f"{share[BARE][HIGH]:.0f} % at {flown.height_m[HIGH]:.0f} m. With the single-step method "
        f"it has {share[PAPERS].max():.1f} % at most."
    )


def over_format(shown: Format) -> str:
    """Say how much the errors differ over the format."""
    sigma = 100 * shown.sigma
    plan, height = np.hypot(sigma[..., 0], sigma[..., 1]), sigma[..., 2]
    return (
        f"In plan σ is {np.nanmin(plan):.0f} to {np.nanmax(plan):.0f} cm over the format, in "
        f"height {np.nanmin(height):.0f} to {np.nanmax(height):.0f} cm."
    )


def unexplained(found: Examined) -> str:
    """Say what the paper's own accuracies leave of its RMS, and what can explain it."""
    rms = as_printed.rms()
    said = as_printed.predicted(found, as_printed.assumptions()[0]).rms
    left = as_printed.unexplained(rms, said)
    suspects = as_printed.suspects(found)
    able = [one for one in suspects if one.rms[2] <= left[2]]
    turn = next(one.size for one in suspects if one.name == "boresight κ")
    kappa = turn / printed.sigma(3, "boresight_kappa_deg", PAPERS)
    named = " or ".join(f"{one.name} ({one.needed})" for one in able)
    return (
        f"With the smallest errors that the paper names, its budget predicts {said[0]:.2f}, "
        f"{said[1]:.2f} and {said[2]:.2f} m in east, north and height; printed are "
        f"{rms[0]:.2f}, {rms[1]:.2f} and {rms[2]:.2f} m. So the height leaves {left[2]:.2f} m "
        f"unexplained, but the plan {left[0]:.2f} and {left[1]:.2f} m. Of the errors in the table, "
        f"the only ones that make so much in plan without making the heights worse than they were "
        f"found are: {named}. Such a κ would be {kappa:.0f} times its printed standard deviation. "
        "Targets do it that are not quite the same point on the ground and in the images."
    )


def answer(found: Examined, flown: Heights) -> str:
    """Answer the question of the chapter."""
    split = plan_and_height(found.pairs(BARE).mean)
    (image, trajectory, calibrated) = (
        [100 * float(value) for value in part] for part in budget.shares(split).values()
    )
    left = as_printed.unexplained(
        as_printed.rms(), as_printed.predicted(found, as_printed.assumptions()[0]).rms
    )
    share = budget.shares(flown.variance[BARE][:, 1])["calibration"]
    return (
        f"At the height of the calibration, the error of a map comes from image points and "
        f"survey ({image[0]:.0f} % of the variance in plan, {image[1]:.0f} % in height, over "
        f"pairs of rays and with the {inside(TITLES[BARE])} method) and from the trajectory "
        f"({trajectory[0]:.0f} and {trajectory[1]:.0f} %), of which the attitude has nearly "
        f"all; the calibration has {calibrated[0]:.1f} and {calibrated[1]:.1f} %.\n\n"
        "Single parameters of a calibration may be known poorly as long as they compensate each "
        f"other. That holds at the heights of the calibration only: at {flown.height_m[HIGH]:.0f} "
        f"m the same calibration has {100 * share[HIGH]:.0f} % of the variance in height. Of the "
        f"paper's RMS of {as_printed.rms()[0]:.2f} m, about {left[0]:.1f} m in each coordinate of "
        "the plan is explained by none of the accuracies that it names."
    )
