"""The synthetic stage on pixels: a small flight whose pictures are of one known scene."""

import shutil

import numpy as np
import pytest
import tifffile

from acx4book.chapters.synthetic_image import equalised, sentences, tables
from acx4book.notebooks import stages
from acx4lib import flight as flights
from acx4lib.errors import FlightError
from acx4lib.results import folder as results
from acx4lib.stages import pictures as taken
from acx4lib.stages import synthetic
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.tie_points.differences import tie_differences
from support.flights import pictured

K = pictured.REDUCTION


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return pictured.write_flight(tmp_path_factory.mktemp("pixels") / "flight")


@pytest.fixture(scope="module")
def flight(path):
    return flights.read(path)


@pytest.fixture(scope="module")
def orientation():
    return pictured.orientation()


@pytest.fixture(scope="module")
def pictures(flight, orientation):
    return taken.read_pictures(flight, orientation)


@pytest.fixture(scope="module")
def found(pictures, orientation):
    return taken.find(pictures, orientation)


def stage_of(flight, orientation, pictures, found):
    return synthetic.SyntheticStage(
        synthetic=flight.synthetic_camera,
        orientation=orientation,
        pictures=pictures,
        found=found,
        refinement=synthetic.refine(flight, orientation, found),
    )


def test_a_flight_without_files_has_no_pictures(path, orientation, tmp_path):
    bare = shutil.copytree(path, tmp_path / "flight")
    table = (bare / "heads" / "images.csv").read_text()
    lines = [line.rpartition(",")[0] for line in table.splitlines()]
    (bare / "heads" / "images.csv").write_text("\n".join(lines) + "\n")
    read = flights.read(bare)
    assert taken.read_pictures(read, orientation) is None
    assert "nothing is rendered" in sentences.pixels(read, None)
    table = tables.found(stage_of(read, orientation, None, None))
    assert table.to_dict("records") == [tables.NO_PIXELS]


def test_the_size_of_the_files_says_by_how_much_they_are_reduced(flight, pictures):
    assert pictures.reduction == K
    assert [one.exposure for one in pictures.exposed] == ["E0", "E1"]
    assert f"at 1/{K} of the full size" in sentences.pixels(flight, pictures)


def test_pixels_can_be_averaged_first(flight, orientation, pictures):
    half = taken.read_pictures(flight, orientation, reduce=2)
    assert half.reduction == 2 * K
    one, two = (read.exposed[0].images[0].astype(float) for read in (pictures, half))
    rows, cols = two.shape[:2]
    top, left = (one.shape[0] - 2 * rows) // 2, (one.shape[1] - 2 * cols) // 2
    assert two[3, 5] == pytest.approx(
        one[top + 6 : top + 8, left + 10 : left + 12].mean(axis=(0, 1)), abs=0.5
    )


def test_the_middle_of_a_picture_is_the_middle_of_the_sensor(orientation):
    head = orientation.heads[0]
    reduced = np.array([[head.width_px // K - 1, head.height_px // K - 1]]) / 2
    full = taken.full_size(reduced, np.array([0]), orientation, K)
    assert full[0] == pytest.approx([(head.width_px - 1) / 2, (head.height_px - 1) / 2], abs=1e-12)


def test_tie_points_are_where_both_heads_see_one_place(found, orientation):
    """The orientation is exact; a tenth of a pixel of the reduced pictures is a poor match."""
    d = np.hypot(*tie_differences(orientation, found.ties).T) / pictured.REDUCED.pixel_mm
    assert len(d) > 400  # of 432 cells
    assert np.quantile(d, 0.95) < 0.1
    assert set(found.ties.exposure_idx) == {0, 1}


def test_refining_what_is_right_moves_it_by_hundredths_of_a_pixel(
    flight, orientation, pictures, found
):
    stage = stage_of(flight, orientation, pictures, found)
    corner = 0.4 * np.array([[67.2, 90.72]])
    places = [
        head_from_synthetic(o, 1, corner) for o in (orientation, stage.refinement.orientation)
    ]
    assert np.linalg.norm(places[1] - places[0]) < 0.05 * K
    assert tables.ways(stage)["Refined by"].iloc[-1] == tables.EACH
    assert len(tables.found(stage)) == 2  # exposures of one overlap


def test_grey_values_agree_after_equalisation(pictures, orientation):
    fit = equalised.response(pictures, orientation, seed=1)
    assert all(np.max(one.after) < 0.01 for one in fit.overlaps)
    assert "disagree by" in sentences.response(orientation, fit)


@pytest.mark.parametrize("feather_px", [0.0, 150.0])
def test_the_rendered_image_is_the_scene(pictures, orientation, feather_px):
    """Interpolated twice, cubic and bilinear: a few per cent of the scene's contrast."""
    image = equalised.image(pictures, orientation, None, feather_px=feather_px)
    scene = pictured.frame_of(pictured.scene(2))  # the middle one of two exposures is the second
    assert image.shape == scene.shape
    seen = (image > 0).all(axis=2)
    assert seen.mean() > 0.5
    left = image[seen].astype(float) - scene[seen]
    assert np.sqrt(np.mean(left**2)) < 0.15 * scene.std()


def test_a_picture_turned_by_180_degrees_is_an_error_of_its_exposure(path, orientation, tmp_path):
    spoilt = shutil.copytree(path, tmp_path / "flight")
    file = pictured.head_path(spoilt, "E1", "RIGHT")
    tifffile.imwrite(file, tifffile.imread(file)[::-1, ::-1], photometric="rgb")
    with pytest.raises(FlightError, match=r"^exposure E1: .*turned by 180 degrees"):
        taken.read_pictures(flights.read(spoilt), orientation)


@pytest.mark.slow
def test_the_notebook_runs_on_pixels(path, tmp_path):
    folder = pictured.write_results(tmp_path / "results", path)
    report = stages.run(path, folder, stages=("synthetic",))
    assert report.ran == ("synthetic",)
    kept = results.read(folder)
    assert results.cameras(kept, "synthetic/refined") == pictured.HEADS
    text = (folder / "notebooks" / "02-synthetic-image.ipynb").read_text(encoding="utf-8")
    assert '"output_type": "error"' not in text
    assert text.count('"image/png"') >= 7
