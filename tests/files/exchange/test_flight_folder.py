"""What was brought becomes a flight's folder; what the user changed is not replaced."""

import datetime as dt
import tomllib
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4files import flight
from acx4files.exchange import coordinates, flight_folder
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.project import (
    columns,
    first_use,
    require_names,
    trajectory_in_grid,
    without_doubles,
)
from acx4lib.errors import FlightError, OutputError

POINTS = {"point": ["A", "B,1"], "east_m": [1.5, 2.0], "north_m": [0.1, 0.2], "height_m": [3, 4]}
CAMERA = {"cameras": {"C 1": {"width_px": 10, "focal_mm": 8.25}}}


def control(**changes):
    given = {"sha256": {"a.txt": "12"}, "tables": {"control_points.csv": POINTS}, **changes}
    return ImportedFlight(source="Program 1", **given)


def test_tables_settings_and_what_is_said_are_written(tmp_path):
    brought = control(
        settings={"crs": "EPSG:31982", **CAMERA}, assumed=("Rows grow down.",), left_out=("One.",)
    )
    assert flight_folder.write(brought, tmp_path / "f") == ()
    assert (tmp_path / "f" / "control_points.csv").read_text() == (
        'point,east_m,north_m,height_m\nA,1.5,0.1,3\n"B,1",2.0,0.2,4\n'
    )
    assert (tmp_path / "f" / "flight.toml").read_text() == (
        'name = "f"\ncrs = "EPSG:31982"\nrefraction = "standard"\n\n'
        '[cameras."C 1"]\nwidth_px = 10\nfocal_mm = 8.25\n'
    )
    assert (
        (tmp_path / "f" / "import.md")
        .read_text()
        .startswith(
            "# Program 1\n\n## Read\n\n- a.txt, SHA-256 12\n\n## Assumed\n\n- Rows grow down.\n\n"
            "## Left out\n\n- One.\n\n## Written\n\n- control_points.csv, written with SHA-256 "
        )
    )


@pytest.mark.parametrize(
    ("before", "crs"),
    [("", "local"), ('crs = "EPSG:31982"', "EPSG:31982"), ('refraction = "none"', "EPSG:31982")],
    ids=["no map", "a flight that is there", "one that says it"],
)
def test_refraction_is_only_set_where_a_flight_gets_its_map(tmp_path, before, crs):
    flight_folder.begin(tmp_path / "f", {"flight.toml": f'name = "f"\n{before}\n'})
    flight_folder.write(control(settings={"crs": crs, **CAMERA}), tmp_path / "f")
    assert "standard" not in (tmp_path / "f" / "flight.toml").read_text()


def test_a_second_import_adds_tables_and_settings_and_tells_what_it_replaces(tmp_path):
    flight_folder.write(control(settings=CAMERA), tmp_path)
    more = {"crs": "EPSG:1", "cameras": {"C 1": {"focal_mm": 9.0}, "D": {"width_px": 3}}}
    one = {name: column[:1] for name, column in POINTS.items()}
    tables = {"heads/images.csv": {"a": []}, "control_points.csv": one}
    other = ImportedFlight(source="Other", sha256={}, settings=more, tables=tables)
    said = flight_folder.write(other, tmp_path)
    assert said == ("control_points.csv: 2 rows of an earlier import replaced by 1",)
    text = (tmp_path / "flight.toml").read_text()
    assert "focal_mm = 9.0" in text
    assert "[cameras.D]" in text
    assert (tmp_path / "heads" / "images.csv").read_text() == "a\n"
    said = (tmp_path / "import.md").read_text()
    assert said.startswith("# Program 1\n")
    assert "\n# Other\n" in said


def test_a_table_that_was_changed_is_not_replaced_and_nothing_else_is(tmp_path):
    flight_folder.write(control(settings=CAMERA), tmp_path)
    table = tmp_path / "control_points.csv"
    table.write_text("mine\n")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(OutputError, match=r"control_points.csv: was changed since an import"):
        flight_folder.write(control(settings={"crs": "EPSG:1"}), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_settings_that_were_edited_stay_and_the_new_ones_are_told(tmp_path):
    flight_folder.write(control(settings=CAMERA), tmp_path)
    settings = tmp_path / "flight.toml"
    settings.write_text("# mine\n")
    for _ in range(2):
        (said,) = flight_folder.write(control(settings={"crs": "EPSG:1"}), tmp_path)
        assert said.startswith("flight.toml was edited and stays as it is")
    assert settings.read_text() == "# mine\n"
    assert '```toml\ncrs = "EPSG:1"\n```' in (tmp_path / "import.md").read_text()


def test_a_folder_of_somebody_else_is_not_written_into(tmp_path):
    (tmp_path / "flight.toml").write_text("")
    with pytest.raises(OutputError, match="did not write"):
        flight_folder.write(control(), tmp_path)


def test_pictures_get_their_place(tmp_path):
    picture = tmp_path / "a.tif"
    picture.write_bytes(b"pixels")
    brought = control(pictures={"heads/images/a.tif": picture})
    place = tmp_path / "f" / "heads" / "images" / "a.tif"
    for _ in range(2):
        flight_folder.write(brought, tmp_path / "f")
    flight_folder.write(control(pictures={"heads/images/a.tif": place}), tmp_path / "f")
    assert place.read_bytes() == b"pixels"


def test_a_flight_has_one_crs_and_one_kind_of_heights(tmp_path):
    flight_folder.write(control(settings={"crs": "EPSG:31982", "heights": -25.5}), tmp_path)
    flight_folder.write(control(settings={"heights": -25.5}), tmp_path)
    with pytest.raises(OutputError, match=r"heights is -25.5, and 'ellipsoidal' in what is brou"):
        flight_folder.write(control(settings={"heights": "ellipsoidal"}), tmp_path)


def test_a_flight_that_is_begun_is_added_to_and_not_begun_again(tmp_path):
    texts = {"flight.toml": "# a remark\n", "control_points.csv": "point\n"}
    flight_folder.begin(tmp_path, texts)
    flight_folder.write(control(settings=CAMERA), tmp_path)
    assert "A,1.5,0.1,3" in (tmp_path / "control_points.csv").read_text()
    assert "# a remark" in (tmp_path / "flight.toml").read_text()
    with pytest.raises(OutputError, match="choose a new or empty folder"):
        flight_folder.begin(tmp_path, texts)


def test_heads_get_the_camera_that_they_make_together_as_the_first_of_them_sees():
    heads = {"A": {**CAMERA["cameras"]["C 1"], "k1": 1e-5, "mount_kappa_deg": -90.0}, "B": {}}
    images = {"heads/images.csv": {"image": ["1", "2", "3"], "camera": ["A", "B", "A"]}}
    brought = flight_folder.with_synthetic(control(settings={"cameras": heads}, tables=images))
    assert brought.settings["synthetic"] == {"camera": "SYN", "heads": ["A", "B"]}
    syn = {"width_px": 10, "focal_mm": 8.25, "mount_kappa_deg": -90.0}
    assert brought.settings["cameras"] == {**heads, "SYN": syn}
    assert "SYN has size, focal length and direction of A" in brought.assumed[-1]
    assert flight_folder.with_synthetic(brought) is brought
    alone = control(settings={"cameras": heads}, tables={"calibration/images.csv": {}})
    assert flight_folder.with_synthetic(alone) is alone


def test_the_first_head_is_the_one_that_is_not_turned_in_the_rig():
    down = {**CAMERA["cameras"]["C 1"], "mount_kappa_deg": -90.0}
    turned = {name: {**down, "mount_omega_deg": 0.2 * k} for k, name in enumerate("ABC", 1)}
    images = {"heads/images.csv": {"image": [*"1234"], "camera": [*"ABDC"]}}
    settings = {"cameras": {**turned, "D": {**down, "focal_mm": 9.0}}}
    brought = flight_folder.with_synthetic(control(settings=settings, tables=images))
    assert brought.settings["synthetic"]["heads"] == ["D", "A", "B", "C"]
    assert brought.settings["cameras"]["SYN"]["focal_mm"] == 9.0


# --- A new flight names what is to be filled in, and with that is a flight


SIZE = {"width_px": 100, "height_px": 80, "pixel_um": 5.0, "focal_mm": 50.0}


def begun(folder, *cameras):
    texts = flight_folder.files("f", cameras=cameras, crs="EPSG:31982", heights=-25.5)
    flight_folder.begin(folder, texts)
    with pytest.raises(FlightError) as raised:
        flight.read(folder)
    return raised.value.problems


def test_what_is_to_be_filled_in_is_all_that_is_wrong(tmp_path):
    problems = begun(tmp_path, "CAM")
    ends = [f"cameras.CAM.{key}: missing; required" for key in SIZE]
    assert [line.split(": ", 1)[1] for line in problems[:4]] == ends
    assert len(problems) == 7
    assert all("has no rows; at least one row" in line for line in problems[4:])
    settings = ImportedFlight(source="a", sha256={}, settings={"cameras": {"CAM": SIZE}})
    flight_folder.write(settings, tmp_path)
    text = (tmp_path / "flight.toml").read_text()
    assert "focal_mm = 50.0  # approximate; the calibration estimates it\n" in text
    assert tomllib.loads(text)["cameras"]["CAM"] == SIZE


def test_several_cameras_are_heads_of_a_synthetic_image(tmp_path):
    problems = begun(tmp_path, "SYN", 'b "2"')
    assert len(problems) == 3 * 4 + 2 + 3  # sizes, heads without images, empty tables
    settings = tomllib.loads((tmp_path / "flight.toml").read_text())
    assert settings["synthetic"] == {"camera": "SYN_1", "heads": ["SYN", 'b "2"']}
    assert list(settings["cameras"]) == ["SYN", 'b "2"', "SYN_1"]
    assert (tmp_path / "heads" / "images.csv").is_file()


# --- TOML that is written is read back as it was ---------------------------------------------


def test_nested_tables_come_back():
    values = {
        "name": 'a "quoted"\nname \x7f',
        "n": 3,
        "x": 1e-12,
        "yes": True,
        "day": dt.date(2025, 1, 2),
        "cameras": {"C 1": {"f": 1.5}, "é": {"heads": ["a", "b"]}},
        "points": [[float(i), 0.5] for i in range(12)],
        "empty": {},
    }
    assert tomllib.loads(flight_folder.written(values)) == values
    strips = {"block": {"strips": {"a": {"n": 1}, "b": {"n": 2}}}}
    text = flight_folder.written(strips, inline="strips")
    assert "a = {n = 1}\n" in text
    assert tomllib.loads(text) == strips


REMARKS = """\
# A flight.
crs = "EPSG:1"  # the map

[cameras.CAM]  # the only one
# focal_mm = 74.0  # about
pixel_um = 5.0

[apriori]
image_point_px = 0.5
"""


def test_values_are_added_between_the_remarks():
    values = {
        "crs": "EPSG:2",
        "heights": 1.5,
        "cameras": {"CAM": {"focal_mm": 50.5, "k1": 1e-6}, "B 2": {"pixel_um": 4.0}},
    }
    assert (
        flight_folder.added(REMARKS, values)
        == """\
# A flight.
crs = "EPSG:2"  # the map
heights = 1.5

[cameras.CAM]  # the only one
focal_mm = 50.5  # about
pixel_um = 5.0
k1 = 1e-06

[apriori]
image_point_px = 0.5

[cameras."B 2"]
pixel_um = 4.0
"""
    )


def test_a_form_that_is_not_edited_line_by_line_is_written_anew():
    before = 'cameras = {A = {b1 = 1}}  # inline\nname = """a\nheights = 2\n"""\n'
    values = {"cameras": {"A": {"k1": 2.0}}, "heights": 3.0}
    after = tomllib.loads(flight_folder.added(before, values))
    name = "a\nheights = 2\n"
    assert after == {"cameras": {"A": {"b1": 1, "k1": 2.0}}, "name": name, "heights": 3.0}


# --- tables with the digits that they need, and names that a flight may use ------------------


def test_numbers_have_the_digits_that_they_need():
    points = columns("col_px row_px", np.array([[1.23456789, 2.0]]))
    assert points == {"col_px": [1.2346], "row_px": [2.0]}
    table = trajectory_in_grid(
        ["a"], np.array([[1.123456789, 2.0, 3.0]]), np.radians([[0.1, 0.2, 1 / 3]])
    )
    assert table["east_m"] == [1.12346]
    assert table["kappa_deg"] == [0.333333333]


def test_names_that_stand_twice_get_the_program_s_number():
    assert without_doubles(["a", "b", "a"], [7, 8, 9]) == (["a#7", "b", "a#9"], 2)
    names, place = first_use(["b", "a", "b"])
    assert (names, place.tolist()) == (["b", "a"], [0, 1, 0])


@pytest.mark.parametrize(
    ("name", "said"), [("", "is empty"), ("=a", "would be computed"), ("a\nb", "U\\+000A")]
)
def test_a_name_that_no_flight_may_use_is_refused(name, said):
    def wrong(found, expected):
        return FlightError([f"f:1: name: {found}; {expected}"])

    with pytest.raises(FlightError, match=f"f:1: name: .*{said}"):
        require_names(["good", name], wrong)


# --- the flight's coordinate system from a project's own -------------------------------------


AT = np.array([-49.2, -25.4])


@pytest.mark.parametrize("form", ["WKT1_GDAL", "WKT2_2019"])
def test_a_projected_system_is_found_again_by_its_code(form):
    text = pyproj.CRS("EPSG:31982").to_wkt(form)
    found = coordinates.chosen(text, None, None)
    assert found.settings == {"crs": "EPSG:31982", "heights": "ellipsoidal"}
    assert "no vertical part" in found.assumed[1]


LOCAL = 'LOCAL_CS["Local",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'


def test_other_systems_become_the_flights():
    """A geographic one the zone of a place; a vertical one stays though its grid is not here."""
    found = coordinates.chosen("EPSG:4674", AT, None)
    assert found.settings["crs"] == "EPSG:31982"
    there = found.from_source(np.array([[*AT, 900.0]]))
    to_map = pyproj.Transformer.from_crs("EPSG:4674", "EPSG:31982", always_xy=True)
    assert_allclose(there, [[*to_map.transform(*AT), 900.0]])
    found = coordinates.chosen("EPSG:31982+5773", None, None)
    assert found.settings == {"crs": "EPSG:31982", "heights": "EPSG:5773"}
    assert found.assumed[1] == "Heights are in EGM96 height"
    assert coordinates.chosen("EPSG:4674", None, None) is None
    assert coordinates.chosen(LOCAL, AT, None) is None
    assert coordinates.chosen(LOCAL, AT, "EPSG:31982").crs == "EPSG:31982"


def test_heights_are_converted_by_undulations():
    system = replace(coordinates.chosen("EPSG:31982", None, None), heights=4.0)
    enh = np.array([[676000.0, 7184000.0, 100.0]])
    assert_allclose(coordinates.with_heights(system, enh, "ellipsoidal")[:, 2], 96.0)
    assert_allclose(coordinates.with_heights(system, enh, 3.0)[:, 2], 99.0)
    assert coordinates.with_heights(system, enh, 4.0) is enh


@pytest.mark.parametrize(
    ("text", "place", "wanted", "message"),
    [
        ("EPSG:1", AT, None, "is none that PROJ knows"),
        ("+proj=utm +zone=22 +nadgrids=/etc/passwd", AT, None, "may name a file"),
        ("EPSG:31982", AT, "EPSG:4326", "is not a projected CRS"),
        ("EPSG:4150", AT, None, "has no UTM zone that PROJ knows here"),
    ],
)
def test_what_cannot_be_used_is_told(text, place, wanted, message):
    with pytest.raises(ValueError, match=message):
        coordinates.chosen(text, place, wanted)


def test_axes_are_those_of_the_system():
    assert coordinates.is_north_first(coordinates.parsed("EPSG:4326"))
    assert not coordinates.is_north_first(coordinates.parsed("EPSG:31982"))
