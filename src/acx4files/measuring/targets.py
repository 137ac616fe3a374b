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
from acx4lib.expected import Array, Index, Mask
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
_TINY_PX = 1e-9  # of a sample in the very middle, which has no direction


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
    for start in sorted(_starts(grey), reverse=True):
        if len(starts) < MOST and not any(_same(start, other) for other in starts):
            starts.append(start)
    fitted = (_centred(grey, c, r, size, correlation=rho) for rho, size, c, r in starts)
    return [disc for disc in fitted if disc is not None]


def _same(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Tell whether two starts are of the same disc; the clearer one has the better radius."""
    return np.hypot(a[2] - b[2], a[3] - b[3]) < max(1.5, b[1])


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


def _image_jacobian(x: Array, y: Array, radius: float, blur: float) -> Array:
    """Return the derivatives of `_image` by the middle and by ln radius and ln blur, (n, 4)."""
    xx, yy = (x[:, None] + _PLAY)[:, None, :], (y[:, None] + _PLAY)[:, :, None]
    away = np.hypot(xx, yy)
    z = (radius - away) / blur
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    outward = density / np.maximum(away, _TINY_PX) / blur
    parts = (outward * xx, outward * yy, density * (radius / blur), -density * z)
    return np.stack([part.mean(axis=(-1, -2)) for part in parts], axis=-1)


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

    def jacobian(p: Array) -> Array:
        model = x - p[0], y - p[1], np.exp(p[2]), np.exp(p[3])
        J = np.zeros((len(x) + 2, 6))
        J[:-2, :4], J[:-2, 4], J[:-2, 5] = p[5] * _image_jacobian(*model), 1.0, _image(*model)
        J[[-2, -1], [2, 3]] = _WEIGHT
        return J

    fit = least_squares(misfit, start, jacobian, method="lm", max_nfev=60)
    return _judged(fit.x, fit.fun, np.asarray(fit.jac), (col, row, radius, contrast, correlation))


def _judged(
    p: Array, v: Array, J: Array, start: tuple[float, float, float, float, float]
) -> Disc | None:
    """Return the disc of a fit; None where it is no disc."""
    col, row, radius, contrast, correlation = start
    rms = float(np.sqrt(v @ v / max(len(v) - len(p), 1)))
    size = float(np.exp(p[2]))
    away = np.hypot(p[0], p[1])
    N = J.T @ J
    if away > max(1.0, 0.7 * radius) or not p[5] > 0 or rms > LARGEST_MISFIT * p[5]:
        return None
    if size > 2 * radius or np.linalg.cond(N) > 1e14:
        return None
    sigma = rms * float(np.sqrt(np.linalg.inv(N)[:2, :2].trace() / 2))
    return Disc(
        col=col + float(p[0]),
        row=row + float(p[1]),
        sigma_px=float(np.hypot(sigma, LEAST_SIGMA_PX)),
        radius_px=size,
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
    votes = (
        by_views + by_points + 0.1 * np.array([candidate.correlation for candidate in candidates])
    )
    votes[(by_points < enough) | (by_views + by_points == 0)] = 0
    best: dict[tuple[int, int], int] = {}
    for k, candidate in enumerate(candidates):
        other = best.get((candidate.point, candidate.view))
        if votes[k] > 0 and (other is None or votes[k] > votes[other]):
            best[candidate.point, candidate.view] = k
    return _as_beside([candidates[k] for k in sorted(best.values())])


def _as_beside(chosen: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates with the offset of the points around them; two stones may agree."""
    out = []
    for candidate in chosen:
        others = [other for other in chosen if other.point != candidate.point]
        others.sort(key=lambda other: np.hypot(*np.subtract(other.at_m, candidate.at_m)))
        near = np.array([other.offset_m for other in others[:AROUND]] or [candidate.offset_m])
        away = np.hypot(*(np.median(near, axis=0) - candidate.offset_m))
        if away < OTHER_POINT_PX * candidate.pixel_m:
            out.append(candidate)
    return out


def _votes(candidates: Sequence[Candidate]) -> tuple[Array, Array]:
    """Return how many other pictures of its point, and other points, support each candidate."""
    offset = np.array([c.offset_m for c in candidates])
    pixel = np.array([c.pixel_m for c in candidates])
    radius = np.array([c.radius_m for c in candidates])
    bright = np.array([c.bright for c in candidates])
    point, view = (np.array([getattr(c, n) for c in candidates]) for n in ("point", "view"))
    out = np.zeros((2, len(candidates)))
    for k in range(len(candidates)):
        coarser = np.maximum(pixel, pixel[k])
        away = np.hypot(*(offset - offset[k]).T) / coarser
        sizes = np.maximum(radius, radius[k]) / np.minimum(radius, radius[k])
        alike = (sizes < ALIKE) | (np.abs(radius - radius[k]) < ALIKE_PX * coarser)
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
    """Return the places of signalised points in pictures.

    Parameters
    ----------
    views : sequence of View
        With orientations on which the pictures agree.
    x_m : ndarray, shape (n, 3)
        Surveyed points, mapping frame, m.

    Returns
    -------
    list of Candidate
        For every point that was found, one for each picture.
    """
    return elected(
        [candidate for i, view in enumerate(views) for candidate in _candidates(i, view, x_m)]
    )


def _candidates(i: int, view: View, x_m: Array) -> Iterator[Candidate]:
    """Yield the discs near the places of all points in a picture."""
    places = pixels_of(view, x_m)
    away = np.linalg.norm(x_m - view.T_m_c.r[0], axis=1)
    pixel_m = away * view.camera.pixel_mm / view.camera.interior.f
    for k in np.flatnonzero(inside(view.camera, places)).tolist():
        reach = int(max(LEAST_PX, SEARCH * away[k] / pixel_m[k])) + int(2 * max(RADII_PX))
        window, first = _window(view, places[k], reach)
        for disc in discs(window):
            colrow = first + np.array([disc.col, disc.row])
            yield Candidate(
                point=k,
                view=i,
                at_m=(float(x_m[k, 0]), float(x_m[k, 1])),
                offset_m=_offset(view, x_m[k], places[k], colrow),
                pixel_m=float(pixel_m[k]),
                radius_m=float(disc.radius_px * pixel_m[k]),
                bright=disc.contrast > 0,
                correlation=disc.correlation,
                colrow=(float(colrow[0]), float(colrow[1])),
                sigma_px=disc.sigma_px,
            )


def _window(view: View, place: Array, reach: int) -> tuple[Array, Array]:
    """Return the grey values around a place, and the col, row of their first pixel."""
    image = pixels_of_view(view)
    col, row = np.rint(place).astype(int)
    top, left = max(row - reach, 0), max(col - reach, 0)
    part = image[top : row + reach + 1, left : col + reach + 1]
    return grey(np.ascontiguousarray(part)), np.array([left, top])


def _offset(view: View, x_m: Array, place: Array, colrow: Array) -> tuple[float, float]:
    """Return by how much a point would have to move on its level to be seen at a pixel, m."""
    step = 1.0
    moved = x_m + step * np.array([[1.0, 0, 0], [0, 1.0, 0]])
    J = (pixels_of(view, moved) - place).T / step
    east, north = np.linalg.solve(J, colrow - place)
    return float(east), float(north)


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
    measured = {(row.image, row.point) for row in given}
    by_point: dict[str, list[Measured]] = {}
    for row in given:
        by_point.setdefault(row.point, []).append(row)
    signalised = [k for k, name in enumerate(names) if name not in by_point]
    rows = [
        _row(
            views[target.view],
            names[signalised[target.point]],
            np.array(target.colrow),
            target.sigma_px,
        )
        for target in find_targets(views, x_m[signalised])
    ]
    for name in names:
        rows += _natural(views, surface, by_point.get(name, []))
    rows = [row for row in rows if (row.image, row.point) not in measured]
    done = measured | {(row.image, row.point) for row in rows}
    return Surveyed(rows=tuple(rows), not_found=dict(_missing(views, names, x_m, done)))


def _natural(
    views: Sequence[View], surface: Surface, given: Sequence[Measured]
) -> Iterator[Measured]:
    """Yield the measurements of a point in other pictures, matched from the surest given one."""
    of_name = {view.name: view for view in views}
    measured_rows = [row for row in given if row.image in of_name]
    if not measured_rows:
        return
    row = min(measured_rows, key=lambda measured: measured.sigma_px)
    view = of_name[row.image]
    others = [other for other in views if other is not view]
    colrow = view.own(np.array([[row.col_px, row.row_px]]))[0]
    for k, place, sigma in zip(*places_in_other_views(view, others, surface, colrow), strict=True):
        matched_view = others[k]
        given_px = row.sigma_px / matched_view.shrink
        yield _row(matched_view, row.point, place, float(np.hypot(sigma, given_px)))


def _row(view: View, point: str, colrow: Array, sigma_px: float) -> Measured:
    col, row = view.full(colrow[None])[0]
    return Measured(
        image=view.name,
        point=point,
        col_px=float(col),
        row_px=float(row),
        sigma_px=sigma_px * view.shrink,
    )


def _missing(
    views: Sequence[View], names: Sequence[str], x_m: Array, done: set[tuple[str, str]]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each point that pictures should show, with those in which it was not found."""
    shown: list[Mask] = [inside(view.camera, pixels_of(view, x_m)) for view in views]
    for k, name in enumerate(names):
        lacking = [
            view.name
            for view, mask in zip(views, shown, strict=True)
            if mask[k] and (view.name, name) not in done
        ]
        if lacking:
            yield name, tuple(lacking)
