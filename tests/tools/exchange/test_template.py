"""A new flight names what is to be filled in, and with that is a flight."""

import tomllib

import pytest

from acx4lib import flight
from acx4lib.errors import FlightError
from acx4tools.exchange import flight_folder, template
from acx4tools.exchange.brought import Brought

SIZE = {"width_px": 100, "height_px": 80, "pixel_um": 5.0, "focal_mm": 50.0}


def begun(folder, *cameras):
    texts = template.files("f", cameras=cameras, crs="EPSG:31982", heights=-25.5)
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
