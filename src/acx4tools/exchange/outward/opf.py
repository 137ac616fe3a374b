"""OPF, Pix4D's open photogrammetry format, version 1.0: sensors, rig relatives, oriented cameras.

Specification: https://pix4d.github.io/opf-spec. Rig relatives are R = Rx(a) Ry(b) Rz(c) from the
head to the reference, x right, y down, z ahead; orientations are from right, up, back to the CRS.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyproj

from acx4lib.geometry.geodesy import GridSystem
from acx4tools.exchange.outward import brown, orientations
from acx4tools.exchange.outward.brown import CORNER, Brown
from acx4tools.exchange.outward.calibrated import Calibrated, Relative, to_first
from acx4tools.exchange.outward.orientations import Oriented
from acx4tools.exchange.outward.taken import BODY, Taken, as_json

ASSUMED = (
    "perspective internals: R1 to R3, T1, T2 are k1 to k3, p1, p2 of OpenCV; pixel (0, 0) is the "
    "outer corner of the top-left one; a sensor's id is its place in the list, from 1",
    "rig relatives, with sigma in input-cameras.json: Rx(a) Ry(b) Rz(c) from the head to {}, m",
    "global shutter, and one band with the camera's name",
)
IN_CRS = "positions and angles are in the grid, as OPF has them: {}; heights are ellipsoidal"
CAPTURES = "captures of input-cameras.json: they need times and pixel types"
FORMAT = "application/opf-{}+json"
LONGEST_SHIFT_M = 1000.0
"""The processing CRS is shifted by whole multiples of this."""


def cameras(calibrated: Calibrated) -> Taken:
    """Return input and calibrated sensors."""
    lenses = brown.square(calibrated)
    return Taken(
        files={
            "input-cameras.json": as_json(_input(calibrated, lenses)),
            "calibrated-cameras.json": as_json(_calibrated(calibrated, lenses)),
        },
        lenses=brown.lenses(lenses),
        assumed=(ASSUMED[0], ASSUMED[1].format(calibrated.cameras[0].name), ASSUMED[2]),
        left_out=("sigma of internals: parameters.csv has them", BODY, CAPTURES),
    )


def images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return a project with oriented cameras, and without points."""
    alone = cameras(calibrated)
    lenses = brown.square(calibrated)
    grid = oriented.block.frame.grid
    enh = _ellipsoidal(oriented)
    shift = -np.round(enh.mean(axis=0) / LONGEST_SHIFT_M) * LONGEST_SHIFT_M
    document = _calibrated(calibrated, lenses)
    document["cameras"] = _oriented(calibrated, oriented, enh + shift)
    listed = [{"id": i + 1, "uri": name} for i, name in enumerate(oriented.names)]
    more = {
        "calibrated-cameras.json": document,
        "camera-list.json": {**_head("camera-list"), "cameras": listed},
        "scene-reference-frame.json": {
            **_head("scene-reference-frame"),
            "crs": {"definition": _definition(_plane(grid))},
            "base_to_canonical": {
                "scale": [1.0, 1.0, 1.0],
                "shift": shift.tolist(),
                "swap_xy": False,
            },
        },
        "project.opf": _project(oriented.block.name),
    }
    return Taken(
        files={**alone.files, **{name: as_json(value) for name, value in more.items()}},
        lenses=alone.lenses,
        assumed=(*alone.assumed, IN_CRS.format(_plane(grid).name)),
        left_out=alone.left_out,
    )


def _plane(grid: GridSystem) -> pyproj.CRS:
    """Return the part of a CRS that has no heights: in OPF they are then ellipsoidal."""
    crs = pyproj.CRS.from_user_input(grid.crs)
    return crs.sub_crs_list[0] if crs.is_compound else crs


def _definition(plane: pyproj.CRS) -> str:
    """Return a CRS as a code or WKT."""
    code = plane.to_authority(min_confidence=100)
    return ":".join(code) if code else plane.to_wkt("WKT2_2019")


def _head(name: str) -> dict[str, str]:
    return {"format": FORMAT.format(name), "version": "1.0"}


def _input(calibrated: Calibrated, lenses: Mapping[str, Brown]) -> dict[str, Any]:
    rig = to_first(calibrated.calibration)
    sensors = []
    for i, (camera, head) in enumerate(zip(calibrated.cameras, rig, strict=True), start=1):
        sensor = {
            "id": i,
            "name": camera.name,
            "bands": [{"name": camera.name, "weight": 1.0}],
            "image_size_px": [camera.width_px, camera.height_px],
            "pixel_size_um": 1000 * camera.pixel_mm,
            "internals": _internals(lenses[camera.name]),
            "shutter_type": "global",
        }
        sensors.append(sensor if i == 1 else {**sensor, "rig_relatives": _with_sigma(head)})
    return {**_head("input-cameras"), "sensors": sensors, "captures": []}


def _calibrated(calibrated: Calibrated, lenses: Mapping[str, Brown]) -> dict[str, Any]:
    rig = to_first(calibrated.calibration)
    sensors = []
    for i, (camera, head) in enumerate(zip(calibrated.cameras, rig, strict=True), start=1):
        sensor = {"id": i, "internals": _internals(lenses[camera.name])}
        placed = {
            "translation": head.T_v_r_h.r.tolist(),
            "rotation_angles_deg": np.degrees(head.T_v_r_h.opk).tolist(),
        }
        sensors.append(sensor if i == 1 else {**sensor, "rig_relatives": placed})
    return {**_head("calibrated-cameras"), "sensors": sensors, "cameras": []}


def _internals(lens: Brown) -> dict[str, Any]:
    return {
        "type": "perspective",
        "principal_point_px": [lens.hole.cx + CORNER, lens.hole.cy + CORNER],
        "focal_length_px": lens.hole.fx,
        "radial_distortion": [lens.k1, lens.k2, lens.k3],
        "tangential_distortion": [lens.p1, lens.p2],
    }


def _with_sigma(head: Relative) -> dict[str, Any]:
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


def _ellipsoidal(oriented: Oriented) -> np.ndarray:
    """Return grid positions with ellipsoidal heights, as OPF takes a CRS of two dimensions."""
    frame = oriented.block.frame
    lonlath = frame.to_geographic(oriented.T_m_c.r)
    return np.column_stack([frame.grid.grid_from_lonlat(lonlath[:, :2]), lonlath[:, 2]])


def _oriented(calibrated: Calibrated, oriented: Oriented, xyz: np.ndarray) -> list[dict[str, Any]]:
    names = [camera.name for camera in calibrated.cameras]
    angles = orientations.in_grid(oriented)[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy()
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


def _project(name: str) -> dict[str, Any]:
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
        **_head("project"),
        "id": str(uuid.uuid5(uuid.NAMESPACE_OID, name)),
        "name": name,
        "description": "exported by acx4",
        "generator": {"name": "acx4lib", "version": "1"},
        "items": [
            {
                "id": ids[kind],
                "type": kind,
                "resources": [{"uri": f"{file}.json", "format": FORMAT.format(file)}],
                "sources": sources if kind == "calibration" else [],
            }
            for kind, file in items.items()
        ],
    }
