"""Differences between heads in the synthetic image: at tie points, and over the whole frame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import (
    INTERIOR,
    Camera,
    border_distance,
    correct,
    correct_jacobian,
    xy_from_colrow,
)
from acx4lib.geometry.frames import rotation_from_opk, skew, transform
from acx4lib.synthetic_image.frame import head_from_synthetic, synthetic_from_head
from acx4lib.tie_points.ties import TiePoints

PER_HEAD = 6 + len(INTERIOR)
"""Number of parameters of a head: Xc, Yc, Zc, rotation, interior orientation."""

# --- at tie points ---------------------------------------------------------------------------


def tie_differences(orientation: RelativeOrientation, ties: TiePoints) -> Array:
    """Return the positions of tie points from the second head minus those from the first.

    Parameters
    ----------
    orientation : RelativeOrientation
    ties : TiePoints

    Returns
    -------
    ndarray, shape (n, 2)
        mm in the synthetic image, in the order of the tie points.
    """
    out = np.zeros((len(ties), 2))
    for k, colrow, own, sign in sides(ties):
        out[own] += sign * synthetic_from_head(orientation, k, colrow)
    return out


def sides(ties: TiePoints) -> Iterator[tuple[int, Array, Index, float]]:
    """Yield each head, its pixels, the rows of its tie points, and its sign in the differences."""
    both = ((ties.head_a, ties.colrow_a, -1.0), (ties.head_b, ties.colrow_b, 1.0))
    for heads, colrow, sign in both:
        for k in np.unique(heads):
            own = np.flatnonzero(heads == k)
            yield int(k), colrow[own], own, sign


def synthetic_from_head_jacobian(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return d(synthetic_from_head) / d(pose and interior orientation of the head).

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    colrow : ndarray, shape (n, 2)
        Pixels of the head.

    Returns
    -------
    ndarray, shape (n, 2, 15)
        By Xc, Yc, Zc (mm), a rotation about the head's axes (R exp(delta), rad), and the nine
        parameters of `camera.INTERIOR`.
    """
    camera, R = orientation.heads[k], rotation_from_opk(orientation.opk[k])
    xy = xy_from_colrow(camera, colrow)
    ray_h = np.column_stack([correct(camera.interior, xy), np.full(len(xy), -camera.interior.f)])
    ray_s = transform(R, ray_h)
    by_place = np.zeros((len(xy), 2, 3))
    by_place[:, :, :2], by_place[:, :, 2] = np.eye(2), -ray_s[:, :2] / ray_s[:, 2:]
    by_ray = -(orientation.xyz_mm[k, 2] / ray_s[:, 2])[:, None, None] * by_place @ R
    by_interior = by_ray[:, :, :2] @ correct_jacobian(camera.interior, xy)
    by_interior[:, :, 0] -= by_ray[:, :, 2]  # the ray's third component is -f
    return np.concatenate([by_place, -by_ray @ skew(ray_h), by_interior], axis=2)


def by_pair(
    orientation: RelativeOrientation, ties: TiePoints
) -> Iterator[tuple[Index, Index, Array]]:
    """Yield for each pair of heads its tie points, its parameters, and d(differences) by these."""
    for a, b in sorted({*zip(ties.head_a.tolist(), ties.head_b.tolist(), strict=True)}):
        own = np.flatnonzero((ties.head_a == a) & (ties.head_b == b))
        by_a = synthetic_from_head_jacobian(orientation, a, ties.colrow_a[own])
        by_b = synthetic_from_head_jacobian(orientation, b, ties.colrow_b[own])
        at = np.concatenate([PER_HEAD * k + np.arange(PER_HEAD) for k in (a, b)])
        yield own, at, np.concatenate([-by_a, by_b], axis=2)


def normals(
    parts: Iterable[tuple[Index, Index, Array]], d: Array, weight: Array, n_heads: int
) -> tuple[Array, Array]:
    """Return J^T P J and J^T P d by all parameters of all heads, `PER_HEAD` each.

    Parameters
    ----------
    parts : iterable
        From `by_pair`.
    d : ndarray, shape (n, 2)
        From `tie_differences`.
    weight : ndarray, shape (n,)
        Of a difference in one coordinate, mm^-2.
    n_heads : int
    """
    n = PER_HEAD * n_heads
    N, h = np.zeros((n, n)), np.zeros(n)
    for own, at, by_both in parts:
        J = by_both.reshape(2 * len(own), -1)
        PJ = np.repeat(weight[own], 2)[:, None] * J
        N[np.ix_(at, at)] += PJ.T @ J
        h[at] += PJ.T @ d[own].ravel()
    return N, h


# --- the whole frame -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameDifferences:
    """Differences between the synthetic images of two orientations, over the whole frame.

    Attributes
    ----------
    xy : ndarray, shape (n, 2)
        Nodes of the synthetic image that a head sees, mm.
    head : ndarray, shape (n,)
        The head whose pixels are used there.
    d_px : ndarray, shape (n, 2)
        Differences in x and y, pixels of the synthetic image.
    """

    xy: Array
    head: Index
    d_px: Array

    @property
    def rms_px(self) -> float:
        """RMS length, px."""
        return float(np.sqrt(np.mean(np.sum(self.d_px**2, axis=1))))

    @property
    def largest_px(self) -> float:
        """Largest length, px."""
        return float(np.max(np.hypot(*self.d_px.T)))


def frame_differences(
    orientation: RelativeOrientation,
    other: RelativeOrientation,
    synthetic: Camera,
    *,
    spacing_px: int = 120,
) -> FrameDifferences:
    """Return the position differences between the synthetic images of two orientations.

    Parameters
    ----------
    orientation, other : RelativeOrientation
        Orientations of the same heads; `other` may be the truth.
    synthetic : Camera
    spacing_px : int
        Spacing of the nodes, which include the frame's borders.

    Returns
    -------
    FrameDifferences
        `orientation` minus `other`; at each node for the head whose border is farthest away.
    """
    expected.whole("spacing_px", spacing_px)
    expected.many("other", other.heads, len(orientation.heads), "heads, as of orientation")
    w, h = synthetic.width_px, synthetic.height_px
    cols = np.linspace(-0.5, w - 0.5, max(w // spacing_px, 1) + 1)
    rows = np.linspace(-0.5, h - 0.5, max(h // spacing_px, 1) + 1)
    xy = xy_from_colrow(synthetic, np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2))
    seen = [head_from_synthetic(orientation, k, xy) for k in range(len(orientation.heads))]
    by_head = [border_distance(c, seen[k]) for k, c in enumerate(orientation.heads)]
    far = np.nan_to_num(np.stack(by_head), nan=-1.0)
    head = np.argmax(far, axis=0)
    d_px = np.full((len(xy), 2), np.nan)
    for k, colrow in enumerate(seen):
        own = (head == k) & (far[k] >= 0)
        d_px[own] = (xy[own] - synthetic_from_head(other, k, colrow[own])) / synthetic.pixel_mm
    covered = np.isfinite(d_px[:, 0])
    return FrameDifferences(xy=xy[covered], head=head[covered], d_px=d_px[covered])
