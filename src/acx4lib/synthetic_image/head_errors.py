"""What the errors of the heads' calibration do to a camera calibrated in the synthetic image.

A head that is off moves all points that it measured, at every exposure, together. So this is no
standard deviation of single points: the adjustment does not average it, and does not see it.
"""

from __future__ import annotations

import numpy as np

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.reliability import gains
from acx4lib.calibration.estimates import from_bundle, to_reported
from acx4lib.calibration.heads import RelativeOrientation, varied
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.least_squares.covariance import sigmas
from acx4lib.synthetic_image.carried import CarriedPoints
from acx4lib.synthetic_image.frame import head_from_synthetic, synthetic_from_head


def parameter_covariance(
    bundle: Bundle, block: Block, carried: CarriedPoints, orientation: RelativeOrientation
) -> Array:
    """Return the covariance of a synthetic camera's parameters that its heads' calibration causes.

    Valid for the calibration of heads that carried the points, and for what the noise of its
    measurements does. What a focal length that is held wrongly does to a head is no part of it.
    Other flights that are carried by the same one share this error.

    Parameters
    ----------
    bundle : Bundle
        One synthetic camera, mounted, adjusted with the points.
    block : Block
        As it was measured, in heads.
    carried : CarriedPoints
        All points of the bundle's block, in its order.
    orientation : RelativeOrientation
        The heads by which they were carried.

    Returns
    -------
    ndarray, shape (n, n)
        Of the parameters as results report them, in the order of the bundle's columns; it adds to
        the covariance of the adjustment.

    Notes
    -----
    J S_h J^T with the joint covariance S_h of the heads and J = d(parameters) / d(heads): by the
    normal equations d(parameters) / d(points), times d(points) / d(heads) by differences of a
    standard deviation to both sides.
    """
    expected.instance("bundle", bundle, Bundle)
    expected.many("carried", carried, len(bundle.network.block.image_points), "measurements")
    calibration = from_bundle(bundle)
    columns = np.arange(calibration.n_columns)
    network, solution = bundle.network, bundle.solution
    equations = network.equations(bundle.state)
    found = gains(equations, solution.inverse, network.free_points, columns)
    by_points = next(g for e, g in zip(equations, found, strict=True) if e.kind == "image_point")
    (camera,) = network.block.cameras
    moved = _moved(block, carried, orientation, camera)[network.rows]
    J = to_reported(calibration) @ np.einsum("mdc,mdk->ck", by_points, moved)
    known = np.flatnonzero(sigmas(orientation.cov_joint) > 0)
    cov: Array = J @ orientation.cov_joint[np.ix_(known, known)] @ J.T
    return cov


def _moved(
    block: Block, carried: CarriedPoints, orientation: RelativeOrientation, camera: Camera
) -> Array:
    """Return d(points) / d(parameters of the heads that have a sigma), pixels, shape (n, 2, k)."""
    sigma = sigmas(orientation.cov_joint)
    known = np.flatnonzero(sigma > 0)
    names = [head.name for head in orientation.heads]
    of_block = np.array([names.index(head.name) for head in block.cameras])
    heads = of_block[carried.camera_idx]
    xy = xy_from_colrow(camera, carried.colrow)
    out = np.zeros((len(carried), 2, len(known)))
    n = len(names)
    for place, i in enumerate(known.tolist()):
        k = i // 6 if i < 6 * n else (i - 6 * n) // ((len(sigma) - 6 * n) // n)
        own = np.flatnonzero(heads == k)
        colrow = head_from_synthetic(orientation, k, xy[own])
        ahead, behind = (
            synthetic_from_head(varied(orientation, i, step), k, colrow)
            for step in (sigma[i], -sigma[i])
        )
        out[own, :, place] = (ahead - behind) / (2 * sigma[i] * camera.pixel_mm) * [1.0, -1.0]
    return out
