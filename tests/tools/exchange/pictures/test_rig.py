"""Heads, their reference, and what their three angles mean."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acx4tools.exchange.pictures import rig
from acx4tools.exchange.pictures.tags import read
from support.pictures import tagged


def head_of(tmp_path, properties):
    return rig.head_of(read(tagged.write(tmp_path / "a.tif", properties)))


def test_a_head_has_its_number_and_band_as_name(tmp_path):
    head = head_of(
        tmp_path, tagged.micasense(3, relatives=(0.1, 0.2, 0.3), reference=1, band="NIR")
    )
    assert (head.name, head.index, head.reference) == ("4 NIR", 3, 1)
    assert head.relatives_deg == (0.1, 0.2, 0.3)
    assert head_of(tmp_path, {}).name == "RedEdge-T"


def test_the_angles_turn_a_ray_of_the_head_into_the_reference():
    """Camera axes of the library have y up and z back, those of the angles y down and z ahead."""
    angles, ray = (3.0, -5.0, 8.0), np.array([0.2, -0.3, 1.0])
    down = np.diag([1, -1, -1])
    turned = Rotation.from_euler("XYZ", angles, degrees=True).apply(ray)
    assert down @ rig.rotation(angles) @ down @ ray == pytest.approx(turned)


def test_the_reference_leads_wherever_it_stands():
    heads = [
        rig.Head(name=str(i), index=i, reference=r, relatives_deg=a)
        for i, r, a in ((0, 1, (0.1, 0, 0)), (1, 1, (0, 0, 0)), (2, 1, (0, 0.2, 0)))
    ]
    assert [head.name for head in rig.in_order(heads)] == ["1", "0", "2"]
    assert "1" in rig.sentence(heads)


def test_a_camera_looks_down_with_the_top_of_its_image_ahead():
    ahead, up = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])
    assert pytest.approx(ahead) == rig.DOWN @ [0, 1, 0]
    assert pytest.approx(up) == rig.DOWN @ [0, 0, 1]
    assert np.linalg.det(rig.DOWN) == pytest.approx(1)
