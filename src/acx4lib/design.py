"""The design of a block: flying heights, ground pixels and overlaps (section 3.2)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected
from acx4lib.block import Block, SurveyedPoints, select_images
from acx4lib.expected import Array, Index
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose, transform

if TYPE_CHECKING:
    import pandas as pd


SAME_HEIGHT = 0.15
"""Strips whose flying heights differ by less than this share count as one level."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Level:
    """The strips of a block at one flying height.

    Attributes
    ----------
    strips : tuple of str
    exposure_idx : ndarray
    height_m : float
        Median height above the mean of the surveyed points; NaN where there are none.
    gsd_m : float
        Ground sample distance, mean of the cameras.
    images_per_strip : float
        Mean number of images of one camera in a strip.
    forward_overlap, side_overlap : float
        Medians, 0 to 1, over flat ground at the surveyed points; NaN where not known.
    n_directions : int
        Number of flying directions that differ by more than a right angle.
    """

    strips: tuple[str, ...]
    exposure_idx: Index
    height_m: float
    gsd_m: float
    images_per_strip: float
    forward_overlap: float
    side_overlap: float
    n_directions: int


def ground_height(block: Block) -> float:
    """Return the mean height of the surveyed points in the mapping frame, m; NaN for none."""
    surveyed = _on_the_ground(block)
    return float(surveyed[:, 2].mean()) if len(surveyed) else np.nan


def _on_the_ground(block: Block) -> Array:
    """Return the surveyed points without absurd heights, shape (n, 3).

    A point is absurd if its height differs from the median by more than the flying height.
    """
    surveyed = np.concatenate([block.control.x_m, block.check.x_m])
    if not len(surveyed):
        return surveyed
    middle = np.median(surveyed[:, 2])
    above = np.median(block.trajectory.T_m_b.r[:, 2]) - middle
    return surveyed[np.abs(surveyed[:, 2] - middle) < above] if above > 0 else surveyed


def flying_heights(block: Block) -> Array:
    """Return the height of every exposure above the mean of the surveyed points, m.

    Above the ellipsoid where there are no surveyed points.

    Returns
    -------
    ndarray, shape (n_exposures,)
    """
    surveyed = _on_the_ground(block)
    ground = block.frame.to_geographic(surveyed)[:, 2].mean() if len(surveyed) else 0.0
    return block.frame.to_geographic(block.trajectory.T_m_b.r)[:, 2] - ground


def ground_sample_m(block: Block) -> float:
    """Return the ground sampling distance of the first camera, mean of the exposures, m."""
    camera = block.cameras[0]
    return float(camera.pixel_mm * flying_heights(block).mean() / camera.interior.f)


def strip_of_exposure(block: Block) -> list[str]:
    """Return the strip of every exposure, taken from its first image."""
    strips = [""] * len(block.trajectory)
    for i in range(len(block.images) - 1, -1, -1):
        strips[int(block.images.exposure_idx[i])] = block.images.strips[i]
    return strips


def directions(block: Block) -> Array:
    """Return the flying direction at every exposure, unit vectors in the mapping frame.

    From the neighbours in the strip; without neighbours, the forward axis of the body.

    Returns
    -------
    ndarray, shape (n_exposures, 2)
    """
    direction = block.trajectory.T_m_b.R[:, :2, 0].copy()
    strips = np.array(strip_of_exposure(block), dtype=object)
    for strip in sorted(set(strips) - {""}):
        exposures = np.flatnonzero(strips == strip)
        if len(exposures) > 1:
            direction[exposures] = np.gradient(block.trajectory.T_m_b.r[exposures, :2], axis=0)
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def footprints(block: Block) -> Array:
    """Return the footprint of every image on flat ground at the surveyed points.

    Computed from the declared cameras and the trajectory.

    Returns
    -------
    ndarray, shape (n_images, 4, 3)
        Mapping frame, m, from the upper-left corner clockwise; NaN where a corner does not look
        down or the ground is not known.
    """
    ground = ground_height(block)
    corners = np.zeros((len(block.images), 4, 3))
    for k, camera in enumerate(block.cameras):
        images = np.flatnonzero(block.images.camera_idx == k)
        T_m_c = block.T_m_b_images[images] @ camera.T_b_c
        w, h = camera.width_px - 0.5, camera.height_px - 0.5
        colrow = np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])
        poses = Pose(R=np.repeat(T_m_c.R, 4, axis=0), r=np.repeat(T_m_c.r, 4, axis=0))
        ray = rays(camera, poses, np.tile(colrow, (len(images), 1)))
        length = np.where(ray[:, 2] < 0, (ground - poses.r[:, 2]) / ray[:, 2], np.nan)
        corners[images] = (poses.r + length[:, None] * ray).reshape(-1, 4, 3)
    return corners


def levels(block: Block) -> tuple[Level, ...]:
    """Group the strips of a block by flying height, the highest first.

    Exposures of the trajectory without an image, as in a part of a block, are ignored.
    """
    height = flying_heights(block)
    strip_of = np.array(strip_of_exposure(block), dtype=object)
    strip_of[~np.isin(np.arange(len(strip_of)), block.images.exposure_idx)] = None  # took no image
    names = [name for name in dict.fromkeys(strip_of) if name is not None]
    height_of_strip = {name: float(np.median(height[strip_of == name])) for name in names}
    groups: list[list[str]] = []
    for name in sorted(names, key=lambda n: -height_of_strip[n]):
        if groups and height_of_strip[name] > (1 - SAME_HEIGHT) * height_of_strip[groups[-1][0]]:
            groups[-1].append(name)
        else:
            groups.append([name])
    return tuple(_level(block, sorted(group, key=names.index), strip_of) for group in groups)


def _level(block: Block, strips: Sequence[str], strip_of: Array) -> Level:
    exposures = np.flatnonzero(np.isin(strip_of, strips))
    known = np.isfinite(ground_height(block))
    height = float(np.median(flying_heights(block)[exposures])) if known else np.nan
    per_camera = np.bincount(block.images.camera_idx, minlength=len(block.cameras))
    present = np.flatnonzero(per_camera)
    n_images = np.isin(block.images.exposure_idx, exposures).sum()
    direction = directions(block)[exposures]
    image_idx, share = forward_overlaps(block)
    return Level(
        strips=tuple(strips),
        exposure_idx=exposures,
        height_m=height,
        gsd_m=float(np.mean([height * c.pixel_mm / c.interior.f for c in block.cameras])),
        images_per_strip=float(n_images / len(present) / len(strips)),
        forward_overlap=_median(share[np.isin(block.images.exposure_idx[image_idx], exposures)]),
        side_overlap=_side_overlap(block, strips, strip_of),
        n_directions=1 + int(np.any(direction @ direction[0] < 0)),
    )


def _overlap(block: Block, images: Index, shift: Array) -> Array:
    """Return the overlap of each image with itself, shifted on flat ground, 0 to 1, shape (n,)."""
    T_m_b = block.T_m_b_images[images]
    known = np.isfinite(ground_height(block))
    above = flying_heights(block) if known else np.full(len(block.trajectory), np.nan)
    height = above[block.images.exposure_idx[images]]
    share = np.zeros(len(images))
    for k, camera in enumerate(block.cameras):
        of_camera = block.images.camera_idx[images] == k
        R_m_c = T_m_b.R[of_camera] @ camera.T_b_c.R
        moved = transform(np.swapaxes(R_m_c, -1, -2), shift[of_camera])[:, :2]
        size = camera.pixel_mm / camera.interior.f * np.array([camera.width_px, camera.height_px])
        share_xy = np.maximum(1 - np.abs(moved) / (height[of_camera, None] * size), 0)
        share[of_camera] = share_xy.prod(axis=1)
    return share


def forward_overlaps(block: Block) -> tuple[Index, Array]:
    """Return images with a successor of the same camera in the strip, and their overlaps.

    Valid for images that look down, over flat ground at the surveyed points.

    Returns
    -------
    image_idx : ndarray, shape (n,)
    share : ndarray, shape (n,)
        0 to 1; NaN where the ground is not known.
    """
    next_of: dict[int, int] = {}
    last: dict[tuple[int, str], int] = {}
    for i, strip in enumerate(block.images.strips):
        key = (int(block.images.camera_idx[i]), strip)
        if strip and key in last:
            next_of[last[key]] = i
        last[key] = i
    a, b = (np.array([*part], dtype=np.intp) for part in (next_of.keys(), next_of.values()))
    r = block.T_m_b_images.r
    return a, _overlap(block, a, r[b] - r[a])


def _side_overlap(block: Block, strips: Sequence[str], strip_of: Array) -> float:
    """Return the median overlap of each strip with the nearest parallel one."""
    r, direction = block.trajectory.T_m_b.r, directions(block)
    shares = []
    for strip in strips:
        in_strip = strip_of == strip
        along = np.append(direction[in_strip].mean(axis=0), 0.0)
        along /= np.linalg.norm(along)
        spacings = []
        for other in strips:
            parallel = abs(direction[strip_of == other].mean(axis=0) @ along[:2]) > np.cos(
                np.radians(20)
            )
            if other != strip and parallel:
                d = (r[strip_of == other].mean(axis=0) - r[in_strip].mean(axis=0)) * [1.0, 1.0, 0.0]
                spacings.append(d - along * (d @ along))
        if spacings:
            nearest = min(spacings, key=lambda d: float(d @ d))
            images = np.flatnonzero(in_strip[block.images.exposure_idx])
            shares.append(_median(_overlap(block, images, np.tile(nearest, (len(images), 1)))))
    return _median(np.array(shares))


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else np.nan


# --- as tables -------------------------------------------------------------------------------


def level_table(block: Block) -> pd.DataFrame:
    """Return the flying heights of a block, the highest first, with ground pixels and overlaps.

    Returns
    -------
    DataFrame
        By the ``level``, from 1: heights in m, ground pixels in cm, overlaps in per cent; NaN where
        the ground or the strips are not known.
    """
    import pandas as pd  # noqa: PLC0415 a flight is read without it

    rows = {number: _level_row(level) for number, level in enumerate(levels(block), 1)}
    table = pd.DataFrame.from_dict(rows, orient="index")
    return table.rename_axis("level")


def _level_row(level: Level) -> dict[str, float]:
    named = len([strip for strip in level.strips if strip])
    return {
        "height above ground (m)": level.height_m,
        "ground pixel (cm)": 100 * level.gsd_m,
        "strips": named or np.nan,
        "directions": level.n_directions,
        "images per strip": level.images_per_strip if named else np.nan,
        "forward overlap (%)": 100 * level.forward_overlap,
        "side overlap (%)": 100 * level.side_overlap,
    }


def sigma_table(blocks: Mapping[str, Block]) -> pd.DataFrame:
    """Return the median standard deviations of the observations, one row per block."""
    import pandas as pd  # noqa: PLC0415 as above

    rows = {name: _sigmas(block) for name, block in blocks.items()}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("block")


def _sigmas(block: Block) -> dict[str, float]:
    surveyed = np.concatenate([block.control.sigma_m, block.check.sigma_m])
    trajectory = block.trajectory
    attitude = np.degrees(trajectory.sigma_attitude)
    return {
        "image points (px)": _median(block.image_points.sigma_px),
        "survey, plan (m)": _median(surveyed[:, :2]),
        "survey, height (m)": _median(surveyed[:, 2]),
        "GNSS, plan (m)": _median(trajectory.sigma_position[:, :2]),
        "GNSS, height (m)": _median(trajectory.sigma_position[:, 2]),
        "roll, pitch (°)": _median(attitude[:, :2]),
        "heading (°)": _median(attitude[:, 2]),
    }


# --- Parts of a block, to learn what a flight would determine without the rest of it


def lowest_height(block: Block) -> Block:
    """Select the images taken less than a tenth above the lowest flying height."""
    height = flying_heights(block)[block.images.exposure_idx]
    return select_images(block, height < 1.1 * height.min())


def one_direction(block: Block) -> Block:
    """Select the images whose heading is within 90 degrees of the first image's."""
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
    """Use control points as tie points: those named, or all.

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
    """Split every tie point into one point per camera that measured it.

    No measurement is lost; the cameras are left with the surveyed points and the trajectory in
    common.
    """
    points = block.image_points
    camera = block.images.camera_idx[points.image_idx]
    first = np.full(len(block.points), len(block.cameras))
    np.minimum.at(first, points.point_idx, camera)
    split = camera > first[points.point_idx]
    split &= ~np.isin(points.point_idx, [*block.control.point_idx, *block.check.point_idx])
    pairs, pair_idx = np.unique(
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
    point_idx[split] = len(block.points) + pair_idx.ravel()
    return replace(block, points=tuple(names), image_points=replace(points, point_idx=point_idx))


def as_if_cartesian(block: Block) -> Block:
    """Return the block as seen by software that takes east, north, height as Cartesian.

    Positions and control are the grid's numbers, attitudes those against the grid; curvature of
    the earth and scale of the map are not modelled.
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
        Camera whose lever arm changes; all by default.

    Raises
    ------
    ValueError
        Where the block has no such camera, or these are not three numbers.
    """
    r = expected.numbers("lever_m", np.asarray(lever_m, dtype=float), (3,))
    names = [declared.name for declared in block.cameras]
    if camera:
        expected.one_of("camera", camera, names)
    chosen = [not camera or name == camera for name in names]
    cameras = tuple(
        replace(declared, T_b_c=Pose(R=declared.T_b_c.R, r=r)) if selected else declared
        for declared, selected in zip(block.cameras, chosen, strict=True)
    )
    return replace(block, cameras=cameras)
