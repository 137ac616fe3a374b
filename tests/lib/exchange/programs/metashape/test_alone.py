"""Calibrations of Metashape without images."""

import re

import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.metashape import reading
from support.projects import metashape, scene

SAVED = f"""<?xml version="1.0" encoding="UTF-8"?>
<calibration>
  <projection>frame</projection>
  <width>{scene.WIDTH}</width>
  <height>{scene.HEIGHT}</height>
  <f>{scene.F}</f>
  <cx>{scene.CX - scene.WIDTH / 2}</cx>
  <cy>{scene.CY - scene.HEIGHT / 2}</cy>
  <k1>{scene.K1}</k1>
  <k2>{scene.K2}</k2>
  <p1>{scene.P2}</p1>
  <p2>{scene.P1}</p2>
  <date>2022-05-26T08:27:27Z</date>
</calibration>"""


def test_a_saved_calibration_is_that_of_its_chunk(tmp_path):
    path = tmp_path / "head 0.xml"
    path.write_text(SAVED)
    own = reading.read(path, pixel_um=1000 * scene.PIXEL_MM)
    whole = reading.read(metashape.write(tmp_path / "c.xml", slaves=False))
    table = dict(whole.settings["cameras"]["head 0"])
    del table["mount_kappa_deg"]  # a calibration says nothing of the camera's place
    assert set(own.settings["cameras"]["head 0"]) == set(table)
    for key, value in table.items():
        assert_allclose(own.settings["cameras"]["head 0"][key], value)
    assert not own.tables


def test_a_chunk_without_images_has_its_cameras(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    whole = reading.read(path)
    text = re.sub(r"<cameras>.*</cameras>", "", path.read_text(), flags=re.DOTALL)
    path.write_text(re.sub(r"<frames>.*</frames>", "", text, flags=re.DOTALL))
    assert reading.read(path).settings["cameras"] == whole.settings["cameras"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (">frame<", ">equirectangular<", r"c\.xml:3: projection: 'equirectangular'; must be one"),
        (">1280<", ">12.5<", r"c\.xml:4: width: '12.5'; must be a positive whole number"),
        ("<f>1450.0</f>", "", r"c\.xml:2: calibration: <f> is missing"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, old, new, message):
    path = tmp_path / "c.xml"
    path.write_text(SAVED.replace(old, new))
    with pytest.raises(FlightError, match=message):
        reading.read(path)
