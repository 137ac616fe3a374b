"""Chapter 8, all heads with their trajectory in one adjustment."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from acx4book.typesetting import matrix, style
from acx4book.typesetting.myst import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import Flight
from acx4files.results.folder import RELATIVE
from acx4lib.attempts import Failed, attempt
from acx4lib.calibration import rig
from acx4lib.calibration.heads import RelativeOrientation, varied
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, Interior, xy_from_colrow
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.synthetic_image.frame import coverage, head_from_synthetic, synthetic_from_head
from acx4sim.files import truth_path

# --- Figures of the rig: the heads together beside the heads one by one


NO_OTHERS = "The heads are oriented in no other way."
FACTORS = (1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 500)


def _gains(before: RelativeOrientation, after: RelativeOrientation) -> Array:
    """Return how many times smaller the standard deviations become, shape (n_heads, 6)."""
    fixed = (before.sigma == 0) | (after.sigma == 0)
    return np.where(fixed, np.nan, before.sigma / np.where(fixed, 1.0, after.sigma))


def median_gains(
    before: RelativeOrientation | Failed, after: RelativeOrientation
) -> dict[Markup, float]:
    """Return the medians of gains by kinds of parameters; empty for a way that failed."""
    if isinstance(before, Failed):
        return {}
    gains = _gains(before, after)
    parts = {"$X_c$ and $Y_c$": slice(0, 2), "$Z_c$": slice(2, 3), "the angles": slice(3, 6)}
    known = {
        name: of_kind[np.isfinite(of_kind)]
        for name, part in parts.items()
        for of_kind in [gains[:, part]]
    }
    return {
        Markup(name): float(np.median(of_kind)) for name, of_kind in known.items() if of_kind.size
    }


def rig_gains(
    others: Mapping[str, RelativeOrientation | Failed], rig: RelativeOrientation
) -> Figure:
    """Draw how many times smaller the rig's standard deviations are, parameter by parameter.

    Parameters
    ----------
    others : mapping of str to RelativeOrientation or Failed
        Other ways to orient the heads, by their titles; a way that failed is left out.
    rig : RelativeOrientation
    """
    oriented = {
        title: orientation
        for title, orientation in others.items()
        if not isinstance(orientation, Failed)
    }
    if not oriented:
        return style.nothing(NO_OTHERS)
    with style.applied():
        fig, axes = style.subplots(
            1, len(oriented), figsize=(style.WIDTH, 3.1), sharey=True, squeeze=False
        )
        for ax, (title, orientation) in zip(axes[0], oriented.items(), strict=True):
            _draw_gains(ax, _gains(orientation, rig))
            ax.set_title(title)
        axes[0, 0].set_ylabel("σ over that of the rig (1)")
        handles = [
            Line2D([], [], ls="", marker="o", color=style.colour(k), label=style.plain(head.name))
            for k, head in enumerate(rig.heads)
        ]
        style.legend_below(fig, handles)
    return fig


def _draw_gains(ax: Axes, gains: Array) -> None:
    """Draw a row of dots for each parameter, one per head, on a logarithmic axis."""
    ax.axhline(1.0, color=style.SOFT, lw=0.9, zorder=1)
    spread = 0.09 * (np.arange(len(gains)) - (len(gains) - 1) / 2)
    for k, ratios in enumerate(gains):
        ax.plot(np.arange(len(RELATIVE)) + spread[k], ratios, "o", color=style.colour(k), ms=4.5)
    ax.set_xticks(range(len(RELATIVE)), [LABELS[name] for name in RELATIVE])
    known = gains[np.isfinite(gains)]
    highest = 1.3 * known.max(initial=2.0)
    low, high = ax.get_ylim() if ax.get_yscale() == "log" else (0.8, highest)
    ax.set_yscale("log")
    ax.set_ylim(min(low, 0.8 * known.min(initial=1.0)), max(high, highest))
    ax.set_yticks([n for n in FACTORS if n < ax.get_ylim()[1]])
    ax.yaxis.set_major_formatter("{x:g}")
    ax.minorticks_off()
    ax.grid(visible=False, axis="x")
    ax.set_xlim(-0.6, len(RELATIVE) - 0.4)


def rig_correlations(ways: Mapping[str, RelativeOrientation | Failed]) -> Figure:
    """Draw the correlations of relative orientations.

    Parameters
    ----------
    ways : mapping of str to RelativeOrientation or Failed
        By their titles; a way that failed is left out.
    """
    oriented = {
        title: orientation
        for title, orientation in ways.items()
        if not isinstance(orientation, Failed)
    }
    if not oriented:
        return style.nothing(NO_OTHERS)
    with style.applied():
        fig, axes = style.subplots(1, len(oriented), figsize=(style.WIDTH, 2.55), squeeze=False)
        for ax, (title, orientation) in zip(axes[0], oriented.items(), strict=True):
            _draw_correlations(ax, orientation, title)
        matrix.scale(fig, axes[0].tolist(), shrink=0.75, aspect=28)
    return fig


def _draw_correlations(ax: Axes, orientation: RelativeOrientation, title: str) -> None:
    values, n = correlation(orientation.cov), len(RELATIVE)
    matrix.signed_cells(ax, values, gap=0.0)
    names = [style.plain(head.name) for head in orientation.heads]
    middle = n * np.arange(len(names)) + n / 2
    ax.set_xticks(middle, names, size=7)
    ax.set_yticks(middle, names, size=7, rotation=90, va="center")
    for edge in range(n, n * len(names), n):
        ax.axhline(edge, color=style.INK, lw=0.6)
        ax.axvline(edge, color=style.INK, lw=0.6)
    off = np.abs(values - np.diag(np.diag(values)))
    style.heading(ax, title, f"largest {off.max():.2f}")


def rig_deformations(synthetic: Camera, found: Mapping[str, Deformation]) -> Figure:
    """Draw the predicted errors of synthetic images over their frame, and the true ones.

    Parameters
    ----------
    synthetic : Camera
    found : mapping of str to Deformation
        By the titles of the panels; one at least.

    Returns
    -------
    Figure
        Ground: the standard deviation, the largest of the heads at a node. Arrows: the true
        errors of a simulated flight. A sentence where the heads see one ground.
    """
    if all(image.coincides for image in found.values()):
        return style.nothing(
            "The heads see the same ground: an error of one is the misfit of its whole band."
        )
    pixel = synthetic.pixel_mm
    most = max(image.sigma.max() for image in found.values()) / pixel
    lengths = [np.hypot(*image.d.T) for image in found.values()]
    longest = max(float(np.nanmax(d, initial=0.0)) for d in lengths) / pixel
    key = style.round_length(longest) if longest > 0 else 0.0
    with style.applied():
        fig, axes = style.subplots(
            1, len(found), figsize=(style.WIDTH, 4.9), sharey=True, squeeze=False
        )
        for ax, (title, image) in zip(axes[0], found.items(), strict=True):
            marks = _draw_sigma(ax, image, synthetic, most)
            if key > 0:
                _draw_errors(ax, image, key=key, pixel=pixel)
            style.heading(ax, title, f"overlaps misfit by {image.gap_sigma_mm / pixel:.2f} px")
            ax.set_xlabel("$x$ (mm)")
        axes[0, 0].set_ylabel("$y$ (mm)")
        bar = fig.colorbar(marks, ax=axes[0].tolist(), location="bottom", shrink=0.5, aspect=40)
        bar.set_label("standard deviation (px)")
        bar.outline.set_visible(False)
    return fig


def _draw_sigma(ax: Axes, image: Deformation, synthetic: Camera, most: float) -> QuadMesh:
    """Draw the standard deviation over the frame, the largest of the heads at a node."""
    (x, column), (y, row) = (_places(image, i) for i in (0, 1))
    largest = np.full((len(y), len(x)), np.nan)
    np.fmax.at(largest, (row, column), image.sigma / synthetic.pixel_mm)
    shading: Any = "gouraud" if np.isfinite(largest).all() else "nearest"
    mesh = ax.pcolormesh(
        x, y, largest, cmap=style.SHADES, vmin=0, vmax=most, shading=shading, rasterized=True
    )
    w, h = synthetic.width_px, synthetic.height_px
    upper, lower = xy_from_colrow(synthetic, np.array([[-0.5, -0.5], [w - 0.5, h - 0.5]]))
    ax.add_patch(Rectangle(tuple(upper), *(lower - upper), fc="none", ec=style.INK, lw=1.2))
    ax.set(aspect="equal")
    ax.margins(0.07)
    ax.grid(visible=False)
    return mesh


def _places(image: Deformation, axis: int) -> tuple[Array, Index]:
    """Return the places of the nodes along an axis, and the index of each row's place."""
    places, idx = np.unique(image.xy[:, axis].round(6), return_inverse=True)
    return places, idx


def _draw_errors(ax: Axes, image: Deformation, *, key: float, pixel: float) -> None:
    """Draw the true errors of every other node, in the colours of the heads."""
    (x, column), (_, row) = (_places(image, i) for i in (0, 1))
    some = (column % 2 == 1) & (row % 2 == 1)
    gap = 2 * float(np.min(np.diff(x)))
    arrows = ax.quiver(
        *image.xy[some].T,
        *(image.d[some].T * gap / (key * pixel)),
        color=[style.colour(k) for k in image.head[some]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.006,
    )
    label, place = f"{key:g} px", (0.86, 1.03)
    ax.quiverkey(
        arrows, *place, gap, label, labelpos="W", color=style.INK, fontproperties=style.LETTERS
    )


# --- Errors of the heads in the synthetic image


@dataclass(frozen=True, kw_only=True, eq=False)
class Deformation:
    """Errors of a synthetic image at nodes of its frame, a row for each head that sees the node.

    The part that the synthetic camera's own calibration takes up is removed: focal length,
    principal point and a turn of the whole image.

    Attributes
    ----------
    xy : ndarray, shape (n, 2)
        Nodes, mm.
    head : ndarray, shape (n,)
    d : ndarray, shape (n, 2)
        Errors, mm; NaN where the truth is not known.
    variance : ndarray, shape (n, 2)
        As the covariance of the heads states it, mm².
    pairs : ndarray, shape (m, 2)
        Rows of two heads at one node.
    gap : ndarray, shape (m, 2)
        Differences of the two heads, mm; NaN where the truth is not known.
    gap_variance : ndarray, shape (m, 2)
        mm².
    coincides : bool
        Whether the heads see one ground, as those of several bands do.
    """

    xy: Array
    head: Index
    d: Array
    variance: Array
    pairs: Index
    gap: Array
    gap_variance: Array
    coincides: bool

    @property
    def sigma(self) -> Array:
        """Stated standard deviation of the plane vector, mm, shape (n,)."""
        return np.sqrt(self.variance.sum(axis=1))

    @property
    def gap_sigma_mm(self) -> float:
        """Stated root mean square of the differences in the overlaps, mm."""
        return float(np.sqrt(self.gap_variance.sum(axis=1).mean()))

    @property
    def gap_rms_mm(self) -> float:
        """Root mean square of the differences in the overlaps, mm."""
        return float(np.sqrt(np.sum(self.gap**2, axis=1).mean()))

    @property
    def largest_mm(self) -> float:
        """Largest error over the frame, mm."""
        return float(np.hypot(*self.d.T).max())


def deformation(
    orientation: RelativeOrientation,
    synthetic: Camera,
    *,
    truth: RelativeOrientation | None = None,
) -> Deformation:
    """Return the errors of a relative orientation in the synthetic image.

    Parameters
    ----------
    orientation : RelativeOrientation
    synthetic : Camera
    truth : RelativeOrientation, optional
        The same heads as they truly are.
    """
    grid = coverage(orientation, synthetic, spacing_px=600)
    nodes, seen = grid.xy.reshape(-1, 2), grid.seen.reshape(len(orientation.heads), -1)
    head, node = np.nonzero(seen)
    xy = nodes[node]
    taken_up = _taken_up(xy, synthetic.interior.f)
    effects, cov = _effects(orientation, head, xy)
    # a frame that no two heads share has no pairs
    pairs = np.array(
        [
            (a, b)
            for a, b in zip(*np.nonzero(node[:, None] == node), strict=True)
            if head[a] < head[b]
        ],
        dtype=np.intp,
    ).reshape(-1, 2)
    d = np.full_like(xy, np.nan)
    if truth is not None:
        d = _without(taken_up, (xy - _seen_by(orientation, truth, head, xy)).ravel()).reshape(-1, 2)
    A = _without(taken_up, effects).reshape(len(xy), 2, -1)
    return Deformation(
        xy=xy,
        head=head,
        d=d,
        variance=_variance(A, cov),
        pairs=pairs,
        gap=d[pairs[:, 1]] - d[pairs[:, 0]],
        gap_variance=_variance(A[pairs[:, 1]] - A[pairs[:, 0]], cov),
        coincides=grid.coincides,
    )


def _variance(A: Array, cov: Array) -> Array:
    """Return the diagonal of A cov A^T, for A of shape (n, 2, k)."""
    out: Array = np.einsum("nia,ab,nib->ni", A, cov, A, optimize=True)
    return out


def _seen_by(
    orientation: RelativeOrientation, other: RelativeOrientation, head: Index, xy: Array
) -> Array:
    """Return points of a synthetic image as the other orientation places the same pixels, mm."""
    out = np.empty_like(xy)
    for k in range(len(orientation.heads)):
        in_head = head == k
        out[in_head] = synthetic_from_head(
            other, k, head_from_synthetic(orientation, k, xy[in_head])
        )
    return out


def _effects(orientation: RelativeOrientation, head: Index, xy: Array) -> tuple[Array, Array]:
    """Return d(x, y of all nodes) / d(uncertain parameters), (2 n, k), and their covariance."""
    sigma = sigmas(orientation.cov_joint)
    uncertain = np.flatnonzero(sigma)
    effects = np.zeros((2 * len(xy), len(uncertain)))
    for column, i in enumerate(map(int, uncertain)):
        ahead, behind = (
            _seen_by(orientation, varied(orientation, i, step), head, xy)
            for step in (sigma[i], -sigma[i])
        )
        effects[:, column] = (ahead - behind).ravel() / (2 * sigma[i])
    return effects, orientation.cov_joint[np.ix_(uncertain, uncertain)]


def _taken_up(xy: Array, f: float) -> Array:
    """Return the effects of focal length, principal point and a turn of a camera, (2 n, 6)."""
    x, y = xy.T
    zero, one = np.zeros_like(x), np.ones_like(x)
    fields = [
        (x / f, y / f),
        (one, zero),
        (zero, one),
        (x * y / f, f + y**2 / f),
        (f + x**2 / f, x * y / f),
        (-y, x),
    ]
    return np.stack([np.column_stack(field).ravel() for field in fields], axis=1)


def _without(columns: Array, values: Array) -> Array:
    """Return values less their least-squares fit by columns."""
    q = np.linalg.qr(columns)[0]
    return values - q @ (q.T @ values)


# --- The heads of a simulated flight as they truly are


def _true_heads(flight: Flight, cameras: Sequence[Camera]) -> tuple[Camera, ...]:
    """Return the true heads of a simulated flight; none where it was not simulated."""
    path = truth_path(flight.pictures.resolve())
    if not path.is_file():
        return ()
    truth = json.loads(path.read_text("utf-8-sig"))["cameras"]
    return tuple(true_head(camera, truth[camera.name]) for camera in cameras)


def true_head(camera: Camera, told: Mapping[str, Any]) -> Camera:
    """Return a camera with its true parameters in a simulated flight."""
    angles = [told[f"boresight_{angle}_deg"] for angle in ("omega", "phi", "kappa")]
    lens = {name: told[name] for name in ("k1", "k2", "k3", "p1", "p2")}
    return replace(
        camera,
        interior=Interior(f=told["f_mm"], xp=told["xp_mm"], yp=told["yp_mm"], **lens),
        T_b_c=Pose(
            R=rotation_from_opk(np.radians(angles)),
            r=np.array([told[f"lever_{axis}_m"] for axis in "xyz"]),
        ),
    )


def true_orientation(flight: Flight, together: Mounting) -> RelativeOrientation | None:
    """Return the heads' true orientation in the synthetic frame; None where it is not known.

    Parameters
    ----------
    flight : Flight
    together : Mounting
        Their rig.
    """
    heads = _true_heads(flight, together.calibration.cameras)
    if not heads:
        return None
    exact = replace(together, calibration=replace(together.calibration, cameras=heads))
    orientation = attempt(rig.relative_orientation, exact, flight.synthetic_camera)
    return None if isinstance(orientation, Failed) else orientation
