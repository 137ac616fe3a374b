"""A small flight of two heads with pixels: one known picture, as each of them would see it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import tifffile

from acx4files import flight as flown
from acx4files.results import folder as results
from acx4files.results import provenance, tables
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.frames import Pose
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads, synthetic_from_head
from support.flights import written
from support.run_results import put

HEADS = ("LEFT", "RIGHT")
REDUCTION = 8
MARGIN = 200
"""Pixels of the scene around the frame of the synthetic image."""

SYNTHETIC = written.cameras()["CAM"]
REDUCED = reduced_camera(SYNTHETIC, REDUCTION)


def orientation() -> RelativeOrientation:
    """Return the heads exactly as they are mounted, all perspective centres in one."""
    heads = [written.cameras()[name] for name in HEADS]
    R_s_b = SYNTHETIC.T_b_c.R.T
    opk = [Pose(R=R_s_b @ head.T_b_c.R, r=np.zeros(3)).opk for head in heads]
    return RelativeOrientation(
        heads=tuple(heads),
        xyz_mm=np.tile([0.0, 0.0, 25.0], (2, 1)),
        opk=np.array(opk),
        cov_joint=np.zeros((32, 32)),
        n_exposures=6,
    )


def scene(seed: int = 1) -> np.ndarray:
    """Return grey values of the frame and MARGIN pixels around it, textured at all scales."""
    rng = np.random.default_rng(seed)
    rows, cols = REDUCED.height_px + 2 * MARGIN, REDUCED.width_px + 2 * MARGIN
    total = np.full((rows, cols, 3), 12000, np.float32)
    for step in (4, 9, 20, 60):
        coarse = (rows // step, cols // step, 3)
        noise = rng.standard_normal(coarse, dtype=np.float32)
        fine = cv2.resize(noise, (cols, rows), interpolation=cv2.INTER_CUBIC)
        total += 1500 * fine.reshape(rows, cols, 3)
    return total


def frame_of(picture: np.ndarray) -> np.ndarray:
    """Return the part of a scene that the synthetic image shows."""
    return picture[MARGIN:-MARGIN, MARGIN:-MARGIN]


def head_images(picture: np.ndarray) -> dict[str, np.ndarray]:
    """Return what every head sees of a scene."""
    reduced, out = reduced_heads(orientation(), REDUCTION), {}
    for k, head in enumerate(reduced.heads):
        grid = np.meshgrid(np.arange(head.width_px), np.arange(head.height_px))
        colrow = np.stack(grid, axis=-1).reshape(-1, 2).astype(float)
        xy = synthetic_from_head(reduced, k, colrow)
        centre = 0.5 * np.array([REDUCED.width_px - 1, REDUCED.height_px - 1])
        at = xy / REDUCED.pixel_mm * [1, -1] + centre + MARGIN
        maps = at.astype(np.float32).reshape(head.height_px, head.width_px, 2)
        seen = cv2.remap(
            picture, maps[..., 0], maps[..., 1], cv2.INTER_CUBIC, None, cv2.BORDER_REFLECT
        )
        seen = seen.reshape(head.height_px, head.width_px, -1)
        out[head.name] = np.rint(seen).clip(1, 65535).astype(np.uint16)
    return out


def write_flight(
    folder: Path,
    exposures: tuple[str, ...] = ("E0", "E1"),
    *,
    blocks: tuple[str, ...] = ("heads",),
    mounted: tuple[str, ...] = ("CAM",),
) -> Path:
    """Write a flight whose named exposures have pixels, a scene of its own each."""
    written.write_flight(folder, blocks=blocks, mounted=mounted)
    (folder / "heads" / "images").mkdir()
    table = pd.read_csv(folder / "heads" / "images.csv", dtype=str)
    named = table["exposure"].isin(exposures)
    table["file"] = ("images/" + table["image"] + ".tif").where(named, "")
    table.to_csv(folder / "heads" / "images.csv", index=False)
    for i, exposure in enumerate(exposures):
        for name, image in head_images(scene(i + 1)).items():
            tifffile.imwrite(head_path(folder, exposure, name), image, photometric="rgb")
    return folder


def head_path(folder: Path, exposure: str, head: str) -> Path:
    """Return the file of a head's image."""
    return folder / "heads" / "images" / f"{exposure}_{head}.tif"


def write_results(folder: Path, flight: Path) -> Path:
    """Write results of the heads stage, as exact as the flight is."""
    found = [tables.of_relative_orientation("heads/relative_orientation", orientation())]
    provenance.begin(folder, flown.read(flight), [])
    put(folder, "heads", found)
    bundles = {f"heads/bundle/{name}": {"converged": True} for name in HEADS}
    results.replace(folder, ["heads/bundle"], tables={}, summary=bundles)
    return folder
