"""A project of OPF: a rig of two cameras, four captures, nine control points with marks."""

import json

import cv2
import numpy as np
import pyproj

from support.projects import scene
from support.projects.scene import NAMES

SHIFT = np.array([-676000.0, -7184000.0, -1000.0])
ANGLES = np.array([0.4, -0.3, 1.2])
"""Rx, Ry, Rz of the second camera, degrees."""
BASE = np.array([0.12, -0.03, 0.05])


def relative():
    """Return the rotation from the second camera's axes to the first one's, y down, z ahead."""
    x, y, z = (cv2.Rodrigues(np.radians(a) * e)[0] for a, e in zip(ANGLES, np.eye(3), strict=True))
    return x @ y @ z


def cameras_on_map():
    """Return the rotations from camera axes, y down, to east, north, up of the grid."""
    block = scene.scene()
    there = pyproj.Transformer.from_crs(scene.GEOGRAPHIC, scene.CRS, always_xy=True)
    found = []
    for (lon, lat, _), angles in zip(block.lonlath, np.radians(scene.YPR), strict=True):
        (e0, e1), (n0, n1) = there.transform([lon - 1e-5, lon + 1e-5], [lat, lat])
        turn = np.arctan2(n1 - n0, e1 - e0)  # grid direction of east
        enu_of_ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        found.append(cv2.Rodrigues(turn * np.eye(3)[2])[0] @ enu_of_ned @ scene.camera(*angles))
    return found


def opk(R_g_cv):
    """Return omega, phi, kappa in degrees of R = Rx Ry Rz from right, top, back."""
    R = R_g_cv @ np.diag([1.0, -1.0, -1.0])
    return np.degrees(
        [np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])]
    ).tolist()


def documents(*, as_opk=False):
    """Return the documents of a project by their names."""
    block, turned = scene.scene(), cameras_on_map()
    places = centres(block)
    captures, listed, after = [], [], []
    marks = {k: [] for k in range(len(block.points_enh))}
    for i, (R, r) in enumerate(zip(turned, places, strict=True)):
        captures.append(_capture(i, block.lonlath[i], opk(R) if as_opk else None))
        for head, (axes, at) in enumerate([(R, r), (R @ relative(), r + R @ BASE)]):
            number = 10 * i + head
            listed.append({"id": number, "uri": f"images/{head}/{NAMES[i]}"})
            after.append(
                {
                    "id": number,
                    "sensor_id": head + 1,
                    "position": (at + SHIFT).tolist(),
                    "orientation_deg": opk(axes),
                }
            )
            for k, position in enumerate(scene.seen(axes, at, block.points_enh).tolist()):
                mark = {"camera_id": number, "position_px": position, "accuracy": 1.0}
                marks[k].append(mark)
    return {
        "camera-list": {"cameras": listed},
        "input-cameras": {"sensors": [_sensor(1), _sensor(2)], "captures": captures},
        "calibrated-cameras": {"sensors": [_after(1), _after(2)], "cameras": after},
        "input-control-points": {"gcps": _gcps(block.points_enh, marks), "mtps": []},
        "calibrated-control-points": {
            "points": [
                {"id": f"P{k}", "coordinates": (at + SHIFT).tolist()}
                for k, at in enumerate(block.points_enh)
            ]
        },
        "scene-reference-frame": {
            "crs": {"definition": scene.CRS},
            "base_to_canonical": {"scale": [1, 1, 1], "shift": SHIFT.tolist(), "swap_xy": False},
        },
    }


def write_tracks(folder):
    """Write the nine points as tie points: sparse.gltf and its buffers."""
    folder.mkdir(parents=True, exist_ok=True)
    block, turned = scene.scene(), cameras_on_map()
    places = centres(block)
    heads = [
        (10 * i + head, R @ relative() if head else R, r + R @ BASE if head else r)
        for i, (R, r) in enumerate(zip(turned, places, strict=True))
        for head in (0, 1)
    ]
    pixels = np.stack([scene.seen(R, r, block.points_enh) for _, R, r in heads], axis=1)
    n, m = len(block.points_enh), len(heads)
    upright = block.points_enh + SHIFT
    ranges = [k * m | m << 40 for k in range(n)]
    values = {
        "positions": ("VEC3", 5126, np.stack([upright.T[0], upright.T[2], -upright.T[1]], axis=1)),
        "cameraIds": ("SCALAR", 5125, np.tile(np.arange(m), n)),
        "ranges": ("VEC2", 5125, np.array([[r & 0xFFFFFFFF, r >> 32] for r in ranges])),
        "pixels": ("VEC2", 5126, pixels.reshape(-1, 2)),
        "features": ("SCALAR", 5125, np.arange(n * m)),
        "scales": ("SCALAR", 5126, np.ones(n * m)),
    }
    matches = {
        "cameraUids": [number for number, _, _ in heads],
        "cameraIds": 1,
        "pointIndexRanges": 2,
        "imagePoints": {"pixelCoordinates": 3, "featureIds": 4, "scales": 5},
    }
    primitive = {
        "attributes": {"POSITION": 0},
        "mode": 0,
        "extensions": {"OPF_mesh_primitive_matches": matches},
    }
    kinds = {5125: "<u4", 5126: "<f4"}
    for name, (_, kind, array) in values.items():
        (folder / f"{name}.bin").write_bytes(array.astype(kinds[kind]).tobytes())
    sizes = [array.size * 4 for _, _, array in values.values()]
    document = {
        "asset": {"version": "2.0", "extensions": {"OPF_asset_version": {"version": "1.0"}}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": np.eye(4).ravel().tolist()}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [
            {"uri": f"{name}.bin", "byteLength": size}
            for name, size in zip(values, sizes, strict=True)
        ],
        "bufferViews": [
            {"buffer": k, "byteOffset": 0, "byteLength": size} for k, size in enumerate(sizes)
        ],
        "accessors": [
            {"bufferView": k, "componentType": kind, "count": len(array), "type": form}
            for k, (form, kind, array) in enumerate(values.values())
        ],
    }
    (folder / "sparse.gltf").write_text(json.dumps(document, indent=1))
    return folder / "sparse.gltf"


def write(folder, *, tracks=False, **wanted):
    """Write a project; its folder is returned."""
    folder.mkdir(parents=True, exist_ok=True)
    resources = []
    for name, document in documents(**wanted).items():
        kind = f"application/opf-{name}+json"
        text = json.dumps({"format": kind, "version": "1.0", **document}, indent=1)
        (folder / f"{name}.json").write_text(text)
        resources.append({"uri": f"{name}.json", "format": kind})
    project = {
        "version": "1.0",
        "format": "application/opf-project+json",
        "id": "caa7754e-90dc-11ec-b909-0242ac120002",
        "name": "a block",
        "description": "",
        "generator": {"name": "Writer", "version": "2.0"},
        "items": [{"id": "1", "type": "all", "resources": resources, "sources": []}],
    }
    if tracks:
        path = write_tracks(folder / "points")
        listed = [{"uri": f"points/{path.name}", "format": "model/gltf+json"}]
        item = {"id": "2", "type": "calibration", "resources": listed, "sources": []}
        project["items"].append(item)
    (folder / "project.opf").write_text(json.dumps(project))
    return folder


def centres(block):
    to_map = pyproj.Transformer.from_crs(scene.GEOGRAPHIC, scene.CRS, always_xy=True)
    east, north = to_map.transform(*block.lonlath.T[:2])
    return np.stack([east, north, block.lonlath[:, 2]], axis=1)


def _capture(i, lonlath, angles):
    lon, lat, height = lonlath.tolist()
    kind = "yaw_pitch_roll" if angles is None else "omega_phi_kappa"
    orientation = {
        "type": kind,
        "angles_deg": scene.YPR[i].tolist() if angles is None else angles,
        "sigmas_deg": [0.03, 0.02, 0.01],
    }
    return {
        "id": i,
        "rig_model_source": "user",
        "cameras": [{"id": 10 * i + head, "sensor_id": head + 1} for head in (0, 1)],
        "reference_camera_id": 10 * i,
        "geolocation": {
            "crs": {"definition": scene.GEOGRAPHIC},
            "coordinates": [lat, lon, height],
            "sigmas": [0.04, 0.05, 0.1],
        },
        "orientation": orientation if angles is None else {**orientation, "crs": scene.CRS},
        "time": "2020-09-25T09:12:53Z",
    }


def _sensor(number):
    sensor = {
        "id": number,
        "name": f"head {number}",
        "bands": [{"name": "Red", "weight": 1}],
        "image_size_px": [scene.WIDTH, scene.HEIGHT],
        "pixel_size_um": 1000 * scene.PIXEL_MM,
        "internals": _internals(1440.0),
        "shutter_type": "global",
    }
    if number == 1:
        return sensor
    rig = {
        "translation": {"values_m": BASE.tolist(), "sigmas_m": [0.001, 0.001, 0.002]},
        "rotation": {"angles_deg": [0, 0, 0], "sigmas_deg": [0.05, 0.05, 0.1]},
    }
    return {**sensor, "rig_relatives": rig}


def _after(number):
    sensor = {"id": number, "internals": _internals(scene.F)}
    if number == 1:
        return sensor
    rig = {"translation": BASE.tolist(), "rotation_angles_deg": ANGLES.tolist()}
    return {**sensor, "rig_relatives": rig}


def _internals(f):
    return {
        "type": "perspective",
        "principal_point_px": [scene.CX, scene.CY],
        "focal_length_px": f,
        "radial_distortion": [scene.K1, scene.K2, scene.K3],
        "tangential_distortion": [scene.P1, scene.P2],
    }


def _gcps(points, marks):
    return [
        {
            "id": f"P{k}",
            "geolocation": {
                "crs": {"definition": scene.CRS},
                "coordinates": at.tolist(),
                "sigmas": [0.02, 0.02, 0.03],
            },
            "marks": marks[k],
            "is_checkpoint": k == 8,
        }
        for k, at in enumerate(points)
    ]
