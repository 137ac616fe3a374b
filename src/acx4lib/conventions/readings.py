"""The readings of a block: its sightings and body poses, each in another meaning of its numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import Block, ImagePoints
from acx4lib.flight.design import strip_of_exposure
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """A block in one reading.

    Attributes
    ----------
    name : str
        What is read otherwise, such as "pitch of opposite sign".
    quantity : {"attitude", "position", "image"}
        What it changes most.
    seen : Sightings
    T_m_b : Pose
        One per exposure of the sightings.
    velocity : ndarray, shape (n_exposures, 3), or None
        m/s, where a delay is to be found.
    of_some : bool
        Whether it changes some images only, perhaps too few for the misfit of all.
    """

    name: str
    quantity: str
    seen: Sightings
    T_m_b: Pose
    velocity: Array | None = None
    of_some: bool = False


def velocities(block: Block, seen: Sightings) -> Array | None:
    """Return the velocity of every exposure that is seen, m/s; None where no times tell it."""
    time_s = block.trajectory.time_s
    if len(time_s) < len(block.trajectory) or not np.isfinite(time_s).all():
        return None
    velocity, strips = np.zeros((len(time_s), 3)), np.array(strip_of_exposure(block), dtype=object)
    for strip in dict.fromkeys(strips):
        own = np.flatnonzero(strips == strip)
        if len(own) > 1 and np.all(np.diff(time_s[own]) > 0):
            velocity[own] = np.gradient(block.trajectory.T_m_b.r[own], time_s[own], axis=0)
    return velocity[seen.exposures] if np.any(velocity) else None


# --- A part of a block's measurements, enough to compare readings of the flight by


MOST_IMAGES = 60
"""Number of images that are looked at, spread over the block."""

MOST_MEASUREMENTS = 900
"""Number of their measurements, spread likewise."""

RUN = 10
"""Number of neighbouring exposures that are looked at together where tie points are needed."""

FEWEST_RAYS = 3
"""Of a tie point: two rays of one strip say nothing of the angles across it."""

FEWEST_EXPOSURES = 6
"""Number of exposures below which a reading may fit by chance."""

FEWEST_MEASUREMENTS = 30
"""Number of measurements of surveyed points below which tie points are taken as well."""

BEYOND = 300_000.0
"""Distance from the median of the surveyed points, m, that no point of a block can have."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightings:
    """Measurements of points, most of them surveyed.

    Attributes
    ----------
    cameras : tuple of Camera
        As declared.
    exposures : ndarray, shape (n_exposures,)
        Places of the exposures in the block's trajectory.
    camera_idx, exposure_idx, point_idx : ndarray, shape (n,)
        Of every measurement: places in `cameras`, `exposures` and `x_m`.
    colrow : ndarray, shape (n, 2)
        Pixels.
    x_m : ndarray, shape (n_points, 3)
        Surveyed coordinates, mapping frame, m; NaN for tie points.
    """

    cameras: tuple[Camera, ...]
    exposures: Index
    camera_idx: Index
    exposure_idx: Index
    point_idx: Index
    colrow: Array
    x_m: Array

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.colrow)


def sightings(block: Block) -> Sightings | None:
    """Return measurements of at most sixty images; None where they cannot tell readings apart.

    Surveyed points are enough where there are some in every image; else tie points are added.
    """
    x_m = _surveyed(block)
    points = block.image_points[np.isfinite(block.image_points.sigma_px)]
    few = _of_some_images(block, points[np.isfinite(x_m[points.point_idx, 0])])
    if not _enough(block, few):
        few = _with_ties(block, points, np.isfinite(x_m[:, 0]))
    if not _enough(block, few):
        return None
    shown, point_idx = np.unique(few.point_idx, return_inverse=True)
    exposures, exposure_idx = np.unique(
        block.images.exposure_idx[few.image_idx], return_inverse=True
    )
    return Sightings(
        cameras=block.cameras,
        exposures=exposures,
        camera_idx=block.images.camera_idx[few.image_idx],
        exposure_idx=exposure_idx,
        point_idx=point_idx,
        colrow=few.colrow,
        x_m=x_m[shown],
    )


def _enough(block: Block, points: ImagePoints) -> bool:
    exposures = np.unique(block.images.exposure_idx[points.image_idx])
    return len(exposures) >= FEWEST_EXPOSURES and len(points) >= FEWEST_MEASUREMENTS


def _surveyed(block: Block) -> Array:
    """Return the coordinates of surveyed points on the earth, NaN for all other points."""
    x_m = np.full((len(block.points), 3), np.nan)
    for surveyed in (block.control, block.check):
        x_m[surveyed.point_idx] = surveyed.x_m
    known = np.isfinite(x_m[:, 0])
    if known.any():
        far = np.abs(x_m[known] - np.median(x_m[known], axis=0)).max(axis=1) > BEYOND
        x_m[np.flatnonzero(known)[far]] = np.nan
    return x_m


def _of_some_images(block: Block, points: ImagePoints) -> ImagePoints:
    """Return the measurements of whole exposures, evenly spaced, and not too many of them."""
    exposure = block.images.exposure_idx[points.image_idx]
    kept = _spaced(np.unique(exposure), _most_exposures(block))
    points = points[np.isin(exposure, kept)]
    return points[_spaced(np.arange(len(points)), MOST_MEASUREMENTS)]


def _with_ties(block: Block, points: ImagePoints, is_surveyed: Mask) -> ImagePoints:
    """Return the measurements of neighbouring exposures, of surveyed and of some tie points."""
    exposure = block.images.exposure_idx[points.image_idx]
    measured = np.unique(exposure)
    first = _spaced(np.arange(len(measured)), _most_exposures(block) // RUN)
    runs = np.unique(np.minimum(first[:, None] + np.arange(RUN), len(measured) - 1))
    points = points[np.isin(exposure, measured[runs])]
    rays = np.bincount(points.point_idx, minlength=len(is_surveyed))
    ties = np.flatnonzero((rays >= FEWEST_RAYS) & ~is_surveyed)
    most = int(MOST_MEASUREMENTS / max(1.0, rays[ties].mean())) if len(ties) else 0
    kept = is_surveyed.copy()
    kept[_spaced(ties, most)] = True
    return points[kept[points.point_idx]]


def _most_exposures(block: Block) -> int:
    return int(MOST_IMAGES * len(block.trajectory) / max(1, len(block.images)))


def _spaced(values: Index, most: int) -> Index:
    """Return at most so many values, evenly spaced."""
    every = np.linspace(0, len(values) - 1, min(len(values), max(most, 1)))
    return values[np.round(every).astype(np.intp)]
