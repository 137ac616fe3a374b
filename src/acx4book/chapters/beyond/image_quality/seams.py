"""What is seen where two heads meet: grey values across a seam, and differences in an overlap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4book.chapters.beyond.image_quality.known_exposure import (
    KnownExposure,
    border_depth,
    render_known,
)
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import xy_from_colrow
from acx4lib.synthetic_image.frame import head_from_synthetic, reduced_camera, reduced_heads
from acx4lib.synthetic_image.rendering import FEATHER_PX, resample
from acx4lib.synthetic_image.response import Response, log_response

BAND = 1
"""Green."""

ROW_SHARE = 0.75
"""Of the frame's height, where the seam is crossed."""

AVERAGED_ROWS = 8
"""Rows of the picture at hand whose mean is drawn."""

Window = tuple[int, int, int, int]
"""First row, row behind the last, first column, column behind the last."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamProfile:
    """Grey values of a band along a line across the seam of two heads.

    Attributes
    ----------
    names : tuple of str
        The two heads.
    x_px : ndarray, shape (n,)
        From the seam, px of the full-size synthetic image.
    taken, equalised : ndarray, shape (2, n)
        Of both heads, as they are and divided by their response; NaN where one does not see.
    blended, ideal : ndarray, shape (n,)
        Of the synthetic image, and of the ideal camera's.
    """

    names: tuple[str, str]
    x_px: Array
    taken: Array
    equalised: Array
    blended: Array
    ideal: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class OverlapPicture:
    """A part of an overlap as two heads see it.

    Attributes
    ----------
    names : tuple of str
        The two heads.
    grey : ndarray, shape (rows, cols)
        As the first one sees it.
    differences : dict of str to ndarray, shape (rows, cols)
        Second less first, as a share of their mean, by what was done to them.
    """

    names: tuple[str, str]
    grey: Array
    differences: dict[str, Array]


def seam_profile(
    known: KnownExposure,
    orientation: RelativeOrientation,
    response: Response,
    *,
    pair: tuple[int, int] = (0, 3),
) -> SeamProfile:
    """Return grey values across the seam of two heads that stand beside each other.

    Parameters
    ----------
    known : KnownExposure
    orientation : RelativeOrientation
        Full size.
    response : Response
    pair : tuple of int
        The left and the right one of the lower heads.
    """
    row, col = _seam(known, orientation, pair)
    half = int(2.5 * FEATHER_PX / known.reduce)
    window = (row, row + AVERAGED_ROWS, col - half, col + half)
    taken = [_seen(known, orientation, k, window, None)[..., BAND].mean(axis=0) for k in pair]
    equal = [_seen(known, orientation, k, window, response)[..., BAND].mean(axis=0) for k in pair]
    blended = _mean_rows(render_known(known, orientation, response), window)
    return SeamProfile(
        names=_names(known, pair),
        x_px=known.reduce * (np.arange(-half, half) + 0.5),
        taken=np.stack(taken),
        equalised=np.stack(equal),
        blended=blended,
        ideal=_mean_rows(known.ideal, window),
    )


def overlap_picture(
    known: KnownExposure,
    orientations: tuple[RelativeOrientation, RelativeOrientation],
    response: Response,
    *,
    pair: tuple[int, int] = (0, 3),
    size_px: tuple[int, int] = (180, 240),
) -> OverlapPicture:
    """Return a part of an overlap, and the differences of its heads before and after.

    Parameters
    ----------
    known : KnownExposure
    orientations : tuple of RelativeOrientation
        As calibrated and refined, full size.
    response : Response
    pair : tuple of int
        The left and the right one of the lower heads.
    size_px : tuple of int
        Rows and columns, of the picture at hand.
    """
    row, col = _seam(known, orientations[1], pair)
    rows, cols = size_px
    window = (row - rows // 2, row + rows // 2, col - cols // 2, col + cols // 2)
    calibrated, refined = orientations
    return OverlapPicture(
        names=_names(known, pair),
        grey=_seen(known, refined, pair[0], window, None).mean(axis=2),
        differences={
            "as taken": _difference(known, calibrated, pair, window, None),
            "equalised": _difference(known, calibrated, pair, window, response),
            "equalised and refined": _difference(known, refined, pair, window, response),
        },
    )


def _names(known: KnownExposure, pair: tuple[int, int]) -> tuple[str, str]:
    first, second = (known.orientation.heads[k].name for k in pair)
    return first, second


def _seam(
    known: KnownExposure, orientation: RelativeOrientation, pair: tuple[int, int]
) -> tuple[int, int]:
    """Return row and column, of the picture at hand, where both heads' borders are as far."""
    small = reduced_camera(known.synthetic, known.reduce)
    row = int(ROW_SHARE * small.height_px)
    cols = np.arange(small.width_px, dtype=float)
    xy = xy_from_colrow(small, np.column_stack([cols, np.full(len(cols), row)]))
    left, right = (
        border_depth(orientation.heads[k], head_from_synthetic(orientation, k, xy)) for k in pair
    )
    shared = np.flatnonzero((left > 0) & (right > 0))
    return row, int(shared[np.argmin(np.abs(left - right)[shared])])


def _seen(
    known: KnownExposure,
    orientation: RelativeOrientation,
    k: int,
    window: Window,
    response: Response | None,
) -> Array:
    """Return what a head sees of a window, equalised if its response is given."""
    small = reduced_camera(known.synthetic, known.reduce)
    heads = reduced_heads(orientation, known.reduce)
    grey, seen = resample(known.images[k], heads, k, small, window)
    out = np.where(seen[..., None], grey, np.nan)
    if response is None:
        return out
    rows, cols = np.arange(window[0], window[1]), np.arange(window[2], window[3])
    places = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2).astype(float)
    colrow = head_from_synthetic(heads, k, xy_from_colrow(small, places))
    factor = np.exp(log_response(response, k, colrow, heads.heads[k]))
    return out / factor.reshape(out.shape)


def _difference(
    known: KnownExposure,
    orientation: RelativeOrientation,
    pair: tuple[int, int],
    window: Window,
    response: Response | None,
) -> Array:
    a, b = (_seen(known, orientation, k, window, response).mean(axis=2) for k in pair)
    return 2 * (b - a) / (a + b)


def _mean_rows(image: Raster, window: Window) -> Array:
    part = image[window[0] : window[1], window[2] : window[3], BAND]
    mean: Array = part.mean(axis=0, dtype=float)
    return mean
