"""Parts of a block, for the question of what a flight would tell without the rest of it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.flight.block import Block, SurveyedPoints, select_images
from acx4lib.flight.design import flying_heights
from acx4lib.geometry.frames import Pose


def lowest_height(block: Block) -> Block:
    """Return the images that were taken at the lowest flying height, within a tenth of it."""
    height = flying_heights(block)[block.images.exposure_idx]
    return select_images(block, height < 1.1 * height.min())


def one_direction(block: Block) -> Block:
    """Return the images that were flown within a right angle of the first one's direction."""
    forward = block.T_m_b_images.R[:, :2, 0]
    return select_images(block, forward @ forward[0] > 0)


def without_strips(block: Block, names: Collection[str]) -> Block:
    """Return a block without the images of some strips.

    Parameters
    ----------
    block : Block
    names : collection of str
        Names of strips; names that no image has are passed over.
    """
    return select_images(block, np.array([strip not in names for strip in block.images.strips]))


def without_control(block: Block, names: Collection[str] | None = None) -> Block:
    """Return a block in which control points count as tie points: those named, or all.

    Parameters
    ----------
    block : Block
    names : collection of str, optional
        Names of points.
    """
    keep = [
        names is not None and block.points[point] not in names for point in block.control.point_idx
    ]
    return replace(block, control=block.control[np.array(keep, dtype=bool)])


def with_focal_lengths(block: Block, f_mm: Mapping[str, float]) -> Block:
    """Return a block whose cameras are declared with other focal lengths.

    Parameters
    ----------
    block : Block
    f_mm : mapping of str to float
        By camera; the others keep theirs.
    """
    expected.names_of("f_mm", tuple(f_mm), [camera.name for camera in block.cameras])
    cameras = [
        camera.with_interior(replace(camera.interior, f=f_mm.get(camera.name, camera.interior.f)))
        for camera in block.cameras
    ]
    return replace(block, cameras=tuple(cameras))


def unshared(block: Block) -> Block:
    """Return the block with every tie point split into one for each camera that measured it.

    No measurement is lost; the cameras are left with the surveyed points and the trajectory in
    common.

    Parameters
    ----------
    block : Block
    """
    points = block.image_points
    camera = block.images.camera_idx[points.image_idx]
    first = np.full(len(block.points), len(block.cameras))
    np.minimum.at(first, points.point_idx, camera)
    split = camera > first[points.point_idx]
    split &= ~np.isin(points.point_idx, [*block.control.point_idx, *block.check.point_idx])
    pairs, own = np.unique(
        np.stack([points.point_idx, camera], axis=1)[split], axis=0, return_inverse=True
    )
    names = list(block.points)
    taken = set(names)
    for point, k in pairs:
        name = f"{block.points[point]} {block.cameras[k].name}"
        while name in taken:
            name += "'"
        names.append(name)
        taken.add(name)
    point_idx = points.point_idx.copy()
    point_idx[split] = len(block.points) + own.ravel()
    return replace(block, points=tuple(names), image_points=replace(points, point_idx=point_idx))


def as_if_cartesian(block: Block) -> Block:
    """Return the block as a program sees it that takes east, north, height for Cartesian.

    Positions and control are the grid's numbers, attitudes those against the grid; curvature of
    the earth and scale of the map are not modelled.

    Parameters
    ----------
    block : Block
    """
    trajectory, frame = block.trajectory, block.frame
    enh = frame.to_grid(trajectory.T_m_b.r)
    origin = np.append(np.round(enh[:, :2].mean(axis=0)), 0.0)
    R_g_b = frame.grid_axes(trajectory.T_m_b.r) @ trajectory.T_m_b.R
    return replace(
        block,
        control=_in_grid(block, origin, block.control),
        check=_in_grid(block, origin, block.check),
        trajectory=replace(
            trajectory,
            T_m_b=Pose(R=R_g_b, r=enh - origin),
            R_g_m=np.broadcast_to(np.eye(3), (len(enh), 3, 3)),
        ),
    )


def _in_grid(block: Block, origin: Array, surveyed: SurveyedPoints) -> SurveyedPoints:
    identity = np.broadcast_to(np.eye(3), (len(surveyed), 3, 3))
    if len(surveyed) == 0:
        return surveyed
    return replace(surveyed, x_m=block.frame.to_grid(surveyed.x_m) - origin, R_g_m=identity)


def with_lever_arm(block: Block, lever_m: Sequence[float], *, camera: str = "") -> Block:
    """Return a block whose cameras are declared with another lever arm.

    An adjustment that holds the lever arm holds this one; others begin with it.

    Parameters
    ----------
    block : Block
    lever_m : sequence of float
        Along the body's x, y, z (forward, left, up), m.
    camera : str, optional
        The camera that it is of; all by default.

    Raises
    ------
    ValueError
        Where the block has no such camera, or these are not three numbers.
    """
    r = expected.numbers("lever_m", np.asarray(lever_m, dtype=float), (3,))
    names = [one.name for one in block.cameras]
    if camera:
        expected.one_of("camera", camera, names)
    chosen = [not camera or name == camera for name in names]
    cameras = tuple(
        replace(one, T_b_c=Pose(R=one.T_b_c.R, r=r)) if own else one
        for one, own in zip(block.cameras, chosen, strict=True)
    )
    return replace(block, cameras=cameras)
