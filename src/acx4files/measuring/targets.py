"""Control and check points in pictures: discs and natural points, found again in every picture.

Discs lie on a ground of another brightness: templates find them, least squares centres them, and
votes of all pictures tell them from what only looks alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from acx4files.measuring.pairs import MatchOptions, found_in
from acx4files.measuring.views import Surface, View, pixels_of, pixels_of_view, transferred
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import inside
from acx4lib.tie_points.matching import grey

RADII_PX = (0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0)
"""Radii of the templates: every disc is near one of them."""

LEAST_CORRELATION = 0.75
MOST = 8
"""Largest number of discs fitted around one place."""

LEAST_SIGMA_PX = 0.02
"""Error of a disc's model: its edge, and the response of the pixels."""

LARGEST_MISFIT = 0.12
"""Largest root mean square of residuals, as a share of the disc's contrast."""

_BLUR, _SAMPLES = 0.5, 4
_WEIGHT = 0.05  # of the usual blur and the template's radius: small discs determine neither
_SMALL_PX, _PHASES = 1.8, ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5))
_PLAY = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One measurement for image_points.csv."""

    image: str
    point: str
    col_px: float
    row_px: float
    sigma_px: float


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A disc in a picture.

    Attributes
    ----------
    col, row : float
    sigma_px : float
        Of either coordinate.
    radius_px : float
    contrast : float
        Grey value of the disc less that of its ground.
    correlation : float
        With its template.
    """

    col: float
    row: float
    sigma_px: float
    radius_px: float
    contrast: float
    correlation: float


def discs(grey: Array) -> list[Disc]:
    """Return the discs in a part of a picture, the clearest first.

    Parameters
    ----------
    grey : ndarray of float32, shape (rows, cols)
        Without NaN.
    """
    starts: list[tuple[float, float, float, float]] = []
    for rho, radius, col, row in sorted(_starts(grey), reverse=True):
        others = (np.hypot(col - c, row - r) < max(1.5, radius) for _, _, c, r in starts)
        if len(starts) < MOST and not any(others):  # the clearer one has the better radius
            starts.append((rho, radius, col, row))
    fitted = (_centred(grey, c, r, size, correlation=rho) for rho, size, c, r in starts)
    return [disc for disc in fitted if disc is not None]


def _starts(grey: Array) -> list[tuple[float, float, float, float]]:
    """Return correlation, radius, col and row of the local maxima of all templates.

    A small disc looks different where its middle lies between pixels, and has templates for it.
    """
    out: list[tuple[float, float, float, float]] = []
    for radius in RADII_PX:
        for dx, dy in _PHASES if radius < _SMALL_PX else _PHASES[:1]:
            template = _template(radius, dx, dy)
            half = len(template) // 2
            if min(grey.shape) <= 2 * half + 2:
                return out
            score = np.abs(cv2.matchTemplate(grey, template, cv2.TM_CCOEFF_NORMED))
            score[~np.isfinite(score)] = 0
            peak = (score == cv2.dilate(score, np.ones((5, 5)))) & (score >= LEAST_CORRELATION)
            rows, cols = np.nonzero(peak)
            out += [
                (float(score[r, c]), radius, int(c) + half + dx, int(r) + half + dy)
                for r, c in zip(rows, cols, strict=True)
            ]
    return out


def _template(radius: float, dx: float, dy: float) -> Array:
    """Return a blurred disc, its middle at dx, dy, with a ring of its ground around it."""
    half = int(np.ceil(_reach(radius)))
    x = np.arange(-half, half + 1, dtype=float)
    return _image(x[None, :] - dx, x[:, None] - dy, radius, _BLUR).astype(np.float32)


def _reach(radius: float) -> float:
    """Return how far from its middle a disc is compared with its ground, px."""
    return 1.6 * radius + 0.7


def _image(x: Array, y: Array, radius: float, blur: float) -> Array:
    """Return the share of a blurred disc in pixels, from their distances to its middle."""
    xx = (x[..., None] + _PLAY) ** 2
    yy = (y[..., None] + _PLAY) ** 2
    away = np.sqrt(xx[..., None, :] + yy[..., :, None])
    return np.asarray(ndtr((radius - away) / blur).mean(axis=(-1, -2)))


def _centred(
    grey: Array, col: float, row: float, radius: float, *, correlation: float
) -> Disc | None:
    """Return the disc near a place, centred by least squares; None where there is none."""
    half = int(np.ceil(_reach(radius))) + 1
    rows, cols = grey.shape
    c, r = round(col), round(row)
    if not (half <= c < cols - half and half <= r < rows - half):
        return None
    y, x = np.mgrid[-half : half + 1, -half : half + 1].reshape(2, -1).astype(float)
    x, y = x - (col - c), y - (row - r)
    near = np.hypot(x, y) <= _reach(radius) + 0.5
    x, y = x[near], y[near]
    values = grey[r - half : r + half + 1, c - half : c + half + 1].ravel()[near].astype(float)
    inner = np.hypot(x, y) <= max(radius, 0.8)
    ground = float(np.median(values[~inner]))
    contrast = float(np.mean(values[inner])) - ground
    if contrast == 0:
        return None
    start = np.array([0.0, 0.0, np.log(radius), np.log(_BLUR), ground / contrast, 1.2])

    def misfit(p: Array) -> Array:
        share = _image(x - p[0], y - p[1], np.exp(p[2]), np.exp(p[3]))
        usual = _WEIGHT * (p[2:4] - start[2:4])
        return np.append(p[4] + p[5] * share - values / contrast, usual)

    fit = least_squares(misfit, start, method="lm", max_nfev=400)
    p, J = fit.x, np.asarray(fit.jac)
    N = J.T @ J
    rms = float(np.sqrt(2 * fit.cost / max(len(fit.fun) - len(p), 1)))
    is_away = np.hypot(p[0], p[1]) > max(1.0, 0.7 * radius) or np.exp(p[2]) > 2 * radius
    if is_away or not p[5] > 0 or rms > LARGEST_MISFIT * p[5] or np.linalg.cond(N) > 1e14:
        return None
    sigma = rms * float(np.sqrt(np.linalg.inv(N)[:2, :2].trace() / 2))
    return Disc(
        col=col + float(p[0]),
        row=row + float(p[1]),
        sigma_px=float(np.hypot(sigma, LEAST_SIGMA_PX)),
        radius_px=float(np.exp(p[2])),
        contrast=float(p[5]) * contrast,
        correlation=correlation,
    )


# --- Which spots are targets: those that all pictures and all points agree on
#
# The points of a block are found where the trajectory puts them but for an error that changes
# smoothly over the ground. A target is off by this error in every picture; other bright spots are
# anywhere.


SAME_POINT_PX, OTHER_POINT_PX = 2.5, 3.0
"""Largest differences between offsets of one point in two pictures, and of two points."""

OTHERS = 2
"""Other points that must agree, where as many have candidates: a bright stone, too, is at the same
place in all pictures, but not beside every point."""

AROUND = 9
"""Measurements of the nearest other points, the median of whose offsets is compared."""

ALIKE, ALIKE_PX = 1.5, 0.5
"""Largest ratio, or else difference, of the radii on the ground of two targets."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A spot that may be a surveyed point.

    Attributes
    ----------
    point, view : int
    at_m : tuple of float
        x, y of the point in the mapping frame.
    offset_m : tuple of float
        On the ground, from where the point should be.
    pixel_m : float
        Size of a pixel on the ground.
    radius_m : float
    bright : bool
    correlation : float
    colrow : tuple of float
    sigma_px : float
    """

    point: int
    view: int
    at_m: tuple[float, float]
    offset_m: tuple[float, float]
    pixel_m: float
    radius_m: float
    bright: bool
    correlation: float
    colrow: tuple[float, float]
    sigma_px: float


def elected(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates that are targets, at most one for each point in a picture."""
    if not candidates:
        return []
    by_views, by_points = _votes(candidates)
    enough = min(OTHERS, len({candidate.point for candidate in candidates}) - 1)
    votes = by_views + by_points + [0.1 * candidate.correlation for candidate in candidates]
    votes[(by_points < enough) | (by_views + by_points == 0)] = 0
    best: dict[tuple[int, int], int] = {}
    for k in np.argsort(-votes, kind="stable")[: np.sum(votes > 0)].tolist():
        best.setdefault((candidates[k].point, candidates[k].view), k)
    chosen = [candidates[k] for k in sorted(best.values())]
    return [candidate for candidate in chosen if _is_as_beside(candidate, chosen)]


def _is_as_beside(candidate: Candidate, chosen: Sequence[Candidate]) -> bool:
    """Tell whether a candidate has the offset of the points around it; two stones may agree."""
    others = [other for other in chosen if other.point != candidate.point]
    others.sort(key=lambda other: np.hypot(*np.subtract(other.at_m, candidate.at_m)))
    near = np.array([other.offset_m for other in others[:AROUND]] or [candidate.offset_m])
    away = np.hypot(*(np.median(near, axis=0) - candidate.offset_m))
    return bool(away < OTHER_POINT_PX * candidate.pixel_m)


def _votes(candidates: Sequence[Candidate]) -> tuple[Array, Array]:
    """Return how many other pictures of its point, and other points, support each candidate."""
    point, view, offset, pixel, radius, bright = (
        np.array([getattr(candidate, name) for candidate in candidates])
        for name in ("point", "view", "offset_m", "pixel_m", "radius_m", "bright")
    )
    out = np.zeros((2, len(candidates)))
    for k in range(len(candidates)):
        coarser = np.maximum(pixel, pixel[k])
        away = np.hypot(*(offset - offset[k]).T) / coarser
        alike = np.maximum(radius, radius[k]) < ALIKE * np.minimum(radius, radius[k])
        alike |= np.abs(radius - radius[k]) < ALIKE_PX * coarser
        alike &= bright == bright[k]
        same = alike & (point == point[k]) & (view != view[k]) & (away < SAME_POINT_PX)
        other = alike & (point != point[k]) & (away < OTHER_POINT_PX)
        out[:, k] = len(np.unique(view[same])), len(np.unique(point[other]))
    return out[0], out[1]


# --- Signalised points looked for in all pictures of a block


SEARCH = 0.006
"""Radius of the search, in flying heights: what the ties leave open of lever arm and boresight."""

LEAST_PX = 12


def find_targets(views: Sequence[View], x_m: Array) -> list[Candidate]:
    """Return the places of signalised points in pictures, one for each point and picture.

    Parameters
    ----------
    views : sequence of View
        With orientations on which the pictures agree.
    x_m : ndarray, shape (n, 3)
        Surveyed points, mapping frame, m.
    """
    return elected([spot for i, view in enumerate(views) for spot in _candidates(i, view, x_m)])


def _candidates(i: int, view: View, x_m: Array) -> Iterator[Candidate]:
    """Yield the discs near the places of all points in a picture."""
    places = pixels_of(view, x_m)
    away = np.linalg.norm(x_m - view.T_m_c.r[0], axis=1)
    pixel_m = away * view.camera.pixel_mm / view.camera.interior.f
    for k in np.flatnonzero(inside(view.camera, places)).tolist():
        reach = int(max(LEAST_PX, SEARCH * away[k] / pixel_m[k])) + int(2 * max(RADII_PX))
        col, row = np.rint(places[k]).astype(int)
        first = np.array([max(col - reach, 0), max(row - reach, 0)])
        part = pixels_of_view(view)[first[1] : row + reach + 1, first[0] : col + reach + 1]
        # by how much a point would move on its level to be seen at a pixel
        level = pixels_of(view, x_m[k] + np.eye(3)[:2]) - places[k]
        for disc in discs(grey(np.ascontiguousarray(part))):
            colrow = first + np.array([disc.col, disc.row])
            east, north = np.linalg.solve(level.T, colrow - places[k])
            yield Candidate(
                point=k,
                view=i,
                at_m=(float(x_m[k, 0]), float(x_m[k, 1])),
                offset_m=(float(east), float(north)),
                pixel_m=float(pixel_m[k]),
                radius_m=float(disc.radius_px * pixel_m[k]),
                bright=disc.contrast > 0,
                correlation=disc.correlation,
                colrow=(float(colrow[0]), float(colrow[1])),
                sigma_px=disc.sigma_px,
            )


# --- Points that are measured in one picture, carried into all others by matching


NATURAL = MatchOptions(search_px=8)


def places_in_other_views(
    view: View, others: Sequence[View], surface: Surface, colrow: Array
) -> tuple[Index, Array, Array]:
    """Match a point of one picture in the other pictures.

    Parameters
    ----------
    view : View
        The picture in which it is measured.
    others : sequence of View
    surface : Surface
    colrow : ndarray, shape (2,)
        Its place there.

    Returns
    -------
    which : ndarray, shape (n,)
        Numbers of the other pictures that show it.
    colrow : ndarray, shape (n, 2)
    sigma_px : ndarray, shape (n,)
        Of the matching; that of the given measurement is not in it.
    """
    middle = np.rint(colrow).astype(np.intp)
    which, places, sigmas = [], [], []
    for k, other in enumerate(others):
        match = found_in(view, other, surface, middle[None], NATURAL)
        if len(match):
            shown = transferred(view, other, surface, np.stack([middle.astype(float), colrow]))
            which.append(k)
            places.append(match.colrow[0] + (shown[1] - shown[0]))
            sigmas.append(match.sigma_px[0, 1])
    return np.array(which, np.intp), np.array(places).reshape(-1, 2), np.array(sigmas)


# --- The surveyed points of a block: those measured in one picture, and those that are signalised


@dataclass(frozen=True, kw_only=True, eq=False)
class Surveyed:
    """Surveyed points as they were found.

    Attributes
    ----------
    rows : tuple of Measured
        Measurements beside the given ones.
    not_found : dict of str to tuple of str
        For every point that some pictures should show and that was not found in them, these.
    """

    rows: tuple[Measured, ...]
    not_found: dict[str, tuple[str, ...]]


def find_surveyed(
    views: Sequence[View],
    surface: Surface,
    names: Sequence[str],
    x_m: Array,
    given: Sequence[Measured],
) -> Surveyed:
    """Look for surveyed points in all pictures of a block.

    Parameters
    ----------
    views : sequence of View
        With orientations on which the pictures agree.
    surface : Surface
    names : sequence of str
        Of the points.
    x_m : ndarray, shape (n, 3)
        Mapping frame, m.
    given : sequence of Measured
        What is measured already. Such a point is matched from there; the others are looked for as
        signalised ones.
    """
    done = {(row.image, row.point) for row in given}
    known = {row.point for row in given}
    signalised = [k for k, name in enumerate(names) if name not in known]
    rows = [
        _row(views[spot.view], names[signalised[spot.point]], np.array(spot.colrow), spot.sigma_px)
        for spot in find_targets(views, x_m[signalised])
    ]
    for name in names:
        rows += _natural(views, surface, [row for row in given if row.point == name])
    rows = [row for row in rows if (row.image, row.point) not in done]
    done |= {(row.image, row.point) for row in rows}
    lacking: dict[str, tuple[str, ...]] = {}
    for view in views:
        for k in np.flatnonzero(inside(view.camera, pixels_of(view, x_m))).tolist():
            if (view.name, names[k]) not in done:
                lacking[names[k]] = (*lacking.get(names[k], ()), view.name)
    not_found = {name: lacking[name] for name in names if name in lacking}
    return Surveyed(rows=tuple(rows), not_found=not_found)


def _natural(
    views: Sequence[View], surface: Surface, given: Sequence[Measured]
) -> Iterator[Measured]:
    """Yield the measurements of a point in other pictures, matched from the surest given one."""
    of_name = {view.name: view for view in views}
    row = min((r for r in given if r.image in of_name), key=lambda r: r.sigma_px, default=None)
    if row is None:
        return
    view = of_name[row.image]
    others = [other for other in views if other is not view]
    colrow = view.own(np.array([[row.col_px, row.row_px]]))[0]
    for k, place, sigma in zip(*places_in_other_views(view, others, surface, colrow), strict=True):
        given_px = row.sigma_px / others[k].shrink
        yield _row(others[k], row.point, place, float(np.hypot(sigma, given_px)))


def _row(view: View, point: str, colrow: Array, sigma_px: float) -> Measured:
    col, row = view.full(colrow[None])[0]
    return Measured(
        image=view.name,
        point=point,
        col_px=float(col),
        row_px=float(row),
        sigma_px=sigma_px * view.shrink,
    )
