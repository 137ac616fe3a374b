"""Fisheye cameras around a car: simulated by OpenCV."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acx4book.reference.surround.cameras import (
    fisheye_from_undistorted,
    frame_from_undistorted,
    ghost_cm,
    image_from_frame,
    place,
    undistorted_from_frame,
)
from support.pictures import surround_rigs
from support.pictures.surround_rigs import HEIGHT, NAMES, WIDTH

on_ground = st.tuples(st.floats(0, WIDTH - 1), st.floats(0, HEIGHT - 1))


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
