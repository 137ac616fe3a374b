"""Flights of thousands of images by one camera, to time commands on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.block import Block
from acx4lib.geometry.camera import inside
from benchmarks.adjusting import bench_blocks

BASE_M = 250.0
IMAGES_PER_STRIP, TIES_PER_IMAGE = 40, 179

FLIGHT_TOML = f"""\
name = "A long flight, simulated"
crs = "{bench_blocks.FRAME.grid.crs}"
heights = "ellipsoidal"

[cameras.SYN]
width_px = {bench_blocks.TRUTH.width_px}
height_px = {bench_blocks.TRUTH.height_px}
pixel_um = {1000 * bench_blocks.TRUTH.pixel_mm}
focal_mm = {bench_blocks.START_F_MM}

[apriori]
image_point_px = {bench_blocks.SIGMA_PX}
gnss_horizontal_m = {bench_blocks.SIGMA_POSITION_M[0]}
gnss_vertical_m = {bench_blocks.SIGMA_POSITION_M[2]}
roll_pitch_deg = {np.degrees(bench_blocks.SIGMA_ATTITUDE[0])}
heading_deg = {np.degrees(bench_blocks.SIGMA_ATTITUDE[2])}

[stages.mounting]
estimate = ["f_mm", "xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2"]
fix = []
"""


def write(folder: Path, n_images: int) -> None:
    """Write a flight of whole strips.

    Parameters
    ----------
    folder : Path
        It is made; its files are replaced.
    n_images : int
        A multiple of `IMAGES_PER_STRIP`.
    """
    counts = [IMAGES_PER_STRIP] * (n_images // IMAGES_PER_STRIP)
    strips = bench_blocks.parallel(counts, base_m=BASE_M)
    block = bench_blocks.fly(strips, TIES_PER_IMAGE * n_images, control=(6, 6), seed=1).block
    (folder / "calibration").mkdir(parents=True, exist_ok=True)
    (folder / "flight.toml").write_text(FLIGHT_TOML, encoding="utf-8")
    for file, (table, decimals) in _tables(block).items():
        table.round(decimals).to_csv(folder / f"{file}.csv", index=False)


def _tables(block: Block) -> dict[str, tuple[pd.DataFrame, int]]:
    """Return the tables by their file, with the decimals of their numbers."""
    names, points = np.array(block.images.names), np.array(block.points)
    seen, control = block.image_points, block.control
    seen = seen[inside(block.cameras[0], seen.colrow)]
    seen = seen[np.lexsort((seen.point_idx, seen.image_idx))]
    enh, opk = block.frame.pose_to_grid(block.trajectory.T_m_b)
    xyz, angles = "east_m north_m height_m", "omega_deg phi_deg kappa_deg"
    surveyed = {"point": points[control.point_idx]}
    surveyed |= _columns(xyz, block.frame.to_grid(control.x_m))
    surveyed |= _columns("sigma_east_m sigma_north_m sigma_height_m", control.sigma_m)
    images = {"image": names, "camera": block.cameras[0].name, "exposure": names}
    images["strip"] = 1 + np.arange(len(names)) // IMAGES_PER_STRIP
    flown = {"exposure": names, **_columns(xyz, enh), **_columns(angles, np.degrees(opk))}
    measured = {"image": names[seen.image_idx], "point": points[seen.point_idx]}
    measured |= _columns("col_px row_px", seen.colrow)
    return {
        "control_points": (pd.DataFrame(surveyed), 6),
        "calibration/images": (pd.DataFrame(images), 0),
        "calibration/trajectory": (pd.DataFrame(flown), 10),
        "calibration/image_points": (pd.DataFrame(measured), 6),
    }


def _columns(names: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(names.split(), values.T, strict=True))
