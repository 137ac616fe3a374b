"""A picture with its approximate orientation: from its pixels to the ground and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
from scipy.ndimage import map_coordinates

from acx4files.images.head_images import image_from_file, is_whole
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy, mountings, xy_from_colrow
from acx4lib.geometry.collinearity import project, rays
from acx4lib.geometry.frames import Pose
from acx4lib.synthetic_image.frame import reduced_camera

AT_HAND = 6
"""Pictures that a process keeps decoded: one is matched with several others in turn."""

DECODED = (".jpg", ".jpeg", ".png")
"""Files that OpenCV decodes; others are read as TIFF."""

_DOWN = -0.05  # least fall of a ray, as a part of its length, to be followed to the ground
_STEPS = 6
_AT_A_TIME = 64  # reduced rows, so that a file that is mapped needs little memory


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A picture at the size at which it is matched.

    Attributes
    ----------
    name : str
        Of the image.
    path : Path
    declared : Camera
        As the flight declares it, at full size.
    camera : Camera
        At the size of the matching, with the best interior orientation so far.
    T_m_c : Pose
        One pose, the best so far.
    shrink : int
        Full-size pixels along one pixel of the matching.
    """

    name: str
    path: Path
    declared: Camera
    camera: Camera
    T_m_c: Pose
    shrink: int

    def full(self, colrow: Array) -> Array:
        """Return pixels of the matching as pixels of the declared camera, shape (n, 2)."""
        return colrow_from_xy(self.declared, xy_from_colrow(self.camera, colrow))

    def own(self, colrow: Array) -> Array:
        """Return pixels of the declared camera as pixels of the matching, shape (n, 2)."""
        return colrow_from_xy(self.camera, xy_from_colrow(self.declared, colrow))


def declared_views(block: Block, paths: Sequence[Path]) -> list[View]:
    """Return the pictures of a block with their approximate orientations, at full size.

    Parameters
    ----------
    block : Block
        With one image for each file.
    paths : sequence of Path
    """
    T_m_c = block.T_m_b_images @ mountings(block.cameras)[block.images.camera_idx]
    cameras = [block.cameras[k] for k in block.images.camera_idx]
    return [
        View(name=name, path=path, declared=c, camera=c, T_m_c=T_m_c[i : i + 1], shrink=1)
        for i, (name, path, c) in enumerate(zip(block.images.names, paths, cameras, strict=True))
    ]


def seen_at(view: View, shrink: int) -> View:
    """Return the same view for matching at another size."""
    camera = reduced_camera(view.declared, shrink).with_interior(view.camera.interior)
    return replace(view, camera=camera, shrink=shrink)


def ground_of(view: View, surface: Surface, colrow: Array) -> Array:
    """Return where the rays of pixels meet the ground, shape (n, 3), m; NaN where they do not."""
    T_m_c = Pose(R=np.broadcast_to(view.T_m_c.R[:1], (len(colrow), 3, 3)), r=view.T_m_c.r[:1])
    ray = rays(view.camera, T_m_c, colrow)
    ray[ray[:, 2] > _DOWN] = np.nan
    from_m = view.T_m_c.r[0]
    z = np.full(len(colrow), float(np.mean(surface.z)))
    for _ in range(_STEPS):
        x_m = from_m + ray * ((z - from_m[2]) / ray[:, 2])[:, None]
        z = surface.heights(np.nan_to_num(x_m[:, :2]))
    x_m[(z >= from_m[2]) | np.isnan(ray[:, 2])] = np.nan
    return np.asarray(x_m)


def pixels_of(view: View, x_m: Array) -> Array:
    """Return the pixels of points, shape (n, 2); NaN where they are not seen."""
    out = np.full((len(x_m), 2), np.nan)
    known = np.isfinite(x_m[:, 0])
    out[known] = project(view.camera, view.T_m_c, x_m[known])
    return out


def transferred(a: View, b: View, surface: Surface, colrow: Array) -> Array:
    """Return the pixels of picture b that show the ground at pixels of picture a, shape (n, 2)."""
    return pixels_of(b, ground_of(a, surface, colrow))


# --- pixels ----------------------------------------------------------------------------------


def size_on_file(path: Path, camera: Camera) -> int:
    """Return K of a picture that has 1/K of its camera's size; FlightError for any other size."""
    return max(camera.width_px // _on_file(path, camera).shape[1], 1)


@lru_cache(maxsize=AT_HAND)
def pixels(path: Path, declared: tuple[int, int], shrink: int) -> np.ndarray:
    """Return the pixels of a picture at 1/shrink of the declared size, (rows, cols, bands).

    Parameters
    ----------
    path : Path
    declared : tuple of int
        Width and height of the camera, px.
    shrink : int
        A multiple of the factor by which the file itself is reduced.
    """
    width, height = declared
    camera = Camera(
        name=path.name, width_px=width, height_px=height, pixel_mm=0.001, interior=Interior(f=1.0)
    )
    image = _on_file(path, camera)
    reduce = shrink // max(declared[0] // image.shape[1], 1)
    return image if reduce <= 1 else _reduced(image, declared, shrink, reduce)


def pixels_of_view(view: View) -> np.ndarray:
    """Return the pixels of a view, (rows, cols, bands)."""
    size = view.declared.width_px, view.declared.height_px
    return pixels(view.path, size, view.shrink)


def _on_file(path: Path, camera: Camera) -> Raster:
    """Return the pixels of a picture of a camera's size or 1/K of it, (rows, cols, bands).

    JPEG and PNG as grey values.
    """
    if path.suffix.lower() not in DECODED:
        return image_from_file(path, camera).image
    if not path.is_file():
        raise FlightError([f"{path}: there is no such file"])
    data = path.read_bytes()
    is_picture = data.startswith((b"\xff\xd8", b"\x89PNG"))
    if is_picture and not is_whole(data):
        raise FlightError([f"{path}: is cut off, its pixels have no end; copy it again"])
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if is_picture else None
    if image is None:
        raise FlightError([f"{path}: is damaged, its pixels cannot be decoded; copy it again"])
    rows, cols = image.shape
    k = max(camera.width_px // cols, 1)
    if (cols, rows) != (camera.width_px // k, camera.height_px // k):
        says = f"has {cols} x {rows} px; {camera.name} has {camera.width_px} x {camera.height_px}"
        raise FlightError([f"{path}: {says}, and its pictures that or 1/K of it, K a whole number"])
    return np.expand_dims(np.asarray(image, np.uint8), 2)


def _reduced(image: Raster, declared: tuple[int, int], shrink: int, reduce: int) -> Array:
    """Return the means of pixels, around the middle of an image, (rows, cols, 1).

    Where one row or column is left over, the mean of the two ways to leave it out is centred.
    """
    cols, rows = (n // shrink for n in declared)
    spare = image.shape[0] - rows * reduce, image.shape[1] - cols * reduce
    ways = [{n // 2, (n + 1) // 2} for n in spare]
    out = np.zeros((rows, cols, 1), np.float32)
    for top, left in ((top, left) for top in ways[0] for left in ways[1]):
        for start in range(0, rows, _AT_A_TIME):
            stop = min(start + _AT_A_TIME, rows)
            part = image[top + start * reduce : top + stop * reduce, left : left + cols * reduce]
            small = cv2.resize(part, (cols, stop - start), interpolation=cv2.INTER_AREA)
            out[start:stop, :, 0] += small.reshape(stop - start, cols, -1).mean(axis=2)
    return out / (len(ways[0]) * len(ways[1]))


# --- The ground under a block, as far as it is known: a height for every place


CELLS = 48
"""Cells along the longer side of a surface; between them heights are bilinear."""

SMOOTH = (1.0, 3.0, 9.0, 27.0)
"""Widths, in cells, of the means from which a cell takes its height: the first that has points."""

_LEAST_WEIGHT = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Heights of the ground in the mapping frame.

    Attributes
    ----------
    origin : ndarray, shape (2,)
        x, y of the first cell's middle, m.
    cell_m : float
    z : ndarray, shape (rows, cols)
        m; rows count along y. Beyond the surface the nearest height holds.
    """

    origin: Array
    cell_m: float
    z: Array

    def heights(self, xy: Array) -> Array:
        """Return the heights at places, shape (n,), m."""
        cells = (xy - self.origin) / self.cell_m
        return map_coordinates(self.z, cells.T[::-1], order=1, mode="nearest")


def level(z: float) -> Surface:
    """Return a plane of one height, m."""
    return Surface(origin=np.zeros(2), cell_m=1.0, z=np.full((1, 1), float(z)))


def through(x_m: Array) -> Surface:
    """Return a smooth surface through points of the ground.

    Parameters
    ----------
    x_m : ndarray, shape (n, 3)
        At least one point, m; single points that are far off its neighbours have little effect,
        as a cell takes the median of its points.
    """
    origin = x_m[:, :2].min(axis=0)
    cell = max(float(np.ptp(x_m[:, :2], axis=0).max()) / (CELLS - 1), 1e-3)
    place = np.rint((x_m[:, :2] - origin) / cell).astype(np.intp)
    shape = tuple(place.max(axis=0)[::-1] + 1)
    z, seen = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    mean = float(np.median(x_m[:, 2]))
    medians = pd.Series(x_m[:, 2] - mean).groupby([place[:, 1], place[:, 0]]).median()
    rows, cols = (medians.index.get_level_values(k) for k in (0, 1))
    z[rows, cols], seen[rows, cols] = medians, 1
    return Surface(origin=origin, cell_m=cell, z=mean + _filled(z, seen).astype(float))


def _filled(z: Array, seen: Array) -> Array:
    """Return a smooth surface where only some cells are seen."""
    out, open_cells = np.zeros_like(z), np.ones(z.shape, bool)
    for width in SMOOTH:
        weight = cv2.GaussianBlur(seen, (0, 0), width, borderType=cv2.BORDER_CONSTANT)
        total = cv2.GaussianBlur(z * seen, (0, 0), width, borderType=cv2.BORDER_CONSTANT)
        enough = open_cells & (weight * 2 * np.pi * width**2 > _LEAST_WEIGHT)
        out[enough] = (total / np.maximum(weight, 1e-12))[enough]
        open_cells &= ~enough
    return out
