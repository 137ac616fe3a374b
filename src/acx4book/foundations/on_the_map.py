"""The worked example put on a map, and mistakes that are made there.

The example's axes become those of a topocentric frame at the place of the simulated flights near
Curitiba, in UTM zone 22 South, with the ground at the height of that region.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4book.foundations import example
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.geometry.frames import Pose, rotation_from_opk, turn
from acx4lib.geometry.geodesy import GridSystem, MappingFrame
from acx4lib.geometry.local_frame import LocalFrame

CRS = "EPSG:31982"
PLACE_M = (671_000.0, 7_189_500.0)
GROUND_M = 900.0
"""Map projection, east and north of the example's origin, and its height over the ellipsoid."""


def frame(*, east_m: float = PLACE_M[0]) -> MappingFrame:
    """Return the topocentric frame below the example's origin, at this easting."""
    grid = GridSystem(crs=CRS)
    return MappingFrame(
        grid=grid, origin=grid.lonlat_from_grid(np.array([[east_m, PLACE_M[1]]]))[0]
    )


def placed(*, east_m: float = PLACE_M[0]) -> Block:
    """Return the example on the map: its coordinates are topocentric, `GROUND_M` higher."""
    return _raised(replace(example.block(), frame=frame(east_m=east_m)), GROUND_M)


def map_scale(frame: MappingFrame, height_m: float) -> float:
    """Return what a metre on the ground at this height is on the map, at the frame's origin.

    The mean of the directions east and north, from the map coordinates of points 100 m apart.
    """
    step = np.array([[50.0, 0, 0], [0, 50.0, 0]])
    up = [0.0, 0.0, height_m]
    apart = frame.to_grid(step + up) - frame.to_grid(-step + up)
    return float(np.hypot(apart[:, 0], apart[:, 1]).mean() / 100.0)


# --- mistakes --------------------------------------------------------------------------------


def in_map_coordinates(block: Block) -> Block:
    """Return a block with map coordinates and heights as if they were Cartesian."""
    enh, opk = block.frame.pose_to_grid(block.trajectory.T_m_b)
    return _moved(
        replace(block, frame=LocalFrame()),
        Pose(R=rotation_from_opk(opk), r=enh),
        block.frame.to_grid(block.control.x_m),
    )


def convergence_forgotten(block: Block) -> Block:
    """Return a block whose true headings were taken as azimuths of the grid."""
    T_m_b = block.trajectory.T_m_b
    angle = block.frame.grid.convergence(block.frame.to_geographic(T_m_b.r)[:, :2])
    R = turn(2, -angle) @ T_m_b.R  # the azimuth in the grid becomes too large by the convergence
    return _moved(block, Pose(R=R, r=T_m_b.r), block.control.x_m)


def geoid_forgotten(block: Block, undulation_m: float) -> Block:
    """Return a block whose control points have heights over the geoid, the trajectory not."""
    control = block.control.x_m - np.array([0.0, 0.0, undulation_m])
    return _moved(block, block.trajectory.T_m_b, control)


def _raised(block: Block, height_m: float) -> Block:
    up = np.array([0.0, 0.0, height_m])
    T_m_b = block.trajectory.T_m_b
    return _moved(block, Pose(R=T_m_b.R, r=T_m_b.r + up), block.control.x_m + up)


def _moved(block: Block, T_m_b: Pose, control: Array) -> Block:
    return replace(
        block,
        trajectory=replace(block.trajectory, T_m_b=T_m_b),
        control=replace(block.control, x_m=control),
    )
