"""What errors of the heads do to the synthetic image that is made of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.calibration.heads import RelativeOrientation, varied
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera
from acx4lib.least_squares.covariance import sigmas
from acx4lib.synthetic_image.frame import coverage, head_from_synthetic, synthetic_from_head


@dataclass(frozen=True, kw_only=True, eq=False)
class Deformation:
    """Errors of a synthetic image, at nodes over its frame, once for every head that sees one.

    What the synthetic camera's own calibration takes up is no part of them: focal length,
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
    """

    xy: Array
    head: Index
    d: Array
    variance: Array
    pairs: Index
    gap: Array
    gap_variance: Array

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
    spacing_px: int = 600,
) -> Deformation:
    """Return what a relative orientation has wrong in the synthetic image.

    Parameters
    ----------
    orientation : RelativeOrientation
    synthetic : Camera
    truth : RelativeOrientation, optional
        The same heads as they truly are.
    spacing_px : int
        Of the nodes.
    """
    found = coverage(orientation, synthetic, spacing_px=spacing_px)
    nodes, seen = found.xy.reshape(-1, 2), found.seen.reshape(len(orientation.heads), -1)
    head, node = np.nonzero(seen)
    xy = nodes[node]
    own = _taken_up(xy, synthetic.interior.f)
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
        d = _without(own, (xy - _seen_by(orientation, truth, head, xy)).ravel()).reshape(-1, 2)
    A = _without(own, effects).reshape(len(xy), 2, -1)
    return Deformation(
        xy=xy,
        head=head,
        d=d,
        variance=_variance(A, cov),
        pairs=pairs,
        gap=d[pairs[:, 1]] - d[pairs[:, 0]],
        gap_variance=_variance(A[pairs[:, 1]] - A[pairs[:, 0]], cov),
    )


def _variance(A: Array, cov: Array) -> Array:
    """Return the diagonal of A cov A^T, for A of shape (n, 2, k)."""
    out: Array = np.einsum("nia,ab,nib->ni", A, cov, A, optimize=True)
    return out


def _seen_by(
    orientation: RelativeOrientation, other: RelativeOrientation, head: Index, xy: Array
) -> Array:
    """Return where others have the pixels that show points of a synthetic image, mm."""
    out = np.empty_like(xy)
    for k in range(len(orientation.heads)):
        own = head == k
        out[own] = synthetic_from_head(other, k, head_from_synthetic(orientation, k, xy[own]))
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
    """Return what focal length, principal point and a turn of a camera move, shape (2 n, 6)."""
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


def _without(own: Array, values: Array) -> Array:
    """Return values less their least-squares fit by columns."""
    q = np.linalg.qr(own)[0]
    return values - q @ (q.T @ values)
