"""A folder of MicMac becomes a flight; its own points prove the conventions."""

import pytest

from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4lib.exchange.programs.micmac import reading
from support.reference_files import needs


def rms(sentence):
    return float(sentence.split(" px rms")[0].split()[-1])


@needs("formats/micmac")
def test_real_files_prove_the_conventions():
    """MicMac's own projections are met to what the refit of the lens leaves."""
    brought = reading.read(data.path("formats/micmac/GroundMeasure.xml").parent)
    surveyed, own = brought.found[1:3]
    assert rms(surveyed) == pytest.approx(1.43, abs=0.01)
    assert rms(own) < 0.02
    assert "(40 measurements)" in own
    assert len(brought.tables["calibration/image_points.csv"]["image"]) == 19
    assert brought.tables["control_points.csv"]["point"][3] == "I-of-I"


def test_a_folder_becomes_a_flight(folder):
    brought = reading.read(folder, orientations="adjusted", crs="EPSG:31982", pixel_um=4.0)
    assert brought.settings["crs"] == "EPSG:31982"
    assert brought.settings["cameras"]["C"]["focal_mm"] == 4.0
    assert rms(brought.found[1]) < 1e-9
    assert brought.tables["control_points.csv"]["sigma_height_m"] == [0.02]
    assert brought.tables["calibration/trajectory.csv"]["kappa_deg"] == [0.0]
    assert brought.left_out == (
        "1 other XML files",
        "coordinates of 1 measured points are not there, so that they are tie points: T",
    )


def test_orientations_without_a_crs_are_refused(folder):
    with pytest.raises(FlightError, match="crs: adjusted orientations are in coordinates whose"):
        reading.read(folder, orientations="adjusted")


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        (
            "measured.xml",
            ("<NamePt>T<", "<NamePt>P<"),
            "OneMesureAF1I: 'P' stands twice in 'a.JPG'",
        ),
        ("measured.xml", ("1 2</PtIm>", "1</PtIm>"), "PtIm: '1'; must be 2 numbers"),
        ("points.xml", ("<Pt>10 20 0", "<Pt>10 20 nan"), "Pt: '10 20 nan'; must be 3 numbers"),
        ("points.xml", ("<NamePt>P</NamePt>", ""), "<NamePt> is missing"),
        ("Ori-A/Orientation-a.JPG.xml", ("AutoCal_C", "AutoCal_D"), "'AutoCal_D.xml' is not there"),
    ],
)
def test_wrong_files_are_refused(folder, name, change, message):
    path = folder / name
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(FlightError, match=message):
        reading.read(folder)


def test_measurements_alone_are_read(folder):
    brought = reading.read(folder / "measured.xml")
    assert brought.tables["calibration/images.csv"]["camera"] == ["CAM"]
    assert "prove nothing" in brought.found[1]
