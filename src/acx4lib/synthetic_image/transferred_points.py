"""Measurements of heads transferred into synthetic images, with the heads' errors (section 2.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected, shown
from acx4lib.block import Block, ImagePoints, first_images, synthetic_images
from acx4lib.bundle.reliability import gains
from acx4lib.calibration.heads import RelativeOrientation, varied
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, border_distance, colrow_from_xy, inside, xy_from_colrow
from acx4lib.least_squares.covariance import sigmas
from acx4lib.synthetic_image.frame import (
    head_from_synthetic,
    synthetic_from_head,
    synthetic_from_head_jacobian,
)

if TYPE_CHECKING:
    import pandas as pd


# --- Measurements of the heads, transferred into the synthetic images of their exposures
# (section 2.1)
#
# A measured point is corrected for its head's distortion, and its ray is intersected with the
# plane of the synthetic image, as the renderer maps pixels, but without its grid. Of several heads
# that measured a point at an exposure, one is taken: the one from which `rendering` would take the
# pixel.


@dataclass(frozen=True, kw_only=True, eq=False)
class TransferredPoints:
    """A block's measurements in its synthetic images, one for each exposure and point.

    Attributes
    ----------
    exposure_idx, point_idx, camera_idx : ndarray, shape (n,)
        Indices of the block's exposures, points and cameras; the camera is the head from which
        the measurement was transferred.
    colrow : ndarray, shape (n, 2)
        Pixels of the synthetic image.
    sigma_px : ndarray, shape (n, 2)
        Of col and row: from the measurement and from turns of the heads at single exposures, not
        from their calibration.
    n_left_out : int
        Points of exposures that lie outside the synthetic image.
    """

    exposure_idx: Index
    point_idx: Index
    camera_idx: Index
    colrow: Array
    sigma_px: Array
    n_left_out: int = 0

    def __repr__(self) -> str:
        """Summarize the points in one line."""
        exposures = shown.count(len(np.unique(self.exposure_idx)), "exposure")
        left_out = f"{self.n_left_out} left out" if self.n_left_out else ""
        return shown.line("TransferredPoints", f"{len(self)} of {exposures}", left_out)

    def table(self) -> pd.DataFrame:
        """Return the number of measurements of every head, and their median sigma.

        Heads are counted from zero, in the order of the block's cameras.
        """
        rows = {}
        for k in np.unique(self.camera_idx).tolist():
            of_head = self.camera_idx == k
            col, row = np.median(self.sigma_px[of_head], axis=0).tolist()
            rows[k] = {
                "measurements": int(of_head.sum()),
                "median sigma col (px)": col,
                "median sigma row (px)": row,
            }
        return shown.row_table("head", rows)

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.colrow)


def transfer(
    block: Block, orientation: RelativeOrientation, synthetic: Camera
) -> TransferredPoints:
    """Transfer the measurements of a block's heads into their synthetic images.

    Valid as far as all heads look from one place: relief and flying height move nothing.

    Parameters
    ----------
    block : Block
        Its cameras are heads of `orientation`.
    orientation : RelativeOrientation
    synthetic : Camera

    Returns
    -------
    TransferredPoints
        In the order of the exposures' first images, then of the measurements.

    Raises
    ------
    ValueError
        Where a camera of the block is no head.
    """
    names = [head.name for head in orientation.heads]
    expected.names_of("heads", [camera.name for camera in block.cameras], names)
    heads = np.array([names.index(camera.name) for camera in block.cameras], dtype=np.intp)
    rows = _nearest_to_the_middle(block, heads, orientation.heads)
    points = block.image_points[rows]
    camera_idx = block.images.camera_idx[points.image_idx]
    colrow, sigma = np.full((len(rows), 2), np.nan), np.full((len(rows), 2), np.nan)
    for k in np.unique(heads):
        of_head = np.flatnonzero(heads[camera_idx] == k)
        xy = synthetic_from_head(orientation, int(k), points.colrow[of_head])
        colrow[of_head] = colrow_from_xy(synthetic, xy)
        J = synthetic_from_head_jacobian(orientation, int(k), points.colrow[of_head])
        sigma[of_head] = (
            np.linalg.norm(J, axis=2) * points.sigma_px[of_head, None] / synthetic.pixel_mm
        )
    if orientation.turns is not None:
        sigma = np.hypot(sigma, _by_turns(synthetic, colrow, orientation.turns))
    kept = np.flatnonzero(inside(synthetic, colrow))
    return TransferredPoints(
        exposure_idx=block.images.exposure_idx[points.image_idx[kept]],
        point_idx=points.point_idx[kept],
        camera_idx=camera_idx[kept],
        colrow=colrow[kept],
        sigma_px=sigma[kept],
        n_left_out=len(rows) - len(kept),
    )


def _by_turns(synthetic: Camera, colrow: Array, turns: Array) -> Array:
    """Return the standard deviations of col and row due to turns of a head, px, (n, 2)."""
    (x, y), f = xy_from_colrow(synthetic, colrow).T, synthetic.interior.f
    J = np.array([[x * y / f, f + x**2 / f, y], [f + y**2 / f, x * y / f, x]])  # signs apart
    return np.sqrt(np.square(J).transpose(2, 0, 1) @ turns**2) / synthetic.pixel_mm


def _nearest_to_the_middle(block: Block, heads: Index, cameras: Sequence[Camera]) -> Index:
    """Select a measurement per point and exposure: the farthest from its head's border.

    At equal distances it is the first head's, as at a seam.
    """
    points = block.image_points
    head = heads[block.images.camera_idx[points.image_idx]]
    exposure = block.images.exposure_idx[points.image_idx]
    distance = np.zeros(len(points))
    for k in np.unique(head):
        distance[head == k] = border_distance(cameras[k], points.colrow[head == k])
    order = np.lexsort((head, -distance, points.point_idx, exposure))
    key = exposure[order] * len(block.points) + points.point_idx[order]
    chosen = np.sort(order[np.unique(key, return_index=True)[1]])
    first = first_images(block)[exposure[chosen]]
    return chosen[np.argsort(first, kind="stable")]


def synthetic_block(block: Block, transferred: TransferredPoints, synthetic: Camera) -> Block:
    """Return a block's synthetic images with the transferred measurements.

    Parameters
    ----------
    block : Block
        As it was measured, in heads.
    transferred : TransferredPoints
    synthetic : Camera

    Returns
    -------
    Block
        As `synthetic_images` has it. A measurement's sigma is the root mean square of its two.
    """
    images = synthetic_images(block, synthetic)
    image_of_exposure = np.full(len(block.trajectory), -1)
    image_of_exposure[images.images.exposure_idx] = np.arange(len(images.images))
    return replace(
        images,
        image_points=ImagePoints(
            image_idx=image_of_exposure[transferred.exposure_idx],
            point_idx=transferred.point_idx,
            colrow=transferred.colrow,
            sigma_px=np.sqrt(np.mean(transferred.sigma_px**2, axis=1)),
        ),
    )


# --- Effect of errors of the heads' calibration on a camera calibrated in the synthetic image
#
# An error of a head moves all points measured in it, at every exposure, together. So this is no
# standard deviation of single points: the adjustment does not average it, and does not see it.


def with_heads(
    mounting: Mounting,
    block: Block,
    transferred: TransferredPoints,
    orientation: RelativeOrientation,
) -> Mounting:
    """Return the outcome of a method, its standard deviations with those due to the heads.

    Arguments are those of `parameter_covariance`, which is the `cov_before` of the calibration.
    """
    cov = parameter_covariance(mounting, block, transferred, orientation)
    return replace(mounting, calibration=replace(mounting.calibration, cov_before=cov))


def parameter_covariance(
    mounting: Mounting,
    block: Block,
    transferred: TransferredPoints,
    orientation: RelativeOrientation,
) -> Array:
    """Return the covariance of a synthetic camera's parameters due to its heads' calibration.

    Valid for the noise of the measurements in the calibration of the heads that transferred the
    points. The effect of a wrong focal length, held in the calibration of a head, is not included.
    Flights whose points are transferred by the same calibration share this error.

    Parameters
    ----------
    mounting : Mounting
        Of one synthetic camera, by any method, adjusted with the points.
    block : Block
        As it was measured, in heads.
    transferred : TransferredPoints
        All points of the mounting's block, in its order.
    orientation : RelativeOrientation
        The heads by which they were transferred.

    Returns
    -------
    ndarray, shape (n, n)
        A posteriori, in the columns and units of the calibration's `cov`; it adds to the covariance
        of the adjustment.

    Notes
    -----
    J S_h J^T with the joint covariance S_h of the heads and J = d(parameters) / d(heads): by the
    normal equations d(parameters) / d(points), in the two-step methods by way of eqs (12) and (13),
    times d(points) / d(heads) by differences of a standard deviation to both sides.
    """
    network, solution = mounting.bundle.network, mounting.bundle.solution
    by_bundle = mounting.by_bundle
    if by_bundle is None:
        by_bundle = np.eye(mounting.calibration.n_columns, network.n_columns)
    equations = network.equations(mounting.bundle.state)
    gain_matrices = gains(equations, solution.inverse.times(by_bundle), network.free_points)
    by_points = next(
        g for e, g in zip(equations, gain_matrices, strict=True) if e.kind == "image_point"
    )
    (camera,) = network.block.cameras
    moved = _moved(block, transferred, orientation, camera)[network.rows]
    J = np.einsum("mdc,mdk->ck", by_points, moved)
    known = np.flatnonzero(sigmas(orientation.cov_joint) > 0)
    return J @ orientation.cov_joint[np.ix_(known, known)] @ J.T


def _moved(
    block: Block, transferred: TransferredPoints, orientation: RelativeOrientation, camera: Camera
) -> Array:
    """Return d(points) / d(parameters of the heads that have a sigma), pixels, shape (n, 2, k)."""
    sigma = sigmas(orientation.cov_joint)
    known = np.flatnonzero(sigma > 0)
    names = [head.name for head in orientation.heads]
    of_block = np.array([names.index(head.name) for head in block.cameras])
    heads = of_block[transferred.camera_idx]
    xy = xy_from_colrow(camera, transferred.colrow)
    out = np.zeros((len(transferred), 2, len(known)))
    n = len(names)
    for column, i in enumerate(known.tolist()):
        k = i // 6 if i < 6 * n else (i - 6 * n) // ((len(sigma) - 6 * n) // n)
        of_head = np.flatnonzero(heads == k)
        colrow = head_from_synthetic(orientation, k, xy[of_head])
        ahead, behind = (
            synthetic_from_head(varied(orientation, i, step), k, colrow)
            for step in (sigma[i], -sigma[i])
        )
        out[of_head, :, column] = (ahead - behind) / (2 * sigma[i] * camera.pixel_mm) * [1.0, -1.0]
    return out
