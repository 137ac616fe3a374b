"""Files of cameras, alone or with oriented images, for other programs: a section for each.

`KINDS` has them by the names of ``acx4 export --to``. Layouts and formulas are those of each
program's documentation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pyproj
from scipy.spatial.transform import Rotation

from acx4files.exchange.outward import brown, content
from acx4files.exchange.outward.brown import CORNER, Brown
from acx4files.exchange.outward.content import (
    BODY,
    R_C_V,
    SIGMA,
    Calibrated,
    Oriented,
    Relative,
    Taken,
    add_numbers,
    as_xml,
    lines,
    numbers,
    to_first,
)
from acx4files.flight.settings import SIGMAS, camera_toml
from acx4files.results.whole_files import file_stem
from acx4lib.calibration.estimates import parameters
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import rotation_enu_to_ecef
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.shown import count as counted


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of export.

    Attributes
    ----------
    cameras : callable or None
        Makes the files of the cameras; None where the kind has orientations alone.
    oriented : callable or None
        Makes the files of cameras with oriented images; None where the kind has no place for them.
    heads : bool
        Whether it is for several heads only.
    on_map : bool
        Whether its orientations need a place on the Earth.
    """

    cameras: Callable[[Calibrated], Taken] | None = None
    oriented: Callable[[Calibrated, Oriented], Taken] | None = None
    heads: bool = False
    on_map: bool = False


# --- Cameras as flight.toml declares them, for the next flight


FILE = "cameras.toml"

ASSUMED = (
    "the tables take the place of those of the same names in flight.toml of a new flight",
    "lever_sigma_m and mount_sigma_deg are comments: without # they make the mounting an "
    "observation of the next calibration",
)
FRAME = (
    "{} is a synthetic camera, whose mount angles in flight.toml also define the frame of its "
    "images: where images are rendered anew, keep the old angles"
)


def _toml_cameras(calibrated: Calibrated) -> Taken:
    """Return the tables ``[cameras.NAME]`` with calibrated values, sigma as comments."""
    synthetic, remarks = calibrated.flight.synthetic, list(ASSUMED)
    if synthetic is not None and synthetic.camera in [c.name for c in calibrated.cameras]:
        remarks.append(FRAME.format(synthetic.camera))
    return Taken(
        files={FILE: "\n".join(_tables(calibrated))},
        assumed=tuple(remarks),
        left_out=("correlations: they are in covariance.csv of the results",),
    )


def _tables(calibrated: Calibrated) -> Iterator[str]:
    listed = parameters(calibrated.calibration)
    for k, camera in enumerate(calibrated.cameras):
        yield camera_toml(camera).rstrip("\n")
        for key, sigma in zip(SIGMAS, _mount_sigmas(calibrated, k), strict=True):
            yield f"# {key} = {sigma.tolist()}"
        of_camera = [p for p in listed if p.camera == camera.name]
        yield from (f"# sigma of {p.name}: {p.sigma:.3g} {p.unit}" for p in of_camera)
        yield ""


def _mount_sigmas(calibrated: Calibrated, k: int) -> tuple[Array, Array]:
    """Return sigma along and about the body's axes, m and degrees; rounded to four digits."""
    calibration = calibrated.calibration
    columns = calibration.layout.mount[k]
    J = np.zeros((6, calibration.n_columns + 1))  # the last column is of what is held
    J[:3, columns[:3]] = np.eye(3)
    J[3:, columns[3:]] = np.degrees(calibration.cameras[k].T_b_c.R)
    sigma = sigmas(propagate(J[:, :-1], calibration.cov))
    rounded = np.array([float(f"{component:.4g}") for component in sigma])
    return rounded[:3], rounded[3:]


# --- Cameras as OpenCV's file storage has them: ``cv::FileStorage``, YAML


OPENCV_ASSUMED = (
    "distortion_coefficients are k1, k2, p1, p2, k3, from the ideal to the measured point",
    "pixel (0, 0) is the centre of the top-left one; y is down and z ahead",
)
OPENCV_RIG = "R and T take a point from the axes of {} to those of the head: x = R x + T, m"


def _opencv_cameras(calibrated: Calibrated) -> Taken:
    """Return a YAML file for every camera, with its place in the rig where there are several."""
    cameras, rig = calibrated.cameras, to_first(calibrated.calibration)
    lenses = brown.all_nearest(cameras, "plain")
    return Taken(
        files={
            f"{file_stem(camera.name)}.yaml": _opencv_text(camera, lenses[camera.name], head)
            for camera, head in zip(cameras, rig, strict=True)
        },
        lenses=brown.left_of(lenses),
        assumed=(*OPENCV_ASSUMED, *([OPENCV_RIG.format(cameras[0].name)] if rig[1:] else [])),
        left_out=(SIGMA, BODY),
    )


def _opencv_text(camera: Camera, lens: Brown, head: Relative) -> str:
    """Return the file of a camera, with the names of OpenCV's own examples of calibration."""
    hole, T_h_r = lens.hole, head.T_v_r_h.inverse
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", camera.width_px)
    storage.write("image_height", camera.height_px)
    storage.write("camera_name", camera.name)
    matrix = [[hole.fx, 0.0, hole.cx], [0.0, hole.fy, hole.cy], [0.0, 0.0, 1.0]]
    storage.write("camera_matrix", np.array(matrix))
    storage.write("distortion_coefficients", lens.coefficients[None])
    storage.write("R", np.ascontiguousarray(T_h_r.R))
    storage.write("T", np.ascontiguousarray(T_h_r.r[:, None]))
    return str(storage.releaseAndGetString())


# --- The tags that MicaSense writes into the metadata of every head's pictures
#
# Names and units: https://support.pix4d.com/hc/en-us/articles/360016450032, the namespace
# ``http://pix4d.com/camera/1.0``.


MICASENSE_ASSUMED = (
    "RigRelatives are three angles a, b, c, degrees: Rx(a) Ry(b) Rz(c) takes a ray of the head to "
    "one of {}, x right, y down, z ahead; its transpose takes a ray of {} to the head",
    "PrincipalPoint and PerspectiveFocalLength in mm; PerspectiveDistortion is k1, k2, k3, p1, p2 "
    "of OpenCV",
    "PrincipalPoint counts from the centre of the top-left pixel, as acx4 import pictures reads "
    "it; that the vendor does not mean its corner, half a pixel away, is not confirmed",
)
MICASENSE_POSITIONS = "positions of the heads: RigRelatives are rotations only"

MICASENSE_HEADER = "camera,rig_camera_index,a_deg,b_deg,c_deg,sigma_a_deg,sigma_b_deg,sigma_c_deg"


def _micasense_cameras(calibrated: Calibrated) -> Taken:
    """Return a text of XMP tags for every head, and a table of all RigRelatives with sigma."""
    lenses = brown.all_nearest(calibrated.cameras, "square")
    table, tags = [MICASENSE_HEADER], list[str]()
    for k, head in enumerate(to_first(calibrated.calibration)):
        camera = calibrated.cameras[k]
        angles = np.degrees(head.T_v_r_h.opk) + 0.0  # no negative zeros
        quoted = f'"{camera.name.replace(chr(34), chr(34) * 2)}"'
        with_sigma = (f"{value:.6f}" for value in (*angles, *np.degrees(head.sigma_opk)))
        table.append(",".join([quoted, str(k), *with_sigma]))
        lens, mm = lenses[camera.name], camera.pixel_mm
        k1, k2, p1, p2, k3 = lens.coefficients
        tags += [
            f"[{camera.name}]",
            "Camera:ModelType = perspective",
            f"Camera:PrincipalPoint = {_micasense_listed(lens.hole.cx * mm, lens.hole.cy * mm)}",
            f"Camera:PerspectiveFocalLength = {_micasense_listed(lens.hole.fx * mm)}",
            "Camera:PerspectiveFocalLengthUnits = mm",
            f"Camera:PerspectiveDistortion = {_micasense_listed(k1, k2, k3, p1, p2)}",
            f"Camera:RigCameraIndex = {k}",
            f"Camera:RigRelatives = {_micasense_listed(*angles.tolist())}",
            "Camera:RigRelativesReferenceRigCameraIndex = 0",
            "",
        ]
    first = calibrated.cameras[0].name
    return Taken(
        files={"rig_relatives.csv": lines(table), "xmp_tags.txt": lines(tags)},
        lenses=brown.left_of(lenses),
        assumed=(MICASENSE_ASSUMED[0].format(first, first), *MICASENSE_ASSUMED[1:]),
        left_out=(MICASENSE_POSITIONS, BODY),
    )


def _micasense_listed(*values: float) -> str:
    return ",".join(f"{value:.9g}" for value in values)


# --- COLMAP: cameras.txt and rigs.txt; with images a whole model, as text
#
# Layouts: https://colmap.github.io/format.html. Rotations are quaternions w, x, y, z of axes with
# y down and z ahead; pixel (0, 0) is the outer corner of the top-left one.


COLMAP_ASSUMED = (
    "FULL_OPENCV: fx, fy, cx, cy, k1, k2, p1, p2, k3, and zeros; pixel (0, 0) is the outer corner "
    "of the top-left one",
    "sensor_from_rig takes a point from the axes of {} to those of the camera, m, y down, z ahead",
)
COLMAP_CUT = (
    "what follows a blank in the names of {}: COLMAP reads images.txt up to it, {} of {}; "
    "rename them before they are matched with pictures"
)
COLMAP_WORLD = "the world is Cartesian, m: east, north, up at {}"


def _colmap_cameras(calibrated: Calibrated) -> Taken:
    """Return cameras.txt and rigs.txt; the first camera is the reference of the rig."""
    lenses = brown.all_nearest(calibrated.cameras, "plain")
    rig = to_first(calibrated.calibration)
    listed, rig_line = [], f"1 {len(rig)} CAMERA 1"
    for i, (camera, head) in enumerate(zip(calibrated.cameras, rig, strict=True), start=1):
        hole, coefficients = lenses[camera.name].hole, lenses[camera.name].coefficients
        pinhole = (hole.fx, hole.fy, hole.cx + CORNER, hole.cy + CORNER)
        values = numbers([*pinhole, *coefficients, 0.0, 0.0, 0.0])
        listed.append(f"{i} FULL_OPENCV {camera.width_px} {camera.height_px} {values}")
        if i > 1:
            rig_line += f" CAMERA {i} 1 {_colmap_pose(head.T_v_r_h.inverse)}"
    return Taken(
        files={"cameras.txt": lines(listed), "rigs.txt": lines([rig_line])},
        lenses=brown.left_of(lenses),
        assumed=(COLMAP_ASSUMED[0], COLMAP_ASSUMED[1].format(calibrated.cameras[0].name)),
        left_out=(SIGMA, BODY),
    )


def _colmap_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return a model with oriented images, and without points."""
    alone, block = _colmap_cameras(calibrated), oriented.block
    names = [camera.name for camera in calibrated.cameras]
    number = [names.index(block.cameras[k].name) + 1 for k in block.images.camera_idx]
    T_m_r = block.trajectory.T_m_b @ calibrated.cameras[0].T_b_c
    frames, images = [], []  # a line for each exposure with its images; two lines for each image
    for exposure in np.unique(block.images.exposure_idx):
        taken = np.flatnonzero(block.images.exposure_idx == exposure)
        data = "".join(f" CAMERA {number[i]} {i + 1}" for i in taken)
        pose = _colmap_pose(_colmap_from_world(T_m_r[exposure]))
        frames.append(f"{exposure + 1} 1 {pose} {len(taken)}{data}")
    for i, name in enumerate(oriented.names):
        pose = _colmap_pose(_colmap_from_world(oriented.T_m_c[i]))
        images += [f"{i + 1} {pose} {number[i]} {name}", ""]
    left_out = [SIGMA]
    if cut := [name for name in oriented.names if " " in name]:
        said = (counted(len(cut), "image"), repr(cut[0].split(" ")[0]), repr(cut[0]))
        left_out.append(COLMAP_CUT.format(*said))
    model = {"frames.txt": lines(frames), "images.txt": lines(images)}
    return replace(
        alone,
        files={**alone.files, **model, "points3D.txt": "# no points\n"},
        assumed=(*alone.assumed, COLMAP_WORLD.format(oriented.origin)),
        left_out=tuple(left_out),
    )


def _colmap_from_world(T_m_c: Pose) -> Pose:
    return (T_m_c @ Pose(R=R_C_V, r=np.zeros(3))).inverse


def _colmap_pose(T: Pose) -> str:
    quaternion = Rotation.from_matrix(T.R).as_quat(canonical=True, scalar_first=True)
    return numbers([*quaternion.tolist(), *T.r.tolist()])


# --- Metashape: calibrations as it loads them, a chunk's cameras as it imports them
#
# Layout as Metashape 1.7 writes it; formulas of its manual. The chunk's coordinates are topocentric
# and its transform leads to the ECEF frame, so that no map projection comes in between.


METASHAPE_ASSUMED = (
    "cx, cy from the middle of the image; p1, p2 in Metashape's order; b1 = fx - fy, b2 skew",
    "NAME.xml: Tools, Camera Calibration, Load; cameras.xml: File, Import, Import Cameras",
)
METASHAPE_RIG = (
    "slaves have their rotation to {}, y down and z ahead: <rotation> takes axes of the slave to "
    "those of the master"
)
METASHAPE_POSITIONS = "positions of heads in a rig: --orientations BLOCK has those of images"
METASHAPE_RIGID = (
    "that the heads are a rig: every image has its own pose, which has its head's position"
)


def _metashape_cameras(calibrated: Calibrated) -> Taken:
    """Return a calibration for every camera, and cameras.xml with sensors."""
    made, document, _ = _metashape_sensors(calibrated)
    rig = to_first(calibrated.calibration)
    for sensor, head in zip([*document.iter("sensor")][1:], rig[1:], strict=True):
        sensor.set("master_id", "0")
        add_numbers(sensor, "rotation", head.T_v_r_h.R.ravel())
    several = [METASHAPE_RIG.format(calibrated.cameras[0].name)] if rig[1:] else []
    return replace(
        made,
        files={**made.files, "chunk/cameras.xml": as_xml(document)},
        assumed=(*METASHAPE_ASSUMED, *several),
        left_out=(BODY, *([METASHAPE_POSITIONS] if several else [])),
    )


def _metashape_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return the files of `cameras`, with the poses of oriented images: single ones, no rig."""
    made, document, chunk = _metashape_sensors(calibrated)
    frame = oriented.block.frame
    crs = pyproj.CRS.from_user_input(frame.grid.crs)
    ET.SubElement(chunk, "reference").text = crs.to_wkt("WKT1_GDAL")
    components = ET.SubElement(chunk, "components")
    component = ET.SubElement(components, "component", id="0", label="acx4")
    transform = ET.SubElement(component, "transform")  # topocentric axes to the ECEF frame
    add_numbers(transform, "rotation", rotation_enu_to_ecef(frame.origin[None])[0].ravel())
    origin = frame.grid.ecef_from_geographic(np.append(frame.origin, 0.0)[None])[0]
    add_numbers(transform, "translation", origin)
    add_numbers(transform, "scale", [1.0])
    names = [camera.name for camera in calibrated.cameras]
    listed = ET.SubElement(chunk, "cameras")
    for i, name in enumerate(oriented.names):
        camera = oriented.block.cameras[oriented.block.images.camera_idx[i]]
        sensor = str(names.index(camera.name))
        of_it = {"id": str(i), "sensor_id": sensor, "component_id": "0", "label": name}
        matrix, T = np.eye(4), oriented.T_m_c[i]
        matrix[:3, :3], matrix[:3, 3] = T.R @ R_C_V, T.r
        add_numbers(ET.SubElement(listed, "camera", of_it), "transform", matrix.ravel())
    return replace(
        made,
        files={**made.files, "chunk/cameras.xml": as_xml(document)},
        assumed=METASHAPE_ASSUMED,
        left_out=(METASHAPE_RIGID,) if names[1:] else (),
    )


def _metashape_sensors(calibrated: Calibrated) -> tuple[Taken, ET.Element, ET.Element]:
    """Return calibrations alone, and a document with its chunk, which has sensors."""
    lenses = brown.all_nearest(calibrated.cameras, "skewed")
    document = ET.Element("document", version="1.5.0")
    chunk = ET.SubElement(document, "chunk", label="acx4", enabled="true")
    sensors, files = ET.SubElement(chunk, "sensors"), {}
    for k, camera in enumerate(calibrated.cameras):
        alone, lens = ET.Element("calibration"), lenses[camera.name]
        width, height = str(camera.width_px), str(camera.height_px)
        for tag, text in (("projection", "frame"), ("width", width), ("height", height)):
            ET.SubElement(alone, tag).text = text
        _metashape_lens(alone, camera, lens)
        files[f"{file_stem(camera.name)}.xml"] = as_xml(alone)
        sensor = ET.SubElement(sensors, "sensor", id=str(k), label=camera.name, type="frame")
        ET.SubElement(sensor, "resolution", width=width, height=height)
        mm = {"pixel_width": camera.pixel_mm, "pixel_height": camera.pixel_mm}
        for name, value in (*mm.items(), ("focal_length", camera.interior.f)):
            ET.SubElement(sensor, "property", name=name, value=repr(value))
        # what is loaded is taken from "initial", so that "adjusted" says the same of it
        for kind in ("initial", "adjusted"):
            calibration = ET.SubElement(sensor, "calibration", {"type": "frame", "class": kind})
            ET.SubElement(calibration, "resolution", width=width, height=height)
            _metashape_lens(calibration, camera, lens)
    return Taken(files=files, lenses=brown.left_of(lenses)), document, chunk


def _metashape_lens(element: ET.Element, camera: Camera, lens: Brown) -> None:
    """Write the parameters in their order; b1 and b2 where they are not zero."""
    hole, (k1, k2, p1, p2, k3) = lens.hole, lens.coefficients
    values = {
        "f": hole.fy,
        "cx": hole.cx - 0.5 * (camera.width_px - 1),
        "cy": hole.cy - 0.5 * (camera.height_px - 1),
        "b1": hole.fx - hole.fy,
        "b2": hole.skew,
        "k1": k1,
        "k2": k2,
        "k3": k3,
        "p1": p2,
        "p2": p1,
    }
    for name, value in values.items():
        if value or name not in ("b1", "b2"):
            add_numbers(element, name, [value])


# --- All of them


KINDS: Mapping[str, Kind] = {
    "toml": Kind(cameras=_toml_cameras),
    "opencv": Kind(cameras=_opencv_cameras),
    "metashape": Kind(cameras=_metashape_cameras, oriented=_metashape_images, on_map=True),
    "colmap": Kind(cameras=_colmap_cameras, oriented=_colmap_images),
    "micasense": Kind(cameras=_micasense_cameras, heads=True),
    "opk": Kind(oriented=lambda _, oriented: content.opk(oriented)),
    "opk-topocentric": Kind(
        oriented=lambda _, oriented: content.topocentric_table(oriented), on_map=True
    ),
    "rph": Kind(oriented=lambda _, oriented: content.rph(oriented), on_map=True),
}
