"""Reliability: the smallest errors that are found, and the effect of smaller ones (Baarda 1968).

Internal reliability depends on the redundancy numbers, external reliability on the effect of an
observation on the unknowns. Sigmas are a priori.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib import expected, shown
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.rejections import CRITICAL, POWER, noncentrality
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares.normal_equations import Equations, column_rows, point_normals
from acx4lib.least_squares.statistics import LEAST, Group

WEAK = 0.1
"""Redundancy number below which an observation is poorly controlled."""

NO_EFFECT = 1e-6
"""Effect on an unknown, in its sigmas per sigma of the observation, that is rounding error."""

ROUNDING = 1e-10
"""Redundancy number that may be rounding error."""

TOGETHER = 50_000
"""Number of observations of which the gains are computed together."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Reliability:
    """Reliability of one group of observations.

    Attributes
    ----------
    kind : str
    redundancy : ndarray, shape (m, d)
        Redundancy numbers; NaN for components that take no part.
    detectable : ndarray, shape (m, d)
        Minimal detectable error, in the unit of the observation; infinite without control.
    external : ndarray, shape (m, d)
        Largest effect of this error on any function of the unknowns, in sigmas of the function.
    """

    kind: str
    redundancy: Array
    detectable: Array
    external: Array


def reliability(group: Group, *, critical: float = CRITICAL, power: float = POWER) -> Reliability:
    """Return the reliability of a group of observations.

    Parameters
    ----------
    group : Group
        Residuals after the adjustment.
    critical, power : float
        As in `noncentrality`.

    Notes
    -----
    The minimal detectable error is delta_0 sigma / sqrt(r), the external reliability
    delta_0 sqrt((1 - r) / r), with the redundancy number r. Where errors are correlated,
    `Group.control` takes the place of r, and `Together.own` that of one.
    """
    delta_0 = noncentrality(critical=critical, power=power)
    known = np.isfinite(group.redundancy)
    r = np.where(known, np.clip(group.redundancy, 0.0, 1.0), np.nan)
    full_control = np.ones_like(r) if group.together is None else group.together.own
    control = np.where(known, np.clip(group.control, 0.0, full_control), np.nan)
    controlled = control > LEAST
    detectable, external = np.where(known, np.inf, np.nan), np.where(known, np.inf, np.nan)
    retained, absorbed = control[controlled], (full_control - control)[controlled]
    detectable[controlled] = delta_0 * group.sigma[controlled] / np.sqrt(retained)
    external[controlled] = delta_0 * np.sqrt(absorbed / retained)
    return Reliability(kind=group.kind, redundancy=r, detectable=detectable, external=external)


def parameter_effects(bundle: Bundle, columns: Index) -> list[Array]:
    """Return the effects of minimal detectable errors on some unknowns, in their sigmas.

    Parameters
    ----------
    bundle : Bundle
    columns : ndarray, shape (c,)
        Columns of the unknowns, by `Network.layout`.

    Returns
    -------
    list of ndarray, shape (m, d, c)
        For each group, the effect of such an error in one component; infinite where only this
        observation determines an unknown, apart from its own point.

    Notes
    -----
    The effect is delta_0 gamma / sqrt(r), with the gain gamma in sigmas. Where the observation's
    own point absorbs the error, both are small: gamma by sqrt(r_p), and r by r_p, the redundancy
    number with all unknowns except the point known. So r_p cancels, and is divided out where r is
    not above rounding.
    """
    network, solution = bundle.network, bundle.solution
    expected.shape("columns", columns)
    expected.places("columns", columns, network.n_columns)
    equations = network.equations(bundle.state)
    chosen = np.zeros((len(columns), network.n_columns))
    chosen[np.arange(len(columns)), columns] = 1.0
    derivatives = gains(equations, solution.inverse.times(chosen), network.free_points)
    sigma = np.sqrt(solution.inverse.at(columns, columns))
    out: list[Array] = []
    for e, derivative, group in zip(equations, derivatives, solution.groups, strict=True):
        bias = reliability(group).detectable
        finite = np.where(np.isfinite(bias), bias, np.where(group.used, group.sigma, 0.0))
        gain = derivative * finite[:, :, None] / sigma
        row, d = np.nonzero(np.isinf(bias))
        if len(row):
            own_control: Array = np.ones(len(row))
            if e.B is not None and e.point is not None:
                own_control = _own_control(equations, network.free_points, e, row, d)
            gain[row, d] = _hardly_controlled(gain[row, d], group.control[row, d], own_control)
        out.append(gain)
    return out


def _own_control(
    equations: Sequence[Equations], free_points: Mask, e: Equations, row: Index, d: Index
) -> Array:
    """Return redundancy numbers of components of a group where all but their points are known."""
    V, _ = point_normals(free_points, equations)
    point = np.asarray(e.point)[row]
    b = np.asarray(e.B)[row, d] / e.sigma[row, d, None]
    taken = np.einsum("ni,ni->n", b, np.linalg.solve(V[point], b[:, :, None])[:, :, 0])
    return np.where(free_points[point], np.clip(1.0 - taken, 0.0, 1.0), 1.0)


def _hardly_controlled(gain: Array, control: Array, own_control: Array) -> Array:
    """Return the effects of observations that hardly others control; `gain` in sigmas, (n, c)."""
    out = np.zeros_like(gain)
    moves = own_control > ROUNDING
    effect = gain[moves] / np.sqrt(own_control[moves])[:, None]
    share = np.maximum(control[moves] / own_control[moves], 0.0)
    finite = noncentrality() * effect / np.sqrt(np.maximum(share, LEAST))[:, None]
    unbounded = np.where(np.abs(effect) > NO_EFFECT, np.inf, 0.0)
    out[moves] = np.where(share[:, None] > LEAST, finite, unbounded)
    return out


def gains(equations: Sequence[Equations], cov: Array, free_points: Mask) -> list[Array]:
    """Return the derivatives of functions of adjusted unknowns by observations.

    Parameters
    ----------
    equations : sequence of Equations
        Linearised at the solution.
    cov : ndarray, shape (c, n_columns)
        J Q, of functions with the derivatives J by the unknowns, and the inverse Q of the reduced
        normal matrix.
    free_points : ndarray, shape (n_points,)

    Returns
    -------
    list of ndarray, shape (m, d, c)
        For each group, d(function) / d(observation).

    Notes
    -----
    They are Cov(y, l) P, with the covariance of functions y and adjusted observations l. Its part
    by the points is summed over the observations of each point.
    """
    directly = [_by_columns(e, cov) for e in equations]
    V, _ = point_normals(free_points, equations)
    total = np.zeros((len(V), 3, len(cov)))
    for e, part in zip(equations, directly, strict=True):
        if e.B is not None and e.point is not None:
            for piece in _pieces(len(part)):
                weighted = np.swapaxes(e.B[piece] / e.sigma[piece, :, None] ** 2, 1, 2)
                np.add.at(total, e.point[piece], weighted @ part[piece])
    cov_with_points = -np.linalg.solve(V, total)
    cov_with_points[~free_points] = 0.0
    for k, (e, part) in enumerate(zip(equations, directly, strict=True)):
        if e.B is not None and e.point is not None:
            for piece in _pieces(len(part)):
                part[piece] += e.B[piece] @ cov_with_points[e.point[piece]]
        directly[k] = e.weighed(part)
    return directly


def _pieces(n: int) -> Iterator[slice]:
    """Yield slices of n observations, so that products stay small in memory."""
    for begin in range(0, n, TOGETHER):
        yield slice(begin, begin + TOGETHER)


def _by_columns(e: Equations, cov: Array) -> Array:
    """Return A times the covariance of its unknowns with the functions."""
    return np.asarray(column_rows(cov.shape[1], e, e.A) @ cov.T).reshape(*e.v.shape, len(cov))


# --- One measured image point of an adjustment, with all terms of its equation


@dataclass(frozen=True, kw_only=True, eq=False)
class Ray:
    """A measured image point of an adjustment, with its estimates.

    Attributes
    ----------
    point, image : str
    camera : Camera
        With the estimated interior orientation and mounting.
    T_m_b, T_m_c : Pose
        Adjusted poses of the body and of the camera, ``T_m_c = T_m_b @ T_b_c``. Where the cameras
        are adjusted without a trajectory, `T_m_b` is the pose of the camera.
    x_m : ndarray, shape (3,)
        Adjusted place of the point, m.
    xy_mm : ndarray, shape (2,)
        Where it was measured, mm from the middle of the image.
    residual_px : ndarray, shape (2,)
        Estimated less measured, along columns to the right and rows down.
    """

    point: str
    image: str
    camera: Camera
    T_m_b: Pose
    T_m_c: Pose
    x_m: Array
    xy_mm: Array
    residual_px: Array

    def __repr__(self) -> str:
        x, y = self.xy_mm
        return f"point {self.point!r} in image {self.image!r}, measured at x {x:.4f}, y {y:.4f} mm"


def one_ray(bundle: Bundle, i: int = 0) -> Ray:
    """Return the i-th measurement that took part in an adjustment.

    Parameters
    ----------
    bundle : Bundle
    i : int
        From 0.

    Raises
    ------
    ValueError
        Where there are fewer.
    """
    network, points = bundle.network, bundle.network.image_points
    expected.whole("i", i, least=0)
    if i >= len(points):
        msg = f"i: expected less than {len(points)}, the number of measurements, got {i}"
        raise ValueError(msg)
    block, image, point = network.block, points.image_idx[i], points.point_idx[i]
    camera, T_m_c = bundle.cameras[block.images.camera_idx[image]], bundle.T_m_c[image]
    return Ray(
        point=block.points[point],
        image=block.images.names[image],
        camera=camera,
        T_m_b=T_m_c @ camera.T_b_c.inverse,
        T_m_c=T_m_c,
        x_m=bundle.state.x_m[point],
        xy_mm=xy_from_colrow(camera, points.colrow[i]),
        residual_px=bundle.solution.group("image_point").v[i],
    )
