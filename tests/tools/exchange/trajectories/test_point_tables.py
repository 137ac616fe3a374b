"""Trajectories in tables and lists."""

import numpy as np
import pytest

import acx4lib as acx
from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.geodesy import GridSystem
from acx4tools.exchange import flight_folder
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories import orientations, point_tables
from acx4tools.exchange.trajectories.listed import Column, column, declared, left_out, read_list
from acx4tools.exchange.trajectories.orientations import Meaning, TableOptions
from acx4tools.exchange.trajectories.point_tables import MeasuredOptions
from support.reference_files import needs

# --- tables of points, measured in images or surveyed, in any order of columns ---------------


POINTS, CONTROL = "calibration/image_points.csv", "control_points.csv"
TWO = {"image": ["a", "b"], "point": ["P 1", "P 2"], "col_px": [1.5, 2.5], "row_px": [3.0, 4.0]}
UTM = Meaning(crs="EPSG:32633", heights=45.0)


@pytest.fixture
def file(tmp_path):
    def write(text, name="points.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def measured(path, **options):
    return point_tables.measured([path], MeasuredOptions(**options))


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
    brought = measured(file("point image x y sigma\nP a 1 1 0.3\n"), first=1.0, camera="CAM")
    points = {"image": ["a"], "point": ["P"], "col_px": [0.0], "row_px": [0.0], "sigma_px": [0.3]}
    assert brought.tables == {
        POINTS: points,
        "calibration/images.csv": {"image": ["a"], "camera": ["CAM"], "exposure": ["a"]},
    }
    assert "the middle of the first pixel is 1, 1" in brought.assumed[1]


def test_several_tables_are_put_together(file):
    one, two = file("point image x y\nP a 1 1\n"), file("image point x y\na Q 2 2\n", "more.txt")
    brought = point_tables.measured([one, two], MeasuredOptions())
    assert brought.tables[POINTS]["point"] == ["P", "Q"]
    assert brought.found[0].startswith("2 measurements of 2 points in 1 image;")
    with pytest.raises(FlightError, match=r"points.txt:2: point: 'P' .* in line 2 already"):
        point_tables.measured([one, one], MeasuredOptions())


def test_what_is_left_out_is_named(file):
    text = "SITE : A\nimage point col row camera\na P 1 2 CAM 9\n"
    brought = measured(file(text))
    assert brought.left_out == (
        "Lines before the heading: 1.",
        "Columns that are no measurement: camera, 1 after the last in line 3.",
    )


@pytest.mark.parametrize(
    ("text", "columns", "says"),
    [
        (
            "a P 1 2\na P 3 4\n",
            "image point col row",
            "2: point: 'P' stands in image 'a' in line 1",
        ),
        ("image point x\na P 1\n", "", "1: columns: have no row; must be point image col row"),
        ("image point col row\na P 1 b\n", "", "2: row: 'b'; must be a finite number"),
        ("image point col row\na P 1\n", "", "2: row: is missing, the line has 3 cells"),
        ("a P 1 2\n", "image point col east", "--columns: column 'east' is not known"),
        ("a P 1 2\n", "", "1: columns: is no heading: 'a P 1 2'; declare them by --columns"),
        ('image point col row\na "" 1 2\n', "", "2: point: is empty"),
        ("image point x col row\na P 1 1 2\n", "", "1: columns: two columns may be 'col'"),
    ],
)
def test_bad_measurements_are_refused_in_one_line(file, text, columns, says):
    with pytest.raises(FlightError) as raised:
        measured(file(text), columns=columns)
    (line,) = raised.value.problems
    assert says in line


def test_surveyed_points_in_the_grid_stay_as_they_are(file):
    text = "role z y x name sigma_z\nGCP 10 5e6 4e5 P 0.02\ncheck 11 5000001 400001 Q 0.03\n"
    table = point_tables.surveyed(file(text), Meaning(crs="EPSG:32633")).tables[CONTROL]
    assert (table["point"], table["role"]) == (["P", "Q"], ["control", "check"])
    enh = np.stack([table["east_m"], table["north_m"], table["height_m"]], axis=1)
    assert enh.tolist() == [[4e5, 5e6, 10], [400001, 5000001, 11]]
    assert table["sigma_height_m"].tolist() == [0.02, 0.03]


def test_geographic_points_with_ellipsoidal_heights_become_the_flights(file):
    path = file("P 1 47.5 15.25 300\n")
    columns = {"columns": "point skip lat lon height"}
    meaning = Meaning(crs=UTM.crs, heights=UTM.heights, ellipsoidal=True)
    brought = point_tables.surveyed(path, meaning, role="check", **columns)
    table = brought.tables[CONTROL]
    there = GridSystem(crs="EPSG:32633").lonlat_from_grid(
        np.stack([table["east_m"], table["north_m"]], axis=1)
    )
    assert there == pytest.approx(np.array([[15.25, 47.5]]), abs=1e-9)
    assert (table["height_m"].tolist(), table["role"]) == ([255.0], ["check"])
    assert brought.left_out == ("Columns that are no coordinate: column 2.",)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("point x y z\nP 1 2 3\nP 1 2 3\n", "3: point: 'P' stands in line 2 already"),
        ("point x y role\nP 1 2 control\n", "1: columns: have no position; must be point east"),
        ("x y z\n1 2 3\n", "1: columns: have no point; must be point east north height"),
        ("point x y z role\nP 1 2 3 tie\n", "2: role: 'tie'; must be control or check"),
        ("point lat lon h\nP 91 2 3\n", "2: lat: '91'; must lie between -90 and 90"),
    ],
)
def test_bad_surveyed_points_are_refused_in_one_line(file, text, says):
    with pytest.raises(FlightError) as raised:
        point_tables.surveyed(file(text), UTM)
    (line,) = raised.value.problems
    assert says in line


@needs("ign-uce-m3")
def test_igns_control_lies_where_it_was_measured(tmp_path):
    files = {name: data.path(f"ign-uce-m3/{name}") for name in ("images.OPK", "fr_ign_RAF20.tif")}
    meaning = Meaning(
        crs="EPSG:2154", heights=str(files["fr_ign_RAF20.tif"]), ground_m=3.0, ellipsoidal=False
    )
    ellipsoidal = Meaning(crs=meaning.crs, heights=meaning.heights, ellipsoidal=True)
    pairs = [data.path(f"ign-uce-m3/{name}.mes") for name in ("tie_points", "control_points")]
    options = MeasuredOptions(columns="point image col row")
    surveyed = point_tables.surveyed(
        data.path("ign-uce-m3/control_points.app"), ellipsoidal, columns="point skip x y z"
    )
    camera = {"width_px": 26460, "height_px": 17004, "pixel_um": 4.0, "focal_mm": 123.9}
    lens = {"xp_mm": (13210 - 13229.5) * 0.004, "yp_mm": (8501.5 - 8502) * 0.004}
    for brought in (
        orientations.read(files["images.OPK"], meaning, TableOptions(of="camera")),
        point_tables.measured(pairs, options),
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
    assert column(word) == Column(name=name, unit=unit)


def test_borea_letters_and_repeated_words():
    names = [one.name for one in declared("N X Y Z O P K C S S")]
    expected = "image east north height omega phi kappa camera skip skip"
    assert names == expected.split()
    assert column("temperature") is None
    with pytest.raises(ValueError, match="stands twice"):
        declared("x y x")


# --- Rows with declared columns


NUMBERS = ("east", "omega")


def read(text, columns="", separator=""):
    source = Opened(file="a.txt", data=text.encode())
    return read_list(source, columns, separator=separator, numbers=NUMBERS)


def test_a_heading_with_tabs_over_rows_with_spaces():
    found = read("NOM\tX\tY\nA   1.0  2.0\nB   3.0  4.0\n")
    assert found.names("image") == ["A", "B"]
    assert found.numbers("north").tolist() == [2.0, 4.0]


def test_quoted_cells_may_hold_a_separator():
    found = read("image camera x\nA 'c 1, d' 1\n")
    assert found.names("camera") == ["c 1, d"]
    assert read('image,x\n"A, B",1\n').names("image") == ["A, B"]
    assert read("image,x\nA,1\n", separator="comma").numbers("east").tolist() == [1.0]


def test_declared_columns_with_and_without_a_heading():
    assert len(read("a,b,c\nA,1,2\n", "image x y").rows) == 1
    assert len(read("A,1,2\n", "image x y").rows) == 1


def test_a_heading_of_which_two_columns_may_be_one_is_refused():
    with pytest.raises(FlightError, match="two columns may be 'height'"):
        read("image x y z altitude\nA 1 2 3 4\n")


SITE = (
    "CHANTIER : PARIS - 2015\nDATE : 12/06/2015\nSYSTEME : LAMBERT 93\n\n"
    "NOM X Y OMEGA\nA 1.0 2.0 0.5\nB 3.0 4.0 0.6\n"
)


@pytest.mark.parametrize("columns", ["", "image x y omega"])
def test_lines_before_a_heading_are_counted_and_not_read(columns):
    found = read(SITE, columns)
    assert found.names("image") == ["A", "B"]
    assert found.numbers("north").tolist() == [2.0, 4.0]
    assert found.before == 4
    assert found.rows[0].number == 6


def test_rows_before_a_second_heading_are_rows():
    with pytest.raises(FlightError, match="x"):
        read("A 1.0 2.0 0.5\nNOM X Y OMEGA\nB 3.0 4.0 0.6\n", "image x y omega").numbers("east")


@pytest.mark.parametrize("row", ["A nan nan 1", "A 1,5 2,5 1", "A - - 1", "A *** 2.0 1"])
def test_a_first_row_of_spoilt_numbers_is_no_heading(row):
    with pytest.raises(FlightError, match=r"a.txt:1"):
        read(f"{row}\nB 1.0 2.0 1\n", "image x y omega", "space").numbers("east")


def test_a_heading_beside_declared_columns_is_told_and_where_it_contradicts_them():
    (same,) = left_out(read("image x y\nA 1 2\n", "image x y"), "orientation")
    assert same == "The heading in line 1, since the columns are declared."
    (other,) = left_out(read("image y x\nA 1 2\n", "image x y"), "orientation")
    assert "contradicts the declared columns: 'y' over east, 'x' over north" in other
