"""Exterior orientations of a block by direct georeferencing, eq. (14), as other programs count."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.block import Block, select_cameras, unobserved
from acx4lib.flight.block_from_tables import BLOCKS, read_block, without_points
from acx4lib.flight.reader import Flight, checked
from acx4lib.flight.toml_file import read_toml
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import R_ENU_NED, MappingFrame, rotation_enu_to_ecef
from acx4lib.georeferencing.direct import Georeferenced, georeference, pose_covariances
from acx4lib.results.rows import exterior_table
from acx4tools.exchange.outward.calibrated import Calibrated
from acx4tools.exchange.outward.taken import Taken

R_C_TOP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From a body whose forward axis is up in the image, to the camera's axes; its down is the view."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Oriented:
    """The images of a block with calibrated cameras, and their poses.

    Attributes
    ----------
    block : Block
    georeferenced : Georeferenced
        Cameras and poses in the block's topocentric frame.
    """

    block: Block
    georeferenced: Georeferenced

    @property
    def T_m_c(self) -> Pose:
        """Poses of the images."""
        return self.georeferenced.T_m_c

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the images."""
        return self.block.images.names

    @property
    def origin(self) -> str:
        """Where the topocentric axes begin, in words."""
        if self.block.frame.grid.is_local:
            return "the origin of the flight's coordinates, whose axes they are"
        lon, lat = self.block.frame.origin
        return f"longitude {lon:.9f}, latitude {lat:.9f} degrees, ellipsoidal height 0"


def read_flown(path: Path) -> Flight:
    """Read a flight that may have no measurements and no control points.

    Raises
    ------
    FlightError
        With all that is wrong with it.
    """
    present = [name for name in BLOCKS if (path / name).is_dir()]
    blocks = [without_points(read_block(path, name, pictures=path), path) for name in present]
    return checked(read_toml(path / "flight.toml"), blocks)


def orient(calibrated: Calibrated, flight: Flight, block: str) -> Oriented:
    """Return the images of a block that calibrated cameras took, oriented by eq. (14).

    Parameters
    ----------
    calibrated : Calibrated
    flight : Flight
        That of the calibration, or a later one with the same cameras.
    block : str
        Of its blocks.

    Raises
    ------
    FlightError
        Where the calibration has no mounting, the block no image of a calibrated camera, or its
        trajectory observes nothing.
    """
    if not calibrated.mounted:
        problem = f"{flight.path}: {calibrated.method} has no boresight and no lever arm"
        raise FlightError([f"{problem}; orient images by another method: --method rig"])
    names = [camera.name for camera in calibrated.cameras]
    if block not in flight.blocks:
        raise FlightError([f"{flight.path}: no block {block}; it has {', '.join(flight.blocks)}"])
    if unobserved(flight.block(block)):
        problem = f"{flight.path}: block {block}: its trajectory has start values without sigma"
        raise FlightError([f"{problem}; nothing can be oriented by it"])
    for variant in (flight.mounted(block), flight.block(block)):
        present = [camera.name for camera in variant.cameras if camera.name in names]
        if present:
            mounted = select_cameras(variant, present)
            g = georeference(mounted, calibrated.calibration)
            return Oriented(block=mounted, georeferenced=g)
    listed = ", ".join(camera.name for camera in flight.block(block).cameras)
    problem = f"{flight.path}: block {block} has images of {listed}, not of {', '.join(names)}"
    raise FlightError([f"{problem}; name another --method"])


def in_grid(oriented: Oriented) -> pd.DataFrame:
    """Return positions and omega, phi, kappa in the grid with their sigma, as results have them."""
    cov = pose_covariances(oriented.block, oriented.georeferenced)
    return exterior_table(oriented.block, oriented.names, T_m_c=oriented.T_m_c, cov=cov)


def _topocentric(oriented: Oriented) -> pd.DataFrame:
    """Return positions and omega, phi, kappa in the block's topocentric frame: x_m, ..., kappa_deg.

    Its axes are east, north, up at `Oriented.origin`.
    """
    T = oriented.T_m_c
    return _table(oriented, ("x_m", "y_m", "z_m"), T.r, ("omega", "phi", "kappa"), T.opk)


def _geographic(oriented: Oriented) -> pd.DataFrame:
    """Return latitude, longitude, ellipsoidal height, and roll, pitch, heading of the image.

    The image counts as a body that looks down: its top edge is ahead, its right edge right.
    """
    lonlath = oriented.block.frame.to_geographic(oriented.T_m_c.r)
    names = ("lat_deg", "lon_deg", "height_m")
    rph = roll_pitch_heading(oriented.block.frame, oriented.T_m_c)
    return _table(oriented, names, lonlath[:, [1, 0, 2]], ("roll", "pitch", "heading"), rph)


def roll_pitch_heading(frame: MappingFrame, T_m_c: Pose) -> Array:
    """Return roll, pitch, heading of images as bodies with the top edge ahead, radians, (n, 3).

    Parameters
    ----------
    frame : MappingFrame
    T_m_c : Pose
        Of n images.

    Returns
    -------
    ndarray, shape (n, 3)
        Heading from true north, between 0 and a whole turn.
    """
    lonlat = frame.to_geographic(T_m_c.r)[:, :2]
    R_e_m = rotation_enu_to_ecef(frame.origin[None])[0]
    R_t_c = np.swapaxes(rotation_enu_to_ecef(lonlat), -1, -2) @ R_e_m @ T_m_c.R
    R = R_ENU_NED @ R_t_c @ R_C_TOP
    roll = np.arctan2(R[:, 2, 1], R[:, 2, 2])
    pitch = np.arctan2(-R[:, 2, 0], np.hypot(R[:, 2, 1], R[:, 2, 2]))
    heading = np.mod(np.arctan2(R[:, 1, 0], R[:, 0, 0]), 2 * np.pi)
    return np.stack([roll, pitch, heading], axis=-1)


def _table(
    oriented: Oriented, positions: Iterable[str], r: Array, angles: Iterable[str], values: Array
) -> pd.DataFrame:
    columns = [*positions, *(f"{angle}_deg" for angle in angles)]
    frame = pd.DataFrame(np.column_stack([r, np.degrees(values)]), columns=columns)
    frame.insert(0, "image", list(oriented.names))
    return frame


# --- Exterior orientations as tables of text, which most programs read by declared columns


FILE = "orientations.csv"

DIGITS = {"_m": 5, "_deg": 9}
"""Decimals of metres and degrees; those of latitude and longitude are a tenth of a millimetre."""

OPK = (
    "omega, phi, kappa of R = Rx(omega) Ry(phi) Rz(kappa), from the camera's axes, x right and y "
    "up in the image, to those of {}"
)
GRID = "grid east, grid north and the ellipsoid's normal at the image: {}; heights: {}"
ELLIPSOIDAL = "heights are ellipsoidal"
CENTRE = "positions are those of the perspective centre, by trajectory, boresight and lever arm"
RPH = (
    "roll, pitch and heading are those of the image, not of the body: a camera that looks down is "
    "level, its heading, from true north, is that of the top edge, positive pitch lifts the view "
    "ahead, positive roll lowers the right edge; as a trajectory of a flight they belong to a "
    "camera with mount_kappa_deg = -90"
)
SIGMA_OF = "sigma: a priori of the trajectory, a posteriori of the calibration, with correlations"


def opk(oriented: Oriented) -> Taken:
    """Return positions and angles in the grid of the flight, with a priori sigma."""
    grid = oriented.block.frame.grid
    axes = GRID.format(grid.crs, grid.heights)
    return _taken(in_grid, oriented, (CENTRE, OPK.format(axes), SIGMA_OF))


def topocentric_table(oriented: Oriented) -> Taken:
    """Return positions and angles in topocentric axes."""
    axes = f"east, north, up at {oriented.origin}"
    return _taken(_topocentric, oriented, (CENTRE, OPK.format(axes)))


def rph(oriented: Oriented) -> Taken:
    """Return geographic positions and roll, pitch, heading of the images."""
    return _taken(_geographic, oriented, (CENTRE, ELLIPSOIDAL, RPH))


def _taken(
    table_of: Callable[[Oriented], pd.DataFrame], oriented: Oriented, assumed: tuple[str, ...]
) -> Taken:
    table = table_of(oriented)
    for name in table.columns[1:]:
        unit = next(unit for unit in DIGITS if name.endswith(unit))
        table[name] = [f"{value:.{DIGITS[unit]}f}" for value in table[name]]
    text = table.to_csv(index=False, lineterminator="\n")
    left_out = () if "sigma_east_m" in table else ("standard deviations: --to opk has them",)
    return Taken(files={FILE: text}, assumed=assumed, left_out=left_out)
