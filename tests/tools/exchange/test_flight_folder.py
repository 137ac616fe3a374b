"""What was brought becomes a flight's folder; what the user changed is not replaced."""

import tomllib

import pytest

from acx4lib import flight
from acx4lib.errors import FlightError, OutputError
from acx4tools.exchange import flight_folder
from acx4tools.exchange.flight_folder import Brought

POINTS = {"point": ["A", "B,1"], "east_m": [1.5, 2.0], "north_m": [0.1, 0.2], "height_m": [3, 4]}
CAMERA = {"cameras": {"C 1": {"width_px": 10, "focal_mm": 8.25}}}


def control(**changes):
    given = {"sha256": {"a.txt": "12"}, "tables": {"control_points.csv": POINTS}, **changes}
    return Brought(source="Program 1", **given)


def test_tables_settings_and_what_is_said_are_written(tmp_path):
    brought = control(
        settings={"crs": "EPSG:31982", **CAMERA}, assumed=("Rows grow down.",), left_out=("One.",)
    )
    assert flight_folder.write(brought, tmp_path / "f") == ()
    assert (tmp_path / "f" / "control_points.csv").read_text() == (
        'point,east_m,north_m,height_m\nA,1.5,0.1,3\n"B,1",2.0,0.2,4\n'
    )
    assert (tmp_path / "f" / "flight.toml").read_text() == (
        'name = "f"\ncrs = "EPSG:31982"\n\n[cameras."C 1"]\nwidth_px = 10\nfocal_mm = 8.25\n'
    )
    assert (tmp_path / "f" / "import.md").read_text() == (
        "# Program 1\n\n## Read\n\n- a.txt, SHA-256 12\n\n## Assumed\n\n- Rows grow down.\n\n"
        "## Left out\n\n- One.\n\n"
    )


def test_a_second_import_adds_tables_and_settings(tmp_path):
    flight_folder.write(control(settings=CAMERA), tmp_path)
    more = {"crs": "EPSG:1", "cameras": {"C 1": {"focal_mm": 9.0}, "D": {"width_px": 3}}}
    other = Brought(
        source="Other", sha256={}, settings=more, tables={"heads/images.csv": {"a": []}}
    )
    flight_folder.write(other, tmp_path)
    text = (tmp_path / "flight.toml").read_text()
    assert "focal_mm = 9.0" in text
    assert "[cameras.D]" in text
    assert (tmp_path / "heads" / "images.csv").read_text() == "a\n"
    assert (tmp_path / "control_points.csv").is_file()
    said = (tmp_path / "import.md").read_text()
    assert said.startswith("# Program 1\n")
    assert said.endswith("# Other\n\n")


def test_a_table_that_was_changed_is_not_replaced_and_nothing_else_is(tmp_path):
    flight_folder.write(control(settings=CAMERA), tmp_path)
    table = tmp_path / "control_points.csv"
    table.write_text("mine\n")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(OutputError, match=r"control_points.csv: was cut or changed since"):
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
    with pytest.raises(OutputError, match="lies in the flight"):
        flight_folder.write(control(), tmp_path / "inside")


def test_pictures_get_their_place(tmp_path):
    picture = tmp_path / "a.tif"
    picture.write_bytes(b"pixels")
    brought = control(pictures={"heads/images/a.tif": picture})
    for _ in range(2):
        flight_folder.write(brought, tmp_path / "f")
    assert (tmp_path / "f" / "heads" / "images" / "a.tif").read_bytes() == b"pixels"


def test_a_flight_has_one_crs_and_one_kind_of_heights(tmp_path):
    flight_folder.write(control(settings={"crs": "EPSG:31982", "heights": -25.5}), tmp_path)
    flight_folder.write(control(settings={"heights": -25.5}), tmp_path)
    with pytest.raises(OutputError, match=r"heights is -25.5, and 'ellipsoidal' in what is brou"):
        flight_folder.write(control(settings={"heights": "ellipsoidal"}), tmp_path)


def test_a_file_that_lies_in_the_flight_already_is_not_brought(tmp_path):
    flight_folder.write(control(), tmp_path)
    (tmp_path / "geoid.gtx").write_bytes(b"grid")
    flight_folder.write(control(pictures={"geoid.gtx": tmp_path / "geoid.gtx"}), tmp_path)
    assert (tmp_path / "geoid.gtx").read_bytes() == b"grid"


def test_a_flight_that_is_begun_is_added_to_and_not_begun_again(tmp_path):
    texts = {"flight.toml": "# a remark\n", "control_points.csv": "point\n"}
    flight_folder.begin(tmp_path, texts)
    flight_folder.write(control(settings=CAMERA), tmp_path)
    assert "A,1.5,0.1,3" in (tmp_path / "control_points.csv").read_text()
    assert "# a remark" in (tmp_path / "flight.toml").read_text()
    with pytest.raises(OutputError, match="began this flight already"):
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


def test_rows_that_others_take_the_place_of_are_told(tmp_path):
    flight_folder.write(control(), tmp_path)
    assert flight_folder.write(control(), tmp_path) == ()
    one = {name: column[:1] for name, column in POINTS.items()}
    said = flight_folder.write(control(tables={"control_points.csv": one}), tmp_path)
    assert said == ("control_points.csv: 2 rows of an earlier import replaced by 1",)


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
    settings = Brought(source="a", sha256={}, settings={"cameras": {"CAM": SIZE}})
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
