"""Figures of the chapter: a change that hides, and false alarms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from acx4book.chapters.beyond.stability.chance import EACH, HOLM, JOINT
from acx4book.typesetting import style
from acx4lib.expected import Array, Index
from acx4lib.least_squares.covariance import half, sigmas
from acx4lib.least_squares.statistical import distributions
from acx4lib.results.campaigns.comparison import Comparison, difference

PAIR = ("f_mm", "lever_z_m")
"""Parameters that a flight at two heights tells apart only with difficulty."""

SMALL = 1000.0
"""Micrometres in a millimetre, and millimetres in a metre."""

LEVEL = 0.05
MARKS: Mapping[str, str] = {EACH: style.BRICK, HOLM: style.BLUE, JOINT: style.TEAL}


def hidden(comparison: Comparison, earlier: int, later: int) -> Figure:
    """Draw a difference of f and lever arm z with what chance makes of it.

    Parameters
    ----------
    comparison : Comparison
    earlier, later : int
        Places of two campaigns.

    Returns
    -------
    Figure
        Bands: of each parameter alone, at the joint level. Ellipses: of both together, and of what
        the other parameters leave of both; a dot for each.
    """
    d, cov = pair_of(comparison, earlier, later)
    left, cov_left = without_others(comparison, earlier, later)
    n_tests = len(comparison.parameters) * (len(comparison.campaigns) - 1)
    single = distributions.norm_ppf(1 - LEVEL / n_tests / 2) * sigmas(cov)
    names = [comparison.campaigns[i].name for i in (earlier, later)]
    with style.applied():
        fig, ax = style.subplots(figsize=(0.7 * style.WIDTH, 3.6))
        ax.axvspan(-single[0], single[0], color=style.SHEET, alpha=0.6, lw=0)
        ax.axhspan(-single[1], single[1], color=style.SHEET, alpha=0.6, lw=0)
        for at, own, colour, words in (
            (d, cov, style.BLUE, f"{names[1]} less {names[0]}"),
            (left, cov_left, style.BRICK, "what the other parameters leave"),
        ):
            ax.plot(*_ellipse(own), color=colour)
            ax.plot(*at, "o", ms=6, color=colour, label=words)
        ax.plot([], [], "s", color=style.SHEET, ms=8, label="chance, one by one")
        ax.plot([], [], color=style.SOFT, label="chance, both together")
        ax.set(xlabel="difference of $f$ (µm)", ylabel="difference of lever arm $z$ (mm)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


def _ellipse(cov: Array) -> Array:
    """Return the ellipse that chance leaves in one case of twenty, shape (2, n)."""
    turn = np.linspace(0, 2 * np.pi, 200)
    reach = np.sqrt(distributions.chi2_isf(LEVEL, 2))
    out: Array = reach * half(cov) @ np.array([np.cos(turn), np.sin(turn)])
    return out


def pair_of(comparison: Comparison, earlier: int, later: int) -> tuple[Array, Array]:
    """Return the difference of f (µm) and lever arm z (mm) of two campaigns, and its covariance."""
    found, (own, _) = difference(comparison, earlier, later), _places(comparison)
    return SMALL * found.d[own], SMALL**2 * found.cov[np.ix_(own, own)]


def without_others(comparison: Comparison, earlier: int, later: int) -> tuple[Array, Array]:
    """Return what the differences of all other parameters leave of f (µm) and lever arm z (mm).

    The part of both that correlated errors of the others explain is taken off, and the covariance
    of the rest.
    """
    found, (own, others) = difference(comparison, earlier, later), _places(comparison)
    scale = found.sigma
    cov, d = found.cov / scale[:, None] / scale, found.d / scale
    gain = np.linalg.solve(cov[np.ix_(others, others)], cov[np.ix_(others, own)]).T
    left = d[own] - gain @ d[others]
    cov_left = cov[np.ix_(own, own)] - gain @ cov[np.ix_(others, own)]
    unit = SMALL * scale[own]
    return unit * left, unit[:, None] * unit * cov_left


def _places(comparison: Comparison) -> tuple[Index, Index]:
    """Return the places of the pair, and those of the other parameters."""
    names = [p.name for p in comparison.parameters]
    own = np.array([names.index(name) for name in PAIR])
    return own, np.setdiff1d(np.arange(len(names)), own)


def alarms(shares: Mapping[str, Array], levels: Sequence[float] | Array) -> Figure:
    """Draw how often tests alarm where nothing has changed, over the level of the test.

    Parameters
    ----------
    shares : mapping of str to ndarray, shape (n,)
        As `chance.false_alarms` returns them.
    levels : ndarray, shape (n,)
    """
    with style.applied():
        fig, ax = style.subplots(figsize=(0.62 * style.WIDTH, 3.0))
        ax.plot(levels, levels, "--", color=style.INK, lw=0.9, label="as promised")
        for way, share in shares.items():
            ax.plot(levels, share, "o-", color=MARKS[way], ms=3, label=way)
        ax.set(xlabel="level of the test (1)", ylabel="share of comparisons with an alarm (1)")
        ax.set(xlim=(0, None), ylim=(0, 1))
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig
