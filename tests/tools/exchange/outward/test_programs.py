"""Exports to each program, read again by our own formulas of it."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pycolmap
import pyproj
import pytest
from numpy.testing import assert_allclose
from pyopf.io import load
from pyopf.resolve import resolve
from scipy.spatial.transform import Rotation

from acx4lib.errors import OutputError
from acx4lib.flight.settings import camera_of
from acx4lib.geometry.camera import correct, xy_from_colrow
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.frames import turn as frames_turn
from acx4lib.geometry.geodesy import GridSystem, MappingFrame
from acx4tools.exchange.metadata import Tags, lens_of
from acx4tools.exchange.opencv import from_opencv
from acx4tools.exchange.outward import brown, content, programs
from acx4tools.exchange.outward.content import R_C_V
from acx4tools.exchange.outward.programs import KINDS
from acx4tools.exchange.programs import colmap, micmac, opensfm
from acx4tools.exchange.programs import metashape as programs_metashape
from acx4tools.exchange.programs import opf as programs_opf
from acx4tools.exchange.trajectories import orientations as trajectories_orientations
from acx4tools.exchange.trajectories.orientations import Meaning

# --- A model as COLMAP's own code reads it, and points where COLMAP projects them ------------


CORNER = 0.5  # of COLMAP's pixels


@pytest.fixture(scope="module")
def model(shown, tmp_path_factory):
    at = tmp_path_factory.mktemp("colmap")
    made = KINDS["colmap"].oriented(shown.found, shown.oriented)
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
    lines = KINDS["colmap"].oriented(shown.found, shown.oriented).files["frames.txt"].splitlines()
    images = KINDS["colmap"].oriented(shown.found, shown.oriented).files["images.txt"].splitlines()
    pose_of = {line.split()[-1]: line.split()[1:8] for line in images if line}
    reference = [name for name, head in shown.head.items() if head == "LEFT"]
    assert [line.split()[2:9] for line in lines] == [pose_of[name] for name in reference]


# --- A chunk projected by the formulas of Metashape's manual, written anew here --------------


def projected(calibration, x_c, *, size=None):
    """The manual's frame camera; u, v from the outer corner, so that half a pixel is taken off."""
    width, height = size or (
        int(calibration.find("resolution").get(k)) for k in ("width", "height")
    )
    values = {
        one.tag: float(one.text) for one in calibration if one.tag in programs.METASHAPE_PARAMS
    }
    k1, k2, k3, p1, p2 = (values[k] for k in ("k1", "k2", "k3", "p1", "p2"))
    x, y = (x_c[:, :2] / x_c[:, 2:]).T
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y
    yd = y * radial + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y
    u = width * 0.5 + values["cx"] + xd * values["f"] + xd * values.get("b1", 0.0)
    u += yd * values.get("b2", 0.0)
    v = height * 0.5 + values["cy"] + yd * values["f"]
    return np.stack([u, v], axis=1) - 0.5


def matrix(element, shape):
    return np.array(element.text.split(), dtype=float).reshape(shape)


@pytest.fixture(scope="module")
def chunk(shown):
    made = programs._metashape_images(shown.found, shown.oriented)
    return ET.fromstring(made.files["chunk/cameras.xml"]).find("chunk"), made


def test_points_of_the_ground_are_projected_into_every_image(shown, chunk, agrees):
    """Through the ECEF frame: the component's transform, then the camera's."""
    root, made = chunk
    frame = shown.oriented.block.frame
    to_ecef = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        "+step +proj=cart +ellps=GRS80"
    )
    transform = root.find("components/component/transform")
    R, r = (matrix(transform.find(n), s) for n, s in (("rotation", (3, 3)), ("translation", 3)))
    assert transform.find("scale").text == "1.0"
    sensors = {one.get("id"): one for one in root.iter("sensor")}
    cameras = root.findall("cameras/camera")
    assert len(cameras) == 12
    for camera in cameras:
        sensor, name = sensors[camera.get("sensor_id")], camera.get("label")
        x_e = np.stack(to_ecef.transform(*frame.to_geographic(shown.x_m[name]).T), axis=1)
        T = matrix(camera.find("transform"), (4, 4))
        x_c = ((x_e - r) @ R - T[:3, 3]) @ T[:3, :3]
        adjusted = sensor.find("calibration[@class='adjusted']")
        agrees(projected(adjusted, x_c), shown.colrow[name], made.lenses[sensor.get("label")])


def test_the_rotation_of_a_slave_takes_its_axes_to_the_masters(shown):
    """Of rays: positions of heads have no place in a sensor."""
    text = programs._metashape_cameras(shown.found).files["chunk/cameras.xml"]
    master, slave = ET.fromstring(text).iter("sensor")
    assert (master.get("master_id"), slave.get("master_id")) == (None, "0")
    R = matrix(slave.find("rotation"), (3, 3))
    first, second = shown.found.cameras
    assert_allclose(
        R,
        np.diag([1, -1, -1]) @ first.T_b_c.R.T @ second.T_b_c.R @ np.diag([1, -1, -1]),
        atol=1e-12,
    )


def test_a_calibration_that_metashape_loads_says_the_same_as_the_sensor(shown, chunk, agrees):
    for camera in shown.found.cameras:
        text = programs._metashape_cameras(shown.found).files[f"{camera.name}.xml"]
        alone = ET.fromstring(text)
        size = tuple(int(alone.find(key).text) for key in ("width", "height"))
        x_c = shown.x_m[shown.first_images()[camera.name]]
        x_c = ahead_of(shown, camera.name, x_c)
        seen = projected(alone, x_c, size=size)
        wanted = shown.colrow[shown.first_images()[camera.name]]
        agrees(seen, wanted, chunk[1].lenses[camera.name])
        assert alone.find("projection").text == "frame"


def ahead_of(shown, head, x_m):
    i = shown.oriented.names.index(shown.first_images()[head])
    T = shown.oriented.T_m_c[i]
    return (x_m - T.r) @ T.R * [1, -1, -1]


def test_the_covariance_is_that_of_refitted_lenses(shown, chunk, rng):
    """Of many interior orientations drawn with the calibration's covariance."""
    sensor = next(chunk[0].iter("sensor"))
    names = sensor.find("covariance/params").text.split()
    cov = matrix(sensor.find("covariance/coeffs"), (len(names), len(names)))
    calibration, camera = shown.found.calibration, shown.found.cameras[0]
    own = calibration.layout.interior[0]
    drawn = rng.multivariate_normal(
        camera.interior.to_array(), calibration.cov[np.ix_(own, own)], size=400
    )
    fits = [brown.brown(camera.with_interior(type(camera.interior).from_array(d))) for d in drawn]
    values = {
        "f": [one.hole.fy for one in fits],
        "cx": [one.hole.cx for one in fits],
        "b1": [one.hole.fx - one.hole.fy for one in fits],
        "b2": [one.hole.skew for one in fits],
        "k1": [one.k1 for one in fits],
        "p1": [one.p2 for one in fits],
    }
    for name, scatter in values.items():
        k = names.index(name)
        assert np.std(scatter) == pytest.approx(np.sqrt(cov[k, k]), rel=0.15)  # 4 sigma


# --- micasense -------------------------------------------------------------------------------
#
# RigRelatives read as real pictures of the vendor have them: M^T takes rays into the head.


def tags_of(text):
    found, own = {}, {}
    for line in text.splitlines():
        if line.startswith("["):
            own = found[line.strip("[]")] = {}
        elif line:
            key, _, value = line.partition(" = ")
            own[key.removeprefix("Camera:")] = value
    return found


def numbers(text):
    return np.array(text.split(","), dtype=float)


def turn(axis, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j], R[k, k], R[k, j], R[j, k] = c, c, s, -s
    return R


@pytest.fixture(scope="module")
def made(shown):
    return KINDS["micasense"].cameras(shown.found)


def test_rays_of_the_reference_go_into_every_head_by_the_transpose(shown, made, agrees):
    """To where the head sees them, by its own focal length, principal point and distortion."""
    pixel_mm = shown.found.cameras[0].pixel_mm
    for head, own in tags_of(made.files["xmp_tags.txt"]).items():
        a, b, c = numbers(own["RigRelatives"])
        M = turn(0, a) @ turn(1, b) @ turn(2, c)
        x = (shown.x_r[head] - base(shown, head)) * [1, -1, -1] @ M
        x, y = (x[:, :2] / x[:, 2:]).T
        k1, k2, k3, p1, p2 = numbers(own["PerspectiveDistortion"])
        r2 = x**2 + y**2
        d = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        xd = x * d + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
        yd = y * d + 2 * p2 * x * y + p1 * (r2 + 2 * y**2)
        f, at = numbers(own["PerspectiveFocalLength"])[0], numbers(own["PrincipalPoint"])
        seen = (np.stack([xd, yd], axis=1) * f + at) / pixel_mm
        agrees(seen, shown.colrow[shown.first_images()[head]], made.lenses[head])


def base(shown, head):
    """Where the head is in the axes of the reference: rays know nothing of it."""
    first = shown.found.cameras[0].T_b_c
    other = next(c for c in shown.found.cameras if c.name == head).T_b_c
    return first.R.T @ (other.r - first.r)


def test_the_table_has_sigma_of_all_heads(made):
    reference, other = csv.DictReader(made.files["rig_relatives.csv"].splitlines())
    assert (reference["camera"], reference["rig_camera_index"]) == ("LEFT", "0")
    assert [float(reference[f"{k}_deg"]) for k in ("a", "b", "c", "sigma_a", "sigma_b")] == [
        0.0
    ] * 5
    assert all(1e-4 < float(other[f"sigma_{k}_deg"]) < 0.1 for k in "abc")
    said = numbers(tags_of(made.files["xmp_tags.txt"])["RIGHT"]["RigRelatives"])
    assert [float(other[f"{k}_deg"]) for k in "abc"] == pytest.approx(said.tolist(), abs=1e-6)


def test_the_reader_of_pictures_makes_the_cameras_of_the_tags(shown, made):
    """To twice what the refit loses: rays of points all over the image."""
    for camera in shown.found.cameras:
        own = tags_of(made.files["xmp_tags.txt"])[camera.name]
        picture = Tags(
            path=Path("a.tif"),
            width_px=camera.width_px,
            height_px=camera.height_px,
            samples=1,
            bits=16,
            exif={"FocalPlaneXResolution": 1 / camera.pixel_mm, "FocalPlaneResolutionUnit": 4},
            xmp={f"Camera:{key}": (value,) for key, value in own.items()},
            sha256="",
        )
        back = lens_of(picture, camera.name).camera
        colrow = shown.colrow[shown.first_images()[camera.name]]
        rays = [
            correct(c.interior, xy_from_colrow(c, colrow)) / c.interior.f for c in (camera, back)
        ]
        apart = np.linalg.norm(rays[0] - rays[1], axis=1).max() * camera.interior.f
        assert apart / camera.pixel_mm <= 2.1 * made.lenses[camera.name].largest_px + 1e-3


# --- orientations projected by MicMac's formulas, written anew here --------------------------


def vector(root, path):
    return np.array(root.find(path).text.split(), dtype=float)


def micmac_projected(files, name, x_m):
    outer = ET.fromstring(files[f"Ori-acx4/Orientation-{name}.xml"])
    inner = ET.fromstring(files[outer.find(".//FileInterne").text])
    R = np.stack([vector(outer, f".//{row}") for row in ("L1", "L2", "L3")])
    x_c = (x_m - vector(outer, ".//Centre")) @ R
    pixel = vector(inner, ".//PP") + vector(inner, ".//F") * x_c[:, :2] / x_c[:, 2:]
    x, y = (pixel - vector(inner, ".//CDist")).T
    r2 = x**2 + y**2
    c = [float(one.text) for one in inner.findall(".//CoeffDist")]
    radial = sum(value * r2**power for power, value in enumerate(c, start=1))
    P1, P2, b1, b2 = (vector(inner, f".//{key}")[0] for key in ("P1", "P2", "b1", "b2"))
    dx = radial * x + P1 * (2 * x**2 + r2) + 2 * P2 * x * y + b1 * x + b2 * y
    dy = radial * y + P2 * (2 * y**2 + r2) + 2 * P1 * x * y
    return pixel + np.stack([dx, dy], axis=1)


def test_points_of_the_ground_are_projected_into_every_image_of_micmac(shown, agrees):
    made = KINDS["micmac"].oriented(shown.found, shown.oriented)
    for name, head in shown.head.items():
        agrees(
            micmac_projected(made.files, name, shown.x_m[name]),
            shown.colrow[name],
            made.lenses[head],
        )


def test_b1_has_a_place(shown):
    """So that no more is lost than by a lens of two focal lengths."""
    assert all(
        left.largest_px < 0.01 for left in KINDS["micmac"].cameras(shown.found).lenses.values()
    )


# --- opencv ----------------------------------------------------------------------------------
#
# The files as OpenCV reads them, and points where OpenCV projects them by what it read.


def read(text):
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    keys = ("camera_matrix", "distortion_coefficients", "R", "T")
    return {key: storage.getNode(key).mat() for key in keys}


@pytest.mark.parametrize("name", ["LEFT", "RIGHT"])
def test_opencv_projects_points_of_the_body_into_every_head(rig, name):
    """Points in the reference head's axes go through R and T; the refit's difference is all."""
    found = content.read(rig)
    made = KINDS["opencv"].cameras(found)
    reference = found.cameras[0]
    camera = next(camera for camera in found.cameras if camera.name == name)
    x_b = (camera.T_b_c.R @ ahead(camera).T).T + camera.T_b_c.r
    x_r = (x_b - reference.T_b_c.r) @ reference.T_b_c.R @ R_C_V
    own = read(made.files[f"{name}.yaml"])
    turn = cv2.Rodrigues(own["R"])[0]
    seen = cv2.projectPoints(
        x_r, turn, own["T"], own["camera_matrix"], own["distortion_coefficients"]
    )[0][:, 0]
    wanted = project(camera, Pose(R=np.eye(3)[None], r=np.zeros((1, 3))), ahead(camera))
    apart = np.linalg.norm(seen - wanted, axis=1).max()
    assert apart <= 1.01 * made.lenses[name].largest_px
    assert apart < 0.05 + abs(camera.interior.b2) * camera.height_px / 2  # it has no skew


def ahead(camera):
    """Points all over the image, 100 m from the camera, in its axes."""
    half = 0.49 * camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-h, h, 9) for h in half)))
    return 100 * np.column_stack([x, y, np.full(81, -camera.interior.f)]) / camera.interior.f


def test_a_single_camera_has_no_other_head(single):
    made = KINDS["opencv"].cameras(content.read(single))
    assert list(made.files) == ["CAM.yaml"]
    assert_allclose(read(made.files["CAM.yaml"])["R"], np.eye(3))
    assert not any("R and T" in sentence for sentence in made.assumed)


def test_a_camera_comes_back_from_its_file(shown):
    """To twice what the refit loses, and its digits."""
    made = KINDS["opencv"].cameras(shown.found)
    for camera in shown.found.cameras:
        own = read(made.files[f"{camera.name}.yaml"])
        size = {k: getattr(camera, k) for k in ("width_px", "height_px", "pixel_mm")}
        back, _ = from_opencv(
            own["camera_matrix"], own["distortion_coefficients"][0], name=camera.name, **size
        )
        colrow = shown.colrow[shown.first_images()[camera.name]]
        rays = [
            correct(c.interior, xy_from_colrow(c, colrow)) / c.interior.f for c in (camera, back)
        ]
        apart = np.linalg.norm(rays[0] - rays[1], axis=1).max() * camera.interior.f / 0.005
        assert apart <= 2.1 * made.lenses[camera.name].largest_px + 1e-6


# --- opensfm ---------------------------------------------------------------------------------
#
# A reconstruction projected by the formulas of OpenSfM's documentation, written anew here.


def opensfm_projected(camera, x_c):
    """https://opensfm.org/docs/geometry.html, brown, and from normalised to pixel coordinates."""
    x, y = (x_c[:, :2] / x_c[:, 2:]).T
    r2 = x**2 + y**2
    k1, k2, k3, p1, p2 = (camera[k] for k in ("k1", "k2", "k3", "p1", "p2"))
    d = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = d * x + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    yd = d * y + 2 * p2 * x * y + p1 * (r2 + 2 * y**2)
    u = camera["focal_x"] * xd + camera["c_x"]
    v = camera["focal_y"] * yd + camera["c_y"]
    size = max(camera["width"], camera["height"])
    middle = np.array([camera["width"] - 1, camera["height"] - 1]) / 2
    return np.stack([u, v], axis=1) * size + middle


def moved(pose, x):
    return Rotation.from_rotvec(pose["rotation"]).apply(x) + pose["translation"]


def test_points_of_the_ground_are_projected_into_every_image_of_opensfm(shown, agrees):
    made = KINDS["opensfm"].oriented(shown.found, shown.oriented)
    (model,) = json.loads(made.files["reconstruction.json"])
    assert len(model["shots"]) == 12
    for name, shot in model["shots"].items():
        seen = opensfm_projected(model["cameras"][shot["camera"]], moved(shot, shown.x_m[name]))
        agrees(seen, shown.colrow[name], made.lenses[shot["camera"]])


def test_the_rig_takes_points_of_the_reference_into_the_other_head(shown, agrees):
    made = KINDS["opensfm"].cameras(shown.found)
    rig = json.loads(made.files["rig_cameras.json"])
    models = json.loads(made.files["cameras.json"])
    assert_allclose(rig["LEFT"]["rotation"] + rig["LEFT"]["translation"], 0.0)
    for head, name in shown.first_images().items():
        seen = opensfm_projected(models[head], moved(rig[head], shown.x_r[head] * [1, -1, -1]))
        agrees(seen, shown.colrow[name], made.lenses[head])


def test_the_reference_is_where_positions_are_zero(shown):
    """PROJ's topocentric axes there have the camera where the translation says."""
    made = KINDS["opensfm"].oriented(shown.found, shown.oriented)
    (model,) = json.loads(made.files["reconstruction.json"])
    at = model["reference_lla"]
    assert json.loads(made.files["reference_lla.json"]) == at
    there = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=GRS80 +lon_0={longitude!r} "
        "+lat_0={latitude!r} +h_0={altitude!r} +step +inv +proj=cart +ellps=GRS80 +step "
        "+proj=utm +zone=22 +south +ellps=GRS80".format(**at)
    )
    name, shot = next(iter(model["shots"].items()))
    centre = -Rotation.from_rotvec(shot["rotation"]).inv().apply(shot["translation"])
    enh = shown.oriented.block.frame.to_grid(shown.oriented.T_m_c.r[:1])[0]
    assert name == shown.oriented.names[0]
    assert_allclose(there.transform(*centre), enh, atol=1e-5)


# --- A project by the words of OPF's specification, and as Pix4D's own library reads it ------


def rotation(angles):
    a, b, c = angles
    return turn(0, a) @ turn(1, b) @ turn(2, c)


def opf_projected(internals, x_v):
    """Perspective internals of Pix4D, of points with y down and z ahead; library's pixels."""
    x, y = (x_v[:, :2] / x_v[:, 2:]).T
    r2 = x**2 + y**2
    (R1, R2, R3), (T1, T2) = internals["radial_distortion"], internals["tangential_distortion"]
    d = 1 + R1 * r2 + R2 * r2**2 + R3 * r2**3
    xd = x * d + 2 * T1 * x * y + T2 * (r2 + 2 * x**2)
    yd = y * d + 2 * T2 * x * y + T1 * (r2 + 2 * y**2)
    f, at = internals["focal_length_px"], internals["principal_point_px"]
    return np.stack([xd, yd], axis=1) * f + at - 0.5


@pytest.fixture(scope="module")
def opf_made(shown):
    return programs._opf_images(shown.found, shown.oriented)


@pytest.fixture(scope="module")
def files(opf_made):
    return {name: json.loads(text) for name, text in opf_made.files.items()}


def test_rig_relatives_take_a_point_of_the_head_to_the_reference(shown, opf_made, files, agrees):
    """T_s = T_r + R_r T_rel and R_s = R_r R_rel, axes right, down, front."""
    first, second = files["calibrated-cameras.json"]["sensors"]
    assert "rig_relatives" not in first
    own = second["rig_relatives"]
    x_v = shown.x_r["RIGHT"] * [1, -1, -1]
    x_s = (x_v - own["translation"]) @ rotation(own["rotation_angles_deg"])
    seen = opf_projected(second["internals"], x_s)
    agrees(seen, shown.colrow[shown.first_images()["RIGHT"]], opf_made.lenses["RIGHT"])


def test_rig_relatives_have_their_sigma(files):
    own = files["input-cameras.json"]["sensors"][1]["rig_relatives"]
    calibrated = files["calibrated-cameras.json"]["sensors"][1]["rig_relatives"]
    assert_allclose(own["rotation"]["angles_deg"], calibrated["rotation_angles_deg"])
    assert all(1e-4 < sigma < 0.1 for sigma in own["rotation"]["sigmas_deg"])
    assert all(0.01 < sigma < 0.2 for sigma in own["translation"]["sigmas_m"])


def test_cameras_are_oriented_in_the_grid(shown, files):
    """R = Rx Ry Rz from right, top, back to the CRS, positions shifted to its canonical form."""
    scene = files["scene-reference-frame.json"]
    shift = np.array(scene["base_to_canonical"]["shift"])
    names = {one["id"]: one["uri"] for one in files["camera-list.json"]["cameras"]}
    frame, T = shown.oriented.block.frame, shown.oriented.T_m_c
    enh = frame.to_grid(T.r)
    for k, camera in enumerate(files["calibrated-cameras.json"]["cameras"]):
        assert names[camera["id"]] == shown.oriented.names[k]
        assert_allclose(np.array(camera["position"]) - shift, enh[k], atol=1e-6)
        assert np.abs(camera["position"][:2]).max() < 1000
        R = frame.grid_axes(T.r[k : k + 1])[0] @ T.R[k]
        assert_allclose(rotation(camera["orientation_deg"]), R, atol=1e-12)
    assert scene["crs"]["definition"] == "EPSG:31982"


def test_the_specifications_own_library_reads_the_project(opf_made, tmp_path):
    for name, text in opf_made.files.items():
        (tmp_path / name).write_text(text)
    project = resolve(load(str(tmp_path / "project.opf")))
    assert len(project.camera_list.cameras) == 12
    assert len(project.calibration.calibrated_cameras.cameras) == 12
    sensors = project.input_cameras.sensors
    assert [sensor.name for sensor in sensors] == ["LEFT", "RIGHT"]
    assert sensors[1].rig_relatives.rotation.sigmas_deg.min() > 0


@pytest.mark.parametrize("crs", ["EPSG:25833+7837", "+proj=utm +zone=33 +ellps=GRS80 +units=m"])
def test_the_crs_has_two_dimensions_as_heights_are_ellipsoidal(shown, crs):
    """A code or WKT, of which PROJ makes the same grid."""
    block = shown.oriented.block
    frame = MappingFrame(grid=GridSystem(crs=crs), origin=np.array([13.0, 50.0]))
    elsewhere = replace(shown.oriented, block=replace(block, frame=frame))
    made = programs._opf_images(shown.found, elsewhere)
    text = json.loads(made.files["scene-reference-frame.json"])["crs"]["definition"]
    found = pyproj.CRS.from_user_input(text)
    assert not found.is_compound
    assert found.to_wkt().startswith("PROJCRS")
    assert_allclose(
        pyproj.Proj(found)(13.0, 50.0), pyproj.Proj("EPSG:25833")(13.0, 50.0), atol=1e-4
    )


# --- the .cam and the external parameters, projected by the formulas that Pix4D publishes ----


def cam(text):
    pairs = [line.split() for line in text.splitlines()[1:] if not line.startswith("#")]
    return {key: float(value) for key, value in pairs}


def test_points_ahead_are_projected_into_every_head(shown, agrees):
    made = KINDS["pix4d"].cameras(shown.found)
    for camera in shown.found.cameras:
        own, name = cam(made.files[f"{camera.name}.cam"]), shown.first_images()[camera.name]
        T = shown.oriented.T_m_c[shown.oriented.names.index(name)]
        x_c = (shown.x_m[name] - T.r) @ T.R * [1, -1, -1]
        x, y = (x_c[:, :2] / x_c[:, 2:]).T
        r2 = x**2 + y**2
        d = 1 + own["K1"] * r2 + own["K2"] * r2**2 + own["K3"] * r2**3
        xd = x * d + 2 * own["T1"] * x * y + own["T2"] * (r2 + 2 * x**2)
        yd = y * d + 2 * own["T2"] * x * y + own["T1"] * (r2 + 2 * y**2)
        mm = np.stack([own["F"] * xd + own["Px"], own["F"] * yd + own["Py"]], axis=1)
        agrees(mm / camera.pixel_mm - 0.5, shown.colrow[name], made.lenses[camera.name])


def test_external_parameters_are_those_of_the_table(shown):
    text = KINDS["pix4d"].oriented(shown.found, shown.oriented).files[programs.PIX4D_EXTERNAL]
    head, *rows = text.splitlines()
    assert head == "imageName X Y Z Omega Phi Kappa"
    table = content.in_grid(shown.oriented)
    assert [row.split()[0] for row in rows] == list(table["image"])
    values = np.array([row.split()[1:] for row in rows], dtype=float)
    np.testing.assert_allclose(values, table.iloc[:, 1:7], atol=1e-6)


def with_a_blank(oriented):
    """Return orientations of which the first image is called "a b"."""
    images = replace(oriented.block.images, names=("a b", *oriented.block.images.names[1:]))
    return replace(oriented, block=replace(oriented.block, images=images))


def test_names_with_blanks_have_no_place_there(shown):
    with pytest.raises(OutputError, match="'a b': a name with blanks has no place"):
        KINDS["pix4d"].oriented(shown.found, with_a_blank(shown.oriented))


def test_names_that_colmap_cuts_at_their_blank_are_told(shown, tmp_path):
    assert not any(
        "blank" in line for line in written_for_colmap(shown, shown.oriented, tmp_path).left_out
    )
    taken = written_for_colmap(shown, with_a_blank(shown.oriented), tmp_path)
    assert taken.left_out[-1].startswith("what follows a blank in the names of 1 image: COLMAP")
    assert "'a' of 'a b'" in taken.left_out[-1]
    read = pycolmap.Reconstruction(tmp_path)
    assert "a" in [image.name for image in read.images.values()]


def written_for_colmap(shown, oriented, folder):
    """Return what is written for COLMAP, which is in the folder then."""
    taken = KINDS["colmap"].oriented(shown.found, oriented)
    for name, text in taken.files.items():
        (folder / name).write_text(text)
    return taken


# --- What is exported is read back by the importers: lenses, rigs, orientations, to rounding


CRS = "EPSG:31982"


def from_opk(folder):
    meaning = Meaning(crs=CRS)
    options = trajectories_orientations.TableOptions(of="camera")
    return trajectories_orientations.read(folder / "orientations.csv", meaning, options)


READERS = {
    "metashape": lambda folder: programs_metashape.read(
        folder / "chunk" / "cameras.xml", orientations="adjusted"
    ),
    "colmap": lambda folder: colmap.read(folder, pixel_um=5.0),
    "opensfm": lambda folder: opensfm.read(folder, orientations="adjusted", crs=CRS, pixel_um=5.0),
    "opf": lambda folder: programs_opf.read(folder / "project.opf", orientations="adjusted"),
    "micmac": lambda folder: micmac.read(folder, pixel_um=5.0),
    "opk": from_opk,
    "rph": from_opk,
}

LENSES = ("metashape", "colmap", "opensfm", "opf", "micmac")
ORIENTED = ("metashape", "opensfm", "opf", "opk")
RIGS = ("colmap", "opf")


@pytest.fixture(scope="module")
def brought(shown, tmp_path_factory):
    """What the readers bring of every export, and the exports."""
    found = {}
    for kind, read in READERS.items():
        at = tmp_path_factory.mktemp(kind)
        made = KINDS[kind].oriented(shown.found, shown.oriented)
        for name, text in made.files.items():
            (at / name).parent.mkdir(parents=True, exist_ok=True)
            (at / name).write_text(text)
        found[kind] = read(at), made
    return found


def cameras(brought):
    tables = brought.settings["cameras"]
    return {name: camera_of(name, table) for name, table in tables.items()}


@pytest.mark.parametrize("kind", LENSES)
def test_lenses_come_back(shown, brought, kind):
    """Twice refitted, so that at most twice is lost what is said."""
    read, made = brought[kind]
    for own, back in zip(shown.found.cameras, cameras(read).values(), strict=True):
        nodes = shown.colrow[shown.first_images()[own.name]]
        rays = [correct(c.interior, xy_from_colrow(c, nodes)) / c.interior.f for c in (own, back)]
        apart = np.linalg.norm(rays[0] - rays[1], axis=1).max() * own.interior.f / own.pixel_mm
        assert apart <= 2.1 * made.lenses[own.name].largest_px + 1e-4


@pytest.mark.parametrize("kind", RIGS)
def test_rotations_of_the_heads_come_back(shown, brought, kind):
    read, _ = brought[kind]
    first, second = (camera.T_b_c.R for camera in cameras(read).values())
    own = [camera.T_b_c.R for camera in shown.found.cameras]
    assert_allclose(first.T @ second, own[0].T @ own[1], atol=2e-9)


def test_roll_pitch_and_heading_are_a_trajectory_of_turned_cameras(shown, brought):
    """As export.md says: mount_kappa_deg = -90, the lever arm zero."""
    read, _ = brought["rph"]
    rows = read.tables["calibration/trajectory.csv"]
    lonlath = np.stack([rows[k] for k in ("lon_deg", "lat_deg", "height_m")], axis=1)
    rph = np.stack([rows[k] for k in ("roll_deg", "pitch_deg", "heading_deg")], axis=1)
    T = shown.oriented.block.frame.pose_from_geographic(
        lonlath.astype(float), np.radians(rph.astype(float))
    )
    assert_allclose(T.R @ frames_turn(2, -np.pi / 2), shown.oriented.T_m_c.R, atol=1e-9)
    assert_allclose(T.r, shown.oriented.T_m_c.r, atol=2e-4)


@pytest.mark.parametrize("kind", ORIENTED)
def test_orientations_come_back(shown, brought, kind):
    """Body times mounting of what was imported is the camera's pose.

    In a grid the base of a rig is not scaled like the map, and its verticals are not parallel:
    0.0002 of 0.6 m, and 0.6 m of the earth's radius.
    """
    metres, radians = (2e-4, 1e-7) if kind == "opf" else (2e-5, 1e-9)
    read, _ = brought[kind]
    folder = next(n.rpartition("/")[0] for n in read.tables if n.endswith("trajectory.csv"))
    rows = read.tables[f"{folder}/trajectory.csv"]
    T_m_b = shown.oriented.block.frame.pose_from_grid(
        np.stack([rows[k] for k in ("east_m", "north_m", "height_m")], axis=1).astype(float),
        np.radians(
            np.stack([rows[k] for k in ("omega_deg", "phi_deg", "kappa_deg")], axis=1).astype(float)
        ),
    )
    where = {name: i for i, name in enumerate(rows["exposure"])}
    images = read.tables.get(f"{folder}/images.csv")
    for k, name in enumerate(shown.oriented.names):
        exposure, T_b_c = name, None
        if images is not None:
            row = list(images["image"]).index(name)
            exposure = images["exposure"][row]
            T_b_c = cameras(read)[images["camera"][row]].T_b_c
        T = T_m_b[where[exposure]]
        T = T if T_b_c is None else T @ T_b_c
        assert_allclose(T.r, shown.oriented.T_m_c.r[k], atol=metres)
        assert_allclose(T.R, shown.oriented.T_m_c.R[k], atol=radians)
