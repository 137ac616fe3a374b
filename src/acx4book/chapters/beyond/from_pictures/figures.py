"""Figures of the chapter: a place in several pictures, and points over a picture."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from acx4book.chapters.beyond.from_pictures.exact import Errors
from acx4book.chapters.beyond.from_pictures.whole import REDUCE
from acx4book.typesetting import style
from acx4lib.expected import Index, Mask
from acx4lib.flight.block import Block
from acx4lib.measuring.levels import Matched
from acx4lib.measuring.measure import Outcome
from acx4lib.measuring.pictures.patches import laid_patches, own_patches
from acx4lib.measuring.pictures.views import View, pixels_of_view, transferred

SIDE = 49
"""Of the patches that are shown, px."""

CHOSEN = ("C1-05", "C2-04", "C4-03", "C5-05")
"""The first one's geometry is that of the others: opposite strips and crossing ones."""

NAMES = ("the first", "opposite", "across, higher", "across, back")

SHOWN = 4
"""Every so many pixels of a picture are shown."""


def patches(outcome: Outcome) -> Figure:
    """Draw a place in four pictures: as it is there, and laid into the first one's pixels.

    Parameters
    ----------
    outcome : Outcome
        Of measuring the chapter's flight; its pictures are still there.
    """
    views = [_view(outcome, name) for name in CHOSEN]
    at = _shared_corner(outcome.matched, views)
    surface = outcome.matched.surface
    with style.applied():
        fig, axes = style.subplots(2, len(views), figsize=(style.WIDTH, 3.7))
        for k, view in enumerate(views):
            there = np.rint(transferred(views[0], view, surface, at.astype(float))).astype(int)
            as_it_is = own_patches(view, there, SIDE).grey
            laid = laid_patches(views[0], view, surface, at, SIDE).grey if k else as_it_is
            for ax, image in zip(axes[:, k], (as_it_is, laid), strict=True):
                ax.imshow(image, cmap="gray", interpolation="nearest")
                style.bare(ax)
                ax.set(xticks=[], yticks=[])
            axes[0, k].set_title(f"{view.name}\n{NAMES[k]}")
    return fig


def _view(outcome: Outcome, name: str) -> View:
    return next(view for view in outcome.matched.views if view.name == name)


def _shared_corner(matched: Matched, views: list[View]) -> Index:
    """Return the corner of the first view that was found in most of the others, (1, 2)."""
    number = {view.name: k for k, view in enumerate(matched.views)}
    wanted = [number[view.name] for view in views]
    rays = matched.rays
    first = rays.view == wanted[0]
    own = np.flatnonzero(first & np.all(rays.colrow == np.rint(rays.colrow), axis=1))
    seen = np.isin(rays.view, wanted)
    count = np.bincount(rays.point, seen)[rays.point[own]]
    best = own[int(np.argmax(count))]
    return np.rint(rays.colrow[best]).astype(np.intp)[None]


def cover(outcome: Outcome, block: Block, name: str = "C2-04") -> Figure:
    """Draw the tie points and the control points of a picture over it.

    Parameters
    ----------
    outcome : Outcome
    block : Block
        As it was measured.
    name : str
        Of the picture.
    """
    view = _view(outcome, name)
    small = pixels_of_view(view)[::SHOWN, ::SHOWN].mean(axis=2)
    points = block.image_points
    own = points.image_idx == block.images.names.index(name)
    rays = block.rays[points.point_idx[own]]
    colrow = points.colrow[own] / REDUCE / SHOWN
    control = np.isin(points.point_idx[own], block.control.point_idx)
    with style.applied():
        fig, ax = style.subplots(figsize=(0.8 * style.WIDTH, 4.4))
        ax.imshow(small, cmap="gray", vmin=0, vmax=2.2 * np.median(small))
        for least, most, colour, words in (
            (2, 2, style.ORANGE, "2 rays"),
            (3, 4, style.TEAL, "3 or 4"),
            (5, 99, style.BLUE, "5 and more"),
        ):
            some = ~control & (rays >= least) & (rays <= most)
            ax.plot(*colrow[some].T, "o", ms=3.5, color=colour, mec="white", mew=0.4, label=words)
        ax.plot(*colrow[control].T, "^", ms=7, color=style.BRICK, mec="white", label="control")
        style.bare(ax)
        ax.set(xticks=[], yticks=[])
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=4)
    return fig


def sizes(ties: Errors, alike: Mask) -> Figure:
    """Draw how large the errors of tie points are, for one flying height and for both.

    Parameters
    ----------
    ties : Errors
    alike : ndarray of bool, shape (n,)
        Measurements of points that pictures of one height alone show.
    """
    length = np.hypot(*ties.off.T)
    with style.applied():
        fig, ax = style.subplots(figsize=(0.8 * style.WIDTH, 3.0))
        for own, colour, words in (
            (alike, style.TEAL, "seen from one height"),
            (~alike, style.BLUE, "seen from both heights"),
        ):
            at = np.sort(length[own])
            share = np.arange(1, len(at) + 1) / max(len(at), 1)
            ax.plot(at, share, color=colour, label=words)
        ax.set(xscale="log", xlim=(1e-3, 2), ylim=(0, 1), ylabel="share of the measurements")
        ax.set_xlabel("error, at most (px)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig
