"""Results as tables for programs: estimates with their sigma, covariances, ground points."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4files.flight.block_from_tables import index_of
from acx4files.flight.problems import did_you_mean, lines_of, quoted
from acx4files.flight.settings import Apriori
from acx4files.flight.table_files import Columns, table_in_memory
from acx4files.flight.tables import SIGMA_POSITION, Schema
from acx4lib.block import Block
from acx4lib.calibration import estimates
from acx4lib.calibration.estimates import Calibration
from acx4lib.errors import FlightError
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import direct
from acx4lib.georeferencing.direct import Georeferenced, Rays
from acx4lib.least_squares.covariance import sigmas

PIXELS = Schema(
    required=("image", "col_px", "row_px", "height_m"),
    optional=("sigma_px", "sigma_height_m"),
    keys=(),
)
"""Columns of a table of pixels to be located on the ground."""


def parameters(calibration: Calibration) -> pd.DataFrame:
    """Return the estimated parameters of a calibration.

    Returns
    -------
    DataFrame
        ``camera``, ``parameter``, ``value``, ``sigma``, ``unit``, ``sigma_before`` as
        parameters.csv has them, sigma a posteriori, infinite where the data say nothing; and
        whether the data determine it.
    """
    listed = estimates.parameters(calibration)
    return pd.DataFrame(
        {
            "camera": [p.camera for p in listed],
            "parameter": [p.name for p in listed],
            "value": [p.value for p in listed],
            "sigma": [p.sigma for p in listed],
            "unit": [p.unit for p in listed],
            "sigma_before": [p.sigma_before for p in listed],
            "determined": estimates.is_determined(calibration),
        }
    )


def covariance(calibration: Calibration) -> pd.DataFrame:
    """Return the a posteriori covariance of the parameters, in the units of `parameters`.

    Returns
    -------
    DataFrame
        Square; rows and columns are named ``camera/parameter``.
    """
    names = [f"{p.camera}/{p.name}" for p in estimates.parameters(calibration)]
    return pd.DataFrame(estimates.reported_covariance(calibration), index=names, columns=names)


def ground_points(block: Block, georeferenced: Georeferenced, pixels: Columns) -> pd.DataFrame:
    """Locate pixels on the ground at given heights.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
        The block's poses, as `georeferencing.direct.georeference` returns them.
    pixels : DataFrame or dict of arrays
        ``image``, ``col_px``, ``row_px``, ``height_m``, the height in the flight's system, and
        optionally ``sigma_px``, by default that of `Apriori`, and ``sigma_height_m``, by default
        negligible.

    Returns
    -------
    DataFrame
        ``image``, ``col_px``, ``row_px``, then ``east_m``, ``north_m``, ``height_m`` and the sigma
        of each, a priori, from pixel, height, interior orientation, mounting and trajectory. NaN
        where a ray does not come down to the height.

    Raises
    ------
    FlightError
        With all problems of the table, by row from 0 and column.
    """
    table = table_in_memory(pixels, "pixels", PIXELS)
    names = table.text.get("image", ())
    image_idx = index_of(names, block.images.names)
    unknown = [
        table.problem(
            row,
            "image",
            f"{quoted(names[row])} is unknown{did_you_mean(names[row], block.images.names)}",
            f"must be an image of block {block.name}",
        )
        for row in np.flatnonzero(image_idx < 0).tolist()
    ]
    if problems := [*table.problems, *unknown]:
        raise FlightError(lines_of(problems))
    n = len(table)
    rays = Rays(
        image_idx=image_idx,
        group=np.arange(n),
        colrow=np.column_stack([table.numbers[name] for name in ("col_px", "row_px")]),
        sigma_px=table.numbers.get("sigma_px", np.full(n, Apriori().image_point_px)),
    )
    ground = direct.ground_points(
        block,
        georeferenced,
        rays,
        height_m=table.numbers["height_m"],
        sigma_height_m=table.numbers.get("sigma_height_m"),
    )
    out = pd.DataFrame(
        {"image": list(names), "col_px": rays.colrow[:, 0], "row_px": rays.colrow[:, 1]}
    )
    out[[f"{axis}_m" for axis in AXES]] = ground.enh
    out[list(SIGMA_POSITION)] = sigmas(ground.cov)
    return out
