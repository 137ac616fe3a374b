"""COLMAP: cameras.txt and rigs.txt; with images a whole model, as text.

Layouts: https://colmap.github.io/format.html. Rotations are quaternions w, x, y, z of axes with
y down and z ahead; pixel (0, 0) is the outer corner of the top-left one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from acx4lib.geometry.frames import Pose
from acx4tools.exchange.outward import brown
from acx4tools.exchange.outward import calibrated as outward_calibrated
from acx4tools.exchange.outward.brown import CORNER, Brown
from acx4tools.exchange.outward.calibrated import R_C_V, Calibrated
from acx4tools.exchange.outward.orientations import Oriented
from acx4tools.exchange.outward.taken import BODY, SIGMA, Taken, lines, numbers

ASSUMED = (
    "FULL_OPENCV: fx, fy, cx, cy, k1, k2, p1, p2, k3, and zeros; pixel (0, 0) is the outer corner "
    "of the top-left one",
    "sensor_from_rig takes a point from the axes of {} to those of the camera, m, y down, z ahead",
)
WORLD = "the world is Cartesian, m: east, north, up at {}"


def cameras(calibrated: Calibrated) -> Taken:
    """Return cameras.txt and rigs.txt; the first camera is the reference of the rig."""
    found = brown.of_all(calibrated)
    return Taken(
        files={
            "cameras.txt": lines(_camera_lines(calibrated, found)),
            "rigs.txt": lines([_rig_line(calibrated)]),
        },
        lenses=brown.lenses(found),
        assumed=(ASSUMED[0], ASSUMED[1].format(calibrated.cameras[0].name)),
        left_out=(SIGMA, BODY),
    )


def images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return a model with oriented images, and without points."""
    alone = cameras(calibrated)
    return Taken(
        files={
            **alone.files,
            "frames.txt": lines(_frame_lines(calibrated, oriented)),
            "images.txt": lines(_image_lines(calibrated, oriented)),
            "points3D.txt": "# no points\n",
        },
        lenses=alone.lenses,
        assumed=(*alone.assumed, WORLD.format(oriented.origin)),
        left_out=(SIGMA,),
    )


def _camera_lines(calibrated: Calibrated, found: dict[str, Brown]) -> Iterator[str]:
    for i, camera in enumerate(calibrated.cameras, start=1):
        one = found[camera.name]
        hole = (one.hole.fx, one.hole.fy, one.hole.cx + CORNER, one.hole.cy + CORNER)
        values = [*hole, one.k1, one.k2, one.p1, one.p2, one.k3, 0.0, 0.0, 0.0]
        yield f"{i} FULL_OPENCV {camera.width_px} {camera.height_px} {numbers(values)}"


def _rig_line(calibrated: Calibrated) -> str:
    others = outward_calibrated.to_first(calibrated.calibration)[1:]
    placed = [
        f" CAMERA {i} 1 {_pose(one.T_v_r_h.inverse)}" for i, one in enumerate(others, start=2)
    ]
    return f"1 {len(others) + 1} CAMERA 1{''.join(placed)}"


def _frame_lines(calibrated: Calibrated, oriented: Oriented) -> Iterator[str]:
    """Yield a line for each exposure: the pose of the rig, and its images."""
    block, number = oriented.block, _numbers_of_cameras(calibrated, oriented)
    T_m_r = block.trajectory.T_m_b @ calibrated.cameras[0].T_b_c
    for exposure in np.unique(block.images.exposure_idx):
        taken = np.flatnonzero(block.images.exposure_idx == exposure)
        data = "".join(f" CAMERA {number[i]} {i + 1}" for i in taken)
        yield f"{exposure + 1} 1 {_pose(_from_world(T_m_r[exposure]))} {len(taken)}{data}"


def _image_lines(calibrated: Calibrated, oriented: Oriented) -> Iterator[str]:
    """Yield two lines for each image, the second without points."""
    number = _numbers_of_cameras(calibrated, oriented)
    for i, name in enumerate(oriented.names):
        yield f"{i + 1} {_pose(_from_world(oriented.T_m_c[i]))} {number[i]} {name}"
        yield ""


def _numbers_of_cameras(calibrated: Calibrated, oriented: Oriented) -> list[int]:
    names = [camera.name for camera in calibrated.cameras]
    own = [names.index(camera.name) + 1 for camera in oriented.block.cameras]
    return [own[k] for k in oriented.block.images.camera_idx]


def _from_world(T_m_c: Pose) -> Pose:
    return (T_m_c @ Pose(R=R_C_V, r=np.zeros(3))).inverse


def _pose(T: Pose) -> str:
    quaternion = Rotation.from_matrix(T.R).as_quat(canonical=True, scalar_first=True)
    return numbers([*quaternion.tolist(), *T.r.tolist()])
