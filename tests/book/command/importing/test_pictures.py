"""``acx4 import pictures``, ``check``, ``run`` and ``render`` of nothing but pictures."""

import numpy as np
import pytest
import tifffile
from scipy.spatial.transform import Rotation

from acx4lib.flight import reader
from acx4lib.results import folder
from acx4lib.results.read_back import read_relative_orientation
from acx4lib.synthetic_image.frame import head_pose
from support.pictures import tagged

TRUE = ((0, 0, 0), (0.2, -0.3, 0.5), (-0.4, 0.1, -0.2), (0.1, 0.5, 0.3))
BANDS = tuple((np.cos(a), np.sin(a)) for a in np.radians([0, 30, 60, 90]))
"""Neighbours see similar things; the first and the last have nothing in common."""

STATED = tuple((a + 0.15, b - 0.1, c + 0.05) for a, b, c in TRUE[1:])


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Four heads at one exposure, in two folders, whose stated angles are off."""
    folder = tmp_path_factory.mktemp("pictures")
    stated = ((0, 0, 0), *STATED)
    for k, grey in enumerate(tagged.pictures_of(TRUE, BANDS)):
        said = tagged.micasense(k, relatives=stated[k], band="abcd"[k])
        place = folder / ("Red" if k < 2 else "Blue") / f"IMG_0007_{k + 1}.tif"
        tagged.write(place, said, pixels=grey)
    return folder


def test_a_folder_of_pictures_becomes_a_flight_that_is_checked(tmp_path, acx4):
    for k in range(2):
        said = tagged.micasense(k, relatives=(0, 0.1 * k, 0), band="ab"[k])
        tagged.write(tmp_path / "pictures" / f"IMG_0007_{k + 1}.tif", said)
    flight = tmp_path / "flight"
    status, said, wrong = acx4("import", "pictures", tmp_path / "pictures", "--out", flight)
    assert (status, wrong) == (0, "")
    assert "assumed: RigRelatives" in said
    assert "still to do" not in said
    status, said, _ = acx4("check", flight)
    assert status == 0
    assert "2: 1 a, 2 b" in said
    assert "# pictures of MicaSense RedEdge-T" in (flight / "import.md").read_text("utf-8")


def test_a_broken_picture_is_one_line(tmp_path, acx4):
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff")
    status, _, wrong = acx4("import", "pictures", tmp_path, "--out", tmp_path / "flight")
    assert status == 2
    assert "a.jpg:1: file: " in wrong
    assert not (tmp_path / "flight").exists()


def test_pictures_alone_turn_the_heads_and_become_a_stack(acx4, pictures, tmp_path):
    """The truth to a third of a pixel; the stated angles are a whole one off."""
    flight, results, images = (tmp_path / name for name in ("flight", "results", "images"))
    assert acx4("import", "pictures", pictures, "--out", flight)[0] == 0
    options = ("--stages", "heads,synthetic", "--numbers-only", "--results", results)
    status, said, _ = acx4("run", flight, *options)
    assert status == 0
    assert "heads: skipped, nothing is measured in block heads" in said
    found = read_relative_orientation(
        folder.read(results), "synthetic/refined", reader.read(flight).cameras
    )
    flip = np.diag([1, -1, -1])
    for k, angles in enumerate(TRUE):
        R = flip @ head_pose(found, k).R @ flip
        true = Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()
        turned = Rotation.from_matrix(R.T @ true).as_rotvec(degrees=True)
        # what a band sees of the other landscape does not average out
        assert np.abs(turned).max() < 0.05
    options = ("--results", results, "--out", images, "--blend", "stack")
    assert acx4("render", flight, *options)[0] == 0
    stack = tifffile.imread(images / "IMG_0007.tif")
    assert stack.shape == (240, 320, 4)
    likeness = np.corrcoef(stack[20:-20, 20:-20].reshape(-1, 4).astype(float).T)
    assert np.abs(likeness - np.array(BANDS) @ np.transpose(BANDS)).max() < 0.12
