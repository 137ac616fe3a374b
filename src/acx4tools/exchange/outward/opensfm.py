"""OpenSfM and ODM: cameras.json, rig_cameras.json; with images a reconstruction.json.

Names as in ``opensfm/io.py``; coordinates of https://opensfm.org/docs/geometry.html: pixels from
the middle of the image divided by its longer side, y down and z ahead, rotations as vectors.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, log
from acx4tools.exchange.outward import brown
from acx4tools.exchange.outward import calibrated as outward_calibrated
from acx4tools.exchange.outward.brown import Brown
from acx4tools.exchange.outward.calibrated import R_C_V, Calibrated
from acx4tools.exchange.outward.orientations import Oriented
from acx4tools.exchange.outward.taken import BODY, SIGMA, Taken, as_json

ASSUMED = (
    "brown: focal lengths and principal point are divided by the longer side of the image",
    "ODM finds a camera by the name that it made from the picture's metadata: replace the names "
    "by those of its own cameras.json; for OpenSfM the file is camera_models_overrides.json",
)
RIG = "rig_cameras.json takes points from the axes of {} to those of the camera, m"
WORLD = "the world is east, north, up at reference_lla: {}"


def cameras(calibrated: Calibrated) -> Taken:
    """Return cameras.json, and rig_cameras.json where there are several cameras."""
    found = brown.of_all(calibrated)
    files = {"cameras.json": as_json(_models(calibrated, found))}
    rig = outward_calibrated.to_first(calibrated.calibration)
    if rig[1:]:
        names = [camera.name for camera in calibrated.cameras]
        poses = (_pose(one.T_v_r_h.inverse) for one in rig)
        files["rig_cameras.json"] = as_json(dict(zip(names, poses, strict=True)))
    said = [RIG.format(calibrated.cameras[0].name)] if rig[1:] else []
    return Taken(
        files=files,
        lenses=brown.lenses(found),
        assumed=(*ASSUMED, *said),
        left_out=(SIGMA, BODY),
    )


def images(calibrated: Calibrated, oriented: Oriented) -> Taken:
    """Return a reconstruction of oriented images without points, and its cameras."""
    alone = cameras(calibrated)
    lon, lat = oriented.block.frame.origin.tolist()
    block = oriented.block
    shots = {
        name: {
            **_pose((oriented.T_m_c[i] @ Pose(R=R_C_V, r=np.zeros(3))).inverse),
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
        assumed=(*alone.assumed, WORLD.format(oriented.origin)),
        left_out=(SIGMA,),
    )


def _models(calibrated: Calibrated, found: Mapping[str, Brown]) -> dict[str, Any]:
    return {camera.name: _model(camera, found[camera.name]) for camera in calibrated.cameras}


def _model(camera: Camera, one: Brown) -> dict[str, Any]:
    longer = max(camera.width_px, camera.height_px)
    return {
        "projection_type": "brown",
        "width": camera.width_px,
        "height": camera.height_px,
        "focal_x": one.hole.fx / longer,
        "focal_y": one.hole.fy / longer,
        "c_x": (one.hole.cx - (camera.width_px - 1) / 2) / longer,
        "c_y": (one.hole.cy - (camera.height_px - 1) / 2) / longer,
        **{name: getattr(one, name) for name in ("k1", "k2", "p1", "p2", "k3")},
    }


def _pose(T: Pose) -> dict[str, list[float]]:
    return {"rotation": log(T.R).tolist(), "translation": T.r.tolist()}
