"""XMP packets as vendors write them, and as nobody should."""

from pathlib import Path

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.pictures.xmp import properties
from support.pictures import tagged

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
