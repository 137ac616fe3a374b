"""Tie points of OPF, as Pix4D's own library reads them."""

import json
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pyopf.pointcloud import GlTFPointCloud

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.opf import reading
from support.projects import opf, scene


def test_tie_points_are_brought_and_met(tmp_path):
    brought = reading.read(opf.write(tmp_path / "p", tracks=True))
    points = brought.tables["heads/image_points.csv"]
    assert len(points["point"]) == 72 + 72  # marks, and as many matches of tie points
    assert points["point"][72:75] == ["t0", "t0", "t0"]
    assert points["image"][72:75] == ["one.jpg#0", "one.jpg#1", "two.jpg#10"]
    assert_allclose(points["col_px"][72], points["col_px"][0], atol=2e-4)  # in single precision
    said = next(one for one in brought.found if one.startswith("the calibrated tie points"))
    assert float(re.search(r"to ([\d.e-]+) px rms", said)[1]) < 0.02
    assert "sparse.gltf" in brought.sha256


def test_pix4d_s_library_reads_the_same(tmp_path):
    path = opf.write_tracks(tmp_path)
    (node,) = GlTFPointCloud.open(path).nodes
    assert node.matches.point_index_ranges[3] == (24, 8)
    assert [uid.int for uid in node.matches.camera_uids][:3] == [0, 1, 10]
    first = scene.seen(opf.cameras_on_map()[0], *own(0))
    assert_allclose(node.matches.image_points.pixelCoordinates[::8], first, atol=1e-4)


def own(i):
    """Return the centre of an exposure and the points."""
    block = scene.scene()
    return opf.centres(block)[i], block.points_enh


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["accessors"][0].update(count=10), "accessors.0: 120 bytes from 0 of 108"),
        (lambda d: d["accessors"][3].update(type="VEC3"), "must be 2 values of kind 'f'"),
        (lambda d: d["accessors"][1].update(count=8), "does not fit to its points and matches"),
        (lambda d: d["buffers"][2].update(uri="../x.bin"), "must lie below the project's folder"),
        (lambda d: d["buffers"][2].update(uri="none.bin"), "none.bin"),
        (lambda d: d["bufferViews"][1].update(byteOffset=-4), "must be complete"),
        (lambda d: d["nodes"][0].update(mesh=7), "meshes: 7 is missing; required"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path, change, message):
    folder = opf.write(tmp_path / "p", tracks=True)
    path = folder / "points" / "sparse.gltf"
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(FlightError, match=message):
        reading.read(folder)


def test_a_point_is_taken_once_in_an_image(tmp_path):
    folder = opf.write(tmp_path / "p", tracks=True)
    ids = np.zeros(72, dtype="<u4")  # all matches in one camera
    (folder / "points" / "cameraIds.bin").write_bytes(ids.tobytes())
    brought = reading.read(folder)
    assert len(brought.tables["heads/image_points.csv"]["point"]) == 72 + 9
    assert any(one.startswith("63 measurements of tie points") for one in brought.left_out)
