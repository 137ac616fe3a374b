"""Tables of the synthetic image beside Table 2 and the paper's claims."""

import numpy as np
import pytest

from acx4book.chapters.synthetic_image import tables
from acx4lib import flight as flights
from acx4lib.stages import synthetic
from acx4lib.synthetic_image.frame import coverage
from acx4lib.synthetic_image.transferred_points import carry
from support.flights import in_heads, pictured


@pytest.fixture(scope="module")
def refinement(refined):
    return refined[0].refinement


def test_table_2_is_the_papers(flight):
    table = tables.table_2(flight, flight.synthetic_camera)
    printed = table["paper"].str.split(" x ").str[0].astype(float)
    assert np.array_equal(table["value"].astype(float), printed)


def test_coverage_is_that_of_the_printed_table_1(flight, refined):
    """0.00 / 69.2 / 28.7 / 0.4 / 1.7 per cent with eq. (6) as printed."""
    heads = {"ours": refined[0].orientation, **tables.printed_heads(flight)}
    ours, printed = (100 * coverage(one, flight.synthetic_camera).share for one in heads.values())
    assert np.allclose(printed, [0.0, 69.2, 28.7, 0.4, 1.7], atol=0.3)
    assert np.allclose(ours, printed, atol=0.5)
    table = tables.seen({"ours": ours / 100})
    assert table.index.tolist() == ["no head", "1 head", "2 heads", "3 heads", "4 heads"]
    assert table["ours"].sum() == pytest.approx(100)


def test_heads_that_are_not_the_papers_stand_beside_none(scene_flight):
    assert tables.printed_heads(scene_flight) == {}


def test_the_first_head_is_not_turned(refinement):
    table = tables.turns(refinement)
    sigma = table.xs("sigma", axis=1, level=1)
    assert sigma.loc["CAM1"].isna().all()
    assert (sigma.loc["CAM2":] > 0).all(axis=None)
    value = table.xs("value", axis=1, level=1)
    assert (value.loc["CAM1"] == 0).all()
    assert (np.abs(value) < 6 * sigma).loc["CAM2":].all(axis=None)  # of true heads and angles


def test_every_way_to_refine_has_a_row_and_none_makes_it_worse(flight, refinement):
    table = tables.ways(refinement, flight.synthetic_camera)
    assert table.index.tolist() == [*tables.WAYS.values()]
    left = table[tables.RMS]
    assert (left.iloc[1:] <= left.iloc[0]).all()
    assert (table[tables.EVERY] >= left - 1e-9).all()


def test_each_exposure_by_itself_is_a_row_where_there_are_pictures(
    scene_flight, scene_orientation, scene_ties
):
    refinement = synthetic.refine(scene_flight, scene_orientation, scene_ties)
    table = tables.ways(refinement, scene_flight.synthetic_camera)
    assert table.index[-1] == tables.EACH


def test_tables_of_what_a_flight_does_not_have_are_empty(flight, refinement):
    without = synthetic.gathered(
        refinement.before, refinement.ties[:0], {}, refinement.before, None
    )
    assert len(tables.ways(without, flight.synthetic_camera)) == 0
    assert tables.turns(without).xs("value", axis=1, level=1).eq(0).all(axis=None)
    assert len(tables.carried(flight, {})) == 0


def test_carried_points_are_counted_by_block(tmp_path):
    small = flights.read(in_heads.write(tmp_path))
    points = carry(small.calibration, pictured.orientation(), small.synthetic_camera)
    row = tables.carried(small, {"calibration": points}).loc["calibration"]
    assert row["Measured in heads"] == len(small.calibration.image_points)
    assert row["Carried"] + row["outside the frame"] == row["Points of exposures"]
