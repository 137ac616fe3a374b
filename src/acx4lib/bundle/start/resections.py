"""Poses of exposures whose trajectory is not known: resections from control points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4lib import expected
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Index
from acx4lib.flight.block import Block, Trajectory
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.intersection import resect

FEWEST = 3
"""Control points that a resection needs."""


def resected(block: Block) -> Block:
    """Return a block with poses by resection, an image of every exposure at a time.

    Approximate values for an adjustment, of standard deviations that are infinite: not known.

    Parameters
    ----------
    block : Block
        Its poses may be any.

    Raises
    ------
    AdjustmentError
        Where no image of an exposure shows three control points.
    ValueError
        If `block` is no Block.
    """
    expected.instance("block", block, Block)
    where = np.full(len(block.points), -1)
    where[block.control.point_idx] = np.arange(len(block.control))
    points = block.image_points[where[block.image_points.point_idx] >= 0]
    seen = np.bincount(points.image_idx, minlength=len(block.images))
    poses = []
    for exposure, name in enumerate(block.trajectory.exposures):
        image = _image(block, exposure, seen)
        if image < 0 or seen[image] < FEWEST:
            msg = (
                f"exposure {name!r} has no image with {FEWEST} control points, which a resection "
                "needs: give its pose, or leave out its images"
            )
            raise AdjustmentError(msg)
        camera = block.cameras[block.images.camera_idx[image]]
        own = points[points.image_idx == image]
        x_m = block.control.x_m[where[own.point_idx]]
        poses.append(resect(camera, own.colrow, x_m) @ camera.T_b_c.inverse)
    T_m_b = Pose(R=np.stack([T.R for T in poses]), r=np.stack([T.r for T in poses]))
    trajectory = Trajectory(exposures=block.trajectory.exposures, T_m_b=T_m_b)
    return replace(block, trajectory=trajectory)


def _image(block: Block, exposure: int, seen: Index) -> int:
    """Return the exposure's image with the most control points; -1 where it has none."""
    own = np.flatnonzero(block.images.exposure_idx == exposure)
    return int(own[np.argmax(seen[own])]) if len(own) else -1
