"""Small flights on disk: exact, by the library's own projection, just enough for the reader."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy, distort, inside
from acx4lib.geometry.collinearity import pinhole, to_camera
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem, MappingFrame, mean_origin

CRS = "EPSG:31982"
GRID = GridSystem(crs=CRS)
MIDDLE = np.array([670_000.0, 7_188_000.0])  # east, north of the test field
MOUNTS = {"CAM": (0.0, 0.0, 90.0), "LEFT": (-15.0, 0.0, 90.0), "RIGHT": (15.0, 0.0, -90.0)}

HEAD = """\
name = "small"
crs = "EPSG:31982"
heights = "ellipsoidal"
"""
CAMERA = """
[cameras.{name}]
width_px = 4000
height_px = 3000
pixel_um = 5.0
focal_mm = 25.0
k1 = 1e-5
mount_omega_deg = {0}
mount_phi_deg = {1}
mount_kappa_deg = {2}
lever_z_m = 0.2
"""
SYNTHETIC = """
[synthetic]
camera = "CAM"
heads = ["LEFT", "RIGHT"]
"""


def cameras() -> dict[str, Camera]:
    """Return the cameras of the small flights, as flight.toml has them."""
    return {
        name: Camera(
            name=name,
            width_px=4000,
            height_px=3000,
            pixel_mm=0.005,
            interior=Interior(f=25.0, k1=1e-5),
            T_b_c=Pose(R=rotation_from_opk(np.radians(opk)), r=np.array([0.0, 0.0, 0.2])),
        )
        for name, opk in MOUNTS.items()
    }


def control_points() -> pd.DataFrame:
    """Return nine points on hills, 200 m apart."""
    east, north = (a.ravel() for a in np.meshgrid([-200.0, 0.0, 200.0], [-200.0, 0.0, 200.0]))
    return pd.DataFrame(
        {
            "point": [f"G{i}" for i in range(9)],
            "east_m": MIDDLE[0] + east,
            "north_m": MIDDLE[1] + north,
            "height_m": 900.0 + 0.05 * east - 0.03 * north,
        }
    )


def exposures() -> pd.DataFrame:
    """Return two strips of three exposures, there and back, 1000 m above ground."""
    along = [-150.0, 0.0, 150.0]
    return pd.DataFrame(
        {
            "exposure": [f"E{i}" for i in range(6)],
            "east_m": MIDDLE[0] + np.array([*along, *along[::-1]]),
            "north_m": MIDDLE[1] + np.repeat([-100.0, 100.0], 3),
            "height_m": 1900.0,
            "omega_deg": [0.3, -0.2, 0.1, 0.2, -0.1, 0.0],
            "phi_deg": [-0.1, 0.2, 0.4, -0.3, 0.1, 0.2],
            "kappa_deg": np.repeat([2.0, -177.0], 3),
        }
    )


def geographic(trajectory: pd.DataFrame) -> pd.DataFrame:
    """Return a trajectory in its other form; exact only for a level body."""
    lonlat = GRID.lonlat_from_grid(trajectory[["east_m", "north_m"]].to_numpy())
    convergence = np.degrees(GRID.convergence(lonlat))
    heading = 90.0 - trajectory["kappa_deg"] + convergence
    return pd.DataFrame(
        {
            "exposure": trajectory["exposure"],
            "lat_deg": lonlat[:, 1],
            "lon_deg": lonlat[:, 0],
            "height_m": trajectory["height_m"],
            "roll_deg": 0.0,
            "pitch_deg": 0.0,
            "heading_deg": heading % 360,
        }
    )


def body_poses(frame: MappingFrame, trajectory: pd.DataFrame) -> Pose:
    """Return T_m_b of a trajectory in grid form."""
    enh = trajectory[["east_m", "north_m", "height_m"]].to_numpy()
    return frame.pose_from_grid(
        enh, np.radians(trajectory[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy())
    )


def measure(trajectory: pd.DataFrame, points: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """Return where the points lie in one image per exposure and camera."""
    lonlat = GRID.lonlat_from_grid(trajectory[["east_m", "north_m"]].to_numpy())
    frame = mean_origin(GRID, lonlat)
    T_m_b = body_poses(frame, trajectory)
    x_m = frame.from_grid(points[["east_m", "north_m", "height_m"]].to_numpy())
    rows = []
    for name in names:
        camera = cameras()[name]
        for i, exposure in enumerate(trajectory["exposure"]):
            colrow = project(camera, T_m_b[i] @ camera.T_b_c, x_m)
            seen = inside(camera, colrow)
            rows += [
                (f"{exposure}_{name}", point, round(col, 3), round(row, 3))
                for point, (col, row) in zip(points["point"][seen], colrow[seen], strict=True)
            ]
    return pd.DataFrame(rows, columns=["image", "point", "col_px", "row_px"])


def project(camera: Camera, T_m_c: Pose, x_m: Array) -> Array:
    """Return pixel coordinates of points in one image."""
    poses = Pose(R=np.repeat(T_m_c.R[None], len(x_m), 0), r=np.repeat(T_m_c.r[None], len(x_m), 0))
    ideal = pinhole(camera.interior.f, to_camera(poses, x_m))
    return colrow_from_xy(camera, distort(camera.interior, ideal))


def images(trajectory: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """Return one image per exposure and camera."""
    rows = [
        (f"{exposure}_{name}", name, exposure, "12"[i >= 3])
        for name in names
        for i, exposure in enumerate(trajectory["exposure"])
    ]
    return pd.DataFrame(rows, columns=["image", "camera", "exposure", "strip"])


def write_flight(
    folder: Path,
    *,
    blocks: tuple[str, ...] = ("calibration",),
    form: str = "grid",
    mounted: tuple[str, ...] = ("CAM",),
) -> Path:
    """Write a small flight that has nothing wrong with it.

    Parameters
    ----------
    folder : Path
    blocks : tuple of str
    form : {"grid", "geographic"}
        Of the trajectory; the body is level in the second.
    mounted : tuple of str
        Cameras of the other blocks than the heads'.
    """
    names = ["LEFT", "RIGHT", "CAM"] if "heads" in blocks else list(mounted)
    toml = HEAD + "".join(CAMERA.format(*MOUNTS[name], name=name) for name in names)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "flight.toml").write_text(toml + (SYNTHETIC if "heads" in blocks else ""))
    control = control_points()
    control.to_csv(folder / "control_points.csv", index=False)
    for block in blocks:
        trajectory = exposures()
        if form == "geographic":
            trajectory[["omega_deg", "phi_deg"]] = 0.0
        taken = ["LEFT", "RIGHT"] if block == "heads" else list(mounted)
        (folder / block).mkdir()
        images(trajectory, taken).to_csv(folder / block / "images.csv", index=False)
        measured = measure(trajectory, control, taken)
        measured.to_csv(folder / block / "image_points.csv", index=False)
        table = geographic(trajectory) if form == "geographic" else trajectory
        table.to_csv(folder / block / "trajectory.csv", index=False)
    return folder


# --- files of a written flight, and changes of them --------------------------------------------


IMAGES = "calibration/images.csv"

POINTS = "calibration/image_points.csv"

TRAJECTORY = "calibration/trajectory.csv"

CONTROL = "control_points.csv"

TOML = "flight.toml"


def replace(folder: Path, file: str, old: str, new: str, count: int = -1) -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, count))


def append(folder: Path, file: str, text: str) -> None:
    (folder / file).write_text((folder / file).read_text() + text)


def change(folder: Path, file: str, by: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    by(pd.read_csv(folder / file)).to_csv(folder / file, index=False)
