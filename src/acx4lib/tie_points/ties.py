"""Tie points between heads in the synthetic image, and refinement by them (2.1, Figure 1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block
from acx4lib.calibration.heads import RelativeOrientation, varied
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares.covariance import sigmas
from acx4lib.synthetic_image.frame import synthetic_from_head

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class TiePoints:
    """Points measured in two heads at one exposure.

    Attributes
    ----------
    head_a, head_b : ndarray, shape (n,)
        head_a < head_b.
    exposure_idx, point_idx : ndarray, shape (n,)
    colrow_a, colrow_b : ndarray, shape (n, 2)
    sigma_px : ndarray, shape (n,)
        The larger sigma of the two measurements; infinite where the tie point is not used.
    """

    head_a: Index
    head_b: Index
    exposure_idx: Index
    point_idx: Index
    colrow_a: Array
    colrow_b: Array
    sigma_px: Array

    def __repr__(self) -> str:
        """Return the number of tie points in one line."""
        return shown.line("TiePoints", f"{len(self)} of {shown.count(len(self._pairs), 'overlap')}")

    @property
    def _pairs(self) -> list[tuple[int, int]]:
        return sorted(set(zip(self.head_a.tolist(), self.head_b.tolist(), strict=True)))

    def table(self) -> pd.DataFrame:
        """Return number, exposures and median sigma of the tie points of each pair of heads.

        Heads are counted from zero, in the order of the orientation.
        """
        rows = {}
        for a, b in self._pairs:
            of_pair = (self.head_a == a) & (self.head_b == b)
            rows[a, b] = {
                "tie points": int(of_pair.sum()),
                "exposures": len(np.unique(self.exposure_idx[of_pair])),
                "median sigma (px)": float(np.median(self.sigma_px[of_pair])),
            }
        return shown.row_table(("head a", "head b"), rows)

    def __len__(self) -> int:
        """Count the tie points."""
        return len(self.head_a)

    def __getitem__(self, keep: Index | Mask) -> TiePoints:
        """Select tie points."""
        return expected.part_of(self, keep)


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Overlap:
    """Differences b minus a of one pair of heads in the synthetic image.

    Attributes
    ----------
    head_a, head_b : int
    xy : ndarray, shape (n, 2)
        Positions, mm.
    d : ndarray, shape (n, 2)
        Differences, mm.
    """

    head_a: int
    head_b: int
    xy: Array
    d: Array

    @property
    def mean(self) -> Array:
        """Average difference in x and y, mm."""
        return self.d.mean(axis=0)

    @property
    def rms(self) -> Array:
        """Root mean square of the differences in x and y, mm."""
        return np.sqrt(np.mean(self.d**2, axis=0))


def shared_points(block: Block, orientation: RelativeOrientation) -> TiePoints:
    """Return all points measured in two heads at one exposure.

    Parameters
    ----------
    block : Block
        The block of the heads; measurements with an infinite sigma are left out.
    orientation : RelativeOrientation
        It has the names of the heads and their order.

    Raises
    ------
    ValueError
        Where the block lacks a head.
    """
    names = [camera.name for camera in block.cameras]
    expected.names_of("heads", [camera.name for camera in orientation.heads], names)
    head_of = np.full(len(names), -1)
    for k, camera in enumerate(orientation.heads):
        head_of[names.index(camera.name)] = k
    points = block.image_points
    head = head_of[block.images.camera_idx[points.image_idx]]
    exposure = block.images.exposure_idx[points.image_idx]
    order = np.lexsort((head, points.point_idx, exposure))
    order = order[(head[order] >= 0) & np.isfinite(points.sigma_px[order])]
    pairs = [np.zeros((2, 0), dtype=np.intp)]
    for ahead in range(1, len(orientation.heads)):
        a, b = order[:-ahead], order[ahead:]
        same_point = (exposure[a] == exposure[b]) & (points.point_idx[a] == points.point_idx[b])
        pairs.append(np.stack([a[same_point], b[same_point]]))
    a, b = np.concatenate(pairs, axis=1)
    return TiePoints(
        head_a=head[a],
        head_b=head[b],
        exposure_idx=exposure[a],
        point_idx=points.point_idx[a],
        colrow_a=points.colrow[a],
        colrow_b=points.colrow[b],
        sigma_px=np.maximum(points.sigma_px[a], points.sigma_px[b]),
    )


def check_ties(ties: TiePoints, orientation: RelativeOrientation) -> None:
    """Raise a ValueError where tie points belong to other heads."""
    expected.places("ties.head_a", ties.head_a, len(orientation.heads))
    expected.places("ties.head_b", ties.head_b, len(orientation.heads))


def overlaps(ties: TiePoints, orientation: RelativeOrientation) -> list[Overlap]:
    """Return the differences of all pairs of heads that share tie points."""
    check_ties(ties, orientation)
    out = []
    n_heads = len(orientation.heads)
    for a in range(n_heads):
        for b in range(a + 1, n_heads):
            of_pair = (ties.head_a == a) & (ties.head_b == b)
            if of_pair.any():
                xy_a = synthetic_from_head(orientation, a, ties.colrow_a[of_pair])
                xy_b = synthetic_from_head(orientation, b, ties.colrow_b[of_pair])
                out.append(Overlap(head_a=a, head_b=b, xy=(xy_a + xy_b) / 2, d=xy_b - xy_a))
    return out


def refine_by_mean_differences(
    orientation: RelativeOrientation, ties: TiePoints
) -> RelativeOrientation:
    """Shift the heads so that the mean differences of their overlaps become smallest.

    The paper's refinement: Xc and Yc of every head by least squares over the pairs' mean
    differences, each weighted with its number of points. The mean of all heads does not move.

    Returns
    -------
    RelativeOrientation
        Its covariance takes into account that tie points reduce the heads' errors, including
        those of interior orientations, and that tie points have noise.

    Raises
    ------
    ValueError
        For tie points of other heads.
    """
    check_ties(ties, orientation)
    if len(ties) == 0:
        return orientation
    pairs = overlaps(ties, orientation)
    gain, counts = _gain(pairs, len(orientation.heads))
    xyz = orientation.xyz_mm.copy()
    xyz[:, :2] += gain @ np.array([overlap.mean for overlap in pairs])
    n = 6 * len(orientation.heads)
    by_parameter = gain @ _means_jacobian(orientation, ties, pairs)
    J = np.eye(len(orientation.cov_joint))
    J[0:n:6] += by_parameter[0]
    J[1:n:6] += by_parameter[1]
    pixel_mm = orientation.heads[0].pixel_mm
    variance = 2 * (np.mean(ties.sigma_px) * pixel_mm) ** 2 / counts
    noise = (gain * variance) @ gain.T
    cov = J @ orientation.cov_joint @ J.T
    cov[0:n:6, 0:n:6] += noise
    cov[1:n:6, 1:n:6] += noise
    return replace(orientation, xyz_mm=xyz, cov_joint=cov)


def _gain(pairs: list[Overlap], n_heads: int) -> tuple[Array, Array]:
    """Return d(shifts of the heads) / d(mean differences), and the points of each overlap."""
    A = np.zeros((len(pairs), n_heads))
    for row, overlap in enumerate(pairs):
        A[row, overlap.head_a], A[row, overlap.head_b] = -1.0, 1.0
    counts = np.array([len(overlap.d) for overlap in pairs], dtype=float)
    root = np.sqrt(counts)[:, None]
    # minimum norm: the shifts sum to zero, so the mean of the heads does not move
    return -np.linalg.pinv(root * A) * root.T, counts


def _means_jacobian(
    orientation: RelativeOrientation, ties: TiePoints, pairs: list[Overlap]
) -> Array:
    """Return d(mean differences) / d(parameters), (2, n_overlaps, n_parameters); 0 where held."""
    n, sigma = len(orientation.heads), sigmas(orientation.cov_joint)
    out = np.zeros((2, len(pairs), len(sigma)))
    for row, overlap in enumerate(pairs):
        rows = (ties.head_a == overlap.head_a) & (ties.head_b == overlap.head_b)
        sides = (overlap.head_a, ties.colrow_a[rows], -1), (overlap.head_b, ties.colrow_b[rows], 1)
        for k, colrow, sign in sides:
            poses, interiors = np.split(np.arange(len(sigma)), [6 * n])
            parameters = [*np.split(poses, n)[k], *np.split(interiors, n)[k]]
            for i in (int(i) for i in parameters if sigma[i]):
                ahead, behind = (
                    synthetic_from_head(varied(orientation, i, step), k, colrow).mean(axis=0)
                    for step in (sigma[i], -sigma[i])
                )
                out[:, row, i] = sign * (ahead - behind) / (2 * sigma[i])
    return out
