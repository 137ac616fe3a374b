"""Two pictures matched: the corners of each found in the other one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Index, Mask
from acx4lib.tie_points.least_squares_matching import correlate, match
from acx4tools.measuring.pictures import epipolar
from acx4tools.measuring.pictures.ground import Surface
from acx4tools.measuring.pictures.patches import laid_patches, own_patches, side_of
from acx4tools.measuring.pictures.views import View, transferred

SPLINE = 8
"""Pixels around a patch over which the splines of a stack's neighbours fade away."""

MOVES = 5
"""Largest movement of a window in least-squares matching, px."""


@dataclass(frozen=True, kw_only=True)
class MatchOptions:
    """How pictures are matched; px of the pictures as they are matched.

    Attributes
    ----------
    correlation_px, window_px : int
        Odd sides of the windows of correlation and of least-squares matching.
    search_px : int
        Largest distance of a point from its prediction, along columns and rows.
    least_correlation : float
        Smallest correlation coefficient.
    largest_sigma_px : float
        Largest predicted sigma of a position.
    epipolar_px : float
        Largest distance from the epipolar line; more where the scatter of the pair is larger.
    """

    correlation_px: int = 15
    window_px: int = 21
    search_px: int = 6
    least_correlation: float = 0.7
    largest_sigma_px: float = 0.25
    epipolar_px: float = 0.5

    def __post_init__(self) -> None:
        expected.whole("search_px", self.search_px)
        for name in ("largest_sigma_px", "epipolar_px"):
            expected.size(name, getattr(self, name))

    @property
    def side(self) -> int:
        """Side of the patches."""
        half = max(self.window_px // 2 + MOVES, self.correlation_px // 2)
        return side_of(half + self.search_px + SPLINE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Found:
    """Points of one picture found in another one.

    Attributes
    ----------
    which : ndarray, shape (n,)
        Numbers of the points that were found.
    colrow : ndarray, shape (n, 2)
        In the other picture.
    sigma_px : ndarray, shape (n, 2)
        Of the difference of both positions: in pixels of the first picture, and of the other.
    """

    which: Index
    colrow: Array
    sigma_px: Array

    def __getitem__(self, keep: Index | Mask) -> Found:
        """Select points."""
        return expected.part_of(self, keep)

    def __len__(self) -> int:
        """Count the points."""
        return len(self.which)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairJob:
    """The matching of two pictures.

    Attributes
    ----------
    a, b : View
    surface : Surface
    at_a, at_b : ndarray, shape (n, 2)
        Whole col, row of the corners of each.
    options : MatchOptions
    """

    a: View
    b: View
    surface: Surface
    at_a: Index
    at_b: Index
    options: MatchOptions


def match_pair(job: PairJob) -> tuple[Found, Found]:
    """Return the corners of the first picture found in the second, and the reverse."""
    there = found_in(job.a, job.b, job.surface, job.at_a, job.options)
    back = found_in(job.b, job.a, job.surface, job.at_b, job.options)
    colrow_a = np.concatenate([job.at_a[there.which], back.colrow])
    colrow_b = np.concatenate([there.colrow, job.at_b[back.which]])
    near = epipolar.agree(job.a, job.b, colrow_a, colrow_b, least_px=job.options.epipolar_px)
    return there[near[: len(there)]], back[near[len(there) :]]


def found_in(a: View, b: View, surface: Surface, at: Index, options: MatchOptions) -> Found:
    """Return the points of picture a that picture b shows, by correlation and least squares.

    Parameters
    ----------
    a, b : View
    surface : Surface
        The ground, by which patches of b are resampled into the pixels of a.
    at : ndarray, shape (n, 2)
        Whole col, row in a.
    options : MatchOptions
    """
    middle = transferred(a, b, surface, at.astype(float))
    size = np.array([b.camera.width_px, b.camera.height_px])
    inside = np.all((middle > 0) & (middle < size - 1), axis=1)  # False for NaN
    which = np.flatnonzero(inside)
    if not len(which):
        return Found(which=which, colrow=np.zeros((0, 2)), sigma_px=np.zeros((0, 2)))
    first = own_patches(a, at[which], options.side)
    other = laid_patches(a, b, surface, at[which], options.side)
    middles = first.middles
    near, coefficient = correlate(
        *(first.grey, other.grey, middles, middles.astype(float)),
        half=options.correlation_px // 2,
        search=options.search_px,
    )
    near[~(coefficient >= options.least_correlation)] = np.nan
    done = match(first.grey, other.grey, middles, near, half=options.window_px // 2)
    sigma = np.sqrt(np.mean(done.sigma_px**2, axis=1))
    good = np.flatnonzero(sigma < options.largest_sigma_px)
    place = other.places(good, (done.colrow - middles)[good])
    both = np.column_stack([sigma, sigma * other.scale])[good]
    return Found(which=which[good], colrow=place, sigma_px=both)
