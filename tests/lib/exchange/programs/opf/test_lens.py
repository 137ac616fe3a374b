"""OPF's lenses, held against OpenCV and the formulas of the specification."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.opf.lens import internals
from acx4lib.exchange.safe import json_tree
from acx4lib.exchange.safe.opened import Opened

IDEAL = np.array([[0.3, 0.2], [-0.25, 0.1], [1e-9, 0.0], [-0.3, -0.28], [0.1, -0.3]])
PERSPECTIVE = """{"type": "perspective", "principal_point_px": [640, 480],
"focal_length_px": 1450, "radial_distortion": [-0.05, 0.03, -0.01],
"tangential_distortion": [3e-4, -2e-4]}"""
FISHEYE = """{"type": "fisheye", "principal_point_px": [640, 480],
"affine": [1674.33, 0.4, -0.3, 1670.1], "is_symmetric_affine": false,
"polynomial": [0.0, 1.0, 0.0152646, -0.161096], "is_p0_zero": true}"""


def lens(text):
    return internals(json_tree.tree(Opened(file="i.json", data=text.encode())))


def test_a_perspective_lens_is_opencv_s():
    matrix = np.array([[1450.0, 0.0, 639.5], [0.0, 1450.0, 479.5], [0.0, 0.0, 1.0]])
    points, zero = np.column_stack([IDEAL, np.ones(len(IDEAL))]), np.zeros(3)
    coefficients = np.array([-0.05, 0.03, 3e-4, -2e-4, -0.01])
    seen = cv2.projectPoints(points, zero, zero, matrix, coefficients)[0][:, 0]
    assert_allclose(lens(PERSPECTIVE).colrow(IDEAL), seen, atol=1e-9)


def test_a_fisheye_counts_angles_in_right_angles():
    """Pix4D's page on internal camera parameters, written out."""
    r = np.hypot(*IDEAL.T)
    t = 2 / np.pi * np.arctan(r)
    rho = t + 0.0152646 * t**2 - 0.161096 * t**3
    x, y = (rho / r * IDEAL.T).tolist()
    x, y = np.array(x), np.array(y)
    expected = np.stack([1674.33 * x + 0.4 * y + 640, -0.3 * x + 1670.1 * y + 480], axis=1) - 0.5
    assert_allclose(lens(FISHEYE).colrow(IDEAL), expected, atol=1e-8)


def test_a_fisheye_s_focal_length_is_that_of_its_maker():
    """A Sequoia has a lens of 3.98 mm and pixels of 3.75 um."""
    assert lens(FISHEYE).hole.fx * 0.00375 == pytest.approx(3.98, abs=0.03)


@pytest.mark.parametrize("text", [PERSPECTIVE, FISHEYE])
def test_every_lens_has_its_inverse(text):
    found = lens(text)
    assert_allclose(found.ideal(found.colrow(IDEAL)), IDEAL, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"fisheye"', '"spherical"', r"i\.json:1: type: 'spherical'; must be one of perspective"),
        ("[0.0, 1.0,", "[0.1, 1.0,", r"i\.json:3: polynomial: .* must be 0, a positive number"),
        ("1674.33", "-1674.33", r"i\.json:2: affine: .* positive c and f"),
        ("[640, 480]", "[640]", "principal_point_px: .* must be a list of 2 values"),
    ],
)
def test_what_is_no_lens_is_told_with_its_place(old, new, message):
    with pytest.raises(FlightError, match=message):
        lens(FISHEYE.replace(old, new))
