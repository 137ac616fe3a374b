"""Exports to each program, read again by our own formulas of it."""

import csv
from pathlib import Path
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pycolmap
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4files.exchange.metadata import Tags, lens_of
from acx4files.exchange.outward import content, programs
from acx4files.exchange.outward.content import R_C_V
from acx4files.exchange.outward.programs import KINDS
from acx4files.exchange.programs import colmap
from acx4files.exchange.programs import metashape as programs_metashape
from acx4files.exchange.trajectories import orientations as trajectories_orientations
from acx4files.flight.settings import camera_of
from acx4lib.geometry.camera import correct, xy_from_colrow
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.frames import turn as frames_turn

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


# --- A chunk projected by the formulas of Metashape's manual, written anew here --------------


def projected(calibration, x_c, *, size=None):
    """The manual's frame camera; u, v from the outer corner, so that half a pixel is taken off."""
    width, height = size or (
        int(calibration.find("resolution").get(k)) for k in ("width", "height")
    )
    values = {one.tag: float(one.text) for one in calibration if one.tag in PARAMS}
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


PARAMS = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "p1", "p2")


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


# --- What is exported is read back by the importers: lenses, rigs, orientations, to rounding


CRS = "EPSG:31982"


def from_opk(folder):
    path = folder / "orientations.csv"
    return trajectories_orientations.read(path, of="camera", crs=CRS)


READERS = {
    "metashape": lambda folder: programs_metashape.read(
        folder / "chunk" / "cameras.xml", orientations="adjusted"
    ),
    "colmap": lambda folder: colmap.read(folder, pixel_um=5.0),
    "opk": from_opk,
    "rph": from_opk,
}

LENSES = ("metashape", "colmap")
ORIENTED = ("metashape", "opk")


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


def test_rotations_of_the_heads_come_back(shown, brought):
    read, _ = brought["colmap"]
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
    """Body times mounting of what was imported is the camera's pose."""
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
        assert_allclose(T.r, shown.oriented.T_m_c.r[k], atol=2e-5)
        assert_allclose(T.R, shown.oriented.T_m_c.R[k], atol=1e-9)
