"""A folder of a thousand images: ``python -m benchmarks.commands.large_flight --out FOLDER``.

The block is made as `bench_blocks`' are: the paper's camera, strips with overlaps of 80 and 30 %.
With 25 strips of 40 images and 179 000 tie points it has 1.1 million measurements. The same number
has a flight that is less in order: strips overlap by 60 %, are turned by 20 degrees against the
grid, flown at different speeds, and listed in any order; the focal length is given 0.4 % off.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.flight.block import Block
from acx4lib.geometry.camera import inside
from benchmarks.adjusting import bench_blocks

BASE_M = 250.0
IMAGES_PER_STRIP = 40
TIES_PER_IMAGE = 179

TURNED_DEG, ASIDE_M, TIES_PER_TURNED_IMAGE = 20.0, 630.0, 112
SPEEDS = 0.2
"""Of the flight that is less in order; its speeds differ by that share, and bases with them."""

FLIGHT_TOML = f"""\
name = "A long flight, simulated"
crs = "{bench_blocks.FRAME.grid.crs}"
heights = "ellipsoidal"

[cameras.SYN]
width_px = {bench_blocks.TRUTH.width_px}
height_px = {bench_blocks.TRUTH.height_px}
pixel_um = {1000 * bench_blocks.TRUTH.pixel_mm}
focal_mm = {{focal_mm}}

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


@dataclass(frozen=True)
class _Table:
    """A table of a flight's folder and the decimals of its numbers."""

    file: str
    columns: dict[str, object]
    decimals: int


def write(folder: Path, n_images: int, *, seed: int = 1) -> None:
    """Write a flight of whole strips.

    Parameters
    ----------
    folder : Path
        It is made; its files are replaced.
    n_images : int
        A multiple of `IMAGES_PER_STRIP`.
    seed : int
        The same seed gives the same bytes.
    """
    strips = bench_blocks.parallel(
        [IMAGES_PER_STRIP] * (n_images // IMAGES_PER_STRIP), base_m=BASE_M
    )
    block = bench_blocks.fly(strips, TIES_PER_IMAGE * n_images, control=(6, 6), seed=seed).block
    _write(folder, block, focal_mm=bench_blocks.START_F_MM)


def write_turned(folder: Path, n_images: int, *, seed: int = 1) -> None:
    """Write the flight that is less in order; parameters as those of `write`."""
    rng = np.random.default_rng(seed)
    n_strips = n_images // IMAGES_PER_STRIP
    strips = [
        replace(
            strip,
            aside_m=ASIDE_M * (k - (n_strips - 1) / 2),
            base_m=BASE_M * (1 + SPEEDS * rng.uniform(-1, 1)),
        )
        for k, strip in enumerate(
            bench_blocks.parallel([IMAGES_PER_STRIP] * n_strips, base_m=BASE_M)
        )
    ]
    rng.shuffle(strips)
    n_ties = TIES_PER_TURNED_IMAGE * n_images
    block = bench_blocks.fly(strips, n_ties, control=(6, 6), seed=seed, turned_deg=TURNED_DEG).block
    _write(folder, block, focal_mm=1.004 * bench_blocks.TRUTH.interior.f)


def _write(folder: Path, block: Block, *, focal_mm: float) -> None:
    strip = 1 + np.arange(len(block.images)) // IMAGES_PER_STRIP
    (folder / block.name).mkdir(parents=True, exist_ok=True)
    text = FLIGHT_TOML.format(focal_mm=focal_mm)
    (folder / "flight.toml").write_text(text, encoding="utf-8")
    for table in _tables(block, strip):
        pd.DataFrame(table.columns).round(table.decimals).to_csv(folder / table.file, index=False)


def _tables(block: Block, strip: np.ndarray) -> tuple[_Table, ...]:
    names, images = np.array(block.points), np.array(block.images.names)
    on_sensor = inside(block.cameras[0], block.image_points.colrow)
    measured, control = block.image_points[on_sensor], block.control
    enh, opk = block.frame.pose_to_grid(block.trajectory.T_m_b)
    col, row = measured.colrow.T
    by_image = np.lexsort((measured.point_idx, measured.image_idx))
    return (
        _Table(
            "control_points.csv",
            {
                "point": names[control.point_idx],
                **_columns("east_m north_m height_m", block.frame.to_grid(control.x_m)),
                **_columns("sigma_east_m sigma_north_m sigma_height_m", control.sigma_m),
            },
            6,
        ),
        _Table(
            f"{block.name}/images.csv",
            {"image": images, "camera": block.cameras[0].name, "exposure": images, "strip": strip},
            0,
        ),
        _Table(
            f"{block.name}/trajectory.csv",
            {
                "exposure": images,
                **_columns("east_m north_m height_m", enh),
                **_columns("omega_deg phi_deg kappa_deg", np.degrees(opk)),
            },
            10,
        ),
        _Table(
            f"{block.name}/image_points.csv",
            {
                "image": images[measured.image_idx[by_image]],
                "point": names[measured.point_idx[by_image]],
                "col_px": col[by_image],
                "row_px": row[by_image],
            },
            6,
        ),
    )


def _columns(names: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(names.split(), values.T, strict=True))


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the flight that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--images", type=int, default=1000, help="a multiple of 40")
    parser.add_argument("--turned", action="store_true", help="the flight that is less in order")
    given = parser.parse_args(arguments)
    (write_turned if given.turned else write)(given.out, given.images)


if __name__ == "__main__":
    main()
