"""Pictures of the ground, taken by a camera with the exact model.

Tile by tile, the ground points of the pixels are computed exactly at nodes and by polynomials
between them. Every pixel is the mean of 2 x 2 samples. The ground is a raster with cells of about
the size of a sample.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from acx4sim.earth import Array
from acx4sim.fly import stream
from acx4sim.optics.lens import Camera
from acx4sim.pictures.ground_rays import Station, ground_from_pixels, reduced
from acx4sim.scenery.noise import FloatImage, GroundWindow, cell_m

Picture = NDArray[np.uint16]

BANDS = ("red", "green", "blue")
WHITE = 65535
SHOT_NOISE = 0.5  # DN per square root of DN, in a pixel of full size
_GAIN = 0.05
_COSINE = (2.35, 3.0)  # power of the cosine: 20 to 25 % less light in the corner of a head
_BAND_COSINE = 0.03
_NODES = 16  # per tile and axis
_TILE_PX = 512
_GROUND_TILE = 512
_MARGIN = 4  # cells, for interpolation
_MIDDLE = np.array([3, -25, 150, 150, -25, 3], np.float32) / 256
_ITSELF = np.ones(1, np.float32)


class Ground(Protocol):
    """A ground that can be photographed."""

    def paint(self, window: GroundWindow) -> Picture:
        """Return the ground's DN in a window, shape (rows, cols, 3), red first."""


@dataclass(frozen=True, kw_only=True)
class CameraResponse:
    """The dependence of a camera's DN on those of the ground.

    Attributes
    ----------
    gain : tuple of float
        Factor of every band.
    cosine : tuple of float
        Per band, the power of cos(angle from the axis) with which the light decreases.
    """

    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    cosine: tuple[float, float, float] = (0.0, 0.0, 0.0)


def camera_response(name: str, seed: int) -> CameraResponse:
    """Draw the response of a camera."""
    rng = stream(seed, name, "response")
    gain = 1 + rng.uniform(-_GAIN, _GAIN, 3)
    cosine = rng.uniform(*_COSINE) * (1 + rng.uniform(-_BAND_COSINE, _BAND_COSINE, 3))
    return CameraResponse(gain=_three(gain), cosine=_three(cosine))


def _three(values: Array) -> tuple[float, float, float]:
    red, green, blue = (round(float(value), 6) for value in values)
    return red, green, blue


@dataclass(frozen=True, kw_only=True, eq=False)
class Tiles:
    """A ground painted in tiles, which all pictures share.

    It keeps the tiles used last; several threads may use it at the same time.

    Attributes
    ----------
    ground : Ground
        The painter.
    n_kept : int
        Number of tiles to keep, of 1.6 MB each.
    """

    ground: Ground
    n_kept: int = 400
    _kept: "OrderedDict[tuple[int, int, int], Picture]" = field(
        default_factory=OrderedDict, repr=False
    )
    _lock: Any = field(default_factory=threading.Lock, repr=False)

    def paint(self, window: GroundWindow) -> Picture:
        """Return the ground's DN in a window, shape (rows, cols, 3)."""
        picture = np.empty((window.rows, window.cols, 3), np.uint16)
        for row in _tiles_over(window.row, window.rows):
            for col in _tiles_over(window.col, window.cols):
                top, left = row * _GROUND_TILE - window.row, col * _GROUND_TILE - window.col
                to_rows = slice(max(top, 0), top + _GROUND_TILE)
                to_cols = slice(max(left, 0), left + _GROUND_TILE)
                here = picture[to_rows, to_cols]
                tile = self._tile(window.level, row, col)
                top, left = to_rows.start - top, to_cols.start - left
                here[:] = tile[top : top + here.shape[0], left : left + here.shape[1]]
        return picture

    def _tile(self, level: int, row: int, col: int) -> Picture:
        key = level, row, col
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        n = _GROUND_TILE
        tile = self.ground.paint(
            GroundWindow(level=level, row=row * n, col=col * n, rows=n, cols=n)
        )
        with self._lock:
            self._kept[key] = tile
            while len(self._kept) > self.n_kept:
                self._kept.popitem(last=False)
        return tile


def _tiles_over(first: int, n: int) -> range:
    return range(first // _GROUND_TILE, (first + n - 1) // _GROUND_TILE + 1)


def picture(
    at: Station,
    camera: Camera,
    ground: Ground,
    *,
    reduce: int = 1,
    responds: CameraResponse | None = None,
    noise: np.random.Generator | None = None,
    tell: Callable[[int, int], None] = lambda *_: None,
) -> Picture:
    """Return the picture that a camera takes at an exposure.

    Parameters
    ----------
    at : Station
        The exposure: true body frame and hills.
    camera : Camera
        Any camera on the IMU, at full size.
    ground : Ground
        The ground; `Tiles` of it save time where several pictures show it.
    reduce : int
        The picture has 1/reduce of the size, and covers the middle of the sensor.
    responds : CameraResponse, optional
        Gain and vignetting; by default a pixel has the DN of the ground.
    noise : Generator, optional
        It draws the shot noise, 0.5 sqrt(DN) in a pixel of full size; by default there is none.
    tell : callable
        Called with the number of finished rows of the picture, and of all rows.

    Returns
    -------
    ndarray of uint16, shape (rows, cols, 3)
        Red, green, blue.
    """
    small = reduced(camera, reduce)
    image = np.empty((small.height_px, small.width_px, 3), np.uint16)
    for rows, cols, part in parts(at, small, ground):
        dn = part if responds is None else part * _factor(responds, small, rows, cols)
        if noise is not None:
            spread = np.sqrt(np.maximum(dn, 0)) * np.float32(SHOT_NOISE / reduce)
            dn = dn + spread * noise.standard_normal(dn.shape, dtype=np.float32)
        image[rows, cols] = np.clip(np.rint(dn), 0, WHITE)
        tell(rows.stop if cols.stop == small.width_px else rows.start, small.height_px)
    return image


def parts(at: Station, camera: Camera, ground: Ground) -> Iterator[tuple[slice, slice, FloatImage]]:
    """Yield a picture in tiles: rows, columns and DN, without response and noise."""
    ground = ground if isinstance(ground, Tiles) else Tiles(ground=ground)
    tile = _tile_size(camera)
    tops = np.arange(0, camera.height_px, tile)
    lefts = np.arange(0, camera.width_px, tile)
    nodes = _ground_at_nodes(at, camera, tops, lefts, tile)
    level = _level(nodes, tile)
    for i, top in enumerate(tops):
        for j, left in enumerate(lefts):
            rows = slice(int(top), min(int(top) + tile, camera.height_px))
            cols = slice(int(left), min(int(left) + tile, camera.width_px))
            down = _weights(rows.stop - rows.start, tile)
            along = _weights(cols.stop - cols.start, tile)
            yield rows, cols, _samples(ground, level, nodes[i, :, j], down, along)


def _tile_size(camera: Camera) -> int:
    """Return the size of tiles: at most 1/18 of the field, so that polynomials can fit hills."""
    return min(_TILE_PX, max(16, -(-max(camera.width_px, camera.height_px) // 18)))


def _ground_at_nodes(
    at: Station, camera: Camera, tops: NDArray[np.int64], lefts: NDArray[np.int64], tile: int
) -> Array:
    """Return east and north, m, at the tiles' Chebyshev nodes: (n, nodes, n, nodes, 2)."""
    places = tile * (_chebyshev() + 1) / 2 - 0.5
    row, col = tops[:, None] + places, lefts[:, None] + places
    colrow = np.stack(np.meshgrid(col.ravel(), row.ravel()), axis=-1).reshape(-1, 2)
    en = ground_from_pixels(at, camera, colrow)[:, :2]
    return en.reshape(*row.shape, *col.shape, 2)


def _chebyshev() -> Array:
    return np.asarray(-np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES))


@lru_cache(maxsize=64)
def _weights(n: int, tile: int) -> Array:
    """Return the weights of the nodes for the samples of a tile's first n pixels: (2 n, nodes)."""
    x = (np.arange(2 * n) + 0.5) / tile - 1
    k = np.arange(_NODES)
    node = np.cos(k[:, None] * np.arccos(_chebyshev()))
    weights: Array = (
        np.cos(np.arccos(x)[:, None] * k) @ (node * np.where(k, 2, 1)[:, None]) / _NODES
    )
    return weights


def _level(nodes: Array, tile: int) -> int:
    """Return the level with cells of nearly half a pixel in the middle of the picture."""
    middle = nodes[nodes.shape[0] // 2, :, nodes.shape[2] // 2]
    a, b = middle[-1, 0] - middle[0, -1], middle[-1, -1] - middle[0, 0]
    span = tile * np.cos(np.pi / 2 / _NODES)
    pixel_m = np.sqrt(abs(a[0] * b[1] - a[1] * b[0]) / 2) / span
    return round(np.log2(pixel_m / 2 / cell_m(0)))


def _samples(ground: Ground, level: int, nodes: Array, down: Array, along: Array) -> FloatImage:
    """Return the DN of a tile: the mean of 2 x 2 samples of the ground."""
    cells = nodes.transpose(2, 0, 1) / cell_m(level) - 0.5
    low = np.floor(cells.min(axis=(1, 2))).astype(int) - _MARGIN
    high = np.ceil(cells.max(axis=(1, 2))).astype(int) + _MARGIN
    n_cols, n_rows = high - low + 1
    window = GroundWindow(level=level, row=int(low[1]), col=int(low[0]), rows=n_rows, cols=n_cols)
    x, y = (
        (down @ (plane - start) @ along.T).astype(np.float32)
        for plane, start in zip(cells, low, strict=True)
    )
    fine = cv2.remap(_with_middles(ground.paint(window)), 2 * x, 2 * y, cv2.INTER_LINEAR)
    size = len(along) // 2, len(down) // 2
    return np.asarray(cv2.resize(fine.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _with_middles(cells: Picture) -> Picture:
    """Insert a value between every two cells, by polynomials of the fifth degree.

    OpenCV's cubic and Lanczos interpolation shift a slope by up to 0.05 and 0.03 cells, its linear
    one does not. With cells of half the size, linear interpolation keeps structures of four pixels
    to 0.001 pixels.
    """
    fine = np.empty((2 * cells.shape[0], 2 * cells.shape[1], 3), np.uint16)
    fine[::2, ::2] = cells
    fine[::2, 1::2] = cv2.sepFilter2D(cells, -1, _MIDDLE, _ITSELF, anchor=(2, 0))
    fine[1::2, ::2] = cv2.sepFilter2D(cells, -1, _ITSELF, _MIDDLE, anchor=(0, 2))
    fine[1::2, 1::2] = cv2.sepFilter2D(cells, -1, _MIDDLE, _MIDDLE, anchor=(2, 2))
    return fine


def _factor(responds: CameraResponse, camera: Camera, rows: slice, cols: slice) -> FloatImage:
    """Return gain times vignetting in a part of a picture, shape (rows, cols, 3)."""
    pixel = camera.pixel_um / 1000 / camera.f_mm
    x = (np.arange(cols.start, cols.stop) - (camera.width_px - 1) / 2) * pixel
    y = (np.arange(rows.start, rows.stop) - (camera.height_px - 1) / 2) * pixel
    log_cosine = np.log1p(y[:, None] ** 2 + x**2).astype(np.float32) / -2
    power = np.array(responds.cosine, np.float32)
    return np.exp(log_cosine[..., None] * power) * np.array(responds.gain, np.float32)


def head_images(
    at: Station, ground: Ground, *, reduce: int = 1, seed: int = 1
) -> Mapping[str, Picture]:
    """Return the pictures of all cameras that expose at a station, as in the flight.

    Parameters
    ----------
    at : Station
        The exposure.
    ground : Ground
        The ground.
    reduce : int
        As in `picture`.
    seed : int
        Seed of the flight, for responses and noise.
    """
    ground = Tiles(ground=ground)
    return {name: camera_image(at, name, ground, reduce=reduce, seed=seed) for name in at.cameras}


def camera_image(
    at: Station,
    name: str,
    ground: Ground,
    *,
    reduce: int = 1,
    seed: int = 1,
    tell: Callable[[int, int], None] = lambda *_: None,
) -> Picture:
    """Return the picture of one camera of the flight, with its response and noise."""
    return picture(
        at,
        at.plan.cameras[name],
        ground,
        reduce=reduce,
        responds=camera_response(name, seed),
        noise=stream(seed, at.exposure, name, "pixels"),
        tell=tell,
    )
