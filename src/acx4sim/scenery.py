"""A ground to take pictures of: a landscape drawn from noise, or a photograph.

The landscape has fields, lanes, villages, trees, water, and texture at every scale. A map says
where they are, and the coloured shapes of `drawing`, which gives every place its own random
numbers, draw them. A picture can lie on the ground instead.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from acx4sim.drawing import (
    Canvas,
    FloatImage,
    GroundWindow,
    Shapes,
    doubled,
    draw,
    draw_any,
    draw_labels,
    fractal,
    rectangles,
    scattered,
    shapes,
    white,
)
from acx4sim.earth import Array

Picture = NDArray[np.uint16]

_BRIGHTEST = 56_000.0  # DN of a perfect white
_CLIP = 64_000.0
_HAZE = (700.0, 1000.0, 1500.0)
_FARMS, _HEDGES = 0.08, 0.3  # shares of the cells and of the lanes
_HEDGE_BESIDE = np.array([4.5, -4.5])
_MEADOW = (126, 142, 94, 150)
_WATER = np.array([50, 68, 74, 5], np.float32)
_SHALLOW = np.array([92, 100, 84, 60], np.float32)
_BANK = np.array([152, 144, 112, 150], np.float32)
_BANK_M, _SHORE_PLAY = 7.0, 18.0
_WATER_LEVEL = 5  # cells of 2 m in which the shore is computed
_ROUGH = 0.045  # amplitude of the noise of a meadow at each size up to 4 m
_ROUGHNESS = ((np.arange(256) / 150) ** 2).astype(np.float32)
_PATCHES = {5: 0.02, 6: 0.025, 7: 0.03, 8: 0.03, 9: 0.03, 10: 0.03}
_COLOURS = {2: 0.012, 4: 0.015, 6: 0.02, 8: 0.025}
_WHEELS_M, _GAUGE_M = 24.0, 0.9
_REPEAT_M = 504.0  # a multiple of the spacings of all rows and wheels
_DISC_M, _PAD_M = 0.3, 0.9


@dataclass(frozen=True, kw_only=True, eq=False)
class _Fields:
    """Areas of fields, units across their rows (n, 2), spacing (m) and contrasts of rows (n, 3)."""

    shapes: Shapes
    across: Array
    rows: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cell:
    """The content of a cell of the net, in layers; later layers cover earlier ones."""

    fields: _Fields
    ground: list[Shapes]
    tracks: list[Shapes]
    roads: list[Shapes]
    bridges: list[Shapes]
    shadows: list[Shapes]
    bodies: list[Shapes]


@dataclass(frozen=True, kw_only=True)
class Country:
    """The positions of lanes, water, woods and villages.

    Attributes
    ----------
    seed : int
        Another seed gives different fields, houses, trees.
    middle : tuple of float
        East and north of a point near which the first lake, river and village lie, m.
    """

    seed: int
    middle: tuple[float, float]

    def map_from_net(self, uv: Array) -> Array:
        """Return east and north of positions in the straight net, shape (..., 2), m."""
        bent = uv.copy()
        for axis, a, b, amplitude, phase in _BENDS:
            bent[..., axis] += amplitude * np.sin(a * uv[..., 0] + b * uv[..., 1] + phase)
        c, s = np.cos(_TURN), np.sin(_TURN)
        x, y = bent[..., 0], bent[..., 1]
        return np.stack([c * x - s * y, s * x + c * y], axis=-1) + self.middle

    def cells_around(self, low: Array, high: Array) -> list[tuple[int, int]]:
        """Return the cells of the net that may overlap a rectangle of the map."""
        c, s = np.cos(_TURN), np.sin(_TURN)
        x, y = np.meshgrid([low[0], high[0]], [low[1], high[1]])
        x, y = x - self.middle[0], y - self.middle[1]
        uv = np.stack([(c * x + s * y).ravel(), (c * y - s * x).ravel()])
        reach = sum(bend[3] for bend in _BENDS)  # for both axes, so more than enough, for roofs too
        first = np.floor((uv.min(axis=1) - reach) / PITCH).astype(int)
        last = np.floor((uv.max(axis=1) + reach) / PITCH).astype(int)
        return [(a, b) for b in range(first[1], last[1] + 1) for a in range(first[0], last[0] + 1)]

    def rng(self, a: int, b: int, purpose: int) -> np.random.Generator:
        """Return the random numbers of a cell."""
        return np.random.default_rng([self.seed, a + 2**31, b + 2**31, purpose])

    def water_m(self, en: Array) -> Array:
        """Return the distance to the shore of lakes and rivers, positive on the water, m."""
        return np.maximum(self.lake_m(en), self.river_m(en))

    def lake_m(self, en: Array) -> Array:
        """Return the distance to the shore of a lake, positive on the water, m."""
        first = np.add(self.middle, (1213.0, -871.0))
        x = _around(en, first, _LAKES, self.seed)
        bearing = np.arctan2(x[..., 1], x[..., 0])
        lobes = (
            1
            + 0.20 * np.cos(2 * bearing + 1.0)
            + 0.10 * np.cos(3 * bearing + 0.3)
            + 0.04 * np.cos(7 * bearing + 2.0)
            + 0.015 * np.cos(19 * bearing)
        )
        return np.asarray(_LAKE_M * lobes - np.linalg.norm(x, axis=-1))

    def river_m(self, en: Array) -> Array:
        """Return the distance to the bank of a river, positive on the water, m."""
        x = en - self.middle
        along, across = 0.62 * x[..., 0] + 0.785 * x[..., 1], 0.62 * x[..., 1] - 0.785 * x[..., 0]
        across = across - 560.0
        across = across - _RIVERS * np.rint(across / _RIVERS)
        phase = 2 * np.pi * along
        bend = 105 * np.sin(phase / 1380) + 45 * np.sin(phase / 590 + 1) + 6 * np.sin(phase / 97)
        slope = 0.48 * np.cos(phase / 1380) + 0.48 * np.cos(phase / 590 + 1)
        width = _RIVER_M + 7 * np.sin(phase / 433) + 1.5 * np.sin(phase / 61)
        return np.asarray(width - np.abs(across - bend) / np.hypot(1, slope))

    def woods(self, en: Array) -> Array:
        """Return a number that is positive in the woods, shape (...)."""
        x = en - self.middle
        waves = np.stack([np.sin(a * x[..., 0] + b * x[..., 1] + c) for a, b, c in _WOODS], axis=-1)
        return np.asarray(waves @ _WOODS_WEIGHT - _WOODS_FROM)

    def village_m(self, en: Array) -> Array:
        """Return the distance inside the edge of a village, m."""
        x = _around(en, np.add(self.middle, (-520.0, 240.0)), _VILLAGES, self.seed + 1)
        return np.asarray(_VILLAGE_M - np.linalg.norm(x, axis=-1))


@lru_cache(maxsize=600)
def _cell(country: Country, a: int, b: int) -> _Cell:
    rng = country.rng(a, b, 7)
    ground, shadows, bodies, garden = _buildings(country, a, b, rng)
    places, radii = _planted(country, a, b, rng)
    places = np.concatenate([places, garden])
    radii = np.concatenate([radii, rng.uniform(1.4, 3.4, len(garden))])
    wood = _trees(places, radii, rng)
    tracks, roads = _lane_shapes(country, a, b)
    return _Cell(
        fields=_fields(country, a, b),
        ground=[wood.floor, *ground],
        tracks=tracks,
        roads=roads,
        bridges=_bridge_shapes(country, a, b),
        shadows=[*shadows, wood.shadows],
        bodies=[*_car_shapes(country, a, b), *bodies, wood.crowns],
    )


def _buildings(
    country: Country, a: int, b: int, rng: np.random.Generator
) -> tuple[list[Shapes], list[Shapes], list[Shapes], Array]:
    """Return ground, shadows and roofs of a village or a farm, and the positions of its trees."""
    middle = country.map_from_net((np.array([a, b]) + 0.5) * PITCH)
    if country.village_m(middle) > 0:
        of = _village(country, a, b)
        return of.ground, of.shadows, of.roofs, of.trees
    if rng.random() < _FARMS:
        shadow, roof = _farm(country, a, b)
        return [], [shadow], [roof], np.empty((0, 2))
    return [], [], [], np.empty((0, 2))


def _planted(country: Country, a: int, b: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return positions and radii of the trees of woods and hedges."""
    found = [_wood_places(country, a, b)]
    for axis in (0, 1):
        if rng.random() < _HEDGES:
            beside = _lane(country, a, b, axis)[2:-2] + _HEDGE_BESIDE
            found.append(_row_places(country, beside, rng))
    places, radii = zip(*found, strict=True)
    return np.concatenate(places), np.concatenate(radii)


@dataclass(frozen=True, kw_only=True, eq=False)
class Landscape:
    """The landscape around a position.

    Attributes
    ----------
    country : Country
        Its map.
    marks : ndarray, shape (n, 2)
        East and north of the signalised points, m: white discs of 60 cm on dark squares.
    """

    country: Country
    marks: Array = field(default_factory=lambda: np.empty((0, 2)))

    def paint(self, window: GroundWindow) -> Picture:
        """Return the ground's DN in a window, shape (rows, cols, 3), red first."""
        east, north = window.en()
        around = self.country.cells_around(
            np.array([east[0], north[0]]), np.array([east[-1], north[-1]])
        )
        cells = [_cell(self.country, a, b) for a, b in around]
        patches = fractal(window, _PATCHES, self.country.seed)
        canvas = np.tile(np.array(_MEADOW, np.uint8), (window.rows, window.cols, 1))
        _sow(canvas, window, [cell.fields for cell in cells], patches)
        for layer in ("ground", "tracks", "roads"):
            _draw_all(canvas, window, [getattr(cell, layer) for cell in cells])
        wet = _flood(canvas, window, self.country, patches)
        for layer in ("bridges", "shadows", "bodies"):
            _draw_all(canvas, window, [getattr(cell, layer) for cell in cells])
        dn = _textured(canvas, window, patches * (1 - wet), self.country.seed)
        _mark(dn, window, self.marks)
        bands = [(np.clip(band, 0, _CLIP) + 0.5).astype(np.uint16) for band in dn]
        return np.asarray(cv2.merge(bands), np.uint16)


def _draw_all(canvas: Canvas, window: GroundWindow, layers: list[list[Shapes]]) -> None:
    for layer in layers:
        for one in layer:
            draw(canvas, window, one)


def _sow(canvas: Canvas, window: GroundWindow, sown: list[_Fields], patches: FloatImage) -> None:
    """Draw fields, their rows and wheel tracks."""
    labels = np.zeros(canvas.shape[:2], np.int16)
    first = 1
    for one in sown:
        draw_any(canvas, window, one.shapes)
        draw_labels(labels, window, one.shapes, first)
        first += len(one.across)
    across = np.concatenate([[[0.0, 0.0]], *(one.across for one in sown)])
    rows = np.concatenate([[[1.0, 0.0, 0.0]], *(one.rows for one in sown)])
    field = labels.astype(np.intp)
    east, north = window.en()
    cell = np.float32(window.cell_m)
    start = (across @ [east[0], north[0]]) % _REPEAT_M
    ce, cn = (across * window.cell_m).astype(np.float32).T
    way = start.astype(np.float32).take(field)
    way += ce.take(field) * np.arange(window.cols, dtype=np.float32)
    way += cn.take(field) * np.arange(window.rows, dtype=np.float32)[:, None]
    spacing, contrast, wheels = rows.T
    seen = np.clip(spacing / window.cell_m / 4 - 0.5, 0, 1) * contrast
    turns = (2 * np.pi / spacing).astype(np.float32).take(field) * way
    tone = seen.astype(np.float32).take(field) * np.sin(turns) * (1 + 8 * patches)
    off = np.abs(way - np.float32(_WHEELS_M) * np.rint(way / np.float32(_WHEELS_M)))
    wide = max(0.3, float(cell))
    tracks = np.maximum(1 - np.abs(off - np.float32(_GAUGE_M)) / np.float32(wide), 0)
    tone -= (wheels * 0.3 / wide).astype(np.float32).take(field) * tracks
    tone += 1
    tone = np.clip(tone, 0, 1.2, out=tone)
    *colours, rough = cv2.split(canvas)
    cv2.merge([*((colour * tone).astype(np.uint8) for colour in colours), rough], canvas)


def _shore(window: GroundWindow, country: Country) -> FloatImage:
    """Return the distance to the shore, m, computed in coarse cells."""
    if window.level >= _WATER_LEVEL:
        east, north = window.en()
        en = np.stack(np.meshgrid(east, north), axis=-1)
        return country.water_m(en).astype(np.float32)
    coarser = window.coarser()
    return doubled(_shore(coarser, country), coarser, window, cv2.INTER_LINEAR)


def _is_far_from_water(window: GroundWindow, country: Country) -> bool:
    east, north = window.en()
    corners = np.stack(np.meshgrid(east[[0, -1]], north[[0, -1]]), axis=-1)
    across = np.hypot(window.rows, window.cols) * window.cell_m
    return bool(country.water_m(corners).max() < -across - 20)


def _flood(
    canvas: Canvas, window: GroundWindow, country: Country, patches: FloatImage
) -> FloatImage:
    """Draw lakes and rivers with their banks; return the share of water."""
    if _is_far_from_water(window, country):
        return np.zeros((1, 1), np.float32)
    shore = _shore(window, country)
    shore = shore + np.float32(_SHORE_PLAY) * patches
    if shore.max() < -_BANK_M:
        return np.zeros((1, 1), np.float32)
    wet: FloatImage = np.clip(shore / window.cell_m + 0.5, 0, 1)
    bank = np.clip((shore + _BANK_M) / 5, 0, 1)
    depth = np.clip(shore / 14, 0, 1)
    bands = []
    for band, deep, shallow, sand in zip(cv2.split(canvas), _WATER, _SHALLOW, _BANK, strict=True):
        ground = band + bank * (sand - band)
        water = shallow + depth * (deep - shallow)
        bands.append((ground + wet * (water - ground)).astype(np.uint8))
    cv2.merge(bands, canvas)
    return wet


def _textured(canvas: Canvas, window: GroundWindow, patches: FloatImage, seed: int) -> FloatImage:
    """Convert colours to DN and add noise, shape (3, rows, cols)."""
    *colours, roughness = cv2.split(canvas)
    rough = fractal(window, dict.fromkeys(range(-3, 6), _ROUGH), seed + 1)
    rough *= cv2.LUT(roughness, _ROUGHNESS)
    rough += patches
    hue = fractal(window, _COLOURS, seed + 2)
    hue *= np.minimum(roughness * np.float32(1 / 60), 1)
    squares = ((np.arange(256) / 255) ** 2 * _BRIGHTEST).astype(np.float32)
    bright = np.exp(rough, out=rough)
    dn = np.empty((3, window.rows, window.cols), np.float32)
    for i, (turn, haze) in enumerate(zip((1.0, 0.2, -1.2), _HAZE, strict=True)):
        tint = bright * (1 + np.float32(turn) * hue)
        np.multiply(cv2.LUT(colours[i], squares), tint, out=dn[i])
        dn[i] += np.float32(haze)
    return dn


def _mark(dn: FloatImage, window: GroundWindow, marks: Array) -> None:
    """Paint the signalised points; a cell at an edge is mixed by the share that is covered."""
    cell = window.cell_m
    for east, north in marks:
        col, row = east / cell - 0.5 - window.col, north / cell - 0.5 - window.row
        reach = _PAD_M / cell + 2
        cols = np.arange(max(int(col - reach), 0), min(int(col + reach) + 1, window.cols))
        rows = np.arange(max(int(row - reach), 0), min(int(row + reach) + 1, window.rows))
        if not (cols.size and rows.size):
            continue
        x, y = (cols - col) * cell, ((rows - row) * cell)[:, None]
        part = dn[:, rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        _blend(part, _covered(_PAD_M - np.maximum(np.abs(x), np.abs(y)), cell), 3200.0)
        _blend(part, _disc(x, y, cell), 46_000.0)


def _covered(inside_m: Array, cell: float) -> FloatImage:
    return np.clip(inside_m / cell + 0.5, 0, 1).astype(np.float32)


def _disc(x: Array, y: Array, cell: float) -> FloatImage:
    """Return the share of every cell that the disc covers, from 8 x 8 samples."""
    play = (np.arange(8) + 0.5) / 8 * cell - cell / 2
    xx = (x[:, None] + play) ** 2
    yy = (y[:, :, None].reshape(-1, 1) + play) ** 2
    inside = yy[:, None, :, None] + xx[None, :, None, :] < _DISC_M**2
    return inside.mean(axis=(2, 3)).astype(np.float32)


def _blend(part: FloatImage, share: FloatImage, dn: float) -> None:
    part += share * (np.float32(dn) - part)


# --- A real photograph on the ground


_HALVED_LEVEL = 2  # 25 cm: a pixel of the photo is 12.5 cm, of the halved photo 25 cm
_COUNT = 256  # numbers of the halved photos for one of the photo
_DITHER = 0.29  # standard deviation of the rounding of the photo to 8 bit
_SALT = 3
_MOST_PIXELS = 1 << 30  # OpenCV does not read more


@dataclass(frozen=True, kw_only=True, eq=False)
class Photo:
    """A photograph that covers the plane, mirrored at its edges.

    Attributes
    ----------
    name : str
        Name of its file.
    halves : tuple of ndarray of uint16, shape (rows, cols, 3)
        The photo, north first, halved once, twice, ...; 256 for one number of the 8 bit.
    """

    name: str
    halves: tuple[Picture, ...]

    def paint(self, window: GroundWindow) -> Picture:
        """Return the photo's DN in a window, shape (rows, cols, 3), red first.

        DN are proportional to the square of the photo's numbers, which are made for a screen.
        """
        k = min(max(window.level - _HALVED_LEVEL, 0), len(self.halves) - 1)
        step = 2.0 ** (window.level - _HALVED_LEVEL - k)
        source = self.halves[k]
        east, north = window.en()
        x, y = np.meshgrid(
            _mirrored(east / window.cell_m * step - 0.5, source.shape[1]),
            _mirrored(-north / window.cell_m * step - 0.5, source.shape[0]),
        )
        counts = cv2.remap(
            source,
            x.astype(np.float32),
            y.astype(np.float32),
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REFLECT,
        )
        fine = np.stack([white(window, _SALT + band) for band in range(3)], axis=-1)
        shares = np.clip(counts / np.float32(_COUNT) + fine * _DITHER, 0, 255) / 255
        return np.asarray(np.rint(shares**2 * _BRIGHTEST), np.uint16)


def _mirrored(x: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Fold positions into a picture of n pixels, outer edges at -0.5 and n - 0.5."""
    return np.asarray(n - np.abs((x + 0.5) % (2 * n) - n) - 0.5)


def read_photo(path: str | Path) -> Photo:
    """Read a photograph from a JPEG, PNG or TIFF, converted to 8 bit and colour.

    Raises
    ------
    OSError
        Where the file does not exist, cannot be read or is too large.
    """
    image = _decoded(os.fspath(path))
    if image is None or min(image.shape[:2]) < 2:
        msg = "is not a picture that can be read; give a JPEG, PNG or TIFF"
        raise OSError(errno.EINVAL, msg, os.fspath(path))
    counts = image.astype(np.uint16)
    counts *= _COUNT
    halves = [_half(counts)]
    while min(halves[-1].shape[:2]) > 64:
        halves.append(_half(halves[-1]))
    return Photo(name=Path(path).name, halves=tuple(halves))


def _decoded(path: str) -> NDArray[np.uint8] | None:
    """Return a picture, None for a file that is none; raise an OSError for one too large."""
    if Path(path).exists() and not (Path(path).is_file() or Path(path).is_dir()):
        raise OSError(errno.EINVAL, "is no file", path)
    try:
        data = np.fromfile(path, np.uint8)
        with _silent():
            image = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB) if len(data) else None
    except (cv2.error, MemoryError):
        msg = f"is too large a picture; at most {_MOST_PIXELS:,} pixels that fit into memory"
        raise OSError(errno.EFBIG, msg, path) from None
    return None if image is None else np.asarray(image, np.uint8)


@contextmanager
def _silent() -> Iterator[None]:
    """Suppress what the picture libraries themselves print to standard error."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _half(image: Picture) -> Picture:
    size = image.shape[1] // 2, image.shape[0] // 2
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint16)


# --- The map of an invented country: its net of lanes, its water, woods and villages


PITCH = np.array([290.0, 210.0])  # of the net of lanes, m
_TURN = np.radians(17.0)
_BENDS = (  # direction of the shift, wave numbers in u and v (rad/m), amplitude m, phase
    (0, 0.0009, 0.0041, 38.0, 0.3),
    (1, 0.0047, 0.0012, 32.0, 1.9),
    (0, 0.0071, -0.0052, 13.0, 4.0),
    (1, -0.0063, 0.0083, 11.0, 2.2),
)
_WOODS = (  # wave numbers in east and north, rad/m, phase
    (0.0049, 0.0021, 0.9),
    (-0.0031, 0.0062, 2.6),
    (0.0104, -0.0071, 5.0),
    (0.0067, 0.0121, 1.3),
    (0.0310, 0.0170, 3.3),
    (-0.0230, 0.0360, 0.4),
)
_WOODS_WEIGHT = np.array([1.0, 1.0, 0.8, 0.8, 0.22, 0.22])
_WOODS_FROM = 1.25
_LAKES, _LAKE_M = 5200.0, 430.0
_VILLAGES, _VILLAGE_M = 2700.0, 330.0
_RIVERS, _RIVER_M = 6500.0, 27.0


def _around(en: Array, first: Array, pitch: float, seed: int) -> Array:
    """Return positions relative to the nearest of many spread centres, of which one is `first`."""
    x = en - first
    index = np.rint(x / pitch).astype(np.int64)
    here = x - index * pitch
    h = scattered(index[..., 1], index[..., 0], seed)
    play = np.stack([h & np.uint32(1023), (h >> np.uint32(10)) & np.uint32(1023)], axis=-1) / 1023
    moved = np.any(index != 0, axis=-1, keepdims=True)
    return np.asarray(here - moved * (play - 0.5) * 0.3 * pitch)


# --- Fields with furrows, and the lanes between them


_STEPS = 10  # corners along a side of a field
_MARGIN_M = 1.1
_PAVED_EVERY = (4, 5)
_TRACKS = 0.6  # share of the other lanes

# red, green, blue, roughness; spacing of rows m, their contrast, contrast of wheel tracks;
# frequency
CROPS = np.array(
    [
        [196, 180, 136, 125, 0.5, 0.05, 0.16, 3],  # ripe wheat
        [122, 146, 96, 130, 0.5, 0.06, 0.20, 4],  # young wheat
        [92, 120, 76, 155, 0.75, 0.13, 0.05, 4],  # maize
        [132, 142, 96, 145, 0.9, 0.14, 0.05, 3],  # soya
        [164, 124, 100, 140, 1.4, 0.09, 0.02, 2],  # tilled, red soil
        [132, 102, 86, 165, 2.1, 0.12, 0.02, 2],  # ploughed
        [186, 170, 138, 140, 3.0, 0.08, 0.05, 3],  # stubble
        [136, 152, 104, 150, 6.0, 0.03, 0.00, 3],  # meadow
        [124, 138, 96, 160, 9.0, 0.02, 0.00, 2],  # pasture
        [202, 192, 100, 130, 0.5, 0.03, 0.18, 1],  # rape in flower
        [176, 154, 124, 150, 1.0, 0.05, 0.03, 2],  # bare, dry
    ]
)
_ASPHALT = (116, 116, 119, 85)
_VERGE = (150, 146, 118, 140)
_WHITE = (226, 226, 222, 60)
_EARTH = (176, 158, 128, 130)
_GRASS = (122, 138, 92, 155)
_CONCRETE = (172, 170, 164, 70)


def _fields(country: Country, a: int, b: int) -> _Fields:
    """Divide a cell into strips, each with a crop."""
    rng = country.rng(a, b, 2)
    axis = int(rng.random() < 0.35)
    cuts = _cuts(rng, PITCH[1 - axis])
    outlines = np.stack(
        [
            _outline(country, np.array([a, b]) * PITCH, axis, low, high)
            for low, high in pairwise(cuts)
        ]
    )
    n = len(outlines)
    crop = CROPS[rng.choice(len(CROPS), n, p=CROPS[:, 7] / CROPS[:, 7].sum())]
    colours = crop[:, :4].copy()
    colours[:, :3] *= rng.uniform(0.9, 1.08, (n, 1)) * rng.uniform(0.96, 1.04, (n, 3))
    along = outlines[:, _STEPS - 1] - outlines[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    return _Fields(shapes=shapes(outlines, colours), across=across, rows=crop[:, 4:7])


def _cuts(rng: np.random.Generator, length_m: float) -> Array:
    """Return the positions where a cell is cut into strips."""
    widths = rng.uniform(0.4, 1.6, rng.integers(2, 7))
    return np.asarray(np.concatenate([[0.0], np.cumsum(widths)]) / widths.sum() * length_m)


def _outline(country: Country, corner: Array, axis: int, low: float, high: float) -> Array:
    """Return the outline of the strip from `low` to `high`, along `axis` of the net."""
    way = np.linspace(3.5, PITCH[axis] - 3.5, _STEPS)
    low, high = low + _MARGIN_M + 2 * (low == 0), high - _MARGIN_M
    sides = np.concatenate(
        [
            np.column_stack([way, np.full(_STEPS, low)]),
            np.column_stack([way[::-1], np.full(_STEPS, high)]),
        ]
    )
    return country.map_from_net(corner + (sides[:, ::-1] if axis else sides))


def _lane(country: Country, a: int, b: int, axis: int) -> Array:
    """Return the line of a cell's first side along an axis of the net, shape (n, 2)."""
    way = np.linspace(0, PITCH[axis], 31)[:, None] * np.eye(2)[axis]
    return country.map_from_net(np.array([a, b]) * PITCH + way)


def _is_paved(a: int, b: int, axis: int) -> bool:
    """Tell whether the lane along a cell's side has asphalt."""
    return (a % _PAVED_EVERY[0] == 1) if axis else (b % _PAVED_EVERY[1] == 2)


def _lane_shapes(country: Country, a: int, b: int) -> tuple[list[Shapes], list[Shapes]]:
    """Build the tracks and the roads along the two first sides of a cell."""
    rng = country.rng(a, b, 3)
    tracks: list[Shapes] = []
    roads: list[Shapes] = []
    for axis in (0, 1):
        line = _lane(country, a, b, axis)
        if _is_paved(a, b, axis):
            roads += _paved(line)
        elif rng.random() < _TRACKS:
            tracks += _track(line)
    return tracks, roads


def _paved(line: Array) -> list[Shapes]:
    fine = np.column_stack(
        [np.interp(np.linspace(0, 30, 121), np.arange(31), line[:, i]) for i in range(2)]
    )
    dashes = _ribbons(fine, -0.07, 0.07, overlap_m=0.0)[::4]
    return [
        shapes(_ribbons(line, -5.2, 5.2), _VERGE),
        shapes(_ribbons(line, -3.6, 3.6), _ASPHALT),
        _thin(_ribbons(line, -3.32, -3.18), _WHITE, 0.14, _ASPHALT),
        _thin(_ribbons(line, 3.18, 3.32), _WHITE, 0.14, _ASPHALT),
        _thin(dashes, _WHITE, 0.14, _ASPHALT),
    ]


def _thin(
    outlines: Array, colour: tuple[int, ...], width_m: float, under: tuple[int, int, int, int]
) -> Shapes:
    """Return narrow polygons as shapes."""
    return replace(shapes(outlines, colour), width_m=width_m, under=under)


def _ribbons(line: Array, from_m: float, to_m: float, overlap_m: float = 0.5) -> Array:
    """Return the quadrangles of a band along a line, shape (n - 1, 4, 2)."""
    along = np.gradient(line, axis=0)
    left = np.column_stack([-along[:, 1], along[:, 0]])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    a, b = line + from_m * left, line + to_m * left
    reach = np.diff(line, axis=0)
    reach *= overlap_m / np.linalg.norm(reach, axis=1, keepdims=True)
    return np.stack([a[:-1] - reach, a[1:] + reach, b[1:] + reach, b[:-1] - reach], axis=1)


def _bridge_shapes(country: Country, a: int, b: int) -> list[Shapes]:
    """Build the bridges of paved lanes over a river."""
    found: list[Shapes] = []
    for axis in (0, 1):
        line = _lane(country, a, b, axis)
        over = (country.river_m(line) > -9) & (country.lake_m(line) < -30)
        if not (_is_paved(a, b, axis) and over.any()):
            continue
        span = np.flatnonzero(over)
        part = line[max(span[0] - 1, 0) : span[-1] + 2]
        found.append(shapes(_ribbons(part + 3.6 * SHADOW, -4.6, 4.6), (26, 34, 38, 8)))
        found.append(shapes(_ribbons(part, -4.6, 4.6), _CONCRETE))
        found.append(shapes(_ribbons(part, -3.6, 3.6), _ASPHALT))
        found.append(_thin(_ribbons(part, -3.32, -3.18), _WHITE, 0.14, _ASPHALT))
        found.append(_thin(_ribbons(part, 3.18, 3.32), _WHITE, 0.14, _ASPHALT))
    return found


def _track(line: Array) -> list[Shapes]:
    return [
        shapes(_ribbons(line, -2.4, 2.4), _GRASS),
        shapes(_ribbons(line, -1.35, -0.55), _EARTH),
        shapes(_ribbons(line, 0.55, 1.35), _EARTH),
    ]


def _car_shapes(country: Country, a: int, b: int) -> list[Shapes]:
    """Put cars on the asphalt of a cell."""
    rng = country.rng(a, b, 4)
    found: list[Shapes] = []
    for axis in (0, 1):
        if not _is_paved(a, b, axis):
            continue
        line = _lane(country, a, b, axis)
        at = rng.integers(2, 29, rng.poisson(1.6))
        along = line[at + 1] - line[at]
        angle = np.arctan2(along[:, 1], along[:, 0])
        side = rng.choice([-1.75, 1.75], len(at))
        place = line[at] + side[:, None] * np.column_stack([-np.sin(angle), np.cos(angle)])
        dry = country.lake_m(place) < -4
        place, angle = place[dry], angle[dry]
        found += _cars(place, angle, rng)
    return found


def _cars(place: Array, angle: Array, rng: np.random.Generator) -> list[Shapes]:
    """Build cars with their shadows and windows."""
    paint = np.array([[215, 215, 215], [60, 62, 66], [150, 40, 38], [50, 70, 120], [168, 170, 172]])
    colours = np.column_stack([paint[rng.integers(0, 5, len(place))], np.full(len(place), 15)])
    return [
        shapes(rectangles(place + 0.6 * SHADOW, 4.5, 1.9, angle), (40, 42, 44, 20)),
        shapes(rectangles(place, 4.4, 1.8, angle), colours),
        shapes(rectangles(place, 2.3, 1.5, angle), (52, 58, 64, 10)),
        shapes(rectangles(place, 1.3, 1.5, angle), colours),
    ]


# --- Villages: streets, houses with their roofs and shadows, gardens and halls


_ROOFS = np.array(
    [[178, 92, 66], [164, 84, 62], [150, 92, 74], [122, 76, 64], [120, 118, 118], [186, 112, 84]]
)
_HALLS = np.array([[206, 208, 208], [176, 182, 188], [228, 226, 220], [146, 150, 158]])
_STREET = (132, 130, 128, 85)
_LAWN = np.array([124, 142, 94, 155])
_GARDENS = (116, 132, 90, 175)
_PAVEMENT = (152, 150, 146, 90)
_BED = np.array([128, 108, 84, 190])
_PLOT_M = 19.0
_ALONG = np.array([1.0, 0.0])


def _houses(
    middle: Array, length: Array, width: Array, angle: Array, roof: NDArray[np.int64]
) -> tuple[Shapes, Shapes]:
    """Build shadows and gable roofs of houses; colours (n, 3)."""
    tall = 3.0 + 0.45 * width
    base = rectangles(middle, length, width, angle)
    cast = base + SHADOW * tall[:, None, None]
    shadow = np.concatenate([_sweeps(base, cast), cast])
    across = np.column_stack([-np.sin(angle), np.cos(angle)])
    sunny = (across @ SHADOW) < 0
    quarter = across * width[:, None] / 4
    left = rectangles(middle + quarter, length, width / 2, angle)
    right = rectangles(middle - quarter, length, width / 2, angle)
    light = np.where(sunny, 1.12, 0.74)[:, None]
    ridge = rectangles(middle, length, 0.35, angle)
    chimney = rectangles(middle + across * width[:, None] / 7, 0.9, 0.7, angle)
    rough = np.full((len(middle), 1), 95)
    outlines = np.concatenate([left, right, ridge, chimney])
    colours = np.concatenate(
        [
            np.hstack([roof * light, rough]),
            np.hstack([roof * (1.86 - light), rough]),
            np.hstack([roof * 0.9, rough]),
            np.hstack([roof * 0 + 92, rough]),
        ]
    )
    return shapes(shadow, SHADE), shapes(outlines, colours)


def _sweeps(base: Array, cast: Array) -> Array:
    """Return the areas between the sides of a base and their cast shadows: (4 n, 4, 2)."""
    after, cast_after = np.roll(base, -1, axis=1), np.roll(cast, -1, axis=1)
    return np.stack([base, after, cast_after, cast], axis=2).reshape(-1, 4, 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Village:
    """Layers of a village in the order of drawing, and the places of its trees, shape (n, 2)."""

    ground: list[Shapes]
    shadows: list[Shapes]
    roofs: list[Shapes]
    trees: Array


def _village(country: Country, a: int, b: int) -> _Village:
    """Build a cell of a village."""
    rng = country.rng(a, b, 5)
    corner = np.array([a, b]) * PITCH
    place, angle = _plots(country, corner, rng)
    n = len(place)
    hall = rng.random(n) < 0.06
    length = np.where(hall, rng.uniform(16, 18, n), rng.uniform(9.0, 14.0, n))
    width = np.where(hall, rng.uniform(12, 14, n), rng.uniform(7, 9.5, n))
    colour = np.where(hall[:, None], _HALLS[rng.integers(0, 4, n)], _ROOFS[rng.integers(0, 6, n)])
    turn = np.where(rng.random(n) < 0.3, np.pi / 2, 0) + rng.normal(0, 0.03, n)
    shadow, roof = _houses(place, length, width, angle + turn, colour)
    shed = place + _offset(angle, rng.uniform(-6, 6, n), rng.uniform(-12, -10, n))
    long, wide = rng.uniform([3, 2.5], [5, 3.5], (n, 2)).T
    shed_shadow, shed_roof = _houses(shed, long, wide, angle, _ROOFS[rng.integers(2, 5, n)])
    garden = place + _offset(angle, rng.choice([-7.5, 7.5], n), rng.uniform(-12, 8, n))
    behind = place + _offset(angle, rng.uniform(-8, 8, n), rng.uniform(-19, -13, n))
    return _Village(
        ground=[*_gardens(country, corner, place, angle, rng), *_streets(country, corner)],
        shadows=[shadow, shed_shadow],
        roofs=[shed_roof, roof],
        trees=np.concatenate([garden[rng.random(n) < 0.7], behind[rng.random(n) < 0.6]]),
    )


def _streets(country: Country, corner: Array) -> list[Shapes]:
    u, v = (np.linspace(0, length, 24) for length in PITCH)
    lines = [np.column_stack([u, np.full(24, PITCH[1] * k / 3)]) for k in (1, 2)]
    lines.append(np.column_stack([np.full(24, PITCH[0] / 2), v]))
    drawn = [country.map_from_net(corner + line) for line in lines]
    return [
        *(shapes(_ribbons(line, -3.9, 3.9), _PAVEMENT) for line in drawn),
        *(shapes(_ribbons(line, -2.6, 2.6), _STREET) for line in drawn),
    ]


def _gardens(
    country: Country, corner: Array, place: Array, angle: Array, rng: np.random.Generator
) -> list[Shapes]:
    """Build the ground between the houses: meadows, lawns, beds, drives, pools."""
    n = len(place)
    frame = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * PITCH
    meadow = country.map_from_net(corner + frame)[None]
    lawn = _LAWN * np.hstack([rng.uniform(0.88, 1.08, (n, 3)), np.ones((n, 1))])
    bed = place + _offset(angle, rng.uniform(-5, 5, n), rng.uniform(-16, -11, n))
    long, wide = rng.uniform([3, 3], [9, 6], (n, 2)).T
    soil = _BED * np.hstack([rng.uniform(0.85, 1.2, (n, 1)).repeat(3, axis=1), np.ones((n, 1))])
    drive = place + _offset(angle, rng.uniform(-7, -5, n), np.full(n, 9.0))
    pool = rng.random(n) < 0.08
    at = place[pool] + _offset(angle[pool], np.full(pool.sum(), 4.0), np.full(pool.sum(), -10.0))
    return [
        shapes(meadow, _GARDENS),
        shapes(rectangles(place, _PLOT_M - 1.0, 30.0, angle), lawn),
        shapes(rectangles(bed, long, wide, angle), soil),
        shapes(rectangles(drive, 3.2, 10.0, angle), _PAVEMENT),
        shapes(rectangles(at, 8.0, 4.2, angle[pool]), (110, 176, 192, 20)),
    ]


def _offset(angle: Array, along: Array, across: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * along - s * across, s * along + c * across])


def _plots(country: Country, corner: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the middles and directions of the plots of a cell, on both sides of two streets."""
    u = np.arange(_PLOT_M * 0.7, PITCH[0] - 10, _PLOT_M)
    u = u[np.abs(u - PITCH[0] / 2) > 15]
    v = np.concatenate([PITCH[1] * k / 3 + np.array([-18.0, 18.0]) for k in (1, 2)])
    uv = corner + np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    place = country.map_from_net(uv)
    ahead = country.map_from_net(uv + _ALONG) - place
    angle = np.arctan2(ahead[:, 1], ahead[:, 0])
    away = np.tile(np.repeat([0.0, np.pi], len(u)), 2)
    keep = (rng.random(len(uv)) < 0.88) & (country.water_m(place) < -20)
    keep &= country.village_m(place) > -60
    return (place + rng.normal(0, 0.8, place.shape))[keep], (angle + away)[keep]


def _farm(country: Country, a: int, b: int) -> tuple[Shapes, Shapes]:
    """Build the sheds of a single farm in the corner of a cell: shadows and roofs."""
    rng = country.rng(a, b, 6)
    uv = np.array([a, b]) * PITCH + [[30.0, 22.0], [58.0, 26.0], [34.0, 52.0]]
    place = country.map_from_net(uv)
    dry = country.water_m(place) < -30
    ahead = country.map_from_net(uv + _ALONG) - place
    angle = np.arctan2(ahead[:, 1], ahead[:, 0]) + np.array([0, np.pi / 2, 0])
    length, width = rng.uniform([20, 30, 12], [30, 45, 15]), rng.uniform([11, 13, 8], [15, 18, 10])
    colour = np.vstack([_HALLS[rng.integers(0, 4, 2)], _ROOFS[rng.integers(0, 6, 1)]])
    return _houses(place[dry], length[dry], width[dry], angle[dry], colour[dry])


# --- Trees from above: shadow, crown, and its sunlit side and clumps


SHADOW = np.array([0.58, -0.60])  # of something one metre high, east and north, m
SHADE = (52, 58, 50, 140)
_FLOOR = (98, 110, 74, 190)
_CORNERS = 18
_CLUMPS = 14
_LEAST = 3.0  # cells; smaller clumps are not drawn
_COUNTRY_ROUGH = 240
_SPACING = 5.3
_CROWNS = np.array([[70, 92, 52], [60, 84, 50], [84, 100, 56], [54, 74, 48], [92, 104, 60]])
_FROM_WATER = 4.0
_FROM_LANES = 6.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Trees:
    """Trees in layers: the ground around them, their shadows, and their crowns."""

    floor: Shapes
    shadows: Shapes
    crowns: Shapes


def _trees(places: Array, radius: Array, rng: np.random.Generator) -> _Trees:
    """Build trees at positions (n, 2), with radii (n,), m."""
    n = len(places)
    bearing = np.linspace(0, 2 * np.pi, _CORNERS, endpoint=False)
    circle = np.column_stack([np.cos(bearing), np.sin(bearing)])
    crown = radius[:, None, None] * _ragged(n, bearing, rng)[..., None] * circle
    tall = radius * rng.uniform(1.1, 1.7, n)
    dark = _CROWNS[rng.integers(0, len(_CROWNS), n)] * rng.uniform(0.75, 0.98, (n, 1))
    sunny = -0.22 * SHADOW / np.linalg.norm(SHADOW) * radius[:, None]
    away, where = rng.uniform(0, 0.85, (n, _CLUMPS)), rng.uniform(0, 2 * np.pi, (n, _CLUMPS))
    clump = (away * radius[:, None] * np.array([np.cos(where), np.sin(where)])).transpose(1, 2, 0)
    size = radius[:, None] * rng.uniform(0.10, 0.22, (n, _CLUMPS))
    parts = np.concatenate(
        [
            crown[:, None],
            (sunny[:, None] + 0.72 * crown)[:, None],
            clump[:, :, None] + size[..., None, None] * circle,
        ],
        axis=1,
    )
    toward_sun = 1.24 + 0.35 * (clump @ -SHADOW) / radius[:, None]
    tone = np.concatenate([np.tile([1.0, 1.16], (n, 1)), toward_sun], axis=1)
    tone[:, 2:] *= rng.uniform(0.88, 1.12, (n, _CLUMPS))
    colours = np.concatenate(
        [dark[:, None] * tone[..., None], np.full((n, 2 + _CLUMPS, 1), _COUNTRY_ROUGH)], axis=2
    )
    return _Trees(
        floor=shapes(places[:, None] + 1.4 * radius[:, None, None] * circle, _FLOOR),
        shadows=shapes((places + SHADOW * tall[:, None])[:, None] + 0.98 * crown, SHADE),
        crowns=replace(
            shapes(
                (places[:, None, None] + parts).reshape(-1, _CORNERS, 2), colours.reshape(-1, 4)
            ),
            least=_LEAST,
        ),
    )


def _ragged(n: int, bearing: Array, rng: np.random.Generator) -> Array:
    """Return the radii of n crowns by bearing, about 1."""
    waves = np.array([2, 3, 5])
    phase = rng.uniform(0, 2 * np.pi, (n, 3, 1))
    ripple = 0.06 * np.sin(waves[:, None] * bearing + phase).sum(axis=1)
    return np.asarray(1 + ripple + rng.normal(0, 0.03, ripple.shape))


def _wood_places(country: Country, a: int, b: int) -> tuple[Array, NDArray[np.float64]]:
    """Return positions and radii of the trees in a cell's part of the woods, m."""
    rng = country.rng(a, b, 1)
    n = np.ceil(PITCH / _SPACING).astype(int)
    grid = np.stack(np.meshgrid(np.arange(n[0]), np.arange(n[1])), axis=-1).reshape(-1, 2)
    within = (grid + rng.uniform(0.1, 0.9, grid.shape)) * (PITCH / n)
    radius = rng.uniform(2.4, 4.6, len(within))
    en = country.map_from_net(within + PITCH * [a, b])
    edge = np.minimum(within, PITCH - within).min(axis=1)
    keep = (country.woods(en) > 0) & (edge > _FROM_LANES) & (country.village_m(en) < -20)
    keep &= country.water_m(en) < -_FROM_WATER
    return en[keep], radius[keep]


def _row_places(country: Country, line: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return positions and radii of trees and bushes along a line (n, 2), m."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    gaps = rng.choice([3.5, 5.0, 8.0, 30.0], int(length[-1] / 4), p=[0.4, 0.3, 0.2, 0.1])
    way = np.cumsum(gaps)
    way = way[way < length[-1]]
    en = np.column_stack([np.interp(way, length, line[:, i]) for i in range(2)])
    en += rng.normal(0, 0.6, en.shape)
    radius = rng.uniform(1.2, 3.4, len(en))
    keep = country.water_m(en) < -_FROM_WATER
    return en[keep], radius[keep]
