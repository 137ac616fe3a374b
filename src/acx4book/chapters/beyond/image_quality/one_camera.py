"""What one camera, with smooth distortion of any kind, takes up of the synthetic image's seams.

Chapter 12 stored the residuals of a single step over the synthetic image, of measurements without
noise, at two flying heights (``make chain``). Everything that one camera can do is fitted to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, correct_jacobian, xy_from_colrow

STORED = Path(str(resources.files("acx4book.chapters.beyond.image_quality") / "stored"))

RADIAL = ("f", "xp", "yp", "k1", "k2", "k3")
BROWN = (*RADIAL, "p1", "p2")

WAVES = ((1, 0), (0, 1), (1, 1), (1, -1))
"""Whole waves along both sides of the image: a Fourier series of the first order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
    """Residuals over the synthetic image, at two flying heights.

    Attributes
    ----------
    camera : Camera
        The synthetic one.
    colrow, d_px : ndarray, shape (n, 2)
        Places and residuals, px.
    head : ndarray of str, shape (n,)
        From which a pixel is taken.
    height_m : ndarray, shape (n,)
        Flying height above the ground.
    """

    camera: Camera
    colrow: Array
    d_px: Array
    head: np.ndarray
    height_m: Array


def pattern(camera: Camera) -> Pattern:
    """Return the residuals that chapter 12 stored.

    Parameters
    ----------
    camera : Camera
        The synthetic one.
    """
    table = pd.read_csv(STORED / "closed_chain_pattern.csv")
    return Pattern(
        camera=camera,
        colrow=table[["col_px", "row_px"]].to_numpy(),
        d_px=table[["d_col_px", "d_row_px"]].to_numpy(),
        head=table["head"].to_numpy(),
        height_m=table["height_m"].to_numpy(dtype=float),
    )


def effects(pattern: Pattern, free: tuple[str, ...]) -> Array:
    """Return what interior orientation, boresight and lever arm move, px per unit.

    Parameters
    ----------
    pattern : Pattern
    free : tuple of str
        Interior parameters, the columns before three of the boresight and three of the lever arm.

    Returns
    -------
    A : ndarray, shape (n, 2, len(free) + 6)
        The effect of the lever arm is in proportion to 1 / H.
    """
    camera = pattern.camera
    xy, f = xy_from_colrow(camera, pattern.colrow), camera.interior.f
    interior = correct_jacobian(camera.interior, xy)
    interior[:, :, 0] = xy / f
    own = interior[:, :, [INTERIOR.index(name) for name in free]]
    (x, y), one, zero = xy.T, np.ones(len(xy)), np.zeros(len(xy))
    boresight = [[f + x * x / f, x * y / f, -y], [x * y / f, f + y * y / f, x]]
    lever = [[f * one, zero, x], [zero, f * one, y]]
    turned, moved = (np.moveaxis(np.array(part), 2, 0) for part in (boresight, lever))
    mm = np.concatenate([own, turned, moved / pattern.height_m[:, None, None]], axis=2)
    return mm / np.array([camera.pixel_mm, -camera.pixel_mm])[:, None]


def waves(pattern: Pattern) -> Array:
    """Return sixteen terms of a Fourier series over the image, shape (n, 2, 16).

    Notes
    -----
    After Tang, Fritsch and Cramer [1]_: cos and sin of m u + n v, in x and in y, where u and v
    go from -pi to pi over the image. The constant term is left to the principal point.

    References
    ----------
    .. [1] R. Tang, D. Fritsch and M. Cramer, "New rigorous and flexible Fourier self-calibration
       models for airborne camera calibration", ISPRS Journal 71, 2012.
    """
    camera = pattern.camera
    size = np.array([camera.width_px, camera.height_px])
    phase = 2 * np.pi * (pattern.colrow / size - 0.5) @ np.array(WAVES).T
    own = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    none = np.zeros_like(own)
    return np.stack([np.hstack([own, none]), np.hstack([none, own])], axis=1)


def left(d_px: Array, A: Array) -> Array:
    """Return what a fit by least squares leaves of vectors.

    Parameters
    ----------
    d_px : ndarray, shape (n, 2)
    A : ndarray, shape (n, 2, k)
        What each unknown moves; columns may depend on each other.
    """
    rows = A.reshape(-1, A.shape[2])
    rows = rows / np.linalg.norm(rows, axis=0)
    found = np.linalg.lstsq(rows, d_px.ravel(), rcond=1e-9)[0]
    return d_px - (rows @ found).reshape(d_px.shape)


def left_by_heads(pattern: Pattern, A: Array) -> Array:
    """Return what remains where each head has unknowns of its own."""
    out = np.empty_like(pattern.d_px)
    for name in np.unique(pattern.head):
        own = pattern.head == name
        out[own] = left(pattern.d_px[own], A[own])
    return out


def left_table(pattern: Pattern, fields: dict[str, Array]) -> pd.DataFrame:
    """Return the root mean square of a coordinate, by what was fitted and by flying height, px."""
    return pd.DataFrame(
        {
            f"From {h:.0f} m (px)": [
                np.sqrt(np.mean(d[pattern.height_m == h] ** 2)) for d in fields.values()
            ]
            for h in np.unique(pattern.height_m)
        },
        index=pd.Index(fields, name="Fitted"),
    )


def left_figure(pattern: Pattern, fields: dict[str, Array]) -> Figure:
    """Draw residuals at the lower flying height, in the colours of the heads, to one scale."""
    low = pattern.height_m == pattern.height_m.min()
    own = {title: d[low] for title, d in fields.items()}
    key = style.round_length(max(float(np.hypot(*d.T).max()) for d in own.values()))
    names, head = np.unique(pattern.head[low], return_inverse=True)
    with style.applied():
        fig, axes = style.subplots(1, len(own), figsize=(style.WIDTH, 3.9), sharey=True)
        for ax, (title, d) in zip(axes, own.items(), strict=True):
            _draw(ax, pattern.camera, pattern.colrow[low], d / key, head)
            style.heading(ax, title[:1].upper() + title[1:], f"rms {np.sqrt(np.mean(d**2)):.2f} px")
        axes[0].set_ylabel("row (px)")
        handles = [Line2D([], [], color=style.colour(k), label=n) for k, n in enumerate(names)]
        arrows = Line2D([], [], ls="", label=f"distance of arrows: {key:g} px")
        style.legend_below(fig, [*handles, arrows])
    return fig


def _draw(ax: Axes, camera: Camera, colrow: Array, in_key: Array, head: np.ndarray) -> None:
    """Draw every second node in rows and columns."""
    column, row = (np.unique(x, return_inverse=True)[1] for x in colrow.T)
    some = (column % 2 == 0) & (row % 2 == 0)
    gap = 2 * float(np.min(np.diff(np.unique(colrow[:, 0]))))
    ax.quiver(
        *colrow[some].T,
        *(gap * in_key[some]).T,
        color=[style.colour(k) for k in head[some]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.007,
        zorder=3,
    )
    ax.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal")
    ax.set(xlabel="column (px)", xticks=[0, 5000, 10000])
