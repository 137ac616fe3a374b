"""The measurements of a block in the order in which compiled code works on them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee

from acx4lib._typing import Array, Index, Mask
from acx4lib.rays import Rays, compiled

RAYS_PER_PART = 40_000
MOST_PARTS = 4
"""Rays are worked on in parts, which threads share; the result does not depend on the threads."""

DENSE_COLUMNS, DENSE_SHARE = 1500, 0.3
"""A system is dense that has fewer unknowns, or whose band is a larger share of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Packed:
    """The rays of a block in the order in which they are worked on.

    Attributes
    ----------
    rays : Rays
    row : ndarray, shape (n,)
        Which measurement of the block each ray is.
    sigma_px : ndarray, shape (n,)
    image : ndarray, shape (n_images,)
        The block's images in the order of the rays' numbers.
    pose : ndarray, shape (n_poses,)
        The block's poses in the order of the bands.
    band : int
        Images whose numbers are less than this apart may share points.
    dense : bool
        Whether the reduced system is worth a dense matrix.
    parts : tuple of tuple of int
        First and last point of what a thread takes at a time.
    """

    rays: Rays
    row: Index
    sigma_px: Array
    image: Index
    pose: Index
    band: int
    dense: bool
    parts: tuple[tuple[int, int], ...]


def pack(  # noqa: PLR0913
    *,
    point: Index,
    image: Index,
    xy: Array,
    sigma_px: Array,
    sigma_mm: Array,
    free_points: Mask,
    also: Index,
    pose_of_image: Index,
    n_poses: int,
) -> Packed:
    """Return measurements in the order in which they are worked on.

    Parameters
    ----------
    point, image : ndarray, shape (n,)
        Of every measurement.
    xy : ndarray, shape (n, 2)
        mm.
    sigma_px, sigma_mm : ndarray, shape (n,)
    free_points : ndarray, shape (n_points,)
    also : ndarray, shape (k,)
        Points of which there are other observations.
    pose_of_image : ndarray, shape (n_images,)
    n_poses : int
    """
    pose: Index = np.arange(n_poses)
    dense = 6 * n_poses <= DENSE_COLUMNS
    if not dense:
        pose = ordered(point, pose_of_image[image], n_poses)
    place = np.empty(n_poses, dtype=np.int64)
    place[pose] = np.arange(n_poses)
    images = np.argsort(place[pose_of_image], kind="stable")
    number = np.empty(len(images), dtype=np.int64)
    number[images] = np.arange(len(images))

    first = np.full(len(free_points), len(images))
    np.minimum.at(first, point, number[image])
    row = np.lexsort((number[image], point, first[point]))
    start = np.flatnonzero(np.diff(point[row], prepend=-1))
    points = point[row][start]
    starts = np.append(start, len(row))
    known = np.full(len(free_points), -1)
    known[also] = np.arange(len(also))
    rays = Rays(
        start=starts,
        point=points,
        free=np.ascontiguousarray(free_points[points]),
        also=known[points],
        image=number[image][row].astype(np.int32),
        xy=np.ascontiguousarray(xy[row]),
        weight=1 / sigma_mm[row],
    )
    band = _image_band(rays.start, rays.image)
    of_pose = place[pose_of_image[images]]
    dense = dense or 6 * pose_band(of_pose, band) > DENSE_SHARE * 6 * n_poses
    return Packed(
        rays=rays,
        row=row,
        sigma_px=sigma_px[row],
        image=images,
        pose=pose,
        band=band,
        dense=dense,
        parts=_parts(starts),
    )


def ordered(point: Index, pose: Index, n_poses: int) -> Index:
    """Return the poses in reverse Cuthill-McKee order of which share points."""
    order = np.argsort(point, kind="stable")
    starts = np.append(np.flatnonzero(np.diff(point[order], prepend=-1)), len(order))
    linked = np.zeros((n_poses, n_poses), dtype=np.bool_)
    _link(starts, pose[order], linked)
    return reverse_cuthill_mckee(sparse.csr_matrix(linked), symmetric_mode=True).astype(np.int64)


@compiled
def _link(starts: Index, pose: Index, linked: Mask) -> None:
    for p in range(len(starts) - 1):
        for a in range(starts[p], starts[p + 1]):
            for b in range(starts[p], starts[p + 1]):
                linked[pose[a], pose[b]] = True


def _image_band(start: Index, image: Index) -> int:
    """Return the largest difference of image numbers at a point, plus one."""
    if len(image) == 0:
        return 1
    return int(np.max(image[start[1:] - 1] - image[start[:-1]])) + 1


def _parts(starts: Index) -> tuple[tuple[int, int], ...]:
    n = int(np.clip(starts[-1] // RAYS_PER_PART, 1, MOST_PARTS))
    edges = np.searchsorted(starts, np.linspace(0, starts[-1], n + 1))
    edges[0], edges[-1] = 0, len(starts) - 1
    return tuple((int(a), int(b)) for a, b in pairwise(edges))


def pose_band(pose: Index, band: int) -> int:
    """Return how many poses apart images less than `band` apart can hang, plus one."""
    ahead = np.minimum(np.arange(len(pose)) + band - 1, len(pose) - 1)
    return int(np.max(pose[ahead] - pose, initial=0)) + 1
