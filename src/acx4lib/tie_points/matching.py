"""Points that two heads share, tile by tile of their overlap in the synthetic geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, border_distance, colrow_from_xy
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.frame import (
    coverage,
    footprint,
    head_from_synthetic,
    reduced_camera,
    reduced_heads,
)
from acx4lib.synthetic_image.head_map import HeadMap, window_map
from acx4lib.tie_points.compiled import sample_between_nodes
from acx4lib.tie_points.least_squares_matching import REACH, correlate, match, spline_coefficients

TILE_PX = 1024  # small enough for the memory and for the processor's cache


@dataclass(frozen=True, kw_only=True)
class TieOptions:
    """Settings for the measurement of tie points; px of the images given.

    Attributes
    ----------
    cell_px : int
        Largest side of the cells, which give at most one corner each.
    cells : int
        Approximate number of cells: those of small overlaps are smaller.
    correlation_px, window_px : int
        Odd sides of the windows of correlation and of least-squares matching.
    search_px : int
        Largest difference from the shift found in reduced images.
    coarse_search_px : int
        Largest shift in reduced images, in their pixels.
    least_correlation : float
        Smallest correlation coefficient of the windows.
    least_texture : float
        Smallest mean squared derivative of the grey values in its weakest direction, divided by
        that of noise alone.
    largest_sigma_px : float
        Largest predicted sigma of a point's difference along columns or rows. Where the pictures
        are so poor that it leaves out many, it is twice the median, but at most `consensus_px`.
    consensus_px : float
        Largest misfit of a point with the others of its overlap.
    """

    cell_px: int = 42
    cells: int = 9000
    correlation_px: int = 15
    window_px: int = 21
    search_px: int = 8
    coarse_search_px: int = 14
    least_correlation: float = 0.6
    least_texture: float = 3.0
    largest_sigma_px: float = 0.15
    consensus_px: float = 0.5

    @property
    def least_width_px(self) -> int:
        """Width that an overlap must have for windows around a point to lie in both heads."""
        in_first = self.window_px // 2 + 2
        return in_first + max(in_first, self.correlation_px // 2 + self.search_px) + 1


@dataclass(frozen=True, kw_only=True, eq=False)
class OverlapTask:
    """The matching of one overlap.

    Attributes
    ----------
    images : sequence of ndarray, shape (rows, cols, bands) or (rows, cols)
        Images of all heads.
    orientation : RelativeOrientation
        Nominal orientation.
    synthetic : Camera
    shared : SharedWindow
        The common part of two heads.
    shift : ndarray, shape (2, 3)
        Approximate position in the second head minus position in the first: an affine function
        of synthetic col, row.
    cell : int
        Side of the cells, px.
    noise : float
        Variance of the first head's grey values, divided by these.
    options : TieOptions
    """

    images: Sequence[np.ndarray]
    orientation: RelativeOrientation
    synthetic: Camera
    shared: SharedWindow
    shift: Array
    cell: int
    noise: float
    options: TieOptions

    @property
    def halo(self) -> int:
        """Width of the border of grey values around a tile, px."""
        return self.options.window_px // 2 + self.options.search_px + 6


@dataclass(frozen=True, kw_only=True, eq=False)
class OverlapMatches:
    """Positions of the same points in two heads, in pixels of the nominal synthetic image.

    Attributes
    ----------
    colrow_a, colrow_b : ndarray, shape (n, 2)
        Positions from the first head and from the second.
    sigma_px : ndarray, shape (n, 2)
        Predicted sigma of their difference along columns and rows.
    counts : ndarray, shape (4,)
        Numbers of cells, of those with texture, of points that correlate, of points matched.
    """

    colrow_a: Array
    colrow_b: Array
    sigma_px: Array
    counts: Index


def match_overlaps(tasks: Sequence[OverlapTask]) -> list[OverlapMatches]:
    """Return all matches of each overlap, including false ones and those on moving objects.

    The tiles of all overlaps are shared among the processors.
    """
    parts = [(task, part) for task in tasks for part in _parts(task)]
    matches = iter(processors.in_order(lambda both: _match_corners(both[0], _tile(*both)), parts))
    return [_joined(task, [next(matches) for _ in _parts(task)]) for task in tasks]


def _joined(task: OverlapTask, parts: Sequence[OverlapMatches]) -> OverlapMatches:
    """Join the matches of an overlap's parts; leave out those with a large sigma."""
    sigma = np.concatenate([part.sigma_px for part in parts])
    usual = float(np.median(np.max(sigma, axis=1))) if len(sigma) else 0.0
    options = task.options
    largest = max(options.largest_sigma_px, min(2 * usual, options.consensus_px))
    sure = np.max(sigma, axis=1) < largest
    counts = np.sum([part.counts for part in parts], axis=0)
    return OverlapMatches(
        colrow_a=np.concatenate([part.colrow_a for part in parts])[sure],
        colrow_b=np.concatenate([part.colrow_b for part in parts])[sure],
        sigma_px=sigma[sure],
        counts=np.array([*counts, sure.sum()]),
    )


def shift_at(shift: Array, colrow: Array) -> Array:
    """Return an affine shift at points, shape (n, 2)."""
    return colrow @ shift[:, :2].T + shift[:, 2]


# --- tiles -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class _Tile:
    """Grey values of two heads around a part of their overlap.

    Attributes
    ----------
    a, b : ndarray of float32, shape (rows, cols)
    size : tuple of int
        Rows and columns of the part itself, without its halo.
    first_a, first_b : ndarray, shape (2,)
        Synthetic col, row of their first pixels.
    """

    a: Array
    b: Array
    size: tuple[int, int]
    first_a: Array
    first_b: Array


def _parts(task: OverlapTask) -> list[SyntheticWindow]:
    """Return the parts of an overlap, each of whole cells, for matching one after the other."""
    row_0, row_1, col_0, col_1 = task.shared.window
    side = max(TILE_PX // task.cell, 1) * task.cell
    return [
        (row, min(row + side, row_1), col, min(col + side, col_1))
        for row in range(row_0, row_1, side)
        for col in range(col_0, col_1, side)
    ]


def _tile(task: OverlapTask, part: SyntheticWindow) -> _Tile:
    """Return both heads' grey values in a part and around it, the second head's shifted."""
    middle = np.array([[part[2] + part[3], part[0] + part[1]]]) / 2
    shift = np.rint(shift_at(task.shift, middle)[0]).astype(int)
    halo = task.halo
    window = (part[0] - halo, part[1] + halo, part[2] - halo, part[3] + halo)
    moved = (window[0] + shift[1], window[1] + shift[1], window[2] + shift[0], window[3] + shift[0])
    a, b = task.shared.head_a, task.shared.head_b
    return _Tile(
        a=grey_window(task.images[a], task.orientation, a, task.synthetic, window),
        b=grey_window(task.images[b], task.orientation, b, task.synthetic, moved),
        size=(part[1] - part[0], part[3] - part[2]),
        first_a=np.array([window[2], window[0]]),
        first_b=np.array([moved[2], moved[0]]),
    )


def _whole(tile: _Tile, half: int) -> Mask:
    """Return the positions at which both heads have a whole window."""
    seen = np.isfinite(tile.a) & np.isfinite(tile.b)
    window = np.ones((2 * half + 1, 2 * half + 1), np.uint8)
    whole = cv2.erode(
        seen.astype(np.uint8), window, borderType=cv2.BORDER_CONSTANT, borderValue=0.0
    )
    return whole > 0


# --- one tile --------------------------------------------------------------------------------


def _match_corners(task: OverlapTask, tile: _Tile) -> OverlapMatches:
    """Return the matches of a tile by corners, correlation and least-squares matching."""
    options = task.options
    half = options.window_px // 2
    corners, n_cells = _corners(task, tile)
    textured = _has_texture(task, np.nan_to_num(tile.a), corners)
    corners = corners[textured]
    near = corners + shift_at(task.shift, corners + tile.first_a) + tile.first_a - tile.first_b
    correlated, coefficient = correlate(
        tile.a, tile.b, corners, near, half=options.correlation_px // 2, search=options.search_px
    )
    good = (coefficient >= options.least_correlation) & np.isfinite(correlated[:, 0])
    corners = corners[good]
    matches = match(tile.a, tile.b, corners, correlated[good], half=half)
    done = np.isfinite(matches.sigma_px[:, 0])
    return OverlapMatches(
        colrow_a=(corners + tile.first_a)[done].astype(float),
        colrow_b=(matches.colrow + tile.first_b)[done],
        sigma_px=matches.sigma_px[done],
        counts=np.array([n_cells, textured.sum(), good.sum()]),
    )


def _corners(task: OverlapTask, tile: _Tile) -> tuple[Index, int]:
    """Return the best corner of each cell, col, row in the tile, and the number of cells."""
    halo, (rows, cols) = task.halo, tile.size
    core = np.s_[halo : halo + rows, halo : halo + cols]
    whole = _whole(tile, task.options.window_px // 2 + 2)[core]
    if not whole.any():
        return np.zeros((0, 2), dtype=np.intp), 0
    values = response(np.nan_to_num(tile.a))[core]
    corners, n_cells = best_of_cells(values, whole, task.cell)
    return corners + halo, n_cells


def _has_texture(task: OverlapTask, grey: Array, corners: Index) -> Mask:
    """Tell where grey values change by more than noise in every direction."""
    col, row = corners.T
    squares = cv2.cornerMinEigenVal(grey, task.options.window_px, ksize=1)
    weakest = squares[row, col] / 4  # a derivative is half the difference of two pixels
    # central differences of white noise have half its variance; interpolation reduces it
    by_noise = task.noise * np.maximum(grey[row, col], 1) / 2
    return weakest >= task.options.least_texture * by_noise


# --- Corners with texture around them (Figure 1), and the noise that texture must exceed


BLOCK, SOBEL, K = 5, 3, 0.04  # sides of sum and derivative, factor of the trace, after Harris
NOISE_MASK = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)  # zero on planes
_PATCH, _N_PATCHES, _QUIET = 24, 400, 0.05


def response(grey: Array) -> Array:
    """Return Harris' corner response, positive at corners.

    Parameters
    ----------
    grey : ndarray, shape (rows, cols)

    Returns
    -------
    ndarray of float32, shape (rows, cols)
        det - K trace^2 of the squared derivatives, summed over `BLOCK` x `BLOCK` pixels [1]_.

    References
    ----------
    .. [1] C. Harris, M. Stephens, "A combined corner and edge detector", Alvey Vision
       Conference, 1988.
    """
    return np.asarray(cv2.cornerHarris(np.asarray(grey, np.float32), BLOCK, SOBEL, K), np.float32)


def best_of_cells(values: Array, allowed: Mask, cell: int) -> tuple[Index, int]:
    """Return the position of the largest positive value in each cell.

    Parameters
    ----------
    values : ndarray, shape (rows, cols)
    allowed : ndarray of bool, shape (rows, cols)
        Allowed positions.
    cell : int
        Side of the cells, px; the cells of the last row and column are narrower.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Cell by cell, without cells that have no positive value.
    n_cells : int
        Number of cells with allowed positions.
    """
    rows, cols = (-(-n // cell) for n in values.shape)
    padded = np.zeros((rows * cell, cols * cell), np.float32)
    padded[: values.shape[0], : values.shape[1]] = np.where(allowed, values, 0)
    free = np.zeros(padded.shape, bool)
    free[: values.shape[0], : values.shape[1]] = allowed
    cells = _by_cell(padded, cell)
    place = np.argmax(cells, axis=1)
    filled = np.flatnonzero(np.take_along_axis(cells, place[:, None], axis=1)[:, 0] > 0)
    row = filled // cols * cell + place[filled] // cell
    col = filled % cols * cell + place[filled] % cell
    return np.column_stack([col, row]), int(np.sum(_by_cell(free, cell).any(axis=1)))


def _by_cell(values: np.ndarray, cell: int) -> np.ndarray:
    """Return a row of values for each cell."""
    rows, cols = (n // cell for n in values.shape)
    return values.reshape(rows, cell, cols, cell).swapaxes(1, 2).reshape(rows * cols, -1)


def noise_level(image: np.ndarray, *, rng: np.random.Generator) -> float:
    """Estimate the noise of an image: the variance of a grey value divided by the grey value.

    The number of photons has a Poisson distribution, so the variance is proportional to the grey
    value. It comes from the quietest of many small patches; texture in the others has no effect.
    If the whole image has texture of the size of a pixel, some of it counts as noise.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
        The noise is that of the mean of the bands.
    rng : Generator
        Chooses the patches.

    Returns
    -------
    float
        At least the variance that rounding to whole numbers causes.

    Notes
    -----
    The noise of a patch is found with the filter of Immerkaer [1]_, which is zero on planes.

    References
    ----------
    .. [1] J. Immerkaer, "Fast noise variance estimation", Computer Vision and Image
       Understanding 64(2), 1996.
    """
    rows, cols = image.shape[:2]
    side = min(_PATCH, rows, cols)
    origins = rng.integers(0, [rows - side + 1, cols - side + 1], size=(_N_PATCHES, 2))
    patches = np.stack([image[row : row + side, col : col + side] for row, col in origins])
    patches = patches.mean(axis=3, dtype=np.float32)
    # all below each other; rows that mix neighbouring patches are cut off
    filtered = cv2.filter2D(patches.reshape(-1, side), -1, NOISE_MASK).reshape(patches.shape)
    squares = np.mean(filtered[:, 1:-1, 1:-1] ** 2, axis=(1, 2), dtype=float)
    rounding = 1 / (12 * image.shape[2])
    variances = np.maximum(squares / np.sum(NOISE_MASK**2), rounding)
    ratios = variances / np.maximum(patches.mean(axis=(1, 2), dtype=float), 1.0)
    return float(np.quantile(ratios, _QUIET))


# --- overlaps of two heads, and grey values in the synthetic geometry -------------------------


# first row, row after the last, first column, column after the last
SyntheticWindow = tuple[int, int, int, int]

STEP_MM = 0.09  # from node to node of a map: 16 px of 5.6 um, with errors of 0.002 px between
LONG = 3  # widths of a narrow overlap; heads that only touch at a corner need no ties
_NODES = 100  # along the longer side of the synthetic image, to find overlaps
_BORDER = 200  # points on each side of a head
_ROUNDING = 1e-3  # px


@dataclass(frozen=True, kw_only=True)
class SharedWindow:
    """The common part of two heads in the synthetic image.

    Attributes
    ----------
    head_a, head_b : int
        head_a < head_b.
    window : tuple of int
        Rectangle around it: first row, row after the last, first column, column after the last.
    area_px : float
        Number of synthetic pixels that both heads see.
    width_px : float
        Its width, synthetic pixels.
    """

    head_a: int
    head_b: int
    window: SyntheticWindow
    area_px: float
    width_px: float


@dataclass(frozen=True, kw_only=True, eq=False)
class GreyExposure:
    """Grey images of all heads at one exposure, reduced by a whole number.

    Attributes
    ----------
    images : tuple of ndarray of float32, shape (rows, cols)
    orientation : RelativeOrientation
        With heads of this size.
    synthetic : Camera
        Reduced by the same factor.
    factor : int
    """

    images: tuple[Array, ...]
    orientation: RelativeOrientation
    synthetic: Camera
    factor: int


def shared_windows(orientation: RelativeOrientation, synthetic: Camera) -> list[SharedWindow]:
    """Return the parts that pairs of heads share.

    They are found on a grid over the synthetic image; strips that are narrower than its meshes, by
    the heads' borders.
    """
    size = np.array([synthetic.height_px, synthetic.width_px])
    grid = coverage(orientation, synthetic, spacing_px=max(int(size.max()) // _NODES, 1))
    seen = grid.seen
    spacing = (size - 1) / (np.array(seen.shape[1:]) - 1)
    out = []
    for a in range(len(seen)):
        for b in range(a + 1, len(seen)):
            shared = np.argwhere(seen[a] & seen[b])
            strip = _strip(orientation, (a, b), synthetic)
            if not len(shared):
                out += [strip] if strip.area_px > LONG * strip.width_px**2 else []
                continue
            # the shared part may extend up to the next node
            first = np.maximum(np.floor((shared.min(axis=0) - 1) * spacing), 0)
            last = np.minimum(np.ceil((shared.max(axis=0) + 1) * spacing) + 1, size)
            window = (int(first[0]), int(last[0]), int(first[1]), int(last[1]))
            area = float(len(shared) * np.prod(spacing))
            inner = _depths(orientation, (a, b), synthetic, grid.xy[seen[a] & seen[b]])
            width = max(strip.width_px, 2 * float(inner.min(axis=0).max()))
            out.append(replace(strip, window=window, area_px=area, width_px=width))
    return out


def _strip(
    orientation: RelativeOrientation, pair: tuple[int, int], synthetic: Camera
) -> SharedWindow:
    """Return the common part of two heads that overlap only in a strip along their borders."""
    half = 0.5 * synthetic.pixel_mm * np.array([synthetic.width_px, synthetic.height_px])
    xy = np.concatenate([footprint(orientation, k, per_side=_BORDER) for k in pair])
    depths = _depths(orientation, pair, synthetic, xy)
    # a point of a border is 0 px inside its own head
    within = (depths.min(axis=0) > -_ROUNDING) & np.all(np.abs(xy) <= half, axis=1)
    colrow = colrow_from_xy(synthetic, xy[within])
    empty = not len(colrow)
    first = np.zeros(2) if empty else np.floor(colrow.min(axis=0))
    last = np.zeros(2) if empty else np.ceil(colrow.max(axis=0)) + 1
    width = float(depths[:, within].max(initial=0.0))
    return SharedWindow(
        head_a=pair[0],
        head_b=pair[1],
        window=(int(first[1]), int(last[1]), int(first[0]), int(last[0])),
        area_px=width * float(np.max(last - first)),
        width_px=width,
    )


def _depths(
    orientation: RelativeOrientation, pair: tuple[int, int], synthetic: Camera, xy: Array
) -> Array:
    """Return the depths of points inside the borders of two heads, synthetic px, shape (2, n)."""
    depths = []
    for k in pair:
        head = orientation.heads[k]
        depth = border_distance(head, head_from_synthetic(orientation, k, xy))
        depths.append(depth * head.pixel_mm / synthetic.pixel_mm)
    return np.nan_to_num(np.stack(depths), nan=-1.0)


def grey(image: np.ndarray) -> Array:
    """Return the mean of an image's bands, shape (rows, cols), float32."""
    bands = image.shape[2]
    share = np.full((1, bands), 1 / bands, np.float32)
    return np.asarray(cv2.transform(image.astype(np.float32), share), np.float32)


def grey_window(
    image: np.ndarray,
    orientation: RelativeOrientation,
    k: int,
    synthetic: Camera,
    window: SyntheticWindow,
) -> Array:
    """Return the grey values of one head in a part of the synthetic image.

    Interpolated by cubic splines. Bilinear interpolation would shift fine structures by
    hundredths of a pixel, depending on their position between the pixels.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
        Image of the head; or its grey values, shape (rows, cols).
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    window : tuple of int
        First row, row after the last, first column, column after the last; it may extend beyond
        the synthetic image's border.

    Returns
    -------
    ndarray of float32
        NaN where the head does not see.
    """
    step_px = min(max(round(STEP_MM / synthetic.pixel_mm), 4), 16)
    head = window_map(orientation, k, synthetic, window, step_px=step_px)
    out = np.full((window[1] - window[0], window[3] - window[2]), np.nan, np.float32)
    first, last = _part(head)
    if np.all(last - first > 3):
        part = image[first[1] : last[1], first[0] : last[0]]
        part = np.asarray(part, np.float32) if part.ndim == 2 else grey(part)
        resample(part, head.nodes, head.step_px, first, out)
    return out


def resample(part: Array, nodes: Array, step: int, origin: Array, out: Array) -> None:
    """Fill an image with grey values of another one, by cubic splines.

    Parameters
    ----------
    part : ndarray of float32, shape (rows, cols)
        Grey values of a part of the other image.
    nodes : ndarray, shape (m, n, 2)
        col, row in the other image, at every `step`-th pixel of `out`; bilinear between them.
    step : int
    origin : ndarray, shape (2,)
        col, row in the other image of the part's first pixel.
    out : ndarray of float32
        NaN where the part has no values.
    """
    whole = np.ascontiguousarray(nodes, dtype=float)
    sample_between_nodes(spline_coefficients(part), whole, step, origin.astype(float), out)


def _part(head: HeadMap) -> tuple[np.ndarray, np.ndarray]:
    """Return first col, row of the pixels of a map, and col, row after the last."""
    size = np.array([head.width_px, head.height_px])
    flat = head.nodes.reshape(-1, 2)
    flat = flat[np.isfinite(flat[:, 0])]
    if not len(flat):
        return size, size
    first = np.clip(np.floor(flat.min(axis=0)) - REACH, 0, size).astype(np.intp)
    last = np.clip(np.ceil(flat.max(axis=0)) + REACH + 1, 0, size).astype(np.intp)
    return first, last


def reduced_exposure(
    images: Sequence[np.ndarray],
    orientation: RelativeOrientation,
    synthetic: Camera,
    factor: int,
) -> GreyExposure:
    """Return grey images reduced by a factor; pixels are means of factor x factor pixels."""
    heads = reduced_heads(orientation, factor)
    pairs = zip(images, heads.heads, strict=True)
    return GreyExposure(
        images=tuple(processors.in_order(lambda pair: _reduced_grey(*pair, factor), pairs)),
        orientation=heads,
        synthetic=reduced_camera(synthetic, factor),
        factor=factor,
    )


def _reduced_grey(image: np.ndarray, camera: Camera, factor: int) -> Array:
    """Return the means of factor x factor pixels, from the middle of an image."""
    rows, cols = camera.height_px, camera.width_px
    row, col = (image.shape[0] - factor * rows) // 2, (image.shape[1] - factor * cols) // 2
    part = image[row : row + factor * rows, col : col + factor * cols]
    small = cv2.resize(part, (cols, rows), interpolation=cv2.INTER_AREA)
    return grey(small.reshape(rows, cols, -1))
