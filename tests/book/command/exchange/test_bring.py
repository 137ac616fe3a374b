"""What all imports have in common."""

from acx4book.command.exchange import bring


def test_crs_and_heights_are_those_of_the_flight_unless_they_are_given(tmp_path):
    assert bring.system_of(tmp_path, "", "") == ("", "ellipsoidal")
    assert bring.system_of(tmp_path, "EPSG:31982", "-3.5") == ("EPSG:31982", -3.5)
    toml = tmp_path / "flight.toml"
    toml.write_text('crs = "EPSG:32633"\nheights = "geoid.gtx"\n')
    assert bring.system_of(tmp_path, "", "") == ("EPSG:32633", "geoid.gtx")
    (tmp_path / "geoid.gtx").write_bytes(b"")
    assert bring.system_of(tmp_path, "", "") == ("EPSG:32633", str(tmp_path / "geoid.gtx"))
    toml.write_text("not yet TOML")
    assert bring.system_of(tmp_path, "", "") == ("", "ellipsoidal")
