"""The list of what was chosen is complete, and its values are those of the flight."""

import html

import pytest

from acx4book.pages import chosen
from acx4book.paper import printed
from support.flights.simulated import fly


@pytest.fixture(scope="module")
def page():
    flown = fly("acx4-ideal", seed=1)
    return chosen.page(flown.flight, flown.truth)


@pytest.mark.parametrize(
    "row",
    [
        "chosen | tie points of the calibration block | 700 |",
        "chosen | noise of GNSS positions, plan and height | 2 and 1.5 cm |",
        "chosen | places of the natural targets | 36 over",
        "chosen | focal length of the first head | 74.",
        "a guess | noise of image points | 0.5 px |",
        "a guess | noise of natural targets | 1 to 2 px |",
        "a guess | tie points of every head | 500 |",
        "ground that has tie points, heads and calibration | 5.2 × 3.8 and 4.2 × 2.5 km |",
        "a guess | control field | 56 over",
        "a guess | side overlap of the validation block | 30 % |",
        "a guess | places of the heads | a square of 0.16 m |",
        "a guess | axes of the lever arm | forward, left, up |",
        "a guess | site, relief, refraction, seed |",
    ],
)
def test_the_list_has_it(page, row):
    assert row in html.unescape(page)


def test_what_the_paper_says_of_gnss_stands_beside_it(page):
    assert f"{printed.statement('gnss_best_m'):.2f} to" in page
