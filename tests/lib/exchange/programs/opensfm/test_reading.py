"""Projects of OpenSfM become flights; its own points prove the conventions."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4lib.exchange.programs.colmap.text import TEXT
from acx4lib.exchange.programs.opensfm import reading
from acx4lib.exchange.programs.shared import oriented
from acx4lib.exchange.programs.shared.cameras import FLIP
from acx4lib.exchange.safe import opened
from acx4lib.geometry import frames
from support.reference_files import needs

SAMPLE = "formats/opensfm/OpenSfM_example_meshed.json"
COLMAP = "formats/colmap/txt/images.txt"
COLMAPS = ("cameras", "images", "points3D")
CONTROL = {
    "points": [
        {
            "id": "1",
            "position": {"latitude": -25.4, "longitude": -49.3, "altitude": 905.0},
            "observations": [{"shot_id": "0.jpg", "projection": [0.0, 0.0]}],
        }
    ]
}


def test_own_points_are_met_by_what_was_imported(tmp_path, written):
    images = reading.images_of(written.write(tmp_path / "p"))
    assert len(images.colrow) == 20
    assert oriented.misfits(images).max() < 0.02  # px, what the refit of the lens leaves


def test_a_project_becomes_a_flight(tmp_path, written):
    brought = reading.read(written.write(tmp_path / "p"), orientations="adjusted", crs="EPSG:31982")
    assert brought.settings["crs"] == "EPSG:31982"
    camera = brought.settings["cameras"]["m"]
    assert (camera["width_px"], camera["pixel_um"], camera["focal_mm"]) == (400, 5.0, 1.8)
    points = brought.tables["calibration/image_points.csv"]
    u, v = written.seen(written.MODEL, written.turned(0), written.CENTRES[0])[0]
    first = [points["col_px"][0], points["row_px"][0]]
    assert_allclose(first, [400 * u + 199.5, 400 * v + 149.5], atol=6e-5)
    assert brought.tables["calibration/trajectory.csv"]["height_m"][0] == pytest.approx(
        960, abs=1e-3
    )
    assert "20 measurements" in brought.found[0]
    assert "(20 measurements)" in brought.found[1]


def test_orientations_are_left_out_unless_asked_for(tmp_path, written):
    brought = reading.read(written.write(tmp_path / "p"))
    assert "calibration/trajectory.csv" not in brought.tables
    assert brought.left_out == (
        "4 measured positions: without attitudes they are no trajectory",
        "4 adjusted orientations (--orientations adjusted)",
    )


def test_tie_points_with_names_of_control_points_are_renamed(tmp_path, written):
    folder = written.write(tmp_path / "p", ground_control_points=CONTROL)
    brought = reading.read(folder)
    points = brought.tables["calibration/image_points.csv"]["point"]
    assert points[:3] == ["1", "track 0", "track 1"]
    assert brought.tables["control_points.csv"]["height_m"] == [905.0]


def test_rigs_are_heads_with_their_places_in_the_rig(tmp_path, written):
    ids = {"0.jpg": "left", "1.jpg": "right"}
    pose = {"rotation": [0, 0, 0], "translation": [0, 0, 0]}
    whole = written.reconstruction(
        rig_instances={"i": pose | {"rig_camera_ids": ids}},
        rig_cameras={"left": pose, "right": pose | {"translation": [-0.1, 0.2, 0.0]}},
    )
    brought = reading.read(written.write(tmp_path / "p", whole), orientations="adjusted")
    assert set(brought.settings["cameras"]) == {"left", "right", "m"}
    right = brought.settings["cameras"]["right"]
    assert (right["lever_x_m"], right["lever_y_m"]) == (0.1, 0.2)  # y of the rig is down
    assert brought.tables["heads/images.csv"]["exposure"] == ["i", "i", "2.jpg", "3.jpg"]
    assert brought.tables["heads/trajectory.csv"]["exposure"] == ["i", "2.jpg", "3.jpg"]


def test_initial_cameras_are_those_before_the_adjustment(tmp_path, written):
    model = written.MODEL | {"focal_x": 1.0, "focal_y": 1.0}
    folder = written.write(tmp_path / "p", camera_models={"m": model})
    assert reading.read(folder, camera="initial").settings["cameras"]["m"]["focal_mm"] == 2.0
    assert reading.read(folder).settings["cameras"]["m"]["focal_mm"] == 1.8


def test_cameras_alone_are_read(tmp_path, written):
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"m": written.MODEL}))
    brought = reading.read(path)
    assert list(brought.settings["cameras"]) == ["m"]
    assert not brought.tables


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda w: w.pop("shots"), r"0: 'shots' is missing"),
        (lambda w: w["shots"].clear(), r"0.shots: has no shot; must have one at least"),
        (lambda w: w["shots"]["0.jpg"].update(camera="n"), r"'n' is missing"),
        (
            lambda w: w["shots"]["0.jpg"].update(rotation=[1, 2]),
            r"rotation: \[1, 2\]; must be a list of 3",
        ),
        (lambda w: w["shots"]["0.jpg"].update(rotation=[1e9, 0, 0]), "must be a rotation vector"),
        (
            lambda w: w["shots"].update({"=1": w["shots"].pop("0.jpg")}),
            "image: '=1' would be computed",
        ),
        (lambda w: w["cameras"]["m"].update(k1=-3.0), "expected a ray for every pixel"),
    ],
)
def test_wrong_reconstructions_are_refused(tmp_path, change, message, written):
    whole = written.reconstruction()
    change(whole)
    folder = tmp_path / "p"
    folder.mkdir()
    (folder / "reconstruction.json").write_text(json.dumps([whole]))
    with pytest.raises(FlightError, match=message):
        reading.read(folder)


def test_orientations_that_are_nowhere_are_refused(tmp_path, written):
    whole = written.reconstruction()
    del whole["reference_lla"]
    with pytest.raises(FlightError, match="shots: has no measured position: the adjusted"):
        reading.read(written.write(tmp_path / "p", whole), orientations="adjusted")


@needs("formats")
def test_opensfm_and_colmap_agree_on_the_same_pictures():
    """Two adjustments of 11 pictures, one with a lens, the other without distortion."""
    folder, images = data.path(COLMAP).parent, reading.images_of(data.path(SAMPLE))
    model = TEXT.read({name: opened.read(folder / f"{name}.txt") for name in COLMAPS})
    T_u_v = {image.name: image.pose.inverse for image in model.images}
    other = [T_u_v[name] for name in images.images]
    R_u_w = np.array([one.R @ FLIP @ R.T for one, R in zip(other, images.T_w_c.R, strict=True)])
    mean = frames.mean_rotation(R_u_w)
    apart = np.degrees(np.linalg.norm(frames.log(mean.T @ R_u_w), axis=1))
    assert np.median(apart) < 0.1
    assert apart.max() < 0.7
    a = np.array([one.r for one in other])
    a, b = a - a.mean(axis=0), (images.T_w_c.r - images.T_w_c.r.mean(axis=0)) @ mean.T
    off = np.linalg.norm(a - b * np.sum(a * b) / np.sum(b * b), axis=1)
    assert off.max() < 0.02 * np.sqrt(np.mean(np.sum(a**2, axis=1)))


@needs("opensfm_berlin")
def test_points_of_a_real_project_are_met_as_its_description_says(tmp_path):
    """Its README has a median of 2.44e-4, a 95th percentile of 1.20e-3 of the longer side."""
    for name in ("reconstruction.json", "tracks.csv"):
        stem, _, ending = name.partition(".")
        (tmp_path / name).symlink_to(data.path(f"opensfm_berlin/{stem}_example.{ending}").resolve())
    apart = oriented.misfits(reading.images_of(tmp_path)) / 3264
    assert len(apart) == 3082
    assert_allclose(np.quantile(apart, [0.5, 0.95]), [2.44e-4, 1.20e-3], rtol=0.02)
