"""Steps, tables and sentences of the first stages, on the paper's flight and on another one."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import acx4sim
from acx4book.chapters.flight import tables as contents
from acx4book.chapters.heads import held_focal_length, tables
from acx4book.chapters.heads import sentences as head_sentences
from acx4book.chapters.synthetic_image import sentences as synthetic_sentences
from acx4book.chapters.synthetic_image import tables as synthetic_tables
from acx4book.chapters.synthetic_image import wrong_heads
from acx4book.notebooks import stages
from acx4book.paper import printed as paper
from acx4book.paper.errata import audit
from acx4lib import flight as flights
from acx4lib.calibration.heads import Heads
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.results import adjustments
from acx4lib.results import folder as results
from acx4lib.stages import heads, synthetic
from support.flights.simulated import HEADS, fly

NAMES = {"CAM2": "port", "CAM3": "starboard"}


@pytest.fixture(scope="module")
def flight():
    return fly("acx4", seed=1, blocks=("heads",)).flight


@pytest.fixture(scope="module")
def stage(flight):
    return heads.orient(flight, heads.calibrate(flight))


@pytest.fixture(scope="module")
def folder(tmp_path_factory, stage):
    """Return a results folder that the heads stage has left."""
    folder = tmp_path_factory.mktemp("results")
    adjustments.write(folder, "heads", heads.records(stage))
    return folder


@pytest.fixture(scope="module")
def other_path(tmp_path_factory):
    """Write a flight of two heads that are not the paper's."""
    path = tmp_path_factory.mktemp("other") / "flight"
    options = acx4sim.Options(blocks=("heads",))
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=1, options=options), path)
    toml = (path / "flight.toml").read_text()
    toml = re.sub(r"\[cameras\.CAM[14]\]\n(.+\n)+\n", "", toml)
    for old, new in {**NAMES, "SYN": "virtual"}.items():
        toml = toml.replace(f"cameras.{old}]", f"cameras.{new}]").replace(f'"{old}"', f'"{new}"')
    toml = toml.replace('"CAM1", ', "").replace(', "CAM4"', "")
    (path / "flight.toml").write_text(toml)
    images = pd.read_csv(path / "heads" / "images.csv", dtype=str)
    images = images[images["camera"].isin(NAMES)]
    points = pd.read_csv(path / "heads" / "image_points.csv", dtype=str)
    points = points[points["image"].isin(images["image"])]
    images.assign(camera=images["camera"].map(NAMES)).to_csv(
        path / "heads" / "images.csv", index=False
    )
    points.to_csv(path / "heads" / "image_points.csv", index=False)
    return path


@pytest.fixture(scope="module")
def other(other_path):
    return flights.read(other_path)


# --- what flew -------------------------------------------------------------------------------


def test_the_papers_flight_stands_beside_the_papers_numbers(flight):
    table = contents.level_table(flight).set_index("Flying height (m)")
    high, low = (table.loc[h] for h in ("2597 (2600)", "1596 (1600)"))
    assert high["Ground pixel (cm)"] == "21.1 (22)"
    assert high["Side overlap (%)"] == ""
    assert (low["Strips"], low["Images per strip"]) == ("3 (3)", "7 (7)")
    assert low["Directions"] == "1 (1)"
    (held,) = contents.content_table(flight).to_dict("records")
    assert (held["Images each"], held["Surveyed"]) == ("31 (31)", "56 (56)")


def test_every_statement_that_is_shown_is_transcribed():
    names = [name for said in contents.PRINTED.values() for name in said.values()]
    names += [*contents.PRINTED_IMAGES.values(), *contents.PRINTED_POINTS.values()]
    assert all(paper.statement(name) > 0 for name in names)


def test_other_flights_stand_alone(other):
    text = contents.level_table(other).to_csv() + contents.content_table(other).to_csv()
    assert "(26" not in text
    assert "(31)" not in text
    assert contents.content_table(other)["Cameras"].tolist() == ["port, starboard"]


def test_the_standard_deviations_are_those_of_flight_toml(flight):
    (row,) = contents.sigma_table(flight).to_dict("records")
    assert row["Image points (px)"] == flight.apriori.image_point_px
    assert row["heading (deg)"] == pytest.approx(flight.apriori.heading_deg)


def test_notes_are_a_list(flight):
    assert contents.notes(replace(flight, notes=("one", "two"))) == "- one\n- two"
    assert "Nothing" in contents.notes(replace(flight, notes=()))


def test_directions_are_said(flight):
    assert "in one direction only" in contents.directions_sentence(flight)


def test_a_flight_without_surveyed_points_has_no_height_above_ground(flight):
    block = without_control(flight.heads)
    said = contents.directions_sentence(replace(flight, blocks={"heads": block}))
    assert said.startswith("*heads*: height above ground not known, flown in ")


def without_control(block):
    nothing = np.zeros(len(block.control), dtype=bool)
    return replace(block, control=block.control[nothing])


# --- the heads -------------------------------------------------------------------------------


def test_the_stage_leaves_every_head_its_orientation_and_its_correlations(folder):
    found = results.read(folder)
    keys = {f"heads/bundle/{name}" for name in HEADS} | {"heads/relative_orientation"}
    assert set(found.summary) == keys
    assert results.cameras(found, "heads/relative_orientation") == HEADS
    largest = audit.largest_correlations(folder)
    assert {name.split()[0] for name in largest} == set(HEADS)
    assert all(0.1 < value <= 1 for value in largest.values())
    assert "Cannot be the maximum" in audit.audit(largest)[10].verdict


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
    stage = heads.orient(other, heads.calibrate(other))
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


def test_a_head_that_fails_leaves_the_orientation_out(flight, stage, tmp_path):
    kept = {name: fit for name, fit in stage.heads.bundles.items() if name != "CAM2"}
    failed = heads.orient(flight, Heads(bundles=kept, failures={"CAM2": "too few"}))
    adjustments.write(tmp_path, "heads", heads.records(failed))
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["heads/bundle/CAM2"]["not_determined"] == ["heads/bundle/CAM2: too few"]
    assert summary["heads/bundle/CAM1"]["converged"] is True
    (reason,) = summary["heads/relative_orientation"]["left_out"]
    assert reason == "heads/relative_orientation: CAM2 could not be adjusted"
    with pytest.raises(AdjustmentError, match="CAM2 could not be adjusted"):
        synthetic.read_heads(flight, tmp_path)
    assert "CAM2 could not" in head_sentences.orientation(flight, failed)
    assert len(tables.orientation(flight, failed)) == 1


def test_heads_without_control_points_are_told_so(flight):
    block = without_control(flight.heads)
    said = heads.calibrate(replace(flight, blocks={"heads": block}))
    assert set(said.failures) == set(HEADS)
    assert said.failures["CAM1"].startswith("0 control points in images do not orient the block")


def test_heads_of_which_nothing_is_estimated_go_all_the_way(flight, tmp_path):
    as_declared = replace(flight, estimate_heads=())
    stage = heads.orient(as_declared, heads.calibrate(as_declared))
    adjustments.write(tmp_path, "heads", heads.records(stage))
    read = synthetic.read_heads(as_declared, tmp_path)
    assert [head.interior.k1 for head in read.heads] == [0.0] * 4
    assert "no correlations to show" in head_sentences.correlation(as_declared, stage)


def test_the_paper_is_beside_no_other_choice_of_heads(flight):
    three = replace(flight.synthetic, heads=HEADS[:3])
    assert paper.applies(flight)
    assert not paper.applies(replace(flight, synthetic=three))


def test_without_any_head_everything_still_says_so(flight):
    none = heads.orient(flight, Heads(bundles={}, failures=dict.fromkeys(HEADS, "no")))
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


# --- the synthetic image ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def orientation(flight, folder):
    return synthetic.read_heads(flight, folder)


@pytest.fixture(scope="module")
def refined(flight, folder, tmp_path_factory):
    copy = shutil.copytree(folder, tmp_path_factory.mktemp("refined") / "results")
    return synthetic.run(flight, copy), copy


@pytest.fixture(scope="module")
def refinement(refined):
    return refined[0].refinement


def test_results_of_the_heads_are_asked_for(flight, tmp_path):
    with pytest.raises(FlightError, match="run stage heads first"):
        synthetic.read_heads(flight, tmp_path)


def test_the_refined_heads_are_written(refinement, refined):
    found = results.read(refined[1])
    assert results.cameras(found, "synthetic/refined") == HEADS
    said = found.summary["synthetic/refined"]
    assert said["n_unknowns"] == 9
    assert said["n_observations"] == 2 * (len(refinement.ties) - said["n_rejected"])
    assert 0.3 < said["sigma0_squared"] < 3


def test_table_2_is_the_papers(flight, refined):
    table = synthetic_tables.table_2(flight, refined[0]).set_index("Parameter")
    printed = table["Printed"].str.split(" x ").str[0].astype(float)
    assert np.array_equal(table["Value"].astype(float), printed)


def test_coverage_is_that_of_the_printed_table_1(flight, refined):
    """0.00 / 69.2 / 28.7 / 0.4 / 1.7 per cent with eq. (6) as printed."""
    table = synthetic_tables.seen(flight, refined[0])
    printed = table["Table 1 as printed (%)"].astype(float)
    assert np.allclose(printed, [0.0, 69.2, 28.7, 0.4, 1.7], atol=0.3)
    assert np.allclose(table["Share (%)"].astype(float), printed, atol=0.5)


def test_the_first_head_is_not_turned(refinement):
    table = synthetic_tables.turns(refinement).set_index("Head")
    assert table.loc["CAM1"].str.startswith("+0.00 ±").all()
    assert not table.loc["CAM2"].str.startswith("+0.00 ±").any()


def test_every_way_to_refine_has_a_row_and_none_makes_it_worse(refined):
    table = synthetic_tables.ways(refined[0])
    assert table["Refined by"].tolist() == [*synthetic_tables.WAYS.values()]
    left = table["RMS of the differences (px)"].astype(float)
    assert (left[1:] <= left[0]).all()


def test_what_is_said_has_the_papers_half_pixel(flight, refined):
    assert "3 µm, 0.5 px" in synthetic_sentences.refinement(flight, refined[0])
    assert "nothing is rendered" in synthetic_sentences.pixels(flight, None)


@pytest.mark.slow
def test_turned_heads_are_repaired_by_rotations_and_not_by_shifts(flight, refined):
    """With 0.01 degrees: 0.01 px in the overlaps, 0.02 px in the frame; a shift leaves 3 px."""
    table = synthetic_tables.repaired(wrong_heads.repaired(flight, refined[0], seed=1))
    turned = table[table["Errors"].str.startswith("heads turned")].set_index("Refined by")
    turned = turned.drop(columns="Errors").astype(float)
    rotations, shift = (
        turned.loc[synthetic_tables.WAYS[way]] for way in ("rotations", "mean shift")
    )
    assert rotations["Overlaps, RMS (px)"] < 0.01
    assert rotations["at most in the frame (px)"] < 0.02
    assert shift["at most in the frame (px)"] > 1.0


def test_without_tie_points_the_refinement_is_left_out(flight, folder, tmp_path):
    block = flight.blocks["heads"]
    rows = block.images.camera_idx[block.image_points.image_idx] == 0
    alone = replace(block, image_points=block.image_points[rows])
    bare = replace(flight, blocks={"heads": alone})
    copy = shutil.copytree(folder, tmp_path / "results")
    stage = synthetic.run(bare, copy)
    entry = results.read(copy).summary["synthetic/refined"]
    (reason,) = results.messages(entry, "left_out")
    assert reason.startswith("synthetic/refined: ")
    assert "nothing can be refined" in synthetic_sentences.refinement(bare, stage)
    assert synthetic_tables.ways(stage).to_dict("records") == [synthetic_tables.NO_TIES]


# --- the notebooks ---------------------------------------------------------------------------


@pytest.mark.slow
def test_the_notebooks_run_on_heads_that_are_not_the_papers(other_path, tmp_path):
    report = stages.run(other_path, tmp_path / "results", stages=("heads", "synthetic"))
    assert report.ran == ("heads", "synthetic")
    assert report.not_determined == report.left_out == ()
    found = results.read(tmp_path / "results")
    assert results.cameras(found, "synthetic/refined") == ("port", "starboard")
    for path in (tmp_path / "results" / "notebooks").glob("0*.ipynb"):
        text = path.read_text()
        assert '"output_type": "error"' not in text
        assert '"name": "stderr"' not in text
        assert "CAM1" not in text
