"""Match two pictures: find the corners of each in the other one, along its epipolar line.

Patches are laid onto the ground, compared and fitted by least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import TypeVar

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from acx4files.measuring.views import Surface, View, pixels_of_view, transferred
from acx4lib import expected
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.tie_points.least_squares_matching import REACH, correlate, match
from acx4lib.tie_points.matching import grey, resample

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

    @property
    def side(self) -> int:
        """Side of the patches."""
        half = max(self.window_px // 2 + MOVES, self.correlation_px // 2)
        reach = half + self.search_px + SPLINE  # to every side; a whole number of steps
        return 2 * STEP * -(-reach // STEP) + 1


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


# --- Consensus by epipolar geometry: both rays of a point lie in one plane with both cameras


ENOUGH = 12
"""Points by which the trend of their distances can be told from false matches."""

SIGMAS = 4.0
_ROUNDS = 8
_LEAST_BASE = 0.02  # of the distance to the ground; without a base every ray is in one plane


def distances(a: View, b: View, colrow_a: Array, colrow_b: Array) -> Array:
    """Return the distances of points from their epipolar lines, px of picture b, shape (n, 2).

    The second column is zero, unless the two pictures have no base: then the two rays should be
    parallel, and both columns are components of the angle between them.
    """
    ray_a, ray_b = (_rays(view, colrow) for view, colrow in ((a, colrow_a), (b, colrow_b)))
    base = b.T_m_c.r[0] - a.T_m_c.r[0]
    px = b.camera.interior.f / b.camera.pixel_mm
    high = max(abs(float(a.T_m_c.r[0, 2])), 1.0)
    if np.linalg.norm(base) < _LEAST_BASE * high:
        apart = (ray_b - ray_a) @ b.T_m_c.R[0]
        return np.asarray(px * apart[:, :2])
    normal = np.cross(base, ray_a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = px * np.sum(normal * ray_b, axis=1)
    return np.column_stack([across, np.zeros_like(across)])


def agree(a: View, b: View, colrow_a: Array, colrow_b: Array, *, least_px: float) -> Mask:
    """Tell which matches of a pair agree on an epipolar geometry, shape (n,).

    Errors of the orientations change the distances from the epipolar lines smoothly over the
    picture; a false match leaves this trend. A cubic polynomial takes it up, with the lens's part.

    Parameters
    ----------
    a, b : View
    colrow_a, colrow_b : ndarray, shape (n, 2)
    least_px : float
        A distance that is always allowed.
    """
    n = len(colrow_a)
    if n < ENOUGH:
        return np.zeros(n, dtype=bool)
    off = distances(a, b, colrow_a, colrow_b)
    size = np.array([a.camera.width_px, a.camera.height_px])
    x, y = (2 * colrow_a / size - 1).T
    degree = 3 if n > 60 else 2 if n > 25 else 1
    A = np.column_stack([x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)])
    weight = np.ones(n)
    residuals = off - np.median(off, axis=0)
    for _ in range(_ROUNDS):
        size_of = np.hypot(*residuals.T)
        scatter = max(1.4826 * float(np.median(size_of)), least_px / SIGMAS)
        weight = 1 / (1 + (size_of / (2 * scatter)) ** 2)  # Cauchy's
        WA = A * np.square(weight)[:, None]
        residuals = off - A @ np.linalg.lstsq(WA.T @ A, WA.T @ off, rcond=None)[0]
    near: Mask = np.hypot(*residuals.T) <= max(least_px, SIGMAS * scatter)
    return near if near.sum() >= max(ENOUGH, n / 3) else np.zeros(n, dtype=bool)


def _rays(view: View, colrow: Array) -> Array:
    T_m_c = Pose(R=np.broadcast_to(view.T_m_c.R[:1], (len(colrow), 3, 3)), r=view.T_m_c.r[:1])
    return rays(view.camera, T_m_c, np.asarray(colrow, float))


# --- Patches of a picture, resampled into the pixels of another one by way of the ground
#
# Strips that cross or oppose each other, and other flying heights, differ by turns and scales that
# no search over shifts can find. After this only small shifts remain.


STEP = 8
"""Pixels between the nodes of a patch's map, which is bilinear between them."""

FINER = 1.1
"""A picture that has more pixels along the same line is smoothed before it is resampled."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Patches:
    """Patches around points, one below the other, all of the same odd size.

    Attributes
    ----------
    grey : ndarray of float32, shape (n * side, side)
        NaN where nothing is seen.
    side : int
    scale : ndarray, shape (n,)
        Pixels of the picture they come from, along one pixel of the patches; NaN if not seen.
    nodes : ndarray, shape (n, k, k, 2)
        Places in that picture of every `STEP`-th pixel; none of a picture's own patches.
    """

    grey: Array
    side: int
    scale: Array
    nodes: Array = field(default_factory=lambda: np.zeros((0, 1, 1, 2)))

    @property
    def middles(self) -> Index:
        """Return col, row of the patches' middles in the stack, shape (n, 2)."""
        n, half = len(self.scale), self.side // 2
        return np.column_stack([np.full(n, half), np.arange(n) * self.side + half])

    def places(self, which: Index, from_middle: Array) -> Array:
        """Return the places in the other picture of points of laid patches, shape (n, 2).

        By the same nodes as the grey values: on a rough ground, the way by the ground differs.

        Parameters
        ----------
        which : ndarray, shape (n,)
            Numbers of their patches.
        from_middle : ndarray, shape (n, 2)
            Distances of the points from the middles, px.
        """
        at = np.column_stack([which, (from_middle[:, ::-1] + self.side // 2) / STEP]).T
        both = [map_coordinates(self.nodes[..., k], at, order=1, mode="nearest") for k in (0, 1)]
        return np.column_stack(both)


def own_patches(view: View, at: Index, side: int) -> Patches:
    """Return a picture's own patches around pixels, shape (n, 2), as they are."""
    image, offset = pixels_of_view(view), np.arange(side) - side // 2
    rows, cols = (at[:, k, None] + offset for k in (1, 0))
    is_row, is_col = ((i >= 0) & (i < n) for i, n in zip((rows, cols), image.shape, strict=False))
    rows, cols = (np.clip(i, 0, n - 1) for i, n in zip((rows, cols), image.shape, strict=False))
    patches = image[rows[:, :, None], cols[:, None, :]]
    out = grey(np.ascontiguousarray(patches.reshape(-1, side, image.shape[2])))
    out[~(is_row[:, :, None] & is_col[:, None, :]).reshape(-1, side)] = np.nan
    return Patches(grey=out, side=side, scale=np.ones(len(at)))


def laid_patches(a: View, b: View, surface: Surface, at: Index, side: int) -> Patches:
    """Return patches of picture b that cover the ground of patches around pixels of picture a."""
    image, k = pixels_of_view(b), (side - 1) // STEP + 1
    offset = np.stack(np.meshgrid(*[np.arange(k) * STEP - side // 2] * 2), axis=-1)
    nodes = transferred(a, b, surface, (at[:, None, None] + offset).reshape(-1, 2).astype(float))
    nodes = nodes.reshape(len(at), k, k, 2)
    scale = _scales(nodes, side)
    out = np.full((len(at), side, side), np.nan, np.float32)
    for i in np.flatnonzero(np.isfinite(nodes).all(axis=(1, 2, 3))):
        _lay(image, nodes[i], float(scale[i]), out[i])
    return Patches(grey=out.reshape(-1, side), side=side, scale=scale, nodes=nodes)


def _scales(nodes: Array, side: int) -> Array:
    """Return the square root of a map's change of area for every patch, (n,)."""
    across, down = nodes[:, -1, -1] - nodes[:, 0, 0], nodes[:, -1, 0] - nodes[:, 0, -1]
    area = np.abs(across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0]) / 2
    return np.sqrt(area) / (side - 1)


def _lay(image: np.ndarray, nodes: Array, scale: float, out: Array) -> None:
    """Fill in a patch by spline interpolation in an image."""
    rim = REACH + 2
    size = np.array(image.shape[1::-1])
    flat = nodes.reshape(-1, 2)
    first = np.clip(np.floor(flat.min(axis=0)) - rim, 0, size).astype(np.intp)
    last = np.clip(np.ceil(flat.max(axis=0)) + rim, 0, size).astype(np.intp)
    if np.any(last - first < REACH):
        return
    part = grey(np.ascontiguousarray(image[first[1] : last[1], first[0] : last[0]]))
    if scale > FINER:
        part[:] = cv2.GaussianBlur(part, (0, 0), 0.5 * np.sqrt(scale**2 - 1))
    resample(part, nodes, STEP, first, out)


# --- Pairs, here or in other processes


Both = tuple[Found, Found]
Count = Callable[[int, int], None]
Job = TypeVar("Job")
Value = TypeVar("Value")


def each(
    function: Callable[[Job], Value], jobs: Sequence[Job], executor: Executor | None, tell: Count
) -> list[Value]:
    """Return a function's values of all jobs, computed here or by an executor.

    Parameters
    ----------
    function : callable
    jobs : sequence
    executor : Executor or None
    tell : callable
        Called with the number of finished jobs and of all.
    """
    out: list[Value] = []
    for value in (executor.map if executor else map)(function, jobs):
        out.append(value)
        tell(len(out), len(jobs))
    return out


def match_pair(job: PairJob) -> Both:
    """Return the corners of the first picture found in the second, and the reverse."""
    forth = found_in(job.a, job.b, job.surface, job.at_a, job.options)
    back = found_in(job.b, job.a, job.surface, job.at_b, job.options)
    colrow_a = np.concatenate([job.at_a[forth.which], back.colrow])
    colrow_b = np.concatenate([forth.colrow, job.at_b[back.which]])
    near = agree(job.a, job.b, colrow_a, colrow_b, least_px=job.options.epipolar_px)
    return forth[near[: len(forth)]], back[near[len(forth) :]]
