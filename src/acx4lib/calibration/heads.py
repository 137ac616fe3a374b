"""Calibration of the heads and their orientation in the synthetic frame (2.1, 4.1, Table 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block, select_cameras
from acx4lib.bundle.adjust import Bundle, adjust, free_orientation, qualities
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.bundle.observations import shared_errors
from acx4lib.bundle.rejections import without
from acx4lib.calibration.estimates import (
    from_bundle,
    parameter_rows,
    reported_covariance,
    require_control,
    undetermined,
)
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import INTERIOR, Camera, Interior, distortion, xy_from_colrow
from acx4lib.geometry.frames import Pose, mean_rotation, opk_jacobian, skew, transform
from acx4lib.geometry.parameters import RELATIVE
from acx4lib.least_squares.adjustment import cross_covariance
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.model import Model

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Heads:
    """The self-calibrations of all heads.

    Attributes
    ----------
    bundles : dict of str to Bundle
        By head.
    failures : dict of str to str
        Why a head could not be adjusted.
    """

    bundles: dict[str, Bundle]
    failures: dict[str, str]

    def __repr__(self) -> str:
        """Name the heads in a line."""
        failed = f"could not be adjusted: {', '.join(self.failures)}" if self.failures else ""
        return shown.line("Heads", *self.bundles, failed)

    def table(self) -> pd.DataFrame:
        """Return the parameters of all heads with their units and sigma."""
        return shown.parameter_table(
            row
            for fit in self.bundles.values()
            for row in parameter_rows(from_bundle(fit), only_interior=True)
        )

    def quality(self) -> pd.DataFrame:
        """Return the adjustments, a row for every head."""
        return qualities("camera", self.bundles)


@dataclass(frozen=True, kw_only=True, eq=False)
class RelativeOrientation:
    """Heads in the synthetic frame, as Table 1 counts them.

    Attributes
    ----------
    heads : tuple of Camera
        With calibrated interior orientation.
    xyz_mm : ndarray, shape (n_heads, 3)
        Xc, Yc, Zc: positions of the heads over the synthetic image, whose plane is Z = 0.
    opk : ndarray, shape (n_heads, 3)
        omega, phi, kappa of eq. (6) from the synthetic frame to the head, radians.
    cov_joint : ndarray, shape (16 n_heads, 16 n_heads)
        A posteriori: first for each head Xc, Yc, Zc (mm), omega, phi, kappa (rad), then for each
        head the interior orientation in the order of `camera.INTERIOR`, zero where held. Tilt
        and principal point of a head compensate each other, so both are needed together.
    n_exposures : int
    turns : ndarray, shape (3,), or None
        Standard deviation of rotations of heads at single exposures, about the axes of the
        synthetic image, radians; None where it is not known.
    """

    heads: tuple[Camera, ...]
    xyz_mm: Array
    opk: Array
    cov_joint: Array
    n_exposures: int
    turns: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.heads)
        for name in ("xyz_mm", "opk"):
            expected.shape(name, getattr(self, name), (n, 3))
        expected.shape("cov_joint", self.cov_joint, (16 * n, 16 * n))

    def __repr__(self) -> str:
        """Name the heads and the number of exposures in one line."""
        names = shown.names([camera.name for camera in self.heads])
        n = shown.count(self.n_exposures, "exposure")
        return shown.line("RelativeOrientation", f"{names} over {n}")

    def table(self) -> pd.DataFrame:
        """Return the orientation of every head; sigma of what is held is NaN."""
        to_shown = np.array([1.0, 1.0, 1.0, *3 * [np.degrees(1.0)]])
        values = np.hstack([self.xyz_mm, self.opk]) * to_shown
        sigma = np.where(self.sigma > 0, self.sigma, np.nan) * to_shown
        return shown.parameter_table(
            shown.Row(camera.name, *RELATIVE[i], float(values[k, i]), float(sigma[k, i]))
            for k, camera in enumerate(self.heads)
            for i in range(len(RELATIVE))
        )

    @property
    def cov(self) -> Array:
        """Covariance of Xc, Yc, Zc (mm), omega, phi, kappa (rad), (6 n_heads, 6 n_heads)."""
        n = 6 * len(self.heads)
        return self.cov_joint[:n, :n]

    @property
    def sigma(self) -> Array:
        """Standard deviations, shape (n_heads, 6): mm and radians."""
        return sigmas(self.cov).reshape(-1, 6)


def varied(orientation: RelativeOrientation, i: int, step: float) -> RelativeOrientation:
    """Return the orientation with one parameter changed, numbered as in `cov_joint`."""
    n = 6 * len(orientation.heads)
    if i >= n:
        k, j = divmod(i - n, len(INTERIOR))
        heads = list(orientation.heads)
        interior = heads[k].interior.to_array()
        interior[j] += step
        heads[k] = heads[k].with_interior(Interior.from_array(interior))
        return replace(orientation, heads=tuple(heads))
    xyz, opk = orientation.xyz_mm.copy(), orientation.opk.copy()
    (xyz if i % 6 < 3 else opk)[i // 6, i % 3] += step
    return replace(orientation, xyz_mm=xyz, opk=opk)


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class CommonExposures:
    """The poses of all heads at the exposures where all heads are oriented.

    Attributes
    ----------
    names : tuple of str
        Of the exposures.
    idx : ndarray, shape (n,)
        Rows of the trajectory.
    images : tuple of ndarray, shape (n,)
        By head, the images of its bundle.
    T_m_b : Pose
        Of the body, from the trajectory.
    T_m_h : tuple of Pose
        By head, from its bundle.
    scale, height : ndarray, shape (n,)
        Image scale of the first head, mm per m on the ground, and its height over ground, m.
    """

    names: tuple[str, ...]
    idx: Index
    images: tuple[Index, ...]
    T_m_b: Pose
    T_m_h: tuple[Pose, ...]
    scale: Array
    height: Array


def calibrate_heads(
    block: Block, heads: Sequence[str], model: Model, *, after: Heads | None = None
) -> Heads:
    """Adjust every head by itself with free exterior orientation, and reject gross errors.

    Parameters
    ----------
    block : Block
    heads : sequence of str
        Cameras of the block.
    model : Model
        Its `fix` and `gnss` have no effect.
    after : Heads, optional
        Another calibration in the same block. Its rejected gross errors are taken over; no others
        are searched for.

    Returns
    -------
    Heads
        A head that cannot be adjusted is in `failures`.
    """
    network = partial(free_orientation, model=model)
    bundles, failures = {}, {}
    for name in heads:
        alone = select_cameras(block, [name])
        before = after.bundles.get(name) if after else None
        try:
            require_control(alone)
            if before is None:
                bundles[name] = adjust_rejecting(alone, network)
            else:
                fit = adjust(network(without(alone, before.rejected)))
                bundles[name] = replace(fit, rejected=before.rejected)
        except AdjustmentError as error:
            failures[name] = str(error)
    return Heads(bundles=bundles, failures=failures)


def above_gnss(fit: Bundle) -> float:
    """Return how high a head's images stand above the trajectory's positions in the mean, m.

    Parameters
    ----------
    fit : Bundle
        Of one head by itself, which observes no positions.
    """
    block = fit.network.block
    above = fit.T_m_c.r[:, 2] - block.trajectory.T_m_b.r[block.images.exposure_idx, 2]
    return float(above[fit.oriented].mean())


def focal_lengths_by_gnss(tried: Sequence[Heads]) -> dict[str, float]:
    """Return the focal lengths with which the heads would stand at the trajectory's heights.

    A wrong focal length lifts or lowers the cameras in proportion. A straight line through the
    mean heights over the held focal lengths therefore gives the right focal length. A lever arm is
    not subtracted: 1 m of it is f over the flying height in m.

    Parameters
    ----------
    tried : sequence of Heads
        The same heads, with at least two different focal lengths of each.

    Returns
    -------
    dict of str to float
        f in mm by head; only heads that could always be adjusted.
    """
    focal_lengths = {}
    for name in tried[0].bundles if tried else ():
        fits = [heads.bundles[name] for heads in tried if name in heads.bundles]
        if len(fits) == len(tried):
            rise = [above_gnss(fit) for fit in fits]
            f = [fit.cameras[0].interior.f for fit in fits]
            focal_lengths[name] = float(np.polynomial.Polynomial.fit(rise, f, 1)(0.0))
    return focal_lengths


def relative_orientation(
    heads: Heads, synthetic: Camera | None, *, weak: bool = False
) -> RelativeOrientation:
    """Return the orientation of heads in the synthetic frame, mean of their common exposures.

    Parameters
    ----------
    heads : Heads
        The first one is the reference.
    synthetic : Camera or None
        Its declared mounting turns the body frame into the synthetic frame. A flight without a
        table [synthetic] has none.
    weak : bool
        Whether undetermined interior orientations are accepted.

    Raises
    ------
    AdjustmentError
        Where there is no synthetic camera, a head could not be adjusted or its interior
        orientation is not determined, or no exposure at which all heads are oriented.
    ValueError
        For no heads.

    Notes
    -----
    The covariance is propagated from the heads' full covariance matrices, from the control points
    that the heads share, and from the trajectory. The scatter of the exposures would be too
    small: an error of a head's interior orientation is the same at all exposures.
    """
    if synthetic is None:
        raise AdjustmentError("flight.toml has no table [synthetic]")
    if heads.failures:
        raise AdjustmentError(f"{', '.join(heads.failures)} could not be adjusted")
    fits = list(heads.bundles.values())
    if not weak and (
        open_ones := [n for n, fit in heads.bundles.items() if undetermined(from_bundle(fit))]
    ):
        msg = f"the interior orientation of {', '.join(open_ones)} is not determined"
        raise AdjustmentError(msg)
    common = common_exposures(heads)
    T_m_b, T_m_h, scale = common.T_m_b, common.T_m_h, common.scale
    R_b_s = synthetic.T_b_c.R
    R_s_m = np.swapaxes(T_m_b.R @ R_b_s, -1, -2)
    xyz, opk = np.zeros((len(fits), 3)), np.zeros((len(fits), 3))
    for k, T in enumerate(T_m_h):
        xyz[k] = (scale[:, None] * transform(R_s_m, T.r - T_m_h[0].r)).mean(axis=0)
        opk[k] = Pose(R=mean_rotation(R_s_m @ T.R), r=xyz[k]).opk
    xyz[:, 2] += fits[0].state.interiors[0].f
    xyz[:, :2] -= xyz[:, :2].mean(axis=0)
    J, K = _jacobians(T_m_b, T_m_h, R_b_s, scale=scale, height=common.height)
    # all positions in mm are proportional to the first head's focal length
    by_f = np.hstack([xyz / fits[0].state.interiors[0].f, np.zeros_like(opk)]).ravel()
    cov = _covariance(fits, common.images, common.idx, (J, K, by_f))
    to_opk = np.eye(len(cov))
    for k in range(len(fits)):
        angles = slice(6 * k + 3, 6 * k + 6)
        to_opk[angles, angles] = opk_jacobian(opk[k])
    return RelativeOrientation(
        heads=tuple(fit.cameras[0] for fit in fits),
        xyz_mm=xyz,
        opk=opk,
        cov_joint=propagate(to_opk, cov),
        n_exposures=len(common.names),
    )


def can_be_calibrated(block: Block) -> bool:
    """Tell whether heads show the three control points that they need one by one.

    Parameters
    ----------
    block : Block
        Of the heads, with the control points that are measured in it.
    """
    return len(block.image_points) > 0 and len(block.control) >= 3


def declared_orientation(heads: Sequence[Camera], synthetic: Camera) -> RelativeOrientation:
    """Return the declared orientation of heads, for heads without a calibration.

    Parameters
    ----------
    heads : sequence of Camera
        The first one is the reference.
    synthetic : Camera
        Its declared mounting turns the body frame into the synthetic frame.

    Returns
    -------
    RelativeOrientation
        Of one perspective centre, without exposures and covariance.
    """
    n, R_b_h = len(heads), np.stack([head.T_b_c.R for head in heads])
    xyz = np.tile([0.0, 0.0, heads[0].interior.f], (n, 1))
    return RelativeOrientation(
        heads=tuple(heads),
        xyz_mm=xyz,
        opk=Pose(R=synthetic.T_b_c.R.T @ R_b_h, r=xyz).opk,
        cov_joint=np.zeros((16 * n, 16 * n)),
        n_exposures=0,
    )


def common_exposures(heads: Heads) -> CommonExposures:
    """Return the poses of all heads at the exposures that they have in common.

    Raises
    ------
    AdjustmentError
        Where there is no exposure at which all heads are oriented.
    ValueError
        For no heads.
    """
    fits = list(heads.bundles.values())
    trajectory = fits[0].network.block.trajectory
    image = np.full((len(fits), len(trajectory)), -1)
    complete: Mask = np.all(np.isfinite(trajectory.sigma_attitude), axis=1)
    for k, fit in enumerate(fits):
        exposure = fit.network.block.images.exposure_idx
        image[k, exposure] = np.arange(len(exposure))
        complete &= np.isin(np.arange(len(trajectory)), exposure[fit.oriented])
    exposures = np.flatnonzero(complete)
    if len(exposures) == 0:
        msg = (
            "the heads share no exposure at which all of them are oriented; each needs images "
            "there, and three control points off one line in its images"
        )
        raise AdjustmentError(msg)
    images = tuple(image[:, exposures])
    scale, height = ground_scale(fits[0], images[0])
    return CommonExposures(
        names=tuple(trajectory.exposures[i] for i in exposures),
        idx=exposures,
        images=images,
        T_m_b=trajectory.T_m_b[exposures],
        T_m_h=tuple(fit.T_m_c[idx] for fit, idx in zip(fits, images, strict=True)),
        scale=scale,
        height=height,
    )


def ground_scale(first: Bundle, images: Index) -> tuple[Array, Array]:
    """Return the image scale, mm per m on the ground, and the height over ground, m.

    Parameters
    ----------
    first : Bundle
    images : ndarray, shape (n,)
        Images of the bundle's first camera.

    Returns
    -------
    scale, height : ndarray, shape (n,)
        The ground is the mean height of the points in an image.
    """
    points = first.network.image_points
    z = first.state.x_m[points.point_idx, 2]
    n_images = len(first.network.block.images)
    count = np.bincount(points.image_idx, minlength=n_images)
    ground = np.bincount(points.image_idx, z, minlength=n_images) / np.maximum(count, 1)
    height = first.T_m_c.r[images, 2] - ground[images]
    return first.state.interiors[0].f / height, height


def _jacobians(
    T_m_b: Pose, T_m_h: Sequence[Pose], R_b_s: Array, *, scale: Array, height: Array
) -> tuple[Array, Array]:
    """Return the derivatives of (Xc, Yc, Zc, rotation about the head's axes) of all heads.

    Returns
    -------
    by_pose : ndarray, shape (n_heads, 6, n_heads, n_exposures, 6)
        By the heads' poses.
    by_body : ndarray, shape (n_heads, 6, n_exposures, 6)
        By the trajectory.
    """
    n_heads, n = len(T_m_h), len(T_m_b)
    by_pose, by_body = np.zeros((n_heads, 6, n_heads, n, 6)), np.zeros((n_heads, 6, n, 6))
    R_s_m = np.swapaxes(T_m_b.R @ R_b_s, -1, -2)
    per_mm = np.moveaxis(scale[:, None, None] * R_s_m, 0, 1) / n  # (3, n, 3)
    for k, T in enumerate(T_m_h):
        d_m = T.r - T_m_h[0].r
        d_b = np.einsum("nji,nj->ni", T_m_b.R, d_m)
        by_pose[k, :3, k, :, :3] += per_mm
        by_pose[k, :3, 0, :, :3] -= per_mm
        # the scale itself depends on the first head's height
        by_pose[k, :3, 0, :, 2] -= np.einsum("inj,nj->in", per_mm, d_m) / height
        by_pose[k, 3:, k, :, 3:] = np.eye(3)[:, None, :] / n
        turned = scale[:, None, None] * R_b_s.T @ skew(d_b)
        by_body[k, :3, :, 3:] = np.moveaxis(turned, 0, 1) / n
        R_h_b = np.swapaxes(T.R, -1, -2) @ T_m_b.R
        by_body[k, 3:, :, 3:] = -np.moveaxis(R_h_b, 0, 1) / n
    by_pose[:, :2] -= by_pose[:, :2].mean(axis=0)
    by_body[:, :2] -= by_body[:, :2].mean(axis=0)
    return by_pose, by_body


def _covariance(
    fits: Sequence[Bundle],
    images: Sequence[Index],
    exposures: Index,
    derivatives: tuple[Array, Array, Array],
) -> Array:
    """Return the joint covariance (16 n_heads) from heads, shared control, and trajectory.

    `derivatives` are by the heads' poses, by the trajectory, by the first focal length.
    """
    J, K, by_f = derivatives
    n_heads, n = len(fits), 16 * len(fits)
    cov, by_control = np.zeros((n, n)), []
    for k, (fit, idx) in enumerate(zip(fits, images, strict=True)):
        columns = fit.network.layout
        lens = columns.interior[0]
        by_columns = np.zeros((n, columns.n_columns))
        by_columns[: 6 * n_heads, columns.pose[idx].ravel()] = J[:, :, k].reshape(6 * n_heads, -1)
        rows = 6 * n_heads + len(INTERIOR) * k + np.flatnonzero(lens >= 0)
        by_columns[rows, lens[lens >= 0]] = 1.0
        if k == 0 and lens[0] >= 0:
            by_columns[: len(by_f), lens[0]] = by_f
        by_columns *= np.sqrt(fit.solution.sigma0_sq)
        by_control.append(by_columns @ _by_control(fit))
        cov += fit.solution.inverse.times(by_columns) @ by_columns.T
        cov -= by_control[k] @ by_control[k].T
    together: Array = np.sum(by_control, axis=0)
    by_body = np.zeros((n, len(exposures), 6))
    by_body[: 6 * n_heads] = K.reshape(-1, len(exposures), 6)
    trajectory = fits[0].network.block.trajectory
    cov += np.einsum("iea,eab,jeb->ij", by_body, trajectory.cov[exposures], by_body)
    if (shared := shared_errors(trajectory, exposures)) is not None:
        cov += shared.among(np.moveaxis(by_body, 1, 0))
    return cov + together @ together.T


def _by_control(fit: Bundle) -> Array:
    """Return d(columns) / d(control coordinates) in units of the coordinates' sigma.

    Shape (n_columns, 3 n_control), for all control points of the block: the same for all heads.
    """
    network = fit.network
    control = network.control
    cross = cross_covariance(network, fit.state, fit.solution, control.point_idx)
    sigma = np.where(control.sigma_m > 0, control.sigma_m, np.inf)
    out = np.zeros((len(network.block.points), 3, network.n_columns))
    out[control.point_idx] = (control.R_g_m @ cross) / sigma[:, :, None]
    return out[network.block.control.point_idx].reshape(-1, network.n_columns).T


# --- The distortion of a calibrated camera over its image (section 4.1, eqs 7-11)


RADIAL = ("k1", "k2", "k3")


def corner_radius(camera: Camera) -> float:
    """Return half the image diagonal, mm."""
    return 0.5 * camera.pixel_mm * camera.diagonal_px


def radial_profile(fit: Bundle) -> tuple[Array, Array, Array]:
    """Compute the radial distortion of a calibrated camera from its middle to its corner.

    Parameters
    ----------
    fit : Bundle
        An adjustment of one camera.

    Returns
    -------
    r, px, sigma_px : ndarray, shape (n,)
        Radius, mm; distortion of eqs (7)-(8) and its a posteriori standard deviation, px.
    """
    camera, calibration = fit.cameras[0], from_bundle(fit)
    r = np.linspace(0.0, corner_radius(camera), 200)
    powers = np.stack([r**3, r**5, r**7], axis=1) / camera.pixel_mm
    values = np.array([getattr(camera.interior, name) for name in RADIAL])
    columns = calibration.layout.interior[0][[INTERIOR.index(name) for name in RADIAL]]
    padded = np.pad(reported_covariance(calibration), (0, 1))  # column -1: held, no variance
    cov = padded[np.ix_(columns, columns)]
    return r, powers @ values, np.sqrt(np.einsum("ni,ij,nj->n", powers, cov, powers))


def largest_at_corners(camera: Camera) -> float:
    """Return the length of the whole distortion, eqs (7)-(10), at the worst corner, px."""
    w, h = camera.width_px - 0.5, camera.height_px - 0.5
    corners = np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])
    dxy = distortion(camera.interior, xy_from_colrow(camera, corners))
    return float(np.hypot(*dxy.T).max() / camera.pixel_mm)
