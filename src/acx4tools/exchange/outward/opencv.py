"""Cameras as OpenCV's file storage has them: ``cv::FileStorage``, YAML."""

from __future__ import annotations

import cv2
import numpy as np

from acx4lib.geometry.camera import Camera
from acx4lib.results.whole_files import file_stem
from acx4tools.exchange.outward import brown
from acx4tools.exchange.outward import calibrated as outward_calibrated
from acx4tools.exchange.outward.brown import Brown
from acx4tools.exchange.outward.calibrated import Calibrated, Relative
from acx4tools.exchange.outward.taken import BODY, SIGMA, Taken

ASSUMED = (
    "distortion_coefficients are k1, k2, p1, p2, k3, from the ideal to the measured point",
    "pixel (0, 0) is the centre of the top-left one; y is down and z ahead",
)
RIG = "R and T take a point from the axes of {} to those of the head: x = R x + T, m"


def cameras(calibrated: Calibrated) -> Taken:
    """Return a YAML file for every camera, with its place in the rig where there are several."""
    cameras = calibrated.cameras
    rig = outward_calibrated.to_first(calibrated.calibration)
    found = brown.of_all(calibrated)
    return Taken(
        files={
            f"{file_stem(camera.name)}.yaml": _text(camera, found[camera.name], one)
            for camera, one in zip(cameras, rig, strict=True)
        },
        lenses=brown.lenses(found),
        assumed=(*ASSUMED, *([RIG.format(cameras[0].name)] if rig[1:] else [])),
        left_out=(SIGMA, BODY),
    )


def _text(camera: Camera, lens: Brown, one: Relative) -> str:
    """Return the file of a camera, with the names of OpenCV's own examples of calibration."""
    T_h_r = one.T_v_r_h.inverse
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", camera.width_px)
    storage.write("image_height", camera.height_px)
    storage.write("camera_name", camera.name)
    hole, coefficients = lens.hole, [lens.k1, lens.k2, lens.p1, lens.p2, lens.k3]
    matrix = [[hole.fx, 0.0, hole.cx], [0.0, hole.fy, hole.cy], [0.0, 0.0, 1.0]]
    storage.write("camera_matrix", np.array(matrix))
    storage.write("distortion_coefficients", np.array([coefficients]))
    storage.write("R", np.ascontiguousarray(T_h_r.R))
    storage.write("T", np.ascontiguousarray(T_h_r.r[:, None]))
    return str(storage.releaseAndGetString())
