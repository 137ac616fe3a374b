"""Observed positions and attitudes: their systematic errors, and errors that change slowly."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from acx4lib import expected, shown
from acx4lib.bundle.observations.strips import Motion, Strips, has_times
from acx4lib.bundle.unknowns import Layout, State
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Trajectory
from acx4lib.geometry.frames import Pose, exp, log, log_jacobian, transform
from acx4lib.least_squares.problem import Equations
from acx4lib.least_squares.statistical.correlated import Correlation, SlowErrors
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov


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
    motion : Motion, optional
        Velocity and rate of rotation, needed where a delay is estimated.
    slow_positions, slow_attitudes : SlowErrors, optional
        The correlated part of their errors; none by default.

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
    motion: Motion | None = None
    slow_positions: SlowErrors | None = None
    slow_attitudes: SlowErrors | None = None

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

    @property
    def linked(self) -> Index:
        """Pairs of poses whose errors are correlated, shape (k, 2)."""
        found = [np.zeros((0, 2), dtype=np.intp)]
        for correlation in (self.of_positions, self.of_attitudes):
            if correlation is not None:
                found.append(np.stack([correlation.first, correlation.second], axis=1))
        return np.concatenate(found)


def unobserved(T_m_b: Pose) -> PoseObservations:
    """Return poses without any observation."""
    open_sigma = np.full((len(T_m_b), 3), np.inf)
    return PoseObservations(
        T_m_b=T_m_b,
        R_g_m=np.tile(np.eye(3), (len(T_m_b), 1, 1)),
        sigma_position=open_sigma,
        sigma_attitude=open_sigma,
    )


def slow_errors(
    trajectory: Trajectory, of: str, rows: Index | slice = slice(None)
) -> SlowErrors | None:
    """Return the part of a trajectory's errors that changes slowly; None where there is none.

    The process runs on from strip to strip: what is left of the correlation after a turn depends
    on its duration alone.

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
    return errors if observed.motion is None else errors + state.delay[0] * observed.motion.velocity


def position_equations(observed: PoseObservations, state: State, columns: Layout) -> Equations:
    """Linearise observed positions, along the grid's axes.

    Parameters
    ----------
    observed : PoseObservations
    state : State
    columns : Layout
    """
    n, strips = len(state.T_m_b), observed.strips
    A, where = [observed.R_g_m], [columns.pose[:, :3]]
    if np.any(columns.shift >= 0):
        A.append(np.tile(np.eye(3), (n, 1, 1)))
        where.append(np.tile(columns.shift, (n, 1)))
    if len(columns.drift):
        A.append(strips.elapsed[:, None, None] * np.eye(3))
        where.append(np.vstack([columns.drift, np.full(3, -1)])[strips.idx])
    if observed.motion is not None and columns.delay[0] >= 0:
        A.append(observed.motion.velocity[:, :, None])
        where.append(np.tile(columns.delay[:1], (n, 1)))
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


def attitude_equations(observed: PoseObservations, state: State, columns: Layout) -> Equations:
    """Linearise observed attitudes, about the body's axes.

    Observed is what the body has a delay later than at the exposure, as `position_errors` has it.

    Parameters
    ----------
    observed : PoseObservations
    state : State
    columns : Layout
    """
    R, where = np.swapaxes(observed.T_m_b.R, -1, -2) @ state.T_m_b.R, columns.pose[:, 3:]
    if observed.motion is None or columns.delay[1] < 0:
        v = log(R)
        A = log_jacobian(v)
    else:
        rate = observed.motion.rate
        later = exp(state.delay[1] * rate)
        v = log(R @ later)
        by_turn = log_jacobian(v)
        A = np.concatenate(
            [by_turn @ np.swapaxes(later, -1, -2), by_turn @ rate[:, :, None]], axis=2
        )
        where = np.concatenate([where, np.full((len(v), 1), columns.delay[1])], axis=1)
    return Equations(
        kind="attitude",
        v=v,
        sigma=observed.sigma_attitude,
        A=A,
        columns=where,
        unit=np.arange(len(v)),
        correlation=observed.of_attitudes,
    )
