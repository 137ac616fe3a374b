"""Files of cameras, alone or with oriented images, for other programs: a section for each.

`KINDS` has them by the names of ``acx4 export --to``. Layouts and formulas are those of each
program's documentation; of Pix4D's .cam no file of the program itself was at hand.
"""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pyproj
from scipy.spatial.transform import Rotation

from acx4lib.calibration.estimates import parameters
from acx4lib.errors import OutputError
from acx4lib.expected import Array
from acx4lib.flight.settings import SIGMAS, camera_toml
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, log
from acx4lib.geometry.geodesy import GridSystem, rotation_enu_to_ecef
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.results.whole_files import file_stem
from acx4lib.shown import count as counted
from acx4tools.exchange import lens
from acx4tools.exchange.lens import Left
from acx4tools.exchange.outward import brown, content
from acx4tools.exchange.outward.brown import CORNER, Brown
from acx4tools.exchange.outward.content import (
    BODY,
    CENTRE,
    GRID,
    OPK,
    R_C_V,
    SIGMA,
    Calibrated,
    Oriented,
    Relative,
    Taken,
    add_numbers,
    as_json,
    as_xml,
    lines,
    numbers,
    to_first,
)


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
NOT_MOUNTED = (
    "the mounting is not estimated: mount angles have the heads' rotations relative to each other"
)
FRAME = (
    "{} is a synthetic camera, whose mount angles in flight.toml also define the frame of its "
    "images: where images are rendered anew, keep the old angles"
)


def _toml_cameras(calibrated: Calibrated) -> Taken:
    """Return the tables ``[cameras.NAME]`` with calibrated values, sigma as comments."""
    return Taken(
        files={FILE: "\n".join(_tables(calibrated))},
        assumed=(*ASSUMED, *_remarks(calibrated)),
        left_out=("correlations: they are in covariance.csv of the results",),
    )


def _remarks(calibrated: Calibrated) -> Iterator[str]:
    synthetic = calibrated.flight.synthetic
    if not calibrated.mounted:
        yield NOT_MOUNTED
    elif synthetic is not None and synthetic.camera in [c.name for c in calibrated.cameras]:
        yield FRAME.format(synthetic.camera)


def _tables(calibrated: Calibrated) -> Iterator[str]:
    listed = parameters(calibrated.calibration)
    for k, camera in enumerate(calibrated.cameras):
        yield camera_toml(camera).rstrip("\n")
        if calibrated.mounted:
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
    cameras = calibrated.cameras
    rig = to_first(calibrated.calibration)
    lenses = brown.of_all(calibrated)
    return Taken(
        files={
            f"{file_stem(camera.name)}.yaml": _opencv_text(camera, lenses[camera.name], head)
            for camera, head in zip(cameras, rig, strict=True)
        },
        lenses=brown.lenses(lenses),
        assumed=(*OPENCV_ASSUMED, *([OPENCV_RIG.format(cameras[0].name)] if rig[1:] else [])),
        left_out=(SIGMA, BODY),
    )


def _opencv_text(camera: Camera, lens: Brown, head: Relative) -> str:
    """Return the file of a camera, with the names of OpenCV's own examples of calibration."""
    T_h_r = head.T_v_r_h.inverse
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", camera.width_px)
    storage.write("image_height", camera.height_px)
    storage.write("camera_name", camera.name)
    hole, coefficients = lens.hole, [lens.k1, lens.k2, lens.p1, lens.p2, lens.k3]
    matrix = [[hole.fx, 0.0, hole.cx], [0.0, hole.fy, hole.cy], [0.0, 0.0, 1.0]]
    storage.write("camera_matrix", np.array(matrix))
    storage.write("distortion_coefficients", np.array([coefficients]))
    storage.write("R", np.ascontiguousarray(T_h_r.R))
    storage.write("T", np.ascontiguousarray(T_h_r.r[:, None]))
    return str(storage.releaseAndGetString())


# --- Text like that of Pix4D: a .cam for every camera; with images their external parameters
#
# Formulas of the lens: "How are the internal and external camera parameters defined?", Pix4D.
# Layout of the .cam: as other programs write it for Pix4D; no file of Pix4D itself was at hand.


PIX4D_ASSUMED = (
    "F, Px, Py in mm, the principal point from the outer corner of the top-left pixel; K1 to K3, "
    "T1, T2 as R1 to R3, T1, T2 of Pix4D, which are k1 to k3, p1, p2 of OpenCV",
    "the layout of the .cam is that which other programs write for Pix4D; it was not tried there",
)
PIX4D_EXTERNAL = "external_camera_parameters.txt"


def _pix4d_cameras(calibrated: Calibrated) -> Taken:
    """Return a .cam file for every camera."""
    lenses = brown.square(calibrated)
    return Taken(
        files={
            f"{file_stem(camera.name)}.cam": _pix4d_cam(camera, lenses[camera.name])
            for camera in calibrated.cameras
        },
        lenses=brown.lenses(lenses),
        assumed=PIX4D_ASSUMED,
        left_out=(SIGMA, BODY, "the heads' places in a rig: --to micasense or opf has them"),
    )


def _pix4d_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return the .cam files, and positions with omega, phi, kappa of the images."""
    alone = _pix4d_cameras(calibrated)
    if blank := [name for name in oriented.names if len(name.split()) != 1]:
        lacks = f"{blank[0]!r}: a name with blanks has no place there"
        msg = f"{PIX4D_EXTERNAL}: {lacks}; export --to opk"
        raise OutputError(msg)
    table = content.in_grid(oriented).iloc[:, :7]
    lines = ["imageName X Y Z Omega Phi Kappa"]
    for name, *values in table.itertuples(index=False):
        position, angles = values[:3], values[3:]
        cells = [*(f"{v:.6f}" for v in position), *(f"{v:.9f}" for v in angles)]
        lines.append(" ".join([str(name), *cells]))
    grid = oriented.block.frame.grid
    axes = OPK.format(GRID.format(grid.crs, grid.heights))
    return Taken(
        files={**alone.files, PIX4D_EXTERNAL: "\n".join([*lines, ""])},
        lenses=alone.lenses,
        assumed=(*alone.assumed, CENTRE, axes),
        left_out=alone.left_out,
    )


def _pix4d_cam(camera: Camera, model: Brown) -> str:
    mm = camera.pixel_mm
    width, height = camera.width_px * mm, camera.height_px * mm
    values = {
        f"#Focal Length mm assuming a sensor width of {width:.9g}x{height:.9g}mm": {
            "F": model.hole.fx * mm
        },
        "#Principal Point mm": {
            "Px": (model.hole.cx + CORNER) * mm,
            "Py": (model.hole.cy + CORNER) * mm,
        },
        "#Symmetrical Lens Distortion Coeffs": {"K1": model.k1, "K2": model.k2, "K3": model.k3},
        "#Tangential Lens Distortion Coeffs": {"T1": model.p1, "T2": model.p2},
    }
    lines = ["Pix4D camera calibration file 0"]
    for title, entries in values.items():
        lines += [title, *(f"{key} {value!r}" for key, value in entries.items())]
    return "\n".join([*lines, ""])


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
    first = calibrated.cameras[0].name
    lenses = brown.square(calibrated)
    rig = to_first(calibrated.calibration)
    rows = list(enumerate(zip(calibrated.cameras, rig, strict=True)))
    table = [MICASENSE_HEADER, *(_micasense_row(k, camera, head) for k, (camera, head) in rows)]
    tags = [line for k, (c, head) in rows for line in _micasense_tags(k, c, head, lenses[c.name])]
    assumed = (MICASENSE_ASSUMED[0].format(first, first), *MICASENSE_ASSUMED[1:])
    angles = [line for k, (camera, head) in rows for line in _micasense_rig_tags(k, camera, head)]
    return Taken(
        files={"rig_relatives.csv": lines(table), "xmp_tags.txt": lines(tags)},
        lenses=brown.lenses(lenses),
        assumed=assumed,
        left_out=(MICASENSE_POSITIONS, BODY),
        without_lenses=Taken(
            files={"rig_relatives.csv": lines(table), "xmp_tags.txt": lines(angles)},
            assumed=assumed[:1],
            left_out=(MICASENSE_POSITIONS, BODY),
        ),
    )


def _micasense_row(index: int, camera: Camera, head: Relative) -> str:
    angles, sigma = _micasense_angles(head), np.degrees(head.sigma_opk)
    name = f'"{camera.name.replace(chr(34), chr(34) * 2)}"'
    return ",".join([name, str(index), *(f"{v:.6f}" for v in (*angles, *sigma))])


def _micasense_tags(index: int, camera: Camera, head: Relative, lens: Brown) -> Iterator[str]:
    """Yield the tags of a head, under its name in brackets."""
    mm = camera.pixel_mm
    distortion = (lens.k1, lens.k2, lens.k3, lens.p1, lens.p2)
    yield f"[{camera.name}]"
    yield "Camera:ModelType = perspective"
    yield f"Camera:PrincipalPoint = {_micasense_listed(lens.hole.cx * mm, lens.hole.cy * mm)}"
    yield f"Camera:PerspectiveFocalLength = {_micasense_listed(lens.hole.fx * mm)}"
    yield "Camera:PerspectiveFocalLengthUnits = mm"
    yield f"Camera:PerspectiveDistortion = {_micasense_listed(*distortion)}"
    yield from _micasense_of_rig(index, head)


def _micasense_rig_tags(index: int, camera: Camera, head: Relative) -> Iterator[str]:
    """Yield the tags of a head's place in the rig alone, under its name in brackets."""
    yield f"[{camera.name}]"
    yield from _micasense_of_rig(index, head)


def _micasense_of_rig(index: int, head: Relative) -> Iterator[str]:
    yield f"Camera:RigCameraIndex = {index}"
    yield f"Camera:RigRelatives = {_micasense_listed(*_micasense_angles(head).tolist())}"
    yield "Camera:RigRelativesReferenceRigCameraIndex = 0"
    yield ""


def _micasense_angles(head: Relative) -> Array:
    """Return a, b, c of a head in degrees."""
    return np.degrees(head.T_v_r_h.opk) + 0.0  # no negative zeros


def _micasense_listed(*values: float) -> str:
    return ",".join(f"{value:.9g}" for value in values)


# --- OpenSfM and ODM: cameras.json, rig_cameras.json; with images a reconstruction.json
#
# Names as in ``opensfm/io.py``; coordinates of https://opensfm.org/docs/geometry.html: pixels from
# the middle of the image divided by its longer side, y down and z ahead, rotations as vectors.


OPENSFM_ASSUMED = (
    "brown: focal lengths and principal point are divided by the longer side of the image",
    "ODM finds a camera by the name that it made from the picture's metadata: replace the names "
    "by those of its own cameras.json; for OpenSfM the file is camera_models_overrides.json",
)
OPENSFM_RIG = "rig_cameras.json takes points from the axes of {} to those of the camera, m"
OPENSFM_WORLD = "the world is east, north, up at reference_lla: {}"


def _opensfm_cameras(calibrated: Calibrated) -> Taken:
    """Return cameras.json, and rig_cameras.json where there are several cameras."""
    lenses = brown.of_all(calibrated)
    files = {"cameras.json": as_json(_opensfm_models(calibrated, lenses))}
    rig = to_first(calibrated.calibration)
    if rig[1:]:
        names = [camera.name for camera in calibrated.cameras]
        poses = (_opensfm_pose(head.T_v_r_h.inverse) for head in rig)
        files["rig_cameras.json"] = as_json(dict(zip(names, poses, strict=True)))
    sentences = [OPENSFM_RIG.format(calibrated.cameras[0].name)] if rig[1:] else []
    return Taken(
        files=files,
        lenses=brown.lenses(lenses),
        assumed=(*OPENSFM_ASSUMED, *sentences),
        left_out=(SIGMA, BODY),
    )


def _opensfm_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return a reconstruction of oriented images without points, and its cameras."""
    alone = _opensfm_cameras(calibrated)
    lon, lat = oriented.block.frame.origin.tolist()
    block = oriented.block
    shots = {
        name: {
            **_opensfm_pose((oriented.T_m_c[i] @ Pose(R=R_C_V, r=np.zeros(3))).inverse),
            "camera": block.cameras[block.images.camera_idx[i]].name,
            "orientation": 1,
            "gps_position": oriented.T_m_c.r[i].tolist(),
        }
        for i, name in enumerate(oriented.names)
    }
    reference = {"latitude": lat, "longitude": lon, "altitude": 0.0}
    model = {
        "cameras": json.loads(alone.files["cameras.json"]),
        "shots": shots,
        "points": {},
        "reference_lla": reference,
    }
    return Taken(
        files={
            **alone.files,
            "reconstruction.json": as_json([model]),
            "reference_lla.json": as_json(reference),
        },
        lenses=alone.lenses,
        assumed=(*alone.assumed, OPENSFM_WORLD.format(oriented.origin)),
        left_out=(SIGMA,),
    )


def _opensfm_models(calibrated: Calibrated, lenses: Mapping[str, Brown]) -> dict[str, Any]:
    return {
        camera.name: _opensfm_model(camera, lenses[camera.name]) for camera in calibrated.cameras
    }


def _opensfm_model(camera: Camera, model: Brown) -> dict[str, Any]:
    longer = max(camera.width_px, camera.height_px)
    return {
        "projection_type": "brown",
        "width": camera.width_px,
        "height": camera.height_px,
        "focal_x": model.hole.fx / longer,
        "focal_y": model.hole.fy / longer,
        "c_x": (model.hole.cx - (camera.width_px - 1) / 2) / longer,
        "c_y": (model.hole.cy - (camera.height_px - 1) / 2) / longer,
        **{name: getattr(model, name) for name in ("k1", "k2", "p1", "p2", "k3")},
    }


def _opensfm_pose(T: Pose) -> dict[str, list[float]]:
    return {"rotation": log(T.R).tolist(), "translation": T.r.tolist()}


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
    lenses = brown.of_all(calibrated)
    return Taken(
        files={
            "cameras.txt": lines(_colmap_camera_lines(calibrated, lenses)),
            "rigs.txt": lines([_colmap_rig_line(calibrated)]),
        },
        lenses=brown.lenses(lenses),
        assumed=(COLMAP_ASSUMED[0], COLMAP_ASSUMED[1].format(calibrated.cameras[0].name)),
        left_out=(SIGMA, BODY),
    )


def _colmap_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return a model with oriented images, and without points."""
    alone = _colmap_cameras(calibrated)
    return Taken(
        files={
            **alone.files,
            "frames.txt": lines(_colmap_frame_lines(calibrated, oriented)),
            "images.txt": lines(_colmap_image_lines(calibrated, oriented)),
            "points3D.txt": "# no points\n",
        },
        lenses=alone.lenses,
        assumed=(*alone.assumed, COLMAP_WORLD.format(oriented.origin)),
        left_out=(SIGMA, *_colmap_cut_names(oriented)),
    )


def _colmap_cut_names(oriented: Oriented) -> Iterator[str]:
    """Yield a sentence on names that COLMAP reads up to their first blank."""
    cut = [name for name in oriented.names if len(name.split(" ")) > 1]
    if cut:
        yield COLMAP_CUT.format(
            counted(len(cut), "image"), repr(cut[0].split(" ")[0]), repr(cut[0])
        )


def _colmap_camera_lines(calibrated: Calibrated, lenses: dict[str, Brown]) -> Iterator[str]:
    for i, camera in enumerate(calibrated.cameras, start=1):
        model = lenses[camera.name]
        hole = (model.hole.fx, model.hole.fy, model.hole.cx + CORNER, model.hole.cy + CORNER)
        values = [*hole, model.k1, model.k2, model.p1, model.p2, model.k3, 0.0, 0.0, 0.0]
        yield f"{i} FULL_OPENCV {camera.width_px} {camera.height_px} {numbers(values)}"


def _colmap_rig_line(calibrated: Calibrated) -> str:
    others = to_first(calibrated.calibration)[1:]
    placed = [
        f" CAMERA {i} 1 {_colmap_pose(head.T_v_r_h.inverse)}"
        for i, head in enumerate(others, start=2)
    ]
    return f"1 {len(others) + 1} CAMERA 1{''.join(placed)}"


def _colmap_frame_lines(calibrated: Calibrated, oriented: Oriented) -> Iterator[str]:
    """Yield a line for each exposure: the pose of the rig, and its images."""
    block, number = oriented.block, _colmap_numbers_of_cameras(calibrated, oriented)
    T_m_r = block.trajectory.T_m_b @ calibrated.cameras[0].T_b_c
    for exposure in np.unique(block.images.exposure_idx):
        taken = np.flatnonzero(block.images.exposure_idx == exposure)
        data = "".join(f" CAMERA {number[i]} {i + 1}" for i in taken)
        pose = _colmap_pose(_colmap_from_world(T_m_r[exposure]))
        yield f"{exposure + 1} 1 {pose} {len(taken)}{data}"


def _colmap_image_lines(calibrated: Calibrated, oriented: Oriented) -> Iterator[str]:
    """Yield two lines for each image, the second without points."""
    number = _colmap_numbers_of_cameras(calibrated, oriented)
    for i, name in enumerate(oriented.names):
        yield f"{i + 1} {_colmap_pose(_colmap_from_world(oriented.T_m_c[i]))} {number[i]} {name}"
        yield ""


def _colmap_numbers_of_cameras(calibrated: Calibrated, oriented: Oriented) -> list[int]:
    names = [camera.name for camera in calibrated.cameras]
    number_of = [names.index(camera.name) + 1 for camera in oriented.block.cameras]
    return [number_of[k] for k in oriented.block.images.camera_idx]


def _colmap_from_world(T_m_c: Pose) -> Pose:
    return (T_m_c @ Pose(R=R_C_V, r=np.zeros(3))).inverse


def _colmap_pose(T: Pose) -> str:
    quaternion = Rotation.from_matrix(T.R).as_quat(canonical=True, scalar_first=True)
    return numbers([*quaternion.tolist(), *T.r.tolist()])


# --- MicMac, first version: AutoCal-NAME.xml; with images an Orientation-IMAGE.xml for each
#
# ``ModPhgrStd``, Fraser's model, has all that a camera has: with x, y from the centre of
# distortion in pixels, x' = x (1 + sum of c_i r^2i) + P1 (r² + 2x²) + 2 P2 x y + b1 x + b2 y, y'
# likewise without b1 and b2, from the ideal to the measured point. It is the direction in which
# MicMac's own ``Verif`` entries agree with its ``CoeffDist`` to the last digit.


MICMAC_ASSUMED = (
    "ModPhgrStd: PP, F and CDist in px, distortion from the ideal to the measured point; "
    "pixel (0, 0) is taken as the centre of the top-left one",
)
MICMAC_WORLD = (
    "Centre and rotation (camera to world, y down, z ahead) in axes east, north, up at {}"
)
MICMAC_FOLDER = "Ori-acx4"


def _micmac_cameras(calibrated: Calibrated) -> Taken:
    """Return a calibration for every camera."""
    near = brown.skewed(calibrated)
    fitted = {
        camera.name: _micmac_fitted(camera, near[camera.name]) for camera in calibrated.cameras
    }
    return Taken(
        files={
            _micmac_file(c): _micmac_calibration(c, fitted[c.name][0]) for c in calibrated.cameras
        },
        lenses={name: left for name, (_, left) in fitted.items()},
        assumed=MICMAC_ASSUMED,
        left_out=(SIGMA, BODY, "the heads' places in a rig"),
    )


def _micmac_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return the calibrations, and the orientations of the images."""
    alone, block = _micmac_cameras(calibrated), oriented.block
    files = {
        f"{MICMAC_FOLDER}/Orientation-{file_stem(name)}.xml": _micmac_orientation(
            oriented, i, block.cameras[block.images.camera_idx[i]]
        )
        for i, name in enumerate(oriented.names)
    }
    return Taken(
        files={**alone.files, **files},
        lenses=alone.lenses,
        assumed=(*MICMAC_ASSUMED, MICMAC_WORLD.format(oriented.origin)),
        left_out=(SIGMA,),
    )


def _micmac_file(camera: Camera) -> str:
    return f"{MICMAC_FOLDER}/AutoCal-{file_stem(camera.name)}.xml"


def _micmac_fitted(camera: Camera, model: Brown) -> tuple[Array, Left]:
    """Return f, cx, cy, k1, k2, p1, p2, k3, b1, b2, as `brown.pixels` has them."""
    f, affinity = (
        model.hole.fy,
        (model.hole.fx / model.hole.fy - 1, model.hole.skew / model.hole.fy),
    )
    hole = (f, model.hole.cx, model.hole.cy)
    start = np.array([*hole, model.k1, model.k2, model.p1, model.p2, model.k3, *affinity])
    return lens.model_of(camera, brown.pixels, start) if any(affinity) else (start, model.left)


def _micmac_calibration(camera: Camera, values: Array) -> str:
    f, cx, cy, *others = values.tolist()
    k1, k2, p1, p2, k3, b1, b2 = others
    root = ET.Element("ExportAPERO")
    inner = ET.SubElement(root, "CalibrationInternConique")
    ET.SubElement(inner, "KnownConv").text = "eConvApero_DistM2C"
    add_numbers(inner, "PP", (cx, cy))
    add_numbers(inner, "F", (f,))
    ET.SubElement(inner, "SzIm").text = f"{camera.width_px} {camera.height_px}"
    model = ET.SubElement(ET.SubElement(inner, "CalibDistortion"), "ModPhgrStd")
    radial = ET.SubElement(model, "RadialePart")
    add_numbers(radial, "CDist", (cx, cy))
    for power, coefficient in enumerate((k1, k2, k3), start=1):
        add_numbers(radial, "CoeffDist", (coefficient / f ** (2 * power),))
    ET.SubElement(radial, "PPaEqPPs").text = "true"
    for name, value in (("P1", p2 / f), ("P2", p1 / f), ("b1", b1), ("b2", b2)):
        add_numbers(model, name, (value,))
    return as_xml(root)


def _micmac_orientation(oriented: Oriented, i: int, camera: Camera) -> str:
    root = ET.Element("ExportAPERO")
    conic = ET.SubElement(root, "OrientationConique")
    affine = ET.SubElement(conic, "OrIntImaM2C")
    for name, text in (("I00", "0 0"), ("V10", "1 0"), ("V01", "0 1")):
        ET.SubElement(affine, name).text = text
    ET.SubElement(conic, "TypeProj").text = "eProjStenope"
    ET.SubElement(conic, "ZoneUtileInPixel").text = "true"
    ET.SubElement(conic, "FileInterne").text = _micmac_file(camera)
    ET.SubElement(conic, "RelativeNameFI").text = "true"
    outer = ET.SubElement(conic, "Externe")
    ET.SubElement(outer, "KnownConv").text = "eConvApero_DistM2C"
    add_numbers(outer, "Centre", oriented.T_m_c.r[i])
    matrix = ET.SubElement(ET.SubElement(outer, "ParamRotation"), "CodageMatr")
    for name, row in zip(("L1", "L2", "L3"), oriented.T_m_c.R[i] @ R_C_V, strict=True):
        add_numbers(matrix, name, row)
    ET.SubElement(ET.SubElement(conic, "ConvOri"), "KnownConv").text = "eConvApero_DistM2C"
    return as_xml(root)


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
METASHAPE_PARAMS = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "p1", "p2")
"""Parameters, in the order in which they are written."""

METASHAPE_VALUES = np.zeros((10, 10))
"""d(PARAMS) / d(fx, fy, cx, cy, k1, k2, k3, p1, p2, skew)."""
METASHAPE_VALUES[[0, 1, 2, 3, 3], [1, 2, 3, 0, 1]] = [1, 1, 1, 1, -1]
METASHAPE_VALUES[[4, 5, 6, 7, 8, 9], [9, 4, 5, 6, 8, 7]] = 1


def _metashape_cameras(calibrated: Calibrated) -> Taken:
    """Return a calibration for every camera, and cameras.xml with sensors and covariances."""
    lenses = brown.skewed(calibrated)
    document, chunk = _metashape_chunk(calibrated, lenses)
    _metashape_rig(chunk, calibrated)
    several = len(calibrated.cameras) > 1
    return Taken(
        files={
            **{
                f"{file_stem(camera.name)}.xml": _metashape_calibration(camera, lenses[camera.name])
                for camera in calibrated.cameras
            },
            "chunk/cameras.xml": as_xml(document),
        },
        lenses=brown.lenses(lenses),
        assumed=(
            *METASHAPE_ASSUMED,
            *([METASHAPE_RIG.format(calibrated.cameras[0].name)] if several else []),
        ),
        left_out=(BODY, *([METASHAPE_POSITIONS] if several else [])),
    )


def _metashape_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return the files of `cameras`, with the poses of oriented images: single ones, no rig."""
    alone = _metashape_cameras(calibrated)
    document, chunk = _metashape_chunk(calibrated, brown.skewed(calibrated))
    _metashape_place(chunk, oriented)
    names = [camera.name for camera in calibrated.cameras]
    _metashape_transform(ET.SubElement(chunk, "components"), oriented)
    listed = ET.SubElement(chunk, "cameras")
    for i, name in enumerate(oriented.names):
        camera = oriented.block.cameras[oriented.block.images.camera_idx[i]]
        element = ET.SubElement(
            listed,
            "camera",
            {"id": str(i), "sensor_id": str(names.index(camera.name)), "component_id": "0"},
            label=name,
        )
        add_numbers(element, "transform", _metashape_matrix(oriented.T_m_c[i]).ravel())
    return Taken(
        files={**alone.files, "chunk/cameras.xml": as_xml(document)},
        lenses=alone.lenses,
        assumed=METASHAPE_ASSUMED,
        left_out=(METASHAPE_RIGID,) if names[1:] else (),
    )


def _metashape_chunk(
    calibrated: Calibrated, lenses: Mapping[str, Brown]
) -> tuple[ET.Element, ET.Element]:
    """Return a document and its chunk, with sensors."""
    document = ET.Element("document", version="1.5.0")
    chunk = ET.SubElement(document, "chunk", label="acx4", enabled="true")
    sensors = ET.SubElement(chunk, "sensors")
    for k, camera in enumerate(calibrated.cameras):
        sensor = ET.SubElement(sensors, "sensor", {"id": str(k)}, label=camera.name, type="frame")
        _metashape_sensor(sensor, camera, lenses[camera.name])
        _metashape_covariance(sensor, calibrated, k)
    return document, chunk


def _metashape_rig(chunk: ET.Element, calibrated: Calibrated) -> None:
    """Make all sensors but the first its slaves."""
    rig = to_first(calibrated.calibration)
    for k, (sensor, head) in enumerate(zip(chunk.iter("sensor"), rig, strict=True)):
        if k:
            sensor.set("master_id", "0")
            add_numbers(sensor, "rotation", head.T_v_r_h.R.ravel())


def _metashape_sensor(sensor: ET.Element, camera: Camera, lens: Brown) -> None:
    size = {"width": str(camera.width_px), "height": str(camera.height_px)}
    ET.SubElement(sensor, "resolution", size)
    mm = {"pixel_width": camera.pixel_mm, "pixel_height": camera.pixel_mm}
    for name, value in (*mm.items(), ("focal_length", camera.interior.f)):
        ET.SubElement(sensor, "property", name=name, value=repr(value))
    # what is loaded is taken from "initial", so that "adjusted" says the same of it
    for kind in ("initial", "adjusted"):
        calibration = ET.SubElement(sensor, "calibration", {"type": "frame", "class": kind})
        ET.SubElement(calibration, "resolution", size)
        _metashape_write_params(calibration, camera, lens)


def _metashape_write_params(element: ET.Element, camera: Camera, lens: Brown) -> None:
    hole = lens.hole
    middle = 0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1)
    internals = (hole.fy, hole.cx - middle[0], hole.cy - middle[1], hole.fx - hole.fy, hole.skew)
    values = (*internals, lens.k1, lens.k2, lens.k3, lens.p2, lens.p1)
    for name, value in zip(METASHAPE_PARAMS, values, strict=True):
        if value or name not in ("b1", "b2"):
            add_numbers(element, name, [value])


def _metashape_covariance(sensor: ET.Element, calibrated: Calibrated, k: int) -> None:
    calibration = calibrated.calibration
    columns = calibration.layout.interior[k]
    J = METASHAPE_VALUES @ brown.derivatives(calibration.cameras[k], columns, calibration.n_columns)
    cov = propagate(J, calibration.cov)
    kept = np.flatnonzero(np.diag(cov) > 0)
    if len(kept):
        element = ET.SubElement(sensor, "covariance")
        ET.SubElement(element, "params").text = " ".join(METASHAPE_PARAMS[i] for i in kept)
        add_numbers(element, "coeffs", cov[np.ix_(kept, kept)].ravel())


def _metashape_transform(components: ET.Element, oriented: Oriented) -> None:
    """Write the way from the topocentric axes to the ECEF frame."""
    frame = oriented.block.frame
    component = ET.SubElement(components, "component", id="0", label="acx4")
    transform = ET.SubElement(component, "transform")
    add_numbers(transform, "rotation", rotation_enu_to_ecef(frame.origin[None])[0].ravel())
    origin = frame.grid.ecef_from_geographic(np.append(frame.origin, 0.0)[None])[0]
    add_numbers(transform, "translation", origin)
    add_numbers(transform, "scale", [1.0])


def _metashape_place(chunk: ET.Element, oriented: Oriented) -> None:
    crs = pyproj.CRS.from_user_input(oriented.block.frame.grid.crs)
    ET.SubElement(chunk, "reference").text = crs.to_wkt("WKT1_GDAL")


def _metashape_matrix(T_m_c: Pose) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = T_m_c.R @ R_C_V, T_m_c.r
    return matrix


def _metashape_calibration(camera: Camera, lens: Brown) -> str:
    """Return the file of one calibration."""
    element = ET.Element("calibration")
    ET.SubElement(element, "projection").text = "frame"
    ET.SubElement(element, "width").text = str(camera.width_px)
    ET.SubElement(element, "height").text = str(camera.height_px)
    _metashape_write_params(element, camera, lens)
    return as_xml(element)


# --- OPF, Pix4D's open photogrammetry format, version 1.0: sensors, rig relatives, oriented cameras
#
# Specification: https://pix4d.github.io/opf-spec. Rig relatives are R = Rx(a) Ry(b) Rz(c) from the
# head to the reference, x right, y down, z ahead; orientations are from right, up, back to the CRS.


OPF_ASSUMED = (
    "perspective internals: R1 to R3, T1, T2 are k1 to k3, p1, p2 of OpenCV; pixel (0, 0) is the "
    "outer corner of the top-left one; a sensor's id is its place in the list, from 1",
    "rig relatives, with sigma in input-cameras.json: Rx(a) Ry(b) Rz(c) from the head to {}, m",
    "global shutter, and one band with the camera's name",
)
OPF_IN_CRS = "positions and angles are in the grid, as OPF has them: {}; heights are ellipsoidal"
OPF_CAPTURES = "captures of input-cameras.json: they need times and pixel types"
OPF_FORMAT = "application/opf-{}+json"
OPF_LONGEST_SHIFT_M = 1000.0
"""The processing CRS is shifted by whole multiples of this."""


def _opf_cameras(calibrated: Calibrated) -> Taken:
    """Return input and calibrated sensors."""
    lenses = brown.square(calibrated)
    return Taken(
        files={
            "input-cameras.json": as_json(_opf_input(calibrated, lenses)),
            "calibrated-cameras.json": as_json(_opf_calibrated(calibrated, lenses)),
        },
        lenses=brown.lenses(lenses),
        assumed=(OPF_ASSUMED[0], OPF_ASSUMED[1].format(calibrated.cameras[0].name), OPF_ASSUMED[2]),
        left_out=("sigma of internals: parameters.csv has them", BODY, OPF_CAPTURES),
    )


def _opf_images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return a project with oriented cameras, and without points."""
    alone = _opf_cameras(calibrated)
    lenses = brown.square(calibrated)
    grid = oriented.block.frame.grid
    enh = _opf_ellipsoidal(oriented)
    shift = -np.round(enh.mean(axis=0) / OPF_LONGEST_SHIFT_M) * OPF_LONGEST_SHIFT_M
    document = _opf_calibrated(calibrated, lenses)
    document["cameras"] = _opf_oriented(calibrated, oriented, enh + shift)
    listed = [{"id": i + 1, "uri": name} for i, name in enumerate(oriented.names)]
    more = {
        "calibrated-cameras.json": document,
        "camera-list.json": {**_opf_head("camera-list"), "cameras": listed},
        "scene-reference-frame.json": {
            **_opf_head("scene-reference-frame"),
            "crs": {"definition": _opf_definition(_opf_plane(grid))},
            "base_to_canonical": {
                "scale": [1.0, 1.0, 1.0],
                "shift": shift.tolist(),
                "swap_xy": False,
            },
        },
        "project.opf": _opf_project(oriented.block.name),
    }
    return Taken(
        files={**alone.files, **{name: as_json(value) for name, value in more.items()}},
        lenses=alone.lenses,
        assumed=(*alone.assumed, OPF_IN_CRS.format(_opf_plane(grid).name)),
        left_out=alone.left_out,
    )


def _opf_plane(grid: GridSystem) -> pyproj.CRS:
    """Return the part of a CRS that has no heights: in OPF they are then ellipsoidal."""
    crs = pyproj.CRS.from_user_input(grid.crs)
    return crs.sub_crs_list[0] if crs.is_compound else crs


def _opf_definition(plane: pyproj.CRS) -> str:
    """Return a CRS as a code or WKT."""
    code = plane.to_authority(min_confidence=100)
    return ":".join(code) if code else plane.to_wkt("WKT2_2019")


def _opf_head(name: str) -> dict[str, str]:
    return {"format": OPF_FORMAT.format(name), "version": "1.0"}


def _opf_input(calibrated: Calibrated, lenses: Mapping[str, Brown]) -> dict[str, Any]:
    rig = to_first(calibrated.calibration)
    sensors = []
    for i, (camera, head) in enumerate(zip(calibrated.cameras, rig, strict=True), start=1):
        sensor = {
            "id": i,
            "name": camera.name,
            "bands": [{"name": camera.name, "weight": 1.0}],
            "image_size_px": [camera.width_px, camera.height_px],
            "pixel_size_um": 1000 * camera.pixel_mm,
            "internals": _opf_internals(lenses[camera.name]),
            "shutter_type": "global",
        }
        sensors.append(sensor if i == 1 else {**sensor, "rig_relatives": _opf_with_sigma(head)})
    return {**_opf_head("input-cameras"), "sensors": sensors, "captures": []}


def _opf_calibrated(calibrated: Calibrated, lenses: Mapping[str, Brown]) -> dict[str, Any]:
    rig = to_first(calibrated.calibration)
    sensors = []
    for i, (camera, head) in enumerate(zip(calibrated.cameras, rig, strict=True), start=1):
        sensor = {"id": i, "internals": _opf_internals(lenses[camera.name])}
        placed = {
            "translation": head.T_v_r_h.r.tolist(),
            "rotation_angles_deg": np.degrees(head.T_v_r_h.opk).tolist(),
        }
        sensors.append(sensor if i == 1 else {**sensor, "rig_relatives": placed})
    return {**_opf_head("calibrated-cameras"), "sensors": sensors, "cameras": []}


def _opf_internals(lens: Brown) -> dict[str, Any]:
    return {
        "type": "perspective",
        "principal_point_px": [lens.hole.cx + CORNER, lens.hole.cy + CORNER],
        "focal_length_px": lens.hole.fx,
        "radial_distortion": [lens.k1, lens.k2, lens.k3],
        "tangential_distortion": [lens.p1, lens.p2],
    }


def _opf_with_sigma(head: Relative) -> dict[str, Any]:
    return {
        "translation": {
            "values_m": head.T_v_r_h.r.tolist(),
            "sigmas_m": head.sigma_position.tolist(),
        },
        "rotation": {
            "angles_deg": np.degrees(head.T_v_r_h.opk).tolist(),
            "sigmas_deg": np.degrees(head.sigma_opk).tolist(),
        },
    }


def _opf_ellipsoidal(oriented: Oriented) -> np.ndarray:
    """Return grid positions with ellipsoidal heights, as OPF takes a CRS of two dimensions."""
    frame = oriented.block.frame
    lonlath = frame.to_geographic(oriented.T_m_c.r)
    return np.column_stack([frame.grid.grid_from_lonlat(lonlath[:, :2]), lonlath[:, 2]])


def _opf_oriented(
    calibrated: Calibrated, oriented: Oriented, xyz: np.ndarray
) -> list[dict[str, Any]]:
    names = [camera.name for camera in calibrated.cameras]
    angles = content.in_grid(oriented)[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy()
    block = oriented.block
    return [
        {
            "id": i + 1,
            "sensor_id": names.index(block.cameras[block.images.camera_idx[i]].name) + 1,
            "position": xyz[i].tolist(),
            "orientation_deg": angles[i].tolist(),
        }
        for i in range(len(oriented.names))
    ]


def _opf_project(name: str) -> dict[str, Any]:
    """Return the index of all files; identifiers are made of their names."""
    items = {
        "camera_list": "camera-list",
        "input_cameras": "input-cameras",
        "scene_reference_frame": "scene-reference-frame",
        "calibration": "calibrated-cameras",
    }
    ids = {kind: str(uuid.uuid5(uuid.NAMESPACE_OID, f"{name}/{kind}")) for kind in items}
    sources = [{"id": ids[kind], "type": kind} for kind in items if kind != "calibration"]
    return {
        **_opf_head("project"),
        "id": str(uuid.uuid5(uuid.NAMESPACE_OID, name)),
        "name": name,
        "description": "exported by acx4",
        "generator": {"name": "acx4lib", "version": "1"},
        "items": [
            {
                "id": ids[kind],
                "type": kind,
                "resources": [{"uri": f"{file}.json", "format": OPF_FORMAT.format(file)}],
                "sources": sources if kind == "calibration" else [],
            }
            for kind, file in items.items()
        ],
    }


# --- All of them


KINDS: Mapping[str, Kind] = {
    "toml": Kind(cameras=_toml_cameras),
    "opencv": Kind(cameras=_opencv_cameras),
    "metashape": Kind(cameras=_metashape_cameras, oriented=_metashape_images, on_map=True),
    "colmap": Kind(cameras=_colmap_cameras, oriented=_colmap_images),
    "opensfm": Kind(cameras=_opensfm_cameras, oriented=_opensfm_images, on_map=True),
    "opf": Kind(cameras=_opf_cameras, oriented=_opf_images, on_map=True),
    "micasense": Kind(cameras=_micasense_cameras, heads=True),
    "pix4d": Kind(cameras=_pix4d_cameras, oriented=_pix4d_images),
    "micmac": Kind(cameras=_micmac_cameras, oriented=_micmac_images),
    "opk": Kind(oriented=lambda _, oriented: content.opk(oriented)),
    "opk-topocentric": Kind(
        oriented=lambda _, oriented: content.topocentric_table(oriented), on_map=True
    ),
    "rph": Kind(oriented=lambda _, oriented: content.rph(oriented), on_map=True),
}
