"""Figures of the heads: residuals in the image, distortion, correlations (section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from acx4book.chapters.heads.tables import SYMBOLS
from acx4book.typesetting import matrix, style
from acx4book.typesetting.field import Residuals, field_figure
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.correlations import EXTERIOR, interior_exterior
from acx4lib.calibration.lens import radial_profile
from acx4lib.expected import Array

NO_HEADS = "No head could be adjusted."

# --- residuals -------------------------------------------------------------------------------


def mean_residuals(fits: Mapping[str, Bundle]) -> Figure:
    """Draw the mean residual vectors of the cells of every head's image.

    Parameters
    ----------
    fits : mapping of str to Bundle

    Returns
    -------
    Figure
        Vectors longer than three of their standard deviations stand out in colour: such are
        distortion that the model does not have.
    """
    if not fits:
        return style.nothing(NO_HEADS)
    return field_figure(
        {
            name: Residuals(
                camera=fit.network.block.cameras[0],
                colrow=fit.network.image_points.colrow,
                v=fit.solution.group("image_point").v,
                sigma_px=fit.network.image_points.sigma_px,
            )
            for name, fit in fits.items()
        }
    )


# --- distortion ------------------------------------------------------------------------------


def radial_distortion(
    fits: Mapping[str, Bundle],
    *,
    printed_px: Mapping[str, float] | None = None,
    claim_px: float | None = None,
) -> Figure:
    """Draw the radial distortion of every head, with one standard deviation, up to its corner.

    Parameters
    ----------
    fits : mapping of str to Bundle
    printed_px : mapping of str to float, optional
        The paper's at the corner, by head.
    claim_px : float, optional
        What the paper's text says of the border.

    Returns
    -------
    Figure
    """
    if not fits:
        return style.nothing(NO_HEADS)
    printed_px = printed_px or {}
    with style.applied():
        fig, (wide, near) = style.subplots(1, 2, figsize=(style.WIDTH, 3.3), width_ratios=[1.5, 1])
        lowest, highest, corner = np.inf, -np.inf, 0.0
        for i, (name, fit) in enumerate(fits.items()):
            r, px, sigma = radial_profile(fit)
            for ax in (wide, near):
                ax.plot(r, px, color=style.colour(i), label=style.plain(name))
                ax.fill_between(r, px - sigma, px + sigma, color=style.colour(i), alpha=0.25, lw=0)
            ends = [px[-1], printed_px.get(name, px[-1])]
            if name in printed_px:
                near.plot(
                    r[-1], ends[1], "D", ms=4.5, mfc=style.PAPER, mec=style.colour(i), mew=1.3
                )
            lowest, highest = min(lowest, 0.93 * min(ends)), max(highest, 1.05 * max(ends))
            corner = max(corner, r[-1])
        highest = max(highest, 1.04 * (claim_px or 0.0))
        near.set(xlim=(0.955 * corner, 1.008 * corner), ylim=(lowest, highest))
        wide.yaxis.set_major_locator(MaxNLocator(7, integer=True))
        wide.set(xlim=(0, 1.02 * corner))
        style.heading(wide, "radial distortion", "from the principal point to the corner")
        style.heading(near, "at the corner", r"bands: $\pm 1\sigma$")
        handles = wide.get_legend_handles_labels()[0]
        handles += _claims((wide, near), claim_px, some=bool(printed_px))
        for ax in (wide, near):
            ax.set(xlabel="radius (mm)", ylabel="distortion (px)")
        style.legend_below(fig, handles)
    return fig


def _claims(axes: Sequence[Axes], claim_px: float | None, *, some: bool) -> list[Line2D]:
    """Draw the paper's statement and return the legend's handles of what is the paper's."""
    handles = []
    if some:
        label = "Table 1 of the paper"
        handles.append(
            Line2D([], [], ls="", marker="D", mfc=style.PAPER, mec=style.SOFT, label=label)
        )
    if claim_px is not None:
        for ax in axes:
            ax.axhline(claim_px, color=style.PRINTED, ls=(0, (4, 2)), lw=1)
        label = f"its text: about {claim_px:g} px"
        handles.append(Line2D([], [], color=style.PRINTED, ls=(0, (4, 2)), lw=1, label=label))
    return handles


# --- correlations ----------------------------------------------------------------------------


def correlations(fits: Mapping[str, Bundle], *, claim: float | None = None) -> Figure:
    """Draw how the interior orientation of the heads correlates with the exterior.

    Parameters
    ----------
    fits : mapping of str to Bundle
    claim : float, optional
        Bound that the paper gives.

    Returns
    -------
    Figure
        Left the largest of all heads and images by pairs of parameters, right how many of all
        correlations stay below a value.
    """
    if not fits:
        return style.nothing(NO_HEADS)
    found = {name: interior_exterior(fit) for name, fit in fits.items()}
    with style.applied():
        fig, (pairs, shares) = style.subplots(
            1, 2, figsize=(style.WIDTH, 3.2), width_ratios=[1.15, 1]
        )
        _draw_pairs(
            pairs,
            next(iter(found.values())).interior,
            np.max([c.largest for c in found.values()], 0),
        )
        for i, (name, c) in enumerate(found.items()):
            values = np.sort(np.abs(c.values), axis=None)
            share = np.arange(1, len(values) + 1) / len(values)
            shares.plot(values, 100 * share, color=style.colour(i), label=style.plain(name))
        shares.set(xlim=(0, 1), ylim=(0, 100), xlabel="absolute correlation (1)")
        shares.set_ylabel("share of all below (%)")
        handles = shares.get_legend_handles_labels()[0]
        if claim is not None:
            line = shares.axvline(claim, color=style.PRINTED, ls=(0, (4, 2)), lw=1)
            line.set_label(f"the paper: all below {claim:g}")
            handles.append(line)
        style.heading(pairs, "largest correlations", "of all heads and images")
        style.heading(shares, "all correlations", "interior with exterior orientation")
        style.legend_below(fig, handles)
    return fig


def _draw_pairs(ax: Axes, interior: Sequence[str], largest: Array) -> None:
    matrix.signed_cells(ax, largest)
    ax.set_aspect("auto")
    ax.set_xticks(np.arange(len(EXTERIOR)) + 0.5, [SYMBOLS[name] for name in EXTERIOR], size=9)
    ax.set_yticks(np.arange(len(interior)) + 0.5, [SYMBOLS[name] for name in interior], size=9)
    ax.set(xlabel="exterior orientation", ylabel="interior orientation")
    for i, j in np.ndindex(*largest.shape):
        matrix.write(ax, i, j, float(largest[i, j]), f"{largest[i, j]:.2f}")
