"""What the chapter says with numbers of its campaigns."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acx4book.chapters.beyond.stability.chance import EACH, HOLM, JOINT
from acx4book.chapters.beyond.stability.figures import pair_of, without_others
from acx4book.chapters.beyond.stability.history import UM_PER_DEGREE
from acx4book.chapters.beyond.stability.turned import ARCSEC, EXPOSURE, HEAD, planted
from acx4book.typesetting.labels import p_value
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.trust.rigidity import Rigidity
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.results.campaigns.comparison import (
    Comparison,
    difference,
    stability,
    temperatures,
    trend,
)
from acx4lib.results.campaigns.estimates import joint_test


def _p(p: float) -> str:
    said = p_value(p)
    return f"$p$ {said}" if said.startswith("<") else f"$p$ = {said}"


def hidden(comparison: Comparison, earlier: int, later: int) -> str:
    """Say how one change of f shows singly, with the lever arm, and with all parameters."""
    d, cov = pair_of(comparison, earlier, later)
    left, cov_left = without_others(comparison, earlier, later)
    t, rho = d / sigmas(cov), correlation(cov)[0, 1]
    both, alone = joint_test(d, cov), joint_test(left, cov_left)
    everything = difference(comparison, earlier, later).test()
    warm = np.diff([comparison.campaigns[i].session.temperature_c for i in (earlier, later)])[0]
    return (
        f"The true focal length differs by {UM_PER_DEGREE * warm:.1f} µm. The difference of $f$ is "
        f"{t[0]:+.1f} of its standard deviations, that of the lever arm's $z$ {t[1]:+.1f}; their "
        f"errors have a correlation of {rho:+.2f}. Both together give χ² = {both.chi_square:.1f} "
        f"with 2 degrees of freedom, {_p(both.p)}. What the other parameters leave of both gives "
        f"χ² = {alone.chi_square:.1f}, and all {everything.dof} parameters together "
        f"χ² = {everything.chi_square:.1f}, {_p(everything.p)}."
    )


def alarms(shares: Mapping[str, float], level: float, n: int) -> str:
    """Say how often each way of testing alarms at a level."""
    return (
        f"At a level of {100 * level:g} %, {100 * shares[EACH]:.0f} % of the comparisons have an "
        f"alarm if each of the {n} parameters is tested at this level, {100 * shares[HOLM]:.1f} % "
        f"with Holm's joint level, {100 * shares[JOINT]:.1f} % with one χ² test of all."
    )


def temperature(before: Comparison) -> str:
    """Say what the regression finds of the true dependence of f on temperature."""
    slope, sigma = slope_of_f(before)
    return (
        f"The slope of $f$ is {slope:.2f} ± {sigma:.2f} µm per °C; the truth is "
        f"{UM_PER_DEGREE:g} µm per °C."
    )


def slope_of_f(before: Comparison) -> tuple[float, float]:
    """Return the slope of f over temperature and its standard deviation, µm per °C."""
    at = temperatures(before)
    if at is None:
        msg = "the campaigns have no temperatures"
        raise ValueError(msg)
    found = trend(before, at)
    i = [p.name for p in before.parameters].index("f_mm")
    return 1e3 * float(found.slope[i]), 1e3 * float(sigmas(found.cov)[i])


def turned(found: Rigidity) -> str:
    """Say whether the planted turn was found."""
    own = planted(found)
    return (
        f"{shown(HEAD)} was turned by {ARCSEC:g}″ at exposure {shown(EXPOSURE)}. The test of this "
        f"exposure gives {own['turn_arcsec']:.1f} ± {own['sigma_arcsec']:.1f}″ and "
        f"{_p(own['p_joint'])} at the joint level. The test of all {len(found.exposures)} "
        f"exposures at once gives {_p(found.whole.p)}: one turn among {found.whole.dof} angles is "
        "diluted."
    )


def answer(everything: Comparison, before: Comparison, found: Rigidity) -> str:
    """Say how one tells whether a camera has changed."""
    slope, sigma = slope_of_f(before)
    all_p, own = stability(everything).p, planted(found)
    lines = trend(before, np.array([c.session.temperature_c for c in before.campaigns]))
    lie = "lie" if lines.scatter.p >= 0.05 else "do not lie"
    return (
        "A camera has changed if the differences of its parameters are larger than their joint "
        f"covariance allows: here {_p(all_p)} for all {len(everything.campaigns)} campaigns. One "
        "χ² test of all parameters answers whether, and single tests at a joint level answer "
        "where; correlated parameters need the first. A change with a cause is no instability: up "
        f"to the repair the campaigns {lie} on straight lines over the temperature, with "
        f"{slope:.2f} ± {sigma:.2f} µm per °C for $f$. Within one flight an F test finds a head "
        f"that turned by {ARCSEC:g}″ at a single exposure ({_p(own['p_joint'])})."
    )
