"""Figure of the heads' responses: gain and falloff, and what overlaps say before and after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from acx4book.typesetting import style
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.synthetic_image.response import OverlapResponse, ResponseFit

BANDS = {
    1: ("grey",),
    3: ("red", "green", "blue"),
    4: ("red", "green", "blue", "near infrared"),
}
"""Usual order of bands by their number."""


def response_curves(fit: ResponseFit | None, orientation: RelativeOrientation) -> Figure:
    """Draw every head's response from the middle to the corner, and the overlaps' disagreement.

    Parameters
    ----------
    fit : ResponseFit or None
    orientation : RelativeOrientation
        Names the heads.

    Returns
    -------
    Figure
        Upper panels: per band, relative to the mean of the heads in the middle, with one standard
        deviation. Lower panel: robust rms of the log ratio of two heads, band by band.

    Notes
    -----
    The standard deviation at a distance is that of the coefficients as if they were independent;
    the overlaps know the sum of the radial terms better than each.
    """
    if fit is None or not fit.overlaps:
        return style.nothing("No two heads overlap in pixels, so nothing tells their responses.")
    n_bands = fit.response.coefficients.shape[1]
    names = [style.plain(head.name) for head in orientation.heads]
    with style.applied():
        fig = style.figure(figsize=(style.WIDTH, 3.35 + 0.26 * len(fit.overlaps)))
        parts: Any = fig.subfigures(2, 1, height_ratios=[2.35, 0.75 + 0.26 * len(fit.overlaps)])
        upper, lower = parts
        axes = upper.subplots(1, n_bands, sharey=True, squeeze=False)[0]
        for band, ax in enumerate(axes):
            _draw_band(ax, fit, band)
            ax.set_title(_band(band, n_bands))
        axes[0].set_ylabel("response (%)")
        _draw_overlaps(lower.subplots(), fit.overlaps, names)
        style.legend_below(fig, _handles(names), ncols=len(names) + 3)
    return fig


def _band(i: int, n: int) -> str:
    return BANDS[n][i] if n in BANDS else f"band {i + 1}"


def _draw_band(ax: Axes, fit: ResponseFit, band: int) -> None:
    """Draw the response of all heads in one band over the distance from the middle."""
    r = np.linspace(0, 1, 61)
    powers = np.stack([np.ones_like(r), r**2, r**4], axis=1)
    for k, head in enumerate(fit.response.coefficients[:, band]):
        log = powers @ head
        sigma = np.sqrt(powers**2 @ fit.sigma[k, band] ** 2)
        ax.fill_between(
            *(r, 100 * np.exp(log - sigma), 100 * np.exp(log + sigma)),
            color=style.colour(k),
            alpha=0.16,
            lw=0,
        )
        ax.plot(r, 100 * np.exp(log), color=style.colour(k))
    ax.set(xlim=(0, 1), xlabel="distance over the corner's (1)")


def _draw_overlaps(ax: Axes, overlaps: Sequence[OverlapResponse], names: Sequence[str]) -> None:
    """Draw for every pair of heads and band what their ratio was, is, and cannot be below."""
    n_bands = len(overlaps[0].before)
    offset = 0.17 * (np.arange(n_bands) - (n_bands - 1) / 2)
    for line, one in enumerate(overlaps):
        y = line + offset
        before, after, floor = (100 * np.expm1(v) for v in (one.before, one.after, one.floor))
        ax.hlines(y, after, before, color=style.SOFT, lw=0.8, alpha=0.7)
        ax.plot(before, y, "o", ms=4.5, mfc=style.PAPER, mec=style.INK, mew=1.0)
        ax.plot(after, y, "o", ms=4.5, color=style.INK)
        ax.plot(floor, y, "|", ms=6, color=style.colour(5), mew=1.3)
    labels = [f"{names[o.head_a]}, {names[o.head_b]}" for o in overlaps]
    ax.set(xscale="log", yticks=range(len(overlaps)), yticklabels=labels)
    ax.set(ylim=(len(overlaps) - 0.5, -0.5), xlabel="disagreement, robust rms (%)")
    _percent_axis(ax, overlaps)
    every = [np.concatenate([getattr(o, name) for o in overlaps]) for name in ("before", "after")]
    worst = [100 * float(np.expm1(v).max()) for v in every]
    style.heading(
        ax,
        "the same ground in two heads",
        f"at most {worst[0]:.1f} % as taken and {worst[1]:.2f} % after; one dot per band",
    )


def _percent_axis(ax: Axes, overlaps: Sequence[OverlapResponse]) -> None:
    """Set limits and round numbers of a logarithmic axis in per cent."""
    values = np.concatenate([np.concatenate([o.before, o.after, o.floor]) for o in overlaps])
    percent = 100 * np.expm1(values[values > 0]) if (values > 0).any() else np.array([1.0])
    low, high = float(percent.min()) / 1.4, float(percent.max()) * 1.4
    rounds = np.array([m * 10.0**e for e in range(-4, 3) for m in (1, 2, 5)])
    ax.set(xlim=(low, high), xticks=rounds[(rounds >= low) & (rounds <= high)])
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(axis="x", which="minor", length=0)
    ax.grid(visible=False, axis="y")


def _handles(names: Sequence[str]) -> list[Any]:
    heads = [Line2D([], [], color=style.colour(k), label=name) for k, name in enumerate(names)]
    dot: dict[str, Any] = {"color": "none", "marker": "o", "ms": 4.5, "markeredgecolor": style.INK}
    return [
        *heads,
        Line2D([], [], mfc=style.PAPER, label="as taken", **dot),
        Line2D([], [], mfc=style.INK, label="equalised", **dot),
        Line2D([], [], color="none", marker="|", mec=style.colour(5), mew=1.3, ms=7, label="noise"),
    ]
