"""Direct georeferencing: camera poses by eq. (14) with known mountings, and intersection."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block
from acx4lib.bundle.observations import SharedErrors, shared_errors
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, mountings
from acx4lib.geometry.collinearity import (
    Measurement,
    as_seen,
    directions,
    image_derivatives,
    mounted_jacobian,
)
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import MappingFrame
from acx4lib.geometry.intersection import intersect
from acx4lib.georeferencing.error_sources import ErrorSources, turned
from acx4lib.least_squares.covariance import propagate
from acx4lib.model import Model

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Georeferenced:
    """Camera poses from the trajectory and a calibration, with their derivatives.

    Attributes
    ----------
    cameras : tuple of Camera
        Calibrated, in the order of the block's cameras.
    T_m_c : Pose
        One per image.
    by_body : ndarray, shape (n_images, 6, 6)
        d(camera pose) / d(body pose).
    by_parameters : ndarray, shape (n_images, 6, n)
        d(camera pose) / d(columns of the calibration).
    layout : Layout
        Columns of the calibration, for these cameras.
    cov_body : ndarray, shape (n_exposures, 6, 6)
        A priori covariances of the trajectory.
    cov_parameters : ndarray, shape (n, n)
        A priori covariance of the calibration.
    shared : SharedErrors, optional
        Covariances between the body poses of exposures.
    refraction : str
        How rays run to the cameras, as `Model` has it.
    """

    cameras: tuple[Camera, ...]
    T_m_c: Pose
    by_body: Array
    by_parameters: Array
    layout: Layout
    cov_body: Array
    cov_parameters: Array
    shared: SharedErrors | None = None
    refraction: str = "none"

    def __repr__(self) -> str:
        """Describe the cameras and the number of images in one line."""
        names = shown.names([camera.name for camera in self.cameras])
        return shown.line("Georeferenced", names, shown.count(len(self.T_m_c), "image"))

    def between(self, a: Index, b: Index) -> Array:
        """Return the covariances between the body poses of pairs of exposures, (n, 6, 6)."""
        same = (a == b)[:, None, None]
        if self.shared is None:
            return np.where(same, self.cov_body[a], 0.0)
        return np.where(same, self.cov_body[a], self.shared.between(a, b))

    def table(self) -> pd.DataFrame:
        """Return the poses of the images, which are counted from zero, in the mapping frame."""
        values = np.hstack([self.T_m_c.r, np.degrees(self.T_m_c.opk)])
        columns = ("x (m)", "y (m)", "z (m)", "ω (°)", "φ (°)", "κ (°)")
        rows = {i: dict(zip(columns, pose, strict=True)) for i, pose in enumerate(values.tolist())}
        return shown.row_table("image", rows)


def georeference(block: Block, calibration: Calibration, model: Model = Model()) -> Georeferenced:
    """Return the camera poses of a block by eq. (14), with their derivatives and covariances.

    Parameters
    ----------
    block : Block
    calibration : Calibration
        Must have every camera of the block.
    model : Model
        Of which refraction counts.

    Raises
    ------
    AdjustmentError
        Where errors that change slowly are stated, and an exposure has no time.
    ValueError
        Where the calibration lacks a camera.
    """
    names = [camera.name for camera in calibration.cameras]
    missing = [camera.name for camera in block.cameras if camera.name not in names]
    if missing:
        raise ValueError(f"the calibration has no camera {', '.join(missing)}")
    order = np.array([names.index(camera.name) for camera in block.cameras])
    cameras = tuple(calibration.cameras[k] for k in order)
    camera_idx = block.images.camera_idx
    T_b_c = mountings(cameras)[camera_idx]
    by_body, by_mount = mounted_jacobian(block.T_m_b_images, T_b_c)
    layout = replace(
        calibration.layout,
        interior=calibration.layout.interior[order],
        mount=calibration.layout.mount[order],
    )
    mount = layout.mount[camera_idx]
    by_parameters = np.zeros((len(camera_idx), 6, calibration.n_columns + 1))
    np.put_along_axis(
        by_parameters, np.broadcast_to(mount[:, None, :], by_mount.shape), by_mount, axis=2
    )
    return Georeferenced(
        cameras=cameras,
        T_m_c=block.T_m_b_images @ T_b_c,
        by_body=by_body,
        by_parameters=by_parameters[:, :, :-1],
        layout=layout,
        cov_body=block.trajectory.cov,
        cov_parameters=calibration.total_cov,
        shared=shared_errors(block.trajectory),
        refraction=model.refraction,
    )


def pose_covariances(block: Block, georeferenced: Georeferenced) -> Array:
    """Return the camera poses' covariances, (n_images, 6, 6), m and rad about the camera's axes."""
    g = georeferenced
    from_body = propagate(g.by_body, g.cov_body[block.images.exposure_idx])
    return from_body + propagate(g.by_parameters, g.cov_parameters)


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Rays:
    """Measurements to intersect, sorted by group; every group is one intersection.

    Attributes
    ----------
    image_idx : ndarray, shape (n,)
    group : ndarray, shape (n,)
        Ascending from zero.
    colrow : ndarray, shape (n, 2)
    sigma_px : ndarray, shape (n,)
    """

    image_idx: Index
    group: Index
    colrow: Array
    sigma_px: Array

    def __post_init__(self) -> None:
        expected.shape("colrow", self.colrow, (len(self.image_idx), 2))
        expected.positive("sigma_px", self.sigma_px)
        if np.any(np.diff(self.group, prepend=0) < 0):
            msg = f"group: expected ascending numbers from zero, got {self.group.tolist()[:10]} ..."
            raise ValueError(msg)

    @property
    def n_groups(self) -> int:
        """Number of intersections."""
        return int(self.group.max(initial=-1)) + 1

    def select(self, rows: Index, group: Index) -> Rays:
        """Return some of the measurements in new groups."""
        return Rays(
            image_idx=self.image_idx[rows],
            group=group,
            colrow=self.colrow[rows],
            sigma_px=self.sigma_px[rows],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Intersections:
    """Intersected points with the parts of their errors.

    Attributes
    ----------
    x_m : ndarray, shape (n_groups, 3)
        m.
    v : ndarray, shape (n, 2)
        Residuals, px.
    cov : ndarray, shape (n_groups, 3, 3)
        A priori, from image points, trajectory and calibration, m^2.
    sources : ErrorSources
        The parts of `cov`, and the errors that points share.
    by_point : ndarray, shape (n, 2, 3)
        d(v) / d(point).
    by_body : ndarray, shape (n, 2, 6)
        d(v) / d(body pose).
    by_parameters : ndarray, shape (n, 2, k)
        d(v) / d(columns of the calibration).
    """

    x_m: Array
    v: Array
    cov: Array
    sources: ErrorSources
    by_point: Array
    by_body: Array
    by_parameters: Array

    def __repr__(self) -> str:
        """Describe the number of intersected points in one line."""
        points, rays = shown.count(len(self.x_m), "point"), shown.count(len(self.v), "ray")
        return shown.line("Intersections", f"{points} of {rays}")

    def table(self) -> pd.DataFrame:
        """Return the points, counted from zero, in the mapping frame with their a priori sigma."""
        rows = {}
        sigma_of = np.sqrt(np.diagonal(self.cov, axis1=1, axis2=2))
        for i, (x_m, sigma) in enumerate(zip(self.x_m, sigma_of, strict=True)):
            for axis, value, axis_sigma in zip("xyz", x_m.tolist(), sigma.tolist(), strict=True):
                rows[i, axis, "m"] = {"value": value, "sigma": axis_sigma}
        return shown.row_table(("point", "coordinate", "unit"), rows)


def measured(block: Block, georeferenced: Georeferenced, selected: Rays) -> Measurement:
    """Return the measurements with the cameras and poses of direct georeferencing."""
    return Measurement(
        cameras=georeferenced.cameras,
        camera_idx=block.images.camera_idx[selected.image_idx],
        T_m_c=georeferenced.T_m_c[selected.image_idx],
        colrow=selected.colrow,
    )


def intersect_rays(block: Block, georeferenced: Georeferenced, selected: Rays) -> Intersections:
    """Intersect groups of rays: least squares of the image residuals.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    selected : Rays

    Returns
    -------
    Intersections
        NaN where rays do not meet in front of the cameras.

    Raises
    ------
    ValueError
        For images that are not in the block.
    """
    expected.places("selected.image_idx", selected.image_idx, len(block.images))
    measurement, refraction = measured(block, georeferenced, selected), georeferenced.refraction
    r_m, P = measurement.T_m_c.r, np.eye(2) / selected.sigma_px[:, None, None] ** 2
    x_m = intersect(r_m, directions(measurement), selected.group, selected.n_groups)
    for _ in range(20):
        apparent = as_seen(r_m, x_m[selected.group], refraction=refraction)
        v, by_interior, by_pose, B = image_derivatives(measurement, apparent)
        normal = _summed(np.swapaxes(B, 1, 2) @ P @ B, selected)
        right = _summed(np.einsum("nji,njk,nk->ni", B, P, v), selected)
        bad = ~np.all(np.isfinite(normal), axis=(1, 2))
        normal[bad] = np.eye(3)
        bad |= ~np.isfinite(np.linalg.cond(normal)) | (np.linalg.det(normal) <= 0)
        normal[bad] = np.eye(3)
        step = -np.linalg.solve(normal, right[..., None])[..., 0]
        step[bad] = np.nan
        x_m = x_m + step
        if not np.any(np.abs(step) > 1e-9):
            break
    gain = -np.linalg.inv(normal)[selected.group] @ np.swapaxes(B, 1, 2) @ P
    by_parameters = _by_columns(block, georeferenced, selected, by_interior, by_pose)
    sources = _error_sources(
        block, georeferenced, selected, gain, by_parameters=by_parameters, by_pose=by_pose
    )
    return Intersections(
        x_m=x_m,
        v=v,
        cov=sources.cov,
        sources=sources,
        by_point=B,
        by_body=by_pose @ georeferenced.by_body[selected.image_idx],
        by_parameters=by_parameters,
    )


def _by_columns(
    block: Block,
    georeferenced: Georeferenced,
    selected: Rays,
    by_interior: Array,
    by_pose: Array,
) -> Array:
    """Return d(v) / d(columns of the calibration), by way of the pose and the interior."""
    g, image_idx = georeferenced, selected.image_idx
    by_column = by_pose @ g.by_parameters[image_idx]
    columns = g.layout.interior[block.images.camera_idx[image_idx]]
    padded = np.concatenate([by_column, np.zeros((*by_column.shape[:2], 1))], axis=2)
    index = np.broadcast_to(columns[:, None, :], by_interior.shape)
    np.put_along_axis(padded, index, by_interior, axis=2)
    return padded[:, :, :-1]


def ray_covariance(block: Block, georeferenced: Georeferenced, selected: Rays) -> Array:
    """Return the joint covariance of measured minus predicted image coordinates.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    selected : Rays
        A few; the matrix is dense.

    Returns
    -------
    ndarray, shape (2 n, 2 n)
        Of columns and rows, ray by ray, px^2: from the noise of the image points, from the poses
        of the body, which rays of one exposure share, and from the calibration, which all share.
    """
    g = georeferenced
    intersections = intersect_rays(block, g, selected)
    exposure = block.images.exposure_idx[selected.image_idx]
    by_columns = intersections.by_parameters.reshape(2 * len(exposure), -1)
    return (
        np.diag(np.repeat(selected.sigma_px**2, 2))
        + by_trajectory(intersections.by_body, exposure, g)
        + by_columns @ g.cov_parameters @ by_columns.T
    )


def by_trajectory(by_body: Array, exposure: Index, georeferenced: Georeferenced) -> Array:
    """Return the joint covariance of a few image points from the poses of the body.

    Parameters
    ----------
    by_body : ndarray, shape (n, 2, 6)
        d(image point) / d(body pose).
    exposure : ndarray, shape (n,)
    georeferenced : Georeferenced

    Returns
    -------
    ndarray, shape (2 n, 2 n)
        px^2.
    """
    n = len(exposure)
    first, second = np.indices((n, n)).reshape(2, -1)
    body = georeferenced.between(exposure[first], exposure[second])
    blocks = (by_body[first] @ body @ np.swapaxes(by_body[second], 1, 2)).reshape(n, n, 2, 2)
    return np.swapaxes(blocks, 1, 2).reshape(2 * n, 2 * n)


def _summed(values: Array, selected: Rays) -> Array:
    out = np.zeros((selected.n_groups, *values.shape[1:]))
    np.add.at(out, selected.group, values)
    return out


def _error_sources(
    block: Block,
    georeferenced: Georeferenced,
    selected: Rays,
    gain: Array,
    *,
    by_parameters: Array,
    by_pose: Array,
) -> ErrorSources:
    """Propagate image noise, trajectory and calibration through the gains d(point) / d(v)."""
    g, image_idx = georeferenced, selected.image_idx
    from_image = gain @ np.swapaxes(gain, 1, 2) * selected.sigma_px[:, None, None] ** 2
    # rays of one exposure share its trajectory error: sum their sensitivities first
    exposure = block.images.exposure_idx[image_idx]
    keys, shared = np.unique(
        np.column_stack([selected.group, exposure]), axis=0, return_inverse=True
    )
    by_body = np.zeros((len(keys), 3, 6))
    np.add.at(by_body, shared.ravel(), gain @ by_pose @ g.by_body[image_idx])
    return ErrorSources(
        image=_summed(from_image, selected),
        survey=np.zeros((selected.n_groups, 3, 3)),
        point=keys[:, 0],
        exposure=keys[:, 1],
        by_body=by_body,
        by_parameters=_summed(gain @ by_parameters, selected),
        cov_body=g.cov_body,
        cov_parameters=g.cov_parameters,
        shared=g.shared,
    )


# --- Ground points of single pixels on a known height: eqs (1)-(5) and (14), with their errors


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPoints:
    """Where pixels lie on the ground.

    Attributes
    ----------
    x_m : ndarray, shape (n, 3)
        Mapping frame, m; NaN where a ray does not come down to the height.
    enh : ndarray, shape (n, 3)
        East, north, height, in the flight's system, m.
    sources : ErrorSources
        A priori errors along east, north and height, by their sources, in metres on the
        ground.
    """

    x_m: Array
    enh: Array
    sources: ErrorSources

    def __len__(self) -> int:
        """Count the points."""
        return len(self.x_m)

    @property
    def cov(self) -> Array:
        """Covariance of every point along east, north and height, shape (n, 3, 3), m^2."""
        return self.sources.cov


def ground_points(
    block: Block,
    georeferenced: Georeferenced,
    pixels: Rays,
    *,
    height_m: Array,
    sigma_height_m: Array | None = None,
) -> GroundPoints:
    """Return the points in which the rays of pixels meet surfaces of constant height.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
        The block's poses, as `direct.georeference` returns them.
    pixels : Rays
        A group for every pixel.
    height_m : ndarray, shape (n,)
        In the flight's height system, m.
    sigma_height_m : ndarray, shape (n,), optional
        Their standard deviations, by default zero; heights of two points err independently.

    Returns
    -------
    GroundPoints
        With the errors of pixel, height, interior orientation, mounting and trajectory. Common
        sources make the errors of two points correlated.

    Raises
    ------
    ValueError
        For other shapes, images that the block does not have, or pixels that share a group.

    Notes
    -----
    A point x fulfils v(x) = 0, the image residuals of eqs (1)-(11), and h(x) = h. So
    d(x) = [dv/dx; dh/dx]^-1 (-dv, dh), where dh/dx is the normal of the ellipsoid.
    """
    expected.places("pixels.image_idx", pixels.image_idx, len(block.images))
    height = expected.numbers("height_m", height_m, (len(pixels.image_idx),))
    sigma_h = np.zeros(len(height)) if sigma_height_m is None else np.asarray(sigma_height_m)
    measurement = measured(block, georeferenced, pixels)
    x_m, lifted, met = _on_surface(
        block.frame, measurement.T_m_c.r, directions(measurement), height, georeferenced.refraction
    )
    _, by_interior, by_pose, by_point = image_derivatives(measurement, lifted)
    axes = block.frame.grid_axes(x_m)
    by_residuals = np.linalg.inv(np.concatenate([by_point, axes[:, 2:]], axis=1))
    sources = _error_sources(
        block,
        georeferenced,
        pixels,
        -by_residuals[:, :, :2],
        by_parameters=_by_columns(block, georeferenced, pixels, by_interior, by_pose),
        by_pose=by_pose,
    )
    along = by_residuals[:, :, 2:] * sigma_h[:, None, None]
    sources = turned(replace(sources, survey=along @ np.swapaxes(along, 1, 2)), axes)
    return GroundPoints(
        x_m=np.where(met[:, None], x_m, np.nan),
        enh=np.where(met[:, None], block.frame.to_grid(x_m), np.nan),
        sources=replace(sources, image=np.where(met[:, None, None], sources.image, np.nan)),
    )


def _on_surface(
    frame: MappingFrame, r_m: Array, towards: Array, height: Array, refraction: str
) -> tuple[Array, Array, Mask]:
    """Return true and apparent points of rays on heights, and a mask; others go straight down."""
    up = frame.grid_axes(r_m)[:, 2]
    down = np.einsum("ni,ni->n", up, towards) < 0
    towards = np.where(down[:, None], towards, -up)
    seen_at = r_m + (frame.to_grid(r_m)[:, 2] - height)[:, None] * towards
    x_m, remaining = seen_at, np.full(len(r_m), np.inf)
    for _ in range(20):
        x_m = 2 * seen_at - as_seen(r_m, seen_at, refraction=refraction)
        remaining = frame.to_grid(x_m)[:, 2] - height
        if not np.any(np.abs(remaining) > 1e-6):
            break
        slope = np.einsum("ni,ni->n", frame.grid_axes(x_m)[:, 2], towards)
        seen_at = seen_at - (remaining / slope)[:, None] * towards
    ahead = np.einsum("ni,ni->n", seen_at - r_m, towards) > 0
    return x_m, seen_at, down & ahead & (np.abs(remaining) <= 1e-6)
