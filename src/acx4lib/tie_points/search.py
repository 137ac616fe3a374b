"""Tie points measured in the heads' images (Figure 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from acx4lib import shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.tie_points import large_shifts
from acx4lib.tie_points.harris import noise_level
from acx4lib.tie_points.matching import (
    OverlapMatches,
    OverlapTask,
    TieOptions,
    match_overlaps,
    shift_at,
)
from acx4lib.tie_points.overlaps import SharedWindow, reduced_exposure, shared_windows
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
        """What became of the overlap's cells, by the columns of a table."""
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
                "agree (images of different exposures, a head turned, or its orientation too far "
                "off?)"
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
        """Return what became of every overlap's cells."""
        return shown.row_table(("head a", "head b"), {one.names: one.row for one in self.overlaps})

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

    Returns
    -------
    ImageTies

    Raises
    ------
    ValueError
        Where the images are not those of the heads.
    """
    _check(images, orientation)
    options = options or TieOptions()
    windows = shared_windows(orientation, synthetic)
    largest = max((shared.area_px for shared in windows), default=0.0)
    coarse = reduced_exposure(images, orientation, synthetic, large_shifts.coarse_factor(windows))
    rng = np.random.default_rng(0)  # the same images always give the same result
    noise = [noise_level(image, rng=rng) for image in images]
    tasks = [
        OverlapTask(
            images=images,
            orientation=orientation,
            synthetic=synthetic,
            shared=shared,
            shift=large_shifts.NO_SHIFT,
            cell=_cell(shared, largest, options),
            noise=noise[shared.head_a],
            options=options,
        )
        for shared in windows
    ]
    shifts = processors.in_order(lambda task: large_shifts.coarse_shift(task, coarse), tasks)
    tasks = [replace(task, shift=shift) for task, shift in zip(tasks, shifts, strict=True)]
    found = list(map(_measured, tasks, match_overlaps(tasks)))
    return _assembled(found, orientation, synthetic, exposure)


def _check(images: Sequence[np.ndarray], orientation: RelativeOrientation) -> None:
    """Raise where images are not those of the heads."""
    if len(images) != len(orientation.heads):
        msg = f"{len(orientation.heads)} heads need as many images, got {len(images)}"
        raise ValueError(msg)
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
    return min(options.cell_px, max(large_shifts.LEAST_CELL_PX, int(np.sqrt(area / options.cells))))


def strongest_chain(overlaps: Sequence[OverlapTies]) -> list[OverlapTies]:
    """Return as few overlaps as bind all heads, of which most corners found a partner.

    Of heads with different bands these are the pairs that see similar things: a chain from band to
    band, where contrasts of the first and the last may be inverted.

    Parameters
    ----------
    overlaps : sequence of OverlapTies
        Of one exposure.

    Returns
    -------
    list of OverlapTies
        In the order of `overlaps`; heads without tie points are not bound.
    """
    n = 1 + max((one.head_b for one in overlaps), default=0)
    length = np.zeros((n, n))
    for one in overlaps:
        if one.n_ties:
            length[one.head_a, one.head_b] = one.n_textured / one.n_ties
    tree = sparse.csgraph.minimum_spanning_tree(length).toarray()
    return [one for one in overlaps if tree[one.head_a, one.head_b] > 0]


# --- one overlap ----------------------------------------------------------------------------


def _measured(task: OverlapTask, matches: OverlapMatches) -> tuple[OverlapMatches, OverlapTies]:
    """Return the matches of an overlap that agree, and their numbers."""
    # of poor pictures, good matches miss each other by more
    usual = 4 * float(np.median(matches.sigma_px)) if len(matches.sigma_px) else 0.0
    agree = large_shifts.consensus(matches, max(task.options.consensus_px, usual))
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
    found: Sequence[tuple[OverlapMatches, OverlapTies]],
    orientation: RelativeOrientation,
    synthetic: Camera,
    exposure: int,
) -> ImageTies:
    """Return the tie points of all overlaps in head pixels."""
    n = sum(report.n_ties for _, report in found)
    head_a, head_b = np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.intp)
    colrow_a, colrow_b, sigma = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    per_px = np.zeros(n)
    start = 0
    for matches, report in found:
        own = slice(start, start + report.n_ties)
        start += report.n_ties
        a, b = report.head_a, report.head_b
        head_a[own], head_b[own], sigma[own] = a, b, matches.sigma_px
        xy_a, xy_b = (xy_from_colrow(synthetic, c) for c in (matches.colrow_a, matches.colrow_b))
        colrow_a[own] = head_from_synthetic(orientation, a, xy_a)
        colrow_b[own] = head_from_synthetic(orientation, b, xy_b)
        per_px[own] = synthetic.pixel_mm / orientation.heads[b].pixel_mm
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
        overlaps=tuple(report for _, report in found),
    )


def _grouped(number: int) -> str:
    """Return a whole number as text, with spaces between thousands."""
    return f"{number:,}".replace(",", " ")
