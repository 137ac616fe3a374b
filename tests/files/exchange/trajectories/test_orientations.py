"""Orientations of a list, in the forms of a flight."""

import json
import re
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation

import acx4 as acx
from acx4book.reference import data
from acx4files.exchange import flight_folder
from acx4files.exchange.safe import Opened
from acx4files.exchange.trajectories import orientations
from acx4files.exchange.trajectories.listed import Column, read_list
from acx4lib.errors import FlightError
from acx4lib.geometry import frames
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, GridSystem
from support.helpers import needs

CRS = "EPSG:31982"
# section 1.7 of the notes on geodesy: two independent computations agree on these
GEOGRAPHIC = "image lat lon h roll pitch heading\nA -25.45 -49.25 2250 1.25 -2.5 37\n"
EAST, NORTH, CONVERGENCE = 675960.7544160, 7184067.8846027, -0.7522096122


def table(text, **meaning):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.txt"
        path.write_text(text)
        brought = orientations.read(path, **meaning)
    return brought.tables["calibration/trajectory.csv"]


def test_a_geographic_list_stays_what_it_is():
    found = table(GEOGRAPHIC)
    assert [found[name][0] for name in ("lat_deg", "lon_deg", "height_m")] == [-25.45, -49.25, 2250]
    assert found["roll_deg"][0] == 1.25
    assert found["heading_deg"][0] == pytest.approx(37.0, abs=1e-12)


def test_a_heading_from_grid_north_gets_the_convergence():
    grid = f"image x y z roll pitch yaw\nA {EAST} {NORTH} 2250 1.25 -2.5 {37 - CONVERGENCE}\n"
    found = table(grid, crs=CRS, north="grid")
    assert found["lat_deg"][0] == pytest.approx(-25.45, abs=1e-9)
    assert found["heading_deg"][0] == pytest.approx(37.0, abs=1e-8)
    assert table(grid, crs=CRS)["heading_deg"][0] == pytest.approx(37.0 - CONVERGENCE)


def test_omega_phi_kappa_against_true_north_become_roll_pitch_heading():
    # a body forward-left-up with zero roll and pitch: kappa = 90 - heading
    text = "image lat lon h omega phi kappa\nA -25.45 -49.25 2250 0 0 53\n"
    found = table(text, north="true")
    assert found["heading_deg"][0] == pytest.approx(37.0)
    on_grid = table(text, crs=CRS)
    assert on_grid["east_m"][0] == pytest.approx(EAST, abs=1e-5)
    assert on_grid["kappa_deg"][0] == pytest.approx(53.0)


def test_units_and_orders():
    text = "image x y z omega phi kappa\nA 1 2 3 {} {} {}\n"
    in_gon, in_rad = (re.sub("(omega|phi|kappa)", rf"\1_{unit}", text) for unit in ("gon", "rad"))
    gon = table(in_gon.format(10, 20, 100))
    rad = table(in_rad.format(*np.radians([9, 18, 90])))
    for name, degrees in (("omega_deg", 9), ("phi_deg", 18), ("kappa_deg", 90)):
        assert gon[name][0] == pytest.approx(degrees)
        assert rad[name][0] == pytest.approx(degrees)
    pok = table(text.format(10, 20, 30), order="pok")
    opk = np.array([pok[f"{name}_deg"][0] for name in ("omega", "phi", "kappa")])
    expected = Rotation.from_euler("YXZ", [20, 10, 30], degrees=True)
    assert Rotation.from_euler("XYZ", opk, degrees=True).approx_equal(expected, atol=1e-9)
    assert abs(opk[0] - 10) > 0.5


def test_scaled_heights_and_heights_of_the_flight():
    text = f"image x y z omega phi kappa\nA {EAST} {NORTH} 2250 0 0 0\n"
    scaled = table(text, crs=CRS, scaled_above=250.0)["height_m"][0]
    assert scaled == pytest.approx(250 + 2000 / 0.9999823472, abs=1e-4)
    geoid = table(text, crs=CRS, heights=5.25, ellipsoidal=True)["height_m"][0]
    assert geoid == pytest.approx(2244.75)


# --- Tables of orientations that other programs wrote


def read(file, **options):
    return orientations.read(data.path(file), **options)


def columns(table, *names):
    return np.stack([np.asarray(table[name], dtype=float) for name in names], axis=-1)


@needs("formats")
def test_a_table_is_what_the_same_program_wrote_as_json():
    crs = data.path("formats/orthority/io_ngi_xyz_opk.prj").read_text()
    brought = read("formats/orthority/io_ngi_xyz_opk.csv", of="camera", crs=crs)
    table = brought.tables["calibration/trajectory.csv"]
    said = json.loads(data.path("formats/orthority/io_ngi_ext_param.geojson").read_text())
    shots = [shot["properties"] for shot in said["features"]]
    assert table["exposure"] == [shot["filename"] for shot in shots]
    xyz = columns(table, "east_m", "north_m", "height_m")
    assert xyz == pytest.approx(np.array([shot["xyz"] for shot in shots]), abs=6e-4)
    opk = np.radians(columns(table, "omega_deg", "phi_deg", "kappa_deg"))
    assert opk == pytest.approx(np.array([shot["opk"] for shot in shots]), abs=1e-5)


@needs("formats")
def test_roll_pitch_yaw_of_a_drone_against_its_adjusted_omega_phi_kappa():
    # the camera's x points right and its y forward: a quarter turn from the body's axes
    measured = read("formats/orthority/io_odm_lla_rpy.csv").tables["calibration/trajectory.csv"]
    adjusted = read("formats/orthority/io_odm_xyz_opk.csv", of="camera")
    table = adjusted.tables["calibration/trajectory.csv"]
    order = [table["exposure"].index(name.removesuffix(".tif")) for name in measured["exposure"]]
    grid = GridSystem(crs="EPSG:32651")
    lonlat = columns(measured, "lon_deg", "lat_deg")
    R_n_b = frames.rotation_from_rph(
        np.radians(columns(measured, "roll_deg", "pitch_deg", "heading_deg"))
    )
    R_g_b = frames.turn(2, grid.convergence(lonlat)) @ R_ENU_NED @ R_n_b @ R_FRD_FLU
    R_g_c = R_g_b @ frames.turn(2, -np.pi / 2)
    opk = np.radians(columns(table, "omega_deg", "phi_deg", "kappa_deg"))[order]
    apart = np.swapaxes(R_g_c, 1, 2) @ frames.rotation_from_opk(opk)
    assert np.degrees(np.linalg.norm(frames.log(apart), axis=1)).max() < 2.0
    east_north = columns(table, "east_m", "north_m")[order]
    assert np.abs(grid.grid_from_lonlat(lonlat) - east_north).max() < 5.0


@needs("ign-uce-m3")
def test_the_heights_of_a_real_block_lose_the_scale_of_the_map():
    options = {"of": "camera", "block": "validation"}
    meaning = {"crs": "EPSG:2154", "heights": str(data.path("ign-uce-m3/fr_ign_RAF20.tif"))}
    brought = read("ign-uce-m3/images.OPK", scaled_above=3.0, **options, **meaning)
    table = brought.tables["validation/trajectory.csv"]
    # IGN's own factor at this place is 1.000283
    assert table["height_m"][0] == pytest.approx(3 + (1771.280 - 3) / 1.000283, abs=2e-3)
    assert brought.settings == {"crs": "EPSG:2154", "heights": "fr_ign_RAF20.tif"}
    assert list(brought.pictures) == ["fr_ign_RAF20.tif"]
    assert brought.tables["validation/images.csv"]["camera"][0] == "UCE-M3-f120-s06"
    assert any("the scale of the map" in line for line in brought.assumed)


# --- Text exports of POSPac: the documented layout, and what real headings look like


UNITS = "(position in Meters, orientation in Degrees, lat, long in Deg)"
PREAMBLE = f"POSPac\nBoresight values used: tx 0.1 deg\n\n{UNITS}\n"
HEADING = "ID, # EVENT, TIME (s), EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, LAT, LONG"
ROW = "365324.63 3096141.49 2088.37 -1.05 0.32 179.18 27.984 -82.369"
LON, LAT = pyproj.Proj("EPSG:32617")(365324.63, 3096141.49, inverse=True)
PLACE = f"{LAT:.7f} {LON:.7f}"
"""Of the row's east and north."""


def read_pospac(tmp_path, text, **meaning):
    (tmp_path / "eo.txt").write_text(text)
    given = {"crs": "EPSG:32617", **meaning}
    return orientations.read(tmp_path / "eo.txt", columns="pospac", **given)


def rows(*cells):
    return "".join(f"{cell}\n" for cell in cells)


def sequence(axes):
    names = {"x": "omega", "y": "phi", "z": "kappa"}
    said = zip(("First", "Second", "Third"), axes, strict=True)
    lines = [f"{n} rotation is about the '{a}' axis by the '{names[a]}' angle." for n, a in said]
    return rows("Sequence of the rotation from mapping to image frame:", *lines)


@pytest.mark.parametrize(
    ("heading", "begin", "name"),
    [
        ("ID # EVENT TIME(s) EASTING NORTHING ELLIPSOID HEIGHT OMEGA PHI KAPPA", "i7 3", "i7"),
        (HEADING.replace(", LAT, LONG", ""), "i7 3", "i7"),
        (HEADING.replace(", LAT, LONG", ""), "\t3", "3"),
        (HEADING.replace(", LAT, LONG", "").replace(", ", "\t"), "\t3", "3"),
    ],
)
def test_exterior_orientations(tmp_path, heading, begin, name):
    body = " ".join(ROW.split()[:6])
    row = f"{begin} 564155.65 {body}"
    if begin.startswith("\t"):
        row = f"\t3\t564155.65\t{body}".replace(" ", "\t")
    brought = read_pospac(tmp_path, f"{PREAMBLE}\n {heading}\n\n{row}\n")
    table = brought.tables["calibration/trajectory.csv"]
    assert table["exposure"] == [name]
    assert table["time_s"][0] == 564155.65
    assert [table[f"{n}_deg"][0] for n in ("omega", "phi", "kappa")] == [-1.05, 0.32, 179.18]
    assert "those of the camera" in brought.assumed[2]
    assert "Boresight values used: tx 0.1 deg" in brought.found[-1]


def test_positions_in_two_forms_say_whether_the_crs_is_right(tmp_path):
    text = f"{PREAMBLE}{HEADING}\n7 3 1.5 {' '.join(ROW.split()[:6])} {PLACE}\n"
    assert any("differ by at most" in line for line in read_pospac(tmp_path, text).found)
    match = r"eo.txt:6: east, north: are .* m apart; must be within 1.011 m .* is --crs right\?"
    with pytest.raises(FlightError, match=match):
        read_pospac(tmp_path, text, crs="EPSG:32618")


def test_the_units_may_stand_below_the_heading(tmp_path):
    """As POSPac MMS writes them: heading, blank line, units, blank line, rows."""
    units = UNITS.replace("Degrees", "Grads")
    row = f"3 564155.65 {' '.join(ROW.split()[:6])}"
    heading = HEADING.replace(", LAT, LONG", "")
    brought = read_pospac(tmp_path, f"*****\n POSPac\n {heading}\n\n {units} \n\n{row}\n")
    table = brought.tables["calibration/trajectory.csv"]
    assert table["exposure"] == ["3"]
    assert table["omega_deg"][0] == pytest.approx(-1.05 * 0.9)


@pytest.mark.parametrize(("axes", "order"), [("xyz", "Rx(omega) Ry"), ("yxz", "Ry(phi) Rx")])
def test_the_sequence_of_rotations_is_the_preambles(tmp_path, axes, order):
    row = f"7 3 1.5 {' '.join(ROW.split()[:6])} {PLACE}"
    brought = read_pospac(tmp_path, f"{PREAMBLE}{sequence(axes)}{HEADING}\n{row}\n")
    assert f"R = {order}" in brought.assumed[1]


def test_the_trajectory_at_events_is_the_imus(tmp_path):
    units = "(time in Sec, position in Meters, orientation angles and SD in Degrees)"
    heading = (
        "TIME, DISTANCE, EASTING, NORTHING, ELLIPSOID HEIGHT, LATITUDE, LONGITUDE, "
        "ELLIPSOID HEIGHT, ROLL, PITCH, HEADING, EAST VELOCITY, NORTH VELOCITY, UP VELOCITY, "
        "EAST SD, NORTH SD, HEIGHT SD, ROLL SD, PITCH SD, HEADING SD"
    )
    row = f"5.25 100 365324.63 3096141.49 88.5 {PLACE} 88.5 1 2 3 4 5 6 .05 .06 .07 .002 .003 .004"
    brought = read_pospac(tmp_path, f"{units}\n{heading}\n{row}\n", heights=-25.0)
    table = brought.tables["calibration/trajectory.csv"]
    assert (table["exposure"], table["height_m"][0]) == (["1"], 113.5)
    assert table["lat_deg"][0] == pytest.approx(LAT, abs=1e-9)
    assert [table[f"{n}_deg"][0] for n in ("roll", "pitch", "heading")] == [1, 2, 3]
    assert table["sigma_heading_deg"][0] == pytest.approx(0.004)
    assert "those of the IMU" in brought.assumed[2]
    zero = f"Boresight values: tx = 0.0000 arc min\n{units}\n{heading}\n{row}\n"
    assert "those of the IMU" in read_pospac(tmp_path, zero).assumed[2]
    applied = read_pospac(tmp_path, zero.replace("0.0000", "0.0100"))
    assert "those of the camera" in applied.assumed[2]


@needs("noaa-dss-dg")
@pytest.mark.parametrize("name", ["C19748959", "C25959144"])
def test_orientations_of_a_real_flight_by_applanix(tmp_path, name):
    """The values of NOAA's files in the documented layout; both forms of position agree."""
    said = dict(
        line.split(":  ", 1)
        for line in data.path(f"noaa-dss-dg/{name}.geom").read_text().splitlines()
        if ":  " in line
    )
    lat, lon, height, _ = said["latlonh_platform_position"].split()
    east, north, _, _ = said["utm_platform_position"].split()
    angles = " ".join(said[key] for key in ("omega", "phi", "kappa"))
    row = f"{name} 1 2.5 {east} {north} {height} {angles} {float(lat):.8f} {float(lon):.8f}"
    crs = f"EPSG:326{int(said['utm_zone']):02d}"
    brought = read_pospac(tmp_path, f"{PREAMBLE}{HEADING}\n{row}\n", crs=crs)
    table = brought.tables["calibration/trajectory.csv"]
    assert table["exposure"] == [name]
    assert table["omega_deg"][0] == float(said["omega"])
    (line,) = (line for line in brought.found if "differ by at most" in line)
    assert float(line.split("at most ")[1].split()[0]) < 0.005


# --- tables of points, measured in images or surveyed, in any order of columns ---------------


POINTS, CONTROL = "calibration/image_points.csv", "control_points.csv"
TWO = {"image": ["a", "b"], "point": ["P 1", "P 2"], "col_px": [1.5, 2.5], "row_px": [3.0, 4.0]}
UTM = {"crs": "EPSG:32633", "heights": 45.0}


@pytest.fixture
def file(tmp_path):
    def write(text, name="points.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def measured(path, **options):
    return orientations.measured([path], **options)


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ('"P 1" a 1.5 3\n"P 2" b 2.5 4\n', "point image col row"),
        ('x y id "image name"\n1.5 3 "P 1" a\n2.5 4 "P 2" b\n', ""),
        ("image;line;column;remark;point\na;3;1.5;;P 1\nb;4;2.5;;P 2\n", ""),
        ("row_px,col_px,point,image\n3,1.5,P 1,a\n4,2.5,P 2,b\n", ""),
        (
            "SITE : HALLE\nDATE : 1/6\n\nNOM\tL\tC\tCLICHE\nP 1\t3\t1.5\ta\nP 2\t4\t2.5\tb\n",
            "",
        ),
    ],
)
def test_any_order_of_columns_makes_the_same_table(file, text, columns):
    assert measured(file(text), columns=columns).tables == {POINTS: TWO}


def test_the_middle_of_the_first_pixel_becomes_zero_and_images_get_a_camera(file):
    brought = measured(file("point image x y sigma\nP a 1 1 0.3\n"), first="1", camera="CAM")
    points = {"image": ["a"], "point": ["P"], "col_px": [0.0], "row_px": [0.0], "sigma_px": [0.3]}
    assert brought.tables == {
        POINTS: points,
        "calibration/images.csv": {"image": ["a"], "camera": ["CAM"], "exposure": ["a"]},
    }
    assert "the middle of the first pixel is 1, 1" in brought.assumed[1]


def test_geographic_points_with_ellipsoidal_heights_become_the_flights(file):
    path = file("P 1 47.5 15.25 300\n")
    columns = {"columns": "point skip lat lon height"}
    brought = orientations.surveyed(path, role="check", ellipsoidal=True, **UTM, **columns)
    table = brought.tables[CONTROL]
    there = GridSystem(crs="EPSG:32633").lonlat_from_grid(
        np.stack([table["east_m"], table["north_m"]], axis=1)
    )
    assert there == pytest.approx(np.array([[15.25, 47.5]]), abs=1e-9)
    assert (table["height_m"].tolist(), table["role"]) == ([255.0], ["check"])
    assert brought.left_out == ("Columns that are no coordinate: column 2.",)


LISTED = "image point col row"
OF_CAMERA = "image x y z omega phi kappa\n"
REFUSED = [
    ("orientations", OF_CAMERA.replace(" z", "") + "A 1 2 3 4 5\n", {}, "1: columns: are image,"),
    ("orientations", OF_CAMERA + "A 1 2 3 400 0 0\n", {}, "2: omega: 400; must be an angle in"),
    ("orientations", OF_CAMERA + "A 1 2 3 4 0 0 5 6\n", {}, "2: row: has 9 cells (blanks in a n"),
    ("orientations", OF_CAMERA + "A 1 2 3 4 0\n", {}, "2: row: has 6 cells (cut off?); as many"),
    ("orientations", GEOGRAPHIC.replace("-25.45", "-95"), {}, "2: lat: -95; must lie"),
    ("orientations", GEOGRAPHIC, {"north": "grid"}, "--crs: is not given; a heading from grid no"),
    ("orientations", GEOGRAPHIC, {"north": "grid", "crs": "EPSG:4326"}, "is not a projected CRS"),
    ("measured", "a P 1 2\na P 3 4\n", {"columns": LISTED}, "'a', 'P' stands in line 1 already"),
    ("measured", "image point x\na P 1\n", {}, "1: columns: have no row; must be point image"),
    ("measured", f"{LISTED}\na P 1 b\n", {}, "2: row: 'b'; must be a finite number"),
    ("measured", "a P 1 2\n", {"columns": f"{LISTED} east"}, "--columns: column 'east' is not kn"),
    ("measured", "a P 1 2\n", {}, "1: columns: is no heading: 'a P 1 2'; declare them by --col"),
    ("measured", f'{LISTED}\na "" 1 2\n', {}, "2: point: is empty"),
    ("measured", "image point x col row\na P 1 1 2\n", {}, "1: columns: two columns may be 'col'"),
    ("surveyed", "point x y z\nP 1 2 3\nP 1 2 3\n", UTM, "3: point: 'P' stands in line 2 already"),
    ("surveyed", "point x y role\nP 1 2 control\n", UTM, "1: columns: have no position; must be"),
    ("surveyed", "x y z\n1 2 3\n", UTM, "1: columns: have no point; must be point east north"),
    ("surveyed", "point x y z role\nP 1 2 3 tie\n", UTM, "2: role: 'tie'; must be control or che"),
    ("surveyed", "point lat lon h\nP 91 2 3\n", UTM, "2: lat: 91; must lie between -90 and 90"),
    ("pospac", "nothing\n", {}, "1: heading: is not there; must have a line with EASTING"),
    ("pospac", PREAMBLE + HEADING, {}, "has a heading and no rows"),
    ("pospac", f"{PREAMBLE}{HEADING}\n1 2 3\n", {}, "6: row: has 3 cells (cut off?); as many as"),
    ("pospac", f"{PREAMBLE}{HEADING}, FOO\n", {}, "5: heading: 'FOO' is not known"),
    ("pospac", f"{PREAMBLE}{sequence('zyx')}{HEADING}\n", {}, "6: rotations: "),
    ("pospac", f"{PREAMBLE.replace('Meters', 'Feet')}{HEADING}\n", {}, "4: units:"),
    (
        *("pospac", f"{PREAMBLE}{HEADING}\n7 3 1 {ROW}\n".replace("ELLIPSOID", "ORTHOMETRIC"), {}),
        "ORTHOMETRIC HEIGHT: is no ellipsoidal height; needs --heights",
    ),
    (
        *("pospac", f"{PREAMBLE}{HEADING}\n7 3 1 {ROW.replace('179.18', 'x')}\n", {}),
        "6: kappa: 'x'; must be a finite number",
    ),
]


@pytest.mark.parametrize(("kind", "text", "options", "says"), REFUSED)
def test_other_lists_are_refused_in_one_line(file, kind, text, options, says):
    pospac = partial(orientations.read, columns="pospac")
    readers = {"orientations": orientations.read, "measured": measured, "pospac": pospac}
    with pytest.raises(FlightError) as raised:
        readers.get(kind, orientations.surveyed)(file(text), **options)
    (line,) = raised.value.problems
    assert says in line


@needs("ign-uce-m3")
def test_igns_control_lies_where_it_was_measured(tmp_path):
    files = {name: data.path(f"ign-uce-m3/{name}") for name in ("images.OPK", "fr_ign_RAF20.tif")}
    system = {"crs": "EPSG:2154", "heights": str(files["fr_ign_RAF20.tif"])}
    pairs = [data.path(f"ign-uce-m3/{name}.mes") for name in ("tie_points", "control_points")]
    surveyed = orientations.surveyed(
        data.path("ign-uce-m3/control_points.app"),
        columns="point skip x y z",
        ellipsoidal=True,
        **system,
    )
    camera = {"width_px": 26460, "height_px": 17004, "pixel_um": 4.0, "focal_mm": 123.9}
    lens = {"xp_mm": (13210 - 13229.5) * 0.004, "yp_mm": (8501.5 - 8502) * 0.004}
    for brought in (
        orientations.read(files["images.OPK"], of="camera", scaled_above=3.0, **system),
        orientations.measured(pairs, columns="point image col row"),
        surveyed,
    ):
        flight_folder.write(brought, tmp_path)
    toml = tmp_path / "flight.toml"
    said = "\n".join(f"{key} = {value}" for key, value in {**camera, **lens}.items())
    toml.write_text(f"{toml.read_text()}\n[cameras.UCE-M3-f120-s06]\n{said}\n")
    block = acx.read(tmp_path).calibration
    assert (len(block.points), len(block.image_points.colrow)) == (683, 1551)
    seen = block.control.point_idx[:, None] == block.image_points.point_idx
    point, k = np.nonzero(seen)
    T_m_c = block.T_m_b_images[block.image_points.image_idx[k]]
    apart = project(block.cameras[0], T_m_c, block.control.x_m[point])
    apart -= block.image_points.colrow[k]
    # 0.2 px each, and point 1005, of which an intersection is 2.5 px off
    assert len(k) == 7
    assert np.hypot(*apart.T).max() < 2.5


# --- words for columns -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("word", "name", "unit"),
    [
        ("Omega", "omega", ""),
        ("kappa_gon", "kappa", "gon"),
        ("Roll [rad]", "roll", "rad"),
        ("X", "east", ""),
        ("north_m", "north", ""),
        ("azimuth", "heading", ""),
        ("sigma_roll_arcmin", "sigma_roll", "arcmin"),
        ("time_s", "time", ""),
        ("photoID", "image", ""),
    ],
)
def test_a_word_has_a_name_and_may_have_a_unit(word, name, unit):
    listed = point_tables_read(f"strip,{word}\nA,1\n")
    unit = unit or ("deg" if name in ("omega", "heading") else "")
    assert listed.columns[1] == Column(name=name, unit=unit)


# --- Rows with declared columns


def point_tables_read(text, columns=""):
    source = Opened(file="a.txt", data=text.encode())
    return read_list(source, columns)


@pytest.mark.parametrize(
    "text",
    [
        "image;x;omega\nA;385711,802;-0,5\nB;385712;1,250\n",
        'image,x,omega\nA,"385711,802","-0,5"\nB,385712,"1,250"\n',
        "image\tx\tomega\nA\t385711,802\t-0,5\nB\t385712\t1,250\n",
    ],
)
def test_decimal_commas_are_read_and_said(text):
    found = point_tables_read(text)
    assert found.table.numbers["east"].tolist() == [385711.802, 385712.0]
    assert found.table.numbers["omega"].tolist() == [-0.5, 1.25]
    assert found.said.endswith(" Its numbers have decimal commas.")


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("image;x;omega\nA;385,711;1,250\n", "385,711"),  # may be thousands
        ("image;x;omega\nA;385711,802;1.25\n", "385711,802"),  # two decimal signs
        ("image;x;omega\nA;385,711,802;1,25\n", "385,711,802"),
    ],
)
def test_commas_that_may_set_thousands_apart_are_refused(text, cell):
    with pytest.raises(FlightError, match=f"a.txt:2: east: '{cell}' .*; must be a finite number"):
        point_tables_read(text)


@pytest.mark.parametrize("row", ["A nan nan 1", "A 1,5 2,5 1", "A - - 1", "A *** 2.0 1"])
def test_a_first_row_of_spoilt_numbers_is_no_heading(row):
    with pytest.raises(FlightError, match=r"a.txt:1"):
        point_tables_read(f"{row}\nB 1.0 2.0 1\n", "image x y omega")


def test_a_heading_beside_declared_columns_is_told_and_where_it_contradicts_them():
    (same,) = point_tables_read("image x y\nA 1 2\n", "image x y").left_out("orientation")
    assert same == "The heading in line 1, since the columns are declared."
    wide = point_tables_read("image name in x in y\nA 1 2\n", "image x y")
    assert wide.left_out("orientation")[0].startswith("The heading in line 1")
    (other,) = point_tables_read("image y x\nA 1 2\n", "image x y").left_out("orientation")
    assert "contradicts the declared columns: 'y' over east, 'x' over north" in other
