"""Figures of what would be seen if something were wrong with the heads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from acx4book.chapters.heads.figures import NO_HEADS
from acx4book.chapters.heads.held_focal_length import HeldFocalLength
from acx4book.typesetting import style
from acx4lib.bundle.adjust import Bundle
from acx4lib.expected import Array
from acx4lib.geometry.frames import log


def held_focal_lengths(held: Sequence[HeldFocalLength]) -> Figure:
    """Draw what the calibration of the heads shows when their focal lengths are held wrong.

    Parameters
    ----------
    held : sequence of HeldFocalLength
        All heads changed by the same, at least two different changes.

    Returns
    -------
    Figure
        Above what could give a wrong focal length away, below the parameters that take it up.
    """
    names = [name for name in held[0].bundles if all(name in h.bundles for h in held)]
    if not names:
        return style.nothing(NO_HEADS)
    change = np.array([h.change_mm[0] for h in held])
    start = int(np.argmin(np.abs(change)))
    with style.applied():
        fig, axes = style.subplots(2, 3, figsize=(style.WIDTH, 4.6), sharex=True)
        for i, name in enumerate(names):
            curves = _reactions([h.bundles[name] for h in held], start)
            curves.insert(2, np.array([h.above_gnss_m[name] for h in held]))
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
        axes[0, 0].set_ylim(0, 1.35 * max(h.sigma0_sq for h in held))
        axes[0, 1].set_ylim(0, 1600 * max(h.control_rms_m for h in held))
        axes[0, 2].axhline(0.0, color=style.BRICK, lw=0.9, zorder=1)
        for ax in axes[1]:
            ax.set_xlabel("change of the held $f$ (mm)")
        style.legend_below(fig, axes[0, 0].get_legend_handles_labels()[0])
    return fig


def _reactions(fits: Sequence[Bundle], start: int) -> list[Array]:
    """Return what reacts in one head: fit, control, principal point, attitude."""
    control = [fit.solution.group("control_point").v for fit in fits]
    xy = np.array([[fit.cameras[0].interior.xp, fit.cameras[0].interior.yp] for fit in fits])
    R_m_c = fits[start].T_m_c.R
    turned = [log(np.swapaxes(R_m_c, -1, -2) @ fit.T_m_c.R).mean(axis=0) for fit in fits]
    return [
        np.array([fit.solution.sigma0_sq for fit in fits]),
        np.array([1000 * np.sqrt(np.mean(v**2)) if len(v) else np.nan for v in control]),
        *(xy - xy[start]).T,
        np.degrees(np.linalg.norm(turned, axis=1)),
    ]
