"""Lists of image coordinates: blocks with and without -99, as different programs write them."""

import pytest

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.shared import photo_lists
from acx4lib.exchange.safe.opened import Opened

PIX4D = """P1060498 H_8.07_6.0525
1006 -1.90643 1.83493
1020 2.00132 -0.797681

P1060499 H_8.07_6.0525

1006 -2.42102 1.87814
1020 2.15263 -0.33399
"""
"""The example in Pix4D's documentation of its BINGO file."""


def read(text):
    return photo_lists.read(Opened(file="image.dat", data=text.encode()))


@pytest.mark.parametrize(
    "text",
    [PIX4D, PIX4D.replace("\n\nP", "\n-99\nP") + "-99\n", PIX4D.replace("\n", "\r\n")],
)
def test_blocks_end_by_a_mark_or_by_the_next_header(text):
    found = read(text)
    assert [(one.image, one.point) for one in found] == [
        ("P1060498", "1006"),
        ("P1060498", "1020"),
        ("P1060499", "1006"),
        ("P1060499", "1020"),
    ]
    assert found[0].xy == (-1.90643, 1.83493)
    assert found[3].camera == "H_8.07_6.0525"


def test_a_header_without_a_camera_has_the_usual_one():
    assert read("7\n1 0.5 0.5 3\n-99\n")[0].camera == "CAM"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 c\n5 0.1 0.2\n5 0.1 0.2\n-99\n", "image.dat:3: point: '5' stands twice in image '1'"),
        ("1 c\n5 0.1\n-99\n", "image.dat:2: y: is missing, the line has 2 cells"),
        ("1 c\n5 0.1 x\n-99\n", "image.dat:2: y: 'x'; must be a finite number"),
        ("-99\n", "image.dat:1: block: -99 without a header"),
        ("1 c\n", "image.dat:1: file: has no measurement"),
    ],
)
def test_other_layouts_are_refused(text, message):
    with pytest.raises(FlightError, match=message):
        read(text)


def test_one_image_of_two_cameras_is_refused():
    file = Opened(file="image.dat", data=b"1 c\n5 0.1 0.2\n-99\n1 d\n6 0.1 0.2\n-99\n")
    with pytest.raises(FlightError, match="image '1' has the cameras 'c' and 'd'; must be one"):
        photo_lists.brought(
            file,
            photo_lists.read(file),
            source="",
            pixels_per_unit=1.0,
            size=(10, 10),
            pixel_um=1.0,
            block="calibration",
        )
