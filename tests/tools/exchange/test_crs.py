"""The flight's coordinate system from a project's own."""

from dataclasses import replace

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4tools.exchange import crs

AT = np.array([-49.2, -25.4])


@pytest.mark.parametrize("form", ["WKT1_GDAL", "WKT2_2019"])
def test_a_projected_system_is_found_again_by_its_code(form):
    text = pyproj.CRS("EPSG:31982").to_wkt(form)
    found = crs.chosen(text, None, None)
    assert found.settings == {"crs": "EPSG:31982", "heights": "ellipsoidal"}
    assert "no vertical part" in found.assumed[1]


def test_a_geographic_system_becomes_the_zone_of_a_place():
    found = crs.chosen("EPSG:4674", AT, None)
    assert found.settings["crs"] == "EPSG:31982"
    there = found.from_source(np.array([[*AT, 900.0]]))
    to_map = pyproj.Transformer.from_crs("EPSG:4674", "EPSG:31982", always_xy=True)
    assert_allclose(there, [[*to_map.transform(*AT), 900.0]])
    assert crs.chosen("EPSG:4674", None, None) is None


def test_a_vertical_system_is_kept_even_where_its_grid_is_not_here():
    found = crs.chosen("EPSG:31982+5773", None, None)
    assert found.settings == {"crs": "EPSG:31982", "heights": "EPSG:5773"}
    assert found.assumed[1] == "Heights are in EGM96 height"


def test_a_local_system_is_none():
    text = 'LOCAL_CS["Local",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'
    assert crs.chosen(text, AT, None) is None
    assert crs.chosen(text, AT, "EPSG:31982").crs == "EPSG:31982"


def test_heights_are_converted_by_undulations():
    system = replace(crs.chosen("EPSG:31982", None, None), heights=4.0)
    enh = np.array([[676000.0, 7184000.0, 100.0]])
    assert_allclose(crs.with_heights(system, enh, "ellipsoidal")[:, 2], 96.0)
    assert_allclose(crs.with_heights(system, enh, 3.0)[:, 2], 99.0)
    assert crs.with_heights(system, enh, 4.0) is enh


@pytest.mark.parametrize(
    ("text", "wanted", "message"),
    [
        ("EPSG:1", None, "is none that PROJ knows"),
        ("+proj=utm +zone=22 +nadgrids=/etc/passwd", None, "may name a file"),
        ("EPSG:31982", "EPSG:4326", "is not a projected CRS"),
        ("EPSG:4150", AT, None),
    ],
)
def test_what_cannot_be_used_is_told(text, wanted, message):
    if message is None:
        with pytest.raises(ValueError, match="has no UTM zone that PROJ knows here"):
            crs.chosen(text, wanted, None)
        return
    with pytest.raises(ValueError, match=message):
        crs.chosen(text, AT, wanted)


def test_axes_are_those_of_the_system():
    assert crs.is_north_first(crs.parsed("EPSG:4326"))
    assert not crs.is_north_first(crs.parsed("EPSG:31982"))
