"""Four fisheye cameras around a car: simulated by OpenCV, and the published rig."""

from __future__ import annotations

from dataclasses import replace

import cv2
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4book.reference import comparisons, data
from acx4book.reference.surround import comparisons as surround
from acx4book.reference.surround import files, sentences
from acx4book.reference.surround import shown as surround_figures
from acx4book.reference.surround.cameras import (
    FRAME_PX,
    fisheye_from_undistorted,
    frame_from_undistorted,
    ghost_cm,
    image_from_frame,
    place,
    undistorted_from_frame,
)
from acx4book.reference.surround.corners import corner_misfits, find_corners, image_misfits, rms
from acx4book.reference.surround.figures import (
    surround_enlarged,
    surround_ground,
    surround_misfits,
    surround_photographs,
)
from acx4book.reference.surround.greys import grey_correlation, grey_samples, overlapping
from acx4book.reference.surround.target_fit import left_out_misfits, refined, shift, target_seen
from acx4book.reference.surround.views import blended, view
from acx4lib.synthetic_image import response
from support.pictures import surround_rigs
from support.reference_files import needs

NAMES = tuple(surround_rigs.STATIONS)
WIDTH, HEIGHT = FRAME_PX

on_ground = st.tuples(st.floats(0, WIDTH - 1), st.floats(0, HEIGHT - 1))


@pytest.fixture(scope="module")
def cameras():
    return tuple(surround_rigs.camera(name) for name in NAMES)


@pytest.fixture(scope="module")
def images():
    ground = surround_rigs.chequered_ground()
    return tuple(surround_rigs.photograph(name, ground) for name in NAMES)


@pytest.fixture(scope="module")
def views(cameras, images):
    return tuple(view(c, image) for c, image in zip(cameras, images, strict=True))


@pytest.fixture(scope="module")
def corners(cameras, views):
    return find_corners(cameras, views)


def turned(camera, degrees):
    """Return a camera whose homography is off by a small rotation."""
    R = Rotation.from_rotvec(np.radians(degrees)).as_matrix()
    K = camera.K_undistorted
    return replace(camera, H_s_u=camera.H_s_u @ K @ R @ np.linalg.inv(K))


def all_misfits(cameras, corners):
    return np.concatenate([corner_misfits(cameras, c)[1] for c in corners])


# --- geometry --------------------------------------------------------------------------------


def test_the_lens_is_that_of_opencv(cameras):
    rng = np.random.default_rng(1)
    colrow = rng.uniform([0, 0], surround_rigs.SIZE, (500, 2))
    K_u = surround_rigs.K_UNDISTORTED
    ray = (colrow - K_u[:2, 2]) / np.diag(K_u)[:2]
    theirs = cv2.fisheye.distortPoints(ray[:, None], surround_rigs.K, surround_rigs.THETA)[:, 0]
    ours = fisheye_from_undistorted(cameras[0], colrow)
    assert_allclose(ours, theirs, atol=1e-9)  # px, rounding


@given(st.sampled_from(NAMES), st.lists(on_ground, min_size=1, max_size=5))
def test_the_ground_is_where_a_pinhole_sees_it(name, places):
    colrow = np.array(places)
    R, t = surround_rigs.pose(name)
    x = np.column_stack([colrow, np.zeros(len(colrow))])
    theirs = cv2.projectPoints(x, cv2.Rodrigues(R)[0], t, surround_rigs.K_UNDISTORTED, None)[0]
    ahead = (x @ R.T + t)[:, 2] > 1  # cm
    ours = undistorted_from_frame(surround_rigs.camera(name), colrow)
    # places near the plane of the perspective centre are seen thousands of pixels away
    assert_allclose(ours[ahead], theirs[ahead, 0], rtol=1e-7, atol=1e-6)
    behind = (x @ R.T + t)[:, 2] < -1
    assert np.isnan(ours[behind]).all()


def test_the_sign_of_a_homography_is_free(cameras):
    colrow = np.array([[600.0, 300], [600, 1300]])
    other = replace(cameras[0], H_s_u=-2 * cameras[0].H_s_u)
    assert_allclose(
        undistorted_from_frame(other, colrow),
        undistorted_from_frame(cameras[0], colrow),
    )


def test_nothing_is_seen_outside_the_undistorted_image(cameras):
    colrow = np.array([[600.0, 400], [20, 500], [600, 1300]])  # before it, beside it, behind it
    seen = image_from_frame(cameras[0], colrow)
    assert np.isfinite(seen[:, 0]).tolist() == [True, False, False]


@pytest.mark.parametrize("name", NAMES)
def test_a_camera_stands_where_its_homography_says(name):
    found = place(surround_rigs.camera(name))
    assert_allclose(found.centre_cm, surround_rigs.STATIONS[name][0], atol=1e-6)
    assert_allclose([found.ratio, found.angle], [1, np.pi / 2], atol=1e-9)


def test_stretched_homographies_are_no_cameras(cameras):
    stretched = replace(cameras[0], H_s_u=np.diag([1, 1.04, 1]) @ cameras[0].H_s_u)
    assert_allclose(place(stretched).ratio, 1.04, atol=1e-9)


def test_a_ghost_is_as_wide_as_two_pinholes_make_it(cameras):
    foot, height_cm = np.array([350.0, 350]), 10.0
    tops = []
    for camera in cameras[:2]:
        R, t = surround_rigs.pose(camera.name)
        top = np.array([[*foot, -height_cm]])  # the third axis is down
        seen = cv2.projectPoints(top, cv2.Rodrigues(R)[0], t, camera.K_undistorted, None)[0][0]
        tops.append(frame_from_undistorted(camera, seen)[0])
    expected = np.linalg.norm(tops[0] - tops[1])
    assert expected > 20
    assert_allclose(ghost_cm(cameras[:2], foot, height_cm=height_cm), expected)


# --- files -----------------------------------------------------------------------------------


@pytest.mark.parametrize("turns", range(4))
def test_views_are_turned_as_pictures_are(turns):
    size = (HEIGHT, WIDTH) if turns % 2 == 0 else (WIDTH, HEIGHT)
    view = np.arange(WIDTH * HEIGHT).reshape(size)
    frame = np.rot90(view, turns)
    for x, y in ((0, 0), (17, 5), (size[1] - 1, size[0] - 1)):
        col, row, one = files.quarter_turn(turns) @ [x, y, 1]
        assert one == 1
        assert frame[int(row), int(col)] == view[y, x]


def written(path, **left_out):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    values = {
        "camera_matrix": surround_rigs.K,
        "dist_coeffs": surround_rigs.THETA[:, None],
        "resolution": np.array([[960], [640]], dtype=np.int32),
        "project_matrix": np.diag([2.0, 3, 1]),
        "scale_xy": np.array([[0.5], [0.75]], dtype=np.float32),
        "shift_xy": np.array([[-10.0], [10]], dtype=np.float32),
    }
    for name, value in values.items():
        if name not in left_out:
            storage.write(name, value)
    storage.release()
    return path


def test_the_undistorted_camera_is_scaled_and_shifted(tmp_path):
    camera = files.read(written(tmp_path / "back.yaml"), quarter_turns=2)
    assert (camera.name, camera.width_px, camera.height_px) == ("back", 960, 640)
    assert_allclose(camera.K_undistorted, [[150, 0, 470], [0, 240, 330], [0, 0, 1]])
    assert_allclose(camera.H_s_u @ [0, 0, 1], [WIDTH - 1, HEIGHT - 1, 1])


def test_a_file_without_a_matrix_is_named(tmp_path):
    path = written(tmp_path / "left.yaml", shift_xy=True)
    with pytest.raises(ValueError, match=r"left\.yaml has no matrix 'shift_xy'"):
        files.read(path, quarter_turns=1)
    with pytest.raises(ValueError, match=r"left\.yaml is no image"):
        files.read_image(path)


# --- views -----------------------------------------------------------------------------------


def test_a_view_shows_the_right_pixels_and_takes_gains_out(cameras):
    """The image says of each pixel which one it is."""
    cols, rows = np.meshgrid(np.arange(960), np.arange(640))
    image = np.stack([cols / 4 + 5, rows / 4 + 5, 0 * cols + 200], axis=-1).astype(np.uint8)
    gains = np.zeros((3, 3))
    gains[2, 0] = np.log(2)
    found = view(cameras[1], image, coefficients=gains)
    row, col = np.nonzero(found.seen)
    at = image_from_frame(cameras[1], np.column_stack([col, row])[::97].astype(float))
    shown = found.image[row, col][::97]
    # the image was cut to whole numbers, and so was the view: a grey value is 4 px
    assert_allclose(shown[:, :2], np.floor(at / 4) + 5, atol=1)
    assert np.all(shown[:, 2] == 100)
    assert np.all(found.image[~found.seen] == 0)


def test_views_of_one_ground_are_alike(views):
    pairs = overlapping(views)
    assert pairs == [(0, 1), (0, 3), (1, 2), (2, 3)]
    for a, b in pairs:
        # what is left is that one of them sees the corner from farther away
        assert grey_correlation(views[a], views[b]) > 0.9
    assert np.isnan(grey_correlation(views[0], views[2]))


@pytest.mark.parametrize("feather_px", [0.0, 30.0, 200.0])
def test_blending_equal_views_changes_nothing(views, feather_px):
    flat = [replace(v, image=np.where(v.seen[:, :, None], 77, 0).astype(np.uint8)) for v in views]
    image = blended(flat, feather_px=feather_px)
    seen = np.any([v.seen for v in views], axis=0)
    assert np.all(image[seen] == 77)
    assert np.all(image[~seen] == 0)


def test_a_seam_is_hard_and_a_feather_is_smooth(views):
    lit = [
        replace(v, image=np.where(v.seen[:, :, None], 50 * k, 0).astype(np.uint8))
        for k, v in enumerate(views, 1)
    ]
    hard = blended(lit, feather_px=0)
    assert set(np.unique(hard)) == {0, 50, 100, 150, 200}
    soft = blended(lit, feather_px=60)[:, :, 0].astype(int)
    # where two views end at one place, one goes over into the other at once
    inner = cv2.erode(np.any([v.seen for v in views], axis=0).astype(np.uint8), np.ones((61, 61)))
    steps = np.abs(np.diff(soft, axis=1))[(inner[:, 1:] & inner[:, :-1]).astype(bool)]
    assert steps.max() < 10  # of 150 between left and right; a ramp of 60 px has 2 or 3 a pixel


def test_gains_are_found_and_saturation_is_left_out(views, rng):
    factors = (1.0, 1.1, 0.9, 1.05)
    lit = [
        replace(
            v,
            image=np.rint(v.image * f + rng.normal(0, 1, (HEIGHT, WIDTH, 3)))
            .clip(0, 254)
            .astype(np.uint8),
        )
        for v, f in zip(views, factors, strict=True)
    ]
    lit[1].image[:320, :420] = 255
    samples = grey_samples(lit)
    assert samples[0].saturated.any()
    assert np.all(np.isnan(samples[0].log_ratio) == samples[0].saturated | samples[0].dark)
    fit = response.fit_response(samples, n_heads=4, n_bands=3)
    expected = np.log(factors) - np.mean(np.log(factors))
    # means of 64 pixels of 50 to 180, with a noise of one: a quarter of a percent at most
    assert_allclose(fit.response.coefficients[:, :, 0], np.tile(expected, (3, 1)).T, atol=0.003)
    assert_allclose(fit.response.coefficients[:, :, 1:], 0, atol=1e-9)


# --- fit -------------------------------------------------------------------------------------


def test_corners_of_the_right_cameras_are_in_one_place(cameras, corners):
    assert min(len(c.colrow_a) for c in corners) >= 10
    # an eighth of a pixel of an image, which has several centimetres where it is far away
    assert rms(all_misfits(cameras, corners)) < 0.5
    every = np.concatenate([image_misfits(cameras, c) for c in corners])
    assert rms(every) < 0.15
    for c in corners:  # of squares of 40 cm, outer edges of the first pixels
        at = corner_misfits(cameras, c)[0] + 0.5
        assert_allclose(at, 20 * np.rint(at / 20), atol=1.0)


def test_misfits_are_those_of_the_cameras(cameras, corners):
    moved = replace(
        cameras[1], H_s_u=np.array([[1, 0, 7.0], [0, 1, -3], [0, 0, 1]]) @ cameras[1].H_s_u
    )
    d = corner_misfits((cameras[0], moved, *cameras[2:]), corners[0])[1]
    assert_allclose(d - corner_misfits(cameras, corners[0])[1], [[7, -3]] * len(d), atol=1e-9)


@pytest.mark.parametrize("free", ["rotations", "homographies", "in place"])
def test_refinement_finds_the_turns_that_were_made(cameras, corners, free):
    degrees = ([0, 0, 0], [0.4, -0.3, 0.2], [-0.2, 0.3, 0.5], [0.3, 0.2, -0.4])
    wrong = tuple(turned(c, d) for c, d in zip(cameras, degrees, strict=True))
    found = refined(wrong, corners, free=free)
    assert rms(all_misfits(wrong, corners)) > 3
    # in place, the wrong cameras are believed to 5 cm
    assert rms(all_misfits(found, corners)) < (1.0 if free == "in place" else 0.5)
    if free == "rotations":  # the others may change what the overlaps do not show
        for camera, truth in zip(found, cameras, strict=True):
            moved = shift(camera, truth, target_seen(truth))
            assert np.nanmax(np.abs(moved)) < 3  # cm; from side to side it is ten metres
    assert found[0] is wrong[0] or free == "in place"


def test_left_out_corners_are_all_corners_once(cameras, corners):
    left_out = left_out_misfits(cameras, corners, free="rotations")
    assert [len(d) for d in left_out] == [len(c.colrow_a) for c in corners]
    assert rms(np.concatenate(left_out)) < 0.6


# --- figures ---------------------------------------------------------------------------------


def test_figures_have_a_panel_for_what_they_show(cameras, images, views, corners):
    refinements = {"before": cameras, "after": cameras}
    stages = {"before": views, "after": views}
    assert len(surround_photographs(cameras, images).axes) == 4
    assert len(surround_ground(cameras, views, views).axes) == 2
    assert len(surround_misfits(refinements, corners).axes) == 2
    assert len(surround_enlarged(cameras, corners, stages).axes) == 4 * 4
    assert plt.get_fignums() == []


# --- the published rig -----------------------------------------------------------------------


@needs(surround.FILES)
def test_the_published_lens_is_that_of_opencv():
    grid = np.stack(np.meshgrid(np.arange(960.0), np.arange(640.0)), axis=-1)
    for camera in surround.load()[0]:
        theirs = cv2.fisheye.initUndistortRectifyMap(
            *(camera.K, camera.theta_coefficients, np.eye(3), camera.K_undistorted),
            *((960, 640), cv2.CV_32FC1),
        )
        ours = fisheye_from_undistorted(camera, grid.reshape(-1, 2))
        assert_allclose(ours.reshape(grid.shape), np.stack(theirs, -1), atol=5e-5)  # float32


@needs(surround.FILES)
def test_a_view_is_what_opencv_undistorts_warps_and_turns():
    """OpenCV's two steps blur; means of 8 x 8 px do not know."""
    camera, image = (both[1] for both in surround.load())
    K_u = camera.K_undistorted
    flat = cv2.fisheye.undistortImage(image, camera.K, camera.theta_coefficients, None, K_u)
    to_view = np.linalg.inv(files.quarter_turn(1)) @ camera.H_s_u
    theirs = np.rot90(cv2.warpPerspective(flat, to_view, (HEIGHT, WIDTH)), 1)
    ours = view(camera, image)
    seen = cv2.erode(ours.seen.astype(np.uint8), np.ones((9, 9))).astype(bool)[::8, ::8]
    size = (WIDTH // 8, HEIGHT // 8)
    small = [cv2.resize(i, size, interpolation=cv2.INTER_AREA) for i in (ours.image, theirs)]
    d = (small[0].astype(float) - small[1])[seen]
    assert np.sqrt(np.mean(d**2)) < 5  # DN
    assert abs(d.mean()) < 0.3


@needs(surround.FILES)
def test_neighbours_agree_under_one_reading_only():
    table = comparisons.compute("surround_readings").set_index("reading")
    ours, others = table.iloc[0], table.iloc[1:]
    assert ours.min() > 0.65
    assert np.all(others.max() < ours - 0.05)


@needs(surround.FILES)
def test_the_published_cameras_stand_around_a_car():
    table = comparisons.compute("surround_places").set_index("camera")
    assert table["height_cm"].between(50, 120).all()
    assert table.loc["left", "col_cm"] < table.loc["front", "col_cm"] < table.loc["right", "col_cm"]
    assert 150 < table.loc["right", "col_cm"] - table.loc["left", "col_cm"] < 220
    assert 350 < table.loc["back", "row_cm"] - table.loc["front", "row_cm"] < 500
    assert_allclose(table["ratio"], 1, atol=0.05)
    assert_allclose(table["angle_deg"], 90, atol=2)


@needs(surround.FILES)
def test_refinement_improves_corners_that_it_does_not_know():
    table = comparisons.compute("surround_refinements").set_index("refinement")
    published, held = table.loc[surround.AS_PUBLISHED], table.loc[surround.BEST]
    assert held["left_out_cm"] < 0.6 * published["misfit_cm"]
    assert held["moved_cm"] < published["misfit_cm"]
    assert table.loc["homographies", "moved_most_cm"] > 3 * held["moved_most_cm"]


def test_without_photographs_figures_and_sentences_remain(tmp_path):
    folder = str(tmp_path)
    for name in ("photographs", "ground", "enlarged", "misfit_vectors"):
        figure = getattr(surround_figures, name)(folder=folder)
        assert "make reference-data" in figure.axes[0].texts[0].get_text()
    overlaps, refinements = (
        comparisons.computed_or_stored(f"surround_{name}", folder=folder).table
        for name in ("overlaps", "refinements")
    )
    said = [
        sentences.grey_values(overlaps),
        sentences.fit(overlaps, refinements),
        sentences.frame(refinements),
        sentences.ghosts(overlaps),
    ]
    assert all("nan" not in sentence for sentence in said)
    assert f"{refinements['misfit_cm'][0]:.1f} cm apart (rms)" in said[1]


def test_the_index_has_the_licences():
    licences = {e.file: e.licence for e in data.index() if e.file.startswith(surround.FILES)}
    assert set(licences.values()) == {"MIT"}
    assert f"{surround.FILES}/LICENSE-MIT.txt" in licences
