"""Tie points measured in the heads' images (Figure 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy import sparse

from acx4lib import shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.tie_points.matching import (
    GreyExposure,
    OverlapMatches,
    OverlapTask,
    SharedWindow,
    TieOptions,
    match_overlap,
    match_overlaps,
    noise_level,
    reduced_exposure,
    shared_windows,
    shift_at,
)
from acx4lib.tie_points.ties import TiePoints

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class OverlapTies:
    """The tie points of an overlap in numbers.

    Attributes
    ----------
    head_a, head_b : int
    names : tuple of str
        Names of the two heads.
    n_cells, n_textured, n_correlated, n_matched, n_ties : int
        Numbers of cells, of those with texture, of points that correlate, of points matched by
        least squares, of points that agree with each other.
    shift_px : ndarray, shape (2,)
        Shift found in reduced images, mean over the overlap, synthetic col, row.
    width_px, least_width_px : float
        Width of the overlap, and the width that matching needs.
    """

    head_a: int
    head_b: int
    names: tuple[str, str]
    n_cells: int
    n_textured: int
    n_correlated: int
    n_matched: int
    n_ties: int
    shift_px: Array
    width_px: float
    least_width_px: float

    def __repr__(self) -> str:
        """Say in a line how many tie points were found."""
        n = shown.count(self.n_ties, "tie point")
        return shown.line("OverlapTies", f"{n} of {' and '.join(self.names)}")

    @property
    def row(self) -> dict[str, object]:
        """Numbers of cells and points after each step, and the shift, as a table row."""
        return {
            "cells": self.n_cells,
            "textured": self.n_textured,
            "correlated": self.n_correlated,
            "matched": self.n_matched,
            "tie points": self.n_ties,
            "shift col (px)": float(self.shift_px[0]),
            "shift row (px)": float(self.shift_px[1]),
        }

    @property
    def sentence(self) -> str:
        """A warning on the overlap for the user; empty where there is nothing to warn of."""
        heads = " and ".join(self.names)
        if self.width_px < self.least_width_px and not self.n_ties:
            return (
                f"{heads}: their pictures overlap by {self.width_px:.0f} px, and the windows of "
                f"matching need {self.least_width_px:.0f} px, so no tie points are found there"
            )
        if self.n_textured < 0.25 * self.n_cells:
            return (
                f"{heads}: {_grouped(self.n_textured)} of {_grouped(self.n_cells)} cells have "
                "texture"
            )
        if not self.n_ties and self.n_textured:
            return (
                f"{heads}: {_grouped(self.n_textured)} cells have texture, but their points do not "
                "agree (files exchanged, of different exposures or turned by 180 degrees, or an "
                "orientation too far off?)"
            )
        if self.n_ties < 0.1 * self.n_textured:
            return (
                f"{heads}: only {_grouped(self.n_ties)} points, which agree, for "
                f"{_grouped(self.n_textured)} cells with texture (noise, compression, or other "
                "bands?)"
            )
        return ""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageTies:
    """Tie points of one exposure.

    Attributes
    ----------
    ties : TiePoints
        In head pixels. Position in the first head is exact by definition; but `sigma_px` is given
        as if both measurements had an equal part in their difference.
    sigma : ndarray, shape (n, 2)
        Predicted standard deviation of the differences along columns and rows, synthetic px.
    overlaps : tuple of OverlapTies
    """

    ties: TiePoints
    sigma: Array
    overlaps: tuple[OverlapTies, ...]

    def __repr__(self) -> str:
        """Say in a line how many tie points were found."""
        n = shown.count(len(self.overlaps), "overlap")
        return shown.line("ImageTies", f"{shown.count(len(self.ties), 'tie point')} of {n}")

    def table(self) -> pd.DataFrame:
        """Return numbers of cells and points of every overlap, a row each."""
        return shown.row_table(
            ("head a", "head b"), {overlap.names: overlap.row for overlap in self.overlaps}
        )

    @property
    def sentences(self) -> list[str]:
        """Warnings on the overlaps for the user."""
        return [report.sentence for report in self.overlaps if report.sentence]


def find_ties(
    images: Sequence[np.ndarray],
    orientation: RelativeOrientation,
    synthetic: Camera,
    *,
    exposure: int = 0,
    options: TieOptions | None = None,
) -> ImageTies:
    """Measure tie points between all heads that share enough of the synthetic image.

    Overlaps without texture give few points or none; a sentence then says so.

    Parameters
    ----------
    images : sequence of ndarray, shape (rows, cols, bands)
        Images of all heads, 8 or 16 bit.
    orientation : RelativeOrientation
        Nominal orientation; its heads have the size of the images.
    synthetic : Camera
    exposure : int
        The `exposure_idx` of the tie points.
    options : TieOptions, optional

    Raises
    ------
    ValueError
        Where the images are not those of the heads.
    """
    _check(images, orientation)
    options = options or TieOptions()
    windows = shared_windows(orientation, synthetic)
    largest = max((shared.area_px for shared in windows), default=0.0)
    coarse = reduced_exposure(images, orientation, synthetic, coarse_factor(windows))
    rng = np.random.default_rng(0)  # the same images always give the same result
    noise = [noise_level(image, rng=rng) for image in images]
    tasks = [
        OverlapTask(
            images=images,
            orientation=orientation,
            synthetic=synthetic,
            shared=shared,
            shift=NO_SHIFT,
            cell=_cell(shared, largest, options),
            noise=noise[shared.head_a],
            options=options,
        )
        for shared in windows
    ]
    shifts = processors.in_order(lambda task: _coarse_shift(task, coarse), tasks)
    tasks = [replace(task, shift=shift) for task, shift in zip(tasks, shifts, strict=True)]
    measured = list(map(_measured, tasks, match_overlaps(tasks)))
    return _assembled(measured, orientation, synthetic, exposure)


def _check(images: Sequence[np.ndarray], orientation: RelativeOrientation) -> None:
    """Raise where images are not those of the heads."""
    if len(images) != len(orientation.heads):
        raise ValueError(f"{len(orientation.heads)} heads need as many images, got {len(images)}")
    for image, head in zip(images, orientation.heads, strict=True):
        if image.ndim != 3 or image.shape[:2] != (head.height_px, head.width_px):
            msg = (
                f"{head.name}: an image of {head.width_px} x {head.height_px} px with bands is "
                f"needed, got an array of shape {image.shape}"
            )
            raise ValueError(msg)


def _cell(shared: SharedWindow, largest: float, options: TieOptions) -> int:
    """Return the side of an overlap's cells; the small overlaps of diagonal heads have fewer."""
    area = max(shared.area_px, largest / 2)
    return min(options.cell_px, max(LEAST_CELL_PX, int(np.sqrt(area / options.cells))))


def strongest_chain(overlaps: Sequence[OverlapTies]) -> list[OverlapTies]:
    """Return the smallest set of overlaps that connects all heads, with the most matched corners.

    For heads with different bands these are the pairs with similar contrast: a chain from band to
    band, while contrasts of the first and the last may be inverted.

    Parameters
    ----------
    overlaps : sequence of OverlapTies
        Of one exposure.

    Returns
    -------
    list of OverlapTies
        In the order of `overlaps`; heads without tie points are not connected.
    """
    n = 1 + max((overlap.head_b for overlap in overlaps), default=0)
    length = np.zeros((n, n))
    for overlap in overlaps:
        if overlap.n_ties:
            length[overlap.head_a, overlap.head_b] = overlap.n_textured / overlap.n_ties
    tree = sparse.csgraph.minimum_spanning_tree(length).toarray()
    return [overlap for overlap in overlaps if tree[overlap.head_a, overlap.head_b] > 0]


# --- one overlap ----------------------------------------------------------------------------


def _measured(task: OverlapTask, matches: OverlapMatches) -> tuple[OverlapMatches, OverlapTies]:
    """Return the consistent matches of an overlap, and the numbers of each step."""
    # in poor pictures, good matches scatter more
    usual = 4 * float(np.median(matches.sigma_px)) if len(matches.sigma_px) else 0.0
    agree = consensus(matches, max(task.options.consensus_px, usual))
    kept = OverlapMatches(
        colrow_a=matches.colrow_a[agree],
        colrow_b=matches.colrow_b[agree],
        sigma_px=matches.sigma_px[agree],
        counts=matches.counts,
    )
    shared = task.shared
    row_0, row_1, col_0, col_1 = shared.window
    middle = np.array([[col_0 + col_1, row_0 + row_1]]) / 2
    names = [task.orientation.heads[k].name for k in (shared.head_a, shared.head_b)]
    n_cells, n_textured, n_correlated, n_matched = map(int, matches.counts)
    return kept, OverlapTies(
        head_a=shared.head_a,
        head_b=shared.head_b,
        names=(names[0], names[1]),
        n_cells=n_cells,
        n_textured=n_textured,
        n_correlated=n_correlated,
        n_matched=n_matched,
        n_ties=int(agree.sum()),
        shift_px=shift_at(task.shift, middle)[0],
        width_px=shared.width_px,
        least_width_px=task.options.least_width_px,
    )


# --- together --------------------------------------------------------------------------------


def _assembled(
    measured: Sequence[tuple[OverlapMatches, OverlapTies]],
    orientation: RelativeOrientation,
    synthetic: Camera,
    exposure: int,
) -> ImageTies:
    """Return the tie points of all overlaps in head pixels."""
    n = sum(report.n_ties for _, report in measured)
    head_a, head_b = np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.intp)
    colrow_a, colrow_b, sigma = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    per_px = np.zeros(n)
    start = 0
    for matches, report in measured:
        rows = slice(start, start + report.n_ties)
        start += report.n_ties
        a, b = report.head_a, report.head_b
        head_a[rows], head_b[rows], sigma[rows] = a, b, matches.sigma_px
        xy_a, xy_b = (xy_from_colrow(synthetic, c) for c in (matches.colrow_a, matches.colrow_b))
        colrow_a[rows] = head_from_synthetic(orientation, a, xy_a)
        colrow_b[rows] = head_from_synthetic(orientation, b, xy_b)
        per_px[rows] = synthetic.pixel_mm / orientation.heads[b].pixel_mm
    return ImageTies(
        ties=TiePoints(
            head_a=head_a,
            head_b=head_b,
            exposure_idx=np.full(n, exposure),
            point_idx=np.arange(n),
            colrow_a=colrow_a,
            colrow_b=colrow_b,
            # each of the two measurements has half the variance of the difference
            sigma_px=per_px * np.sqrt(np.mean(sigma**2, axis=1) / 2),
        ),
        sigma=sigma,
        overlaps=tuple(report for _, report in measured),
    )


def _grouped(number: int) -> str:
    """Return a whole number as text, with spaces between thousands."""
    return f"{number:,}".replace(",", " ")


# --- Large shifts between heads, found in reduced images, and matches that agree with each other


LEAST_CELL_PX = 14  # windows of neighbours overlap by a third
NARROW_PX = 220  # shorter side of an overlap in reduced images
LEAST_TIES = 12  # of an overlap, so that a homography is checked by other points
WITNESSES = 3  # further matches by which a few are believed: by chance one in 10^4 overlaps
_SIMPLE = ((cv2.estimateAffine2D, 3), (cv2.findHomography, 4))  # and their least matches
NO_SHIFT = np.zeros((2, 3))
_LEAST_CUBIC, _GROWING_STEPS = 100, 20  # ten matches for each of ten coefficients


def coarse_factor(windows: Sequence[SharedWindow]) -> int:
    """Return the factor of reduction with which overlaps are about `NARROW_PX` wide."""
    sides = [min(w.window[1] - w.window[0], w.window[3] - w.window[2]) for w in windows]
    return max(1, round(max(sides, default=NARROW_PX) / NARROW_PX))


def _coarse_task(task: OverlapTask, coarse: GreyExposure) -> OverlapTask:
    """Return the matching of the same overlap in reduced images, with a wide search."""
    options = task.options
    row_0, row_1, col_0, col_1 = task.shared.window
    k = coarse.factor
    window = (row_0 // k, -(-row_1 // k), col_0 // k, -(-col_1 // k))
    return replace(
        task,
        images=coarse.images,
        orientation=coarse.orientation,
        synthetic=coarse.synthetic,
        shared=replace(task.shared, window=window),
        shift=NO_SHIFT,
        cell=LEAST_CELL_PX,
        noise=task.noise / k**2,
        options=replace(
            options,
            search_px=options.coarse_search_px,
            largest_sigma_px=2 * options.largest_sigma_px,
        ),
    )


def _coarse_shift(task: OverlapTask, coarse: GreyExposure) -> Array:
    """Return the shift of an overlap, found in reduced images, shape (2, 3).

    Zero where they give no reliable shift.
    """
    matches = match_overlap(_coarse_task(task, coarse))
    agree = consensus(matches, 2 * task.options.consensus_px)
    if not agree.any():
        return NO_SHIFT
    # coordinates are those of pixel centres: reduced col 0 is in the middle of k cols
    k = coarse.factor
    a = k * matches.colrow_a[agree] + (k - 1) / 2
    d = k * (matches.colrow_b - matches.colrow_a)[agree]
    A = np.column_stack([a, np.ones(len(a))])
    return np.linalg.lstsq(A, d, rcond=None)[0].T


def consensus(matches: OverlapMatches, threshold_px: float) -> Mask:
    """Return the mask of matches that agree with each other, shape (n,).

    Parameters
    ----------
    matches : OverlapMatches
    threshold_px : float
        Largest allowed misfit.

    Returns
    -------
    ndarray of bool
        All False where fewer than `LEAST_TIES` agree, or less than a tenth: that may be chance. Of
        fewer matches, half must agree, and `WITNESSES` more than determine a transformation.

    Notes
    -----
    The first model is a homography, by MAGSAC [1]_ with a fixed seed. In the synthetic geometry
    it is exact for errors of the heads' rotations; calibrated lenses add hundredths of a pixel.
    The second is a cubic polynomial that starts from these matches; with badly known lenses, it
    keeps the matches of the whole overlap. Moving objects and false matches fit neither model.
    A few matches must fit an affine transformation or, if they are enough, a homography.

    References
    ----------
    .. [1] D. Barath et al., "MAGSAC++, a fast, reliable and accurate robust estimator",
       CVPR 2020.
    """
    n = len(matches.colrow_a)
    least = max(LEAST_TIES, 0.1 * n)
    if n < least:
        return _few(matches, threshold_px)
    for wider in (1, 4):  # with badly known lenses few matches fit a homography
        agree = _on_homography(matches, wider * threshold_px)
        if agree.sum() >= max(least, _LEAST_CUBIC):
            agree = _grown(matches, agree, threshold_px)
        elif wider > 1:
            break
        if agree.sum() >= least:
            return agree
    return _few(matches, threshold_px)


def _few(matches: OverlapMatches, threshold_px: float) -> Mask:
    """Return the mask of few matches that agree on a transformation of few parameters."""
    n, a, b = len(matches.colrow_a), matches.colrow_a, matches.colrow_b
    best = np.zeros(n, dtype=bool)
    for estimate, determined_by in _SIMPLE:
        if n < determined_by + WITNESSES:
            continue
        transformation, agree = estimate(
            a, b, method=cv2.RANSAC, ransacReprojThreshold=threshold_px
        )
        enough = max(determined_by + WITNESSES, n / 2, best.sum() + 1)
        if transformation is not None and agree.sum() >= enough:
            best = agree.ravel() > 0
    return best


def _on_homography(matches: OverlapMatches, threshold_px: float) -> Mask:
    """Return the mask of matches that agree on a homography."""
    homography, agree = cv2.findHomography(
        matches.colrow_a, matches.colrow_b, cv2.USAC_MAGSAC, threshold_px, maxIters=5000
    )
    if homography is None or agree.sum() < LEAST_TIES:
        return np.zeros(len(matches.colrow_a), dtype=bool)
    # MAGSAC itself has no sharp limit
    misfits = _homography_misfits(matches, agree.ravel() > 0)
    return np.hypot(*misfits.T) <= threshold_px


def _grown(matches: OverlapMatches, agree: Mask, threshold_px: float) -> Mask:
    """Return the mask of matches on a cubic polynomial, grown from the agreeing ones."""
    x, y = ((matches.colrow_a - matches.colrow_a.mean(axis=0)) / np.ptp(matches.colrow_a)).T
    powers = [x**i * y**j for i in range(4) for j in range(4 - i)]
    A, d = np.column_stack(powers), matches.colrow_b - matches.colrow_a
    for _ in range(_GROWING_STEPS):
        before = agree
        misfit = d - A @ np.linalg.lstsq(A[before], d[before], rcond=None)[0]
        agree = np.hypot(*misfit.T) <= threshold_px
        if np.array_equal(agree, before):
            break
    return agree


def _homography_misfits(matches: OverlapMatches, agree: Mask) -> Array:
    """Return the misfits of all matches to the homography of the agreeing ones, (n, 2), px."""
    homography, _ = cv2.findHomography(matches.colrow_a[agree], matches.colrow_b[agree], 0)
    fitted = cv2.perspectiveTransform(matches.colrow_a[:, None], homography)[:, 0]
    return matches.colrow_b - np.asarray(fitted, float)
