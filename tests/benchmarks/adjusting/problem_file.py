"""An adjustment's input as one plain file, which every solver of the benchmark reads.

In this order, 64 bits a number, in the machine's byte order: numbers of poses, points, control
points and image points; then the arrays of `_arrays`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from acx4lib.bundle.network import Network
from acx4lib.bundle.observations import PoseObservations
from acx4lib.bundle.unknowns import Layout, State, layout
from acx4lib.flight.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import MOUNT
from benchmarks.adjusting.bench_blocks import FRAME, FREE


def write(network: Network, path: Path) -> None:
    """Write a network of one camera with one image per exposure.

    Raises
    ------
    ValueError
        For another network.
    """
    n_poses = len(network.pose_names)
    if len(network.block.cameras) != 1 or not np.array_equal(network.pose_idx, np.arange(n_poses)):
        msg = "the problem file holds one camera with one image per exposure"
        raise ValueError(msg)
    counts = (n_poses, network.n_points, len(network.control), len(network.image_points))
    with path.open("wb") as out:
        np.array(counts, dtype=np.int64).tofile(out)
        for array in _arrays(network):
            array.tofile(out)


def _arrays(network: Network) -> list[np.ndarray]:
    camera, control = network.block.cameras[0], network.control
    start, observed, points = network.start, network.observed, network.image_points
    numbers = [
        np.array([camera.width_px, camera.height_px, camera.pixel_mm]),
        *(start.interiors[0].to_array(), start.T_b_c.R[0], start.T_b_c.r[0]),
        *(start.T_m_b.R, start.T_m_b.r, observed.R_g_m),  # observed and start values alike
        *(observed.sigma_position, observed.sigma_attitude, start.x_m),
        *(control.point_idx, control.x_m, control.R_g_m, control.sigma_m),
        *(points.image_idx, points.point_idx, points.colrow, points.sigma_px),
    ]
    return [
        np.ascontiguousarray(a, dtype=np.int32 if a.dtype.kind == "i" else np.float64)
        for a in numbers
    ]


def read(path: Path, *, free: Sequence[str] = FREE, free_mount: Sequence[str] = MOUNT) -> Network:
    """Return the network of a file, ready for adjustment.

    Parameters
    ----------
    path : Path
    free, free_mount : sequence of str
        As in `uses.mounted_orientation`; nothing of the mounting where poses are the camera's.
    """
    with path.open("rb") as file:
        n_poses, n_points, n_control, n_rays = np.fromfile(file, np.int64, 4)
        camera = _camera(file)
        T_m_b = Pose(R=_floats(file, n_poses, 3, 3), r=_floats(file, n_poses, 3))
        observed = PoseObservations(
            T_m_b=T_m_b,
            R_g_m=_floats(file, n_poses, 3, 3),
            sigma_position=_floats(file, n_poses, 3),
            sigma_attitude=_floats(file, n_poses, 3),
        )
        x_m = _floats(file, n_points, 3)
        control = SurveyedPoints(
            point_idx=np.fromfile(file, np.int32, n_control),
            x_m=_floats(file, n_control, 3),
            R_g_m=_floats(file, n_control, 3, 3),
            sigma_m=_floats(file, n_control, 3),
        )
        points = ImagePoints(
            image_idx=np.fromfile(file, np.int32, n_rays),
            point_idx=np.fromfile(file, np.int32, n_rays),
            colrow=_floats(file, n_rays, 2),
            sigma_px=_floats(file, n_rays),
        )
    block = _block(camera, observed, control, points, n_points=n_points)
    return _network(block, observed, x_m, layout(1, n_poses, free=free, free_mount=free_mount))


def _floats(file: BinaryIO, *shape: int) -> np.ndarray:
    return np.fromfile(file, np.float64, int(np.prod(shape))).reshape(shape)


def _camera(file: BinaryIO) -> Camera:
    width_px, height_px, pixel_mm = _floats(file, 3)
    return Camera(
        name="SYN",
        width_px=int(width_px),
        height_px=int(height_px),
        pixel_mm=pixel_mm,
        interior=Interior.from_array(_floats(file, len(INTERIOR))),
        T_b_c=Pose(R=_floats(file, 3, 3), r=_floats(file, 3)),
    )


def _block(
    camera: Camera,
    observed: PoseObservations,
    control: SurveyedPoints,
    points: ImagePoints,
    *,
    n_points: int,
) -> Block:
    exposures = tuple(f"E{i}" for i in range(len(observed.T_m_b)))
    return Block(
        frame=FRAME,
        cameras=(camera,),
        images=Images(names=exposures),
        points=tuple(f"P{i}" for i in range(n_points)),
        image_points=points,
        control=control,
        trajectory=Trajectory(
            exposures=exposures,
            T_m_b=observed.T_m_b,
            R_g_m=observed.R_g_m,
            sigma_position=observed.sigma_position,
            sigma_attitude=observed.sigma_attitude,
        ),
    )


def _network(block: Block, observed: PoseObservations, x_m: np.ndarray, columns: Layout) -> Network:
    """Return what `uses.mounted_orientation` does, without a search for start values."""
    n, camera = len(block.images), block.cameras[0]
    return Network(
        block=block,
        pose_names=block.trajectory.exposures,
        pose_idx=np.arange(n),
        layout=columns,
        image_points=block.image_points,
        rows=np.arange(len(block.image_points), dtype=np.int32),
        control=block.control,
        observed=observed,
        start=State(
            interiors=(camera.interior,),
            T_b_c=Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None]),
            T_m_b=observed.T_m_b,
            x_m=x_m,
        ),
        distortion_at="measured",  # as `bench_blocks.network` has it
    )
