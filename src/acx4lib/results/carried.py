"""The table of points carried into synthetic images, and the blocks that it makes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from acx4lib.errors import FlightError
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import index_of
from acx4lib.flight.reader import Flight
from acx4lib.results import folder
from acx4lib.results.adjustments import NO_ADJUSTMENT, Record
from acx4lib.synthetic_image.carried import CarriedPoints, synthetic_block

METHOD = "synthetic/points"
"""The carried points among the results."""

MEASURED = ("images.csv", "image_points.csv")
"""Tables of a block that the carried points depend on."""


def of_carried(flight: Flight, carried: Mapping[str, CarriedPoints]) -> Record:
    """Return the record of the points of all blocks that were carried.

    Parameters
    ----------
    flight : Flight
    carried : mapping of str to CarriedPoints
        By block.
    """
    tables = [_table(flight.block(name), points) for name, points in carried.items()]
    entry: dict[str, object] = {
        **NO_ADJUSTMENT,
        "converged": True,
        "n_observations": 2 * sum(map(len, carried.values())),
        "n_left_out": sum(points.n_left_out for points in carried.values()),
        "measured": {file: flight.sha256[file] for name in carried for file in _files(name)},
    }
    return Record(
        stage="synthetic",
        method="points",
        tables={"synthetic_points": pd.concat(tables, ignore_index=True)},
        summary={METHOD: entry},
    )


def _files(block: str) -> list[str]:
    return [f"{block}/{name}" for name in MEASURED]


def _table(block: Block, carried: CarriedPoints) -> pd.DataFrame:
    heads = [camera.name for camera in block.cameras]
    return pd.DataFrame(
        {
            "block": block.name,
            "image": [block.trajectory.exposures[i] for i in carried.exposure_idx],
            "point": [block.points[i] for i in carried.point_idx],
            "head": [heads[i] for i in carried.camera_idx],
            "col_px": carried.colrow[:, 0],
            "row_px": carried.colrow[:, 1],
            "sigma_col_px": carried.sigma_px[:, 0],
            "sigma_row_px": carried.sigma_px[:, 1],
        }
    )


def mounted_block(flight: Flight, name: str, found: folder.Results) -> Block:
    """Return a block with the camera that is mounted: carried, where it is measured in heads.

    Parameters
    ----------
    flight : Flight
    name : str
        ``calibration`` or ``validation``.
    found : Results
        Only looked at where the block is measured in heads.

    Raises
    ------
    FlightError
        Where the block is not in the flight, stage synthetic has not carried its points, or they
        were measured anew since.
    """
    block, synthetic = flight.block(name), flight.synthetic_camera
    if name not in flight.carried or synthetic is None:
        return block
    return synthetic_block(block, read_carried(flight, block, found), synthetic)


def read_carried(flight: Flight, block: Block, found: folder.Results) -> CarriedPoints:
    """Return the points of a block that stage synthetic carried.

    Parameters
    ----------
    flight : Flight
    block : Block
        One of its blocks that are measured in heads.
    found : Results

    Raises
    ------
    FlightError
        As `mounted_block`.
    """
    table = folder.rows(found, "synthetic_points", METHOD)
    table = table[table["block"] == block.name]
    said = found.summary.get(METHOD, {}).get("measured", {})
    carried = CarriedPoints(
        exposure_idx=index_of(table["image"], block.trajectory.exposures),
        point_idx=index_of(table["point"], block.points),
        camera_idx=index_of(table["head"], [camera.name for camera in block.cameras]),
        colrow=table[["col_px", "row_px"]].to_numpy(),
        sigma_px=table[["sigma_col_px", "sigma_row_px"]].to_numpy(),
    )
    known = np.stack([carried.exposure_idx, carried.point_idx, carried.camera_idx])
    now = {file: flight.sha256[file] for file in _files(block.name)}
    if not isinstance(said, dict) or not now.items() <= said.items() or np.any(known < 0):
        problem = (
            f"{found.folder}: block {block.name} is not the one whose points were carried into the "
            "synthetic image; run stage synthetic again"
        )
        raise FlightError([problem])
    return carried
