"""A flight is measured: from its folder to that of the measured flight."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from acx4files.flight.reader import read
from acx4files.measuring.levels import (
    COARSE_PX,
    STEP_DOWN,
    corners,
    overlapping,
    sizes_of,
)
from acx4files.measuring.measure import _given, measure_flight, read_unmeasured
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import single_step
from acx4lib.model import Model
from support.pictures import measured

LARGEST = 0.06
"""Largest rms of errors of tie points over two heights, px of the pictures as measured."""

EIGHT = ("C1-03", "C1-05", "C2-04", "C2-06", "C3-04", "C4-03", "C4-05", "C5-05")


def test_tie_points_lie_within_hundredths_of_a_pixel_of_the_exact_geometry(whole):
    found = measured.tie_errors(whole.measured)
    assert len(found.off) > 400
    assert found.rms < LARGEST
    assert np.mean(np.hypot(*found.off.T) > 1) < 0.001


def test_sigma_from_the_matching_is_what_errors_are(whole):
    found = measured.tie_errors(whole.measured)
    # half of normal errors are below 0.67 sigma
    assert 0.4 < np.median(np.abs(found.z)) / 0.674 < 1.3


def test_points_have_three_rays_where_three_pictures_show_them(whole):
    found = measured.tie_errors(whole.measured).rows
    count = found["point"].value_counts()
    low = found[found["image"] == "C1-04"]
    seen_by_all = low[(low["col_px"] > 3000) & (low["col_px"] < 8500)]
    assert (count >= 3).sum() > 80
    assert (count[seen_by_all["point"]] >= 3).mean() > 0.5


def test_every_picture_is_covered(whole):
    rows = measured.tie_errors(whole.measured).rows
    for _, own in rows.groupby("image"):  # a third of a picture may be beside the others
        cells = set(zip(own["col_px"] // (11608 / 3), own["row_px"] // (8708 / 3), strict=True))
        assert len(cells) >= 6


def test_what_is_written_is_a_flight_with_the_same_tables(whole):
    flight = read(whole.measured)
    assert len(flight.calibration.images) == 3
    for name in ("flight.toml", "control_points.csv", "calibration/trajectory.csv"):
        assert (whole.measured / name).read_bytes() == (whole.flight / name).read_bytes()
    picture = "calibration/images/C1-04.tif"
    assert (whole.flight / picture).samefile(whole.measured / picture)  # linked, not copied


@pytest.mark.repeats
def test_the_same_pictures_give_the_same_bytes_whoever_matches(whole, tmp_path):
    from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 here alone

    with ThreadPoolExecutor(2) as pool:
        measure_flight(whole.flight, tmp_path / "again", executor=pool)
    name = "calibration/image_points.csv"
    assert (tmp_path / "again" / name).read_bytes() == (whole.measured / name).read_bytes()


@pytest.mark.repeats
def test_eight_exposures_give_the_camera_from_pictures_trajectory_and_control(tmp_path):
    flight = measured.flown(tmp_path, EIGHT, reduce=4)
    measure_flight(flight, tmp_path / "measured")
    found = measured.tie_errors(tmp_path / "measured", reduce=4)
    assert found.rms < LARGEST
    assert np.mean(np.hypot(*found.off.T) > 1) < 0.001
    measured_flight = read(tmp_path / "measured")
    free = measured_flight.estimate_mounting
    fit = single_step(measured_flight.calibration, Model(free=free)).calibration
    truth = json.loads((tmp_path / "flight.truth.json").read_text())["cameras"]["CAM"]
    for one in parameters(fit):
        assert abs(one.value - truth[one.name]) < 4 * one.sigma, one.name


@pytest.mark.repeats
def test_four_heads_and_their_synthetic_images_are_measured_alike(tmp_path):
    of = {"design": "acx4-ideal", "reduce": 8}
    exposures = ("H3-03", "H3-05", "H2-04", "H1-05", "C1-05", "C2-05", "C4-06")
    flight = measured.flown(tmp_path, exposures, blocks=("heads", "calibration"), **of)
    heads, synthetic = measure_flight(flight, tmp_path / "measured")
    assert len(heads.matched.views) == 4 * 4
    assert len(synthetic.matched.views) == 3
    for outcome in (heads, synthetic):
        found = measured.tie_errors(tmp_path / "measured", block=outcome.block, **of)
        assert found.rms < LARGEST
        assert np.mean(np.hypot(*found.off.T) > 1) < 0.001


def test_a_trajectory_whose_sigma_exceeds_what_is_searched_is_not_relied_on(whole, tmp_path):
    """Two degrees are 35 px between pictures of 760 px, where 14 px are searched."""
    shutil.copytree(whole.flight, tmp_path / "flight")
    settings = tmp_path / "flight" / "flight.toml"
    text = re.sub(r"roll_pitch_deg = .*", "roll_pitch_deg = 2.0", settings.read_text())
    settings.write_text(text)
    asked = []
    measure_flight(tmp_path / "flight", tmp_path / "out", tell=lambda name, *_: asked.append(name))
    assert "calibration features" in asked
    assert measured.tie_errors(tmp_path / "out").rms < LARGEST


# --- Levels


def test_every_cell_has_one_corner_away_from_the_border(views):
    found = corners(views[0], number=100, margin=13)
    assert 80 <= len(found) <= 120
    size = np.array([views[0].camera.width_px, views[0].camera.height_px])
    assert np.all((found >= 13) & (found < size - 13))
    cells = np.unique(found // (size // 4), axis=0)
    assert len(cells) >= 16


def test_neighbours_opposite_and_crossing_strips_overlap(views, surface):
    assert overlapping(views, surface) == [(i, j) for i in range(3) for j in range(i + 1, 3)]


def test_levels_grow_by_no_more_than_a_step_to_the_size_asked_for(views):
    for reduce in (1, 2):
        own = [replace(view, shrink=1) for view in views]
        factors = [level[0] for level in sizes_of(own, reduce)]
        assert factors[-1] == reduce
        assert 11608 / factors[0] <= COARSE_PX * 1.01
        steps = np.array(factors[:-1]) / factors[1:]
        assert np.all((steps > 1) & (steps <= STEP_DOWN + 1))


# --- Reading and writing a flight that is measured


@pytest.fixture
def own(whole, tmp_path):
    return shutil.copytree(whole.flight, tmp_path / "own", copy_function=shutil.os.link)


def test_image_points_may_be_missing_or_empty(own):
    assert len(read_unmeasured(own).flight.calibration.image_points) == 0
    for text in ("", "image,point,col_px,row_px\n", "\n\n"):
        (own / "calibration" / "image_points.csv").write_text(text)
        assert len(read_unmeasured(own).flight.calibration.image_points) == 0


def test_measurements_that_are_there_are_kept(whole, own):
    known = whole.outcome.surveyed.rows[0]
    place = f"{known.image},{known.point},{known.col_px},{known.row_px}"
    table = f"image,point,col_px,row_px,sigma_px\n{place},0.7\n"
    (own / "calibration" / "image_points.csv").write_text(table)
    (row,) = _given(read_unmeasured(own).tables["calibration"], 0.4)
    assert (row.image, row.point, row.sigma_px) == (known.image, known.point, 0.7)
