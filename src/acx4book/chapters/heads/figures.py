"""Figures of the heads: residuals, distortion, correlations, a wrong focal length (4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from acx4book.chapters.heads.tables import SYMBOLS, control_rms, variance
from acx4book.typesetting import matrix, style
from acx4book.typesetting.field import Residuals, field_figure
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.correlations import EXTERIOR, Correlations
from acx4lib.calibration.heads import Heads, above_gnss
from acx4lib.calibration.lens import radial_profile
from acx4lib.expected import Array
from acx4lib.geometry.frames import log

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


def correlations(found: Mapping[str, Correlations], *, claim: float | None = None) -> Figure:
    """Draw how the interior orientation of the heads correlates with the exterior.

    Parameters
    ----------
    found : mapping of str to Correlations
        By head.
    claim : float, optional
        Bound that the paper gives.

    Returns
    -------
    Figure
        Left the largest of all heads and images by pairs of parameters, right how many of all
        correlations stay below a value.
    """
    if not found:
        return style.nothing(NO_HEADS)
    if not any(c.values.size for c in found.values()):
        return style.nothing("No parameter is estimated in oriented images.")
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


# --- a wrong focal length --------------------------------------------------------------------


def held_focal_lengths(held: Mapping[float, Heads]) -> Figure:
    """Draw what the calibration of the heads shows when their focal lengths are held wrong.

    Parameters
    ----------
    held : mapping of float to Heads
        By the change of all focal lengths, mm; at least two.

    Returns
    -------
    Figure
        Above what could give a wrong focal length away, below the parameters that take it up.
    """
    tried, change = list(held.values()), np.array(list(held))
    names = [name for name in tried[0].bundles if all(name in h.bundles for h in tried)]
    if not names:
        return style.nothing(NO_HEADS)
    start = int(np.argmin(np.abs(change)))
    with style.applied():
        fig, axes = style.subplots(2, 3, figsize=(style.WIDTH, 4.6), sharex=True)
        for i, name in enumerate(names):
            curves = _reactions([h.bundles[name] for h in tried], start)
            for ax, values in zip(axes.flat, curves, strict=True):
                ax.plot(change, values, "o-", color=style.colour(i), label=style.plain(name))
        labels = (
            "variance factor (1)",
            "rms at control points (mm)",
            "camera above GNSS (m)",
            "change of $x_p$ (mm)",
            "change of $y_p$ (mm)",
            "turned by (deg)",
        )
        ticks = [f"{c:+g}".replace("-", "\N{MINUS SIGN}") if c else "0" for c in change]
        for ax, label in zip(axes.flat, labels, strict=True):
            ax.set_ylabel(label)
            ax.set_xticks(change, ticks)
        axes[0, 0].set_ylim(0, 1.35 * max(map(variance, tried)))
        axes[0, 1].set_ylim(0, 1600 * max(map(control_rms, tried)))
        axes[0, 2].axhline(0.0, color=style.BRICK, lw=0.9, zorder=1)
        for ax in axes[1]:
            ax.set_xlabel("change of the held $f$ (mm)")
        style.legend_below(fig, axes[0, 0].get_legend_handles_labels()[0])
    return fig


def _reactions(fits: Sequence[Bundle], start: int) -> list[Array]:
    """Return what reacts in one head: fit, control, height, principal point, attitude."""
    control = [fit.solution.group("control_point").v for fit in fits]
    xy = np.array([[fit.cameras[0].interior.xp, fit.cameras[0].interior.yp] for fit in fits])
    R_m_c = fits[start].T_m_c.R
    turned = [log(np.swapaxes(R_m_c, -1, -2) @ fit.T_m_c.R).mean(axis=0) for fit in fits]
    return [
        np.array([fit.solution.sigma0_sq for fit in fits]),
        np.array([1000 * np.sqrt(np.mean(v**2)) if len(v) else np.nan for v in control]),
        np.array([above_gnss(fit) for fit in fits]),
        *(xy - xy[start]).T,
        np.degrees(np.linalg.norm(turned, axis=1)),
    ]
