"""Figure of adjustments that start far from the truth."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from acx4book.chapters.beyond.bad_starts.trials import PHASES, FromBadStarts
from acx4book.typesetting import style


def from_bad_starts(starts: FromBadStarts) -> Figure:
    """Draw how far rays pass their points from phase to phase, and how the ends differ.

    Parameters
    ----------
    starts : FromBadStarts

    Returns
    -------
    Figure
    """
    n = len(starts.apart)
    with style.applied():
        fig, (left, right) = style.subplots(
            1, 2, figsize=(style.WIDTH, 3.0), width_ratios=(2.2, 1.0)
        )
        at = np.arange(len(PHASES))
        images = np.moveaxis(starts.misfit_deg, 1, 0).reshape(len(PHASES), -1)
        left.fill_between(
            at, images.min(axis=1), images.max(axis=1), color=style.SKY, alpha=0.5, lw=0
        )
        left.plot(at, np.median(images, axis=1), "o-", color=style.BLUE)
        left.set_yscale("log")
        left.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        left.set_xticks(at, PHASES)
        left.set_ylabel("rays past their points (deg)")
        style.heading(left, "From bad to adjusted", f"all images of {n} starts, and their median")
        right.plot(
            np.arange(1, n + 1), np.maximum(starts.apart, 1e-12), "o", color=style.ORANGE, ms=3
        )
        right.axhline(1e-3, color=style.SOFT, lw=0.9, ls="--")
        right.set_yscale("log")
        right.set(xlabel="start", ylabel=r"largest difference ($\sigma$)")
        right.set_ylim(top=1e-1)
        style.heading(right, "One minimum", "against the usual start")
    return fig
