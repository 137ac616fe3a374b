"""Others that sample an image at given places; each is made ready first, and called then.

A function of `PEERS` takes an image, shape (rows, cols, bands), and places in it, shape
(m, n, 2), col and row; it returns a call without arguments that gives the samples, (m, n, bands).
"""

from __future__ import annotations

import importlib.util
import math
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from scipy import ndimage

from acx4lib.synthetic_image.frame import synthetic_from_head
from benchmarks.rendering.scene import Scene
from support.pictures import exact_rendering

Sampler = Callable[[], np.ndarray]


def remap(image: np.ndarray, at: np.ndarray, method: int = cv2.INTER_LINEAR) -> Sampler:
    """OpenCV, with maps in single precision."""
    x, y = (np.ascontiguousarray(at[..., axis], np.float32) for axis in (0, 1))
    return lambda: cv2.remap(image, x, y, method, borderMode=cv2.BORDER_CONSTANT)


def remap_cubic(image: np.ndarray, at: np.ndarray) -> Sampler:
    """OpenCV's cubic; its polynomial is another one than Catmull and Rom's."""
    return remap(image, at, cv2.INTER_CUBIC)


def scipy(image: np.ndarray, at: np.ndarray) -> Sampler:
    """scipy.ndimage, band by band."""
    places = np.ascontiguousarray(np.moveaxis(at[..., ::-1], -1, 0))
    bands = [np.ascontiguousarray(band) for band in np.moveaxis(image, -1, 0)]

    def sample() -> np.ndarray:
        samples = [
            ndimage.map_coordinates(b, places, order=1, mode="nearest", output=image.dtype)
            for b in bands
        ]
        return np.stack(samples, axis=-1)

    return sample


def skimage(image: np.ndarray, at: np.ndarray) -> Sampler:
    """scikit-image, band by band; its results are floating-point numbers."""
    from skimage.transform import warp  # noqa: PLC0415 not everywhere

    places = np.ascontiguousarray(np.moveaxis(at[..., ::-1], -1, 0))
    bands = [np.ascontiguousarray(band) for band in np.moveaxis(image, -1, 0)]

    def sample() -> np.ndarray:
        samples = [warp(b, places, order=1, mode="edge", preserve_range=True) for b in bands]
        return np.stack(samples, axis=-1)

    return sample


def pyvips(image: np.ndarray, at: np.ndarray) -> Sampler:
    """libvips, on one thread."""
    os.environ["VIPS_CONCURRENCY"] = "1"  # read when it is first loaded
    import pyvips as vips  # noqa: PLC0415 not everywhere

    source = vips.Image.new_from_array(image)
    places = vips.Image.new_from_array(np.ascontiguousarray(at, np.float32))
    bilinear = vips.Interpolate.new("bilinear")
    return lambda: source.mapim(places, interpolate=bilinear).numpy()


def oracle(image: np.ndarray, at: np.ndarray) -> Sampler:
    """The plain double-precision computation, its map not counted."""
    flat = at.reshape(-1, 2)
    return lambda: exact_rendering.sampled(image, flat).reshape(*at.shape[:2], -1)


PEERS: dict[str, Callable[[np.ndarray, np.ndarray], Sampler]] = {
    "remap_linear": remap,
    "remap_cubic": remap_cubic,
    "pyvips": pyvips,
    "scipy": scipy,
    "skimage": skimage,
    "oracle": oracle,
}

MODULES = {"pyvips": "pyvips", "skimage": "skimage"}


def missing(name: str) -> bool:
    """Tell whether the package that a name needs is not installed."""
    return name in MODULES and importlib.util.find_spec(MODULES[name]) is None


def cut(image: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the part of an image that places need, and the places in that part."""
    size, margin = np.array(image.shape[1::-1]), 4
    low = np.clip(np.floor(at.min(axis=(0, 1))).astype(int) - margin, 0, size)
    high = np.clip(np.ceil(at.max(axis=(0, 1))).astype(int) + margin + 1, 0, size)
    return np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]]), at - low


# --- the same work for Hugin: its project file, and how its programs are called ----------------


PROGRAMS = ("nona", "enblend")
BILINEAR = 5  # of the interpolators that a project file knows
SMALL = 0.01  # share of a head's width that tells how the head is turned


def installed() -> dict[str, str]:
    """Return the versions of the programs that are there."""
    found = {}
    for name in PROGRAMS:
        if shutil.which(name):
            # nona says it in its help, and calls that an error
            said = subprocess.run(
                [name, "--version" if name == "enblend" else "--help"],
                capture_output=True,
                text=True,
                check=False,
            )
            lines = f"{said.stdout}\n{said.stderr}".splitlines()
            found[name] = next(
                (line.split()[-1] for line in lines if line.startswith(f"{name} ")), "unknown"
            )
    return found


def project(scene: Scene) -> str:
    """Return the text of a project: an ideal image, and the heads where ours have them."""
    camera = scene.synthetic
    view = field_of_view_deg(camera.width_px * camera.pixel_mm, camera.interior.f)
    lines = [
        f"p f0 w{camera.width_px} h{camera.height_px} v{view:.9f} E0 R0 "
        'T"UINT16" n"TIFF_m c:NONE r:CROP"',
        f"m g1 i{BILINEAR} f0 m2",
    ]
    for k, (head, file) in enumerate(zip(scene.orientation.heads, scene.files, strict=True)):
        yaw, pitch, roll = angles_deg(scene, k)
        view = field_of_view_deg(head.width_px * head.pixel_mm, head.interior.f)
        lines.append(
            f"i w{head.width_px} h{head.height_px} f0 v{view:.9f} Ra0 Rb0 Rc0 Rd0 Re0 Eev0 Er1 Eb1 "
            f"r{roll:.9f} p{pitch:.9f} y{yaw:.9f} a0 b0 c0 d0 e0 g0 t0 Va1 Vb0 Vc0 Vd0 Vx0 Vy0 "
            f'Vm5 n"{file.resolve()}"'
        )
    return "\n".join([*lines, "v", ""])


def field_of_view_deg(width_mm: float, f_mm: float) -> float:
    """Return the horizontal field of view."""
    return math.degrees(2 * math.atan(width_mm / 2 / f_mm))


def angles_deg(scene: Scene, k: int) -> tuple[float, float, float]:
    """Return yaw, pitch and roll of a head: where its middle looks, and how it is turned there."""
    head = scene.orientation.heads[k]
    col, row = (head.width_px - 1) / 2, (head.height_px - 1) / 2
    places = np.array([[col, row], [col + SMALL * head.width_px, row]])
    xy = synthetic_from_head(scene.orientation, k, places)
    middle, right = np.column_stack([xy, np.full(2, scene.synthetic.interior.f)])
    yaw = math.atan2(middle[0], middle[2])
    pitch = math.atan2(middle[1], math.hypot(middle[0], middle[2]))
    c, s = math.cos(yaw), math.sin(yaw)
    x, z = c * right[0] - s * right[2], s * right[0] + c * right[2]
    y = math.cos(pitch) * right[1] - math.sin(pitch) * z
    roll = -math.atan2(y, x)  # counted clockwise
    return math.degrees(yaw), math.degrees(pitch), math.degrees(roll)


def nona(project_file: Path, folder: Path) -> list[str]:
    """Return the command that makes a layer of each head."""
    return ["nona", "-z", "NONE", "-o", str(folder / "layer"), str(project_file)]


def enblend(folder: Path) -> list[str]:
    """Return the command that makes one image of the layers."""
    layers = sorted(str(path) for path in folder.glob("layer*.tif"))
    return ["enblend", "-o", str(folder / "blended.tif"), *layers]
