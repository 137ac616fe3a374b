"""The simulator's own Earth: ellipsoid, map grid, attitudes and terrain.

PROJ is used for the map projection only. Latitudes and longitudes are in radians, positions in
metres; attitudes are `scipy.spatial.transform.Rotation`.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])

_NORTH_STEP = 1e-5  # rad, 64 m: the step's error and rounding are both below 2e-11 rad
_METRES_PER_RAD = 6.37e6
_ECEF_STEPS = 4  # each adds five correct digits at the height of an aircraft
_HILLS = (  # amplitude m, wavelength m, azimuth deg, phase rad
    (30.0, 4300.0, 20.0, 0.4),
    (23.0, 2650.0, 105.0, 2.1),
    (15.0, 1480.0, 62.0, 4.0),
    (8.0, 830.0, 151.0, 1.2),
    (3.0, 310.0, 85.0, 5.3),
)
RELIEF_M = float(np.sqrt(sum(hill[0] ** 2 for hill in _HILLS) / 2))
"""Root mean square of the hills as they stand; a plan's relief multiplies them."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A map grid on its ellipsoid.

    Attributes
    ----------
    crs : str
        Projected CRS in metres, by PROJ's name for it.
    """

    crs: str

    @property
    def _projection(self) -> Transformer:
        return _projection(self.crs)

    @cached_property
    def _ellipsoid(self) -> tuple[float, float]:
        ellipsoid = CRS.from_user_input(self.crs).ellipsoid
        if ellipsoid is None:
            msg = f"{self.crs} has no ellipsoid"
            raise ValueError(msg)
        return ellipsoid.semi_major_metre, 1 / ellipsoid.inverse_flattening

    def geodetic_from_grid(self, x_g: Array) -> Array:
        """Compute latitude, longitude and height of grid coordinates, shape (n, 3)."""
        lon, lat = self._projection.transform(x_g[:, 0], x_g[:, 1], direction="INVERSE")
        return np.column_stack([np.radians(lat), np.radians(lon), x_g[:, 2]])

    def grid_from_geodetic(self, llh: Array) -> Array:
        """Compute east, north and height of geodetic coordinates, shape (n, 3)."""
        east, north = self._projection.transform(np.degrees(llh[:, 1]), np.degrees(llh[:, 0]))
        return np.column_stack([east, north, llh[:, 2]])

    def ecef_from_geodetic(self, llh: Array) -> Array:
        """Compute geocentric coordinates, shape (n, 3)."""
        a, flattening = self._ellipsoid
        lat, lon, height = llh.T
        e_sq = flattening * (2 - flattening)
        n = a / np.sqrt(1 - e_sq * np.sin(lat) ** 2)
        return np.column_stack(
            [
                (n + height) * np.cos(lat) * np.cos(lon),
                (n + height) * np.cos(lat) * np.sin(lon),
                (n * (1 - e_sq) + height) * np.sin(lat),
            ]
        )

    def geodetic_from_ecef(self, x_e: Array) -> Array:
        """Compute latitude, longitude and height of geocentric coordinates, shape (n, 3)."""
        a, flattening = self._ellipsoid
        e_sq = flattening * (2 - flattening)
        axis = np.hypot(x_e[:, 0], x_e[:, 1])
        lat, height = np.arctan2(x_e[:, 2], (1 - e_sq) * axis), np.zeros(len(x_e))
        for _ in range(_ECEF_STEPS):
            n = a / np.sqrt(1 - e_sq * np.sin(lat) ** 2)
            height = axis / np.cos(lat) - n
            lat = np.arctan2(x_e[:, 2], axis * (1 - e_sq * n / (n + height)))
        return np.column_stack([lat, np.arctan2(x_e[:, 1], x_e[:, 0]), height])

    def convergence(self, llh: Array) -> Array:
        """Compute the azimuth of grid north, rad, from the direction of true north in the grid.

        Two points on the meridian are projected; the projection must be conformal.
        """
        step = np.array([_NORTH_STEP, 0.0, 0.0])
        drawn = self.grid_from_geodetic(llh + step) - self.grid_from_geodetic(llh - step)
        return -np.arctan2(drawn[:, 0], drawn[:, 1])


@cache
def _projection(crs: str) -> Transformer:
    """Make a projection, once: every step of a simulated flight has a grid of its own."""
    grid = CRS.from_user_input(crs)
    return Transformer.from_crs(grid.geodetic_crs, grid, always_xy=True)


def axes_of_enu_in_ecef(llh: Array) -> Array:
    """Compute the rotations from local east, north, up to ECEF, shape (n, 3, 3)."""
    (sin_lat, sin_lon), (cos_lat, cos_lon) = np.sin(llh[:, :2].T), np.cos(llh[:, :2].T)
    east = np.column_stack([-sin_lon, cos_lon, np.zeros(len(llh))])
    up = np.column_stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat])
    return np.stack([east, np.cross(up, east), up], axis=-1)


def attitude_from_rph(rph: Array) -> Rotation:
    """Compute the body's attitude in east, north, up; `rph` in rad, heading from true north."""
    R_ned_frd = Rotation.from_euler("ZYX", rph[:, ::-1])
    return Rotation.from_matrix(ENU_FROM_NED) * R_ned_frd * Rotation.from_matrix(FRD_FROM_FLU)


def rph_from_attitude(R_enu_b: Rotation) -> Array:
    """Compute roll, pitch and heading, rad, heading from 0 to 2 pi."""
    R_ned_frd = Rotation.from_matrix(ENU_FROM_NED) * R_enu_b * Rotation.from_matrix(FRD_FROM_FLU)
    rph = R_ned_frd.as_euler("ZYX")[:, ::-1]
    rph[:, 2] %= 2 * np.pi
    return rph


def opk_from_attitude(R_enu_b: Rotation, convergence: Array) -> Array:
    """Compute omega, phi, kappa, rad, of an attitude relative to the grid."""
    return (Rotation.from_rotvec(convergence[:, None] * [0.0, 0.0, 1.0]) * R_enu_b).as_euler("XYZ")


def rotation_from_opk_deg(opk_deg: tuple[float, float, float]) -> Rotation:
    """Compute the transpose of eq. (6): image to object."""
    return Rotation.from_euler("XYZ", opk_deg, degrees=True)


def chained_deg(
    outer_deg: tuple[float, float, float], inner_deg: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Compute the angles of R_a_c = R_a_b R_b_c from those of R_a_b and R_b_c, degrees."""
    turn = rotation_from_opk_deg(outer_deg) * rotation_from_opk_deg(inner_deg)
    omega, phi, kappa = (float(angle) for angle in turn.as_euler("XYZ", degrees=True))
    return omega, phi, kappa


def terrain_height(
    llh: Array, mean_height: float, *, latitude: float | None = None, relief: float = 1.0
) -> Array:
    """Compute the height of smooth hills at given positions, m; it is the same in every run.

    Parameters
    ----------
    llh : ndarray, shape (n, 3)
        Latitude, longitude, rad; the third column is not used.
    mean_height : float
        Mean height of the ground, m.
    latitude : float, optional
        Latitude at which longitudes are converted to metres, rad; by default the mean of the
        positions. Another latitude moves the hills.
    relief : float
        Factor on the heights of the hills.
    """
    scale = np.cos(llh[:, 0].mean() if latitude is None else latitude)
    east, north = _METRES_PER_RAD * scale * llh[:, 1], _METRES_PER_RAD * llh[:, 0]
    height = np.full(len(llh), mean_height)
    for amplitude, wavelength, azimuth_deg, phase in _HILLS:
        azimuth = np.radians(azimuth_deg)
        along = east * np.sin(azimuth) + north * np.cos(azimuth)
        height += relief * amplitude * np.sin(2 * np.pi * along / wavelength + phase)
    return height
