"""Files of OpenSfM: tracks of every version, rigs in both ways, what is missing or cut off."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.opensfm import project
from acx4lib.exchange.safe import json_tree
from acx4lib.exchange.safe.opened import Opened


def tree(value):
    return json_tree.tree(Opened(file="r.json", data=json.dumps(value).encode()))


def tracks_of(text):
    return project.tracks(Opened(file="tracks.csv", data=text.encode()))


@pytest.mark.parametrize("header", [*project.VERSIONS, ""])
def test_tracks_of_all_versions_are_read(header, written):
    images, names, points = tracks_of(written.tracks(header=header))
    assert images[:2] == ["0.jpg", "0.jpg"]
    assert names[:6] == ["0", "1", "2", "3", "4", "0"]
    assert_allclose(points[:5], written.seen(written.MODEL, written.turned(0), written.CENTRES[0]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("OPENSFM_TRACKS_VERSION_v9\n", "tracks.csv:1: version: 'OPENSFM_TRACKS_VERSION_v9'"),
        ("a\t1\t2\t0.1\n", "tracks.csv:1: x, y: is missing, the line has 4 cells"),
        ("a\t1\t2\t0.1\tnan\n", "tracks.csv:1: x, y: 'nan'; must be a finite number"),
    ],
)
def test_wrong_tracks_are_refused(text, message):
    with pytest.raises(FlightError, match=message):
        tracks_of(text)


def test_the_larger_reconstruction_is_taken_and_the_other_counted(tmp_path, written):
    small = written.reconstruction(shots={"x": written.shot(np.eye(3), np.zeros(3))})
    path = tmp_path / "reconstruction.json"
    path.write_text(json.dumps([small, written.reconstruction()]))
    root, left = project.reconstruction(project.project_of(path))
    assert len(project.shots(root, None).names) == len(written.CENTRES)
    assert left == ("1 more reconstructions with 1 shots: each has a frame of its own",)


def test_positions_with_the_dilution_of_none_are_none(written):
    whole = written.reconstruction()
    whole["shots"]["0.jpg"]["gps_dop"] = 999999.0
    shots = project.shots(tree(whole), None)
    assert np.isnan(shots.gps[0]).all()
    assert_allclose(shots.gps[1:], written.CENTRES[1:])
    assert_allclose(shots.T_w_v.r, written.CENTRES, atol=1e-12)


def test_rigs_are_read_from_instances_and_from_assignments(written):
    ids = {"0.jpg": "left", "1.jpg": "right"}
    pose = {"rotation": [0, 0, 0], "translation": [0, 0, 0]}
    new = tree(written.reconstruction(rig_instances={"i": pose | {"rig_camera_ids": ids}}))
    old = tree([[["0.jpg", "left"], ["1.jpg", "right"]], [["2.jpg", "left"]]])
    for shots in (project.shots(new, None), project.shots(tree(written.reconstruction()), old)):
        assert shots.heads == ("left", "right", "m", "m")
        assert shots.instances[0] == shots.instances[1]
        assert shots.instances[2:] == ("2.jpg", "3.jpg")


def test_a_rig_cameras_place_is_the_inverse_of_what_the_file_has():
    mounts = project.rig_mounts(
        tree({"left": {"rotation": [0, 0, np.pi / 2], "translation": [1, 2, 3]}})
    )
    R = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert_allclose(mounts["left"].R, R.T, atol=1e-12)
    assert_allclose(mounts["left"].r, -R.T @ [1, 2, 3], atol=1e-12)


def test_a_folder_without_files_of_opensfm_is_refused(tmp_path):
    with pytest.raises(FlightError, match=r"folder: has no file of OpenSfM; must hold"):
        project.project_of(tmp_path)


def test_the_folder_of_an_odm_project_is_entered(tmp_path, written):
    written.write(tmp_path / "opensfm")
    assert project.project_of(tmp_path).folder == tmp_path / "opensfm"
