"""Metashape's lenses, held against OpenCV and their own inverses."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.exchange.programs.metashape.lens import Calibration

IDEAL = np.array([[0.3, 0.2], [-0.25, 0.1], [0.0, 0.0], [-0.3, -0.28], [0.1, -0.3]])
SIZE = {"width_px": 1280, "height_px": 960, "f": 1450.0, "cx": 5.0, "cy": -7.0}


def test_a_frame_camera_is_opencv_s_with_p1_and_p2_exchanged():
    others = {"k1": -0.05, "k2": 0.03, "k3": -0.01, "p1": 3e-4, "p2": -2e-4, "b1": 2.0}
    matrix = np.array([[1452.0, 0.0, 644.5], [0.0, 1450.0, 472.5], [0.0, 0.0, 1.0]])
    points = np.column_stack([IDEAL, np.ones(len(IDEAL))])
    coefficients = np.array([-0.05, 0.03, -2e-4, 3e-4, -0.01])
    zero = np.zeros(3)
    seen = cv2.projectPoints(points, zero, zero, matrix, coefficients)[0][:, 0]
    found = Calibration(type="frame", **SIZE, others=others).colrow(IDEAL)
    assert_allclose(found, seen, atol=1e-9)


def test_a_fisheye_without_distortion_is_opencv_s():
    matrix = np.array([[1450.0, 0.0, 644.5], [0.0, 1450.0, 472.5], [0.0, 0.0, 1.0]])
    points = np.column_stack([IDEAL, np.ones(len(IDEAL))])[:, None]
    zero = np.zeros(3)
    seen = cv2.fisheye.projectPoints(points, zero, zero, matrix, np.zeros(4))[0][:, 0]
    assert_allclose(Calibration(type="fisheye", **SIZE).colrow(IDEAL), seen, atol=1e-9)


@pytest.mark.parametrize("kind", ["frame", "fisheye"])
def test_every_coefficient_has_its_inverse(kind):
    others = {
        "k1": -0.05,
        "k2": 0.03,
        "k3": -0.01,
        "k4": 0.004,
        "p1": 3e-4,
        "p2": -2e-4,
        "p3": 0.1,
        "p4": -0.05,
        "b1": 2.0,
        "b2": -1.0,
    }
    lens = Calibration(type=kind, **SIZE, others=others)
    assert_allclose(lens.ideal(lens.colrow(IDEAL)), IDEAL, atol=1e-12)
    plain = Calibration(type=kind, **SIZE)
    for name in others:  # each of them moves something
        one = Calibration(type=kind, **SIZE, others={name: 0.1 if name[0] != "b" else 1.0})
        if name not in ("p3", "p4"):
            assert np.abs(one.colrow(IDEAL) - plain.colrow(IDEAL)).max() > 1e-3


def test_skew_is_b2_times_y():
    skewed = Calibration(type="frame", **SIZE, others={"b2": 3.0})
    moved = skewed.colrow(IDEAL) - Calibration(type="frame", **SIZE).colrow(IDEAL)
    assert_allclose(moved, np.stack([3.0 * IDEAL[:, 1], np.zeros(len(IDEAL))], axis=1))
