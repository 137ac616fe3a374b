"""The worked example of part I: four images of two opposite strips, and two control points.

All that a reader needs to repeat it by hand: numbers with few digits, in axes that lie on no map.
The first strip was flown towards east, the second back towards west. Positions and attitudes of the
IMU were observed, image points measured and control points surveyed; every number has an error
that its standard deviation allows. `TRUTH` has the true values.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from IPython.display import Markdown
from numpy.typing import ArrayLike

from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy
from acx4lib.geometry.frames import Pose, rotation_from_opk, turn
from acx4lib.geometry.geodesy import GridSystem, LocalFrame, MappingFrame

F_MM = 50.0
PIXEL_MM = 0.010
WIDTH_PX, HEIGHT_PX = 4000, 3000
LEVER_ARM_M = (0.20, -0.10, -0.40)
"""Lever arm from IMU to perspective centre, body axes: forward, left, up; surveyed."""

SIGMA_IMAGE_MM = 0.004
SIGMA_POSITION_M = (0.03, 0.03, 0.05)
SIGMA_ATTITUDE_DEG = (0.005, 0.005, 0.008)
SIGMA_CONTROL_M = (0.01, 0.01, 0.02)

TRUTH = {"omega_deg": 0.30, "phi_deg": -0.20, "kappa_deg": 0.50}
"""The boresight."""

EXPOSURES = pd.DataFrame(
    [
        ("A1", -60.03, 9.99, 499.98, 0.597, -0.407, 1.200),
        ("A2", 59.99, 7.96, 502.91, -0.499, 0.802, -0.911),
        ("B1", 54.98, -11.99, 497.96, 0.403, 0.694, 179.202),
        ("B2", -65.04, -9.01, 501.01, -0.800, -0.296, 181.095),
    ],
    columns=["image", "east_m", "north_m", "height_m", "omega_deg", "phi_deg", "kappa_deg"],
)
"""Position and attitude of the IMU, observed."""

CONTROL = pd.DataFrame(
    [("P", 10.00, 80.01, 19.98), ("Q", -20.01, -89.99, 10.01)],
    columns=["point", "east_m", "north_m", "height_m"],
)
"""Control points, surveyed."""

MEASURED = pd.DataFrame(
    [
        ("A1", "P", 6.920, 6.298),
        ("A1", "Q", 3.225, -11.115),
        ("A2", "P", -4.735, 7.611),
        ("A2", "Q", -7.534, -9.790),
        ("B1", "P", 3.945, -9.495),
        ("B1", "Q", 6.821, 8.116),
        ("B2", "P", -8.038, -10.019),
        ("B2", "Q", -4.297, 7.394),
    ],
    columns=["image", "point", "x_mm", "y_mm"],
)
"""Image coordinates, measured; the principal point is (0, 0) and the lens has no distortion."""


def positions() -> Array:
    """Return the positions of the IMU, shape (4, 3), m."""
    return EXPOSURES[["east_m", "north_m", "height_m"]].to_numpy()


def attitudes() -> Array:
    """Return omega, phi, kappa of the IMU, shape (4, 3), radians."""
    return np.radians(EXPOSURES[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy())


def points() -> Array:
    """Return the control points, shape (2, 3), m."""
    return CONTROL[["east_m", "north_m", "height_m"]].to_numpy()


def measured() -> Array:
    """Return the image coordinates, shape (4, 2, 2), mm: image, point, x and y."""
    return MEASURED[["x_mm", "y_mm"]].to_numpy().reshape(4, 2, 2)


def camera() -> Camera:
    """Return the camera as it is known before the calibration: the boresight is zero."""
    return Camera(
        name="CAM",
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        pixel_mm=PIXEL_MM,
        interior=Interior(f=F_MM),
        T_b_c=Pose(R=np.eye(3), r=np.array(LEVER_ARM_M)),
    )


def block() -> Block:
    """Return the example as the library takes it."""
    image, point = np.divmod(np.arange(len(MEASURED)), len(CONTROL))
    declared = camera()
    return Block(
        cameras=(declared,),
        images=Images(names=tuple(EXPOSURES["image"]), strips=("A", "A", "B", "B")),
        points=tuple(CONTROL["point"]),
        image_points=ImagePoints(
            image_idx=image,
            point_idx=point,
            colrow=colrow_from_xy(declared, measured().reshape(-1, 2)),
            sigma_px=np.full(len(MEASURED), SIGMA_IMAGE_MM / PIXEL_MM),
        ),
        trajectory=Trajectory(
            exposures=tuple(EXPOSURES["image"]),
            T_m_b=Pose(R=rotation_from_opk(attitudes()), r=positions()),
            sigma_position=np.tile(SIGMA_POSITION_M, (4, 1)),
            sigma_attitude=np.radians(np.tile(SIGMA_ATTITUDE_DEG, (4, 1))),
        ),
        control=SurveyedPoints(
            point_idx=np.arange(2), x_m=points(), sigma_m=np.tile(SIGMA_CONTROL_M, (2, 1))
        ),
    )


# --- The worked example put on a map, and mistakes that are made there
#
# The example's axes become those of a topocentric frame at the place of the simulated flights near
# Curitiba, in UTM zone 22 South, with the ground at the height of that region.


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
    return _raised(replace(block(), frame=frame(east_m=east_m)), GROUND_M)


def map_scale(frame: MappingFrame, height_m: float) -> float:
    """Return the map length of a metre on the ground at this height, at the frame's origin.

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


# --- Vectors and matrices as mathematics, with their numbers


def matrix(name: str, values: ArrayLike, *, digits: int, unit: str = "") -> Markdown:
    """Return ``name = (values) unit`` as an equation without a number.

    Parameters
    ----------
    name : str
        LaTeX.
    values : array_like, shape (n,) or (n, m)
        A vector stands upright, as a column.
    digits : int
        After the decimal point.
    unit : str
        Behind the bracket, upright.
    """
    rows = np.atleast_2d(np.asarray(values, dtype=float).T).T
    body = r" \\ ".join(
        " & ".join(f"{v + 0.0:.{digits}f}" for v in row) for row in rows.round(digits)
    )
    behind = rf"\ \mathrm{{{unit}}}" if unit else ""
    return Markdown(  # type: ignore[no-untyped-call] # untyped
        rf"$${name} = \begin{{pmatrix}} {body} \end{{pmatrix}}{behind}$$"
    )
