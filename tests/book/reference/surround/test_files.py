"""Files of the published rig."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference.surround import files
from support.pictures import surround_rigs
from support.pictures.surround_rigs import HEIGHT, WIDTH


@pytest.mark.parametrize("turns", range(4))
def test_views_are_turned_as_pictures_are(turns):
    size = (HEIGHT, WIDTH) if turns % 2 == 0 else (WIDTH, HEIGHT)
    picture = np.arange(WIDTH * HEIGHT).reshape(size)
    frame = np.rot90(picture, turns)
    for x, y in ((0, 0), (17, 5), (size[1] - 1, size[0] - 1)):
        col, row, one = files.quarter_turn(turns) @ [x, y, 1]
        assert one == 1
        assert frame[int(row), int(col)] == picture[y, x]


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
