"""PAT-B: image coordinates in either unit; its other files are refused by name."""

import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs import patb

BLOCK = {"size": (4000, 3000), "pixel_um": 2.0}


def test_micrometres_and_millimetres_are_declared(tmp_path):
    (tmp_path / "a.im").write_text("101 153000\n1 -2000.0 1000.0\n-99\n")
    (tmp_path / "b.im").write_text("101 153000\n1 -2.0 1.0\n-99\n")
    (tmp_path / "a.con").write_text("")
    for name, unit in (("a.im", "um"), ("b.im", "mm")):
        brought = patb.read(tmp_path / name, unit=unit, **BLOCK)
        points = brought.tables["calibration/image_points.csv"]
        assert_allclose([points["col_px"][0], points["row_px"][0]], [999.5, 999.5])
        assert list(brought.settings["cameras"]) == ["CAM"]
        assert any("untried" in one for one in brought.assumed)
    assert patb.read(tmp_path / "a.im", unit="um", **BLOCK).left_out == ("a.con: not read",)


@pytest.mark.parametrize("ending", patb.NOT_READ)
def test_other_files_of_patb_are_refused(tmp_path, ending):
    path = tmp_path / f"a{ending}"
    path.write_text("1 2 3\n")
    with pytest.raises(FlightError, match=f"file: {ending} of PAT-B is not read"):
        patb.read(path, unit="mm", **BLOCK)
