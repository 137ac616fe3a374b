"""Mapping frame, grid and heights: a published-formula test vector, PROJ, and bad systems.

The test vector was computed in three independent ways (a closed chain of rotations, PROJ's
topocentric pipeline alone, and scipy's rotations) before there was a library. Its attitudes are
forward-right-down; the boresight and lever arm stand here in the library's body axes.
"""

import struct
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from acx4files.results import tables
from acx4lib.calibration import mounting
from acx4lib.geometry import geodesy
from acx4lib.geometry.frames import Pose, log, opk_from_rotation, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem, LocalFrame, MappingFrame
from acx4lib.model import Model
from support import blocks
from support.helpers import numeric_jacobian
from support.strategies import numbers, opk

UTM = GridSystem(crs="EPSG:31982")
ORIGIN = np.array([-49.30, -25.40])
FRAME = MappingFrame(grid=UTM, origin=ORIGIN)
GRS80_A, GRS80_F = 6378137.0, 1 / 298.257222101

IMU = np.array([[-49.25, -25.45, 2250.0]])
RPH = np.radians([[1.25, -2.5, 37.0]])
T_B_C = Pose(
    R=rotation_from_opk(np.radians([[0.49665, -1.59457, 0.07984]])),
    r=np.array([[0.223, 0.399, 0.201]]),
)
NANORADIAN_DEG = np.degrees(1e-9)


@pytest.fixture(scope="module")
def T_m_b():
    return FRAME.pose_from_geographic(IMU, RPH)


@pytest.fixture(scope="module")
def T_m_c(T_m_b):
    return T_m_b @ T_B_C


# --- the test vector: 1e-9 rad and 1e-6 m ----------------------------------------------------


def test_camera_attitude_of_the_test_vector(T_m_c):
    expected = [[0.379373516771, 1.983754564674, 52.990117152814]]
    assert_allclose(np.degrees(T_m_c.opk), expected, atol=NANORADIAN_DEG)


def test_perspective_centre_of_the_test_vector(T_m_c):
    """The vector's origin is 950 m above the ellipsoid, the library's on it."""
    expected = [[5030.562389936, -5541.444473953, 1295.799661534 + 950.0]]
    assert_allclose(T_m_c.r, expected, atol=1e-6)


def test_camera_attitude_against_the_grid_of_the_test_vector(T_m_b, T_m_c):
    R_g_c = FRAME.grid_axes(T_m_b.r) @ T_m_c.R  # against the axes at the IMU
    expected = [[0.354061763548, 1.934249251200, 52.259248857567]]
    assert_allclose(np.degrees(opk_from_rotation(R_g_c)), expected, atol=NANORADIAN_DEG)


def test_grid_positions_of_the_test_vector(T_m_b, T_m_c):
    assert_allclose(FRAME.to_grid(T_m_b.r), [[675960.7544160, 7184067.8846027, 2250.0]], atol=1e-6)
    expected = [[675960.5845455, 7184068.3093701, 2250.1997297]]
    assert_allclose(FRAME.to_grid(T_m_c.r), expected, atol=1e-6)


def test_convergence_of_the_test_vector():
    gamma = np.degrees(UTM.convergence(IMU[:, :2]))
    assert_allclose(gamma, [-0.7522096122], atol=1e-10)  # ten decimals


def test_turn_of_the_local_axes_over_7_km():
    R_e_t = geodesy.rotation_enu_to_ecef(np.stack([ORIGIN, IMU[0, :2]]))
    turn_deg = np.degrees(log(R_e_t[0].T @ R_e_t[1]))
    assert_allclose(turn_deg, [0.049999997, 0.045157404, -0.021466463], atol=1e-9)


# --- convergence -----------------------------------------------------------------------------


def convergence_series(lonlat, central_meridian):
    """The series for the transverse Mercator projection to the fifth power of the longitude."""
    lat, dl = np.radians(lonlat[:, 1]), np.radians(lonlat[:, 0] - central_meridian)
    s, c, t = np.sin(lat), np.cos(lat), np.tan(lat)
    e2 = GRS80_F * (2 - GRS80_F)
    eta2 = e2 / (1 - e2) * c**2
    cubic = dl**2 * c**2 / 3 * (1 + 3 * eta2 + 2 * eta2**2)
    return dl * s * (1 + cubic + dl**4 * c**4 / 15 * (2 - t**2))


@given(dl=numbers(1.75), lat=numbers(-5.0, smallest=-60.0))
def test_convergence_is_the_classical_series(dl, lat):
    lonlat = np.array([[-51.0 + dl, lat]])
    # what the series leaves out is 3.5e-11 rad at 1.75 degrees
    assert_allclose(UTM.convergence(lonlat), convergence_series(lonlat, -51.0), atol=5e-11)


@pytest.mark.parametrize("crs", ["EPSG:31982", "EPSG:2154", "EPSG:2180"])
def test_convergence_is_the_azimuth_of_the_grids_north(crs):
    """Three projections, one with northing first: where does a step along grid north lead?"""
    grid = GridSystem(crs=crs)
    middle = {"EPSG:31982": [7e5, 7.1e6], "EPSG:2154": [9e5, 6.5e6], "EPSG:2180": [6.5e5, 6e5]}
    en = np.array([middle[crs]])
    step = np.array([[0.0, 10.0]])
    ahead, behind = grid.lonlat_from_grid(en + step), grid.lonlat_from_grid(en - step)
    there, back, _ = pyproj.CRS(crs).get_geod().inv(*behind[0], *ahead[0])
    gamma = np.degrees(grid.convergence(grid.lonlat_from_grid(en)))
    # true azimuth = grid azimuth + convergence; the mean of both ends is that of the middle
    assert_allclose(gamma, (there + back % 360 - 180) / 2, atol=1e-7)  # 20 m at PROJ's 1e-8 m


def test_kappa_is_the_quarter_turn_less_heading_plus_convergence():
    """With roll and pitch zero, x forward: the grid azimuth is the true one less gamma."""
    level = FRAME.pose_from_geographic(IMU, np.radians([[0.0, 0.0, 37.0]]))
    _, angles = FRAME.pose_to_grid(level)
    gamma = np.degrees(UTM.convergence(IMU[:, :2]))[0]
    assert_allclose(np.degrees(angles), [[0.0, 0.0, 90 - 37.0 + gamma]], atol=NANORADIAN_DEG)


# --- the mapping frame -----------------------------------------------------------------------


@given(
    lon=numbers(-49.0, smallest=-49.6),
    lat=numbers(-25.1, smallest=-25.7),
    height=numbers(5000.0, smallest=-100.0),
)
def test_the_mapping_frame_is_projs_topocentric_pipeline(lon, lat, height):
    pipeline = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        "+step +proj=cart +ellps=GRS80 "
        f"+step +proj=topocentric +ellps=GRS80 +lon_0={ORIGIN[0]} +lat_0={ORIGIN[1]} +h_0=0"
    )
    expected = pipeline.transform(lon, lat, height)
    found = FRAME.from_geographic(np.array([[lon, lat, height]]))
    assert_allclose(found, [expected], atol=1e-8)  # m: a few units in the last place of ECEF


@given(lon=numbers(179.0), lat=numbers(89.0), height=numbers(9000.0))
def test_earth_centred_coordinates_are_the_textbooks(lon, lat, height):
    e2 = GRS80_F * (2 - GRS80_F)
    la, lo = np.radians([lat, lon])
    N = GRS80_A / np.sqrt(1 - e2 * np.sin(la) ** 2)
    expected = [
        (N + height) * np.cos(la) * np.cos(lo),
        (N + height) * np.cos(la) * np.sin(lo),
        (N * (1 - e2) + height) * np.sin(la),
    ]
    assert_allclose(UTM.ecef_from_geographic(np.array([[lon, lat, height]])), [expected], atol=1e-8)


@given(lon=numbers(179.0), lat=numbers(89.0))
def test_local_axes_point_where_small_steps_lead(lon, lat):
    """East, north and up are the directions in which longitude, latitude and height grow."""
    steps = np.array([1e-4, 1e-4, 10.0])
    J = numeric_jacobian(
        lambda x: UTM.ecef_from_geographic(x[None])[0], np.array([lon, lat, 0.0]), step=steps
    )
    axes = J / np.linalg.norm(J, axis=0)
    # the steps are 10 m and less, ECEF is exact to 1e-9 m; near the poles 1e-4 deg is but 0.2 m
    atol = 1e-8 / np.cos(np.radians(lat))
    assert_allclose(geodesy.rotation_enu_to_ecef(np.array([[lon, lat]]))[0], axes, atol=atol)


@given(
    east=numbers(720e3, smallest=600e3),
    north=numbers(7240e3, smallest=7140e3),
    height=numbers(5000.0, smallest=0.0),
)
def test_grid_coordinates_come_back(east, north, height):
    enh = np.array([[east, north, height]])
    assert_allclose(FRAME.to_grid(FRAME.from_grid(enh)), enh, atol=1e-7)  # m: PROJ's inverses


@given(angles=opk(), east=numbers(720e3, smallest=600e3))
def test_poses_come_back_from_the_grid(angles, east):
    enh = np.array([[east, 7.19e6, 1900.0]])
    found, found_angles = FRAME.pose_to_grid(FRAME.pose_from_grid(enh, angles[None]))
    assert_allclose(found, enh, atol=1e-7)
    # the position's 1e-7 m turn the axes by 1e-14 rad; the rest is rounding, worse at high phi
    assert_allclose(rotation_from_opk(found_angles[0]), rotation_from_opk(angles), atol=1e-12)


def test_two_frames_see_the_same_figure():
    """Distances and relative attitudes do not depend on where the mapping frame stands."""
    other = MappingFrame(grid=UTM, origin=np.array([-49.1, -25.6]))
    enh = np.array([[670e3, 7.19e6, 900.0], [671e3, 7.188e6, 950.0], [668e3, 7.191e6, 2500.0]])
    angles = np.radians([[1.0, -2.0, 30.0], [0.5, 0.4, -150.0], [0.0, 0.0, 90.0]])
    here, there = FRAME.pose_from_grid(enh, angles), other.pose_from_grid(enh, angles)
    a, b = here[np.array([0])].inverse @ here, there[np.array([0])].inverse @ there
    assert_allclose(a.r, b.r, atol=1e-8)
    assert_allclose(a.R, b.R, atol=1e-14)


def test_easting_comes_first_whatever_the_axis_order_of_the_crs():
    """EPSG:2180 counts northing first; on its central meridian the easting is 500 000 m."""
    grid = GridSystem(crs="EPSG:2180")
    lonlat = grid.lonlat_from_grid(np.array([[500_000.0, 500_000.0]]))
    assert_allclose(lonlat[:, 0], 19.0, atol=1e-12)
    assert_allclose(grid.grid_from_lonlat(lonlat), [[500_000.0, 500_000.0]], atol=1e-6)


def test_the_mean_origin_lies_amid_the_positions():
    lonlat = np.array([[-49.3, -25.4], [-49.1, -25.4], [-49.2, -25.5], [-49.2, -25.3]])
    assert_allclose(geodesy.mean_origin(UTM, lonlat).origin, [-49.2, -25.4], atol=1e-4)
    assert_allclose(geodesy.mean_origin(UTM, lonlat[:1]).origin, lonlat[0], atol=1e-12)


def test_the_mean_origin_does_not_jump_at_the_date_line():
    across = np.array([[179.9, -17.0], [-179.9, -17.0]])
    lon, lat = geodesy.mean_origin(GridSystem(crs="EPSG:32760"), across).origin
    assert abs(lon) == pytest.approx(180.0, abs=1e-9)
    assert lat == pytest.approx(-17.0, abs=1e-4)  # the chord lies a little below the parallel


def test_no_points_give_no_points():
    none = np.zeros((0, 3))
    assert FRAME.from_grid(none).shape == (0, 3)
    assert FRAME.to_grid(none).shape == (0, 3)
    assert FRAME.grid_axes(none).shape == (0, 3, 3)
    assert len(FRAME.pose_from_grid(none, none)) == 0


def test_a_point_outside_the_projection_is_not_finite():
    x_m = FRAME.from_grid(np.array([[1e12, 7e6, 0.0], [670e3, 7.19e6, 900.0]]))
    assert not np.isfinite(x_m[0]).any()
    assert np.isfinite(x_m[1]).all()


# --- grads and other meridians ---------------------------------------------------------------

LAMBERT_1 = GridSystem(crs="EPSG:27561")


def test_a_map_whose_datum_counts_grads_from_paris_takes_degrees_from_greenwich():
    """IGN's note ALG0003 prints this point of Lambert zone I with its radians from Greenwich."""
    lonlat = np.degrees([[0.145512099, 0.872664626]])
    printed = [[1029705.083, 272723.849]]
    assert_allclose(LAMBERT_1.grid_from_lonlat(lonlat), printed, atol=0.01)
    assert_allclose(LAMBERT_1.lonlat_from_grid(np.array(printed)), lonlat, atol=1e-7)


@pytest.mark.parametrize("crs", ["EPSG:27561", "EPSG:27572", "EPSG:31700"])
def test_convergence_and_scale_are_those_of_the_map_at_any_prime_meridian(crs):
    grid = GridSystem(crs=crs)
    at = np.array([[3.1, 48.9]]) if crs.startswith("EPSG:27") else np.array([[26.1, 44.4]])
    d = np.array([0.0, 1e-5])
    north = (grid.grid_from_lonlat(at + d) - grid.grid_from_lonlat(at - d))[0]
    assert_allclose(grid.convergence(at), -np.arctan2(*north), atol=1e-7)
    frame = MappingFrame(grid=grid, origin=at[0])
    x_m = np.array([[0.0, -100.0, 0.0], [0.0, 100.0, 0.0]])
    length = np.linalg.norm(np.diff(frame.to_grid(x_m)[:, :2], axis=0))
    assert_allclose(grid.scale(at), length / 200, atol=1e-6)


def test_a_geoid_file_is_read_at_the_longitude_from_greenwich(tmp_path):
    """A grid of one metre a degree of longitude, from 0 to 4 degrees east."""
    rows, columns = 3, 5
    head = struct.pack(">4d2i", 47.0, 0.0, 1.0, 1.0, rows, columns)
    path = tmp_path / "slope.gtx"
    path.write_bytes(head + struct.pack(">15f", *([0.0, 1.0, 2.0, 3.0, 4.0] * rows)))
    grid = GridSystem(crs="EPSG:27561", heights=str(path))
    assert_allclose(grid.undulation(np.array([[3.0, 48.5]])), 3.0, atol=1e-5)


# --- systems that cannot be used -------------------------------------------------------------


@pytest.mark.parametrize(
    ("crs", "why"),
    [
        ("EPSG:4674", r"'EPSG:4674' \(SIRGAS 2000\) is not a projected CRS"),
        ("EPSG:2225", "in US survey foot, not in metres"),
        ("EPSG:2048", "does not count east and north"),
        ("EPSG:999999", "is no CRS that PROJ knows"),
        ("a CRS of my own", "is neither an authority code, nor WKT, nor a PROJ string"),
    ],
)
def test_a_crs_that_cannot_be_used_says_why(crs, why):
    with pytest.raises(ValueError, match=why):
        GridSystem(crs=crs)


@pytest.mark.parametrize(
    ("heights", "why"),
    [
        ("missing_geoid.gtx", "'missing_geoid.gtx' is neither"),
        ("EPSG:5773", "us_nga_egm96_15"),  # EGM96 height, its grid is not here: the grid is named
        ("EPSG:31982", "is not a vertical CRS"),
        ("", "is neither"),
    ],
)
def test_heights_that_cannot_be_used_say_why(heights, why):
    with pytest.raises(ValueError, match=why):
        GridSystem(crs="EPSG:31982", heights=heights)


def test_a_constant_undulation_is_that_everywhere():
    grid = GridSystem(crs="EPSG:31982", heights=-25.5)
    assert grid.undulation(np.zeros((2, 2))).tolist() == [-25.5, -25.5]
    for undulation in (1000.0, np.nan):
        with pytest.raises(ValueError, match="at most 200 m either way"):
            GridSystem(crs="EPSG:31982", heights=undulation)


def test_the_scale_of_a_map():
    # notes on geodesy, section 1.3: SIRGAS 2000 / UTM 22S at Curitiba, on the central meridian
    scale = UTM.scale(np.array([[-49.27, -25.45], [-51.0, -25.45]]))
    assert_allclose(scale, [0.999974 + 4e-6, 0.9996], atol=1.2e-5)
    assert UTM.scale(np.zeros((0, 2))).shape == (0,)


def test_a_file_that_is_no_geoid_grid_is_an_error(tmp_path):
    path = tmp_path / "geoid.gtx"
    path.write_text("not a grid")
    with pytest.raises(ValueError, match=r"geoid\.gtx"):
        GridSystem(crs="EPSG:31982", heights=str(path))


# --- heights above a geoid -------------------------------------------------------------------


def undulation(lon, lat):
    """A plane over longitude and latitude, which bilinear interpolation keeps."""
    return 3.0 + 2.0 * (lon + 49.5) - 5.0 * (lat + 25.5)


def write_gtx(path, *, west=-50.0, south=-26.0, step=0.25, rows=5, cols=5):
    """Write a geoid grid: a big-endian header of the south-west corner, then rows from there."""
    lon, lat = west + step * np.arange(cols), south + step * np.arange(rows)
    values = undulation(*np.meshgrid(lon, lat)).astype(">f4")
    path.write_bytes(struct.pack(">4d2i", south, west, step, step, rows, cols) + values.tobytes())
    return path


@pytest.fixture
def geoid(tmp_path):
    return GridSystem(crs="EPSG:31982", heights=str(write_gtx(tmp_path / "my geoid.gtx")))


INSIDE = np.array([[-49.31, -25.43], [-49.62, -25.77]])
SINGLE = 1e-6  # m: the grid's numbers are single precision


def test_a_height_above_the_geoid_plus_its_undulation_is_ellipsoidal(geoid):
    assert_allclose(geoid.undulation(INSIDE), undulation(*INSIDE.T), atol=SINGLE)
    frame = MappingFrame(grid=geoid, origin=ORIGIN)
    enh = np.column_stack([geoid.grid_from_lonlat(INSIDE), [900.0, 950.0]])
    ellipsoidal = enh + [[0, 0, 1]] * undulation(*INSIDE.T)[:, None]
    assert_allclose(frame.from_grid(enh), FRAME.from_grid(ellipsoidal), atol=SINGLE)


def test_heights_above_a_geoid_come_back(geoid):
    frame = MappingFrame(grid=geoid, origin=ORIGIN)
    enh = np.column_stack([geoid.grid_from_lonlat(INSIDE), [900.0, 950.0]])
    assert_allclose(frame.to_grid(frame.from_grid(enh)), enh, atol=1e-7)


def test_a_geographic_trajectory_is_counted_above_the_geoid_too(geoid):
    frame = MappingFrame(grid=geoid, origin=ORIGIN)
    lonlath = np.column_stack([INSIDE, [2000.0, 2100.0]])
    higher = lonlath + [[0, 0, 1]] * undulation(*INSIDE.T)[:, None]
    rph = np.radians([[1.0, 2.0, 3.0]] * 2)
    found, expected = (
        frame.pose_from_geographic(lonlath, rph),
        FRAME.pose_from_geographic(higher, rph),
    )
    assert_allclose(found.r, expected.r, atol=SINGLE)
    assert_allclose(found.R, expected.R, atol=1e-15)  # attitudes are about the ellipsoid's normal
    assert_allclose(lonlath[:, 2], [2000.0, 2100.0], atol=0)  # the argument stays as it was


def test_off_the_geoid_grid_nothing_is_finite(geoid):
    frame = MappingFrame(grid=geoid, origin=ORIGIN)
    lonlat = np.array([[-51.0, -25.5], [-49.5, -25.5]])
    x_m = frame.from_grid(np.column_stack([geoid.grid_from_lonlat(lonlat), [900.0, 900.0]]))
    assert not np.isfinite(x_m[0]).any()
    assert np.isfinite(x_m[1]).all()


@pytest.fixture
def egm96(tmp_path):
    """Give PROJ a grid of the name that it looks for, on a small area."""
    write_gtx(tmp_path / "egm96_15.gtx")
    before = pyproj.datadir.get_data_dir()
    pyproj.datadir.append_data_dir(str(tmp_path))
    yield
    pyproj.datadir.set_data_dir(before)


@pytest.mark.usefixtures("egm96")
@pytest.mark.parametrize("crs", ["EPSG:32722", "EPSG:31982"])
def test_a_vertical_crs_whose_grid_is_here_is_used(crs):
    grid = GridSystem(crs=crs, heights="EPSG:5773")
    assert_allclose(grid.undulation(INSIDE), undulation(*INSIDE.T), atol=SINGLE)


@given(n=st.integers(0, 3))
def test_ellipsoidal_heights_have_no_undulation(n):
    assert UTM.undulation(np.zeros((n, 2))).tolist() == [0.0] * n


# --- A frame on no map: its coordinates are the grid's


X_M = np.array([[1.0, 2.0, 3.0], [-4e5, 7e6, 12.5]])
OPK = np.radians([[1.0, -2.0, 170.0], [0.0, 3.0, 4.0]])


def test_coordinates_and_attitudes_stay_as_they_are():
    frame = LocalFrame()
    assert_array_equal(frame.from_grid(X_M), X_M)
    assert_array_equal(frame.to_grid(X_M), X_M)
    assert_array_equal(frame.pose_from_grid(X_M, OPK).R, rotation_from_opk(OPK))
    enh, opk = frame.pose_to_grid(frame.pose_from_grid(X_M, OPK))
    assert_array_equal(enh, X_M)
    np.testing.assert_allclose(opk, OPK, atol=1e-15)


def test_there_is_a_height_but_no_longitude():
    assert_array_equal(
        LocalFrame().to_geographic(X_M), [[np.nan, np.nan, 3], [np.nan, np.nan, 12.5]]
    )
    with pytest.raises(ValueError, match="lies on no map"):
        LocalFrame().from_geographic(X_M)


def test_a_block_on_no_map_is_calibrated_as_one_on_a_map_and_reported():
    """East, north and height are then x, y and z."""
    block = blocks.balanced()
    local = replace(block, frame=LocalFrame())
    fits = [mounting.single_step(b, Model(free=("f", "xp", "yp"))) for b in (block, local)]
    values = [fit.calibration.cameras[0].interior.to_array() for fit in fits]
    np.testing.assert_allclose(*values, rtol=0, atol=1e-9)
    table = tables.of_bundle("mounting/single_step", fits[1].bundle, fits[1].calibration, {}).tables
    place = table["exterior_orientation"][["east_m", "north_m", "height_m"]].to_numpy()
    assert_array_equal(place, fits[1].bundle.T_m_c.r)
