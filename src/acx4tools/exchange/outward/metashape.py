"""Metashape: calibrations as it loads them, a chunk's cameras as it imports them.

Layout as Metashape 1.7 writes it; formulas of its manual. The chunk's coordinates are topocentric
and its transform leads to the ECEF frame, so that no map projection comes in between.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np
import pyproj

from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import rotation_enu_to_ecef
from acx4lib.least_squares.covariance import propagate
from acx4lib.results.whole_files import file_stem
from acx4tools.exchange.outward import brown
from acx4tools.exchange.outward.brown import Brown
from acx4tools.exchange.outward.calibrated import R_C_V, Calibrated, to_first
from acx4tools.exchange.outward.orientations import Oriented
from acx4tools.exchange.outward.taken import BODY, Taken, add_numbers, as_xml

ASSUMED = (
    "cx, cy from the middle of the image; p1, p2 in Metashape's order; b1 = fx - fy, b2 skew",
    "NAME.xml: Tools, Camera Calibration, Load; cameras.xml: File, Import, Import Cameras",
)
RIG = (
    "slaves have their rotation to {}, y down and z ahead: <rotation> takes axes of the slave to "
    "those of the master"
)
POSITIONS = "positions of heads in a rig: --orientations BLOCK has those of images"
RIGID = "that the heads are a rig: every image has its own pose, which has its head's position"
PARAMS = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "p1", "p2")
"""Parameters, in the order in which they are written."""

VALUES = np.zeros((10, 10))
"""d(PARAMS) / d(fx, fy, cx, cy, k1, k2, k3, p1, p2, skew)."""
VALUES[[0, 1, 2, 3, 3], [1, 2, 3, 0, 1]] = [1, 1, 1, 1, -1]
VALUES[[4, 5, 6, 7, 8, 9], [9, 4, 5, 6, 8, 7]] = 1


def cameras(calibrated: Calibrated) -> Taken:
    """Return a calibration for every camera, and cameras.xml with sensors and covariances."""
    lenses = brown.skewed(calibrated)
    document, chunk = _chunk(calibrated, lenses)
    _rig(chunk, calibrated)
    several = len(calibrated.cameras) > 1
    return Taken(
        files={
            **{
                f"{file_stem(camera.name)}.xml": _calibration(camera, lenses[camera.name])
                for camera in calibrated.cameras
            },
            "chunk/cameras.xml": as_xml(document),
        },
        lenses=brown.lenses(lenses),
        assumed=(*ASSUMED, *([RIG.format(calibrated.cameras[0].name)] if several else [])),
        left_out=(BODY, *([POSITIONS] if several else [])),
    )


def images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return the files of `cameras`, with the poses of oriented images: single ones, no rig."""
    alone = cameras(calibrated)
    document, chunk = _chunk(calibrated, brown.skewed(calibrated))
    _place(chunk, oriented)
    names = [camera.name for camera in calibrated.cameras]
    _transform(ET.SubElement(chunk, "components"), oriented)
    listed = ET.SubElement(chunk, "cameras")
    for i, name in enumerate(oriented.names):
        camera = oriented.block.cameras[oriented.block.images.camera_idx[i]]
        element = ET.SubElement(
            listed,
            "camera",
            {"id": str(i), "sensor_id": str(names.index(camera.name)), "component_id": "0"},
            label=name,
        )
        add_numbers(element, "transform", _matrix(oriented.T_m_c[i]).ravel())
    return Taken(
        files={**alone.files, "chunk/cameras.xml": as_xml(document)},
        lenses=alone.lenses,
        assumed=ASSUMED,
        left_out=(RIGID,) if names[1:] else (),
    )


def _chunk(calibrated: Calibrated, lenses: Mapping[str, Brown]) -> tuple[ET.Element, ET.Element]:
    """Return a document and its chunk, with sensors."""
    document = ET.Element("document", version="1.5.0")
    chunk = ET.SubElement(document, "chunk", label="acx4", enabled="true")
    sensors = ET.SubElement(chunk, "sensors")
    for k, camera in enumerate(calibrated.cameras):
        sensor = ET.SubElement(sensors, "sensor", {"id": str(k)}, label=camera.name, type="frame")
        _sensor(sensor, camera, lenses[camera.name])
        _covariance(sensor, calibrated, k)
    return document, chunk


def _rig(chunk: ET.Element, calibrated: Calibrated) -> None:
    """Make all sensors but the first its slaves."""
    rig = to_first(calibrated.calibration)
    for k, (sensor, head) in enumerate(zip(chunk.iter("sensor"), rig, strict=True)):
        if k:
            sensor.set("master_id", "0")
            add_numbers(sensor, "rotation", head.T_v_r_h.R.ravel())


def _sensor(sensor: ET.Element, camera: Camera, lens: Brown) -> None:
    size = {"width": str(camera.width_px), "height": str(camera.height_px)}
    ET.SubElement(sensor, "resolution", size)
    mm = {"pixel_width": camera.pixel_mm, "pixel_height": camera.pixel_mm}
    for name, value in (*mm.items(), ("focal_length", camera.interior.f)):
        ET.SubElement(sensor, "property", name=name, value=repr(value))
    # what is loaded is taken from "initial", so that "adjusted" says the same of it
    for kind in ("initial", "adjusted"):
        calibration = ET.SubElement(sensor, "calibration", {"type": "frame", "class": kind})
        ET.SubElement(calibration, "resolution", size)
        _write_params(calibration, camera, lens)


def _write_params(element: ET.Element, camera: Camera, lens: Brown) -> None:
    hole = lens.hole
    middle = 0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1)
    internals = (hole.fy, hole.cx - middle[0], hole.cy - middle[1], hole.fx - hole.fy, hole.skew)
    values = (*internals, lens.k1, lens.k2, lens.k3, lens.p2, lens.p1)
    for name, value in zip(PARAMS, values, strict=True):
        if value or name not in ("b1", "b2"):
            add_numbers(element, name, [value])


def _covariance(sensor: ET.Element, calibrated: Calibrated, k: int) -> None:
    calibration = calibrated.calibration
    columns = calibration.layout.interior[k]
    J = VALUES @ brown.derivatives(calibration.cameras[k], columns, calibration.n_columns)
    cov = propagate(J, calibration.cov)
    kept = np.flatnonzero(np.diag(cov) > 0)
    if len(kept):
        element = ET.SubElement(sensor, "covariance")
        ET.SubElement(element, "params").text = " ".join(PARAMS[i] for i in kept)
        add_numbers(element, "coeffs", cov[np.ix_(kept, kept)].ravel())


def _transform(components: ET.Element, oriented: Oriented) -> None:
    """Write the way from the topocentric axes to the ECEF frame."""
    frame = oriented.block.frame
    component = ET.SubElement(components, "component", id="0", label="acx4")
    transform = ET.SubElement(component, "transform")
    add_numbers(transform, "rotation", rotation_enu_to_ecef(frame.origin[None])[0].ravel())
    origin = frame.grid.ecef_from_geographic(np.append(frame.origin, 0.0)[None])[0]
    add_numbers(transform, "translation", origin)
    add_numbers(transform, "scale", [1.0])


def _place(chunk: ET.Element, oriented: Oriented) -> None:
    crs = pyproj.CRS.from_user_input(oriented.block.frame.grid.crs)
    ET.SubElement(chunk, "reference").text = crs.to_wkt("WKT1_GDAL")


def _matrix(T_m_c: Pose) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = T_m_c.R @ R_C_V, T_m_c.r
    return matrix


def _calibration(camera: Camera, lens: Brown) -> str:
    """Return the file of one calibration."""
    element = ET.Element("calibration")
    ET.SubElement(element, "projection").text = "frame"
    ET.SubElement(element, "width").text = str(camera.width_px)
    ET.SubElement(element, "height").text = str(camera.height_px)
    _write_params(element, camera, lens)
    return as_xml(element)
