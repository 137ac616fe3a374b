"""MicMac's files are told by their content."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.micmac import files


def test_files_of_a_folder_are_told_by_their_content(folder):
    found = files.files_of(folder)
    assert list(found.orientations) == ["a.JPG"]
    assert list(found.calibrations) == ["AutoCal_C.xml"]
    assert (len(found.measures), len(found.surveyed), found.others) == (1, 1, 1)


def test_a_camera_that_looks_down_has_the_librarys_axes(folder):
    pose = files.pose(files.files_of(folder).orientations["a.JPG"])
    assert_allclose(pose.R, np.eye(3))
    assert_allclose(pose.r, [10, 20, 100])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("<L1>1 0 0", "<L1>1 0.1 0"), "CodageMatr: L1, L2, L3 are no rotation"),
        (("<L1>1 0 0", "<L1>-1 0 0"), "CodageMatr: L1, L2, L3 are no rotation"),
        (("eProjStenope", "eProjOrthographique"), "TypeProj: 'eProjOrthographique'; must be"),
        (("eConvApero_DistM2C", "eConvAngErdas"), "KnownConv: 'eConvAngErdas'; must be eConvApero"),
        (("<TypeProj>", "<OrIntImaM2C><I00>1 0</I00></OrIntImaM2C><TypeProj>"), "turns or scales"),
        (("CodageMatr", "CodageAngulaire"), "<CodageMatr> is missing"),
    ],
)
def test_other_orientations_are_refused(folder, change, message):
    path = folder / "Ori-A" / "Orientation-a.JPG.xml"
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(FlightError, match=message):
        files.pose(files.files_of(folder).orientations["a.JPG"])


def test_points_inside_global_are_found(folder):
    """As MicMac's manual, and the programs that write such files, have them."""
    path = folder / "points.xml"
    path.write_text(f'<?xml version="1.0"?>\n<Global>{path.read_text()}</Global>')
    assert len(files.files_of(folder).surveyed) == 1


def test_one_of_several_orientations_must_be_chosen(folder):
    (folder / "Ori-B").mkdir()
    for path in (folder / "Ori-A").iterdir():
        (folder / "Ori-B" / path.name).write_text(path.read_text().replace("1000", "2000"))
    with pytest.raises(FlightError, match=r"has orientations in Ori-A, Ori-B; give one of these"):
        files.files_of(folder)
    found = files.files_of(folder / "Ori-B")
    assert found.calibrations["AutoCal_C.xml"].one("F").text == "2000"
    assert (len(found.measures), len(found.surveyed)) == (1, 1)


def test_a_calibration_lies_beside_its_orientations(folder):
    (folder / "Ori-0").mkdir()
    calibration = (folder / "Ori-A" / "AutoCal_C.xml").read_text()
    (folder / "Ori-0" / "AutoCal_C.xml").write_text(calibration.replace("1000", "2000"))
    found = files.files_of(folder)
    assert found.calibrations["AutoCal_C.xml"].one("F").text == "1000"


def test_orientations_may_hold_their_calibration(folder, calibrations):
    path = folder / "Ori-A" / "Orientation-a.JPG.xml"
    inner = calibrations.format(model="<ModNoDist></ModNoDist>").split("InternConique>")[1]
    interior = f"<Interne>{inner.removesuffix('</Calibration')}</Interne>"
    text = path.read_text().replace("<FileInterne>Ori-A/AutoCal_C.xml</FileInterne>", interior)
    for name in ("a", "b"):
        (folder / "Ori-A" / f"Orientation-{name}.JPG.xml").write_text(text)
    other = text.replace("<F>1000", "<F>2000")
    (folder / "Ori-A" / "Orientation-c.JPG.xml").write_text(other)
    found = files.files_of(folder)
    same = {"a.JPG": "AutoCal_C.xml", "b.JPG": "AutoCal_C.xml"}
    assert found.interior == {**same, "c.JPG": "CAM2.xml"}


def test_a_folder_without_files_of_micmac_is_refused(tmp_path):
    (tmp_path / "a.xml").write_text("<x/>")
    with pytest.raises(FlightError, match="has no XML of MicMac; must hold Ori-"):
        files.files_of(tmp_path)
