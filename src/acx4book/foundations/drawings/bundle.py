"""Figures of the bundle: zeros of its matrices, its cost, changes of a camera in the image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from acx4book.foundations import adjusting
from acx4book.foundations.adjusting import View
from acx4book.typesetting.matrix import cells
from acx4book.typesetting.style import (
    BLUE,
    BRICK,
    ORANGE,
    PLUM,
    SKY,
    SMALL,
    SOFT,
    TEAL,
    WIDTH,
    applied,
    bare,
    legend_below,
    subplots,
)
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block

KINDS = {"boresight": BRICK, "poses": BLUE, "points": TEAL, "poses with points": SKY}
"""Colours of entries by the unknowns that they belong to."""

CHANGE_MM = 1.0
"""Change of f and of x_p in the figure of their residuals."""

ROUNDING = 1e-8
"""Length of a step, in standard deviations, below which there are only rounding errors."""


def patterns(A: Array, reduced: Array) -> Figure:
    """Draw where the example's design matrix and normal matrices are not zero.

    Parameters
    ----------
    A : ndarray, shape (46, 33)
        Of `adjusting.equations`.
    reduced : ndarray, shape (27, 27)
        Normal matrix after the points were eliminated.
    """
    owner = np.zeros(A.shape[1], dtype=int)
    owner[adjusting.POSES], owner[adjusting.POINTS] = 1, 2
    between = np.array([[0, 0, 0], [0, 1, 3], [0, 3, 2]])
    kinds = between[owner[:, None], owner]
    with applied():
        fig, axes = subplots(1, 3, figsize=(WIDTH, 4.1))
        _cells(axes[0], A != 0, np.broadcast_to(owner, A.shape), f"$A$: {len(A)} rows")
        _cells(axes[1], A.T @ A != 0, kinds, f"$N$: {A.shape[1]} rows")
        _cells(axes[2], reduced != 0, kinds[:27, :27], f"$N$ reduced: {len(reduced)} rows")
        for row, text in ((8, "image points"), (22, "positions"), (34, "attitudes"), (43, "P, Q")):
            axes[0].text(-0.8, row, text, rotation=90, ha="right", va="center", fontsize=SMALL)
        patches = [Patch(color=colour, label=kind) for kind, colour in KINDS.items()]
        legend_below(fig, patches, ncols=4)
    return fig


def _cells(ax: Axes, filled: Array, kinds: Index, title: str) -> None:
    for kind, colour in enumerate(KINDS.values()):
        cells(ax, filled & (kinds == kind), colour)
    bare(ax)
    ax.set(xticks=[], yticks=[], xlim=(0, filled.shape[1]), ylim=(len(filled), 0), title=title)
    ax.set_aspect("equal", anchor="N")


def of_block(block: Block) -> Figure:
    """Draw which images see which points, and which images share a point."""
    seen = np.zeros((len(block.images), len(block.points)))
    seen[block.image_points.image_idx, block.image_points.point_idx] = 1.0
    first = np.argmax(seen, axis=0)
    order = np.argsort(first, kind="stable")
    shared = seen @ seen.T
    with applied():
        fig, (left, right) = subplots(1, 2, figsize=(WIDTH, 3.0), width_ratios=[2.2, 1])
        cells(left, seen[:, order] > 0, SKY, gap=0.0)
        left.set(xlabel="points, in order of first image (1)", ylabel="images (1)")
        left.set_title("image sees point")
        cells(right, shared > 0, BLUE)
        right.set(xlabel="images (1)", ylabel="images (1)", title="images share a point")
        right.set_aspect("equal", anchor="N")
        for ax, matrix in ((left, seen), (right, shared)):
            ax.set(xlim=(0, matrix.shape[1]), ylim=(len(matrix), 0))
            ax.grid(visible=False)
    return fig


def cost(*, points_per_image: int = 100, rays: float = 6.0, width: int = 60) -> Figure:
    """Draw the multiplications of one iteration by the size of the block, in three ways.

    Parameters
    ----------
    points_per_image : int
        Number of points divided by the number of images.
    rays : float
        Images of a point.
    width : int
        Images between two that share a point, at most.
    """
    n_images = np.unique(np.geomspace(4, 10_000, 40).astype(int))
    ways: dict[str, tuple[str, Array]] = {
        "whole system": (BRICK, np.zeros(len(n_images))),
        "points eliminated": (BLUE, np.zeros(len(n_images))),
        "and a band": (TEAL, np.zeros(len(n_images))),
    }
    for i, n in enumerate(n_images.tolist()):
        n_points = points_per_image * n
        band = adjusting.banded_cholesky(6 * n, 6 * width)
        elimination = adjusting.elimination(n_points, rays, n_shared=14)
        ways["whole system"][1][i] = adjusting.whole(n, n_points, n_shared=14)
        ways["points eliminated"][1][i] = adjusting.reduced(n, n_points, rays, n_shared=14)
        ways["and a band"][1][i] = elimination + band
    with applied():
        fig, ax = subplots(figsize=(WIDTH, 3.2))
        for name, (colour, count) in ways.items():
            ax.loglog(n_images, count, color=colour)
            label: dict[str, Any] = {"color": colour, "fontsize": SMALL, "va": "center"}
            ax.annotate(name, (1.15 * n_images[-1], count[-1]), **label)
        ax.set(xlabel="images (1)", ylabel="multiplications (1)", xlim=(4, 60_000))
    return fig


def convergence(steps: Mapping[str, Sequence[float]]) -> Figure:
    """Draw the lengths of the steps of an iteration, from several starts.

    Parameters
    ----------
    steps : mapping of str to sequence of float
        By the start: lengths of the steps in standard deviations of the unknowns; those below
        `ROUNDING` are drawn there.
    """
    with applied():
        fig, ax = subplots(figsize=(WIDTH, 2.9))
        colours = (BLUE, TEAL, ORANGE, PLUM)
        for (name, lengths), colour in zip(steps.items(), colours, strict=False):
            number = np.arange(1, len(lengths) + 1)
            ax.semilogy(number, np.maximum(lengths, ROUNDING), "o-", color=colour, label=name)
        ax.axhline(1.0, color=SOFT, lw=1.0, ls="--")
        ax.annotate(
            "one standard deviation", (len(lengths), 2.0), ha="right", color=SOFT, fontsize=SMALL
        )
        ax.set(xlabel="step (1)", ylabel="length (1)")
        ax.legend(title="κ wrong by", loc="lower left")
    return fig


def what_is_left(views: Mapping[str, View]) -> Figure:
    """Draw a change of the camera in an image, and the part that no change of pose can hide.

    Parameters
    ----------
    views : mapping of str to View
        By a title; the change itself is drawn for the first.
    """
    parts = (("$f$", 0, BLUE), ("$x_p$", 1, ORANGE))
    with applied():
        fig, axes = subplots(2, 1 + len(views), figsize=(WIDTH, 2.7))
        first = next(iter(views.values()))
        for row, (name, column, colour) in zip(axes, parts, strict=True):
            change = CHANGE_MM * first.by_camera[:, column].reshape(-1, 2)
            _arrows(row[0], first.xy, change, colour, factor=5.0)
            row[0].set_ylabel(f"{name} + {CHANGE_MM:g} mm")
            for ax, view in zip(row[1:], views.values(), strict=True):
                residuals = CHANGE_MM * view.left[:, column].reshape(-1, 2)
                _arrows(ax, view.xy, residuals, colour, factor=100.0)
        axes[0, 0].set_title("the change (× 5)")
        for ax, title in zip(axes[0, 1:], views, strict=True):
            ax.set_title(f"{title} (× 100)")
    return fig


def _arrows(ax: Axes, xy: Array, d: Array, colour: str, *, factor: float) -> None:
    """Draw displacements, mm in the image, enlarged; a point without any is a dot."""
    ax.plot(*xy.T, ".", ms=2.5, color=SOFT)
    ax.quiver(
        *xy.T, *(factor * d).T, color=colour, angles="xy", scale_units="xy", scale=1.0, width=0.008
    )
    bare(ax)
    ax.set(xticks=[], yticks=[], xlim=(-26, 26), ylim=(-20, 20))
    ax.set_aspect("equal")
