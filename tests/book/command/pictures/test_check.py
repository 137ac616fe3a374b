"""`acx4 check` of a flight with pictures."""

import cv2
import numpy as np
import pytest

import acx4sim

SIDES = {"small": 64, "large": 600}


@pytest.fixture(params=SIDES)
def pictured(request, tmp_path):
    """A flight whose first image has a picture; noise, so that its file is large."""
    flight = tmp_path / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=3), flight)
    table = flight / "calibration" / "images.csv"
    head, first, *others = table.read_text().splitlines()
    rows = [f"{head},file", f"{first},images/a.jpg", *(f"{one}," for one in others)]
    table.write_text("\n".join(rows) + "\n")
    side = SIDES[request.param]
    noise = np.random.default_rng(1).integers(0, 255, (side, side), dtype=np.uint8)
    (flight / "calibration" / "images").mkdir()
    picture = flight / "calibration" / "images" / "a.jpg"
    picture.write_bytes(cv2.imencode(".jpg", noise)[1].tobytes())
    return flight, picture


def test_a_jpeg_that_was_cut_in_half_is_one_line(acx4, pictured):
    flight, picture = pictured
    assert acx4("check", flight)[0] == 0
    whole = picture.read_bytes()
    picture.write_bytes(whole[: len(whole) // 2])
    status, _, wrong = acx4("check", flight)
    assert (status, wrong) == (2, f"{picture}: is cut off, its pixels have no end; copy it again\n")


def test_what_follows_the_end_of_a_jpeg_is_no_fault(acx4, pictured):
    flight, picture = pictured
    picture.write_bytes(picture.read_bytes() + bytes(200_000))
    assert acx4("check", flight)[0] == 0
