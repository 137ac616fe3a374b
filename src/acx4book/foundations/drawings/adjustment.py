"""Figures of the chapters on least squares and the bundle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Patch

from acx4book.foundations import adjusting, example
from acx4book.foundations.adjusting import Fit, View
from acx4book.typesetting.matrix import cells
from acx4book.typesetting.style import (
    BLUE,
    BRICK,
    INK,
    MUTED,
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
from acx4lib.block import Block
from acx4lib.bundle.free_network import FreeNetwork
from acx4lib.expected import Array, Index
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares import statistics

# --- where rays meet, what sigma promises, who checks whom -----------------------------------


EAST_HEIGHT = np.ix_([0, 2], [0, 2])
OF_STRIP = {"A": BLUE, "B": ORANGE}
TWO, FOUR = BLUE, TEAL
"""Colours of results from two images and from all four."""

PLUS_MINUS = np.array([-1.0, 1.0])

ENLARGED = 150
"""Factor on the ellipses of a map."""


def where_rays_meet(T_m_c: Pose, results: Sequence[tuple[Array, Fit]]) -> Figure:
    """Draw the rays to P from the side, and the ellipses of two and of four images, enlarged.

    Parameters
    ----------
    T_m_c : Pose
        Of the four images.
    results : sequence of (ndarray, Fit)
        P from two images, and from four: `adjusting.intersected`.
    """
    with applied():
        fig, (side, *near) = subplots(1, 3, figsize=(WIDTH, 4.0))
        P = example.points()[0]
        for name, r in zip(example.EXPOSURES["image"], T_m_c.r, strict=True):
            colour, below = OF_STRIP[name[0]], name[0] == "B"
            side.plot(*np.transpose([r, P])[[0, 2]], color=colour, lw=1.2)
            side.plot(r[0], r[2], "v", color=colour, ms=6)
            outward = float(np.sign(r[0])) * 10, -14 if below else 6
            label: dict[str, Any] = {"ha": "center", "color": colour, "fontsize": SMALL}
            side.annotate(name, r[[0, 2]], outward, textcoords="offset points", **label)
        side.plot(P[0], P[2], "D", color=INK, mfc="none")
        side.annotate("P", P[[0, 2]], (6, -3), textcoords="offset points")
        side.set(xlabel="east (m)", ylabel="height (m)", title="to scale")
        side.set(xlim=(-130, 130), ylim=(-15, 545))
        side.set_aspect("equal")
        for ax, axis, name in zip(near, (0, 1), ("east", "north"), strict=True):
            _near(ax, results, axis)
            ax.set(xlabel=f"{name} (cm)", ylabel="height (cm)", title="at P, enlarged")
    return fig


def _near(ax: Axes, results: Sequence[tuple[Array, Fit]], axis: int) -> None:
    """Draw the ellipses of one sigma in a vertical plane, cm from the surveyed P."""
    plane, P = [axis, 2], example.points()[0]
    for (x_m, fit), colour, text in zip(results, (TWO, FOUR), ("A1, A2", "all four"), strict=True):
        centre = 100 * (x_m - P)[plane]
        ax.add_patch(_ellipse(centre, 1e4 * fit.cov[np.ix_(plane, plane)], colour))
        ax.plot(*centre, "o", color=colour)
        label: dict[str, Any] = {"color": colour, "fontsize": SMALL, "va": "center"}
        ax.annotate(text, (7, centre[1]), **label)
    ax.plot(0, 0, "D", color=INK, mfc="none")
    ax.annotate("surveyed", (7, 0), color=INK, fontsize=SMALL, va="center")
    ax.set(xlim=(-18, 22), ylim=(-40, 46))
    ax.set_aspect("equal")


def _ellipse(centre: Array, cov: Array, colour: str, *, k: float = 1.0) -> Ellipse:
    """Return the ellipse of k sigma of a covariance matrix, shape (2, 2)."""
    values, vectors = np.linalg.eigh(cov)
    width, height = 2 * k * np.sqrt(values)
    angle = np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0]))
    shape: dict[str, Any] = {"fill": False, "edgecolor": colour, "linewidth": 1.6}
    return Ellipse((centre[0], centre[1]), width, height, angle=angle, **shape)


def promise(errors: Array, fits: Sequence[Fit]) -> Figure:
    """Draw many repetitions: errors of P with their ellipses, and the test's statistic.

    Parameters
    ----------
    errors : ndarray, shape (n, 3)
        m.
    fits : sequence of Fit
        n adjustments.
    """
    with applied():
        fig, (left, right) = subplots(1, 2, figsize=(WIDTH, 3.6), width_ratios=[1, 1.35])
        left.plot(*(100 * errors[:, [0, 2]]).T, ".", ms=1.6, mew=0, color=SOFT, alpha=0.5)
        cov = 1e4 * fits[0].cov[EAST_HEIGHT]
        for share in (0.39, 0.95):
            k = np.sqrt(statistics.chi2_ppf(share, 2))
            left.add_patch(_ellipse(np.zeros(2), cov, FOUR, k=k))
            tip = (0.0, k * np.sqrt(cov[1, 1]))
            left.annotate(
                f"{100 * share:.0f} %",
                tip,
                (14, tip[1]),
                color=FOUR,
                fontsize=SMALL,
                va="center",
                arrowprops={"arrowstyle": "-", "color": FOUR, "lw": 0.6},
            )
        left.set(xlabel="error in east (cm)", ylabel="error in height (cm)", title="errors of P")
        left.set(xlim=(-30, 30), ylim=(-55, 55))
        left.set_aspect("equal")
        _against_chi_square(right, np.array([each.square for each in fits]), fits[0].degrees)
    return fig


def _against_chi_square(ax: Axes, squares: Array, degrees: int) -> None:
    statistic = np.linspace(0.01, 20, 400)
    step = statistic[1] - statistic[0]
    below = np.array([statistics.chi2_cdf(x, degrees) for x in statistic])
    ax.hist(squares, bins=np.arange(0, 20.5, 0.5).tolist(), density=True, color=MUTED)
    ax.plot(statistic, np.gradient(below, step), color=FOUR)
    limit = statistics.chi2_isf(0.05, degrees)
    ax.axvline(limit, color=INK, lw=1.0, ls="--")
    ax.annotate("exceeded by\n1 in 20", (limit + 0.3, 0.1), fontsize=SMALL)
    ax.set(xlim=(0, 20), yticks=[], xlabel="weighted sum of squared residuals (1)")
    ax.set_title(f"{degrees} degrees of freedom")


def redundancy(two: Fit, four: Fit) -> Figure:
    """Draw the redundancy numbers of image coordinates, with two images and with four.

    Parameters
    ----------
    two, four : Fit
        Of A1 and A2, and of all four images.
    """
    with applied():
        fig, ax = subplots(figsize=(WIDTH, 2.6))
        names = [f"{axis} in {image}" for image in example.EXPOSURES["image"] for axis in "xy"]
        places = np.arange(len(names))
        ax.bar(places[:4] - 0.2, two.redundancy, 0.36, color=TWO, label="A1 and A2")
        ax.bar(places + 0.2, four.redundancy, 0.36, color=FOUR, label="all four images")
        for i, r in enumerate(two.redundancy):
            ax.annotate(f"{r:.2f}", (i - 0.2, r + 0.02), ha="center", fontsize=SMALL, color=TWO)
        ax.set_xticks(places, names)
        ax.set(ylim=(0, 1), ylabel="redundancy number (1)")
        ax.grid(visible=False, axis="x")
        ax.legend(ncols=2, loc="upper left")
    return fig


def valley(covs: Mapping[str, Array]) -> Figure:
    """Draw the ellipses of a focal length and a flying height that do nearly the same.

    Parameters
    ----------
    covs : mapping of str to ndarray, shape (2, 2)
        By a label: covariance of f, mm, and of the height, m.
    """
    with applied():
        fig, ax = subplots(figsize=(WIDTH, 2.9))
        largest = np.zeros(2)
        for (name, cov), colour in zip(covs.items(), (BLUE, TEAL, ORANGE), strict=False):
            ax.add_patch(_ellipse(np.zeros(2), cov, colour))
            sigma = np.sqrt(cov.diagonal())
            largest = np.maximum(largest, sigma)
            text: dict[str, Any] = {"color": colour, "fontsize": SMALL, "va": "center"}
            ax.annotate(name, sigma, (7, -5), textcoords="offset points", **text)
        ax.set(xlabel="$f$ (mm)", ylabel="$Z_0$ (m)")
        ax.set(xlim=(-1.3 * largest[0], 1.9 * largest[0]), ylim=1.3 * largest[1] * PLUS_MINUS)
    return fig


def datums(free: FreeNetwork) -> Figure:
    """Draw the ellipses of the points of a block in two datums."""
    with applied():
        fig, axes = subplots(1, 2, figsize=(WIDTH, 3.0), sharex=True, sharey=True)
        parts = (("seven unknowns held", free.minimal), ("inner constraints", free.inner))
        for ax, (name, bundle) in zip(axes, parts, strict=True):
            x_m, cov = bundle.state.x_m, bundle.solution.cov_points
            for k in np.flatnonzero(bundle.network.free_points):
                ax.add_patch(_ellipse(x_m[k, :2], ENLARGED**2 * cov[k, :2, :2], TEAL))
            camera = bundle.T_m_c.r
            ax.plot(camera[:, 0], camera[:, 1], "v", color=BLUE, ms=5)
            ax.set(xlabel="east (m)", xlim=300 * PLUS_MINUS, ylim=210 * PLUS_MINUS, title=name)
            ax.set_aspect("equal")
        axes[0].set_ylabel("north (m)")
    return fig


# --- the bundle: zeros of its matrices, its cost, changes of a camera in the image -----------


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
