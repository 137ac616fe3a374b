"""The published rig of four fisheye cameras around a car."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.testing import assert_allclose

from acx4book.reference import comparisons, data
from acx4book.reference.surround import comparisons as surround
from acx4book.reference.surround import files, sentences
from acx4book.reference.surround import shown as surround_figures
from acx4book.reference.surround.cameras import fisheye_from_undistorted
from acx4book.reference.surround.views import view
from support.pictures.surround_rigs import HEIGHT, WIDTH
from support.reference_files import needs


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
    answer = sentences.answer(overlaps, refinements)
    assert f"fits to {refinements['misfit_cm'][0]:.1f} cm in the overlaps" in answer


def test_the_index_has_the_licences():
    licences = {e.file: e.licence for e in data.index() if e.file.startswith(surround.FILES)}
    assert set(licences.values()) == {"MIT"}
    assert f"{surround.FILES}/LICENSE-MIT.txt" in licences
