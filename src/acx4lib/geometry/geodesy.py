"""Conversions between a flight's own CRS and the topocentric mapping frame of all computations.

The mapping frame `m` is east-north-up at an origin on the ellipsoid. It is ECEF, only shifted
and rotated: in a map grid, straight rays would be curved and lengths would change.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import pyproj
from pyproj.enums import TransformDirection
from pyproj.exceptions import CRSError, ProjError
from pyproj.network import set_network_enabled  # type: ignore[attr-defined] # public, but not marked so

from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, rotation_from_opk, rotation_from_rph, turn

R_ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
R_FRD_FLU = np.diag([1.0, -1.0, -1.0])

LARGEST_UNDULATION_M = 200.0
"""The geoid is nowhere farther from the ellipsoid than about 110 m."""

SHOWN = 80
"""Number of characters of a CRS that a message repeats."""


@dataclass(frozen=True, kw_only=True)
class GridSystem:
    """The CRS and the height system in which a flight's numbers are given.

    Attributes
    ----------
    crs : str
        Projected CRS in metres: an authority code, WKT, or a PROJ string without files.
    heights : str or float
        ``"ellipsoidal"``, a geoid grid file, a vertical CRS (code or WKT) whose grid PROJ has, or
        how much smaller than ellipsoidal heights they are everywhere, m.

    Raises
    ------
    ValueError
        Where the CRS or the heights cannot be used; the message says why.
    """

    crs: str
    heights: str | float = "ellipsoidal"

    def __post_init__(self) -> None:
        _check_heights(self.heights)
        set_network_enabled(active=False)  # results must not depend on a server
        given = self.crs if len(self.crs) <= SHOWN else f"{self.crs[:SHOWN]}…"
        fault = crs_fault(self.crs)
        if fault:
            msg = f"{given!r} {fault}"
            raise ValueError(msg)
        try:
            crs = pyproj.CRS.from_user_input(self.crs)
        except CRSError as error:
            msg = f"{given!r} is no CRS that PROJ knows"
            raise ValueError(msg) from error
        if not crs.is_projected:
            msg = f"{given!r} ({crs.name}) is not a projected CRS"
            raise ValueError(msg)
        if any(axis.unit_conversion_factor != 1.0 for axis in crs.axis_info[:2]):
            msg = f"{given!r} ({crs.name}) is in {crs.axis_info[0].unit_name}, not in metres"
            raise ValueError(msg)
        if {axis.direction for axis in crs.axis_info[:2]} != {"east", "north"}:
            msg = f"{given!r} ({crs.name}) does not count east and north"
            raise ValueError(msg)
        try:
            _ = self._geographic, self._cartesian, self._projection, self._counted
        except (CRSError, ProjError) as error:
            msg = f"{given!r} cannot be computed by PROJ ({' '.join(str(error).split())})"
            raise ValueError(msg) from error
        _ = self._height_transformer

    @property
    def is_local(self) -> bool:
        """Whether the coordinates lie on no map."""
        return False

    @property
    def name(self) -> str:
        """The name of the CRS."""
        return str(self._crs.name)

    @cached_property
    def _crs(self) -> pyproj.CRS:
        return pyproj.CRS.from_user_input(self.crs)

    @cached_property
    def _geographic(self) -> pyproj.Transformer:
        """Easting, northing to longitude, latitude as the CRS's own datum counts them."""
        crs = self._horizontal
        return pyproj.Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)

    @property
    def _horizontal(self) -> pyproj.CRS:
        return self._crs.sub_crs_list[0] if self._crs.is_compound else self._crs

    @cached_property
    def _counted(self) -> tuple[float, Array]:
        """The datum's unit of angles, and longitude and latitude of its zero, in degrees.

        Maps of France may count grads from Paris. Longitudes here are degrees from Greenwich.
        """
        geographic = self._horizontal.geodetic_crs
        if geographic is None:
            msg = "it has no geodetic CRS"
            raise CRSError(msg)
        unit = float(np.degrees(geographic.axis_info[0].unit_conversion_factor))
        meridian = geographic.prime_meridian
        east = 0.0
        if meridian is not None:
            east = float(np.degrees(meridian.longitude * float(meridian.unit_conversion_factor)))
        return unit, np.array([east, 0.0])

    def _as_counted(self, lonlat: Array) -> Array:
        """Return longitudes and latitudes as the datum counts them, shape (n, 2)."""
        unit, zero = self._counted
        return (lonlat - zero) / unit

    @cached_property
    def _projection(self) -> pyproj.Proj:
        return pyproj.Proj(self._crs)

    @cached_property
    def _cartesian(self) -> pyproj.Transformer:
        ellipsoid = self._crs.ellipsoid
        if ellipsoid is None:
            msg = f"{self.crs!r} has no ellipsoid"
            raise ValueError(msg)
        return pyproj.Transformer.from_pipeline(
            "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart "
            f"+a={ellipsoid.semi_major_metre!r} +b={ellipsoid.semi_minor_metre!r}"
        )

    @cached_property
    def _height_transformer(self) -> pyproj.Transformer | None:
        if self.heights == "ellipsoidal" or not isinstance(self.heights, str):
            return None
        try:
            if is_code_or_wkt(self.heights):
                return _geoid_of_crs(self._crs, self.heights)
            return _geoid_of_file(self.heights)
        except (CRSError, ProjError, OSError) as error:
            msg = (
                f"heights {self.heights[:SHOWN]!r} is neither 'ellipsoidal', nor a geoid grid "
                f"file, nor a vertical CRS whose grid is here ({str(error).strip()})"
            )
            raise ValueError(msg) from error

    @property
    def height_system(self) -> str:
        """The heights as a word for readers: a file by its name, a number with its meaning."""
        if isinstance(self.heights, str):
            return Path(self.heights).name
        return f"undulation {self.heights:g} m"

    def undulation(self, lonlat: Array) -> Array:
        """Return ellipsoidal minus flight heights, m, shape (n,); not finite off the geoid grid."""
        if not isinstance(self.heights, str):
            return np.full(len(lonlat), float(self.heights))
        if self._height_transformer is None:
            return np.zeros(len(lonlat))
        of_file = isinstance(self.heights, str) and not is_code_or_wkt(self.heights)
        lon, lat = (lonlat if of_file else self._as_counted(lonlat)).T
        return np.asarray(self._height_transformer.transform(lon, lat, np.zeros(len(lon)))[2])

    def lonlat_from_grid(self, east_north: Array) -> Array:
        """Return longitude from Greenwich and latitude on the CRS's own datum, deg, (n, 2)."""
        unit, zero = self._counted
        counted = np.stack(self._geographic.transform(*east_north.T), axis=-1).reshape(-1, 2)
        return counted * unit + zero

    def grid_from_lonlat(self, lonlat: Array) -> Array:
        """Return easting, northing in m, shape (n, 2)."""
        lon, lat = self._as_counted(lonlat).T
        east_north = self._geographic.transform(lon, lat, direction=TransformDirection.INVERSE)
        return np.stack(east_north, axis=-1).reshape(-1, 2)

    def convergence(self, lonlat: Array) -> Array:
        """Return PROJ's meridian convergence, true minus grid azimuth, in radians, shape (n,).

        NaN where PROJ cannot compute it.
        """
        if not len(lonlat):  # PROJ refuses an empty array
            return np.zeros(0)
        factors = self._projection.get_factors(*(lonlat - self._counted[1]).T)
        degrees = np.asarray(factors.meridian_convergence, dtype=float).reshape(-1)
        return np.radians(np.where(np.isfinite(degrees), degrees, np.nan))

    def scale(self, lonlat: Array) -> Array:
        """Return the scale of a conformal map at positions, map length over true, shape (n,)."""
        if not len(lonlat):  # PROJ refuses an empty array
            return np.zeros(0)
        factors = self._projection.get_factors(*(lonlat - self._counted[1]).T)
        return np.sqrt(np.asarray(factors.areal_scale, dtype=float).reshape(-1))

    def ecef_from_geographic(self, lonlath: Array) -> Array:
        """Return earth-centred coordinates (m) of longitude, latitude (deg), height (m), (n, 3)."""
        x_e = np.stack(self._cartesian.transform(*lonlath.T), axis=-1).reshape(-1, 3)
        return np.where(np.isfinite(x_e), x_e, np.nan)  # PROJ's infinities would cause warnings

    def geographic_from_ecef(self, x_e: Array) -> Array:
        """Return longitude, latitude (deg) and ellipsoidal height (m), shape (n, 3)."""
        x, y, z = x_e.T
        lonlath = self._cartesian.transform(x, y, z, direction=TransformDirection.INVERSE)
        return np.stack(lonlath, axis=-1).reshape(-1, 3)


def _check_heights(heights: object) -> None:
    if isinstance(heights, int | float) and not abs(heights) <= LARGEST_UNDULATION_M:
        msg = f"heights {heights} is no undulation: at most {LARGEST_UNDULATION_M:g} m either way"
        raise ValueError(msg)


def rotation_enu_to_ecef(lonlat: Array) -> Array:
    """Return R_e_t: columns east, north, up at geodetic longitude and latitude.

    Parameters
    ----------
    lonlat : ndarray, shape (n, 2)
        Degrees.

    Returns
    -------
    ndarray, shape (n, 3, 3)
    """
    lon, lat = np.radians(lonlat).T
    quarter = np.full_like(lon, np.pi / 2)
    return turn(2, lon + quarter) @ turn(0, quarter - lat)


@dataclass(frozen=True, kw_only=True, eq=False)
class MappingFrame:
    """A topocentric east-north-up frame with its origin on the ellipsoid.

    Attributes
    ----------
    grid : GridSystem
        The coordinate system of the flight's files.
    origin : ndarray, shape (2,)
        Longitude and latitude, degrees.

    Raises
    ------
    ValueError
        Where the origin is not on the earth; from the methods, for arrays of other shapes.
    """

    grid: GridSystem
    origin: Array
    _R_e_m: Array = field(init=False, repr=False)
    _r_e_m: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        lon, lat = expected.numbers("origin", self.origin, (2,))
        if abs(lon) > 360 or abs(lat) > 90:  # NaN passes: the reader then finds the mistake
            msg = f"origin: expected longitude and latitude in degrees, got {lon}, {lat}"
            raise ValueError(msg)
        origin = np.array([[lon, lat]])
        object.__setattr__(self, "_R_e_m", rotation_enu_to_ecef(origin)[0])
        object.__setattr__(
            self, "_r_e_m", self.grid.ecef_from_geographic(np.append(origin, [[0.0]], axis=1))[0]
        )

    def from_geographic(self, lonlath: Array) -> Array:
        """Return mapping coordinates (m) of longitude, latitude (deg), height (m), shape (n, 3)."""
        lonlath = expected.numbers("lonlath", lonlath, ("n", 3))
        return (self.grid.ecef_from_geographic(lonlath) - self._r_e_m) @ self._R_e_m

    def to_geographic(self, x_m: Array) -> Array:
        """Return longitude, latitude (deg) and ellipsoidal height (m), shape (n, 3)."""
        x_m = expected.numbers("x_m", x_m, ("n", 3))
        return self.grid.geographic_from_ecef(x_m @ self._R_e_m.T + self._r_e_m)

    def from_grid(self, enh: Array) -> Array:
        """Return mapping coordinates of east, north, height in the flight's system.

        Parameters
        ----------
        enh : ndarray, shape (n, 3)

        Returns
        -------
        x_m : ndarray, shape (n, 3)
            m; not finite where the point lies outside the CRS or the geoid grid.
        """
        enh = expected.numbers("enh", enh, ("n", 3))
        lonlat = self.grid.lonlat_from_grid(enh[:, :2])
        height = enh[:, 2] + self.grid.undulation(lonlat)
        return self.from_geographic(np.column_stack([lonlat, height]))

    def to_grid(self, x_m: Array) -> Array:
        """Return east, north, height in the flight's system, m, (n, 3); inverse of `from_grid`."""
        lonlath = self.to_geographic(x_m)
        height = lonlath[:, 2] - self.grid.undulation(lonlath[:, :2])
        return np.column_stack([self.grid.grid_from_lonlat(lonlath[:, :2]), height])

    def grid_axes(self, x_m: Array) -> Array:
        """Return R_g_m at points: mapping axes to grid east, grid north, ellipsoid normal.

        Parameters
        ----------
        x_m : ndarray, shape (n, 3)

        Returns
        -------
        ndarray, shape (n, 3, 3)
        """
        lonlat = self.to_geographic(x_m)[:, :2]
        R_g_t = turn(2, self.grid.convergence(lonlat))
        return R_g_t @ np.swapaxes(rotation_enu_to_ecef(lonlat), -1, -2) @ self._R_e_m

    def pose_from_grid(self, enh: Array, opk: Array) -> Pose:
        """Return the poses T_m_b of grid positions and of attitudes relative to the grid.

        Parameters
        ----------
        enh : ndarray, shape (n, 3)
            m, in the flight's system.
        opk : ndarray, shape (n, 3)
            omega, phi, kappa relative to grid east, grid north and ellipsoid normal, radians.
        """
        enh = expected.numbers("enh", enh, ("n", 3))
        opk = expected.numbers("opk", opk, (len(enh), 3))
        r_m = self.from_grid(enh)
        return Pose(R=np.swapaxes(self.grid_axes(r_m), -1, -2) @ rotation_from_opk(opk), r=r_m)

    def pose_to_grid(self, T_m: Pose) -> tuple[Array, Array]:
        """Return east, north, height and omega, phi, kappa (rad); inverse of `pose_from_grid`."""
        R_g = self.grid_axes(T_m.r) @ T_m.R
        return self.to_grid(T_m.r), Pose(R=R_g, r=T_m.r).opk

    def pose_from_geographic(self, lonlath: Array, rph: Array) -> Pose:
        """Return the poses T_m_b of geographic positions with roll, pitch and true heading.

        Parameters
        ----------
        lonlath : ndarray, shape (n, 3)
            Longitude, latitude in degrees, height in the flight's height system.
        rph : ndarray, shape (n, 3)
            Radians, forward-right-down relative to north-east-down.

        Returns
        -------
        Pose
            Of the body frame forward-left-up.
        """
        lonlath = expected.numbers("lonlath", lonlath, ("n", 3)).copy()
        rph = expected.numbers("rph", rph, (len(lonlath), 3))
        lonlath[:, 2] += self.grid.undulation(lonlath[:, :2])
        R_t_b = R_ENU_NED @ rotation_from_rph(rph) @ R_FRD_FLU
        R_m_t = self._R_e_m.T @ rotation_enu_to_ecef(lonlath[:, :2])
        return Pose(R=R_m_t @ R_t_b, r=self.from_geographic(lonlath))


def mean_origin(grid: GridSystem, lonlat: Array) -> MappingFrame:
    """Return the mapping frame at the mean of positions; on no map, that of the coordinates.

    Parameters
    ----------
    grid : GridSystem
    lonlat : ndarray, shape (n, 2)
        Degrees.
    """
    if grid.is_local:
        return LocalFrame()
    lonlat = expected.numbers("lonlat", lonlat, ("n", 2))
    on_ellipsoid = np.column_stack([lonlat, np.zeros(len(lonlat))])
    centre = grid.ecef_from_geographic(on_ellipsoid).mean(axis=0)
    return MappingFrame(grid=grid, origin=grid.geographic_from_ecef(centre[None])[0, :2])


# --- A mapping frame that lies on no map: Cartesian coordinates of a test field or a laboratory


LOCAL = "local"
"""In the place of a CRS: coordinates of their own."""


def grid_system(crs: str, heights: str | float = "ellipsoidal") -> GridSystem:
    """Return the system of a CRS, or that of coordinates on no map.

    Parameters
    ----------
    crs, heights
        As `GridSystem` has them; `LOCAL` is on no map.

    Raises
    ------
    ValueError
        Where the CRS or the heights cannot be used; the message says why.
    """
    if crs == LOCAL:
        return LocalGrid(heights=heights)
    return GridSystem(crs=crs, heights=heights)


@dataclass(frozen=True, kw_only=True)
class LocalGrid(GridSystem):
    """Cartesian coordinates in the place of a CRS: no convergence and no undulation."""

    crs: str = LOCAL

    def __post_init__(self) -> None:
        """Ask PROJ nothing; a ValueError for heights of a geoid."""
        if self.heights != "ellipsoidal":
            msg = f"heights {self.heights!r} belong to a map: a local frame has z alone"
            raise ValueError(msg)

    @property
    def is_local(self) -> bool:
        """Whether the coordinates lie on no map."""
        return True

    @property
    def name(self) -> str:
        """A description of the coordinates."""
        return "x, y, z of its own, on no map"

    @property
    def height_system(self) -> str:
        """The heights as a word for readers."""
        return "z of the frame"

    def lonlat_from_grid(self, east_north: Array) -> Array:
        """Return NaN, shape (n, 2): there is no longitude and no latitude."""
        return np.full((len(east_north), 2), np.nan)

    def undulation(self, lonlat: Array) -> Array:
        """Return zeros, shape (n,)."""
        return np.zeros(len(lonlat))

    def convergence(self, lonlat: Array) -> Array:
        """Return zeros, shape (n,)."""
        return np.zeros(len(lonlat))


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalFrame(MappingFrame):
    """A frame whose axes are those of the coordinates, any x and y with z up, m.

    East, north and height of results are x, y and z. There is no longitude and no latitude.
    """

    grid: GridSystem = field(default_factory=LocalGrid)
    origin: Array = field(default_factory=lambda: np.full(2, np.nan))

    def __post_init__(self) -> None:
        """Ask PROJ nothing."""

    def from_grid(self, enh: Array) -> Array:
        """Return x, y, z as they are, shape (n, 3)."""
        return expected.numbers("enh", enh, ("n", 3))

    def to_grid(self, x_m: Array) -> Array:
        """Return x, y, z as they are, shape (n, 3)."""
        return expected.numbers("x_m", x_m, ("n", 3))

    def to_geographic(self, x_m: Array) -> Array:
        """Return longitude and latitude, which are NaN, and z, shape (n, 3)."""
        x_m = expected.numbers("x_m", x_m, ("n", 3))
        return np.column_stack([np.full((len(x_m), 2), np.nan), x_m[:, 2]])

    def from_geographic(self, lonlath: Array) -> Array:
        """Raise a ValueError: longitude and latitude mean nothing here."""
        n = len(lonlath)
        msg = f"a local frame lies on no map: give x, y, z of the {n} points instead"
        raise ValueError(msg)

    def pose_from_rph(self, x_m: Array, rph: Array) -> Pose:
        """Return the poses T_m_b of positions with roll, pitch and heading from y, radians."""
        x_m = expected.numbers("x_m", x_m, ("n", 3))
        rph = expected.numbers("rph", rph, (len(x_m), 3))
        return Pose(R=R_ENU_NED @ rotation_from_rph(rph) @ R_FRD_FLU, r=x_m)

    def grid_axes(self, x_m: Array) -> Array:
        """Return the identity for every point, shape (n, 3, 3)."""
        return np.tile(np.eye(3), (len(x_m), 1, 1))


# --- Which texts are accepted as a CRS: none that makes PROJ open a file
#
# A PROJ string may name grids, initialisation files and whole pipelines, and WKT may carry such
# strings. A flight is data; it must not choose which files of the machine are opened.


LONGEST = 20_000
"""Largest number of characters of a CRS as WKT; those of EPSG have at most 3 000."""

DEEPEST = 30
"""Largest number of nested brackets in WKT."""

_CODE = re.compile(r"\s*(?:[A-Z]\w*:[\w.]+(?:\+(?:[A-Z]\w*:)?[\w.]+)*|\d+)\s*", re.ASCII | re.I)
_URN = re.compile(r"\s*urn:ogc:def:crs:\w+:[\w.]*:[\w.]+\s*", re.ASCII | re.I)
_WKT = re.compile(r"\s*[A-Z_]+\s*[\[(]", re.ASCII | re.I)
_PROJ = re.compile(r"\s*\+?[A-Z]\w*(?:=\S*)?(?:\s+\+?[A-Z]\w*(?:=\S*)?)*\s*", re.ASCII | re.I)

# The parts of WKT that name a file, directly or inside a PROJ string.
_FILES_IN_WKT = re.compile(
    r"PARAMETERFILE|PROJ4_GRIDS|PROJ-based|grids\s*=|(?:init|file|catalog|model)\s*=|=\s*pipeline|"
    r"://|@",
    re.ASCII | re.I,
)

# These parameters of PROJ are numbers, or names that PROJ itself knows.
_HARMLESS = re.compile(
    r"proj|type|no_defs|wktext|over|south|north|approx|algo|zone|v?units|v?to_meter|ellps|datum|"
    r"towgs84|pm|axis|R(_A|_V|_a|_g|_h|_C|_lat_a|_lat_g)?|a|b|es?|r?f|lat_[0-3b]|lat_ts|lon_[0-3]|"
    r"lonc|[xyhk]_0|[khWMmnq]|alpha|gamma|azi|tilt|hyperbolic|no_uoff|no_off|no_rot|no_cut|sweep|"
    r"rot|lotsa|orient|mode"
)
_VALUE = re.compile(r"[\w.,+'-]*", re.ASCII)

_NO_GRID = re.compile(r"\+?nadgrids=@null(?![\w.,/])", re.ASCII)
"""Web Mercator is written with this entry; it means no grid, so no file is opened."""


def crs_fault(text: str) -> str:
    """Return why a text is refused as a CRS; empty if it is accepted.

    Parameters
    ----------
    text : str
        An authority code (``EPSG:31982``), WKT, or a PROJ string without files.
    """
    text = _NO_GRID.sub("", text)
    if len(text) > LONGEST:
        return f"has {len(text)} characters, of at most {LONGEST}"
    if _CODE.fullmatch(text) or _URN.fullmatch(text):
        return "" if not text.strip().lower().startswith("file:") else "is a file"
    if _WKT.match(text):
        return _wkt_fault(text)
    if "=" in text and _PROJ.fullmatch(text):
        return _proj_fault(text)
    return "is neither an authority code, nor WKT, nor a PROJ string without files"


def is_code_or_wkt(text: str) -> bool:
    """Tell whether a text may be a vertical CRS; any other can only be the name of a file."""
    return bool(_CODE.fullmatch(text) or _URN.fullmatch(text) or _WKT.match(text))


def _wkt_fault(text: str) -> str:
    match = _FILES_IN_WKT.search(text)
    if match:
        return f"names a file ({match[0].strip()})"
    depth = deepest = 0
    for bracket in re.findall(r"[\[\](){}]", text):
        depth += 1 if bracket in "[({" else -1
        deepest = max(depth, deepest)
    return f"has more than {DEEPEST} brackets inside each other" if deepest > DEEPEST else ""


def _proj_fault(text: str) -> str:
    for word in text.split():
        key, _, value = word.removeprefix("+").partition("=")
        if not _HARMLESS.fullmatch(key):
            return f"has +{key}, which may name a file or is no part of a projection"
        if not _VALUE.fullmatch(value) or (key, value) == ("proj", "pipeline"):
            return f"has +{key}={value}, which may name a file"
    return ""


# --- Transformers of PROJ from heights above a geoid to ellipsoidal heights


UNQUOTABLE = re.compile('[",\x00-\x1f]')
"""Characters that the path of a file in a pipeline of PROJ cannot have."""


def _geoid_of_file(path: str) -> pyproj.Transformer:
    """Return the transformer of a geoid grid file to ellipsoidal heights; PROJ may refuse it."""
    if not Path(path).is_file():
        msg = "there is no such file"
        raise CRSError(msg)
    if UNQUOTABLE.search(path) or not path.isprintable():
        msg = "PROJ opens no file with a comma, a quote or what is no text in its path"
        raise CRSError(msg)
    return pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f'+step +proj=vgridshift +grids="{path}" +multiplier=1 '
        "+step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )


def _geoid_of_crs(crs: pyproj.CRS, heights: str) -> pyproj.Transformer:
    """Return the transformer of a vertical CRS to ellipsoidal heights, never an approximate one."""
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    geographic = horizontal.geodetic_crs
    if geographic is None:
        msg = f"{crs.name} has no geodetic CRS"
        raise CRSError(msg)
    fault = crs_fault(heights)
    if fault:
        raise CRSError(f"it {fault}")
    vertical = pyproj.CRS.from_user_input(heights)
    if not vertical.is_vertical:
        msg = f"{vertical.name} is not a vertical CRS"
        raise CRSError(msg)
    name = f"{geographic.name} + {vertical.name}"
    compound = pyproj.crs.CompoundCRS(name, [geographic, vertical])
    return pyproj.Transformer.from_crs(
        compound, geographic.to_3d(), always_xy=True, allow_ballpark=False, only_best=True
    )
