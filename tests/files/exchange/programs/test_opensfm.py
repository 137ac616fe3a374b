"""Projects of OpenSfM become flights; its own points prove the conventions."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4files.exchange.programs import colmap
from acx4files.exchange.programs import opensfm as reading
from acx4files.exchange.project import misfits
from acx4lib.errors import FlightError
from acx4lib.geometry import frames
from acx4lib.geometry.geodesy import GridSystem
from support.helpers import needs
from support.projects import opensfm as written

SAMPLE = "formats/opensfm/OpenSfM_example_meshed.json"
COLMAP = "formats/colmap/txt/images.txt"
ODM = "formats/orthority/odm_opensfm_reconstruction.json"
CONTROL = {
    "points": [
        {
            "id": "1",
            "position": {"latitude": -25.4, "longitude": -49.3, "altitude": 905.0},
            "observations": [{"shot_id": "0.jpg", "projection": [0.0, 0.0]}],
        }
    ]
}


def apart(found):
    """Return the distances of tracks from projected points, px, of those that have a place."""
    cameras = {name: lens.refitted(name).camera for name, lens in found.lenses.items()}
    seen = found.proofs[0].measured
    known = np.flatnonzero(np.isfinite(seen.x_w[seen.point_idx]).all(axis=1))
    image, point = seen.image_idx[known], seen.point_idx[known]
    names = np.array(found.images.cameras)[image]
    T_w_c = found.images.T_w_c[image]
    return misfits(cameras, names, T_w_c, seen.x_w[point], seen.colrow[known])


def test_own_points_are_met_by_what_was_imported(tmp_path):
    off = apart(reading.read_project(written.write(tmp_path / "p")))
    assert len(off) == 20
    assert off.max() < 0.02  # px, what the refit of the lens leaves


def test_a_project_becomes_a_flight(tmp_path):
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
    assert "20 measurements of 5 points" in brought.found
    assert any("(20 measurements)" in one for one in brought.found)


def test_orientations_are_left_out_unless_asked_for(tmp_path):
    brought = reading.read(written.write(tmp_path / "p"))
    assert "calibration/trajectory.csv" not in brought.tables
    assert brought.left_out == (
        "4 measured positions: without attitudes they are no trajectory",
        "4 adjusted orientations (--orientations adjusted)",
    )


def test_tie_points_with_names_of_control_points_are_renamed(tmp_path):
    folder = written.write(tmp_path / "p", ground_control_points=CONTROL)
    brought = reading.read(folder)
    points = brought.tables["calibration/image_points.csv"]["point"]
    assert points[:3] == ["1", "track 0", "track 1"]
    assert brought.tables["control_points.csv"]["height_m"] == [905.0]


def test_rigs_are_heads_with_their_places_in_the_rig(tmp_path):
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


@needs("formats")
def test_opensfm_and_colmap_agree_on_the_same_pictures():
    """Two adjustments of 11 pictures, one with a lens, the other without distortion."""
    ours = reading.read_project(data.path(SAMPLE)).images
    theirs = colmap.read_project(data.path(COLMAP).parent).images
    T_u_c = theirs.T_w_c[[theirs.names.index(name) for name in ours.names]]
    R_u_w = T_u_c.R @ np.swapaxes(ours.T_w_c.R, -1, -2)
    mean = frames.mean_rotation(R_u_w)
    angles = np.degrees(np.linalg.norm(frames.log(mean.T @ R_u_w), axis=1))
    assert np.median(angles) < 0.1
    assert angles.max() < 0.7
    a, b = T_u_c.r - T_u_c.r.mean(axis=0), (ours.T_w_c.r - ours.T_w_c.r.mean(axis=0)) @ mean.T
    off = np.linalg.norm(a - b * np.sum(a * b) / np.sum(b * b), axis=1)
    assert off.max() < 0.02 * np.sqrt(np.mean(np.sum(a**2, axis=1)))


@needs("opensfm_berlin")
def test_points_of_a_real_project_are_met_as_its_description_says(tmp_path):
    """Its README has a median of 2.44e-4, a 95th percentile of 1.20e-3 of the longer side."""
    for name in ("reconstruction.json", "tracks.csv"):
        stem, _, ending = name.partition(".")
        (tmp_path / name).symlink_to(data.path(f"opensfm_berlin/{stem}_example.{ending}").resolve())
    off = apart(reading.read_project(tmp_path)) / 3264
    assert len(off) == 3082
    # 2.5 % for the refit, which leaves 0.1 px rms
    assert_allclose(np.quantile(off, [0.5, 0.95]), [2.44e-4, 1.20e-3], rtol=0.025)


@needs("formats/orthority")
def test_odms_reconstruction_gives_the_orientations_that_another_program_found():
    """Its table has omega, phi, kappa of the same shots, to a thousandth."""
    with pytest.raises(FlightError, match=r"differs by 4 px at most, .*; --allow 4.2 takes it so"):
        reading.read(data.path(ODM))
    brought = reading.read(data.path(ODM), orientations="adjusted", allow=5.0)
    table = brought.tables["calibration/trajectory.csv"]
    lines = data.path("formats/orthority/io_odm_xyz_opk.csv").read_text().splitlines()[1:]
    for line in lines:
        name, *rest = line.replace("'", " ").split()
        k = table["exposure"].index(name)
        names = ("east_m", "north_m", "height_m", "omega_deg", "phi_deg", "kappa_deg")
        got = [table[column][k] for column in names]
        assert_allclose(got, [float(one) for one in rest[:6]], atol=6e-4)


def test_axes_of_utm_are_recognised_and_brought_back(tmp_path):
    """Convergence there is 0.99 degrees: 0.5 m at the outermost camera."""
    whole, grid = written.reconstruction(), GridSystem(crs="EPSG:32722", heights="ellipsoidal")
    plain = reading.read(written.write(tmp_path / "p", whole), orientations="adjusted")
    before = plain.tables["calibration/trajectory.csv"]
    enh = np.stack([before[name] for name in ("east_m", "north_m", "height_m")], axis=1)
    opk = np.radians([before[name] for name in ("omega_deg", "phi_deg", "kappa_deg")]).T
    origin = grid.grid_from_lonlat(np.array([[-49.3, -25.4]]))[0]
    for one, at, angles in zip(whole["shots"].values(), enh, opk, strict=True):
        R_v_w = (frames.rotation_from_opk(angles) @ written.DOWN).T
        placed = written.shot(R_v_w, at - np.append(origin, 0.0))
        one.update(rotation=placed["rotation"], translation=placed["translation"])
    (tmp_path / "p" / "reconstruction.json").write_text(json.dumps([whole]))
    after = reading.read(tmp_path / "p", orientations="adjusted")
    assert any("have the axes of UTM, as ODM writes them" in one for one in after.assumed)
    table = after.tables["calibration/trajectory.csv"]
    for name, values in before.items():
        if name != "exposure":
            assert_allclose(table[name], values, atol=1e-5)


def test_a_list_of_odm_is_the_same_as_the_json(tmp_path):
    listed = "WGS84\n-49.3 -25.4 905.0 199.5 149.5 0.jpg 1\n-49.3 -25.4 905 1 2 x.jpg 1\n"
    folder = written.write(tmp_path / "a")
    (folder / "gcp_list.txt").write_text(listed)
    json_of = reading.read(written.write(tmp_path / "b", ground_control_points=CONTROL))
    list_of = reading.read(folder)
    assert (
        list_of.tables["calibration/image_points.csv"]
        == (json_of.tables["calibration/image_points.csv"])
    )
    control, other = (one.tables["control_points.csv"] for one in (json_of, list_of))
    for name in ("east_m", "north_m", "height_m"):
        assert_allclose(control[name], other[name], atol=1e-4)
    assert any("in images that were not oriented" in one for one in list_of.left_out)


def test_the_middle_of_the_image_and_the_focal_length_are_in_pixels(tmp_path):
    size = {"width": 600, "height": 400}
    two = {"projection_type": "radial", "focal_x": 1, "focal_y": 2, "c_x": 0.01, "c_y": 0.1}
    shots = {name: {"camera": name, "rotation": [0] * 3, "translation": [0] * 3} for name in "ab"}
    whole = {"cameras": {"a": {"focal": 0.9, **size}, "b": {**two, **size}}, "shots": shots}
    folder = written.write(tmp_path / "p", whole)
    (folder / "tracks.csv").unlink()
    a, b = (one.hole for one in reading.read_project(folder).lenses.values())
    assert (a.fx, a.cx, a.cy) == (540.0, 299.5, 199.5)
    assert (b.fx, b.fy, b.cx, b.cy) == (600.0, 1200.0, 305.5, 259.5)
