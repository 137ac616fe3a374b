"""Pictures of a flight are read, averaged and searched for tie points."""

import shutil

import numpy as np
import pytest
import tifffile

from acx4lib import flight as flights
from acx4lib.errors import FlightError
from acx4lib.stages import pictures as taken
from acx4lib.synthetic_image.frame import reduced_heads
from acx4lib.synthetic_image.rendering import render, render_plan
from acx4lib.tie_points.refinement import tie_differences
from support.flights import pictured

K = pictured.REDUCTION


def test_pixels_can_be_averaged_first(scene_flight, scene_orientation, scene_pictures):
    half = taken.read_pictures(scene_flight, scene_orientation, reduce=2)
    assert half.reduction == 2 * K
    one, two = (read.exposed[0].images[0].astype(float) for read in (scene_pictures, half))
    rows, cols = two.shape[:2]
    top, left = (one.shape[0] - 2 * rows) // 2, (one.shape[1] - 2 * cols) // 2
    assert two[3, 5] == pytest.approx(
        one[top + 6 : top + 8, left + 10 : left + 12].mean(axis=(0, 1)), abs=0.5
    )


def test_the_middle_of_a_picture_is_the_middle_of_the_sensor(scene_orientation):
    head = scene_orientation.heads[0]
    reduced = np.array([[head.width_px // K - 1, head.height_px // K - 1]]) / 2
    full = taken.full_size(reduced, np.array([0]), scene_orientation, K)
    assert full[0] == pytest.approx([(head.width_px - 1) / 2, (head.height_px - 1) / 2], abs=1e-12)


def test_tie_points_are_where_both_heads_see_one_place(scene_ties, scene_orientation):
    """The orientation is exact; a tenth of a pixel of the reduced pictures is a poor match."""
    d = np.hypot(*tie_differences(scene_orientation, scene_ties.ties).T) / pictured.REDUCED.pixel_mm
    assert len(d) > 400  # of 432 cells
    assert np.quantile(d, 0.95) < 0.1
    assert set(scene_ties.ties.exposure_idx) == {0, 1}


def test_a_picture_turned_by_180_degrees_is_an_error_of_its_exposure(
    scene_path, scene_orientation, tmp_path
):
    spoilt = shutil.copytree(scene_path, tmp_path / "flight")
    file = pictured.head_path(spoilt, "E1", "RIGHT")
    tifffile.imwrite(file, tifffile.imread(file)[::-1, ::-1], photometric="rgb")
    with pytest.raises(FlightError, match=r"^exposure E1: .*turned by 180 degrees"):
        taken.read_pictures(flights.read(spoilt), scene_orientation)


def test_grey_values_of_heads_agree_once_their_response_is_found(scene_pictures, scene_orientation):
    fit = taken.find_response(scene_pictures, scene_orientation, seed=1)
    assert all(np.max(one.after) < 0.01 for one in fit.overlaps)


@pytest.mark.parametrize("feather_px", [0.0, 150.0])
def test_the_image_that_is_rendered_of_pictures_is_the_scene(
    scene_pictures, scene_orientation, feather_px
):
    """Interpolated twice, cubic and bilinear: a few per cent of the scene's contrast."""
    plan = render_plan(
        reduced_heads(scene_orientation, scene_pictures.reduction),
        scene_pictures.synthetic,
        feather_px=feather_px / scene_pictures.reduction,
    )
    image = render(plan, scene_pictures.middle.images)
    scene = pictured.frame_of(pictured.scene(2))  # the middle one of two exposures is the second
    assert image.shape == scene.shape
    seen = (image > 0).all(axis=2)
    assert seen.mean() > 0.5
    left = image[seen].astype(float) - scene[seen]
    assert np.sqrt(np.mean(left**2)) < 0.15 * scene.std()
