"""The heads together and one by one, and a rig whose heads share no points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acx4lib.calibration import heads as relative_orientation
from acx4lib.calibration import rig
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera
from acx4lib.tie_points.ties import refine_by_mean_differences, shared_points

ONE_BY_ONE = "one by one"
REFINED = "one by one, refined"
WITH_F = "one by one, $f$ estimated"
UNSHARED = "rig, no shared points"
RIG = "rig"
"""The ways to orient the heads, in the order of tables."""


def oriented(
    block: Block,
    together: Mounting,
    synthetic: Camera,
    *,
    free: Sequence[str],
    refraction: str = "none",
) -> dict[str, RelativeOrientation]:
    """Orient heads in every way: each by itself, and all together with and without shared points.

    Parameters
    ----------
    block : Block
        Of the heads.
    together : Mounting
        The rig, calibrated on it.
    synthetic : Camera
    free : sequence of str
        Interior parameters of the heads one by one, of which f is held first.
    refraction : str

    Returns
    -------
    dict of str to RelativeOrientation
        A way that fails is not in it.
    """
    held = tuple(name for name in free if name != "f")
    out: dict[str, RelativeOrientation] = {}
    names = [camera.name for camera in block.cameras]
    for title, estimated in ((ONE_BY_ONE, held), (WITH_F, ("f", *held))):
        heads = relative_orientation.calibrate_heads(
            block, names, free=estimated, refraction=refraction
        )
        if heads.failures:
            continue
        try:
            out[title] = relative_orientation.relative_orientation(heads.bundles, synthetic)
        except AdjustmentError:
            continue
        if title == ONE_BY_ONE:
            ties = shared_points(block, out[title])
            out[REFINED] = refine_by_mean_differences(out[title], ties)
    try:
        alone = rig.calibrate(unshared(block), free=free, refraction=refraction)
        out[UNSHARED] = rig.relative_orientation(alone, synthetic)
    except AdjustmentError:
        pass
    return {**out, RIG: rig.relative_orientation(together, synthetic)}


def gains(before: RelativeOrientation, after: RelativeOrientation) -> Array:
    """Return how many times smaller the standard deviations become, shape (n_heads, 6).

    NaN where one of them is zero: Zc of the first head, where its focal length is held.
    """
    fixed = (before.sigma == 0) | (after.sigma == 0)
    return np.where(fixed, np.nan, before.sigma / np.where(fixed, 1.0, after.sigma))


def unshared(block: Block) -> Block:
    """Return the block with every tie point split into one for each head that measured it.

    No measurement is lost; the heads are left with the control points and the trajectory in
    common.
    """
    points = block.image_points
    surveyed = np.zeros(len(block.points), dtype=bool)
    surveyed[block.control.point_idx] = True
    surveyed[block.check.point_idx] = True
    head = np.where(surveyed[points.point_idx], 0, block.images.camera_idx[points.image_idx])
    n = len(block.points)
    names = [*block.points]
    names += [f"{name} {camera.name}" for camera in block.cameras[1:] for name in block.points]
    return replace(
        block,
        points=tuple(names),
        image_points=replace(points, point_idx=points.point_idx + n * head),
    )
