"""Features that are found again in turned, scaled and brighter pictures, and two pictures by them.

Contrast is equalised locally before, so that dark woods have features beside bright roofs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares

from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import correct, xy_from_colrow
from acx4lib.geometry.frames import exp
from acx4lib.geometry.intersection import R_C_CV
from acx4lib.tie_points.overlaps import grey
from acx4tools.measuring.pictures.views import View, pixels_of_view

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
_RELIEF = 2.0  # ratio of distances to the ground in a pair of pictures, either way
_LEAST_START, _CALLS = 8, 100
_STEEP, _SHORT = 0.5, 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Features:
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
class TwoViews:
    """How two pictures lie to each other, by their features.

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


def features_of(view: View) -> Features:
    """Return the features of a picture (SIFT [1]_, descriptors by Hellinger's distance [2]_).

    References
    ----------
    .. [1] D. G. Lowe, "Distinctive image features from scale-invariant keypoints", International
       Journal of Computer Vision 60(2), 2004.
    .. [2] R. Arandjelovic, A. Zisserman, "Three things everyone should know to improve object
       retrieval", CVPR 2012.
    """
    even = cv2.createCLAHE(clipLimit=_CLIP, tileGridSize=_TILES).apply(_eight_bit(view))
    sift = cv2.SIFT.create(nfeatures=MOST, contrastThreshold=_CONTRAST)
    points, found = sift.detectAndCompute(even, None)
    colrow = np.array([point.pt for point in points], dtype=float).reshape(-1, 2)
    total = np.maximum(found.sum(axis=1, keepdims=True), 1) if len(points) else 1.0
    descriptor = np.zeros((0, 128)) if found is None else np.rint(_LENGTH * np.sqrt(found / total))
    camera = view.camera
    ideal = correct(camera.interior, xy_from_colrow(camera, colrow)) / camera.interior.f
    return Features(
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


def two_views(a: Features, b: Features, down: Array, fall: float) -> TwoViews | None:
    """Return how two pictures lie to each other; None where too few features agree.

    Similar features are mutually the most similar, clearly before the second. Those that agree
    are found by MAGSAC [1]_, once over a plane, the more level one of two, once over any ground:
    over a level one, the latter often finds an absurd second solution, whose base is steep. The
    one on which more agree is taken; a point that is much nearer or farther than the others does
    not.

    Parameters
    ----------
    a, b : Features
    down : ndarray, shape (3,)
        Unit vector towards the ground, axes of the first camera; it may be off by twenty degrees.
    fall : float
        By how much the second camera is lower than the first, in bases, about.

    References
    ----------
    .. [1] D. Barath et al., "MAGSAC++, a fast, reliable and accurate robust estimator", CVPR 2020.
    """
    i, j = similar(a, b)
    if len(i) < LEAST:
        return None
    within = max(a.near, b.near)
    rays = _rays(a.ideal[i]), _rays(b.ideal[j])
    starts = [*_over_a_plane(a.ideal[i], b.ideal[j], within, down)]
    starts += _over_any_ground(a.ideal[i], b.ideal[j], within)
    grown = [_grown(*start, *rays, within) for start in starts]
    found = [one for one in grown if abs(float(one.base_a @ down) - fall) < _STEEP]
    best = max(found, key=lambda one: int(one.agree.sum()), default=None)
    if best is None or best.agree.sum() < LEAST:
        return None
    return TwoViews(
        which=np.column_stack([i, j])[best.agree],
        R_a_b=best.R_a_b,
        base_a=best.base_a,
        depth=float(np.median(best.depth[best.agree])),
    )


def _over_a_plane(
    a: Array, b: Array, within: float, down: Array
) -> Iterator[tuple[Array, Array, Mask]]:
    """Yield the rotation and base over the more level of two planes, and what is near it."""
    H, near = cv2.findHomography(a, b, cv2.USAC_MAGSAC, _PLANE * within)
    if H is None or near.sum() < _LEAST_START:
        return
    _, R, t, normal = cv2.decomposeHomographyMat(H, np.eye(3))
    level = [float(n[:, 0] @ R_C_CV @ down) for n in normal]
    best = int(np.argmax(level))
    yield *_in_own_axes(R[best], t[best]), near[:, 0] > 0


def _over_any_ground(a: Array, b: Array, within: float) -> Iterator[tuple[Array, Array, Mask]]:
    """Yield the rotation and base that most points agree on."""
    E, near = cv2.findEssentialMat(
        *(a, b, np.eye(3), cv2.USAC_MAGSAC, _PROBABILITY, within, _TRIALS)
    )
    if E is None or E.shape != (3, 3) or near.sum() < _LEAST_START:
        return
    own = near[:, 0] > 0
    _, R, t, _ = cv2.recoverPose(E, a[own], b[own], np.eye(3))
    yield *_in_own_axes(R, t), own


def _in_own_axes(R_b_a: np.ndarray, t_b_a: np.ndarray) -> tuple[Array, Array]:
    """Return R_a_b and the unit base in the library's axes."""
    base = -R_C_CV @ R_b_a.T @ t_b_a[:, 0]
    return R_C_CV @ R_b_a.T @ R_C_CV, base / max(float(np.linalg.norm(base)), _SHORT)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grown:
    """A relative orientation, the depths of all pairs by it, and the pairs that agree on it."""

    R_a_b: Array
    base_a: Array
    depth: Array
    agree: Mask


def _grown(
    R_a_b: Array, base_a: Array, near: Mask, ray_a: Array, ray_b: Array, within: float
) -> _Grown:
    """Return the relative orientation that grew from a start, over ground of one height, about."""
    for factor in _SHRINKING:
        if near.sum() >= _LEAST_START:
            R_a_b, base_a = _fitted(R_a_b, base_a, ray_a[near], ray_b[near])
        depth = _depths(R_a_b, base_a, ray_a, ray_b)
        off = np.abs(_across(R_a_b, base_a, ray_a, ray_b)) < factor * within
        ahead = depth[off & (depth > 0)]
        usual = float(np.median(ahead)) if len(ahead) else np.nan
        near = off & (depth > usual / _RELIEF) & (depth < usual * _RELIEF)
    return _Grown(R_a_b=R_a_b, base_a=base_a, depth=depth, agree=near)


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


def similar(a: Features, b: Features) -> tuple[Index, Index]:
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
