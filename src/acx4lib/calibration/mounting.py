"""Boresight and lever arm: the two-step and the single-step method (section 2.2, Table 3).

The observations have the weights of the given sigma, or of sigma that fit the residuals
(`weighted`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.attempts import Failed, attempt
from acx4lib.block import Block, no_datum
from acx4lib.bundle.adjust import Bundle, adjust, free_orientation, mounted_orientation, qualities
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.bundle.observations import PoseObservations, shared_errors, slow_errors
from acx4lib.bundle.rejections import Rejection, without
from acx4lib.bundle.unknowns import Layout, State, layout
from acx4lib.bundle.variance_components import (
    PARTS,
    components,
    group_names,
    image_groups,
)
from acx4lib.calibration.common_errors import enlarged, turned
from acx4lib.calibration.estimates import (
    METHODS,
    Calibration,
    boresight_limit,
    from_bundle,
    require_control,
    saying_what_lacks,
)
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.frames import Pose, mean_rotation, skew, transform
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares.covariance import propagate
from acx4lib.model import Model

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Mounting:
    """The outcome of one method.

    Attributes
    ----------
    method : str
    calibration : Calibration
    bundle : Bundle
        The adjustment from which it comes.
    per_image : Pose, optional
        Two-step only: the mounting T_b_c of every image by eqs (12) and (13).
    averaged : ndarray, optional
        Two-step only: which images entered the mean, shape (n_images,).
    by_bundle : ndarray, optional
        Two-step only: d(columns of the calibration) / d(columns of the bundle); of the single step
        they are the first columns of the bundle.
    """

    method: str
    calibration: Calibration
    bundle: Bundle
    per_image: Pose | None = None
    averaged: Mask | None = None
    by_bundle: Array | None = None

    def __repr__(self) -> str:
        """Describe the estimates and their fit in one line."""
        cameras = shown.names([camera.name for camera in self.calibration.cameras])
        n = shown.count(self.calibration.n_columns, "parameter")
        return shown.line(f"Mounting by {self.method}", cameras, n, *self.bundle.summary)

    def table(self) -> pd.DataFrame:
        """Return the calibration's parameters with their units and sigma."""
        return self.calibration.table()

    def quality(self) -> pd.DataFrame:
        """Return the adjustment in a row."""
        return qualities("method", {self.method: self.bundle})


@dataclass(frozen=True, kw_only=True, eq=False)
class Mountings:
    """The outcome of all methods on one block.

    Attributes
    ----------
    methods : dict of str to Mounting
        In the order of `METHODS`.
    failures : dict of str to str
        Methods without an outcome, and why.
    """

    methods: dict[str, Mounting]
    failures: dict[str, str]

    def __repr__(self) -> str:
        """Name the methods in a line."""
        failed = f"without outcome {', '.join(self.failures)}" if self.failures else ""
        return shown.line("Mountings", *self.methods, failed)

    def table(self) -> pd.DataFrame:
        """Return the parameters of all methods side by side."""
        return shown.side_by_side(self.methods)

    def quality(self) -> pd.DataFrame:
        """Return the adjustments, a row for every method."""
        return qualities(
            "method", {name: mounting.bundle for name, mounting in self.methods.items()}
        )

    def __getitem__(self, method: str) -> Mounting:
        """Return the outcome of a method; raise an AdjustmentError with the reason if it failed."""
        expected.one_of("method", method, METHODS)
        if method not in self.methods:
            raise AdjustmentError(self.failures[method])
        return self.methods[method]


def calibrate(block: Block, model: Model) -> Mountings:
    """Calibrate by all methods; the two-step methods begin with the single step's estimates.

    Parameters
    ----------
    block : Block
    model : Model
        Its `gnss` is used by the single step alone.

    Raises
    ------
    AdjustmentError
        Where all methods fail.
    """
    single = attempt(single_step, block, model)
    two_steps = (two_step, two_step_gnss)
    return together([single, *(attempt(step, block, model, after=single) for step in two_steps)])


def together(outcomes: Sequence[Mounting | Failed]) -> Mountings:
    """Collect the outcomes of several methods on one block.

    Parameters
    ----------
    outcomes : sequence of Mounting or Failed
        At most one per method.

    Raises
    ------
    AdjustmentError
        Where no method has an outcome.
    LinAlgError
        Where a method failed numerically.
    """
    by_method = {outcome.method: outcome for outcome in outcomes}
    failed = [outcome for outcome in outcomes if isinstance(outcome, Failed)]
    for failure in failed:
        if isinstance(failure.error, np.linalg.LinAlgError):
            raise failure.error
    if len(failed) == len(outcomes):
        lines = (f"mounting/{failure.method}: {failure.reason}" for failure in failed)
        raise AdjustmentError("\n".join(lines))
    methods = {name: by_method[name] for name in METHODS if name in by_method}
    return Mountings(
        methods={name: m for name, m in methods.items() if isinstance(m, Mounting)},
        failures={failure.method: failure.reason for failure in failed},
    )


def single_step(block: Block, model: Model, *, snooping: bool = True) -> Mounting:
    """Estimate interior orientation, boresight and lever arm in one adjustment, eq. (14).

    Parameters
    ----------
    block : Block
    model : Model
    snooping : bool
        Whether gross errors are looked for, and rejected.

    Raises
    ------
    AdjustmentError
        Where it does not converge, or where neither three control points nor observed positions
        fix where the block lies.
    """
    if lack := no_datum(block):
        raise AdjustmentError(lack)
    network = partial(mounted_orientation, model=model)
    with saying_what_lacks(block, (*model.free, *model.mount)):
        bundle = adjust_rejecting(block, network) if snooping else adjust(network(block))
        bundle, turns = turned(block, bundle, network)
    calibration = enlarged(replace(from_bundle(bundle), turns=turns), bundle)
    return Mounting(method="single_step", calibration=calibration, bundle=bundle)


def two_step(block: Block, model: Model, *, after: Mounting | Failed | None = None) -> Mounting:
    """Estimate the mounting from a bundle on control points alone, eqs (12) and (13).

    Parameters
    ----------
    block : Block
    model : Model
        Its `gnss` has no effect.
    after : Mounting, optional
        Outcome of another method on the same block. Its rejected gross errors are taken over,
        since this method searches for none, and its estimates are start values. A failed
        outcome has no effect.

    Raises
    ------
    AdjustmentError
        Where the control points do not orient the block, or the bundle does not converge.
    ValueError
        Where `after` is of another block.
    """
    rejected, start = _taken_over(block, after)
    cleaned = without(block, rejected)
    network = free_orientation(cleaned, model, start=start)
    require_control(cleaned)
    bundle = replace(adjust(network), rejected=rejected)
    return _two_step("two_step", bundle, model)


def two_step_gnss(
    block: Block, model: Model, *, after: Mounting | Failed | None = None
) -> Mounting:
    """Estimate the boresight from a bundle whose positions GNSS observes, the lever arm held.

    The cameras' lever arms are held. An unknown one is held at zero, and the estimated interior
    orientation compensates for it.

    Parameters
    ----------
    block, model, after
        As in `two_step`.

    Raises
    ------
    AdjustmentError
        Where the bundle does not converge.
    """
    rejected, start = _taken_over(block, after)
    cleaned = without(block, rejected)
    if not np.isfinite(cleaned.trajectory.sigma_position).any():
        raise AdjustmentError("no position of the trajectory is observed")
    lever = mountings(block.cameras).r[block.images.camera_idx]
    T_m_b, exposure = cleaned.T_m_b_images, cleaned.images.exposure_idx
    positions = PoseObservations(
        T_m_b=Pose(R=T_m_b.R, r=T_m_b.r + transform(T_m_b.R, lever)),
        R_g_m=cleaned.trajectory.R_g_m[exposure],
        sigma_position=cleaned.trajectory.sigma_position[exposure],
        sigma_attitude=np.full((len(T_m_b), 3), np.inf),
        slow_positions=slow_errors(cleaned.trajectory, "position", exposure),
    )
    network = free_orientation(cleaned, model, positions=positions, start=start)
    bundle = replace(adjust(network), rejected=rejected)
    lever_held = replace(model, fix=(*model.fix, "lever_arm"))
    mounting = _two_step("two_step_gnss", bundle, lever_held)
    return replace(mounting, calibration=enlarged(mounting.calibration, bundle))


def _taken_over(
    block: Block, after: Mounting | Failed | None
) -> tuple[tuple[Rejection, ...], State | None]:
    """Return rejections and start values of another method, whose poses are the cameras'.

    Where observations contradict each other, the estimates do not fit, and are no start values.
    """
    if after is None or isinstance(after, Failed):
        return (), None
    bundle, before = after.bundle, after.bundle.network.block
    if (before.images.names, before.points) != (block.images.names, block.points) or len(
        before.image_points
    ) != len(block.image_points):
        msg = "after: expected an outcome on the same block, got one on other images or points"
        raise ValueError(msg)
    if bundle.stopped:
        return bundle.rejected, None
    return bundle.rejected, replace(bundle.state, T_m_b=bundle.T_m_c)


# --- The second of two steps: mountings of single images, averaged, eqs (12) and (13)


def _two_step(method: str, bundle: Bundle, model: Model) -> Mounting:
    """Average the mountings of all images, camera by camera, and propagate their covariance.

    Images have the weights that they have by themselves; the covariance of the mean holds for
    errors of the trajectory that change slowly, too.
    """
    block, pose = bundle.network.block, bundle.network.layout.pose
    T_b_c = mountings_per_image(bundle)
    trajectory, exposure = block.trajectory, block.images.exposure_idx
    sigma = np.hstack([trajectory.sigma_position, trajectory.sigma_attitude])
    known: Mask = np.all(np.isfinite(sigma), axis=1)
    entering = bundle.oriented & known[exposure]
    by_camera_pose, by_trajectory = mounting_jacobians(bundle, T_b_c)
    cov_trajectory = trajectory.cov
    per_image = propagate(
        by_camera_pose, bundle.solution.inverse.at(pose[:, :, None], pose[:, None, :])
    )
    per_image += propagate(by_trajectory, cov_trajectory[exposure])
    weights = np.zeros((len(block.cameras), 6, len(block.images), 6))
    cameras = []
    for k, (camera, declared) in enumerate(zip(bundle.cameras, block.cameras, strict=True)):
        idx = np.flatnonzero(entering & (block.images.camera_idx == k))
        if len(idx) == 0:
            msg = f"no image of {camera.name} is oriented and has a trajectory row to compare with"
            raise AdjustmentError(msg)
        mean, weights[k][:, idx] = _weighted_mean(T_b_c[idx], per_image[idx])
        R = mean.R if BORESIGHT[0] in model.mount else declared.T_b_c.R
        r = mean.r if LEVER_ARM[0] in model.mount else declared.T_b_c.r
        cameras.append(replace(camera, T_b_c=Pose(R=R, r=r)))
    columns = layout(len(cameras), 0, free=model.free, free_mount=model.mount)
    J, K = _derivatives(bundle, weights, by_camera_pose, by_trajectory, columns)
    cov = bundle.solution.inverse.times(J) @ J.T
    cov += np.einsum("iea,eab,jeb->ij", K, cov_trajectory, K)
    if (shared := shared_errors(trajectory)) is not None:
        cov += shared.among(np.moveaxis(K, 1, 0))
    calibration = Calibration(
        cameras=tuple(cameras),
        layout=columns,
        cov=cov,
        sigma0_sq=bundle.solution.sigma0_sq,
        open_columns=np.abs(J) @ bundle.solution.undetermined > 1e-9,
        limit_boresight_deg=boresight_limit(block),
    )
    return Mounting(
        method=method,
        calibration=calibration,
        bundle=bundle,
        per_image=T_b_c,
        averaged=entering,
        by_bundle=J,
    )


def mountings_per_image(bundle: Bundle) -> Pose:
    """Return T_b_c of every image from trajectory and bundle, eqs (12) and (13)."""
    return bundle.network.block.T_m_b_images.inverse @ bundle.T_m_c


def mounting_jacobians(bundle: Bundle, T_b_c: Pose) -> tuple[Array, Array]:
    """Return the derivatives of (lever arm, boresight) by camera poses and by the trajectory.

    Boresights are rotations about the camera's axes, attitudes about the body's axes.

    Returns
    -------
    by_camera_pose, by_trajectory : ndarray, shape (n_images, 6, 6)
    """
    R_b_m = np.swapaxes(bundle.network.block.T_m_b_images.R, -1, -2)
    by_camera_pose = np.zeros((len(T_b_c), 6, 6))
    by_camera_pose[:, :3, :3] = R_b_m
    by_camera_pose[:, 3:, 3:] = np.eye(3)
    by_trajectory = np.zeros_like(by_camera_pose)
    by_trajectory[:, :3, :3] = -R_b_m
    by_trajectory[:, :3, 3:] = skew(T_b_c.r)
    by_trajectory[:, 3:, 3:] = -np.swapaxes(T_b_c.R, -1, -2)
    return by_camera_pose, by_trajectory


def _weighted_mean(T_b_c: Pose, cov: Array) -> tuple[Pose, Array]:
    """Return the mean mounting and the weight matrices of its images, shape (6, n, 6)."""
    weights = np.zeros((6, len(T_b_c), 6))
    for part in (slice(0, 3), slice(3, 6)):
        P = np.linalg.inv(cov[:, part, part])
        weights[part, :, part] = np.moveaxis(np.linalg.inv(P.sum(axis=0)) @ P, 0, 1)
    r = np.einsum("inj,nj->i", weights[:3, :, :3], T_b_c.r)
    return Pose(R=mean_rotation(T_b_c.R, weights[3:, :, 3:]), r=r), weights


def _derivatives(
    bundle: Bundle, weights: Array, by_pose: Array, by_trajectory: Array, columns: Layout
) -> tuple[Array, Array]:
    """Return d(interior, mean mounting) / d(columns of the bundle), and by body poses.

    Shapes (n, n_columns) and (n, n_exposures, 6).
    """
    source, block = bundle.network.layout, bundle.network.block
    J = np.zeros((columns.n_columns, source.n_columns))
    K = np.zeros((columns.n_columns, len(block.trajectory), 6))
    free = source.interior >= 0
    J[columns.interior[free], source.interior[free]] = 1.0
    for k, mount in enumerate(columns.mount):
        own = mount >= 0
        mean = np.einsum("ina,nab->inb", weights[k][own], by_pose)
        J[np.ix_(mount[own], source.pose.ravel())] = mean.reshape(-1, source.pose.size)
        mean = np.einsum("ina,nab->nib", weights[k][own], by_trajectory)
        total = np.zeros((len(block.trajectory), own.sum(), 6))
        np.add.at(total, block.images.exposure_idx, mean)
        K[mount[own]] = np.moveaxis(total, 1, 0)
    return J, K


# --- weights of the observations --------------------------------------------------------------


MAX_ITERATIONS = 30


def weighted(block: Block, model: Model, *, weights: str) -> tuple[Block, dict[str, float]]:
    """Return a block with the standard deviations its flight asks for, and their factors.

    Parameters
    ----------
    block : Block
    model : Model
    weights : str
        ``"given"``, or ``"estimated"`` from the residuals of the single step.

    Raises
    ------
    AdjustmentError
        Where the single step or the factors do not converge.
    ValueError
        For other weights.
    """
    expected.one_of("weights", weights, ("given", "estimated"))
    if weights == "given":
        return block, {}
    factors = estimated_factors(block, lambda scaled_block: single_step(scaled_block, model).bundle)
    return scaled(block, factors), factors


def estimated_factors(block: Block, adjust_block: Callable[[Block], Bundle]) -> dict[str, float]:
    """Return the factor of every group's sigma that makes them fit the residuals.

    A group with too little effective redundancy keeps its sigma: its factor is one.

    Parameters
    ----------
    block : Block
    adjust_block : callable
        Adjusts a block, with or without a search for gross errors.

    Raises
    ------
    AdjustmentError
        Where an adjustment or the factors do not converge.
    """
    factors: dict[str, float] = {}
    steps: dict[str, float] = {}
    held: set[str] = set()
    for _ in range(MAX_ITERATIONS):
        estimates = components(adjust_block(scaled(block, factors)), applied=factors)
        held |= {c.group for c in estimates if not c.estimable}
        steps = {
            c.group: 1 / c.applied
            if c.group in held
            else float(np.clip(c.factor / c.applied, 1 / 3, 3))
            for c in estimates
        }
        factors = {c.group: c.applied * steps[c.group] for c in estimates}
        if all(abs(step - 1) < 1e-3 for step in steps.values()):
            return factors
    worst = max(steps, key=lambda name: abs(np.log(steps[name])))
    msg = (
        f"the standard deviations cannot be estimated: after {MAX_ITERATIONS} adjustments those "
        f'of {worst} still change by {100 * abs(steps[worst] - 1):.1f} %; use weights = "given"'
    )
    raise AdjustmentError(msg)


def scaled(block: Block, factors: Mapping[str, float]) -> Block:
    """Return the block with the sigma of its observations multiplied.

    Parameters
    ----------
    block : Block
    factors : mapping of str to float
        By group; groups not named keep their sigma.

    Raises
    ------
    ValueError
        For an unknown group, or a factor that is not positive.
    """
    expected.names_of("factors", factors, group_names(block))
    for name, factor in factors.items():
        expected.positive(name, factor)
    by_camera = np.array([factors.get(name, 1.0) for name in image_groups(block)])
    by_component = {kind: np.ones(3) for kind in ("control_point", "gnss", "attitude")}
    for name, kind, columns in PARTS:
        by_component[kind][list(columns)] = factors.get(name, 1.0)
    points, trajectory = block.image_points, block.trajectory
    camera_idx = block.images.camera_idx[points.image_idx]
    return replace(
        block,
        image_points=replace(points, sigma_px=points.sigma_px * by_camera[camera_idx]),
        control=replace(
            block.control, sigma_m=block.control.sigma_m * by_component["control_point"]
        ),
        trajectory=replace(
            trajectory,
            sigma_position=trajectory.sigma_position * by_component["gnss"],
            sigma_attitude=trajectory.sigma_attitude * by_component["attitude"],
        ),
    )
