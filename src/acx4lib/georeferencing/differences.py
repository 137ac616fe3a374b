"""Differences between intersected and surveyed points, with what their errors come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected, shown
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block, SurveyedPoints
from acx4lib.georeferencing import direct
from acx4lib.georeferencing.error_sources import ErrorSources, turned
from acx4lib.least_squares.covariance import propagate


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Differences:
    """Estimated minus surveyed coordinates along the axes of the flight's CRS.

    Attributes
    ----------
    point_idx : ndarray, shape (n,)
        Indices of the block's check points.
    image_idx : ndarray, shape (n, 2)
        First and last image of the intersection.
    n_images : ndarray, shape (n,)
    d, sigma : ndarray, shape (n, 3)
        East, north, height, m; sigma a priori.
    sources : ErrorSources
        Of `d`, along the same axes; the survey is part of a difference's own covariance.
    """

    point_idx: Index
    image_idx: Index
    n_images: Index
    d: Array
    sigma: Array
    sources: ErrorSources

    def __len__(self) -> int:
        """Count the differences."""
        return len(self.d)


def differences_at(
    block: Block,
    georeferenced: direct.Georeferenced,
    selected: direct.Rays,
    check_idx: Index,
    refraction: str,
) -> Differences:
    """Intersect groups of rays, and compare every intersection with its check point.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    selected : Rays
        At least one ray in every group.
    check_idx : ndarray, shape (n_groups,)
        Indices into `block.check`.
    refraction : str
        ``"none"`` or ``"standard"``.
    """
    found = direct.intersect_rays(block, georeferenced, selected, refraction=refraction)
    d, sigma = compare(block, found.x_m, found.cov, check_idx)
    groups = np.arange(len(check_idx))
    starts = np.searchsorted(selected.group, groups)
    ends = np.searchsorted(selected.group, groups, side="right")
    check = block.check[check_idx]
    along_grid = turned(found.sources, check.R_g_m)
    survey = np.eye(3) * check.sigma_m[:, None, :] ** 2
    return Differences(
        point_idx=check_idx,
        image_idx=np.column_stack([selected.image_idx[starts], selected.image_idx[ends - 1]]),
        n_images=ends - starts,
        d=d,
        sigma=sigma,
        sources=replace(along_grid, survey=survey),
    )


def compare(block: Block, x_m: Array, cov: Array, check_idx: Index) -> tuple[Array, Array]:
    """Return estimated minus surveyed coordinates of check points and their sigma.

    Parameters
    ----------
    block : Block
    x_m : ndarray, shape (n, 3)
        Estimated coordinates, mapping frame, m.
    cov : ndarray, shape (n, 3, 3)
        Their covariances, m^2.
    check_idx : ndarray, shape (n,)
        Indices into `block.check`.

    Returns
    -------
    d, sigma : ndarray, shape (n, 3)
        East, north, height in the flight's CRS, m; sigma includes that of the survey.
    """
    x_m = expected.numbers("x_m", x_m, ("n", 3))
    expected.shape("cov", cov, (len(x_m), 3, 3))
    expected.whole_numbers("check_idx", check_idx, (len(x_m),))
    expected.places("check_idx", check_idx, len(block.check))
    check: SurveyedPoints = block.check[check_idx]
    met = np.isfinite(x_m).all(axis=1)
    d = np.full((len(x_m), 3), np.nan)
    d[met] = block.frame.to_grid(x_m[met]) - block.frame.to_grid(check.x_m[met])
    cov_grid = propagate(check.R_g_m, cov)
    return d, np.sqrt(np.diagonal(cov_grid, axis1=1, axis2=2) + check.sigma_m**2)


def rays_of_pairs(
    block: Block, pairs: Differences, which: Sequence[int] | None = None
) -> direct.Rays:
    """Return the rays of pairs: where each image of a pair shows its point.

    Parameters
    ----------
    block : Block
        That of the pairs.
    pairs : Differences
        Of pairs of images.
    which : sequence of int, optional
        Which of the pairs; by default all.
    """
    points = block.image_points
    keys = zip(points.image_idx.tolist(), points.point_idx.tolist(), strict=True)
    row_of = {key: row for row, key in enumerate(keys)}
    chosen = np.arange(len(pairs)) if which is None else np.asarray(which, dtype=np.intp)
    shown = block.check.point_idx[pairs.point_idx]
    rows = [row_of[int(i), int(shown[k])] for k in chosen for i in pairs.image_idx[k]]
    return direct.Rays(
        image_idx=points.image_idx[rows],
        group=np.repeat(np.arange(len(chosen)), 2),
        colrow=points.colrow[rows],
        sigma_px=points.sigma_px[rows],
    )
