"""Identification of a report: who, with what, from which data."""

from acx4book.report.identity.describe import identification


def test_the_identification_names_flight_camera_system_and_software(run):
    said = identification(run).set_index("Item")["Statement"]
    assert said["Flight"] == run.flight.name
    assert "pixels of 4.6 µm; declared focal length 50 mm" in said["Camera CAM"]
    assert said["Coordinate system"] == "WGS 84 / UTM zone 33N (EPSG:32633)"
    assert said["Stages computed"] == "mounting and validation"
    assert said["Data, SHA-256"] == f"`{run.provenance.digest}`"
    assert "acx4lib " in said["Software"]
