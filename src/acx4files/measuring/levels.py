"""A block of pictures matched from small to large: each level refines what the next begins with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, product

import numpy as np

from acx4files.measuring.oriented import TieRays, approximate, chosen, joined, refined
from acx4files.measuring.pairs import MatchOptions, PairJob, each, match_pair
from acx4files.measuring.views import Surface, View, ground_of, pixels_of, pixels_of_view, seen_at
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import inside
from acx4lib.tie_points.matching import grey, response

# --- Corners that cover a picture evenly (Harris), one in each of its cells


def corners(view: View, *, number: int, margin: int) -> Index:
    """Return the best corner of every cell of a picture, col, row, shape (n, 2).

    Parameters
    ----------
    view : View
    number : int
        Approximate number of cells.
    margin : int
        Distance from the picture's border, px.
    """
    image = pixels_of_view(view)
    rows, cols = image.shape[:2]
    side = np.sqrt(rows * cols / number)
    across, down = max(round(cols / side), 1), max(round(rows / side), 1)
    edges_x = np.linspace(margin, cols - margin, across + 1).astype(int)
    edges_y = np.linspace(margin, rows - margin, down + 1).astype(int)
    strongest = []
    for (top, bottom), (left, right) in product(pairwise(edges_y), pairwise(edges_x)):
        if bottom > top and right > left:
            values = response(grey(np.ascontiguousarray(image[top:bottom, left:right])))
            row, col = np.unravel_index(int(np.argmax(values)), values.shape)
            if values[row, col] > 0:
                strongest.append((left + col, top + row))
    return np.array(strongest, dtype=np.intp).reshape(-1, 2)


# --- Which pictures show the same ground, by their approximate orientations


GRID = 9
"""Points along each side of a picture, by which the shared part is counted."""

LEAST_SHARE = 0.08
"""Share of the one or the other picture that both must show."""

LARGEST_SCALE = 3.0
"""Ratio of ground pixels above which pictures are not compared."""

STEEPEST = 1.1
"""Ratio of base to height above which the same ground looks too different."""


def overlapping(views: Sequence[View], surface: Surface) -> list[tuple[int, int]]:
    """Return the pairs of views that show enough of the same ground, i < j."""
    grounds = np.array([ground_of(view, surface, _grid(view)) for view in views])
    r = np.array([view.T_m_c.r[0] for view in views])
    away = np.nanmedian(np.linalg.norm(grounds - r[:, None], axis=2), axis=1)
    sizes = away * [view.declared.pixel_mm / view.declared.interior.f for view in views]
    seen = [inside(view.camera, pixels_of(view, grounds.reshape(-1, 3))) for view in views]
    share = np.array(seen).reshape(len(views), len(views), -1).mean(axis=2)
    both = np.maximum(share, share.T) >= LEAST_SHARE
    ratio = sizes[:, None] / sizes
    both &= np.maximum(ratio, ratio.T) <= LARGEST_SCALE
    base = np.hypot(*(r[:, None, :2] - r[None, :, :2]).transpose(2, 0, 1))
    high = r[:, 2] - float(np.mean(surface.z))
    both &= base <= STEEPEST * np.minimum(high[:, None], high)
    return [(int(i), int(j)) for i, j in np.argwhere(np.triu(both, 1))]


def _grid(view: View) -> Array:
    cols, rows = view.camera.width_px, view.camera.height_px
    x, y = np.meshgrid(np.linspace(0, cols - 1, GRID), np.linspace(0, rows - 1, GRID))
    return np.column_stack([x.ravel(), y.ravel()])


# --- The levels


COARSE_PX = 760
"""Longer side of the pictures at the first level, at most."""

SEARCH_PX, EPIPOLAR_PX = 14, 1.0
"""Of the first level, where orientations and ground are not known well."""

FAINT = MatchOptions(correlation_px=21, least_correlation=0.4, largest_sigma_px=0.35)
"""Where features gave the orientations: of photographs, in which lawns and woods correlate less."""

POINTS = 200
"""Cells of a picture, each of which gives one corner at most. With as many, principal points gain
most for the time; focal length and boresight are bounded by the trajectory from 100 on."""

ONE_WAY = float(np.cos(np.radians(5.0)))
"""Cosine of the angle below which two heads look one way."""

STEP_DOWN = 4
"""Largest ratio of the sizes of two levels that follow each other."""

APART = 1 / 4
"""Least distance of points, in windows."""

_LEAST_RAYS = 12
_CURE = "are trajectory, mount_*_deg and --ground right, and are the files those of these images?"

Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, kw_only=True)
class MeasureOptions:
    """How a flight is measured.

    Attributes
    ----------
    points : int
        Cells of a picture, each of which gives at most one corner.
    reduce : int
        Pictures are measured at 1/reduce of their size; for poor ones.
    ground_m : float or None
        Height of the mean ground, as the flight gives heights.
    """

    points: int = POINTS
    reduce: int = 1
    ground_m: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Matched:
    """A block after a level.

    Attributes
    ----------
    views : tuple of View
        With their refined orientations.
    surface : Surface
    rays : TieRays
        Of tie points, with the sigma of windows as a whole; gross errors are left out.
    n_rejected : int
        Rays that the adjustment rejected.
    reduced : int
        K, if pictures were matched at 1/K of their files' size.
    """

    views: tuple[View, ...]
    surface: Surface
    rays: TieRays
    n_rejected: int
    reduced: int

    @property
    def weight(self) -> float:
        """Sum of the weights of all rays, px^-2 of full size: the information of the level."""
        shrink = np.array([view.shrink for view in self.views])[self.rays.view]
        return float(np.sum((shrink * self.rays.sigma_px) ** -2.0))


def match_block(
    block: Block,
    views: Sequence[View],
    surface: Surface,
    *,
    options: MeasureOptions,
    executor: Executor | None,
    tell: Tell,
    faint: bool = False,
) -> Matched:
    """Match all overlapping pictures of a block, level by level.

    Pictures that are blurred or strongly compressed may hold less at their full size than at a
    smaller one: there fewer windows match, and with larger sigma. Then the smaller one is the last.

    Parameters
    ----------
    block : Block
        With one image for each view.
    views : sequence of View
        At the size of their files.
    surface : Surface
        Approximate ground.
    options : MeasureOptions
    executor : Executor or None
        Where pairs are matched; by default here.
    tell : callable
        Called with the name of a level, its finished pairs, and all.
    faint : bool
        Whether features gave the orientations.

    Raises
    ------
    FlightError
        Where no pictures overlap, or too few points are found.
    AdjustmentError
        Where the points cannot be adjusted.
    """
    best, of_file = None, views[0].shrink
    match = FAINT if faint else MatchOptions()
    wide = replace(match, search_px=SEARCH_PX, epipolar_px=EPIPOLAR_PX)
    for shrink in sizes_of(views, options.reduce):
        views = [seen_at(view, k) for view, k in zip(views, shrink, strict=True)]
        count = partial(tell, f"{block.name} 1/{max(shrink)}")
        try:
            how = match if best else wide
            rays = _matched(block, views, surface, options.points, how, executor, count)
        except FlightError:
            if best is None:
                raise
            break
        oriented = refined(approximate(block, height(views, surface)), views, rays)
        views, surface = oriented.views, oriented.surface
        level = Matched(
            views=oriented.views,
            surface=oriented.surface,
            rays=_whole_points(oriented.with_shared(rays)[oriented.kept]),
            n_rejected=int(np.sum(~oriented.kept)),
            reduced=shrink[0] // of_file,
        )
        if best is not None and level.weight < best.weight:
            break
        best = level
    assert best is not None  # there is always a first level
    return best


def is_within_search(block: Block, views: Sequence[View], surface: Surface, reduce: int) -> bool:
    """Tell whether the trajectory's sigma moves pictures by less than the first level searches.

    Parameters
    ----------
    block : Block
        With one image for each view.
    views : sequence of View
        At the size of their files.
    surface : Surface
        Approximate ground.
    reduce : int
        As in `MeasureOptions`.
    """
    exposures = block.images.exposure_idx
    position = block.trajectory.sigma_position[exposures].max(axis=1)
    attitude = block.trajectory.sigma_attitude[exposures].max(axis=1)
    across = np.hypot(position / height(views, surface), attitude)
    f_px = np.array([v.declared.interior.f / v.declared.pixel_mm for v in views])
    apart = np.sqrt(2) * across * f_px / sizes_of(views, reduce)[0]  # of one against another
    return not np.any(np.isfinite(apart) & (apart > SEARCH_PX))


def sizes_of(views: Sequence[View], reduce: int) -> list[list[int]]:
    """Return the reduction of every picture at every level, from small to large."""
    last = [view.shrink * reduce for view in views]
    sides = [max(view.declared.width_px, view.declared.height_px) for view in views]
    ratio = max(max(side / k for side, k in zip(sides, last, strict=True)) / COARSE_PX, 1.0)
    n = 1 + int(np.ceil(np.log(ratio) / np.log(STEP_DOWN)))
    factors = [int(np.ceil(ratio ** ((n - 1 - i) / max(n - 1, 1)))) for i in range(n)]
    return [[k * factor for k in last] for factor in factors]


def height(views: Sequence[View], surface: Surface) -> float:
    """Return the flying height above ground, m."""
    z = np.median([view.T_m_c.r[0, 2] for view in views])
    return max(float(z - np.mean(surface.z)), 1.0)


def _matched(
    block: Block,
    views: Sequence[View],
    surface: Surface,
    n_points: int,
    options: MatchOptions,
    executor: Executor | None,
    count: Callable[[int, int], None],
) -> TieRays:
    """Return the points of one level."""
    camera = block.images.camera_idx
    pairs = [p for p in overlapping(views, surface) if _worth_it(block, *p)]
    if not pairs:
        raise FlightError([f"block {block.name}: no two pictures show the same ground; {_CURE}"])
    margin = options.window_px // 2 + 3
    pixels = [corners(view, number=n_points, margin=margin) for view in views]
    jobs = [
        PairJob(
            a=views[i], b=views[j], surface=surface, at_a=pixels[i], at_b=pixels[j], options=options
        )
        for i, j in pairs
    ]
    matches = dict(zip(pairs, each(match_pair, jobs, executor, count), strict=True))
    rays = joined(pixels, matches, camera)
    shown = _shown(views, surface, pixels, pairs)
    rays = chosen(rays, shown[rays.point], apart_px=options.window_px * APART)
    if len(rays) < _LEAST_RAYS * len(views):
        says = f"block {block.name}: only {len(rays)} measurements in {len(views)} pictures"
        raise FlightError([f"{says}; {_CURE}"])
    return rays


def _worth_it(block: Block, i: int, j: int) -> bool:
    """Tell whether pictures are of the same head or exposure, or of heads that look apart.

    Heads with one view show the same ground at an exposure; pairs of one exposure tie them.
    """
    images = block.images
    same = (
        images.camera_idx[i] == images.camera_idx[j]
        or images.exposure_idx[i] == images.exposure_idx[j]
    )
    look = [block.cameras[images.camera_idx[k]].T_b_c.R[:, 2] for k in (i, j)]
    return bool(same or look[0] @ look[1] < ONE_WAY)


def _shown(
    views: Sequence[View],
    surface: Surface,
    pixels: Sequence[Index],
    pairs: Sequence[tuple[int, int]],
) -> Index:
    """Return for every corner how many pictures show its place, its own among them."""
    out = []
    for i, (view, colrow) in enumerate(zip(views, pixels, strict=True)):
        x_m = ground_of(view, surface, colrow.astype(float))
        n = np.ones(len(colrow), dtype=np.intp)
        for other in (views[a + b - i] for a, b in pairs if i in (a, b)):
            n += inside(other.camera, pixels_of(other, x_m))
        out.append(n)
    return np.concatenate(out)


def _whole_points(rays: TieRays) -> TieRays:
    """Return the rays of points that still have two."""
    _, inverse, count = np.unique(rays.point, return_inverse=True, return_counts=True)
    return rays[count[inverse] >= 2]
