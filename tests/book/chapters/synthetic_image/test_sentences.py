"""The synthetic stage on pixels: a small flight whose pictures are of one known scene."""

import shutil

import numpy as np

from acx4book.chapters.synthetic_image import sentences, tables
from acx4lib import flight as flights
from acx4lib.stages import pictures as taken
from acx4lib.stages import synthetic
from acx4lib.synthetic_image.frame import head_from_synthetic
from support.flights import pictured

K = pictured.REDUCTION


def stage_of(flight, orientation, pictures, found):
    return synthetic.SyntheticStage(
        synthetic=flight.synthetic_camera,
        orientation=orientation,
        pictures=pictures,
        found=found,
        refinement=synthetic.refine(flight, orientation, found),
        carried={},
    )


def test_a_flight_without_files_has_no_pictures(scene_path, scene_orientation, tmp_path):
    bare = shutil.copytree(scene_path, tmp_path / "flight")
    table = (bare / "heads" / "images.csv").read_text()
    lines = [line.rpartition(",")[0] for line in table.splitlines()]
    (bare / "heads" / "images.csv").write_text("\n".join(lines) + "\n")
    read = flights.read(bare)
    assert taken.read_pictures(read, scene_orientation) is None
    assert "nothing is rendered" in sentences.pixels(read, None)
    table = tables.found(stage_of(read, scene_orientation, None, None))
    assert table.to_dict("records") == [tables.NO_PIXELS]


def test_the_size_of_the_files_says_by_how_much_they_are_reduced(scene_flight, scene_pictures):
    assert scene_pictures.reduction == K
    assert [one.exposure for one in scene_pictures.exposed] == ["E0", "E1"]
    assert f"at 1/{K} of the full size" in sentences.pixels(scene_flight, scene_pictures)


def test_refining_what_is_right_moves_it_by_hundredths_of_a_pixel(
    scene_flight, scene_orientation, scene_pictures, scene_ties
):
    stage = stage_of(scene_flight, scene_orientation, scene_pictures, scene_ties)
    corner = 0.4 * np.array([[67.2, 90.72]])
    places = [
        head_from_synthetic(o, 1, corner) for o in (scene_orientation, stage.refinement.orientation)
    ]
    assert np.linalg.norm(places[1] - places[0]) < 0.05 * K
    assert tables.ways(stage)["Refined by"].iloc[-1] == tables.EACH
    assert len(tables.found(stage)) == 2  # exposures of one overlap


def test_the_answer_names_the_share_of_one_head_and_what_overlaps_cannot_show(
    scene_flight, scene_orientation, scene_pictures, scene_ties
):
    stage = stage_of(scene_flight, scene_orientation, scene_pictures, scene_ties)
    first, rest = sentences.answer(scene_flight, stage, None).split("\n\n")
    assert f"at {len(stage.refinement.kept)} of {len(stage.refinement.ties)} tie points" in first
    assert "deform the image without a trace" in rest
    assert "Grey values" not in rest
