"""Figures of the chapter: a change that hides, and false alarms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.least_squares.covariance import half, sigmas
from acx4lib.least_squares.statistical import distributions

LEVEL = 0.05
EACH, HOLM, JOINT = "each at the level", "Holm", "χ² of all"
MARKS: Mapping[str, str] = {EACH: style.BRICK, HOLM: style.BLUE, JOINT: style.TEAL}


Vector = tuple[Array, Array]
"""A difference of two parameters and its covariance."""


def hidden(pair: Vector, rest: Vector, *, label: str, n_tests: int) -> Figure:
    """Draw a difference of f and lever arm z with what chance makes of it.

    Parameters
    ----------
    pair : tuple of ndarray
        The difference in micrometres and millimetres, shape (2,), and its covariance.
    rest : tuple of ndarray
        What the other parameters leave of both, likewise.
    label : str
        What is less what.
    n_tests : int
        Of single parameters, that share a level.

    Returns
    -------
    Figure
        Bands: of each parameter alone, at the joint level. Ellipses: of both together, and of what
        the other parameters leave of both; a dot for each.
    """
    single = distributions.norm_ppf(1 - LEVEL / n_tests / 2) * sigmas(pair[1])
    with style.applied():
        fig, ax = style.subplots(figsize=(0.7 * style.WIDTH, 3.6))
        ax.axvspan(-single[0], single[0], color=style.SHEET, alpha=0.6, lw=0)
        ax.axhspan(-single[1], single[1], color=style.SHEET, alpha=0.6, lw=0)
        for (at, own), colour, words in (
            (pair, style.BLUE, label),
            (rest, style.BRICK, "what the other parameters leave"),
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


def alarms(shares: Mapping[str, Array], levels: Sequence[float] | Array) -> Figure:
    """Draw how often tests alarm where nothing has changed, over the level of the test.

    Parameters
    ----------
    shares : mapping of str to ndarray, shape (n,)
        By way of testing, as `MARKS` has them.
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
