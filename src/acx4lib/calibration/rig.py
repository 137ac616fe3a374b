"""A rig: heads mounted rigidly on one body, adjusted together with their trajectory.

Every head has its own interior orientation, boresight and lever arm. By eq. (14), all heads of an
exposure depend on one body pose, which GNSS and INS observe. The relative orientation follows
from the mountings, and is the same at every exposure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from acx4lib.attempts import Failed, attempt
from acx4lib.block import Block, SurveyedPoints
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.unknowns import holding
from acx4lib.calibration.common_errors import between_heads
from acx4lib.calibration.estimates import (
    LIMIT_BORESIGHT_DEG,
    LIMIT_LEVER_M,
    Calibration,
    Parameter,
    features,
    undetermined,
)
from acx4lib.calibration.heads import RelativeOrientation, ground_scale
from acx4lib.calibration.mounting import Mounting, single_step
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import INTERIOR, Camera, mountings
from acx4lib.geometry.collinearity import Measurement, directions
from acx4lib.geometry.frames import Pose, opk_jacobian
from acx4lib.geometry.parameters import MOUNT
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.model import Model

Step = Callable[[Block, Model], Mounting]
"""Adjusts a block, as `mounting.single_step` does."""


def calibrate(block: Block, model: Model, *, step: Step = single_step) -> Mounting:
    """Estimate interior orientation, boresight and lever arm of all heads in one adjustment.

    Parameters
    ----------
    block : Block
        A block with at least two heads.
    model : Model
        The focal lengths are estimated too, since GNSS observes the heights. If `free` does not
        name them, they are held at the cameras' values where some parameter is not determined
        otherwise, and this determines all. `fix` names the parts of the mounting that are held if
        otherwise some parameter is not determined, or no adjustment converges.
    step : Step
        By default the adjustment of measurements; another for a planned flight.

    Returns
    -------
    Mounting
        Its method is ``rig``.

    Raises
    ------
    AdjustmentError
        Where it does not converge.
    """
    free = tuple(dict.fromkeys(("f", *model.free)))
    names = [free] if "f" in model.free else [free, tuple(model.free)]
    parts = ((), model.fix) if model.fix else ((),)
    outcomes: list[Mounting | Failed] = []
    for trial in (replace(model, free=one, fix=fix) for one in names for fix in parts):
        rig = attempt(_adjusted, step, block, trial)
        if isinstance(rig, Mounting) and not undetermined(rig.calibration):
            return rig
        outcomes.append(rig)
    outcome = next((candidate for candidate in outcomes if candidate), outcomes[0])
    if isinstance(outcome, Failed):
        raise outcome.error
    return outcome


def _adjusted(step: Step, block: Block, model: Model) -> Mounting:
    """Adjust in a single step; repeat it if points need the heights of their neighbours."""
    rig = step(block, model)
    lonely = one_exposure_points(block)
    if len(lonely) and "control" in features(block):
        rig = step(observe_heights(block, rig.bundle, lonely), model)
    return replace(rig, method="rig")


# --- points that heads share at one exposure only --------------------------------------------


def one_exposure_points(block: Block) -> Index:
    """Return tie points that several heads measure at a single exposure.

    Their rays start decimetres apart and meet at a thousandth of a degree. Therefore an ordinary
    bundle leaves them out. In a rig they determine the rotations between its heads, if control
    points fix the height of the ground. Without control points, estimated heights of an adjustment
    would become observations of the next.
    """
    used = np.flatnonzero(np.isfinite(block.image_points.sigma_px))
    points = block.image_points[used]
    exposure = block.images.exposure_idx[points.image_idx]
    first = np.full(len(block.points), len(block.trajectory))
    last = np.full(len(block.points), -1)
    np.minimum.at(first, points.point_idx, exposure)
    np.maximum.at(last, points.point_idx, exposure)
    rays = np.bincount(points.point_idx, minlength=len(block.points))
    alone: Mask = (first == last) & (rays >= 2)
    alone[block.control.point_idx] = False
    alone[block.check.point_idx] = False
    return np.flatnonzero(alone)


def heads_at_once(block: Block) -> Index:
    """Return how often a point is measured by 0, 1, 2, ... heads of one exposure."""
    points = block.image_points
    exposure = block.images.exposure_idx[points.image_idx]
    together = exposure * len(block.points) + points.point_idx
    return np.bincount(np.unique(together, return_counts=True)[1], minlength=1)


def observe_heights(block: Block, bundle: Bundle, points: Index) -> Block:
    """Return the block with points that have the observed height of their nearest neighbours.

    The heads' lenses are so close together, compared with the flying height, that relief moves
    the points by only hundredths of a pixel between heads. So a rough height is enough.

    Parameters
    ----------
    block : Block
    bundle : Bundle
        An adjustment of the block without these points.
    points : ndarray
        Points that are measured but not surveyed.

    Returns
    -------
    Block
        The points are height control. Their standard deviation is the RMS height difference of
        nearest neighbours among the points of the bundle.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415 few flights have a rig, and it loads long

    known = bundle.state.x_m[np.unique(bundle.network.image_points.point_idx)]
    tree = cKDTree(known[:, :2])
    nearest: Index = np.asarray(tree.query(known[:, :2], k=[2])[1])[:, 0]
    sigma = np.sqrt(np.mean((known[nearest, 2] - known[:, 2]) ** 2))
    level = np.full(len(points), known[:, 2].mean())
    x_m = _on_first_ray(block, bundle, points, level)
    x_m = _on_first_ray(block, bundle, points, known[tree.query(x_m[:, :2])[1], 2])
    control = block.control
    return replace(
        block,
        control=SurveyedPoints(
            point_idx=np.concatenate([control.point_idx, points]),
            x_m=np.concatenate([control.x_m, x_m]),
            R_g_m=np.concatenate([control.R_g_m, block.frame.grid_axes(x_m)]),
            sigma_m=np.concatenate(
                [control.sigma_m, np.tile([np.inf, np.inf, sigma], (len(points), 1))]
            ),
        ),
    )


def _on_first_ray(block: Block, bundle: Bundle, points: Index, height: Array) -> Array:
    """Return the positions at given heights on the first ray of every point, mapping frame, m."""
    rows = np.flatnonzero(np.isin(block.image_points.point_idx, points))
    first = rows[np.unique(block.image_points.point_idx[rows], return_index=True)[1]]
    image = block.image_points.image_idx[first]
    rays = directions(
        Measurement(
            cameras=bundle.cameras,
            camera_idx=block.images.camera_idx[image],
            T_m_c=bundle.T_m_c[image],
            colrow=block.image_points.colrow[first],
        )
    )
    origin = bundle.T_m_c.r[image]
    return origin + rays * ((height - origin[:, 2]) / rays[:, 2])[:, None]


# --- relative orientation --------------------------------------------------------------------


def relative_orientation(
    rig: Mounting, synthetic: Camera | None, *, weak: bool = False, as_declared: bool = False
) -> RelativeOrientation:
    """Return the orientation of a rig's heads in the synthetic frame, from their mountings.

    Parameters
    ----------
    rig : Mounting
        The first head is the reference.
    synthetic : Camera or None
        Its declared mounting turns the body frame into the synthetic frame. A flight without a
        table [synthetic] has none.
    weak : bool
        Whether undetermined parameters are accepted.
    as_declared : bool
        Whether the first head keeps its declared attitude: all heads are turned back by its
        change of boresight, which moves the synthetic frame with them.

    Returns
    -------
    RelativeOrientation
        As `heads.relative_orientation` defines it. R_s_h = R_s_b R_b_h. The positions are the
        differences of the lever arms in the synthetic frame, at the first head's mean scale over
        the exposures that all heads have. The covariance takes the heights over ground as
        known; their relative errors are some hundred thousandths.

    Raises
    ------
    AdjustmentError
        Where there is no synthetic camera, the heads are not determined, the first one's mounting
        apart, or they share no exposure.
    """
    if synthetic is None:
        raise AdjustmentError("flight.toml has no table [synthetic]")
    calibration = rig.calibration
    if not weak and (open_ones := _open(calibration)):
        first, others = open_ones[0], len(open_ones) - 1
        so_are = f"; so are {others} others" if others else ""
        raise AdjustmentError(f"{first.camera} {first.name} is not determined{so_are}")
    heads = calibration.cameras
    scale = image_scale(rig)
    R_s_b = synthetic.T_b_c.R.T
    T_b_h = mountings(heads)
    xyz = scale * (T_b_h.r - T_b_h.r[0]) @ R_s_b.T
    xyz[:, 2] += heads[0].interior.f
    xyz[:, :2] -= xyz[:, :2].mean(axis=0)
    declared = rig.bundle.network.block.cameras[0].T_b_c.R if as_declared else T_b_h.R[0]
    opk = Pose(R=R_s_b @ declared @ T_b_h.R[0].T @ T_b_h.R, r=xyz).opk
    J = _jacobian(scale * R_s_b, xyz / heads[0].interior.f, opk)
    if as_declared:
        _less_first(J, T_b_h.R)
    columns = np.hstack([calibration.layout.interior, calibration.layout.mount]).ravel()
    estimated = columns >= 0
    J = J[:, estimated]
    cov = calibration.cov[np.ix_(columns[estimated], columns[estimated])]
    return RelativeOrientation(
        heads=heads,
        xyz_mm=xyz,
        opk=opk,
        cov_joint=calibration.sigma0_sq * propagate(J, cov),
        n_exposures=len(_first_images(rig.bundle)),
        turns=None if calibration.turns is None else np.sqrt(R_s_b**2 @ calibration.turns**2),
    )


def _open(calibration: Calibration) -> list[Parameter]:
    """Return undetermined parameters; a common change of all mountings may be open."""
    open_ones, columns = undetermined(calibration), calibration.layout
    _, between, T = between_heads(calibration, columns)
    if not open_ones or not len(between) or calibration.open_columns.any():
        return open_ones
    sigma = np.sqrt(calibration.sigma0_sq) * sigmas(propagate(T[between], calibration.cov))
    turns = np.isin(between, columns.mount[:, 3:])
    if np.any(sigma > np.where(turns, np.radians(LIMIT_BORESIGHT_DEG), LIMIT_LEVER_M)):
        return open_ones
    mounted = columns.mount[columns.mount >= 0]
    lens_columns = np.setdiff1d(np.arange(len(T)), mounted)
    of_lenses = calibration.cov[np.ix_(lens_columns, lens_columns)]
    layout, is_open = holding(columns, mounted), calibration.open_columns[lens_columns]
    return undetermined(replace(calibration, layout=layout, cov=of_lenses, open_columns=is_open))


def _less_first(J: Array, R_b_h: Array) -> None:
    """Subtract the rotation common to all heads, that of the first, from the angles' rows of J."""
    n = len(R_b_h)
    by_boresight = J[: 6 * n].reshape(n, 6, n, -1)[:, 3:, :, len(INTERIOR) + 3 :]
    each = np.arange(n)
    by_boresight[:, :, 0] -= by_boresight[each, :, each] @ np.swapaxes(R_b_h, 1, 2) @ R_b_h[0]
    by_boresight[0] = 0.0  # exactly: the first one's angles have no sigma


def image_scale(rig: Mounting) -> float:
    """Return the mean image scale of the first head, mm per m on the ground.

    Raises
    ------
    AdjustmentError
        Where the heads share no exposure.
    """
    return float(ground_scale(rig.bundle, _first_images(rig.bundle))[0].mean())


def _first_images(bundle: Bundle) -> Index:
    """Return the images of the first head at the exposures at which every head has measured."""
    block = bundle.network.block
    camera, exposure = block.images.camera_idx, block.images.exposure_idx
    measured = np.unique(bundle.network.image_points.image_idx)
    has_measured = np.zeros((len(block.trajectory), len(block.cameras)), dtype=bool)
    has_measured[exposure[measured], camera[measured]] = True
    complete: Mask = np.all(has_measured, axis=1)
    images = measured[(camera[measured] == 0) & complete[exposure[measured]]]
    if len(images) == 0:
        raise AdjustmentError("the heads share no exposure at which all of them have measurements")
    return images


def _jacobian(mm_per_m: Array, by_f: Array, opk: Array) -> Array:
    """Return d(joint quantities) / d(interior orientation and mounting, head by head).

    Parameters
    ----------
    mm_per_m : ndarray, shape (3, 3)
        Body axes to synthetic axes, times the scale.
    by_f : ndarray, shape (n_heads, 3)
        d(positions) / d(first focal length), to which they are proportional.
    opk : ndarray, shape (n_heads, 3)

    Returns
    -------
    ndarray, shape (16 n_heads, 16 n_heads)
        Rows in the order of `RelativeOrientation.cov_joint`.
    """
    n, inner = len(opk), len(INTERIOR)
    outer = np.zeros((n, 6, n, inner + len(MOUNT)))
    lever, turn = slice(inner, inner + 3), slice(inner + 3, None)
    for k in range(n):
        outer[k, :3, k, lever] += mm_per_m
        outer[k, :3, 0, lever] -= mm_per_m
        outer[k, 3:, k, turn] = opk_jacobian(opk[k])
    outer[:, :2] -= outer[:, :2].mean(axis=0)
    outer[:, :3, 0, 0] = by_f
    interior = np.eye(n * (inner + len(MOUNT))).reshape(n, inner + len(MOUNT), -1)[:, :inner]
    return np.concatenate([outer.reshape(6 * n, -1), interior.reshape(inner * n, -1)])
