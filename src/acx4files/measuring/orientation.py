"""Approximate orientations that need no prediction: features, pairs of views, and all together.

Features are found again in turned, scaled and brighter pictures; contrast is equalised locally
before, so that dark woods have some beside bright roofs. What attitudes of a trajectory are off by
is told by strip and by heading.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import coo_array, eye_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from acx4files.measuring.oriented import (
    LOOSE_ATTITUDE,
    WANTED,
    TieRays,
    approximate,
    chosen,
    refined,
)
from acx4files.measuring.pairs import Count, each
from acx4files.measuring.views import Surface, View, pixels_of_view, seen_at, through
from acx4lib.block import Block, select_images
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import correct, mountings, xy_from_colrow
from acx4lib.geometry.frames import Pose, exp, log, transform
from acx4lib.geometry.intersection import R_C_CV
from acx4lib.tie_points.matching import grey

MOST = 2500
"""Features of a picture, the strongest ones."""

LARGEST_RATIO = 0.85
"""Of the distances to the most and to the second most similar feature."""

NEAR_PX = 1.5
"""Distance from the epipolar line below which a pair of features agrees with the others."""

LEAST = 20
"""Pairs of features that must agree on how two pictures lie to each other."""

_CLIP, _TILES, _CONTRAST = 4.0, (8, 8), 0.01
_LENGTH = 512.0  # of descriptors, which are whole numbers, so that their products are exact
_PROBABILITY, _TRIALS = 0.9999, 3000
_PLANE, _SHRINKING = 5.0, (3.0, 2.0, 1.0, 1.0)  # distances, in `NEAR_PX`
_RELIEF = 1.5  # ratio of distances to the ground in a pair of pictures, either way
_LEAST_START, _CALLS = 8, 100
_STEEP, _SHORT = 0.5, 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class _Features:
    """The features of a picture.

    Attributes
    ----------
    colrow : ndarray, shape (n, 2)
    ideal : ndarray, shape (n, 2)
        Corrected for the lens, over the focal length, in OpenCV's camera axes.
    descriptor : ndarray of float32, shape (n, 128)
        Whole numbers.
    near : float
        `NEAR_PX` over the focal length.
    """

    colrow: Array
    ideal: Array
    descriptor: Array
    near: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _TwoViews:
    """The relative orientation of two pictures, from their features.

    Attributes
    ----------
    which : ndarray, shape (n, 2)
        Numbers of the features in either picture.
    R_a_b : ndarray, shape (3, 3)
        Axes of the second camera to those of the first.
    base_a : ndarray, shape (3,)
        Unit vector from the first to the second, axes of the first.
    depth : float
        Median distance of the points along the first camera's axis, in bases.
    """

    which: Index
    R_a_b: Array
    base_a: Array
    depth: float


def _features_of(view: View) -> _Features:
    """Return the features of a picture (SIFT [1]_, descriptors by Hellinger's distance [2]_)."""
    even = cv2.createCLAHE(clipLimit=_CLIP, tileGridSize=_TILES).apply(_eight_bit(view))
    sift = cv2.SIFT.create(nfeatures=MOST, contrastThreshold=_CONTRAST)
    points, descriptors = sift.detectAndCompute(even, None)
    colrow = np.array([point.pt for point in points], dtype=float).reshape(-1, 2)
    if descriptors is None:
        descriptors = np.zeros((0, 128))
    total = np.maximum(descriptors.sum(axis=1, keepdims=True), 1)
    descriptor = np.rint(_LENGTH * np.sqrt(descriptors / total))
    camera = view.camera
    ideal = correct(camera.interior, xy_from_colrow(camera, colrow)) / camera.interior.f
    return _Features(
        colrow=colrow,
        ideal=ideal * np.diag(R_C_CV)[:2],
        descriptor=descriptor.astype(np.float32),
        near=NEAR_PX * camera.pixel_mm / camera.interior.f,
    )


def _eight_bit(view: View) -> np.ndarray:
    """Return the grey values of a picture from its darkest to its brightest ones, 8 bit."""
    values = grey(np.ascontiguousarray(pixels_of_view(view)))
    low, high = np.percentile(values, (0.5, 99.5))
    bright = (values - low) * (255 / max(float(high - low), 1e-6))
    return np.asarray(np.clip(bright, 0, 255).astype(np.uint8))


def _two_views(pair: tuple[_Features, _Features, Array, float]) -> _TwoViews | None:
    """Return the relative orientation of two pictures; None where too few features agree.

    Beside their features are given the direction of down in the first, and how much the second is
    lower, in bases: of several orientations that fit, flat ground has two, these exclude some.
    """
    a, b, down, fall = pair
    i, j = _similar(a, b)
    if len(i) < LEAST:
        return None
    within = max(a.near, b.near)
    rays = _rays(a.ideal[i]), _rays(b.ideal[j])
    starts = [
        *_over_a_plane(a.ideal[i], b.ideal[j], within, down),
        *_over_any_ground(a.ideal[i], b.ideal[j], within),
    ]
    grown = [_grown(*start, *rays, within) for start in starts]
    plausible = [two for two in grown if abs(float(two.base_a @ down) - fall) < _STEEP]
    best = max(plausible, key=lambda two: len(two.which), default=None)
    if best is None or len(best.which) < LEAST:
        return None
    return replace(best, which=np.column_stack([i, j])[best.which])


def _over_a_plane(
    a: Array, b: Array, within: float, down: Array
) -> Iterator[tuple[Array, Array, Mask]]:
    """Yield rotation and base by a homography (its more level plane), and the inliers."""
    H, near = cv2.findHomography(a, b, cv2.USAC_MAGSAC, _PLANE * within)
    if H is None or near.sum() < _LEAST_START:
        return
    _, R, t, normal = cv2.decomposeHomographyMat(H, np.eye(3))
    level = [float(n[:, 0] @ R_C_CV @ down) for n in normal]
    best = int(np.argmax(level))
    yield *_in_own_axes(R[best], t[best]), near[:, 0] > 0


def _over_any_ground(a: Array, b: Array, within: float) -> Iterator[tuple[Array, Array, Mask]]:
    """Yield rotation and base by an essential matrix, and its inliers."""
    E, near = cv2.findEssentialMat(
        *(a, b, np.eye(3), cv2.USAC_MAGSAC, _PROBABILITY, within, _TRIALS)
    )
    if E is None or E.shape != (3, 3) or near.sum() < _LEAST_START:
        return
    inliers = near[:, 0] > 0
    _, R, t, _ = cv2.recoverPose(E, a[inliers], b[inliers], np.eye(3))
    yield *_in_own_axes(R, t), inliers


def _in_own_axes(R_b_a: np.ndarray, t_b_a: np.ndarray) -> tuple[Array, Array]:
    """Return R_a_b and the unit base in the library's axes."""
    base = -R_C_CV @ R_b_a.T @ t_b_a[:, 0]
    return R_C_CV @ R_b_a.T @ R_C_CV, base / max(float(np.linalg.norm(base)), _SHORT)


def _grown(
    R_a_b: Array, base_a: Array, near: Mask, ray_a: Array, ray_b: Array, within: float
) -> _TwoViews:
    """Return the orientation refined from a start, over ground of about one height.

    `which` numbers the pairs of rays that agree with it.
    """
    for factor in _SHRINKING:
        if near.sum() >= _LEAST_START:
            R_a_b, base_a = _fitted(R_a_b, base_a, ray_a[near], ray_b[near])
        depth = _depths(R_a_b, base_a, ray_a, ray_b)
        off = np.abs(_across(R_a_b, base_a, ray_a, ray_b)) < factor * within
        ahead = depth[off & (depth > 0)]
        usual = float(np.median(ahead)) if len(ahead) else np.nan
        near = off & (depth > usual / _RELIEF) & (depth < usual * _RELIEF)
    return _TwoViews(which=np.flatnonzero(near), R_a_b=R_a_b, base_a=base_a, depth=usual)


def _rays(ideal: Array) -> Array:
    """Return unit vectors in the library's camera axes, (n, 3)."""
    ray = np.column_stack([ideal, np.ones(len(ideal))]) @ R_C_CV
    return ray / np.linalg.norm(ray, axis=1, keepdims=True)


def _fitted(R_a_b: Array, base_a: Array, ray_a: Array, ray_b: Array) -> tuple[Array, Array]:
    """Return the rotation and base with the least squares of distances from epipolar planes."""
    across = np.linalg.svd(base_a[None])[2][1:]

    def moved(p: Array) -> tuple[Array, Array]:
        base = base_a + p[3:] @ across
        return R_a_b @ exp(p[:3]), base / np.linalg.norm(base)

    def misfit(p: Array) -> Array:
        return _across(*moved(p), ray_a, ray_b)

    return moved(least_squares(misfit, np.zeros(5), method="lm", max_nfev=_CALLS).x)


def _across(R_a_b: Array, base_a: Array, ray_a: Array, ray_b: Array) -> Array:
    """Return the angles of rays with their epipolar planes, radians, (n,)."""
    normal = np.cross(base_a, ray_a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), _SHORT)
    return np.asarray(np.sum(normal * (ray_b @ R_a_b.T), axis=1))


def _depths(R_a_b: Array, base_a: Array, ray_a: Array, ray_b: Array) -> Array:
    """Return distances of points along the first camera's axis, in bases, (n,); NaN if parallel."""
    ray_b = ray_b @ R_a_b.T
    cosine = np.sum(ray_a * ray_b, axis=1)
    sine_sq = 1 - cosine**2
    along = (ray_a @ base_a - cosine * (ray_b @ base_a)) / np.where(sine_sq < 1e-9, np.nan, sine_sq)
    return np.asarray(-ray_a[:, 2] * along)


def _similar(a: _Features, b: _Features) -> tuple[Index, Index]:
    """Return the numbers of features that are mutually the most similar."""
    none = np.zeros(0, np.intp)
    if min(len(a.colrow), len(b.colrow)) < 2:
        return none, none
    alike = a.descriptor @ b.descriptor.T
    best, back = alike.argmax(axis=1), alike.max(axis=0)
    every = np.arange(len(best))
    first = alike[every, best].copy()
    alike[every, best] = -1
    apart, second = (2 * (_LENGTH**2 - np.minimum(x, _LENGTH**2)) for x in (first, alike.max(1)))
    good = np.flatnonzero((back[best] == first) & (apart < LARGEST_RATIO**2 * second))
    return good, best[good]


# --- A block oriented by its pictures alone: coarse, but without a prediction of what they show
#
# Features of pictures near each other give how pairs lie to each other; these give the rotations
# of all, the positions scale and turn the whole, and tracks of features adjusted by the bundle
# make it good to a pixel. Attitudes of the trajectory say where down is, to some degrees.


SIDE_PX = 1400
"""Longer side of the pictures in which features are looked for, at most."""

NEIGHBOURS = 8
"""Exposures near each one whose pictures are compared with its own."""

LARGEST_TURN = np.radians(6.0)
"""Largest angle between the rotation of a pair of pictures and that by the rotations of all."""

POSITION, TURN, SIGMA_PX = 0.03, np.radians(5.0), 0.5
"""Least standard deviation of positions, in distances to the ground; that of all attitudes
together, whose errors, of a mount or a magnetometer, are common to them; that of features, px."""

APART = 0.015
"""Least distance of features that are adjusted, in longer sides of a picture."""

_ROUNDS, _NEAR = 30, np.radians(0.5)
_ENOUGH = 0.2  # of the points have three rays

Links = Mapping[tuple[int, int], _TwoViews]
"""Numbers of two views, and their relative orientation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Coarse:
    """A block oriented by its pictures.

    Attributes
    ----------
    block : Block
        The images that are connected, with the poses found as its trajectory.
    views : tuple of View
        Of these, at the size of their files.
    surface : Surface
    apart : tuple of str
        Names of the images that are not connected with them.
    """

    block: Block
    views: tuple[View, ...]
    surface: Surface
    apart: tuple[str, ...]


def oriented_by_features(
    block: Block, views: Sequence[View], *, executor: Executor | None, tell: Count
) -> Coarse:
    """Orient the largest part of a block by features.

    Parameters
    ----------
    block : Block
        With one image for each view.
    views : sequence of View
        At the size of their files; their attitudes may be wrong by ten degrees, their headings by
        any angle if strips are not all parallel.
    executor : Executor or None
    tell : callable
        Called with the finished steps of a camera, and all.

    Raises
    ------
    FlightError
        Where there is one exposure, or no two are connected.
    AdjustmentError
        Where the features cannot be adjusted.
    """
    exposure = block.images.exposure_idx
    if len(np.unique(exposure)) < 2:
        says = f"block {block.name}: all pictures are of one exposure, whose rays meet nowhere"
        raise FlightError([f"{says}; acx4 run turns heads by their pictures alone"])
    small = [seen_at(view, _shrink(view)) for view in views]
    features, found = _connected(block, small, executor, tell)
    if not found:
        says = f"block {block.name}: no two pictures have enough features in common"
        raise FlightError([f"{says}; are the files those of these images, and do they overlap?"])
    part = _parts(block, found)
    largest = part == np.argmax(np.bincount(part))
    distance = {
        (i, j): by.depth * float(np.linalg.norm(views[j].T_m_c.r[0] - views[i].T_m_c.r[0]))
        for (i, j), by in found.items()
        if largest[exposure[i]]
    }
    height = float(np.median([*distance.values()]))  # from the cameras to the ground, m
    links = {pair: found[pair] for pair, z in distance.items() if height / 3 <= z <= 3 * height}
    begun, links = _turned(block, links, largest, height)
    T_m_c = begun.T_m_b_images @ mountings(block.cameras)[block.images.camera_idx]
    kept = np.flatnonzero(largest[exposure]).tolist()
    kept_views = [replace(small[k], T_m_c=T_m_c[k : k + 1]) for k in kept]
    every = _tracks(features, links)
    rays = replace(every, view=np.searchsorted(kept, every.view))
    apart_px = APART * max(small[0].camera.width_px, small[0].camera.height_px)
    rays = chosen(rays, np.full(len(rays), 2), apart_px=apart_px)
    adjusted, moved, surface = _adjusted(
        select_images(begun, largest[exposure]), kept_views, rays, height
    )
    return Coarse(
        block=adjusted,
        views=tuple(seen_at(view, views[k].shrink) for view, k in zip(moved, kept, strict=True)),
        surface=surface,
        apart=tuple(np.array(block.images.names)[~largest[exposure]].tolist()),
    )


def _shrink(view: View) -> int:
    """Return the reduction at which features are looked for."""
    side = max(view.declared.width_px, view.declared.height_px) / view.shrink
    return view.shrink * max(int(np.ceil(side / SIDE_PX)), 1)


def _connected(
    block: Block, views: Sequence[View], executor: Executor | None, tell: Count
) -> tuple[dict[int, _Features], dict[tuple[int, int], _TwoViews]]:
    """Return features and links; further cameras are tried only while several parts are left."""
    camera = block.images.camera_idx
    features: dict[int, _Features] = {}
    links: dict[tuple[int, int], _TwoViews] = {}
    for k in np.argsort(-np.bincount(camera), kind="stable").tolist():
        of_camera = np.flatnonzero(camera == k).tolist()
        own = each(_features_of, [views[i] for i in of_camera], executor, tell)
        features |= dict(zip(of_camera, own, strict=True))
        pairs = _near(views, of_camera)
        jobs = [(features[i], features[j], *_about(views[i], views[j])) for i, j in pairs]
        found = each(_two_views, jobs, executor, tell)
        links |= {pair: by for pair, by in zip(pairs, found, strict=True) if by}
        if len(np.unique(_parts(block, links)[block.images.exposure_idx])) == 1:
            break
    return features, links


def _near(views: Sequence[View], of_camera: Sequence[int]) -> list[tuple[int, int]]:
    """Return the pairs of views in which one is among the nearest neighbours of the other."""
    r = np.array([views[i].T_m_c.r[0] for i in of_camera])
    _, near = cKDTree(r).query(r, k=range(1, min(NEIGHBOURS + 1, len(of_camera)) + 1))
    ends = ((a, b) for a, row in enumerate(np.asarray(near).tolist()) for b in row if a != b)
    return sorted({(of_camera[min(pair)], of_camera[max(pair)]) for pair in ends})


def _about(a: View, b: View) -> tuple[Array, float]:
    """Return the direction of down in a view, and how much another one is lower, in bases."""
    base = b.T_m_c.r[0] - a.T_m_c.r[0]
    down = np.array([0.0, 0.0, -1.0])
    return down @ a.T_m_c.R[0], float(base @ down / max(np.linalg.norm(base), _SHORT))


def _parts(block: Block, links: Links) -> Index:
    """Return the number of the part of every exposure."""
    n, ends = len(block.trajectory), _ends(block, links)
    joins = coo_array((np.ones(len(links)), ends), (n, n))
    return np.asarray(connected_components(joins, directed=False)[1])


def _ends(block: Block, links: Links) -> tuple[Index, Index]:
    """Return the exposures of both views of every link."""
    i, j = block.images.exposure_idx[np.array([*links], np.intp).reshape(-1, 2)].T
    return i, j


# --- rotations -------------------------------------------------------------------------------


def _turned(
    block: Block, links: Links, in_part: Mask, height: float
) -> tuple[Block, dict[tuple[int, int], _TwoViews]]:
    """Return a block with rotations from links, and the links that agree with them.

    Exposures outside `in_part` keep theirs. Standard deviations of the trajectory become those
    that its positions and the rotations have as approximate values.

    Notes
    -----
    Averaged along the links [1]_, then turned as a whole: bases as the positions lie, cameras as
    the attitudes are, each with its weight. A short strip is turned by positions of some metres no
    better than by attitudes, and about its own direction by attitudes alone.

    References
    ----------
    .. [1] V. M. Govindu, "Combining two-view constraints for motion estimation", CVPR 2001.
    """
    i, j = _ends(block, links)
    R_b_c = mountings(block.cameras).R[block.images.camera_idx]
    R_i_j = np.array([R_b_c[a] @ by.R_a_b @ R_b_c[b].T for (a, b), by in links.items()])
    weight = np.array([float(len(by.which)) for by in links.values()])
    trajectory = block.trajectory
    T_m_b = trajectory.T_m_b
    R = _averaged(_spread(T_m_b.R, R_i_j, i, j, weight), R_i_j, i, j, weight)
    good = np.linalg.norm(log(_apart(R, R_i_j, i, j)), axis=1) < LARGEST_TURN

    sigma_m = np.fmax(trajectory.sigma_position, POSITION * height)
    sigma_m = np.where(np.isfinite(sigma_m), sigma_m, height)
    base_m = T_m_b.r[j] - T_m_b.r[i]
    base_b = np.array([R_b_c[a] @ by.base_a for (a, _), by in links.items()])
    by_links = transform(R[i], base_b) * np.linalg.norm(base_m, axis=1, keepdims=True)
    share = weight * good / np.sum(weight * good) * (len(np.unique([i, j])) - 1)
    M = (base_m * share[:, None] / np.mean(sigma_m**2)).T @ by_links
    M += np.mean(T_m_b.R[in_part] @ np.swapaxes(R[in_part], 1, 2), axis=0) / TURN**2
    U, _, Vt = np.linalg.svd(M)
    G = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt

    turned = replace(
        trajectory,
        T_m_b=Pose(R=np.where(in_part[:, None, None], G @ R, T_m_b.R), r=T_m_b.r),
        sigma_position=sigma_m,
        sigma_attitude=np.full((len(R), 3), LOOSE_ATTITUDE),
    )
    agree = {pair: by for (pair, by), keep in zip(links.items(), good, strict=True) if keep}
    return replace(block, trajectory=turned), agree


def _spread(R: Array, R_i_j: Array, i: Index, j: Index, weight: Array) -> Array:
    """Return rotations chained along the surest links from one exposure to all."""
    n = len(R)
    of_pair = {(min(a, b), max(a, b)): k for k, (a, b) in enumerate(zip(i, j, strict=True))}
    surest = np.argsort(weight)
    of_pair |= {(min(i[k], j[k]), max(i[k], j[k])): k for k in surest.tolist()}
    pairs, cost = np.array([*of_pair]), 1 / weight[[*of_pair.values()]]
    tree = minimum_spanning_tree(coo_array((cost, pairs.T), (n, n)).tocsr())
    order, before = breadth_first_order(tree, int(i[surest[-1]]), directed=False)
    out = R.copy()
    for e in order[1:].tolist():
        p = int(before[e])
        k = of_pair[min(p, e), max(p, e)]
        out[e] = out[p] @ (R_i_j[k] if i[k] == p else R_i_j[k].T)
    return out


def _apart(R: Array, R_i_j: Array, i: Index, j: Index) -> Array:
    """Return the misclosures of the links by the rotations of the exposures, mapping frame."""
    return R[i] @ R_i_j @ np.swapaxes(R[j], 1, 2)


def _averaged(R: Array, R_i_j: Array, i: Index, j: Index, weight: Array) -> Array:
    """Return the rotations with the least sum of weighted turns from the links."""
    n, every = len(R), np.arange(len(i))
    ends = np.repeat(every, 2), np.column_stack([j, i]).ravel()
    A = coo_array((np.tile([1.0, -1.0], len(i)), ends), (len(i), n)).tocsr()
    for _ in range(_ROUNDS):
        off = log(_apart(R, R_i_j, i, j))
        w = weight / np.maximum(np.linalg.norm(off, axis=1), _NEAR)
        N = (A.T * w) @ A + eye_array(n) * (1e-9 * w.sum())
        R = exp(spsolve(N.tocsc(), (A.T * w) @ off)) @ R
    return R


# --- adjusted --------------------------------------------------------------------------------


def _adjusted(
    block: Block, views: Sequence[View], rays: TieRays, height: float
) -> tuple[Block, tuple[View, ...], Surface]:
    """Return a block adjusted by its features: the poses found, its views, and the ground."""
    oriented = refined(approximate(block, height), views, rays)
    bundle, x_m = oriented.bundle, oriented.bundle.state.x_m
    n_rays = np.bincount(
        np.unique(rays.point, return_inverse=True)[1][oriented.kept], None, len(x_m)
    )
    checked = np.isfinite(x_m[:, 0]) & (n_rays >= WANTED)  # two rays meet wherever they are wrong
    surface = through(x_m[checked]) if np.mean(checked) > _ENOUGH else oriented.surface
    trajectory = replace(block.trajectory, T_m_b=bundle.state.T_m_b)
    found = replace(block, cameras=bundle.cameras, trajectory=trajectory)
    return found, oriented.views, surface


def _tracks(features: Mapping[int, _Features], links: Links) -> TieRays:
    """Return features chained by all links as points; none has two features in one picture."""
    views = sorted(features)
    ends = np.cumsum([0, *(len(features[v].colrow) for v in views)])
    first, n = dict(zip(views, ends[:-1], strict=True)), int(ends[-1])
    which = np.concatenate(
        [by.which + np.array([first[i], first[j]]) for (i, j), by in links.items()]
    )
    _, track = connected_components(coo_array((np.ones(len(which)), which.T), (n, n)), False)
    view = np.repeat(views, np.diff(ends))
    colrow = np.concatenate([features[v].colrow for v in views])
    order = np.lexsort((view, track))
    track, view, colrow = track[order], view[order], colrow[order]
    twice = np.zeros(n, dtype=bool)
    twice[1:] = (track[1:] == track[:-1]) & (view[1:] == view[:-1])
    usable = (np.bincount(track) > 1) & (np.bincount(track, twice) == 0)
    rays = TieRays(point=track, view=view, colrow=colrow, sigma_px=np.full(n, SIGMA_PX))
    return rays[usable[track]]
