"""Figures of the chapter: a change that hides, and false alarms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from acx4book.chapters.beyond.stability.chance import EACH, HOLM, JOINT
from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.least_squares.covariance import half, sigmas
from acx4lib.least_squares.statistical import distributions
from acx4lib.results.campaigns.comparison import Comparison, difference

PAIR = ("f_mm", "lever_z_m")
"""Parameters that a flight at two heights tells apart only with difficulty."""

LEVEL = 0.05
MARKS: Mapping[str, str] = {EACH: style.BRICK, HOLM: style.BLUE, JOINT: style.TEAL}


def hidden(comparison: Comparison, earlier: int, later: int) -> Figure:
    """Draw a difference of f and lever arm z with what chance makes of it, singly and jointly.

    Parameters
    ----------
    comparison : Comparison
    earlier, later : int
        Places of two campaigns.
    """
    d, cov = pair_of(comparison, earlier, later)
    names = [comparison.campaigns[i].name for i in (earlier, later)]
    turn = np.linspace(0, 2 * np.pi, 200)
    reach = np.sqrt(distributions.chi2_isf(LEVEL, 2))
    ellipse = reach * half(cov) @ np.array([np.cos(turn), np.sin(turn)])
    single = distributions.norm_ppf(1 - LEVEL / 2) * sigmas(cov)
    with style.applied():
        fig, ax = style.subplots(figsize=(0.62 * style.WIDTH, 3.4))
        ax.axvspan(-single[0], single[0], color=style.SHEET, alpha=0.6, lw=0)
        ax.axhspan(-single[1], single[1], color=style.SHEET, alpha=0.6, lw=0)
        ax.plot(*ellipse, color=style.BLUE, label="chance, jointly (95 %)")
        ax.plot(*d, "o", ms=6, color=style.BRICK, label=f"{names[1]} less {names[0]}")
        ax.plot([], [], "s", color=style.SHEET, ms=8, label="chance, singly (95 %)")
        ax.set(xlabel="difference of $f$ (µm)", ylabel="difference of lever arm $z$ (mm)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=3)
    return fig


def pair_of(comparison: Comparison, earlier: int, later: int) -> tuple[Array, Array]:
    """Return the difference of f (µm) and lever arm z (mm) of two campaigns, and its covariance."""
    found = difference(comparison, earlier, later)
    names = [p.name for p in comparison.parameters]
    own = [names.index(name) for name in PAIR]
    return 1e3 * found.d[own], 1e6 * found.cov[np.ix_(own, own)]


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
