"""Heads beside the paper's Table 1, of the paper's flight and of another one."""

from dataclasses import replace

from numpy.testing import assert_allclose

from acx4book.chapters.heads import tables
from acx4book.paper import printed
from acx4lib.calibration.heads import relative_orientation
from acx4lib.stages import attempt
from acx4lib.stages import heads as stage_of_heads
from support.flights.simulated import HEADS


def test_table_1_has_every_printed_number(flight, stage):
    interior = stage.heads.table()
    beside = printed.heads(flight, interior)
    assert beside["apart (σ)"].notna().sum() == 5 * 4  # f is held
    assert beside.loc[("CAM3", "xp", "mm"), "paper"] == "0.2619 ± 0.0032"
    relative = stage.orientation.table()
    beside = printed.heads(flight, relative)
    assert len(beside) == 6 * 4
    assert beside.loc[("CAM2", "Zc", "mm"), "paper"] == "74.272"
    first = beside.loc[("CAM1", "Zc", "mm")]
    assert first["apart (σ)"] != first["apart (σ)"]  # held, no sigma
    assert "σ over the paper's" not in beside  # which prints none of the orientation


def test_distances_from_print_are_those_of_the_values(flight, stage):
    relative = stage.orientation.table()
    off = printed.off_heads(flight, relative)
    assert_allclose(off["CAM2", "Zc", "mm"], stage.orientation.xyz_mm[1, 2] - 74.272, rtol=1e-12)
    beside = printed.heads(flight, relative)
    apart = abs(off / relative["sigma"])  # nothing is printed of the precision
    assert_allclose(beside["apart (σ)"].dropna(), apart.dropna())


def test_other_heads_are_not_compared_with_the_paper(other):
    stage = stage_of_heads.calibrate(other)
    assert [head.name for head in stage.orientation.heads] == ["port", "starboard"]
    for table in (stage.heads.table(), stage.orientation.table()):
        assert printed.heads(other, table).shape == (len(table), 0)
        assert len(printed.off_heads(other, table)) == 0
    assert printed.of_heads(other, "sigma0_squared").empty
    assert tables.printed_border_px(other) == {}
    assert tables.claim(other, "max_correlation") is None


def test_nothing_stands_beside_an_orientation_that_failed(flight):
    failed = attempt(
        relative_orientation, stage_of_heads.Heads(bundles={}, failures={"A": ""}), None
    )
    table = failed.table()
    assert printed.heads(flight, table).shape == (0, 0)
    assert printed.off_heads(flight, table).groupby("parameter").max().to_dict() == {}


def test_the_paper_is_beside_no_other_choice_of_heads(flight):
    three = replace(flight.synthetic, heads=HEADS[:3])
    assert printed.applies(flight)
    assert not printed.applies(replace(flight, synthetic=three))
