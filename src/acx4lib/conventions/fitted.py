"""Readings of a block with a number that must be found first: how much was moved, scaled or late.

Each is a pattern in the residuals. Its size is estimated together with mounting and lens, so that
what these absorb of it is no part of it, and then undone in the measurements or in control.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.conventions.mounted import Mounted, derivatives, mounted, pattern_sizes
from acx4lib.conventions.readings import Reading, velocities
from acx4lib.conventions.sightings import Sightings
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import xy_from_colrow
from acx4lib.geometry.frames import Pose

ROUNDS = 2
"""How often the sizes of a pattern are estimated, each time after an adjustment without it."""

LEAST_SURVEYED = 4
"""Number of surveyed points from which they may be moved or scaled."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pattern:
    """What a mistake makes of the measurements or of the surveyed points.

    Attributes
    ----------
    name : str
        With places for the sizes.
    by_image, by_point : ndarray, shape (n, 2, k) or (n_points, 3, k)
        Image coordinates, radians, or meters, per unit of each size; one of them is empty.
    units : tuple of float
        By which the sizes are multiplied for the name.
    """

    name: str
    units: tuple[float, ...]
    by_image: Array | None = None
    by_point: Array | None = None


def readings(block: Block, seen: Sightings, given: Mounted) -> Iterator[tuple[Reading, Mounted]]:
    """Yield the readings with a fitted number, each with the cameras that fit it.

    Parameters
    ----------
    block : Block
    seen : Sightings
        Of the block.
    given : Mounted
        The cameras that fit the numbers as they are.
    """
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    if not np.isfinite(given.misfit):
        return
    for pattern in (*_of_control(seen), *_of_images(block, seen, T_m_b, given)):
        yield _fitted(pattern, seen, T_m_b, given)


def _fitted(
    pattern: _Pattern, seen: Sightings, T_m_b: Pose, given: Mounted
) -> tuple[Reading, Mounted]:
    """Return the reading without a pattern, and the cameras that fit it."""
    total, undone, found = np.zeros(len(pattern.units)), seen, given
    for _ in range(ROUNDS):
        total = total + pattern_sizes(
            undone, T_m_b, found, _in_residuals(pattern, seen, T_m_b, found)
        )
        undone = _without(pattern, seen, total)
        found = mounted(undone, T_m_b)
    shown = (unit * size for unit, size in zip(pattern.units, total, strict=True))
    quantity = "image" if pattern.by_point is None else "position"
    name = pattern.name.format(*shown)
    return Reading(name=name, quantity=quantity, seen=undone, T_m_b=T_m_b), found


def _in_residuals(pattern: _Pattern, seen: Sightings, T_m_b: Pose, found: Mounted) -> Array:
    """Return what a pattern adds to the residuals, radians, shape (n, 2, k)."""
    if pattern.by_image is not None:
        return -pattern.by_image
    by_point = np.zeros((len(seen.x_m), 3, 1)) if pattern.by_point is None else pattern.by_point
    out: Array = derivatives(seen, T_m_b, found) @ by_point[seen.point_idx]
    return out


def _without(pattern: _Pattern, seen: Sightings, sizes: Array) -> Sightings:
    """Return the sightings with a pattern of these sizes added."""
    if pattern.by_point is not None:
        return replace(seen, x_m=seen.x_m + pattern.by_point @ sizes)
    if pattern.by_image is None:
        return seen
    scale = np.array([c.interior.f / c.pixel_mm for c in seen.cameras])[seen.camera_idx]
    moved = scale[:, None] * (pattern.by_image @ sizes) * np.array([1.0, -1.0])
    return replace(seen, colrow=seen.colrow + moved)


def _of_control(seen: Sightings) -> Iterator[_Pattern]:
    """Yield surveyed points of another epoch, and of another scale."""
    surveyed: Mask = np.isfinite(seen.x_m[:, 0])
    if surveyed.sum() < LEAST_SURVEYED:
        return
    shift = np.zeros((len(surveyed), 3, 2))
    shift[surveyed] = np.eye(3)[:, :2]
    yield _Pattern(
        name="control points moved by {:+.2f} m east and {:+.2f} m north, as from another epoch,",
        units=(1.0, 1.0),
        by_point=shift,
    )
    scale = np.zeros((len(surveyed), 3, 1))
    scale[surveyed, :2, 0] = seen.x_m[surveyed, :2] - seen.x_m[surveyed, :2].mean(axis=0)
    yield _Pattern(
        name="control points scaled by {:+.0f} ppm, as from the ground to the grid,",
        units=(1e6,),
        by_point=scale,
    )


def _of_images(block: Block, seen: Sightings, T_m_b: Pose, given: Mounted) -> Iterator[_Pattern]:
    """Yield pixels that are not square, and rows that were read out one after the other."""
    xy, height = np.empty((len(seen), 2)), np.empty(len(seen))
    for k, camera in enumerate(seen.cameras):
        own = seen.camera_idx == k
        xy[own] = xy_from_colrow(camera, seen.colrow[own]) / camera.interior.f
        height[own] = camera.height_px
    wider = np.zeros((len(seen), 2, 1))
    wider[:, 0, 0] = xy[:, 0]
    yield _Pattern(name="pixels that are {:+.2f} % wider than high", units=(100.0,), by_image=wider)
    velocity = velocities(block, seen)
    if velocity is not None:
        share = (seen.colrow[:, 1] - (height - 1) / 2) / height
        moved = derivatives(seen, T_m_b, given) @ velocity[seen.exposure_idx][:, :, None]
        yield _Pattern(
            name="rows read out one after the other, a rolling shutter of {:+.0f} ms,",
            units=(-1000.0,),
            by_image=share[:, None, None] * moved,
        )
