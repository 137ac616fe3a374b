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
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.tie_points.matching import (
    GreyExposure,
    OverlapMatches,
    OverlapTask,
    SharedWindow,
    TieOptions,
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
        counted = f"{heads}: {self.n_textured} of {self.n_cells} cells have texture"
        if self.width_px < self.least_width_px and not self.n_ties:
            return (
                f"{heads}: their pictures overlap by {self.width_px:.0f} px, and the windows of "
                f"matching need {self.least_width_px:.0f} px, so no tie points are found there"
            )
        if self.n_textured < 0.25 * self.n_cells:
            return counted
        if not self.n_ties and self.n_textured:
            return (
                f"{counted}, but their points do not agree (files exchanged, of different "
                "exposures or turned by 180 degrees, or an orientation too far off?)"
            )
        if self.n_ties < 0.1 * self.n_textured:
            return (
                f"{counted}, but only {self.n_ties} points, which agree, are found in them (noise, "
                "compression, or other bands?)"
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
    options = options or TieOptions()
    sizes = [(head.height_px, head.width_px) for head in orientation.heads]
    if [image.shape[:2] for image in images] != sizes:
        msg = f"images: expected {sizes} px, got {[image.shape[:2] for image in images]}"
        raise ValueError(msg)
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
    reduced = match_overlaps([_coarse_task(task, coarse) for task in tasks])
    tasks = [
        replace(task, shift=_shift(found, coarse.factor, 2 * options.consensus_px))
        for task, found in zip(tasks, reduced, strict=True)
    ]
    measured = [
        (task, found, _agreeing(found, options))
        for task, found in zip(tasks, match_overlaps(tasks), strict=True)
    ]
    parts = [_in_heads(*of_overlap) for of_overlap in measured]
    joined = {
        name: np.concatenate([none, *(part[name] for part in parts)])
        for name, none in NO_TIES.items()
    }
    sigma, n = joined.pop("sigma"), len(joined["head_a"])
    return ImageTies(
        ties=TiePoints(exposure_idx=np.full(n, exposure), point_idx=np.arange(n), **joined),
        sigma=sigma,
        overlaps=tuple(_counted(*of_overlap) for of_overlap in measured),
    )


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


def _agreeing(matches: OverlapMatches, options: TieOptions) -> Mask:
    """Return the mask of consistent matches; in poor pictures, good matches scatter more."""
    usual = 4 * float(np.median(matches.sigma_px)) if len(matches.sigma_px) else 0.0
    return consensus(matches, max(options.consensus_px, usual))


def _counted(task: OverlapTask, matches: OverlapMatches, agree: Mask) -> OverlapTies:
    """Return the numbers of each step."""
    shared = task.shared
    row_0, row_1, col_0, col_1 = shared.window
    middle = np.array([[col_0 + col_1, row_0 + row_1]]) / 2
    heads = task.orientation.heads
    n_cells, n_textured, n_correlated, n_matched = map(int, matches.counts)
    return OverlapTies(
        head_a=shared.head_a,
        head_b=shared.head_b,
        names=(heads[shared.head_a].name, heads[shared.head_b].name),
        n_cells=n_cells,
        n_textured=n_textured,
        n_correlated=n_correlated,
        n_matched=n_matched,
        n_ties=int(agree.sum()),
        shift_px=shift_at(task.shift, middle)[0],
        width_px=shared.width_px,
        least_width_px=task.options.least_width_px,
    )


def _in_heads(task: OverlapTask, matches: OverlapMatches, agree: Mask) -> dict[str, np.ndarray]:
    """Return the columns of the tie points of an overlap, in head pixels."""
    a, b = task.shared.head_a, task.shared.head_b
    xy_a, xy_b = (
        xy_from_colrow(task.synthetic, colrow[agree])
        for colrow in (matches.colrow_a, matches.colrow_b)
    )
    sigma, n = matches.sigma_px[agree], int(agree.sum())
    # each of the two measurements has half the variance of the difference
    per_px = task.synthetic.pixel_mm / task.orientation.heads[b].pixel_mm
    return {
        "head_a": np.full(n, a, dtype=np.intp),
        "head_b": np.full(n, b, dtype=np.intp),
        "colrow_a": head_from_synthetic(task.orientation, a, xy_a),
        "colrow_b": head_from_synthetic(task.orientation, b, xy_b),
        "sigma_px": per_px * np.sqrt(np.mean(sigma**2, axis=1) / 2),
        "sigma": sigma,
    }


# --- Large shifts between heads, found in reduced images, and matches that agree with each other


LEAST_CELL_PX = 14  # windows of neighbours overlap by a third
NARROW_PX = 220  # shorter side of an overlap in reduced images
LEAST_TIES = 12  # of an overlap, so that a homography is checked by other points
WITNESSES = 3  # further matches by which a few are believed: by chance one in 10^4 overlaps
_SIMPLE = ((cv2.estimateAffine2D, 3), (cv2.findHomography, 4))  # and their least matches
NO_SHIFT = np.zeros((2, 3))
NO_TIES = {
    **dict.fromkeys(("head_a", "head_b"), np.zeros(0, dtype=np.intp)),
    **dict.fromkeys(("colrow_a", "colrow_b", "sigma"), np.zeros((0, 2))),
    "sigma_px": np.zeros(0),
}
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


def _shift(matches: OverlapMatches, factor: int, threshold_px: float) -> Array:
    """Return the shift of an overlap, found in reduced images, shape (2, 3); zero without any."""
    agree = consensus(matches, threshold_px)
    if not agree.any():
        return NO_SHIFT
    # coordinates are those of pixel centres: reduced col 0 is in the middle of k cols
    a = factor * matches.colrow_a[agree] + (factor - 1) / 2
    d = factor * (matches.colrow_b - matches.colrow_a)[agree]
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
    least = max(LEAST_TIES, 0.1 * len(matches.colrow_a))
    agree = _on_homography(matches, 4 * threshold_px)  # with badly known lenses few fit it better
    if agree.sum() >= max(least, _LEAST_CUBIC):
        agree = _grown(matches, agree, threshold_px)
    else:
        agree = _on_homography(matches, threshold_px)
    return agree if agree.sum() >= least else _few(matches, threshold_px)


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
    a, b = matches.colrow_a, matches.colrow_b
    none = np.zeros(len(a), dtype=bool)
    if len(a) < LEAST_TIES:
        return none
    homography, mask = cv2.findHomography(a, b, cv2.USAC_MAGSAC, threshold_px, maxIters=5000)
    if homography is None or mask.sum() < LEAST_TIES:
        return none
    # MAGSAC itself has no sharp limit
    agree = mask.ravel() > 0
    homography, _ = cv2.findHomography(a[agree], b[agree], 0)
    fitted = cv2.perspectiveTransform(a[:, None], homography)[:, 0]
    return np.hypot(*(b - np.asarray(fitted, float)).T) <= threshold_px


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
