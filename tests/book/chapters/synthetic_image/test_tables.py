"""Tables of the synthetic image beside Table 2 and the paper's claims."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.synthetic_image import sentences, tables
from acx4lib import flight as flights
from acx4lib.synthetic_image.carried import carry
from support.flights import in_heads, pictured


@pytest.fixture(scope="module")
def refinement(refined):
    return refined[0].refinement


def test_table_2_is_the_papers(flight, refined):
    table = tables.table_2(flight, refined[0]).set_index("Parameter")
    printed = table["Printed"].str.split(" x ").str[0].astype(float)
    assert np.array_equal(table["Value"].astype(float), printed)


def test_coverage_is_that_of_the_printed_table_1(flight, refined):
    """0.00 / 69.2 / 28.7 / 0.4 / 1.7 per cent with eq. (6) as printed."""
    table = tables.seen(flight, refined[0])
    printed = table["Table 1 as printed (%)"].astype(float)
    assert np.allclose(printed, [0.0, 69.2, 28.7, 0.4, 1.7], atol=0.3)
    assert np.allclose(table["Share (%)"].astype(float), printed, atol=0.5)


def test_the_first_head_is_not_turned(refinement):
    table = tables.turns(refinement).set_index("Head")
    assert (table.loc["CAM1"] == "held").all()
    assert table.loc["CAM2"].str.contains(" ± ").all()


def test_every_way_to_refine_has_a_row_and_none_makes_it_worse(refined):
    table = tables.ways(refined[0])
    assert table["Refined by"].tolist() == [*tables.WAYS.values()]
    left = table["RMS of the differences (px)"].astype(float)
    assert (left[1:] <= left[0]).all()


def test_what_is_said_has_the_papers_half_pixel(flight, refined):
    assert "3 µm, 0.5 px" in sentences.refinement(flight, refined[0])
    assert "nothing is rendered" in sentences.pixels(flight, None)


def test_carried_points_are_counted_by_block(tmp_path, flight, refined):
    assert tables.carried(flight, refined[0])["Block"].tolist() == ["none is measured in heads"]
    small = flights.read(in_heads.write(tmp_path))
    points = carry(small.calibration, pictured.orientation(), small.synthetic_camera)
    stage = replace(refined[0], carried={"calibration": points})
    (row,) = tables.carried(small, stage).to_dict("records")
    assert int(row["Measured in heads"]) == len(small.calibration.image_points)
    assert int(row["Carried"]) + int(row["outside the frame"]) == int(row["Points of exposures"])
