"""The bundle block adjustment: a network for each use, and its adjustment with covariances.

Uses differ in how the images are oriented (sections 2.1 and 2.2):

- self-calibration: a pose per image, the mounting held at identity (`free_orientation`);
- the same with observed positions (`free_orientation(..., positions=...)`);
- single step, eq. (14): a pose per exposure, observed by GNSS and INS, and free mountings
  (`mounted_orientation`); several heads on one body are treated in the same way.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block
from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.observations import (
    PoseObservations,
    Strips,
    observed_poses,
    strips_of,
    velocities,
)
from acx4lib.bundle.rejections import Rejection, Stopped
from acx4lib.bundle.start import (
    ASTRAY,
    far_off,
    prepared,
    resected,
    robust_start,
    suspects,
    with_estimates,
    with_measurements,
)
from acx4lib.bundle.unknowns import Layout, State, layout
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import SMALLEST_F_MM, Camera, mountings
from acx4lib.geometry.collinearity import mounted_jacobian
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import ATTITUDE
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.adjustment import Solution
from acx4lib.least_squares.covariance import propagate
from acx4lib.least_squares.reduced_system import held_at_zero
from acx4lib.model import Model

if TYPE_CHECKING:
    import pandas as pd


def free_orientation(
    block: Block,
    model: Model,
    *,
    positions: PoseObservations | None = None,
    start: State | None = None,
) -> Network:
    """Set up a self-calibrating bundle: every image's exterior orientation is free.

    The trajectory gives approximate values only; it is not observed.

    Parameters
    ----------
    block : Block
    model : Model
        Its `fix` and `gnss` have no effect.
    positions : PoseObservations, optional
        Observed camera poses, one per image.
    start : State, optional
        Where to begin, by another adjustment of the block: interior orientations, the poses of the
        images' cameras, and points, NaN where it has none. The trajectory still decides which
        points are used, unless it is far off and this is not.

    Raises
    ------
    AdjustmentError
        As `start.resected`, where the block has no trajectory and there is no start.
    ValueError
        If there is not one position, or start, per image.
    """
    n_images = len(block.images)
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
        model,
        names=block.images.names,
        idx=np.arange(n_images),
        columns=layout(len(block.cameras), n_images, free=model.free),
        observed=positions or _unobserved(T_m_c),
        at=_declared(block, T_m_c, identity),
    )
    return network if start is None else _beginning_near(network, replace(start, T_b_c=identity))


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
    model: Model,
    *,
    turns: Array | None = None,
    start: State | None = None,
) -> Network:
    """Set up the single step, eq. (14): body poses observed by GNSS and INS, mountings free.

    Parameters
    ----------
    block : Block
    model : Model
    turns : ndarray, shape (3,), optional
        Standard deviation of the turns of an exposure's pictures against each other, about the
        body's axes, radians: every picture then has a pose of its own. By default they share one.
    start : State, optional
        Where to begin, unless its rays are far off: a pose for each of the network's.

    Raises
    ------
    AdjustmentError
        Where drifts are asked for and the block has no strips; for a delay as
        `observations.velocities`.
    """
    trajectory = block.trajectory
    strips = strips_of(block) if "drift" in model.gnss else Strips()
    if "drift" in model.gnss and not strips.names:
        msg = "no strip has two exposures to drift between: images.csv needs its column strip"
        raise AdjustmentError(msg)
    exposure_idx, names = block.images.exposure_idx, trajectory.exposures
    rows: Index = np.arange(len(trajectory))
    pose_idx = exposure_idx
    if turns is not None:
        names, rows, pose_idx = block.images.names, exposure_idx, np.arange(len(exposure_idx))
    network = _network(
        block,
        model,
        names=names,
        idx=pose_idx,
        columns=layout(
            len(block.cameras),
            len(rows),
            free=model.free,
            free_mount=model.mount,
            free_shift=model.shift,
            n_drifts=len(strips.names),
            recorded=[name for name in ("delay", *ATTITUDE) if name in model.gnss],
        ),
        observed=observed_poses(
            trajectory,
            rows,
            turns=turns,
            strips=strips,
            velocity=velocities(block) if "delay" in model.gnss else np.zeros((1, 3)),
        ),
        at=_declared(block, trajectory.T_m_b[rows], mountings(block.cameras)),
    )
    return network if start is None else _beginning_near(network, start)


def _declared(block: Block, T_m_b: Pose, T_b_c: Pose) -> State:
    """Return the unknowns as a block declares them; its points have no coordinates."""
    return State(
        interiors=tuple(camera.interior for camera in block.cameras),
        T_b_c=T_b_c,
        T_m_b=T_m_b,
        x_m=np.full((len(block.points), 3), np.nan),
    )


def _network(
    block: Block,
    model: Model,
    *,
    names: tuple[str, ...],
    idx: Index,
    columns: Layout,
    observed: PoseObservations,
    at: State,
) -> Network:
    """Return the network of a block at a state; `idx` are the poses of its images."""
    # checked here, not in the block: the reader of flights also makes blocks that are not finite
    expected.finite("trajectory.T_m_b.R", at.T_m_b.R)
    expected.finite("trajectory.T_m_b.r", at.T_m_b.r)
    expected.finite("control.x_m", block.control.x_m)
    for camera in block.cameras:
        if camera.interior.f < SMALLEST_F_MM:
            f = camera.interior.f
            raise ValueError(f"{camera.name}: expected a focal length in mm, got f={f} (metres?)")
    if len(block.images) == 0:
        raise AdjustmentError(f"block {block.name!r} has no images: there is nothing to adjust")
    network = Network(
        block=block,
        pose_names=names,
        pose_idx=idx,
        layout=columns,
        image_points=block.image_points,
        rows=np.arange(len(block.image_points)),
        control=block.control,
        observed=observed,
        start=replace(at, drift=np.zeros(columns.drift.shape)),
        refraction=model.refraction,
    )
    return with_measurements(network, network.start)


def _beginning_near(network: Network, start: State) -> Network:
    """Return a network that begins at other values; points that these lack keep theirs.

    Only where its own values are far off are the measurements those that the others choose.
    """
    near = replace(network.start, interiors=start.interiors, T_b_c=start.T_b_c, T_m_b=start.T_m_b)
    if far_off(network, network.start).any():
        network = with_measurements(network, near)
    x_m = np.where(np.isfinite(start.x_m), start.x_m, network.start.x_m)
    return network.beginning_at(replace(near, x_m=x_m))


# --- adjusted ---------------------------------------------------------------------------------


HIGH = 100.0
"""Variance factor above which it is checked whether the minimum found is the right one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bundle:
    """An adjusted bundle.

    Attributes
    ----------
    network : Network
    state : State
        Estimates.
    solution : Solution
        Precision and residuals; covariances are a priori.
    rejected : tuple of Rejection
    stopped : tuple of Stopped
        Groups with too many rejections, in which none was made.
    """

    network: Network
    state: State
    solution: Solution
    rejected: tuple[Rejection, ...] = ()
    stopped: tuple[Stopped, ...] = ()

    def __repr__(self) -> str:
        """Describe the adjustment and its fit in one line."""
        n = shown.count(self.solution.n_observations, "observation")
        redundancy = f"redundancy {self.solution.redundancy}"
        return shown.line(f"Bundle of {self.network.block.name!r}", n, redundancy, *self.summary)

    @property
    def summary(self) -> tuple[str, str, str]:
        """The fit in phrases: variance factor, iterations, rejections."""
        p = self.solution.chi_square_p
        probability = f"p {p:.3f}" if p >= 5e-4 else "p < 0.0005"
        fit = f"σ0² {self.solution.sigma0_sq:.3f} ({probability})"
        steps = shown.count(self.solution.iterations, "iteration")
        return fit, steps, f"{len(self.rejected)} rejected" if self.rejected else ""

    def quality(self) -> pd.DataFrame:
        """Return the adjustment in a row: its size, redundancy and global test."""
        return qualities("block", {self.network.block.name: self})

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The block's cameras with their estimates: interior orientation, mounting if mounted."""
        return with_estimates(self.network.block.cameras, self.state)

    @property
    def T_m_c(self) -> Pose:
        """Camera poses, one per image."""
        return camera_poses(self.network, self.state)

    @property
    def camera_pose_covariances(self) -> Array:
        """A priori covariances of the camera poses, (n_images, 6, 6), m and rad in camera axes."""
        network, images = self.network, self.network.block.images
        T_m_b = self.state.T_m_b[network.pose_idx]
        by_body, by_mount = mounted_jacobian(T_m_b, self.state.T_b_c[images.camera_idx])
        J = np.concatenate([by_mount, by_body], axis=2)
        columns = np.concatenate(
            [network.layout.mount[images.camera_idx], network.layout.pose[network.pose_idx]], axis=1
        )
        cov = held_at_zero(self.solution.inverse, columns[:, :, None], columns[:, None, :])
        return propagate(J, cov)

    @property
    def oriented(self) -> Mask:
        """Which images are oriented by their measurements, or held, shape (n_images,)."""
        undetermined = np.append(self.solution.undetermined, False)
        is_open: Mask = np.any(undetermined[self.network.layout.pose], axis=1)
        return ~is_open[self.network.pose_idx]


def qualities(name: str, bundles: Mapping[str, Bundle]) -> pd.DataFrame:
    """Return a row for each adjustment: size, redundancy, global test, number of rejections.

    Parameters
    ----------
    name : str
        Name of the index that holds the keys.
    bundles : mapping of str to Bundle
    """
    return shown.row_table(name, {key: _quality(bundle) for key, bundle in bundles.items()})


def _quality(bundle: Bundle) -> dict[str, object]:
    solution = bundle.solution
    return {
        "observations": solution.n_observations,
        "unknowns": solution.n_unknowns,
        "redundancy": solution.redundancy,
        "σ0²": solution.sigma0_sq,
        "p of χ²": solution.chi_square_p,
        "iterations": solution.iterations,
        "rejected": len(bundle.rejected),
        "left out": sum(bundle.network.left_out.values()),
    }


def adjust(network: Network) -> Bundle:
    """Adjust a network, with all its observations.

    Approximate values that are far off, or from which it fails, are first replaced by better ones,
    and the measurements are chosen anew: `start.prepared`.

    Raises
    ------
    AdjustmentError
        Where it does not converge, or converges to a state that does not fit the measurements.
    """
    return adjust_chosen(prepared(network))


def adjust_chosen(network: Network) -> Bundle:
    """Adjust a network as `adjust` does, with just the measurements that it has."""
    if not far_off(network, network.start).any():
        with suppress(AdjustmentError):
            return _adjusted(network, network.start)
    return _adjusted(network, robust_start(network))


def _adjusted(network: Network, start: State) -> Bundle:
    try:
        state, solution = adjustment.solve(network, start)
    except AdjustmentError as error:
        where = suspects(network, start)
        if not where:
            raise
        raise AdjustmentError(f"{error}{where}") from error
    if solution.sigma0_sq > HIGH and far_off(network, state, limit=ASTRAY).any():
        where = suspects(network, start) or suspects(network, state)
        raise AdjustmentError(f"the adjustment went astray{where}")
    return Bundle(network=network, state=state, solution=solution)


def designed(network: Network) -> Bundle:
    """Return the precision of a planned network; its observations have no errors.

    Returns
    -------
    Bundle
        At the start values, which are the true ones; its sigma0 is one.

    Raises
    ------
    AdjustmentError
        Where observations are fewer than unknowns.
    """
    solution = adjustment.designed(network, network.start)
    return Bundle(network=network, state=network.start, solution=solution)
