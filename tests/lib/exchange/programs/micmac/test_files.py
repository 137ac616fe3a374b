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
        (("CodageMatr", "CodageAngulaire"), "<CodageMatr> is missing"),
    ],
)
def test_other_orientations_are_refused(folder, change, message):
    path = folder / "Ori-A" / "Orientation-a.JPG.xml"
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(FlightError, match=message):
        files.pose(files.files_of(folder).orientations["a.JPG"])


def test_a_folder_without_files_of_micmac_is_refused(tmp_path):
    (tmp_path / "a.xml").write_text("<x/>")
    with pytest.raises(FlightError, match="has no XML of MicMac; must hold Ori-"):
        files.files_of(tmp_path)
