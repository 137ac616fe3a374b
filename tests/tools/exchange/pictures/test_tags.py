"""EXIF and XMP of TIFF and JPEG, written by another program."""

from pathlib import Path

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.pictures import tags
from acx4tools.exchange.pictures.tags import properties, read
from support.pictures import tagged


@pytest.mark.parametrize("name", ["a.tif", "a.TIFF", "a.jpg", "a.JPEG"])
def test_a_tiff_and_a_jpeg_say_the_same(tmp_path, name):
    found = read(tagged.write(tmp_path / name, {"Camera:BandName": "NIR"}))
    assert (found.width_px, found.height_px) == tagged.SIZE
    assert found.text("Camera:BandName", "Model") == "NIR"
    assert found.text("drone-dji:BandName", "Model") == "RedEdge-T"
    assert found.number("FocalPlaneXResolution") == pytest.approx(1 / tagged.PIXEL_MM)
    assert (found.samples, found.bits) == ((1, 16) if "t" in name.lower() else (3, 8))


def test_a_picture_without_xmp_has_no_properties(tmp_path):
    found = read(tagged.write(tmp_path / "a.jpg", None))
    assert found.xmp == {}
    assert found.number("Camera:RigCameraIndex") is None


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"GIF89a", "not a TIFF"),
        (b"\xff\xd8\xff\xe1\x00", "no frame header"),
        (b"II*\x00\xff\xff\xff\x7f", "must be a TIFF or a JPEG that is whole"),
    ],
)
def test_other_and_cut_files_are_refused_in_one_line(tmp_path, content, said):
    path = tmp_path / "a.tif"
    path.write_bytes(content)
    with pytest.raises(FlightError, match=said) as refused:
        read(path)
    assert str(refused.value).count("\n") == 0
    assert str(path) in str(refused.value)


@pytest.mark.parametrize(
    ("value", "said"),
    [("one,2,3", "must be numbers"), ("1,2", "must be 3"), ("1,nan,2", "must be finite numbers")],
)
def test_numbers_that_are_none_are_named(tmp_path, value, said):
    found = read(tagged.write(tmp_path / "a.tif", {"Camera:RigRelatives": value}))
    with pytest.raises(FlightError, match=f"Camera:RigRelatives: .*{said}"):
        found.numbers("Camera:RigRelatives", 3)


@pytest.mark.parametrize(("value", "number"), [((3, 2), 1.5), ((7,), 7.0), (4, 4.0), ("2.5", 2.5)])
def test_numbers_of_exif_are_ratios_or_plain(value, number):
    assert tags.rational(value) == number


@pytest.mark.parametrize("value", [(1, 0), (1, 2, 3), "x", None, b"\x01"])
def test_what_is_no_number_of_exif_is_nan(value):
    assert tags.rational(value) != tags.rational(value)


# --- XMP packets as vendors write them, and as nobody should


PATH = Path("a.tif")


def test_elements_lists_and_attributes_are_read_by_the_vendors_prefix():
    as_elements = properties(
        tagged.packet({"Camera:BandName": "Red edge", "Camera:VignettingCenter": [1.5, 2]}), PATH
    )
    assert as_elements == {
        "Camera:BandName": ("Red edge",),
        "Camera:VignettingCenter": ("1.5", "2"),
    }
    as_attributes = properties(
        tagged.packet({"drone-dji:GimbalYawDegree": "+3.0"}, attributes=True), PATH
    )
    assert as_attributes == {"drone-dji:GimbalYawDegree": ("+3.0",)}


def test_an_older_name_space_of_the_same_vendor_has_the_same_prefix():
    packet = tagged.packet({"Camera:BandName": "NIR"}).replace(b"camera/1.0", b"1.0")
    assert properties(packet, PATH)["Camera:BandName"] == ("NIR",)


def test_other_vendors_properties_are_left_out():
    packet = tagged.packet({"Camera:BandName": "NIR"}).replace(b"pix4d.com", b"example.com")
    assert properties(packet, PATH) == {}


@pytest.mark.parametrize(
    ("packet", "said"),
    [
        (b"<x:xmpmeta", "must be valid XML"),
        (b"<!DOCTYPE x [<!ENTITY a 'b'>]><x>&a;</x>", "DOCTYPE"),
        (b"\xff\xfe\xfa", "XML|UTF"),
    ],
)
def test_what_is_no_plain_xml_is_refused(packet, said):
    with pytest.raises(FlightError, match=said):
        properties(packet, PATH)
