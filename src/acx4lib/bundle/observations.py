"""Observations of a bundle besides image points: control, positions, attitudes, and so on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from acx4lib import expected
from acx4lib.bundle.unknowns import Layout
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block, SurveyedPoints
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.distances import Distances, lengths
from acx4lib.geometry.frames import Pose, log, log_jacobian, transform
from acx4lib.least_squares.normal_equations import Equations, Group


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

    def __post_init__(self) -> None:
        n = len(self.T_m_b)
        expected.shape("R_g_m", self.R_g_m, (n, 3, 3))
        for name in ("sigma_position", "sigma_attitude"):
            expected.shape(name, getattr(self, name), (n, 3))
            expected.positive(name, getattr(self, name))


def unobserved(T_m_b: Pose) -> PoseObservations:
    """Return poses without any observation."""
    open_sigma = np.full((len(T_m_b), 3), np.inf)
    return PoseObservations(
        T_m_b=T_m_b,
        R_g_m=np.tile(np.eye(3), (len(T_m_b), 1, 1)),
        sigma_position=open_sigma,
        sigma_attitude=open_sigma,
    )


def strips_of(block: Block) -> Strips:
    """Return the strips of a block that have exposures at two times or more.

    The time is that of the trajectory; where it has none, the order of the exposures.

    Parameters
    ----------
    block : Block
    """
    trajectory = block.trajectory
    strip = np.full(len(trajectory), "", dtype=object)
    strip[block.images.exposure_idx] = block.images.strips
    timed = bool(np.isfinite(trajectory.time_s).all())
    names: list[str] = []
    idx, elapsed = np.full(len(trajectory), -1), np.zeros(len(trajectory))
    for name in filter(None, dict.fromkeys(strip)):
        here = np.flatnonzero(strip == name)
        time = trajectory.time_s[here] if timed else np.arange(len(here), dtype=float)
        if np.ptp(time) > 0:
            idx[here], elapsed[here] = len(names), time - time.mean()
            names.append(name)
    return Strips(names=tuple(names), idx=idx, elapsed=elapsed, unit="s" if timed else "exposure")


def position_errors(observed: PoseObservations, shift: Array, drift: Array) -> Array:
    """Return the systematic errors of observed positions along the grid's axes, m.

    Parameters
    ----------
    observed : PoseObservations
    shift : ndarray, shape (3,)
        m.
    drift : ndarray, shape (n_strips, 3)
        m per unit of time.

    Returns
    -------
    ndarray, shape (n_poses, 3), or (1, 3) where there are no strips
    """
    strips = observed.strips
    of_strip: Array = np.vstack([drift, np.zeros(3)])[strips.idx]
    return shift + strips.elapsed[:, None] * of_strip


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


def distance_equations(distances: Distances, x_m: Array, joints: Index) -> Equations:
    """Linearise measured distances, in halves: first those at the one end, then at the other.

    An observation has one point at most. A distance d between a and b is two halves, each with
    half of its residual, sigma over the root of two, and one point; an unknown t, added to the
    one and taken off the other, joins them: minimising over t gives the distance's own equation,
    exactly. The unknown has no state.

    Parameters
    ----------
    distances : Distances
    x_m : ndarray, shape (n_points, 3)
        All points of the block.
    joints : ndarray, shape (n,)
        Columns of the unknowns that join the halves.
    """
    n = len(distances)
    length, along = lengths(x_m, distances.point_idx)
    sign = np.repeat([-1.0, 1.0], n)
    return Equations(
        kind="distance",
        v=np.tile((length - distances.distance_m) / 2, 2)[:, None],
        sigma=np.tile(distances.sigma_m / np.sqrt(2), 2)[:, None],
        A=sign[:, None, None],
        columns=joints[:, None],
        unit=np.tile(np.arange(n), 2),
        B=(sign[:, None] * np.tile(along, (2, 1)))[:, None, :],
        point=distances.point_idx.T.ravel(),
    )


def usable(distances: Distances, measured: Index) -> Index:
    """Return the distances that are used: of finite sigma, with both ends among measured points.

    Parameters
    ----------
    distances : Distances
    measured : ndarray
        Points with rays.
    """
    both = np.isin(distances.point_idx, measured).all(axis=1)
    return np.flatnonzero(both & np.isfinite(distances.sigma_m))


def of_halves(values: Array) -> Array:
    """Return the sum of the two halves of every distance, over the first axis."""
    n = len(values) // 2
    total: Array = values[:n] + values[n:]
    return total


def whole(group: Group, distances: Distances) -> Group:
    """Return a group of residuals in which distances are not in halves."""
    if group.kind != "distance":
        return group
    return Group(
        kind=group.kind,
        v=of_halves(group.v),
        sigma=distances.sigma_m[:, None],
        redundancy=of_halves(group.redundancy),
    )


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
    """Return the cameras of which a part of the mounting is estimated and declared with sigma.

    Parameters
    ----------
    cameras : sequence of Camera
    part : str
        ``"lever_arm"`` or ``"boresight"``.
    columns : ndarray, shape (n_cameras, 6)
        Columns of the mountings.
    """
    own = columns[:, :3] if part == "lever_arm" else columns[:, 3:]
    sigma = np.array(
        [c.prior.lever_sigma if part == "lever_arm" else c.prior.boresight_sigma for c in cameras]
    )
    return np.flatnonzero(np.isfinite(sigma).any(axis=1) & np.all(own >= 0, axis=1))


def position_equations(
    observed: PoseObservations, T_m_b: Pose, errors: Array, columns: Layout
) -> Equations:
    """Linearise observed positions, along the grid's axes.

    Parameters
    ----------
    observed : PoseObservations
    T_m_b : Pose
        Estimates.
    errors : ndarray, shape (n_poses, 3) or (1, 3)
        As `position_errors` returns them.
    columns : Layout
    """
    n, strips = len(T_m_b), observed.strips
    A, where = [observed.R_g_m], [columns.pose[:, :3]]
    if np.any(columns.shift >= 0):
        A.append(np.tile(np.eye(3), (n, 1, 1)))
        where.append(np.tile(columns.shift, (n, 1)))
    if len(columns.drift):
        A.append(strips.elapsed[:, None, None] * np.eye(3))
        where.append(np.vstack([columns.drift, np.full(3, -1)])[strips.idx])
    return Equations(
        kind="gnss",
        v=transform(observed.R_g_m, T_m_b.r - observed.T_m_b.r) + errors,
        sigma=observed.sigma_position,
        A=np.concatenate(A, axis=2),
        columns=np.concatenate(where, axis=1),
        unit=np.arange(n),
    )


def attitude_equations(observed: PoseObservations, T_m_b: Pose, columns: Index) -> Equations:
    """Linearise observed attitudes, about the body's axes.

    Parameters
    ----------
    observed : PoseObservations
    T_m_b : Pose
        Estimates.
    columns : ndarray, shape (n_poses, 3)
        Columns of the attitudes.
    """
    v = log(np.swapaxes(observed.T_m_b.R, -1, -2) @ T_m_b.R)
    return Equations(
        kind="attitude",
        v=v,
        sigma=observed.sigma_attitude,
        A=log_jacobian(v),
        columns=columns,
        unit=np.arange(len(T_m_b)),
    )
