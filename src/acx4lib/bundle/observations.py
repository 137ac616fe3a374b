"""Observations of a bundle besides image points: `besides_rays` has an equation for each kind.

Surveyed points, poses by GNSS and INS with their systematic and slowly changing errors, pictures
that share a pose, declared mountings and interior orientations. `least_squares.statistics` has the
weights of slowly changing errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block, SurveyedPoints, Trajectory
from acx4lib.bundle.unknowns import Layout, State
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, exp, log, log_jacobian, transform
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.least_squares.normal_equations import Equations
from acx4lib.least_squares.statistics import Correlation, SlowErrors

# --- The strips of a block, and how the body moves along them


@dataclass(frozen=True, kw_only=True, eq=False)
class Strips:
    """The strips along which observed positions may drift.

    Attributes
    ----------
    names : tuple of str
        n_strips names.
    idx : ndarray, shape (n_poses,), or (1,) where there are no strips
        The strip of each pose, -1 for none.
    elapsed : ndarray, shape as `idx`
        Time since the mean time of the strip's exposures.
    unit : str
        Unit of the time: ``"s"``, or ``"exposure"`` where only the order is known.
    """

    names: tuple[str, ...] = ()
    idx: Index = field(default_factory=lambda: np.full(1, -1))
    elapsed: Array = field(default_factory=lambda: np.zeros(1))
    unit: str = "s"


# --- Pictures of an exposure that do not share its pose


ONE_PLACE_M = 1e-3
"""Standard deviation of the place of every picture: so small that turns also absorb shifts."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Pictures:
    """Poses of single pictures; those of one exposure are nearly equal.

    Attributes
    ----------
    first : ndarray, shape (n_poses,)
        The pose of the exposure's first picture.
    turns : ndarray, shape (3,)
        Standard deviation of the turn of every picture, about the body's axes, radians.
    """

    first: Index
    turns: Array


# --- Observed positions and attitudes: their systematic errors, and errors that change slowly


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class PoseObservations:
    """Observed positions and attitudes of poses.

    Attributes
    ----------
    T_m_b : Pose
        n_poses observed poses.
    R_g_m : ndarray, shape (n_poses, 3, 3)
        Mapping axes to the axes along which position sigma is given.
    sigma_position : ndarray, shape (n_poses, 3)
        m; infinite where a position is not observed.
    sigma_attitude : ndarray, shape (n_poses, 3)
        About the pose's own axes, radians; infinite where an attitude is not observed.
    strips : Strips
        Strips along which positions drift; none by default.
    velocity : ndarray, shape (n_poses, 3), or (1, 3)
        Along the grid's axes, m/s, needed where a delay is estimated; zero by default.
    slow_positions, slow_attitudes : SlowErrors, optional
        The correlated part of their errors; none by default.
    pictures : Pictures, optional
        Where poses are those of pictures, several at an exposure.

    Raises
    ------
    ValueError
        Where a part has another shape, or a sigma is not positive.
    """

    T_m_b: Pose
    R_g_m: Array
    sigma_position: Array
    sigma_attitude: Array
    strips: Strips = field(default_factory=Strips)
    velocity: Array = field(default_factory=lambda: np.zeros((1, 3)))
    slow_positions: SlowErrors | None = None
    slow_attitudes: SlowErrors | None = None
    pictures: Pictures | None = None

    def __post_init__(self) -> None:
        n = len(self.T_m_b)
        expected.shape("R_g_m", self.R_g_m, (n, 3, 3))
        for name in ("sigma_position", "sigma_attitude"):
            expected.shape(name, getattr(self, name), (n, 3))
            expected.positive(name, getattr(self, name))

    @cached_property
    def of_positions(self) -> Correlation | None:
        """Correlation of the positions' errors; None where they are independent."""
        slow = self.slow_positions
        return None if slow is None else slow.correlation(self.sigma_position)

    @cached_property
    def of_attitudes(self) -> Correlation | None:
        """Correlation of the attitudes' errors; None where they are independent."""
        slow = self.slow_attitudes
        return None if slow is None else slow.correlation(self.sigma_attitude)

    @cached_property
    def by_heading(self) -> Array:
        """Sine and cosine of the observed headings, from north over east, shape (n_poses, 2)."""
        ahead = self.T_m_b.R[:, :2, 0]
        return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)

    @property
    def linked(self) -> Index:
        """Pairs of poses whose errors are correlated, shape (k, 2)."""
        pairs = [np.zeros((0, 2), dtype=np.intp)]
        for correlation in (self.of_positions, self.of_attitudes):
            if correlation is not None:
                pairs.append(np.stack([correlation.first, correlation.second], axis=1))
        if self.pictures is not None:
            first = self.pictures.first
            pairs.append(np.argwhere(first[:, None] == first))
        return np.concatenate(pairs)


def slow_errors(
    trajectory: Trajectory, of: str, rows: Index | slice = slice(None)
) -> SlowErrors | None:
    """Return the slowly changing part of a trajectory's errors; None if its share is zero.

    The process continues from strip to strip: correlation across a turn depends only on the
    turn's duration.

    Parameters
    ----------
    trajectory : Trajectory
    of : str
        ``"position"`` or ``"attitude"``.
    rows : ndarray or slice
        Exposures, all by default; they may come twice.

    Raises
    ------
    AdjustmentError
        Where an exposure has no time.
    """
    process: GaussMarkov = getattr(trajectory, f"slow_{of}s")
    sigma: Array = getattr(trajectory, f"sigma_{of}")[rows]
    if process.share == 0:
        return None
    if not has_times(trajectory):
        msg = f"correlated errors of {of}s need times: trajectory.csv needs its column time_s"
        raise AdjustmentError(msg)
    return SlowErrors(
        sigma=process.share * np.where(np.isfinite(sigma), sigma, 0.0),
        together=process.together(trajectory.time_s[rows]),
    )


def observed_poses(
    trajectory: Trajectory,
    rows: Index,
    *,
    turns: Array | None,
    strips: Strips,
    velocity: Array,
) -> PoseObservations:
    """Return the observations of poses by a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
    rows : ndarray, shape (n_poses,)
        The exposure of every pose.
    turns : ndarray, shape (3,), or None
        Of pictures, as in `Pictures`, where each picture has a pose; None where each exposure has.
        The trajectory observes the first picture of an exposure.
    strips : Strips
    velocity : ndarray
        Of the exposures, as `strips_of` and `velocities` return them.
    """
    pictures, later = None, np.zeros(len(rows), dtype=bool)
    if turns is not None:
        _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
        pictures = Pictures(first=first[inverse], turns=turns)
        later = pictures.first != np.arange(len(rows))
        if strips.names:
            strips = replace(strips, idx=strips.idx[rows], elapsed=strips.elapsed[rows])
        if len(velocity) > 1:
            velocity = velocity[rows]
    return PoseObservations(
        T_m_b=trajectory.T_m_b[rows],
        R_g_m=trajectory.R_g_m[rows],
        sigma_position=np.where(later[:, None], np.inf, trajectory.sigma_position[rows]),
        sigma_attitude=np.where(later[:, None], np.inf, trajectory.sigma_attitude[rows]),
        strips=strips,
        velocity=velocity,
        slow_positions=slow_errors(trajectory, "position", rows),
        slow_attitudes=slow_errors(trajectory, "attitude", rows),
        pictures=pictures,
    )


def position_errors(observed: PoseObservations, state: State) -> Array:
    """Return the systematic errors of observed positions along the grid's axes, m.

    Observed is true, plus the shift, plus drift times elapsed time, plus velocity times delay: a
    delay is the time by which a position is recorded late.

    Parameters
    ----------
    observed : PoseObservations
    state : State
        Its shift, m; drift, m per unit of time; and delay, s.

    Returns
    -------
    ndarray, shape (n_poses, 3), or (1, 3) where there are neither strips nor delays
    """
    strips = observed.strips
    drift: Array = np.vstack([state.drift, np.zeros(3)])[strips.idx]
    errors: Array = strips.elapsed[:, None] * drift
    return state.shift + errors + state.delay * observed.velocity


def deviating(observed: PoseObservations, state: State) -> Array:
    """Return the deviations of recorded headings as rotations about the mapping frame's z."""
    larger = observed.by_heading @ state.deviation
    return exp(np.outer(larger, [0.0, 0.0, -1.0]))  # clockwise


def strips_of(block: Block) -> Strips:
    """Return the strips of a block that have exposures at two times or more.

    The time is that of the trajectory; where it has none, the order of the exposures.
    """
    trajectory = block.trajectory
    strip = np.full(len(trajectory), "", dtype=object)
    strip[block.images.exposure_idx] = block.images.strips
    timed = has_times(trajectory)
    names: list[str] = []
    idx, elapsed = np.full(len(trajectory), -1), np.zeros(len(trajectory))
    for name in filter(None, dict.fromkeys(strip)):
        rows = np.flatnonzero(strip == name)
        time = trajectory.time_s[rows] if timed else np.arange(len(rows), dtype=float)
        if np.ptp(time) > 0:
            idx[rows], elapsed[rows] = len(names), time - time.mean()
            names.append(str(name))
    return Strips(names=tuple(names), idx=idx, elapsed=elapsed, unit="s" if timed else "exposure")


# --- velocities ------------------------------------------------------------------------------


STRAIGHT = 0.2
"""Root mean square distance of exposures from uniform motion on a line, over the length of their
strip, above which they have no common velocity."""


def velocities(block: Block) -> Array:
    """Return the velocity of every exposure, that of its strip, along the grid's axes, m/s, (n, 3).

    Raises
    ------
    AdjustmentError
        Where an exposure has no time, no neighbour in its strip, or the time of its neighbour, or
        where a strip is not straight.

    Notes
    -----
    It is the slope of the line that fits the recorded positions of a strip over time. The velocity
    between neighbours would have errors: wind and the moment of exposure move one position against
    the next, within a second or two. These errors would make an estimated delay too small, the more
    so the steadier the flight.
    """
    trajectory, strips, cannot = block.trajectory, strips_of(block), "a delay cannot be estimated"
    if not has_times(trajectory):
        raise AdjustmentError(f"{cannot}: trajectory.csv needs its column time_s")
    alone = np.flatnonzero(strips.idx < 0)
    if len(alone):
        first = trajectory.exposures[alone[0]]
        msg = f"{cannot}: no neighbour in a strip tells the velocity of exposure {first!r}"
        raise AdjustmentError(msg)
    velocity = np.zeros((len(trajectory), 3))
    for strip, name in enumerate(strips.names):
        rows = np.flatnonzero(strips.idx == strip)
        r, elapsed = trajectory.T_m_b.r[rows], strips.elapsed[rows]
        if len(np.unique(elapsed)) < len(rows):
            raise AdjustmentError(f"{cannot}: two exposures of strip {name!r} have the same time")
        along: Array = elapsed @ r / (elapsed @ elapsed)
        deviations = r - r.mean(axis=0) - elapsed[:, None] * along
        length = np.linalg.norm(along) * np.ptp(elapsed)
        if np.sqrt(np.mean(np.sum(deviations**2, axis=1))) > STRAIGHT * length:
            raise AdjustmentError(f"{cannot}: strip {name!r} is not flown straight at one speed")
        velocity[rows] = along
    return transform(trajectory.R_g_m, velocity)


def has_times(trajectory: Trajectory) -> bool:
    """Tell whether all exposures have a time."""
    return bool(np.isfinite(trajectory.time_s).all())


# --- Slowly changing errors that different exposures of a trajectory have in common


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedErrors:
    """Covariances between body poses of n exposures; `Trajectory.cov` has those of each pose.

    Attributes
    ----------
    roots : ndarray, shape (n, 6, 6)
        Axes of a pose's errors, columns, times the sigma of their slow part: m and radians.
    together : ndarray, shape (2, n, n)
        Correlation of the slow parts of positions and of attitudes; zero of an exposure with
        itself.
    """

    roots: Array
    together: Array

    def __post_init__(self) -> None:
        n = len(self.roots)
        expected.shape("roots", self.roots, (n, 6, 6))
        expected.shape("together", self.together, (2, n, n))

    def between(self, first: Index, second: Index) -> Array:
        """Return the covariances of pairs of poses, shape (k, 6, 6); zero of one with itself."""
        related = np.repeat(self.together[:, first, second].T, 3, axis=1)
        return (self.roots[first] * related[:, None]) @ np.swapaxes(self.roots[second], 1, 2)

    def among(self, J: Array) -> Array:
        """Return the part of a covariance that is between exposures: sum of J_i C_ij J_j^T.

        Parameters
        ----------
        J : ndarray, shape (n, q, 6)
            Derivatives of q quantities by the pose of every exposure.

        Returns
        -------
        ndarray, shape (q, q)
        """
        along = np.moveaxis(J @ self.roots, 0, 1)  # (q, n, 6)
        q, n, _ = along.shape
        cov = np.zeros((q, q))
        for related, part in zip(self.together, (along[:, :, :3], along[:, :, 3:]), strict=True):
            cov += np.reshape(related @ part, (q, 3 * n)) @ np.reshape(part, (q, 3 * n)).T
        return cov


def shared_errors(trajectory: Trajectory, rows: Index | slice = slice(None)) -> SharedErrors | None:
    """Return covariances between the exposures of a trajectory; None where errors are independent.

    Parameters
    ----------
    trajectory : Trajectory
    rows : ndarray or slice
        Exposures, all by default.

    Raises
    ------
    AdjustmentError
        Where an exposure has no time.
    """
    parts = [slow_errors(trajectory, kind, rows) for kind in ("position", "attitude")]
    if not any(parts):
        return None
    R_m_g = np.swapaxes(trajectory.R_g_m[rows], 1, 2)
    n = len(R_m_g)
    roots, together = np.zeros((n, 6, 6)), np.zeros((2, n, n))
    for i, (slow, axes) in enumerate(zip(parts, (R_m_g, np.eye(3)), strict=True)):
        if slow is not None:
            part = slice(3 * i, 3 * i + 3)
            roots[:, part, part] = axes * slow.sigma[:, None]
            together[i] = slow.together - np.diag(np.diagonal(slow.together))
    return SharedErrors(roots=roots, together=together)


# --- the equations ----------------------------------------------------------------------------


def besides_rays(
    block: Block,
    control: SurveyedPoints,
    observed: PoseObservations,
    state: State,
    columns: Layout,
) -> Iterator[Equations]:
    """Linearise what is observed besides the rays: v = estimated - observed.

    Control points and positions are observed along the grid's axes; attitudes, turns and declared
    mountings about the body's axes.

    Parameters
    ----------
    block : Block
        With the cameras as declared.
    control : SurveyedPoints
        Those that are not held.
    observed : PoseObservations
    state : State
    columns : Layout

    Yields
    ------
    Equations
        Kinds ``control_point``, ``gnss``, ``attitude``; where pictures have poses of their own,
        ``place`` and ``turn``; of what is declared with sigma and estimated, ``lever_arm``,
        ``boresight``, ``interior``.

    Notes
    -----
    The recorded heading, clockwise about the vertical, is larger by a deviation: the first harmonic
    of the observed heading, B sin + C cos, like that of a compass [1]_. Places and turns of
    pictures are observed as those of the first of their exposure, whose error is common to all.

    References
    ----------
    .. [1] A. Smith and F. J. Evans, "Admiralty manual for the deviations of the compass", 1862.
    """
    eye, strips, pose = np.eye(3), observed.strips, columns.pose
    drift = np.vstack([columns.drift, np.full((1, 3), -1)])[strips.idx]
    yield Equations(
        kind="control_point",
        v=transform(control.R_g_m, state.x_m[control.point_idx] - control.x_m),
        # a single component that is given without error gets a sigma of one micrometre
        sigma=np.maximum(control.sigma_m, 1e-6),
        A=np.zeros((len(control), 3, 0)),
        columns=np.zeros((1, 0), dtype=np.intp),
        unit=np.zeros(len(control), dtype=np.intp),
        B=control.R_g_m,
        point=control.point_idx,
    )
    off = transform(observed.R_g_m, state.T_m_b.r - observed.T_m_b.r)
    yield _linearised(
        "gnss",
        off + position_errors(observed, state),
        observed.sigma_position,
        (observed.R_g_m, pose[:, :3]),
        (eye, columns.shift),
        (strips.elapsed[:, None, None] * eye, drift),
        (observed.velocity[:, :, None], columns.delay),
        correlation=observed.of_positions,
    )
    recorded = state.T_m_b.R
    if deviates := np.any(columns.deviation >= 0):
        recorded = deviating(observed, state) @ recorded
    v = log(np.swapaxes(observed.T_m_b.R, -1, -2) @ recorded)
    J = log_jacobian(v)
    terms = [(J, pose[:, 3:])]
    if deviates:
        vertical = recorded[:, 2, :, None]  # the mapping frame's z in the body
        terms.append((-(J @ vertical) * observed.by_heading[:, None], columns.deviation))
    yield _linearised(
        "attitude", v, observed.sigma_attitude, *terms, correlation=observed.of_attitudes
    )
    if observed.pictures is not None:
        yield from _pictures(observed.pictures, state.T_m_b, pose)
    for kind in DECLARED:
        rows, sigma, where = declared(block.cameras, kind, columns)
        if not len(rows):
            continue
        A, before = eye, [block.cameras[k] for k in rows]
        if kind == "lever_arm":
            v = state.T_b_c.r[rows] - np.array([camera.T_b_c.r for camera in before])
        elif kind == "boresight":
            R = np.array([camera.T_b_c.R for camera in before])
            turned = log(np.swapaxes(R, -1, -2) @ state.T_b_c.R[rows])
            v, A = transform(R, turned), R @ log_jacobian(turned)
        else:
            estimated = np.array([state.interiors[k].to_array()[:3] for k in rows])
            v = estimated - np.array([camera.interior.to_array()[:3] for camera in before])
        yield _linearised(kind, v, sigma, (A, where))


def _linearised(
    kind: str,
    v: Array,
    sigma: Array,
    *terms: tuple[Array, Index],
    correlation: Correlation | None = None,
) -> Equations:
    """Return equations of derivatives and their columns; terms that are held are left out."""
    n = len(v)
    free = [terms[0], *(term for term in terms[1:] if np.any(term[1] >= 0))]
    return Equations(
        kind=kind,
        v=v,
        sigma=sigma,
        A=np.concatenate([np.broadcast_to(A, (n, *A.shape[-2:])) for A, _ in free], axis=2),
        columns=np.concatenate(
            [np.broadcast_to(where, (n, where.shape[-1])) for _, where in free], axis=1
        ),
        unit=np.arange(n),
        correlation=correlation,
    )


def _pictures(pictures: Pictures, T_m_b: Pose, pose: Index) -> Iterator[Equations]:
    """Linearise places and turns of pictures against the first picture of their exposure."""
    later = np.flatnonzero(pictures.first != np.arange(len(pictures.first)))
    first = pictures.first[later]
    same_exposure = (first[:, None] == first).astype(float)
    place = T_m_b.r[later] - T_m_b.r[first]
    turned = np.swapaxes(T_m_b.R[first], -1, -2) @ T_m_b.R[later]
    turn = log(turned)
    J, eye = log_jacobian(turn), np.eye(3)
    by_first = -J @ np.swapaxes(turned, -1, -2)
    for kind, v, one, later_term, first_term in (
        ("place", place, ONE_PLACE_M, (eye, pose[later, :3]), (-eye, pose[first, :3])),
        ("turn", turn, pictures.turns, (J, pose[later, 3:]), (by_first, pose[first, 3:])),
    ):
        own = np.broadcast_to(one, v.shape)
        sigma = np.sqrt(2) * own
        correlation = SlowErrors(sigma=own, together=same_exposure).correlation(sigma)
        yield _linearised(kind, v, sigma, later_term, first_term, correlation=correlation)


DECLARED = ("lever_arm", "boresight", "interior")
"""Kinds of observations that are parts of a declared camera: of the interior, f, xp and yp."""


def declared(cameras: Sequence[Camera], kind: str, columns: Layout) -> tuple[Index, Array, Index]:
    """Return the cameras with a part that is declared with sigma and estimated.

    Parameters
    ----------
    cameras : sequence of Camera
    kind : str
        One of `DECLARED`.
    columns : Layout

    Returns
    -------
    rows : ndarray, shape (k,)
        Indices of these cameras.
    sigma : ndarray, shape (k, 3)
        m, radians or mm; infinite where a component is held.
    where : ndarray, shape (k, 3)
        Columns of the components.
    """
    part = slice(3, 6) if kind == "boresight" else slice(0, 3)
    where = (columns.interior if kind == "interior" else columns.mount)[:, part]
    stated = [c.prior.interior if kind == "interior" else c.prior.sigma[part] for c in cameras]
    sigma = np.where(where >= 0, np.array(stated), np.inf)
    rows = np.flatnonzero(np.isfinite(sigma).any(axis=1))
    return rows, sigma[rows], where[rows]
