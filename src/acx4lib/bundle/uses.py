"""The uses of the bundle: how its images are oriented (sections 2.1 and 2.2).

- Self-calibration: a pose per image, the mounting held at identity (`free_orientation`);
- the same with observed positions (`free_orientation(..., positions=...)`);
- single step, eq. (14): a pose per exposure, observed by GNSS and INS, and free mountings
  (`mounted_orientation`); several heads on one body are treated in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.observations import (
    PoseObservations,
    Strips,
    motion_of,
    observed_poses,
    strips_of,
    usable,
)
from acx4lib.bundle.start import (
    far_off,
    in_front,
    recovered,
    resected,
    robust_phase,
    start_points,
    with_estimates,
)
from acx4lib.bundle.unknowns import Layout, State, free_shift, holding, layout
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import SMALLEST_F_MM, Camera, mountings
from acx4lib.geometry.collinearity import REFRACTION
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import ATTITUDE, DELAYS, MOUNT, TRAJECTORY
from acx4lib.least_squares import processors


def free_orientation(
    block: Block,
    *,
    free: Sequence[str],
    positions: PoseObservations | None = None,
    refraction: str = "none",
    start: State | None = None,
    held: Sequence[str] = (),
    smallest_angle: float | None = None,
) -> Network:
    """Set up a self-calibrating bundle: every image's exterior orientation is free.

    The trajectory gives approximate values only; it is not observed.

    Parameters
    ----------
    block : Block
    free : sequence of str
        Interior parameters to estimate, names of `camera.INTERIOR`.
    positions : PoseObservations, optional
        Observed camera poses, one per image.
    refraction : str
        ``"none"`` or ``"standard"``.
    start : State, optional
        Where to begin, by another adjustment of the block: interior orientations, the poses of the
        images' cameras, and points, NaN where it has none. The trajectory still decides which
        points are used, unless it is far off and this is not.
    held : sequence of str
        Names of images whose poses are known without error, those of `start` or of the trajectory.
    smallest_angle : float, optional
        Radians, in the place of the block's: tie points whose rays meet at less are left out; 0
        keeps all.

    Raises
    ------
    AdjustmentError
        As `start.resected`, where the block has no trajectory and there is no start.
    ValueError
        For an unknown name, or if there is not one position, or start, per image.
    """
    expected.instance("block", block, Block)
    if smallest_angle is not None:
        block = replace(block, smallest_angle=smallest_angle)
    n_images = len(block.images)
    if positions is not None:
        expected.instance("positions", positions, PoseObservations)
        expected.many("positions", positions.T_m_b, n_images, "poses")
    if start is not None:
        expected.instance("start", start, State)
        expected.many("start.T_m_b", start.T_m_b, n_images, "poses")
    if start is None and np.isnan(block.trajectory.T_m_b.r).all():
        block = resected(block)
    T_m_c = block.T_m_b_images @ mountings(block.cameras)[block.images.camera_idx]
    if start is not None and np.isnan(T_m_c.r).all():
        T_m_c = start.T_m_b
    identity = Pose(
        R=np.tile(np.eye(3), (len(block.cameras), 1, 1)), r=np.zeros((len(block.cameras), 3))
    )
    network = _network(
        block,
        poses=_Poses(names=block.images.names, idx=np.arange(n_images), T_m_b=T_m_c),
        columns=layout(len(block.cameras), n_images, free=free),
        observed=positions or _unobserved(T_m_c),
        T_b_c=identity,
        refraction=refraction,
        better=replace(start, T_b_c=identity) if start else None,
    )
    if not held:
        return network
    expected.names_of("held", held, block.images.names)
    images = np.array([block.images.names.index(name) for name in held])
    return with_held_poses(network, held, (T_m_c if start is None else start.T_m_b)[images])


def _unobserved(T_m_b: Pose) -> PoseObservations:
    """Return poses without any observation."""
    open_sigma = np.full((len(T_m_b), 3), np.inf)
    return PoseObservations(
        T_m_b=T_m_b,
        R_g_m=np.tile(np.eye(3), (len(T_m_b), 1, 1)),
        sigma_position=open_sigma,
        sigma_attitude=open_sigma,
    )


def mounted_orientation(
    block: Block,
    *,
    free: Sequence[str],
    free_mount: Sequence[str] = MOUNT,
    refraction: str = "none",
    gnss: Sequence[str] = (),
    turns: Array | None = None,
    start: State | None = None,
) -> Network:
    """Set up the single step, eq. (14): body poses observed by GNSS and INS, mountings free.

    Parameters
    ----------
    block : Block
    free : sequence of str
        Interior parameters to estimate, names of `camera.INTERIOR`.
    free_mount : sequence of str
        Parameters of the mounting to estimate, names of `parameters.MOUNT`; the others keep the
        cameras' values.
    refraction : str
        ``"none"`` or ``"standard"``.
    gnss : sequence of str
        Errors of the trajectory to estimate, names of `parameters.TRAJECTORY`: a ``"shift"`` of
        the block, without height where the lever arm's z is estimated; a ``"drift"`` of each strip;
        a ``"delay"`` of the positions, an ``"attitude_delay"`` of the attitudes; a ``"deviation"``
        of the headings.
    turns : ndarray, shape (3,), optional
        Standard deviation of the turns of an exposure's pictures against each other, about the
        body's axes, radians: every picture then has a pose of its own. By default they share one.
    start : State, optional
        Where to begin, unless its rays are far off: a pose for each of the network's.

    Raises
    ------
    AdjustmentError
        Where drifts are asked for and the block has no strips; for delays as
        `observations.motion_of`.
    ValueError
        For an unknown name.
    """
    expected.instance("block", block, Block)
    expected.names_of("gnss", gnss, TRAJECTORY)
    trajectory = block.trajectory
    strips = strips_of(block) if "drift" in gnss else Strips()
    delayed = [name for name in DELAYS if name in gnss]
    if "drift" in gnss and not strips.names:
        msg = "no strip has two exposures to drift between: images.csv needs its column strip"
        raise AdjustmentError(msg)
    rows = np.arange(len(trajectory)) if turns is None else block.images.exposure_idx
    names = trajectory.exposures if turns is None else block.images.names
    return _network(
        block,
        poses=_Poses(
            names=names,
            idx=block.images.exposure_idx if turns is None else np.arange(len(block.images)),
            T_m_b=trajectory.T_m_b[rows],
        ),
        columns=layout(
            len(block.cameras),
            len(rows),
            free=free,
            free_mount=free_mount,
            free_shift=free_shift(gnss, free_mount),
            n_drifts=len(strips.names),
            recorded=[name for name in (*DELAYS, *ATTITUDE) if name in gnss],
        ),
        observed=observed_poses(
            trajectory,
            rows,
            turns=turns,
            strips=strips,
            motion=motion_of(block, delays=delayed) if delayed else None,
        ),
        T_b_c=mountings(block.cameras),
        refraction=refraction,
        better=start,
    )


def with_held_poses(network: Network, names: Sequence[str], T_m_b: Pose) -> Network:
    """Return a network in which some poses are held: known without error, and not estimated.

    Parameters
    ----------
    network : Network
    names : sequence of str
        Names of its poses: of images with `free_orientation`, whose poses are the cameras'; of
        exposures with `mounted_orientation`, whose poses are the body's.
    T_m_b : Pose
        Their poses, one for each name.

    Raises
    ------
    ValueError
        For a name that the network does not have, or that comes twice, or if there is not one
        pose for each.
    """
    expected.instance("network", network, Network)
    expected.names_of("names", names, network.pose_names)
    expected.different("names", names)
    expected.instance("T_m_b", T_m_b, Pose)
    expected.many("T_m_b", T_m_b, len(names), "poses")
    places = [network.pose_names.index(name) for name in names]
    columns, observed, start = network.layout.pose[places], network.observed, network.start
    held = replace(
        network,
        layout=holding(network.layout, columns[columns >= 0]),
        observed=replace(
            observed,
            T_m_b=_with_poses(observed.T_m_b, places, T_m_b),
            sigma_position=_with_rows(observed.sigma_position, places, np.inf),
            sigma_attitude=_with_rows(observed.sigma_attitude, places, np.inf),
        ),
    )
    return _chosen(held, replace(start, T_m_b=_with_poses(start.T_m_b, places, T_m_b)))


def _with_poses(T: Pose, rows: Sequence[int], new: Pose) -> Pose:
    return Pose(R=_with_rows(T.R, rows, new.R), r=_with_rows(T.r, rows, new.r))


def _with_rows(values: Array, rows: Sequence[int], new: Array | float) -> Array:
    out = values.copy()
    out[rows] = new
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class _Poses:
    """Approximate poses with their names, and the pose on which each image depends."""

    names: tuple[str, ...]
    idx: Index
    T_m_b: Pose


def _network(
    block: Block,
    *,
    poses: _Poses,
    columns: Layout,
    observed: PoseObservations,
    T_b_c: Pose,
    refraction: str,
    better: State | None = None,
) -> Network:
    """Return the network of a block; recover approximate values that are far off."""
    expected.one_of("refraction", refraction, REFRACTION)
    # checked here, not in the block: the reader of flights also makes blocks that are not finite
    expected.finite("trajectory.T_m_b.R", poses.T_m_b.R)
    expected.finite("trajectory.T_m_b.r", poses.T_m_b.r)
    expected.finite("control.x_m", block.control.x_m)
    _require_millimetres(block.cameras)
    if len(block.images) == 0:
        raise AdjustmentError(f"block {block.name!r} has no images: there is nothing to adjust")
    complete = Network(
        block=block,
        pose_names=poses.names,
        pose_idx=poses.idx,
        layout=columns,
        image_points=block.image_points,
        rows=np.arange(len(block.image_points)),
        control=block.control,
        observed=observed,
        start=State(
            interiors=tuple(camera.interior for camera in block.cameras),
            T_b_c=T_b_c,
            T_m_b=poses.T_m_b,
            x_m=np.full((len(block.points), 3), np.nan),
            drift=np.zeros(columns.drift.shape),
        ),
        refraction=refraction,
    )
    network = _chosen(complete, complete.start)
    is_far_off = far_off(network, network.start).any()
    if better is not None:
        near = _beginning_near(_chosen(complete, better) if is_far_off else network, better)
        if not far_off(near, near.start).any():
            return near
    if not is_far_off:
        return network
    network = _chosen(complete, recovered(network))
    return _chosen(complete, _robust(network, network.start))


def _require_millimetres(cameras: Sequence[Camera]) -> None:
    """Raise a ValueError where a focal length, expected in mm, must be in metres."""
    for camera in cameras:
        if camera.interior.f < SMALLEST_F_MM:
            f = camera.interior.f
            raise ValueError(f"{camera.name}: expected a focal length in mm, got f={f} (metres?)")


def _beginning_near(network: Network, better: State) -> Network:
    """Return the network with other start values; points that these lack keep theirs."""
    x_m = np.where(np.isfinite(better.x_m), better.x_m, network.start.x_m)
    start = replace(network.start, interiors=better.interiors, T_b_c=better.T_b_c, x_m=x_m)
    return network.beginning_at(replace(start, T_m_b=better.T_m_b))


def robust_start(network: Network) -> State:
    """Return the state that most observations agree on, even from wrong approximate values."""
    return _robust(network, recovered(network))


def _robust(network: Network, state: State) -> State:
    """Return the state that most observations agree on; unchanged if points lie behind cameras."""
    if not in_front(network, state):
        return state
    with processors.on_one_thread():
        return robust_phase(network, state)


def _chosen(network: Network, state: State) -> Network:
    """Choose the measurements to use, and intersect the points' approximate coordinates."""
    block, point_idx = network.block, network.block.image_points.point_idx
    used = np.flatnonzero(np.isfinite(block.image_points.sigma_px))
    rays_left = np.bincount(point_idx[used], minlength=len(block.points))
    control = block.control[np.flatnonzero(np.isfinite(block.control.sigma_m).any(axis=1))]
    is_control = np.zeros(len(block.points), dtype=bool)
    is_control[control.point_idx] = True
    cameras = with_estimates(block.cameras, state)
    x_m, angle = start_points(replace(block, cameras=cameras), camera_poses(network, state), used)
    too_flat = (angle < block.smallest_angle) & (rays_left >= 2) & ~is_control
    once = (rays_left == 1) & ~is_control
    rows = used[~(too_flat | once)[point_idx[used]]]
    rows = rows[np.argsort(point_idx[rows], kind="stable")]
    x_m[control.point_idx] = control.x_m
    control = control[np.isin(control.point_idx, point_idx[rows])]
    distances = block.distances[usable(block.distances, point_idx[rows])]
    flat = f"whose rays meet at less than {np.degrees(block.smallest_angle):g} degrees"
    reasons = (("measured once", once), (flat, too_flat))
    return replace(
        network,
        image_points=block.image_points[rows],
        rows=rows,
        control=control,
        distances=distances,
        layout=_joining(network.layout, len(distances)),
        start=replace(state, x_m=x_m),
        left_out={why: int(unused.sum()) for why, unused in reasons if unused.any()},
    )


def _joining(columns: Layout, n_distances: int) -> Layout:
    """Return a layout that joins so many distances."""
    without = replace(columns, joint=columns.joint[:0])
    return replace(without, joint=without.n_columns + np.arange(n_distances))
