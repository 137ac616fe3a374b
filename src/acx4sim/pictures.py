"""Pictures of the heads.

Exact rays to the scenery, light, lens and sensor; taken for a whole flight.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from threading import Event
from typing import Any, Protocol

import cv2
import numpy as np
import tifffile
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from acx4sim.drawing import FloatImage, GroundWindow, cell_m
from acx4sim.earth import Array, Grid, axes_of_enu_in_ecef, terrain_height
from acx4sim.fly import Track, fly, ground_points, poses_in_ecef, stream
from acx4sim.optics import Camera, bent, correction, project
from acx4sim.plan import BlockPlan, Plan
from acx4sim.scenery import Country, Landscape, Photo, read_photo

# --- Pictures of the ground, taken by a camera with the exact model
#
# Tile by tile, the ground points of the pixels are computed exactly at nodes and by polynomials
# between them. Every pixel is the mean of 2 x 2 samples. The ground is a raster with cells of
# about the size of a sample.


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
KEPT = 400
"""Tiles of ground that are kept in all, 0.6 GB."""

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

    It keeps the tiles used last; several threads may use it at the same time. A copy with
    another ground keeps the tiles of both.

    Attributes
    ----------
    ground : Ground
        The painter.
    n_kept : int
        Number of tiles to keep, of 1.6 MB each.
    """

    ground: Ground
    n_kept: int = KEPT
    _kept: "OrderedDict[tuple[int, int, int, int], Picture]" = field(
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
        key = id(self.ground), level, row, col
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Station:
    """The true pose of the aircraft at one exposure, and the ground under it.

    Attributes
    ----------
    plan : Plan
        The flight.
    block : str
        Name of its block.
    track : Track
        The true body frame at this one exposure.
    marks_g : ndarray, shape (n, 3)
        True east, north, height of the block's surveyed points, m; they lie on the ground.
    latitude : float
        Latitude for `earth.terrain_height`, rad, with which these points lie on the ground.
    """

    plan: Plan
    block: str
    track: Track
    marks_g: Array
    latitude: float

    @property
    def exposure(self) -> str:
        """Name of the exposure."""
        return self.track.exposure[0]

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras that expose here."""
        return self.plan.blocks[self.block].cameras


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
    dn = cv2.resize(fine.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(dn, cv2.COLOR_RGBA2RGB))


def _with_middles(cells: Picture) -> Picture:
    """Insert a value between every two cells, by polynomials of the fifth degree.

    Returns a fourth, empty band: pixels of 64 bit are copied and interpolated faster than of 48.

    OpenCV's cubic and Lanczos interpolation shift a slope by up to 0.05 and 0.03 cells, its linear
    one does not. With cells of half the size, linear interpolation keeps structures of four pixels
    to 0.001 pixels.
    """
    rows, cols = cells.shape[:2]
    exact = cv2.cvtColor(cells, cv2.COLOR_RGB2RGBA).astype(np.float32)
    beside = cv2.sepFilter2D(exact, -1, _MIDDLE, _ITSELF, anchor=(2, 0))
    above = cv2.sepFilter2D(exact, -1, _ITSELF, _MIDDLE, anchor=(0, 2))
    between = cv2.sepFilter2D(beside, cv2.CV_16U, _ITSELF, _MIDDLE, anchor=(0, 2))
    fine = np.empty((rows, 2, cols, 2), np.uint64)
    fine[:, 0, :, 0] = _pixels(exact)
    fine[:, 0, :, 1] = _pixels(beside)
    fine[:, 1, :, 0] = _pixels(above)
    fine[:, 1, :, 1] = between.view(np.uint64)[..., 0]
    return fine.view(np.uint16).reshape(2 * rows, 2 * cols, 4)


def _pixels(values: cv2.typing.MatLike) -> NDArray[np.uint64]:
    """Return the four bands of each pixel, rounded to 16 bit, as one number."""
    whole = cv2.add(values, np.zeros(4), dtype=cv2.CV_16U)
    return whole.view(np.uint64)[..., 0]


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
    return {name: _camera_image(at, name, ground, reduce=reduce, seed=seed) for name in at.cameras}


def _camera_image(
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


# --- Pictures taken on a simulated flight


Tell = Callable[[str, int, int], None]
_THREADS = 2


class _StoppedError(Exception):
    """Another picture failed, or the command was interrupted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Photography:
    """The exposures of a flight with pictures, and the ground that they show.

    Attributes
    ----------
    stations : tuple of Station
        The exposures.
    reduce : int
        The pictures have 1/reduce of the size.
    photo : Photo, optional
        Photograph on the ground; by default it is the procedural landscape.
    seed : int
        Seed of the flight.
    """

    stations: tuple[Station, ...]
    reduce: int
    photo: Photo | None
    seed: int

    def orders(self) -> list[tuple[str, Station, str]]:
        """Return path inside the flight, exposure and camera of every picture."""
        return [
            (f"{at.block}/images/{_image_name(at, camera)}.tif", at, camera)
            for at in self.stations
            for camera in at.cameras
        ]


def _image_name(at: Station, camera: str) -> str:
    """Return the name of a camera's image in images.csv."""
    return f"{at.exposure}_{camera}" if len(at.cameras) > 1 else at.exposure


def order(
    plan: Plan, seed: int, exposures: Sequence[str], reduce: int, photo: str | Path | None
) -> Photography:
    """Order pictures of exposures.

    Raises
    ------
    ValueError
        Where the plan has no such exposure, none is named, or `reduce` leaves no pixel.
    OSError
        Where the photo does not exist or cannot be read.
    """
    names = list(dict.fromkeys(exposures))
    if not names:
        msg = "no exposure is named that is to have pictures"
        raise ValueError(msg)
    stations = tuple(station(plan, name, seed=seed) for name in names)
    for at in stations:
        for camera in at.cameras:
            reduced(plan.cameras[camera], reduce)
    return Photography(
        stations=stations,
        reduce=reduce,
        photo=None if photo is None else read_photo(photo),
        seed=seed,
    )


def told(ordered: Photography) -> dict[str, Any]:
    """Return the true values of the pictures, for JSON."""
    cameras = dict.fromkeys(camera for _, _, camera in ordered.orders())
    return {
        "note": (
            "A camera's DN are the ground's times gain times the cosine of the angle off the axis "
            "(through the middle of the image, at the true focal length) to a power."
        ),
        "exposures": [at.exposure for at in ordered.stations],
        "reduce": ordered.reduce,
        "ground": "landscape" if ordered.photo is None else ordered.photo.name,
        "bands": list(BANDS),
        "response": {name: asdict(camera_response(name, ordered.seed)) for name in cameras},
    }


def take(ordered: Photography, folder: Path, tell: Tell) -> None:
    """Take all pictures and write them into the folder of a flight.

    Parameters
    ----------
    ordered : Photography
        The pictures to take.
    folder : Path
        Folder of the flight.
    tell : callable
        Called with the name of a picture, its number of finished parts, and of all parts.
    """
    blocks = {at.block: at for at in ordered.stations}
    grounds = {block: _ground(ordered, at) for block, at in blocks.items()}
    tiles = Tiles(ground=next(iter(grounds.values())))
    stop = Event()

    def take_one(path: str, at: Station, camera: str) -> None:
        def pass_on(done: int, total: int) -> None:
            if stop.is_set():
                raise _StoppedError
            tell(Path(path).stem, done, total)

        pixels = _camera_image(
            at,
            camera,
            replace(tiles, ground=grounds[at.block]),
            reduce=ordered.reduce,
            seed=ordered.seed,
            tell=pass_on,
        )
        (folder / path).parent.mkdir(exist_ok=True)
        tifffile.imwrite(folder / path, pixels, photometric="rgb", metadata=None, software="")

    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(_THREADS) as pool:
        jobs = [pool.submit(take_one, *one) for one in ordered.orders()]
        try:
            for job in jobs:
                job.result()
        except BaseException:  # also after an interruption the other pictures are not finished
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise


def _ground(ordered: Photography, at: Station) -> Ground:
    if ordered.photo is not None:
        return ordered.photo
    return landscape(at, seed=ordered.seed)


def landscape(at: Station, *, seed: int = 1) -> Landscape:
    """Return the procedural landscape of a block, with its surveyed points painted on it.

    Parameters
    ----------
    at : Station
        Any exposure of the block.
    seed : int
        Another seed gives different noise, fields and houses.
    """
    middle = at.plan.blocks[at.block].centre_m
    return Landscape(country=Country(seed=seed, middle=middle), marks=at.marks_g[:, :2])


# --- Exact projection from the pixels of a camera to the ground and back
#
# A ray is followed through lens, mounting, attitude and, if the flight has refraction, the air, to
# the point where it meets the hills.


_MAX_STEPS = 40
_GAP_M = 1e-7
_AIR_STEPS = 3  # each adds four correct digits


def station(plan: Plan, exposure: str, *, seed: int = 1) -> Station:
    """Return the station of a flight's exposure, without simulating the flight.

    Parameters
    ----------
    plan : Plan
        The flight, for instance `acx4_plan()`.
    exposure : str
        Name of the exposure, for instance ``H3-04``, or with its block, ``heads/H3-04``.
    seed : int
        Seed of the flight.

    Raises
    ------
    ValueError
        Where the plan has no such exposure; the message names some that it has.
    """
    some = []
    for name, block in plan.blocks.items():
        track = fly(plan, block, stream(seed, plan.draws, name, "fly"))
        own = exposure.removeprefix(f"{name}/")
        if own in track.exposure:
            return _station(plan, name, track, track.exposure.index(own))
        some += [track.exposure[0], track.exposure[-1]]
    msg = f"exposure {exposure!r} is not in {plan.name}; it has, for instance, {', '.join(some)}"
    raise ValueError(msg)


def _station(plan: Plan, name: str, track: Track, i: int) -> Station:
    marks_g = _marks(plan, plan.blocks[name])
    at = Track(
        exposure=track.exposure[i : i + 1],
        strip=track.strip[i : i + 1],
        time_s=track.time_s[i : i + 1],
        x_g=track.x_g[i : i + 1],
        R_enu_b=track.R_enu_b[i : i + 1],
        places=track.places[i : i + 1],
    )
    llh = Grid(crs=plan.crs).geodetic_from_grid(marks_g)
    return Station(
        plan=plan, block=name, track=at, marks_g=marks_g, latitude=float(llh[:, 0].mean())
    )


def _marks(plan: Plan, block: BlockPlan) -> Array:
    return ground_points(plan, block, block.targets if len(block.targets) else plan.control)


def reduced(camera: Camera, k: int) -> Camera:
    """Return the camera of an image at 1/k of the size, which covers the middle of the sensor.

    Raises
    ------
    ValueError
        Where k is not positive, or no pixel is left.
    """
    if k < 1 or min(camera.width_px, camera.height_px) < k:
        msg = f"an image cannot be reduced {k} times; it takes a whole number from 1 on"
        raise ValueError(msg)
    return replace(
        camera,
        width_px=camera.width_px // k,
        height_px=camera.height_px // k,
        pixel_um=camera.pixel_um * k,
    )


def ground_from_pixels(at: Station, camera: Camera, colrow: Array) -> Array:
    """Find the ground points that pixels see.

    Parameters
    ----------
    at : Station
        The exposure.
    camera : Camera
        Any camera on the IMU, with its lens, boresight and lever arm.
    colrow : ndarray, shape (n, 2)
        Pixels; they may lie outside the sensor.

    Returns
    -------
    x_g : ndarray, shape (n, 3)
        East, north and ellipsoidal height of the true ground, m, with errors below 1e-6; NaN
        where a ray does not reach the ground.
    """
    grid = Grid(crs=at.plan.crs)
    r_e_c, R_e_c = poses_in_ecef(grid, at.track, camera.boresight_deg, np.array(camera.lever_m))
    seen = _rays(camera, colrow) @ R_e_c[0].T
    straight = seen
    llh = _meet(at, grid, r_e_c[0], straight)
    for _ in range(_AIR_STEPS if at.plan.refraction == "standard" else 0):
        ray = grid.ecef_from_geodetic(llh) - r_e_c[0]
        turned = _unit(bent(ray, axes_of_enu_in_ecef(llh)[:, :, 2], llh[:, 2])) - _unit(ray)
        straight = _unit(seen - turned)
        llh = _meet(at, grid, r_e_c[0], straight)
    return grid.grid_from_geodetic(llh)


def _rays(camera: Camera, colrow: Array) -> Array:
    """Return unit vectors in the camera frame, from the left sides of eqs (1) and (2)."""
    pixel = camera.pixel_um / 1000
    x = (colrow[:, 0] - (camera.width_px - 1) / 2) * pixel - camera.xp_mm
    y = ((camera.height_px - 1) / 2 - colrow[:, 1]) * pixel - camera.yp_mm
    xy = np.column_stack([x, y])
    ideal = xy - correction(camera, xy)[0]
    return _unit(np.column_stack([ideal, np.full(len(ideal), -camera.f_mm)]))


def _unit(x: Array) -> Array:
    return np.asarray(x / np.linalg.norm(x, axis=-1, keepdims=True))


def _meet(at: Station, grid: Grid, r_e: Array, ray_e: Array) -> Array:
    """Return latitude, longitude, height where rays from one point meet the hills."""
    up = axes_of_enu_in_ecef(grid.geodetic_from_ecef(r_e[None]))[0, :, 2]
    fall = -(ray_e @ up)
    fall = np.where(fall > 0.05, fall, np.nan)
    way = (at.track.x_g[0, 2] - at.plan.ground_m) / fall
    for _ in range(_MAX_STEPS):
        llh = grid.geodetic_from_ecef(r_e + way[:, None] * ray_e)
        height = terrain_height(llh, at.plan.ground_m, latitude=at.latitude, relief=at.plan.relief)
        gap = llh[:, 2] - height
        if not np.nanmax(np.abs(gap), initial=0.0) > _GAP_M:
            break
        way = way + gap / fall
    return llh


def pixels_from_ground(at: Station, camera: Camera, x_g: Array) -> Array:
    """Project ground points.

    Parameters
    ----------
    at : Station
        The exposure.
    camera : Camera
        Any camera on the IMU.
    x_g : ndarray, shape (n, 3)
        East, north, ellipsoidal height, m.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Pixels; NaN far outside the sensor.
    """
    grid = Grid(crs=at.plan.crs)
    r_e_c, R_e_c = poses_in_ecef(grid, at.track, camera.boresight_deg, np.array(camera.lever_m))
    llh = grid.geodetic_from_grid(x_g)
    ray = grid.ecef_from_geodetic(llh) - r_e_c[0]
    if at.plan.refraction == "standard":
        ray = bent(ray, axes_of_enu_in_ecef(llh)[:, :, 2], x_g[:, 2])
    return project(camera, ray @ R_e_c[0])
