"""Points of many rays: a corner of one picture with its places in all others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import brentq

from acx4files.measuring.pairs import Found
from acx4files.measuring.views import Surface, View, seen_at, through
from acx4lib import expected
from acx4lib.block import NO_POINTS, Block, ImagePoints
from acx4lib.bundle.adjust import Bundle, mounted_orientation
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.calibration.common_errors import freely_turned
from acx4lib.errors import AdjustmentError
from acx4lib.expected import NOT_GIVEN, Array, Index, Mask
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.parameters import Prior
from acx4lib.least_squares.reduced_system import held_at_zero
from acx4lib.model import Model

WANTED = 3
"""Rays of a point, wherever the block has as many pictures of its place."""

Pairs = Mapping[tuple[int, int], tuple[Found, Found]]
"""For views i < j, the corners of i found in j, and those of j found in i."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TieRays:
    """Measurements of tie points; those of one point share a number.

    Attributes
    ----------
    point, view : ndarray, shape (n,)
    colrow : ndarray, shape (n, 2)
        Pixels of the pictures as matched.
    sigma_px : ndarray, shape (n,)
    of_head : ndarray of bool, shape (n,)
        Whether the camera is that of the point's corner, as all are by default.
    """

    point: Index
    view: Index
    colrow: Array
    sigma_px: Array
    of_head: Mask = NOT_GIVEN

    def __post_init__(self) -> None:
        expected.default(self, "of_head", lambda: np.ones(len(self.point), dtype=bool))

    def __getitem__(self, keep: Index | Mask) -> TieRays:
        """Select measurements."""
        return expected.part_of(self, keep)

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.point)


def joined(corners: Sequence[Index], pairs: Pairs, camera: Index) -> TieRays:
    """Return one point for every corner with a match in any other picture, with all its rays.

    The corner itself is a ray of the point. Of the variance of a difference, one half belongs to
    either picture.

    Parameters
    ----------
    corners : sequence of ndarray, shape (n, 2)
        Of every view.
    pairs : mapping
    camera : ndarray, shape (n_views,)
    """
    first = np.cumsum([0, *(len(colrow_of_view) for colrow_of_view in corners)])
    parts = [
        (first[master] + found.which, np.full(len(found), view), found.colrow, found.sigma_px)
        for (i, j), both in pairs.items()
        for master, view, found in ((i, j, both[0]), (j, i, both[1]))
    ]
    point, view, colrow, sigma = (np.concatenate(part) for part in zip(*parts, strict=True))
    corner, inverse, count = np.unique(point, return_inverse=True, return_counts=True)
    mean_square = np.bincount(inverse, sigma[:, 0] ** 2) / count
    master = np.searchsorted(first, corner, side="right") - 1
    master_colrow = np.concatenate([np.zeros((0, 2), np.intp), *corners])[corner].astype(float)
    every = TieRays(
        point=np.concatenate([corner, point]),
        view=np.concatenate([master, view]),
        colrow=np.concatenate([master_colrow, colrow]),
        sigma_px=np.sqrt(np.concatenate([mean_square, sigma[:, 1] ** 2]) / 2),
        of_head=np.concatenate([corner >= 0, camera[view] == camera[master[inverse]]]),
    )
    return every[np.lexsort((every.view, every.point))]


def chosen(rays: TieRays, shown: Index, *, apart_px: float) -> TieRays:
    """Return points of enough rays that do not measure the same texture twice.

    Of points closer to each other in a picture than `apart_px`, the one with the most rays stays:
    two on the same texture share its noise, and would count as two. Only pictures of the camera in
    which a point is a corner count, so that every head has its points.

    Parameters
    ----------
    rays : TieRays
        Ordered by point.
    shown : ndarray, shape (n,)
        For every ray, the number of pictures that show its point's place.
    apart_px : float
        Least distance of two points in a picture, px.
    """
    point, start, count = np.unique(rays.point, return_index=True, return_counts=True)
    enough = count >= np.minimum(np.maximum(shown[start], 2), WANTED)
    worst = np.maximum.reduceat(rays.sigma_px, start) if len(point) else np.zeros(0)
    taken: set[tuple[int, int, int]] = set()
    keep = np.zeros(len(rays), dtype=bool)
    for i in np.lexsort((worst, -count)).tolist():
        rays_of_point = slice(start[i], start[i] + count[i])
        cell = np.floor(rays.colrow[rays_of_point] / apart_px).astype(int)
        measured = zip(rays.view[rays_of_point], cell, rays.of_head[rays_of_point], strict=True)
        places = [(int(v), int(c), int(r)) for v, (c, r), of_head in measured if of_head]
        if enough[i] and not any(_near(place, taken) for place in places):
            taken.update(places)
            keep[rays_of_point] = True
    return rays[keep]


def _near(place: tuple[int, int, int], taken: set[tuple[int, int, int]]) -> bool:
    """Tell whether a cell or one of its neighbours in a picture is taken."""
    view, col, row = place
    return any((view, col + i, row + j) in taken for i in (-1, 0, 1) for j in (-1, 0, 1))


# --- Orientations and ground refined by the points found so far: the library's bundle


LOOSE_POSITION, LOOSE_ATTITUDE = 0.005, float(np.radians(1.0))
"""Standard deviations of positions, in flying heights, and of attitudes as approximate values."""

FIRM_POSITION_M, FIRM_ATTITUDE = 0.2, float(np.radians(0.02))
"""Least standard deviations of a trajectory that holds the block in place: room for a lever arm
that is not declared, and for delays."""

LEVER_M = 1.0
"""Standard deviation of a lever arm as an approximate value."""

FREE = ((8, ("f", "xp", "yp", "k1", "k2", "p1", "p2")), (3, ("k1", "k2")), (0, ()))
"""Interior parameters that may be estimated, and the number of pictures that a head needs."""

DETERMINED = 0.005
"""Largest standard deviation of an estimated lens at the corners of its pictures, as a share of
their distance from the middle. A strip over flat ground cannot tell a focal length from a height,
nor two-fold overlap a lens from the ground: an adjustment would wander off along what is open."""

SMALLEST_ANGLE = np.radians(0.5)

CRITICAL = 3.29
"""Of a normal variable, exceeded by 0.1 %: tie points are many, and matches have more large errors
than normal ones."""

LEAST_SIGMA_PX = 0.05
"""Least sigma, px of the matching: errors of a smooth ground and of a first orientation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Oriented:
    """Orientations and ground by an adjustment of the tie points.

    Attributes
    ----------
    views : tuple of View
    surface : Surface
    kept : ndarray of bool, shape (n_rays,)
        Rays that were not rejected.
    bundle : Bundle
    shared_px : ndarray, shape (n_cameras, 2)
        Standard deviation of what all pixels of a window share, px of the matching: in pictures of
        a camera where the corner is another head's, and where it is its own.
    """

    views: tuple[View, ...]
    surface: Surface
    kept: Mask
    bundle: Bundle
    shared_px: Array

    def with_shared(self, rays: TieRays) -> TieRays:
        """Return rays with the standard deviations of windows as a whole."""
        camera = self.bundle.network.block.images.camera_idx[rays.view]
        shared = self.shared_px[camera, rays.of_head.astype(np.intp)]
        return replace(rays, sigma_px=np.hypot(rays.sigma_px, shared))


def refined(block: Block, views: Sequence[View], rays: TieRays) -> Oriented:
    """Adjust the rays of points, reject gross errors, and refine orientations and ground.

    Nothing of this reaches the measured flight but which rays are kept.

    Parameters
    ----------
    block : Block
        With one image for each view, in their order, and a trajectory as `approximate` or `firm`
        make it.
    views : sequence of View
    rays : TieRays

    Raises
    ------
    AdjustmentError
        Where no choice of interior parameters can be adjusted.
    """
    bundle = _adjusted(_with_rays(block, views, rays))
    gone = [rejection.row for rejection in bundle.rejected if rejection.kind == "image_point"]
    kept = np.ones(len(rays), dtype=bool)
    kept[gone] = False
    T_m_c, cameras = bundle.T_m_c, bundle.cameras
    moved = [
        seen_at(
            replace(
                view,
                camera=view.camera.with_interior(cameras[block.images.camera_idx[i]].interior),
                T_m_c=T_m_c[i : i + 1],
            ),
            view.shrink,
        )
        for i, view in enumerate(views)
    ]
    x_m = bundle.state.x_m[np.isfinite(bundle.state.x_m[:, 0])]
    return Oriented(
        views=tuple(moved),
        surface=through(x_m),
        kept=kept,
        bundle=bundle,
        shared_px=_shared(bundle, rays),
    )


def _shared(bundle: Bundle, rays: TieRays) -> Array:
    """Return by how much windows as a whole are off, px of the matching, (n_cameras, 2).

    The noise of pixels tells how well a window is located in another picture. What its pixels have
    in common, such as relief, branches, and what the lens leaves, shows only where windows of many
    pictures meet in points: as scatter beyond that noise, here as a variance for every camera, and
    another for its windows of other heads' corners, which see other colours. What a picture has in
    common is no noise of windows: where exposures have several, each turns by itself.
    """
    images, n_groups = bundle.network.block.images, 2 * len(bundle.network.block.cameras)
    group_of = 2 * images.camera_idx[rays.view] + rays.of_head
    shared_px = np.full(n_groups, LEAST_SIGMA_PX)
    turned, of_rig = bundle, len(images) > len(np.unique(images.exposure_idx))
    for _ in range(_ROUNDS if of_rig else 1):
        sigma_px = np.hypot(rays.sigma_px, shared_px[group_of])
        if of_rig:
            factor = sigma_px / np.hypot(rays.sigma_px, LEAST_SIGMA_PX)
            turned = freely_turned(
                _times(bundle, factor), partial(mounted_orientation, model=Model())
            )
        rows, group = turned.network.rows, turned.solution.groups[0]
        v_sq = np.square(group.v / group.sigma) * sigma_px[rows, None] ** 2
        for k in range(n_groups):
            own = group_of[rows] == k
            redundancy = float(np.nansum(group.redundancy[own]))  # none of a point far away
            shared_px[k] = _beyond(v_sq[own], rays.sigma_px[rows][own], redundancy)
    return shared_px.reshape(-1, 2)


def _times(bundle: Bundle, factor: Array) -> Bundle:
    """Return a bundle with the sigma of its block's rays multiplied by factors."""
    network, points = bundle.network, bundle.network.block.image_points
    weighted = replace(points, sigma_px=factor * points.sigma_px)
    return replace(
        bundle, network=replace(network, block=replace(network.block, image_points=weighted))
    )


def _beyond(v_sq: Array, sigma_px: Array, redundancy: float) -> float:
    """Return the standard deviation that explains squared residuals beyond their noise, px."""

    def excess(shared: float) -> float:
        return float(np.nansum(v_sq / (sigma_px**2 + shared**2)[:, None])) - redundancy

    if excess(0.0) <= 0 or excess(_MOST_SHARED_PX) >= 0:
        return 0.0 if excess(0.0) <= 0 else _MOST_SHARED_PX
    return float(brentq(excess, 0.0, _MOST_SHARED_PX, xtol=1e-9))


_MOST_SHARED_PX, _ROUNDS = 2.0, 3


def _adjusted(block: Block) -> Bundle:
    """Return the adjustment with the most interior parameters that the pictures determine."""
    measured = np.bincount(block.image_points.image_idx, minlength=len(block.images)) > 0
    n_pictures = np.bincount(block.images.camera_idx[measured])
    failed = AdjustmentError("no picture has measurements")
    for least, free in FREE:
        if min(n_pictures[n_pictures > 0], default=0) < least:
            continue
        try:
            set_up = partial(mounted_orientation, model=Model(free=free))
            bundle = adjust_rejecting(block, set_up, critical=CRITICAL, sigma0="estimated")
        except AdjustmentError as error:
            failed = error
        else:
            if all(
                _at_corners(bundle, k) < DETERMINED for k in np.flatnonzero(n_pictures).tolist()
            ):
                return bundle
    raise failed


def _at_corners(bundle: Bundle, k: int) -> float:
    """Return the standard deviation of camera k's lens at its corners, as a share of the radius."""
    camera, columns = bundle.cameras[k], bundle.network.layout.interior[k]
    if np.any(bundle.solution.undetermined[columns[columns >= 0]]):
        return np.inf
    r = camera.diagonal_px * camera.pixel_mm / 2
    by_name = {"f": 1 / camera.interior.f, "k1": r**2, "k2": r**4}
    J = np.array([by_name.get(name, 0.0) for name in INTERIOR])
    cov = held_at_zero(bundle.solution.inverse, columns[:, None], columns[None, :])
    return float(np.sqrt(max(bundle.solution.sigma0_sq * (J @ cov @ J), 0.0)))


def _with_rays(block: Block, views: Sequence[View], rays: TieRays) -> Block:
    """Return the block with these rays alone, and with the uncertainty of its mounting."""
    number, idx = np.unique(rays.point, return_inverse=True)
    full, sigma = np.zeros((len(rays), 2)), np.zeros(len(rays))
    for k, view in enumerate(views):
        in_view = rays.view == k
        full[in_view] = view.full(rays.colrow[in_view])
        sigma[in_view] = view.shrink * np.hypot(rays.sigma_px[in_view], LEAST_SIGMA_PX)
    return replace(
        block,
        cameras=tuple(
            replace(camera, prior=Prior(declared=(True,) * 6, sigma=_SIGMA))
            for camera in block.cameras
        ),
        points=tuple(map(str, number)),
        image_points=ImagePoints(image_idx=rays.view, point_idx=idx, colrow=full, sigma_px=sigma),
        control=NO_POINTS,
        check=NO_POINTS,
        smallest_angle=SMALLEST_ANGLE,
    )


_UNKNOWN_M, _UNKNOWN = 100.0, 0.2  # what a flight states as not known is still near
_SIGMA = (LEVER_M,) * 3 + (LOOSE_ATTITUDE,) * 3


def approximate(block: Block, flying_height: float) -> Block:
    """Return a block whose trajectory has the standard deviations of approximate values.

    So neither a wrong boresight nor a wrong lever arm is taken for errors of measurements.

    Parameters
    ----------
    block : Block
    flying_height : float
        Above ground, m.
    """
    return _with_sigma(block, LOOSE_POSITION * flying_height, LOOSE_ATTITUDE)


def firm(block: Block) -> Block:
    """Return a block held by its trajectory, whose standard deviations get a minimum."""
    return _with_sigma(block, FIRM_POSITION_M, FIRM_ATTITUDE)


def _with_sigma(block: Block, position_m: float, attitude: float) -> Block:
    declared = block.trajectory
    position = np.maximum(declared.sigma_position, position_m)
    attitudes = np.maximum(declared.sigma_attitude, attitude)
    trajectory = replace(
        declared,
        sigma_position=np.where(np.isfinite(position), position, _UNKNOWN_M),
        sigma_attitude=np.where(np.isfinite(attitudes), attitudes, _UNKNOWN),
    )
    return replace(block, trajectory=trajectory)
