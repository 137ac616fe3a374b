"""Whole commands, from start to end: seconds, and memory of all processes.

Flights are made into a folder that is kept.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4lib.block import Block
from acx4lib.geometry.camera import inside
from benchmarks import harness
from benchmarks.adjusting import bench_blocks

EXPOSURE = "H3-04"
NUMBERS = "run --numbers-only"


Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A flight to time commands on.

    Attributes
    ----------
    name : str
    make : callable
        Takes the folder to make.
    commands : tuple of str
        A `render` follows a `run`.
    repeat : int
    """

    name: str
    make: Callable[[Path], None]
    commands: tuple[str, ...]
    large: bool = False


def _simulated(*options: str) -> Callable[[Path], None]:
    return lambda folder: _run([harness.ACX4, "simulate", *options, "--out", str(folder)])


_ALL = ("check", NUMBERS, "run", "report")
KINDS = (
    Kind(name="single-head", make=_simulated("single-head"), commands=_ALL),
    Kind(name="four heads", make=_simulated("acx4"), commands=_ALL),
    Kind(
        name="four heads with pictures",
        make=_simulated("acx4", "--images", EXPOSURE),
        commands=("check", "run --stages heads,synthetic", f"render --exposures {EXPOSURE}"),
        large=True,
    ),
    Kind(
        name="1 000 images",
        make=lambda folder: write_large(folder, 1000),
        commands=_ALL,
        large=True,
    ),
    Kind(
        name="4 000 images",
        make=lambda folder: write_large(folder, 4000),
        commands=("check", NUMBERS),
        large=True,
    ),
)


def rows(_folder: Path, repeat: int) -> tuple[list[Row], Row]:
    """Return a row for every run of every command, and what belongs to all."""
    return [row for kind in KINDS for row in measured(kind, harness.FLIGHTS, repeat)], {}


def measured(kind: Kind, folder: Path, repeat: int) -> Iterator[Row]:
    """Yield a row for every run of every command."""
    flight = folder / kind.name.replace(" ", "-")
    if not (flight / "flight.toml").is_file():
        kind.make(flight)
    sizes = {"flight": kind.name, "images": _rows(flight, "images")}
    sizes["measurements"] = _rows(flight, "image_points")
    for number in range(1, (1 if kind.large else repeat) + 1):
        with tempfile.TemporaryDirectory(dir=folder) as made:
            for text in kind.commands:
                took = harness.timed(*call(text, flight, Path(made)))
                yield {**sizes, "command": text, "run": number, **took}


def call(text: str, flight: Path, made: Path) -> list[str]:
    """Return the whole command; each kind of run has results of its own."""
    name, *options = text.split()
    numbers, full = made / "numbers", made / "results"
    return [
        *(harness.ACX4, name),
        *options,
        *{
            "check": [str(flight)],
            "run": ["--results", str(numbers if text == NUMBERS else full), str(flight)],
            "report": [str(full)],
            "render": [str(flight), "--results", str(full), "--out", str(made / "images")],
        }[name],
    ]


def _rows(flight: Path, table: str) -> int:
    """Return the number of rows of a table in all blocks of a flight."""
    return sum(len(path.read_bytes().splitlines()) - 1 for path in flight.glob(f"*/{table}.csv"))


def _run(arguments: Sequence[str]) -> None:
    sys.stderr.write(f"{' '.join(arguments[1:])}\n")
    harness.called(arguments)


# --- a folder of a thousand images -------------------------------------------------------------


BASE_M = 250.0
IMAGES_PER_STRIP = 40
TIES_PER_IMAGE = 179

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


@dataclass(frozen=True)
class _Table:
    """A table of a flight's folder and the decimals of its numbers."""

    file: str
    columns: dict[str, object]
    decimals: int


def write_large(folder: Path, n_images: int) -> None:
    """Write a flight of whole strips.

    Parameters
    ----------
    folder : Path
        It is made; its files are replaced.
    n_images : int
        A multiple of `IMAGES_PER_STRIP`.
    """
    strips = bench_blocks.parallel(
        [IMAGES_PER_STRIP] * (n_images // IMAGES_PER_STRIP), base_m=BASE_M
    )
    block = bench_blocks.fly(strips, TIES_PER_IMAGE * n_images, control=(6, 6), seed=1).block
    strip = 1 + np.arange(len(block.images)) // IMAGES_PER_STRIP
    (folder / block.name).mkdir(parents=True, exist_ok=True)
    (folder / "flight.toml").write_text(FLIGHT_TOML, encoding="utf-8")
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
