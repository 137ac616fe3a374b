"""A model of COLMAP: a rig of two cameras, four frames, nine points, as text and as binary."""

import struct

import cv2
import numpy as np

from support.projects import scene
from support.projects.scene import NAMES, SLAVE

PARAMETERS = (scene.F, scene.F, scene.CX, scene.CY, scene.K1, scene.K2, scene.P1, scene.P2)
BASE = np.array([0.12, -0.03, 0.05])
"""Position of the second camera in the first one's axes, m."""


def quaternion(R):
    """Return w, x, y, z of a rotation."""
    turn = cv2.Rodrigues(R)[0][:, 0]
    angle = np.linalg.norm(turn)
    axis = turn / angle if angle else turn
    return np.append(np.cos(angle / 2), np.sin(angle / 2) * axis)


def rows():
    """Yield number, pose (world to camera), camera, name and measurements of images."""
    block = scene.scene()
    world = block.points_enh  # as if the map were Cartesian
    axes = axes_of_map(block)
    for i, name in enumerate(NAMES):
        centre = world.mean(axis=0) + block_centre(block, i)
        for k, (R, r) in enumerate([(axes[i], centre), (axes[i] @ SLAVE, centre + axes[i] @ BASE)]):
            pose = np.append(quaternion(R.T), -R.T @ r)
            yield 2 * i + k + 1, pose, k + 1, f"cam{k}/{name}", scene.seen(R, r, world)


def axes_of_map(block):
    """Return the cameras' axes in east, north, up, near enough."""
    down = block.points_e.mean(axis=0)
    up = down / np.linalg.norm(down)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    R_e_m = np.stack([east, np.cross(up, east), up], axis=1)
    return [R_e_m.T @ R for R in block.R_e_c]


def block_centre(block, i):
    return np.array([[0, 0, 100], [8, 3, 101], [-5, 9, 99], [4, -7, 102]], dtype=float)[i]


def write_text(folder, *, rig=True):
    """Write a model as text; the last measurement of an image belongs to no point."""
    folder.mkdir(parents=True, exist_ok=True)
    values = " ".join(map(repr, PARAMETERS))
    size = f"{scene.WIDTH} {scene.HEIGHT}"
    cameras = [f"{k} OPENCV {size} {values}" for k in (1, 2)]
    (folder / "cameras.txt").write_text("# list\n" + "\n".join(cameras) + "\n")
    lines = ["# two lines each"]
    for number, pose, camera, name, colrow in rows():
        lines.append(f"{number} {numbers(pose)} {camera} {name}")
        points = [f"{numbers(at)} {k + 1}" for k, at in enumerate(colrow)]
        lines.append(" ".join([*points, "10.5 20.5 -1"]))
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    points = [
        f"{k + 1} {numbers(at)} 0 0 0 0.5 1 {k}" for k, at in enumerate(scene.scene().points_enh)
    ]
    (folder / "points3D.txt").write_text("\n".join(points) + "\n")
    if rig:
        there = np.append(quaternion(SLAVE.T), -SLAVE.T @ BASE)
        (folder / "rigs.txt").write_text(f"1 2 CAMERA 1 CAMERA 2 1 {numbers(there)}\n")
        frames = [
            f"{i + 1} 1 1 0 0 0 0 0 0 2 CAMERA 1 {2 * i + 1} CAMERA 2 {2 * i + 2}"
            for i in range(len(NAMES))
        ]
        (folder / "frames.txt").write_text("\n".join(frames) + "\n")
    return folder


def write_binary(folder):
    """Write the model as binary files, by the layout that COLMAP documents."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = b"".join(
        struct.pack("<IiQQ8d", k, 4, scene.WIDTH, scene.HEIGHT, *PARAMETERS) for k in (1, 2)
    )
    (folder / "cameras.bin").write_bytes(struct.pack("<Q", 2) + cameras)
    images = [
        struct.pack("<I7dI", number, *pose, camera)
        + name.encode()
        + b"\0"
        + struct.pack("<Q", len(colrow) + 1)
        + b"".join(struct.pack("<ddQ", *at, k + 1) for k, at in enumerate(colrow))
        + struct.pack("<ddQ", 10.5, 20.5, 2**64 - 1)
        for number, pose, camera, name, colrow in rows()
    ]
    (folder / "images.bin").write_bytes(struct.pack("<Q", len(images)) + b"".join(images))
    points = [
        struct.pack("<Q3d3BdQII", k + 1, *at, 0, 0, 0, 0.5, 1, 1, k)
        for k, at in enumerate(scene.scene().points_enh)
    ]
    (folder / "points3D.bin").write_bytes(struct.pack("<Q", len(points)) + b"".join(points))
    there = [*quaternion(SLAVE.T), *(-SLAVE.T @ BASE)]
    rig = struct.pack("<QIIiIiIB7d", 1, 1, 2, 0, 1, 0, 2, 1, *there)
    (folder / "rigs.bin").write_bytes(rig)
    frames = [
        struct.pack(
            "<II7dIiIQiIQ", i + 1, 1, 1, 0, 0, 0, 0, 0, 0, 2, 0, 1, 2 * i + 1, 0, 2, 2 * i + 2
        )
        for i in range(len(NAMES))
    ]
    (folder / "frames.bin").write_bytes(struct.pack("<Q", len(frames)) + b"".join(frames))
    return folder


def numbers(values):
    return " ".join(repr(float(value)) for value in values)
