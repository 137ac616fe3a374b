"""The heads together and one by one, and a rig whose heads share no points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4lib.calibration import heads, rig
from acx4lib.calibration.estimates import not_determined
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.stages.rig import RigStage
from acx4lib.tie_points.ties import refine_by_mean_differences, shared_points

ONE_BY_ONE = "one by one"
REFINED = "one by one, refined"
WITH_F = "one by one, $f$ estimated"
UNSHARED = "rig, no shared points"
RIG = "rig"
"""The ways to orient the heads, in the order of tables."""


def oriented(flight: Flight, stage: RigStage) -> dict[str, RelativeOrientation]:
    """Orient heads in every way: each by itself, and all together with and without shared points.

    Returns
    -------
    dict of str to RelativeOrientation
        A way that fails is not in it; none is where there is no rig.
    """
    synthetic = flight.synthetic_camera
    if synthetic is None or stage.rig is None or not_determined(stage.rig.calibration):
        return {}
    try:
        together = rig.relative_orientation(stage.rig, synthetic)
    except AdjustmentError:
        return {}
    held = tuple(name for name in flight.estimate_heads if name != "f")
    out: dict[str, RelativeOrientation] = {}
    for title, free in ((ONE_BY_ONE, held), (WITH_F, ("f", *held))):
        names = [camera.name for camera in stage.block.cameras]
        fits = heads.calibrate_heads(stage.block, names, free=free, refraction=flight.refraction)
        if fits.failures:
            continue
        try:
            out[title] = heads.relative_orientation(fits, synthetic, weak=True)
        except AdjustmentError:
            continue
        if title == ONE_BY_ONE:
            ties = shared_points(stage.block, out[title])
            out[REFINED] = refine_by_mean_differences(out[title], ties)
    try:
        alone = rig.calibrate(
            unshared(stage.block), free=flight.estimate_heads, refraction=flight.refraction
        )
        out[UNSHARED] = rig.relative_orientation(alone, synthetic)
    except AdjustmentError:
        pass
    return {**out, RIG: together}


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
