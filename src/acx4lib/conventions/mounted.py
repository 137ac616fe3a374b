"""The mountings of cameras adjusted on a trajectory that is taken as exact: eq. (14), robustly.

It asks only which reading of a flight leaves the least, so errors of GNSS and INS remain in the
misfit. Mounting and interior orientation are free within what is plausible: what a real
adjustment would absorb is absorbed here, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.conventions.readings import Reading, Sightings, velocities
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera, Interior, correct, correct_jacobian, xy_from_colrow
from acx4lib.geometry.collinearity import pinhole, pinhole_jacobian, to_camera
from acx4lib.geometry.frames import Pose, exp, skew, transform
from acx4lib.geometry.intersection import intersect

WORST = 1 - 1 / 30
"""Share of the residuals below `Mounted.worst`."""

QUANTILE, NORMAL = 0.75, 1.1503
"""Share of the misfits that their size is taken at, and the normal distribution's value there."""

TURNS, STEPS = 8, 12
"""Largest numbers of closed-form turns, and of adjustment steps after them."""

LARGEST_TURN = 0.5
"""Of one step, radians."""

SETTLED = 0.003
"""Relative decrease of the misfit below which no further step is made."""

WIDTH = 4.0
"""Residual, in misfits, that has a quarter of its weight."""

HELD, LOOSE = 1e30, 1e-12
"""Weights, 1/m², at their coordinates of surveyed points, and of tie points that no ray holds."""

FREE_POSE, ENOUGH_LEFT = 6, 4
"""Unknowns of a free pose, and observations that must be left beyond them."""

LEVER_M, DELAY_S = 1.0, 10.0
"""Prior sigma of lever arm, m, and delay, s: where both are the same, it is a delay."""

FARTHEST_LEVER_M, FARTHEST_F = 10.0, 0.02
"""A lever arm, m, or a share of the focal length, farther from the declared one is none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mounted:
    """Cameras as they fit a trajectory best.

    Attributes
    ----------
    cameras : tuple of Camera
        With their interior orientation and mounting.
    x_m : ndarray, shape (n_points, 3)
        Points, m.
    delay_s : float
        Time by which the trajectory's positions must move, s.
    misfit : float
        Angle by which rays miss their points, per component, robustly; radians. Infinite where
        most points lie behind the cameras.
    worst : float
        Residual that one in thirty exceeds, radians: of images that a robust misfit does not see.
    held : bool
        Whether lever arms and focal lengths are held as declared, since no plausible ones fit.
    """

    cameras: tuple[Camera, ...]
    x_m: Array
    delay_s: float = 0.0
    misfit: float = np.inf
    worst: float = np.inf
    held: bool = False


def mounted(seen: Sightings, T_m_b: Pose, velocity: Array | None = None) -> Mounted:
    """Return the mountings and interior orientations that fit a trajectory best.

    Parameters
    ----------
    seen : Sightings
    T_m_b : Pose
        One per exposure.
    velocity : ndarray, shape (n_exposures, 3), optional
        m/s; with it a delay is estimated.
    """
    start = started(seen, T_m_b)
    found = _adjusted(seen, T_m_b, start, velocity)
    if _plausible(found, seen):
        return found
    return _adjusted(seen, T_m_b, replace(start, held=True), velocity)


def _plausible(found: Mounted, seen: Sightings) -> bool:
    """Tell whether lever arms and focal lengths are anywhere near the declared ones."""
    return all(
        np.linalg.norm(own.T_b_c.r - given.T_b_c.r) < FARTHEST_LEVER_M
        and abs(own.interior.f / given.interior.f - 1) < FARTHEST_F
        for own, given in zip(found.cameras, seen.cameras, strict=True)
    )


def _derivatives(seen: Sightings, T_m_b: Pose, found: Mounted) -> Array:
    """Return the derivatives of all residuals by their points, radians per m, shape (n, 2, 3)."""
    return _linear(seen, T_m_b, found, np.zeros((len(T_m_b), 3)))[2]


def _pattern_sizes(seen: Sightings, T_m_b: Pose, found: Mounted, patterns: Array) -> Array:
    """Return the sizes of patterns in the residuals, estimated with all other unknowns."""
    v, A, B = _linear(seen, T_m_b, found, np.zeros((len(T_m_b), 3)))
    prior = _prior_sigma(seen.cameras, held=found.held, delayed=False)
    wide = np.concatenate([prior, np.full(patterns.shape[2], np.inf)])
    dx, _ = _step(seen, found, (v, np.concatenate([A, patterns], axis=2), B), wide)
    return dx[len(prior) :]


# --- start ------------------------------------------------------------------------------------


def started(seen: Sightings, T_m_b: Pose) -> Mounted:
    """Return the cameras turned onto surveyed points, and tie points where their rays meet.

    Quick, in closed form; lever arms and interior orientations are as declared.

    Parameters
    ----------
    seen : Sightings
    T_m_b : Pose
        One per exposure.
    """
    body = T_m_b[seen.exposure_idx]
    ray_c, cameras = _rays(seen), list(seen.cameras)
    for k, camera in enumerate(cameras):
        own = np.flatnonzero((seen.camera_idx == k) & np.isfinite(seen.x_m[seen.point_idx, 0]))
        if len(own) < 3:
            continue
        to = _to_body(body[own], seen.x_m[seen.point_idx[own]]) - camera.T_b_c.r
        to /= np.linalg.norm(to, axis=1, keepdims=True)
        R_b_c = _turned(camera.T_b_c.R, ray_c[own], to)
        cameras[k] = replace(camera, T_b_c=Pose(R=R_b_c, r=camera.T_b_c.r))
    x_m = seen.x_m.copy()
    ties = np.isnan(x_m[:, 0])
    if ties.any():
        R_b_c = np.stack([camera.T_b_c.R for camera in cameras])[seen.camera_idx]
        met = intersect(body.r, transform(body.R @ R_b_c, ray_c), seen.point_idx, len(x_m))
        x_m[ties] = met[ties]
    start = Mounted(cameras=tuple(cameras), x_m=x_m)
    return replace(start, misfit=size(_linear(seen, T_m_b, start, np.zeros((len(T_m_b), 3)))[0]))


def _rays(seen: Sightings) -> Array:
    """Return unit vectors of the measured rays in camera axes, shape (n, 3)."""
    out = np.empty((len(seen), 3))
    for k, camera in enumerate(seen.cameras):
        own = seen.camera_idx == k
        out[own, :2] = correct(camera.interior, xy_from_colrow(camera, seen.colrow[own]))
        out[own, 2] = -camera.interior.f
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def _to_body(T_m_b: Pose, x_m: Array) -> Array:
    return np.einsum("nji,nj->ni", T_m_b.R, x_m - T_m_b.r)


def _turned(R_b_c: Array, ray_c: Array, to_b: Array) -> Array:
    """Return the rotation with the least sum of chords between rays and directions.

    Kabsch's rotation, reweighted by the chords, as in `bundle.start.start_values`.
    """
    weight = np.ones(len(ray_c))
    for _ in range(TURNS):
        U, _, Vt = np.linalg.svd(np.einsum("n,ni,nj->ij", weight, to_b, ray_c))
        R_b_c = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        weight = 1 / np.maximum(np.linalg.norm(to_b - ray_c @ R_b_c.T, axis=1), 1e-4)
    return R_b_c


# --- adjustment -------------------------------------------------------------------------------

N_MOUNT, N_LENS = 6, 8
N_CAMERA = N_MOUNT + N_LENS
"""Columns of a camera: turn, lever arm, then f, xp, yp, k1, k2, k3, p1, p2; the last is a delay."""


def _adjusted(
    seen: Sightings,
    T_m_b: Pose,
    start: Mounted,
    velocity: Array | None,
) -> Mounted:
    """Return the robust adjustment from a start."""
    prior = _prior_sigma(seen.cameras, held=start.held, delayed=velocity is not None)
    if velocity is None:
        velocity = np.zeros((len(T_m_b), 3))
    best = state = replace(start, misfit=np.inf)
    for _ in range(STEPS):
        v, A, B = _linear(seen, T_m_b, state, velocity)
        misfit = size(v)
        worst = np.quantile(np.nan_to_num(np.abs(v), nan=np.inf), WORST, method="higher")
        state = replace(state, misfit=misfit, worst=float(worst))
        settled = misfit > (1 - SETTLED) * best.misfit
        best = state if misfit < best.misfit else best
        if settled or not np.isfinite(misfit):
            break
        try:
            dx, x_m = _step(seen, state, (v, A, B), prior)
        except np.linalg.LinAlgError:  # a point that nearly parallel rays leave open
            break
        if not np.all(np.isfinite(dx)):
            break
        state = _moved(state, dx, x_m)
    return best


def size(v: Array) -> float:
    """Return the robust size of residuals in two components, per component.

    Parameters
    ----------
    v : ndarray, shape (n, 2)
        Radians; NaN counts as infinite.
    """
    u = np.nan_to_num(np.abs(v), nan=np.inf)
    each = np.quantile(u, QUANTILE, axis=0, method="higher") / NORMAL
    return float(np.sqrt(np.mean(each**2)))


def measuring_noise(seen: Sightings, T_m_b: Pose, found: Mounted) -> float:
    """Return what rays miss their points by when every exposure is turned and moved freely.

    Returns
    -------
    float
        Standard deviation of a component, median of the exposures, radians; NaN where none has
        measurements enough.
    """
    v, A, B = _linear(seen, T_m_b, found, np.zeros((len(T_m_b), 3)))
    ok = np.all(np.isfinite(v), axis=1)
    variances = []
    for exposure in range(len(T_m_b)):
        own = np.flatnonzero(ok & (seen.exposure_idx == exposure))
        cameras = np.unique(seen.camera_idx[own])
        if 2 * len(own) < FREE_POSE + ENOUGH_LEFT or len(cameras) != 1:
            continue
        c = N_CAMERA * int(cameras[0])
        J = np.concatenate([A[own, :, c : c + 3], B[own]], axis=2).reshape(-1, FREE_POSE)
        left = v[own].ravel() - J @ np.linalg.lstsq(J, v[own].ravel(), rcond=None)[0]
        variances.append(left @ left / (len(left) - FREE_POSE))
    return float(np.sqrt(np.median(variances))) if variances else np.nan


def _prior_sigma(cameras: tuple[Camera, ...], *, held: bool, delayed: bool) -> Array:
    """Return prior standard deviations of the unknowns; what is held has a tiny one."""
    out = []
    for camera in cameras:
        f, r = camera.interior.f, 0.5 * camera.diagonal_px * camera.pixel_mm
        lens = [0.01 / r**2, 0.01 / r**4, 0.01 / r**6, 0.002 / r, 0.002 / r]
        lever, focal = (1e-6, 1e-6) if held else (LEVER_M, 0.01 * f)
        out += [*[10.0] * 3, *[lever] * 3, focal, 0.005 * f, 0.005 * f, *lens]
    return np.array([*out, DELAY_S if delayed else 1e-9])


def _linear(
    seen: Sightings, T_m_b: Pose, state: Mounted, velocity: Array
) -> tuple[Array, Array, Array]:
    """Return residuals (n, 2) and derivatives by the unknowns (n, 2, p) and the points (n, 2, 3).

    All divided by the declared focal length, so in radians.
    """
    moved = Pose(R=T_m_b.R, r=T_m_b.r + state.delay_s * velocity)
    v, B = np.empty((len(seen), 2)), np.empty((len(seen), 2, 3))
    A = np.zeros((len(seen), 2, N_CAMERA * len(seen.cameras) + 1))
    for k, camera in enumerate(state.cameras):
        own = np.flatnonzero(seen.camera_idx == k)
        f, unit = camera.interior.f, seen.cameras[k].interior.f
        T_m_c = moved[seen.exposure_idx[own]] @ camera.T_b_c
        x_c = to_camera(T_m_c, state.x_m[seen.point_idx[own]])
        xy = xy_from_colrow(camera, seen.colrow[own])
        ideal = pinhole(f, x_c)
        v[own] = (ideal - correct(camera.interior, xy)) / unit
        by_x = pinhole_jacobian(f, x_c) / unit
        by_m = by_x @ np.swapaxes(T_m_c.R, -1, -2)
        by_lens = -correct_jacobian(camera.interior, xy)[:, :, :N_LENS] / unit
        by_lens[:, :, 0] = ideal / (f * unit)
        by_mount = [by_x @ skew(x_c), -by_x @ camera.T_b_c.R.T]
        A[own, :, N_CAMERA * k : N_CAMERA * (k + 1)] = np.concatenate([*by_mount, by_lens], axis=2)
        A[own, :, -1] = -transform(by_m, velocity[seen.exposure_idx[own]])
        B[own] = by_m
    return v, A, B


def _step(
    seen: Sightings, state: Mounted, linear: tuple[Array, Array, Array], prior: Array
) -> tuple[Array, Array]:
    """Return one reweighted step of the unknowns, and the moved points, which are eliminated."""
    u = np.nan_to_num(np.linalg.norm(linear[0], axis=1), nan=np.inf) / (WIDTH * state.misfit)
    v, A, B = (np.nan_to_num(part) for part in linear)
    weight = (np.square(1 / (1 + u**2)) / state.misfit**2)[:, None, None]
    WA, WB = weight * A, weight * B
    N = np.einsum("nki,nkj->ij", WA, A, optimize=True) + np.diag(prior**-2)
    h = np.einsum("nki,nk->i", WA, v)
    declared = _from_declared(seen, state)
    h[: len(declared)] += declared / prior[: len(declared)] ** 2
    C, D, g = (np.zeros((len(seen.x_m), 3, *more)) for more in ((3,), (len(h),), ()))
    np.add.at(C, seen.point_idx, np.swapaxes(WB, 1, 2) @ B)
    np.add.at(D, seen.point_idx, np.swapaxes(WB, 1, 2) @ A)
    np.add.at(g, seen.point_idx, np.einsum("nki,nk->ni", WB, v))
    surveyed = np.isfinite(seen.x_m[:, 0])
    C += np.where(surveyed, HELD, LOOSE)[:, None, None] * np.eye(3)
    DC = np.linalg.solve(C, D)
    N -= np.einsum("pki,pkj->ij", D, DC, optimize=True)
    h -= np.einsum("pki,pk->i", DC, g)
    dx = -np.linalg.solve(N, h)
    step = np.linalg.solve(C, (g + D @ dx)[..., None])[..., 0]
    return dx, np.where(surveyed[:, None], state.x_m, state.x_m - step)


def _from_declared(seen: Sightings, state: Mounted) -> Array:
    """Return by how much the unknowns differ from what is declared; a turn is free."""
    out = np.zeros(N_CAMERA * len(seen.cameras) + 1)
    for k, (own, given) in enumerate(zip(state.cameras, seen.cameras, strict=True)):
        c = N_CAMERA * k
        out[c + 3 : c + N_MOUNT] = own.T_b_c.r - given.T_b_c.r
        lens = own.interior.to_array() - given.interior.to_array()
        out[c + N_MOUNT : c + N_CAMERA] = lens[:N_LENS]
    out[-1] = state.delay_s
    return out


def _moved(state: Mounted, dx: Array, x_m: Array) -> Mounted:
    cameras = []
    for k, camera in enumerate(state.cameras):
        d = dx[N_CAMERA * k : N_CAMERA * (k + 1)]
        turn = d[:3] * min(1.0, LARGEST_TURN / max(float(np.linalg.norm(d[:3])), 1e-300))
        lens = camera.interior.to_array()
        lens[:N_LENS] += d[N_MOUNT:]
        lens[0] = max(lens[0], 0.5 * camera.interior.f)
        mount = Pose(R=camera.T_b_c.R @ exp(turn), r=camera.T_b_c.r + d[3:N_MOUNT])
        cameras.append(replace(camera, interior=Interior.from_array(lens), T_b_c=mount))
    return replace(state, cameras=tuple(cameras), x_m=x_m, delay_s=state.delay_s + float(dx[-1]))


# --- Readings of a block with a number that must be found first: how much was moved, scaled
# or late
#
# Each is a pattern in the residuals. Its size is estimated together with mounting and lens, so
# that what these absorb of it is no part of it, and then undone in the measurements or in control.


ROUNDS = 2
"""How often the sizes of a pattern are estimated, each time after an adjustment without it."""

LEAST_SURVEYED = 4
"""Number of surveyed points from which they may be moved or scaled."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pattern:
    """What a mistake makes of the measurements or of the surveyed points.

    Attributes
    ----------
    name : str
        With places for the sizes.
    by_image, by_point : ndarray, shape (n, 2, k) or (n_points, 3, k)
        Image coordinates, radians, or meters, per unit of each size; one of them is empty.
    units : tuple of float
        By which the sizes are multiplied for the name.
    """

    name: str
    units: tuple[float, ...]
    by_image: Array | None = None
    by_point: Array | None = None


def readings(block: Block, seen: Sightings, given: Mounted) -> Iterator[tuple[Reading, Mounted]]:
    """Yield the readings with a fitted number, each with the cameras that fit it.

    Parameters
    ----------
    block : Block
    seen : Sightings
        Of the block.
    given : Mounted
        The cameras that fit the numbers as they are.
    """
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    if not np.isfinite(given.misfit):
        return
    for pattern in (*_of_control(seen), *_of_images(block, seen, T_m_b, given)):
        yield _fitted(pattern, seen, T_m_b, given)


def _fitted(
    pattern: _Pattern, seen: Sightings, T_m_b: Pose, given: Mounted
) -> tuple[Reading, Mounted]:
    """Return the reading without a pattern, and the cameras that fit it."""
    total, undone, found = np.zeros(len(pattern.units)), seen, given
    for _ in range(ROUNDS):
        total = total + _pattern_sizes(
            undone, T_m_b, found, _in_residuals(pattern, seen, T_m_b, found)
        )
        undone = _without(pattern, seen, total)
        found = mounted(undone, T_m_b)
    shown = (unit * size for unit, size in zip(pattern.units, total, strict=True))
    quantity = "image" if pattern.by_point is None else "position"
    name = pattern.name.format(*shown)
    return Reading(name=name, quantity=quantity, seen=undone, T_m_b=T_m_b), found


def _in_residuals(pattern: _Pattern, seen: Sightings, T_m_b: Pose, found: Mounted) -> Array:
    """Return what a pattern adds to the residuals, radians, shape (n, 2, k)."""
    if pattern.by_image is not None:
        return -pattern.by_image
    by_point = np.zeros((len(seen.x_m), 3, 1)) if pattern.by_point is None else pattern.by_point
    return _derivatives(seen, T_m_b, found) @ by_point[seen.point_idx]


def _without(pattern: _Pattern, seen: Sightings, sizes: Array) -> Sightings:
    """Return the sightings with a pattern of these sizes added."""
    if pattern.by_point is not None:
        return replace(seen, x_m=seen.x_m + pattern.by_point @ sizes)
    if pattern.by_image is None:
        return seen
    scale = np.array([c.interior.f / c.pixel_mm for c in seen.cameras])[seen.camera_idx]
    moved = scale[:, None] * (pattern.by_image @ sizes) * np.array([1.0, -1.0])
    return replace(seen, colrow=seen.colrow + moved)


def _of_control(seen: Sightings) -> Iterator[_Pattern]:
    """Yield surveyed points of another epoch, and of another scale."""
    surveyed: Mask = np.isfinite(seen.x_m[:, 0])
    if surveyed.sum() < LEAST_SURVEYED:
        return
    shift = np.zeros((len(surveyed), 3, 2))
    shift[surveyed] = np.eye(3)[:, :2]
    yield _Pattern(
        name="control points moved by {:+.2f} m east and {:+.2f} m north, as from another epoch,",
        units=(1.0, 1.0),
        by_point=shift,
    )
    scale = np.zeros((len(surveyed), 3, 1))
    scale[surveyed, :2, 0] = seen.x_m[surveyed, :2] - seen.x_m[surveyed, :2].mean(axis=0)
    yield _Pattern(
        name="control points scaled by {:+.0f} ppm, as from the ground to the grid,",
        units=(1e6,),
        by_point=scale,
    )


def _of_images(block: Block, seen: Sightings, T_m_b: Pose, given: Mounted) -> Iterator[_Pattern]:
    """Yield pixels that are not square, and rows that were read out one after the other."""
    xy, height = np.empty((len(seen), 2)), np.empty(len(seen))
    for k, camera in enumerate(seen.cameras):
        own = seen.camera_idx == k
        xy[own] = xy_from_colrow(camera, seen.colrow[own]) / camera.interior.f
        height[own] = camera.height_px
    wider = np.zeros((len(seen), 2, 1))
    wider[:, 0, 0] = xy[:, 0]
    yield _Pattern(name="pixels that are {:+.2f} % wider than high", units=(100.0,), by_image=wider)
    velocity = velocities(block, seen)
    if velocity is not None:
        share = (seen.colrow[:, 1] - (height - 1) / 2) / height
        moved = _derivatives(seen, T_m_b, given) @ velocity[seen.exposure_idx][:, :, None]
        yield _Pattern(
            name="rows read out one after the other, a rolling shutter of {:+.0f} ms,",
            units=(-1000.0,),
            by_image=share[:, None, None] * moved,
        )
