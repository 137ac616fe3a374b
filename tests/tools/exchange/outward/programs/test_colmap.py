"""A model as COLMAP's own code reads it, and points where COLMAP projects them."""

import numpy as np
import pycolmap
import pytest

from acx4tools.exchange.outward import colmap

CORNER = 0.5  # of COLMAP's pixels


@pytest.fixture(scope="module")
def model(shown, tmp_path_factory):
    at = tmp_path_factory.mktemp("colmap")
    made = colmap.images(shown.found, shown.oriented)
    for name, text in made.files.items():
        (at / name).write_text(text)
    read = pycolmap.Reconstruction()
    read.read_text(str(at))
    return read, made


def test_colmap_projects_points_of_the_ground_into_every_image(shown, model, agrees):
    read, made = model
    assert read.num_images() == 12
    assert read.num_frames() == 6
    for image in read.images.values():
        x_c = image.cam_from_world() * shown.x_m[image.name]
        seen = read.cameras[image.camera_id].img_from_cam(np.asarray(x_c))
        left = made.lenses[shown.head[image.name]]
        agrees(seen - CORNER, shown.colrow[image.name], left)


def test_colmaps_rig_takes_points_of_the_reference_into_the_other_head(shown, model, agrees):
    read, made = model
    (rig,) = read.rigs.values()
    assert rig.num_sensors() == 2
    for sensor, pose in rig.non_ref_sensors.items():
        camera = read.cameras[sensor.id]
        head = shown.found.cameras[sensor.id - 1].name
        x_c = pose * (shown.x_r[head] * [1, -1, -1])
        seen = camera.img_from_cam(np.asarray(x_c))
        agrees(seen - CORNER, shown.colrow[shown.first_images()[head]], made.lenses[head])


def test_frames_have_the_pose_of_the_reference_where_it_took_no_image(shown):
    """The rig's pose is the trajectory's, whichever heads exposed."""
    lines = colmap.images(shown.found, shown.oriented).files["frames.txt"].splitlines()
    images = colmap.images(shown.found, shown.oriented).files["images.txt"].splitlines()
    pose_of = {line.split()[-1]: line.split()[1:8] for line in images if line}
    reference = [name for name, head in shown.head.items() if head == "LEFT"]
    assert [line.split()[2:9] for line in lines] == [pose_of[name] for name in reference]
