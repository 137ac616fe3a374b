import cv2
import numpy as np

from acx4tools.measuring.shown import SURVEYED, write


def test_every_picture_is_shown_with_its_points(whole, tmp_path):
    write([whole.outcome], tmp_path)
    files = sorted(path.name for path in (tmp_path / "calibration").iterdir())
    assert files == ["C1-04.jpg", "C2-04.jpg", "C4-04.jpg"]
    image = cv2.imread(str(tmp_path / "calibration" / "C4-04.jpg")).astype(int)
    assert max(image.shape) <= 1400
    coloured = np.ptp(image, axis=2) > 40
    rays = whole.outcome.matched.rays
    assert 15 < coloured.sum() / np.sum(rays.view == 2) < 130  # a dot has some 60, and its rim
    red = np.abs(image - SURVEYED).max(axis=2) < 40
    assert red.any()
