"""Files of cameras, alone or with oriented images, for other programs: a section for each.

`KINDS` has them by the names of ``acx4 export --to``. Layouts and formulas are those of each
program's documentation; of Pix4D's .cam no file of the program itself was at hand. Metashape and
OPF are files of their own.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as ET

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from acx4lib.calibration.estimates import parameters
from acx4lib.errors import OutputError
from acx4lib.expected import Array
from acx4lib.flight.settings import SIGMAS, camera_toml
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, log
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.results.whole_files import file_stem
from acx4lib.shown import count as counted
from acx4tools.exchange import lens
from acx4tools.exchange.lens import Left
from acx4tools.exchange.outward import brown, metashape, opf, orientations
from acx4tools.exchange.outward.brown import CORNER, Brown
from acx4tools.exchange.outward.calibrated import R_C_V, Calibrated, Relative, to_first
from acx4tools.exchange.outward.orientations import CENTRE, GRID, OPK, Oriented
from acx4tools.exchange.outward.taken import (
    BODY,
    SIGMA,
    Taken,
    add_numbers,
    as_json,
    as_xml,
    lines,
    numbers,
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
    table = orientations.in_grid(oriented).iloc[:, :7]
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


KINDS: Mapping[str, Kind] = {
    "toml": Kind(cameras=_toml_cameras),
    "opencv": Kind(cameras=_opencv_cameras),
    "metashape": Kind(cameras=metashape.cameras, oriented=metashape.images, on_map=True),
    "colmap": Kind(cameras=_colmap_cameras, oriented=_colmap_images),
    "opensfm": Kind(cameras=_opensfm_cameras, oriented=_opensfm_images, on_map=True),
    "opf": Kind(cameras=opf.cameras, oriented=opf.images, on_map=True),
    "micasense": Kind(cameras=_micasense_cameras, heads=True),
    "pix4d": Kind(cameras=_pix4d_cameras, oriented=_pix4d_images),
    "micmac": Kind(cameras=_micmac_cameras, oriented=_micmac_images),
    "opk": Kind(oriented=lambda _, oriented: orientations.opk(oriented)),
    "opk-topocentric": Kind(
        oriented=lambda _, oriented: orientations.topocentric_table(oriented), on_map=True
    ),
    "rph": Kind(oriented=lambda _, oriented: orientations.rph(oriented), on_map=True),
}
