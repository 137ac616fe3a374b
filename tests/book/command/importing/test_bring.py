"""What all imports have in common."""

import os
import re

import pytest

from acx4book.command import importing
from acx4lib.errors import FlightError


def test_crs_and_heights_are_those_of_the_flight_unless_they_are_given(tmp_path):
    assert importing.system_of(tmp_path, "", "") == ("", "ellipsoidal")
    assert importing.system_of(tmp_path, "EPSG:31982", "-3.5") == ("EPSG:31982", -3.5)
    toml = tmp_path / "flight.toml"
    toml.write_text('crs = "EPSG:32633"\nheights = "geoid.gtx"\n')
    assert importing.system_of(tmp_path, "", "") == ("EPSG:32633", "geoid.gtx")
    (tmp_path / "geoid.gtx").write_bytes(b"")
    assert importing.system_of(tmp_path, "", "") == ("EPSG:32633", str(tmp_path / "geoid.gtx"))
    toml.write_text("not yet TOML")
    assert importing.system_of(tmp_path, "", "") == ("", "ellipsoidal")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("heights = [1]\n", "flight.toml:1: heights: [1]; must be text, or an undulation"),
        ("name = 'a'\nheights = nan\n", "flight.toml:2: heights: nan; must be an undulation"),
        ("heights = true\n", "flight.toml:1: heights: True; must be text"),
        ("crs = 5\n", "flight.toml:1: crs: 5; must be text, such as EPSG:32633"),
    ],
)
def test_a_system_that_can_be_none_is_refused(tmp_path, text, says):
    (tmp_path / "flight.toml").write_text(text)
    with pytest.raises(FlightError, match=re.escape(says)):
        importing.system_of(tmp_path, "", "")


def test_a_flight_toml_that_is_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "flight.toml")
    with pytest.raises(FlightError, match=r"flight.toml:1: file: cannot be read \(no regular file"):
        importing.system_of(tmp_path, "", "")
