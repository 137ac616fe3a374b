"""Planned flights: the precision that their geometry gives, before anything is measured.

A covariance needs derivatives and standard deviations, no measurement. So a planned block has the
image points where they would be, without errors, and the adjustment gives its normal matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pandas as pd

from acx4book.foundations import example
from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.bundle.adjust import designed, mounted_orientation
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, inside
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.least_squares.covariance import correlation
from acx4lib.model import Model

CONTROL_M = ((120.0, 110.0), (-110.0, 120.0), (-120.0, -110.0), (110.0, -120.0), (10.0, 20.0))
"""Places of control points, east and north; a plan takes the first of them."""

RELIEF_M = 10.0
"""Largest height of the ground over and under its mean."""

SHOWN = {
    "f": ("f, mm", 1.0),
    "xp": ("xp, mm", 1.0),
    "yp": ("yp, mm", 1.0),
    "b1": ("b1, ppm", 1e6),
    "b2": ("b2, ppm", 1e6),
    "lever_x": ("lever x, m", 1.0),
    "lever_y": ("lever y, m", 1.0),
    "lever_z": ("lever z, m", 1.0),
    "boresight_x": ("ω, °", 180.0 / np.pi),
    "boresight_y": ("φ, °", 180.0 / np.pi),
    "boresight_z": ("κ, °", 180.0 / np.pi),
    "shift_east": ("GNSS east, m", 1.0),
    "shift_north": ("GNSS north, m", 1.0),
    "shift_height": ("GNSS height, m", 1.0),
}
"""Unknowns by the library's names: name with unit for readers, in the order of tables, and what
one of the library's units is in it."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """A strip of five images over the middle of the field.

    Attributes
    ----------
    azimuth_deg : float
        Direction of flight.
    height_m : float
        Over the mean ground.
    """

    azimuth_deg: float
    height_m: float = 500.0

    n: ClassVar[int] = 5

    @property
    def base_m(self) -> float:
        """Distance between images: four fifths of them overlap at any height."""
        return 0.16 * self.height_m


def lines(*azimuths_deg: float, height_m: float = 500.0) -> list[Line]:
    """Return lines in these directions, all at one height."""
    return [Line(azimuth_deg=azimuth, height_m=height_m) for azimuth in azimuths_deg]


def planned(lines: Sequence[Line], *, control: int = 5) -> Block:
    """Return a block of the example's camera without errors of measurement.

    Parameters
    ----------
    lines : sequence of Line
    control : int
        Number of control points, at most those of `CONTROL_M`.
    """
    T_m_b = _exposures(lines)
    x_m = np.concatenate([_ground(np.array(CONTROL_M[:control]).reshape(-1, 2)), _tie_points()])
    camera, n = example.camera(), len(T_m_b)
    image, point, colrow = _seen(camera, T_m_b, x_m)
    names = tuple(f"{k}-{i}" for k, line in enumerate(lines) for i in range(line.n))
    return Block(
        cameras=(camera,),
        images=Images(names=names, strips=tuple(name.split("-")[0] for name in names)),
        points=tuple(f"P{k}" for k in range(len(x_m))),
        image_points=ImagePoints(
            image_idx=image,
            point_idx=point,
            colrow=colrow,
            sigma_px=np.full(len(colrow), example.SIGMA_IMAGE_MM / example.PIXEL_MM),
        ),
        trajectory=Trajectory(
            exposures=names,
            T_m_b=T_m_b,
            sigma_position=np.tile(example.SIGMA_POSITION_M, (n, 1)),
            sigma_attitude=np.radians(np.tile(example.SIGMA_ATTITUDE_DEG, (n, 1))),
        ),
        control=SurveyedPoints(
            point_idx=np.arange(control),
            x_m=x_m[:control],
            sigma_m=np.tile(example.SIGMA_CONTROL_M, (control, 1)),
        ),
    )


def covariance(
    block: Block, *, free: Sequence[str] = (), fix: Sequence[str] = (), gnss: Sequence[str] = ()
) -> pd.DataFrame:
    """Return the a priori covariance of the parameters that a planned block estimates.

    Parameters
    ----------
    block : Block
    free, fix, gnss
        As in `mounting.single_step`.

    Returns
    -------
    DataFrame
        Square, in the units of `SHOWN`. The variance is infinite where the design leaves an
        unknown open.
    """
    network = mounted_orientation(block, Model(free=free, fix=fix, gnss=gnss))
    keys = [name.split("/")[1] for name in network.column_names()]
    columns = np.array([keys.index(key) for key in SHOWN if key in keys])
    names, units = zip(*(SHOWN[keys[k]] for k in columns), strict=True)
    inverse = designed(network).solution.inverse
    cov = inverse.at(columns[:, None], columns) * np.outer(units, units)
    left_open = np.flatnonzero(inverse.undetermined[columns])
    cov[left_open, left_open] = np.inf
    return pd.DataFrame(cov, index=names, columns=names)


def sigmas(covariances: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Return standard deviations, a row for each unknown and a column for each design."""
    listed = {
        name: pd.Series(np.sqrt(np.diag(cov)), index=cov.index) for name, cov in covariances.items()
    }
    table = pd.DataFrame(listed)
    return table.reindex([name for name, _ in SHOWN.values() if name in table.index])


def written(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of `sigmas` as text: *open* is left open by the design, *held* no unknown.

    Standard deviations have two digits.
    """
    return table.map("{:#.2g}".format).replace(
        {"inf": "open", "nan": "held", r"\.$": ""}, regex=True
    )


def correlations(cov: pd.DataFrame) -> pd.DataFrame:
    """Return the correlation matrix of a covariance matrix, with its names."""
    return pd.DataFrame(correlation(cov.to_numpy()), index=cov.index, columns=cov.columns)


# --- where things are ------------------------------------------------------------------------


def _exposures(lines: Sequence[Line]) -> Pose:
    """Return the poses of the IMU: level, along lines over the origin."""
    positions, kappas = [], []
    for line in lines:
        azimuth = np.radians(line.azimuth_deg)
        forward = np.array([np.sin(azimuth), np.cos(azimuth)])
        along = line.base_m * (np.arange(line.n) - (line.n - 1) / 2)
        positions += [[*(t * forward), line.height_m] for t in along]
        kappas += [np.pi / 2 - azimuth] * line.n
    opk = np.column_stack([np.zeros((len(kappas), 2)), kappas])
    return Pose(R=rotation_from_opk(opk), r=np.array(positions))


def _ground(east_north: Array) -> Array:
    """Return points on the ground, which has low hills."""
    east, north = east_north.T
    height = RELIEF_M * np.sin(east / 70.0) * np.cos(north / 90.0)
    return np.column_stack([east_north, height])


def _tie_points() -> Array:
    steps = np.linspace(-400.0, 400.0, 15)
    return _ground(np.stack([x.ravel() for x in np.meshgrid(steps, steps)], axis=-1))


def _seen(camera: Camera, T_m_b: Pose, x_m: Array) -> tuple[Index, Index, Array]:
    """Return image index, point index and pixel of every projection inside an image."""
    images, points = np.divmod(np.arange(len(T_m_b) * len(x_m)), len(x_m))
    colrow = project(camera, (T_m_b @ camera.T_b_c)[images], x_m[points])
    in_frame = inside(camera, colrow)
    return images[in_frame], points[in_frame], colrow[in_frame]
