"""The worked example of part I: four images of two opposite strips, and two control points.

All that a reader needs to repeat it by hand: numbers with few digits, in axes that lie on no map.
The first strip was flown towards east, the second back towards west. Positions and attitudes of the
IMU were observed, image points measured and control points surveyed; every number has an error
that its standard deviation allows. `TRUTH` is what the numbers were made with.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4lib.expected import Array
from acx4lib.flight.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy
from acx4lib.geometry.frames import Pose, rotation_from_opk

F_MM = 50.0
PIXEL_MM = 0.010
WIDTH_PX, HEIGHT_PX = 4000, 3000
LEVER_ARM_M = (0.20, -0.10, -0.40)
"""From the IMU to the perspective centre, body axes: forward, left, up; surveyed."""

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
