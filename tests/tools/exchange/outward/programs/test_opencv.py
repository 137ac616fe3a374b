"""The files as OpenCV reads them, and points where OpenCV projects them by what it read."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.geometry.camera import correct, xy_from_colrow
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from acx4tools.exchange.opencv import from_opencv
from acx4tools.exchange.outward import calibrated, opencv
from acx4tools.exchange.outward.calibrated import R_C_V


def read(text):
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    keys = ("camera_matrix", "distortion_coefficients", "R", "T")
    return {key: storage.getNode(key).mat() for key in keys}


@pytest.mark.parametrize("name", ["LEFT", "RIGHT"])
def test_opencv_projects_points_of_the_body_into_every_head(rig, name):
    """Points in the reference head's axes go through R and T; the refit's difference is all."""
    found = calibrated.read(rig)
    made = opencv.cameras(found)
    reference = found.cameras[0]
    camera = next(camera for camera in found.cameras if camera.name == name)
    x_b = (camera.T_b_c.R @ ahead(camera).T).T + camera.T_b_c.r
    x_r = (x_b - reference.T_b_c.r) @ reference.T_b_c.R @ R_C_V
    own = read(made.files[f"{name}.yaml"])
    turn = cv2.Rodrigues(own["R"])[0]
    seen = cv2.projectPoints(
        x_r, turn, own["T"], own["camera_matrix"], own["distortion_coefficients"]
    )[0][:, 0]
    wanted = project(camera, Pose(R=np.eye(3)[None], r=np.zeros((1, 3))), ahead(camera))
    apart = np.linalg.norm(seen - wanted, axis=1).max()
    assert apart <= 1.01 * made.lenses[name].largest_px
    assert apart < 0.05 + abs(camera.interior.b2) * camera.height_px / 2  # it has no skew


def ahead(camera):
    """Points all over the image, 100 m from the camera, in its axes."""
    half = 0.49 * camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-h, h, 9) for h in half)))
    return 100 * np.column_stack([x, y, np.full(81, -camera.interior.f)]) / camera.interior.f


def test_a_single_camera_has_no_other_head(single):
    made = opencv.cameras(calibrated.read(single))
    assert list(made.files) == ["CAM.yaml"]
    assert_allclose(read(made.files["CAM.yaml"])["R"], np.eye(3))
    assert not any("R and T" in sentence for sentence in made.assumed)


def test_a_camera_comes_back_from_its_file(shown):
    """To twice what the refit loses, and its digits."""
    made = opencv.cameras(shown.found)
    for camera in shown.found.cameras:
        own = read(made.files[f"{camera.name}.yaml"])
        size = {k: getattr(camera, k) for k in ("width_px", "height_px", "pixel_mm")}
        back, _ = from_opencv(
            own["camera_matrix"], own["distortion_coefficients"][0], name=camera.name, **size
        )
        colrow = shown.colrow[shown.first_images()[camera.name]]
        rays = [
            correct(c.interior, xy_from_colrow(c, colrow)) / c.interior.f for c in (camera, back)
        ]
        apart = np.linalg.norm(rays[0] - rays[1], axis=1).max() * camera.interior.f / 0.005
        assert apart <= 2.1 * made.lenses[camera.name].largest_px + 1e-6
