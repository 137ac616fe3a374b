"""Measurements in pictures against the simulator's exact geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4book.chapters.beyond.from_pictures.whole import REDUCE, Whole
from acx4lib.expected import Array, Index, Mask
from acx4sim.pictures.ground_rays import Station, ground_from_pixels, pixels_from_ground, station


@dataclass(frozen=True, kw_only=True, eq=False)
class Errors:
    """Errors of measurements, in pixels of the pictures.

    Attributes
    ----------
    image_idx, point_idx : ndarray, shape (n,)
    off : ndarray, shape (n, 2)
        Along columns and rows.
    sigma : ndarray, shape (n,)
        What the matching predicts for `off`.
    redundancy : int
        Of `off`, both coordinates.
    """

    image_idx: Index
    point_idx: Index
    off: Array
    sigma: Array
    redundancy: int

    @property
    def rms(self) -> float:
        """Root mean square of one coordinate of one measurement, px."""
        return float(np.sqrt(np.sum(self.off**2) / self.redundancy))

    def of_points(self, own: Mask) -> Errors:
        """Return the errors of some tie points alone, of each with all its measurements."""
        n_points = len(np.unique(self.point_idx[own]))
        return Errors(
            image_idx=self.image_idx[own],
            point_idx=self.point_idx[own],
            off=self.off[own],
            sigma=self.sigma[own],
            redundancy=2 * (int(np.sum(own)) - n_points),
        )

    @property
    def wrong(self) -> int:
        """Number of measurements that are off by more than a pixel."""
        return int(np.sum(np.hypot(*self.off.T) > 1))


def of_ties(whole: Whole) -> Errors:
    """Compare the rays of every tie point with each other, on the exact ground.

    A tie point has no true place of its own. Each of its measurements is followed to the ground
    by the exact camera. The weighted mean of these places is projected back.
    """
    image, point, colrow, sigma = _measurements(whole, control=False)
    stations = _stations(whole)
    ground = np.zeros((len(image), 3))
    camera = whole.simulated.plan.cameras["CAM"]
    for k, at in enumerate(stations):
        ground[image == k] = ground_from_pixels(at, camera, colrow[image == k])
    code = np.unique(point, return_inverse=True)[1]
    weight = sigma**-2.0
    total = np.bincount(code, weight)
    mean = np.stack([np.bincount(code, weight * x) / total for x in ground.T], axis=1)[code]
    left = np.sqrt(np.maximum(1 - weight / total[code], 1e-6))
    n = 2 * (len(code) - len(total))
    return _against(whole, image, point, (colrow, sigma * left, mean), n)


def of_control(whole: Whole) -> Errors:
    """Compare the measurements of control points with their true projections."""
    image, point, colrow, sigma = _measurements(whole, control=True)
    truth = whole.simulated.truth["control_points"]
    ground = np.array([truth[whole.block.points[p]] for p in point])
    return _against(whole, image, point, (colrow, sigma, ground), 2 * len(point))


def same_height(whole: Whole, errors: Errors) -> Mask:
    """Tell which measurements are of points that pictures of one height alone show."""
    low = np.array([whole.block.images.strips[i] in ("1", "2", "3") for i in errors.image_idx])
    n = np.bincount(errors.point_idx)
    n_low = np.bincount(errors.point_idx, low)
    one: Mask = ((n_low == 0) | (n_low == n))[errors.point_idx]
    return one


def _measurements(whole: Whole, *, control: bool) -> tuple[Index, Index, Array, Array]:
    seen, surveyed = whole.block.image_points, whole.block.control.point_idx
    own = np.isin(seen.point_idx, surveyed) == control
    return seen.image_idx[own], seen.point_idx[own], seen.colrow[own], seen.sigma_px[own]


def _stations(whole: Whole) -> list[Station]:
    plan, seed = whole.simulated.plan, whole.simulated.seed
    names = (whole.block.trajectory.exposures[i] for i in whole.block.images.exposure_idx)
    return [station(plan, f"calibration/{name}", seed=seed) for name in names]


def _against(
    whole: Whole, image: Index, point: Index, seen: tuple[Array, Array, Array], redundancy: int
) -> Errors:
    colrow, sigma, ground = seen
    off, camera = np.zeros((len(image), 2)), whole.simulated.plan.cameras["CAM"]
    for k, at in enumerate(_stations(whole)):
        own = image == k
        off[own] = colrow[own] - pixels_from_ground(at, camera, ground[own])
    return Errors(
        image_idx=image,
        point_idx=point,
        off=off / REDUCE,
        sigma=sigma / REDUCE,
        redundancy=redundancy,
    )
