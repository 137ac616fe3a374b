"""Tables and sentences on heads, of the paper's flight and of another one."""

from dataclasses import replace

from acx4book.chapters.heads import held_focal_length, tables
from acx4book.chapters.heads import sentences as head_sentences
from acx4book.paper import printed as paper
from acx4lib.calibration.heads import Heads, relative_orientation
from acx4lib.stages import attempt, heads
from support.flights.simulated import HEADS


def oriented(flight, fits):
    return heads.gathered(fits, attempt(relative_orientation, fits, flight.synthetic_camera))


def test_table_1_has_every_printed_number(flight, stage):
    interior = tables.interior(flight, stage)
    relative = tables.orientation(flight, stage)
    assert (len(interior), len(relative)) == (5 * 4, 6 * 4)
    assert interior["Printed"].iloc[2] == "0.2619 ± 0.0032"
    assert relative.set_index(["Parameter", "Head"])["Printed"]["$Z_c$", "CAM2"] == "74.272"
    first = relative.set_index(["Parameter", "Head"]).loc[("$Z_c$", "CAM1")]
    assert (first["Value"], first["Apart (σ)"]) == ("74.000", "")  # held, no sigma


def test_the_sentences_have_the_papers_claims(flight, stage):
    assert "20 parameters" in head_sentences.agreement(flight, stage)
    assert "approximately 15 pixels" in head_sentences.border(flight, stage)
    said = head_sentences.correlation(flight, stage)
    assert "below 10 %" in said
    assert "cannot hold" in said
    assert "m on the ground" in head_sentences.orientation(flight, stage)


def test_the_answer_says_what_a_held_focal_length_costs(flight, stage):
    first, rest = head_sentences.answer(flight, stage).split("\n\n")
    assert first.startswith("Yes, but for the focal length: ")
    assert (
        "of 20 parameters lie within two combined standard deviations of the paper's Table 1"
        in first
    )
    assert "held at its nominal value" in rest
    assert "below 10 %" in rest


def test_held_focal_lengths_are_tabled_and_said(flight, stage):
    tried = held_focal_length.all_heads(flight, stage, (-0.5, 0.0, 0.5))
    one = held_focal_length.last_head(flight, stage, 0.5)
    table = tables.held(stage, [*tried, one])
    assert table["Held $f$"].tolist() == [
        "all heads -0.5 mm",
        "unchanged",
        "all heads +0.5 mm",
        "CAM4 +0.5 mm",
    ]
    assert "0.5 mm changes" in head_sentences.held(stage, tried)
    assert head_sentences.gnss(tried).endswith("instead of 74 mm.")


def test_other_heads_are_not_compared_with_the_paper(other):
    stage = heads.calibrate(other)
    assert [head.name for head in stage.orientation.heads] == ["port", "starboard"]
    for table in (
        tables.quality(other, stage),
        tables.interior(other, stage),
        tables.orientation(other, stage),
        tables.border(other, stage),
    ):
        assert not [column for column in table.columns if "rinted" in column or "Table" in column]
        assert len(table)
    for sentence in (head_sentences.border, head_sentences.correlation):
        assert "paper" not in sentence(other, stage)
    assert "other cameras" in head_sentences.agreement(other, stage)
    assert tables.claim(other, "max_correlation") is None


def test_the_paper_is_beside_no_other_choice_of_heads(flight):
    three = replace(flight.synthetic, heads=HEADS[:3])
    assert paper.applies(flight)
    assert not paper.applies(replace(flight, synthetic=three))


def test_without_any_head_everything_still_says_so(flight):
    none = oriented(flight, Heads(bundles={}, failures=dict.fromkeys(HEADS, "no")))
    tried = held_focal_length.all_heads(flight, none, (-0.5, 0.0, 0.5))
    for table in (tables.quality, tables.interior, tables.border):
        assert table(flight, none)["Head"].tolist() == ["none could be adjusted"]
    assert len(tables.held(none, [*tried, held_focal_length.last_head(flight, none, 0.5)])) == 1
    sentences = [
        head_sentences.held(none, tried),
        head_sentences.gnss(tried),
        head_sentences.correlation(flight, none),
        head_sentences.border(flight, none),
    ]
    assert sentences == ["No head could be adjusted."] * 4
