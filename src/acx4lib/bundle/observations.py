"""Observations of a bundle besides image points.

Poses by GNSS and INS with the strips along which they drift, declared mountings and interior
orientations and surveyed points. `least_squares.statistics` has the weights of slowly
changing errors.
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
from acx4lib.geometry.camera import Camera, Interior
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


def picture_equations(
    pictures: Pictures | None, state: State, columns: Layout
) -> Iterator[Equations]:
    """Linearise shifts and turns of pictures against the first picture of their exposure.

    They are observed as zero. The error of the first picture is common to all of its exposure.
    """
    if pictures is None:
        return
    later = np.flatnonzero(pictures.first != np.arange(len(pictures.first)))
    first, n = pictures.first[later], len(later)
    same_exposure = (first[:, None] == first).astype(float)
    R, r = state.T_m_b.R, state.T_m_b.r
    turned = np.swapaxes(R[first], -1, -2) @ R[later]
    v = log(turned)
    by_turn = log_jacobian(v)
    pair_columns = np.concatenate([columns.pose[later], columns.pose[first]], axis=1)
    each = np.tile(np.eye(3), (n, 1, 1))
    for kind, difference, A, chosen, sigma_axes in (
        ("place", r[later] - r[first], [each, -each], [0, 1, 2, 6, 7, 8], np.full(3, ONE_PLACE_M)),
        (
            "turn",
            v,
            [by_turn, -by_turn @ np.swapaxes(turned, -1, -2)],
            [3, 4, 5, 9, 10, 11],
            pictures.turns,
        ),
    ):
        sigma = np.tile(sigma_axes, (n, 1))
        yield Equations(
            kind=kind,
            v=difference,
            sigma=np.sqrt(2) * sigma,
            A=np.concatenate(A, axis=2),
            columns=pair_columns[:, chosen],
            unit=np.arange(n),
            correlation=SlowErrors(sigma=sigma, together=same_exposure).correlation(
                np.sqrt(2) * sigma
            ),
        )


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
    velocity : ndarray, shape (n_poses, 3), optional
        Along the grid's axes, m/s, needed where a delay is estimated.
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
    velocity: Array | None = None
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
    velocity: Array | None,
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
    velocity : ndarray or None
        Of the exposures, as `strips_of` and `velocities` return them.
    """
    pictures, later = None, np.zeros(len(rows), dtype=bool)
    if turns is not None:
        _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
        pictures = Pictures(first=first[inverse], turns=turns)
        later = pictures.first != np.arange(len(rows))
        if strips.names:
            strips = replace(strips, idx=strips.idx[rows], elapsed=strips.elapsed[rows])
        if velocity is not None:
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
    of_strip: Array = np.vstack([state.drift, np.zeros(3)])[strips.idx]
    errors: Array = state.shift + strips.elapsed[:, None] * of_strip
    return errors if observed.velocity is None else errors + state.delay * observed.velocity


def position_equations(observed: PoseObservations, state: State, columns: Layout) -> Equations:
    """Linearise observed positions, along the grid's axes."""
    n, strips = len(state.T_m_b), observed.strips
    A, where = [observed.R_g_m], [columns.pose[:, :3]]
    if np.any(columns.shift >= 0):
        A.append(np.tile(np.eye(3), (n, 1, 1)))
        where.append(np.tile(columns.shift, (n, 1)))
    if len(columns.drift):
        A.append(strips.elapsed[:, None, None] * np.eye(3))
        where.append(np.vstack([columns.drift, np.full(3, -1)])[strips.idx])
    if observed.velocity is not None and columns.delay[0] >= 0:
        A.append(observed.velocity[:, :, None])
        where.append(np.tile(columns.delay, (n, 1)))
    v = transform(observed.R_g_m, state.T_m_b.r - observed.T_m_b.r)
    return Equations(
        kind="gnss",
        v=v + position_errors(observed, state),
        sigma=observed.sigma_position,
        A=np.concatenate(A, axis=2),
        columns=np.concatenate(where, axis=1),
        unit=np.arange(n),
        correlation=observed.of_positions,
    )


def deviating(observed: PoseObservations, state: State) -> Array:
    """Return the deviations of recorded headings as rotations about the mapping frame's z."""
    larger = observed.by_heading @ state.deviation
    return exp(np.outer(larger, [0.0, 0.0, -1.0]))  # clockwise


def attitude_equations(observed: PoseObservations, state: State, columns: Layout) -> Equations:
    """Linearise observed attitudes, about the body's axes.

    The observed heading, clockwise about the vertical, is larger by the deviation: the first
    harmonic of the observed heading, B sin + C cos, like the deviation of a compass [1]_.

    References
    ----------
    .. [1] A. Smith and F. J. Evans, "Admiralty manual for the deviations of the compass", 1862.
    """
    n, recorded = len(state.T_m_b), state.T_m_b.R
    deviates = bool(np.any(columns.deviation >= 0))
    if deviates:
        recorded = deviating(observed, state) @ recorded
    v = log(np.swapaxes(observed.T_m_b.R, -1, -2) @ recorded)
    by_turn = log_jacobian(v)
    A, where = [by_turn], [columns.pose[:, 3:]]
    if deviates:
        vertical = recorded[:, 2, :, None]  # the mapping frame's z in the body
        A.append(-(by_turn @ vertical) * observed.by_heading[:, None])
        where.append(np.tile(columns.deviation, (n, 1)))
    return Equations(
        kind="attitude",
        v=v,
        sigma=observed.sigma_attitude,
        A=np.concatenate(A, axis=2),
        columns=np.concatenate(where, axis=1),
        unit=np.arange(n),
        correlation=observed.of_attitudes,
    )


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
            names.append(name)
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
    trajectory, strips = block.trajectory, strips_of(block)
    _require_neighbours(block, strips)
    velocity = np.zeros((len(trajectory), 3))
    for strip, name in enumerate(strips.names):
        rows = np.flatnonzero(strips.idx == strip)
        rows = rows[np.argsort(strips.elapsed[rows], kind="stable")]
        step = np.diff(strips.elapsed[rows])
        if np.any(step <= 0):
            again = trajectory.exposures[rows[int(np.argmin(step)) + 1]]
            msg = f"a delay cannot be estimated: {again!r} has the time of another of its strip"
            raise AdjustmentError(msg)
        velocity[rows] = _uniform(trajectory.T_m_b.r[rows], strips.elapsed[rows], name)
    return transform(trajectory.R_g_m, velocity)


def _uniform(r: Array, elapsed: Array, strip: str) -> Array:
    """Return the velocity with which positions of a strip are passed at times from its middle."""
    velocity: Array = elapsed @ r / (elapsed @ elapsed)
    deviations = r - r.mean(axis=0) - elapsed[:, None] * velocity
    length = np.linalg.norm(velocity) * np.ptp(elapsed)
    if np.sqrt(np.mean(np.sum(deviations**2, axis=1))) > STRAIGHT * length:
        msg = (
            f"a delay cannot be estimated: strip {str(strip)!r} is not flown straight at one speed"
        )
        raise AdjustmentError(msg)
    return velocity


def has_times(trajectory: Trajectory) -> bool:
    """Tell whether all exposures have a time."""
    return bool(np.isfinite(trajectory.time_s).all())


def _require_neighbours(block: Block, strips: Strips) -> None:
    """Raise where an exposure has no time, or none before or after it in its strip."""
    cannot = "a delay cannot be estimated"
    if not has_times(block.trajectory):
        raise AdjustmentError(f"{cannot}: trajectory.csv needs its column time_s")
    alone = np.flatnonzero(np.broadcast_to(strips.idx, len(block.trajectory)) < 0)
    if len(alone):
        name = block.trajectory.exposures[alone[0]]
        subject = "exposure" if len(alone) == 1 else f"{len(alone)} exposures, the first"
        msg = f"{cannot}: no neighbour in a strip tells the velocity of {subject} {name!r}"
        raise AdjustmentError(msg)


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


# --- Declared mountings that have standard deviations, as observations of those estimated


def mounting_equations(
    cameras: Sequence[Camera], T_b_c: Pose, columns: Index
) -> Iterator[Equations]:
    """Linearise the declared mountings that have sigma: lever arms, then boresights.

    Both along the body's axes. Only those that are estimated are observations.

    Parameters
    ----------
    cameras : sequence of Camera
        As declared.
    T_b_c : Pose
        Estimates.
    columns : ndarray, shape (n_cameras, 6)
        Columns of the mountings.
    """
    if len(rows := observed_mountings(cameras, "lever_arm", columns)):
        yield Equations(
            kind="lever_arm",
            v=T_b_c.r[rows] - np.array([cameras[k].T_b_c.r for k in rows]),
            sigma=np.array([cameras[k].prior.lever_sigma for k in rows]),
            A=np.tile(np.eye(3), (len(rows), 1, 1)),
            columns=columns[rows, :3],
            unit=np.arange(len(rows)),
        )
    if len(rows := observed_mountings(cameras, "boresight", columns)):
        R_declared = np.array([cameras[k].T_b_c.R for k in rows])
        v = log(np.swapaxes(R_declared, -1, -2) @ T_b_c.R[rows])
        yield Equations(
            kind="boresight",
            v=transform(R_declared, v),
            sigma=np.array([cameras[k].prior.boresight_sigma for k in rows]),
            A=R_declared @ log_jacobian(v),
            columns=columns[rows, 3:],
            unit=np.arange(len(rows)),
        )


def observed_mountings(cameras: Sequence[Camera], part: str, columns: Index) -> Index:
    """Return the cameras with a part of the mounting estimated and declared with sigma.

    Parameters
    ----------
    cameras : sequence of Camera
    part : str
        ``"lever_arm"`` or ``"boresight"``.
    columns : ndarray, shape (n_cameras, 6)
        Columns of the mountings.
    """
    part_columns = columns[:, :3] if part == "lever_arm" else columns[:, 3:]
    sigma = np.array(
        [c.prior.lever_sigma if part == "lever_arm" else c.prior.boresight_sigma for c in cameras]
    )
    return np.flatnonzero(np.isfinite(sigma).any(axis=1) & np.all(part_columns >= 0, axis=1))


# --- Interior orientations known from a laboratory, as observations where they are estimated


def interior_equations(
    cameras: Sequence[Camera], interiors: Sequence[Interior], columns: Index
) -> Iterator[Equations]:
    """Linearise the declared f, xp and yp that have sigma; what is held is no observation.

    Parameters
    ----------
    cameras : sequence of Camera
        As declared.
    interiors : sequence of Interior
        Estimates.
    columns : ndarray, shape (n_cameras, 10)
        Columns of the interior orientations.
    """
    if len(rows := observed_interiors(cameras, columns)):
        sigma = np.array([cameras[k].prior.interior for k in rows])
        estimated = np.array([interiors[k].to_array()[:3] for k in rows])
        declared = np.array([cameras[k].interior.to_array()[:3] for k in rows])
        yield Equations(
            kind="interior",
            v=estimated - declared,
            sigma=np.where(columns[rows, :3] >= 0, sigma, np.inf),
            A=np.tile(np.eye(3), (len(rows), 1, 1)),
            columns=columns[rows, :3],
            unit=np.arange(len(rows)),
        )


def observed_interiors(cameras: Sequence[Camera], columns: Index) -> Index:
    """Return the cameras of which f, xp or yp is estimated and declared with sigma.

    Parameters
    ----------
    cameras : sequence of Camera
    columns : ndarray, shape (n_cameras, 10)
        Columns of the interior orientations.
    """
    sigma = np.array([camera.prior.interior for camera in cameras])
    return np.flatnonzero((np.isfinite(sigma) & (columns[:, :3] >= 0)).any(axis=1))


# --- Observations of points besides their rays: surveyed coordinates


def control_equations(control: SurveyedPoints, x_m: Array) -> Equations:
    """Linearise surveyed coordinates, along the grid's axes.

    Parameters
    ----------
    control : SurveyedPoints
    x_m : ndarray, shape (n_points, 3)
        All points of the block.
    """
    n = len(control)
    return Equations(
        kind="control_point",
        v=transform(control.R_g_m, x_m[control.point_idx] - control.x_m),
        # a single component that is given without error gets a sigma of one micrometre
        sigma=np.maximum(control.sigma_m, 1e-6),
        A=np.zeros((n, 3, 0)),
        columns=np.zeros((1, 0), dtype=np.intp),
        unit=np.zeros(n, dtype=np.intp),
        B=control.R_g_m,
        point=control.point_idx,
    )
