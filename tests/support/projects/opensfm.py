"""A small project of OpenSfM whose points are known, written line by line."""

import json

import cv2
import numpy as np

from acx4lib.geometry import frames

MODEL = {
    "projection_type": "brown",
    "width": 400,
    "height": 300,
    "focal_x": 0.9,
    "focal_y": 0.9,
    "c_x": 0.01,
    "c_y": -0.02,
    "k1": -0.05,
    "k2": 0.01,
    "p1": 0.001,
    "p2": -0.002,
    "k3": 0.0,
}
LLA = {"latitude": -25.4, "longitude": -49.3, "altitude": 900.0}
POINTS = np.array([[-20.0, -15, 0], [20, -15, 2], [20, 15, 1], [-20, 15, 3], [0, 0, 5]])
CENTRES = np.array([[-10.0, 0, 60], [10, 5, 61], [0, -12, 62], [12, 10, 63]])
DOWN = np.diag([1.0, -1, -1])  # x right is east, y down is south, z ahead is down


def seen(model, R, centre, points=POINTS):
    """Return normalised points by the formulas of OpenSfM's documentation."""
    x, y, z = ((points - centre) @ R.T).T
    x, y = x / z, y / z
    r2 = x * x + y * y
    d = 1 + r2 * (model["k1"] + r2 * (model["k2"] + r2 * model["k3"]))
    u = d * x + 2 * model["p1"] * x * y + model["p2"] * (r2 + 2 * x * x)
    v = d * y + 2 * model["p2"] * x * y + model["p1"] * (r2 + 2 * y * y)
    at = (model["focal_x"] * u + model["c_x"], model["focal_y"] * v + model["c_y"])
    return np.stack(at, axis=1)


def shot(R, centre, **more):
    return {
        "rotation": cv2.Rodrigues(R)[0].ravel().tolist(),
        "translation": (-R @ centre).tolist(),
        "camera": "m",
        "gps_position": centre.tolist(),
        "gps_dop": 5.0,
    } | more


def turned(k):
    return frames.exp(np.array([0.02 * k, -0.03, 0.3 * k])) @ DOWN


def reconstruction(model=MODEL, **more):
    shots = {f"{k}.jpg": shot(turned(k), one) for k, one in enumerate(CENTRES)}
    points = {str(k): {"coordinates": one.tolist()} for k, one in enumerate(POINTS)}
    whole = {"cameras": {"m": dict(model)}, "shots": shots, "points": points, "reference_lla": LLA}
    return whole | more


def tracks(model=MODEL, header="OPENSFM_TRACKS_VERSION_v2"):
    lines = [header] if header else []
    for k, centre in enumerate(CENTRES):
        for n, (u, v) in enumerate(seen(model, turned(k), centre)):
            row = [f"{k}.jpg", n, 7, repr(float(u)), repr(float(v)), 0.01, 1, 2, 3, -1, -1]
            lines.append("\t".join(map(str, row[: 11 if header else 5])))
    return "\n".join(lines) + "\n"


def write(folder, whole=None, **files):
    folder.mkdir(exist_ok=True)
    (folder / "reconstruction.json").write_text(json.dumps([whole or reconstruction()]))
    (folder / "tracks.csv").write_text(tracks())
    for name, value in files.items():
        (folder / f"{name}.json").write_text(json.dumps(value))
    return folder
