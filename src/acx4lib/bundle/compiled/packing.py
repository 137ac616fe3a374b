"""The measurements of a block in the order in which compiled code works on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from acx4lib.block import Block, ImagePoints
from acx4lib.bundle.compiled.rays import SortedRays
from acx4lib.compiling import load, uncounted
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import xy_from_colrow

RAYS_PER_PART = 40_000
MOST_PARTS = 4
"""Threads share the rays in parts; the result does not depend on the number of threads."""

WIDE = 40_000
"""Pairs of images in the band above which only two parts are made: each part has its own sums."""

DIRECTIONS = 72
"""Lines across the block along which poses may be ordered."""

DENSE_COLUMNS, DENSE_SHARE = 1500, 0.3
"""A system is dense if it has fewer unknowns, or if its band is a larger share of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Packed:
    """The rays of a block in the order in which they are processed.

    Attributes
    ----------
    rays : SortedRays
    image : ndarray, shape (n_images,)
        The block's images in the order of the rays' numbers.
    pose : ndarray, shape (n_poses,)
        The block's poses in the order of the bands.
    dense : bool
        Whether the reduced system is a dense matrix.
    band : int
        Number of neighbouring poses to which a pose is linked at most, itself included.
    parts : tuple of tuple of int
        First and last point of each part; a thread processes one part at a time.
    """

    rays: SortedRays
    image: Index
    pose: Index
    dense: bool
    band: int
    parts: tuple[tuple[int, int], ...]

    @property
    def n_pairs(self) -> int:
        """Number of pairs of images that share points, an image with itself included."""
        return int(self.rays.pair.max()) + 1

    def weighted(self, weight: Array) -> Packed:
        """Return the same rays with other weights, those of the measurements, in their order."""
        return replace(self, rays=self.rays._replace(weight=weight[self.rays.row]))


class PointsInMm(NamedTuple):
    """Image points of a block, in its order.

    Attributes
    ----------
    point, image : ndarray, shape (n,)
    xy : ndarray, shape (n, 2)
        mm.
    weight : ndarray, shape (n,)
        Reciprocal standard deviation, 1/mm.
    """

    point: Index
    image: Index
    xy: Array
    weight: Array


def in_mm(block: Block, points: ImagePoints) -> PointsInMm:
    """Return image points of a block in millimetres."""
    if len(block.cameras) == 1:
        xy = xy_from_colrow(block.cameras[0], points.colrow)
    else:
        camera_idx, xy = block.images.camera_idx[points.image_idx], np.empty_like(points.colrow)
        for k, camera in enumerate(block.cameras):
            own = camera_idx == k
            xy[own] = xy_from_colrow(camera, points.colrow[own])
    return PointsInMm(
        point=points.point_idx.astype(np.int32, copy=False),  # one kind of array, compiled once
        image=points.image_idx,
        xy=xy,
        weight=weights(block, points),
    )


def weights(block: Block, points: ImagePoints) -> Array:
    """Return the reciprocal standard deviations of image points, 1/mm."""
    pixel_mm = np.array([camera.pixel_mm for camera in block.cameras])
    sigma_mm: Array = pixel_mm[block.images.camera_idx][points.image_idx]
    sigma_mm *= points.sigma_px
    return np.divide(1, sigma_mm, out=sigma_mm)


def pack(
    rows: PointsInMm,
    *,
    free_points: Mask,
    also: Index,
    pose_of_image: Index,
    positions: Array,
    linked: Index,
) -> Packed:
    """Return the measurements in the order in which they are processed.

    Points whose first images are neighbours follow each other, so that their sums stay in the
    processor's cache.

    Parameters
    ----------
    rows : PointsInMm
    free_points : ndarray, shape (n_points,)
    also : ndarray, shape (k,)
        Points that have other observations too.
    pose_of_image : ndarray, shape (n_images,)
    positions : ndarray, shape (n_poses, 3)
        About where the poses are, m.
    linked : ndarray, shape (k, 2)
        Pairs of poses that other observations link.
    """
    n_poses = len(positions)
    pose: Index = np.arange(n_poses)
    dense = 6 * n_poses <= DENSE_COLUMNS
    if not dense:
        pose = ordered(rows.point, pose_of_image.astype(np.int32)[rows.image], positions, linked)
    place = np.empty(n_poses, dtype=np.int64)
    place[pose] = np.arange(n_poses)
    images = np.argsort(place[pose_of_image], kind="stable")
    number = np.empty(len(images), dtype=np.int32)
    number[images] = np.arange(len(images))
    image = number[rows.image]

    starts, points, row = _sorted(rows.point, image, len(free_points), len(images))
    known = np.full(len(free_points), -1)
    known[also] = np.arange(len(also))
    image = image[row]
    rays = SortedRays(
        start=starts,
        point=points,
        free=free_points[points],
        also=known[points].astype(np.int32),
        row=row,
        image=image,
        xy=rows.xy.take(row, axis=0),
        weight=rows.weight[row],
        pair=_numbered_pairs(starts, image, len(images)),
    )
    n_neighbours = rays.pair.shape[1]
    reach = 1 + int(np.max(np.abs(np.diff(place[linked])), initial=0))
    band = max(pose_band(place[pose_of_image[images]], n_neighbours), reach)
    most = 2 if len(images) * n_neighbours > WIDE else MOST_PARTS
    return Packed(
        rays=rays,
        image=images,
        pose=pose,
        dense=dense or band > DENSE_SHARE * n_poses,
        band=band,
        parts=_parts(starts, most),
    )


def _sorted(point: Index, image: Index, n_points: int, n_images: int) -> tuple[Index, Index, Index]:
    """Sort by a point's first image, point, and image.

    Returns
    -------
    starts : ndarray, shape (n_measured + 1,)
        The index in `row` at which each measured point begins.
    points : ndarray, shape (n_measured,)
    row : ndarray, shape (n,)
    """
    first, count = np.full(n_points, n_images), np.zeros(n_points, dtype=np.int64)
    bins, points = np.zeros(n_images + 2, dtype=np.int64), np.empty(n_points, dtype=np.int32)
    starts, row = np.zeros(n_points + 1, dtype=np.int64), np.empty(len(point), dtype=np.int32)
    n_measured = _sort(point, image, first, count, bins, points, starts, row)
    return starts[: n_measured + 1].copy(), points[:n_measured].copy(), row


@uncounted
def _sort(
    point: Index,
    image: Index,
    first: Index,
    count: Index,
    bins: Index,
    points: Index,
    starts: Index,
    row: Index,
) -> int:
    """Fill in points, starts and rows; return the number of measured points."""
    n_points, n_images = len(first), len(bins) - 2
    for q in range(len(point)):
        first[point[q]] = min(first[point[q]], image[q])
        count[point[q]] += 1
    for p in range(n_points):
        bins[first[p] + 1] += 1
    for i in range(n_images + 1):
        bins[i + 1] += bins[i]
    n_measured = bins[n_images]  # points without measurements come last
    for p in range(n_points):
        points[bins[first[p]]] = p
        bins[first[p]] += 1
    end = first  # where the next row of each point goes
    for k in range(n_measured):
        end[points[k]] = starts[k]
        starts[k + 1] = starts[k] + count[points[k]]
    for q in range(len(point)):
        row[end[point[q]]] = q
        end[point[q]] += 1
    for k in range(n_measured):  # insertion sort, as a point has few rows
        for a in range(starts[k] + 1, starts[k + 1]):
            q, b = row[a], a
            while b > starts[k] and image[row[b - 1]] > image[q]:
                row[b] = row[b - 1]
                b -= 1
            row[b] = q
    return int(n_measured)


def ordered(point: Index, pose: Index, positions: Array, also: Index) -> Index:
    """Return the poses in an order that keeps those close that share points.

    Of the orders along lines across the block, in directions counted from its longest extent, and
    the reverse Cuthill-McKee order, it is the one of the smallest band. It depends neither on the
    order in which the poses are given nor on the axes. In a block of parallel strips it is mostly
    along a line: levels of Cuthill-McKee begin in a corner, and grow with its diagonal.

    Parameters
    ----------
    point, pose : ndarray, shape (n,)
        Of each measurement.
    positions : ndarray, shape (n_poses, 3)
        About where the poses are, m.
    also : ndarray, shape (k, 2)
        Pairs of poses that are linked besides.
    """
    n_poses = len(positions)
    starts = np.append(0, np.cumsum(np.bincount(point)))
    linked = np.eye(n_poses, dtype=np.bool_)
    _link(starts, pose[np.argsort(point, kind="stable")], linked)
    linked[also[:, 0], also[:, 1]] = linked[also[:, 1], also[:, 0]] = True
    graph = scipy.sparse.csr_array(linked)
    plan = positions[:, :2] - positions[:, :2].mean(axis=0)
    _, axes = np.linalg.eigh(plan.T @ plan)
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    along = plan @ axes @ np.stack([np.cos(angles), np.sin(angles)])
    orders = list(np.argsort(along, axis=0, kind="stable").T)
    best = min(orders, key=lambda order: _band(order, graph))
    levels = scipy.sparse.csgraph.reverse_cuthill_mckee(graph[best][:, best], symmetric_mode=True)
    return min(best, best[levels], key=lambda order: _band(order, graph))


def _band(order: Index, graph: scipy.sparse.csr_array) -> tuple[int, float]:
    """Return how far the poses reach in an order at most, and the sum of squares of all."""
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    ahead = np.maximum.reduceat(place[graph.indices], graph.indptr[:-1]) - place
    return int(ahead.max()), float(ahead @ ahead)


@uncounted
def _link(starts: Index, pose: Index, linked: Mask) -> None:
    for p in range(len(starts) - 1):
        for a in range(starts[p], starts[p + 1]):
            for b in range(starts[p], starts[p + 1]):
                linked[pose[a], pose[b]] = True


def _numbered_pairs(start: Index, image: Index, n_images: int) -> Index:
    """Return `SortedRays.pair`."""
    band = 1 + int(np.max(image[start[1:] - 1] - image[start[:-1]], initial=0))
    pair = np.full((n_images, band), -1, dtype=np.int32)
    pair[:, 0] = 0
    _mark(start, image, pair)
    shared = pair == 0
    pair[shared] = np.arange(np.count_nonzero(shared))
    return pair


@uncounted
def _mark(start: Index, image: Index, pair: Index) -> None:
    for p in range(len(start) - 1):
        for a in range(start[p], start[p + 1]):
            for b in range(a + 1, start[p + 1]):
                pair[image[a], image[b] - image[a]] = 0


def _parts(starts: Index, most: int) -> tuple[tuple[int, int], ...]:
    n = int(np.clip(starts[-1] // RAYS_PER_PART, 1, most))
    edges = np.searchsorted(starts, np.linspace(0, starts[-1], n + 1))
    edges[0], edges[-1] = 0, len(starts) - 1
    return tuple((int(a), int(b)) for a, b in pairwise(edges))


def pose_band(pose: Index, band: int) -> int:
    """Return the largest difference of pose numbers of images in the band, plus one."""
    ahead = np.minimum(np.arange(len(pose)) + band - 1, len(pose) - 1)
    return int(np.max(pose[ahead] - pose, initial=0)) + 1


load(_sort, _mark)
