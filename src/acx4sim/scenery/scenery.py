"""A procedural landscape: fields, lanes, villages, trees, water, and texture at every scale."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from acx4sim.earth import Array
from acx4sim.scenery.country import (
    PITCH,
    Country,
    Fields,
    bridge_shapes,
    car_shapes,
    farm,
    fields,
    lane,
    lane_shapes,
    row_places,
    trees,
    village,
    wood_places,
)
from acx4sim.scenery.drawing import (
    Canvas,
    FloatImage,
    GroundWindow,
    Shapes,
    doubled,
    draw,
    draw_any,
    draw_labels,
    fractal,
    white,
)

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
_DISC_M, _PAD_M, _ISLET_M = 0.3, 0.9, 6.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cell:
    """The content of a cell of the net, in layers; later layers cover earlier ones."""

    fields: Fields
    ground: list[Shapes]
    tracks: list[Shapes]
    roads: list[Shapes]
    bridges: list[Shapes]
    shadows: list[Shapes]
    bodies: list[Shapes]


@lru_cache(maxsize=600)
def _cell(country: Country, a: int, b: int) -> _Cell:
    rng = country.rng(a, b, 7)
    ground, shadows, bodies, garden = _buildings(country, a, b, rng)
    places, radii = _planted(country, a, b, rng)
    places = np.concatenate([places, garden])
    radii = np.concatenate([radii, rng.uniform(1.4, 3.4, len(garden))])
    wood = trees(places, radii, rng)
    tracks, roads = lane_shapes(country, a, b)
    return _Cell(
        fields=fields(country, a, b),
        ground=[wood.floor, *ground],
        tracks=tracks,
        roads=roads,
        bridges=bridge_shapes(country, a, b),
        shadows=[*shadows, wood.shadows],
        bodies=[*car_shapes(country, a, b), *bodies, wood.crowns],
    )


def _buildings(
    country: Country, a: int, b: int, rng: np.random.Generator
) -> tuple[list[Shapes], list[Shapes], list[Shapes], Array]:
    """Return ground, shadows and roofs of a village or a farm, and the positions of its trees."""
    middle = country.map_from_net((np.array([a, b]) + 0.5) * PITCH)
    if country.village_m(middle) > 0:
        of = village(country, a, b)
        return of.ground, of.shadows, of.roofs, of.trees
    if rng.random() < _FARMS:
        shadow, roof = farm(country, a, b)
        return [], [shadow], [roof], np.empty((0, 2))
    return [], [], [], np.empty((0, 2))


def _planted(country: Country, a: int, b: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return positions and radii of the trees of woods and hedges."""
    found = [wood_places(country, a, b)]
    for axis in (0, 1):
        if rng.random() < _HEDGES:
            beside = lane(country, a, b, axis)[2:-2] + _HEDGE_BESIDE
            found.append(row_places(country, beside, rng))
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
        canvas = np.full((window.rows, window.cols, 4), _MEADOW, np.uint8)
        _sow(canvas, window, [cell.fields for cell in cells], patches)
        for layer in ("ground", "tracks", "roads"):
            _draw_all(canvas, window, [getattr(cell, layer) for cell in cells])
        wet = _flood(canvas, window, self.country, patches)
        for layer in ("bridges", "shadows", "bodies"):
            _draw_all(canvas, window, [getattr(cell, layer) for cell in cells])
        dn = _textured(canvas, window, patches * (1 - wet), self.country.seed)
        _mark(dn, window, self.marks)
        return np.asarray(np.clip(dn, 0, _CLIP) + 0.5).astype(np.uint16)


def _draw_all(canvas: Canvas, window: GroundWindow, layers: list[list[Shapes]]) -> None:
    for layer in layers:
        for one in layer:
            draw(canvas, window, one)


def _sow(canvas: Canvas, window: GroundWindow, sown: list[Fields], patches: FloatImage) -> None:
    """Draw fields, their rows and wheel tracks."""
    labels = np.zeros(canvas.shape[:2], np.int16)
    first = 1
    for one in sown:
        draw_any(canvas, window, one.shapes)
        draw_labels(labels, window, one.shapes, first)
        first += len(one.across)
    across = np.concatenate([[[0.0, 0.0]], *(one.across for one in sown)])
    rows = np.concatenate([[[1.0, 0.0, 0.0]], *(one.rows for one in sown)])
    east, north = window.en()
    cell = np.float32(window.cell_m)
    start = (across @ [east[0], north[0]]) % _REPEAT_M
    ce, cn = (across * window.cell_m).astype(np.float32).T
    way = start.astype(np.float32)[labels]
    way += ce[labels] * np.arange(window.cols, dtype=np.float32)
    way += cn[labels] * np.arange(window.rows, dtype=np.float32)[:, None]
    spacing, contrast, wheels = rows.T
    seen = np.clip(spacing / window.cell_m / 4 - 0.5, 0, 1) * contrast
    turns = (2 * np.pi / spacing).astype(np.float32)[labels] * way
    tone = seen.astype(np.float32)[labels] * np.sin(turns) * (1 + 8 * patches)
    off = np.abs(way - np.float32(_WHEELS_M) * np.rint(way / np.float32(_WHEELS_M)))
    wide = max(0.3, float(cell))
    tracks = np.maximum(1 - np.abs(off - np.float32(_GAUGE_M)) / np.float32(wide), 0)
    tone -= (wheels * 0.3 / wide).astype(np.float32)[labels] * tracks
    tone += 1
    tone = np.clip(tone, 0, 1.2, out=tone)
    for band in range(3):
        canvas[..., band] = canvas[..., band] * tone


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
    bank = np.clip((shore + _BANK_M) / 5, 0, 1)[..., None]
    depth = np.clip(shore / 14, 0, 1)[..., None]
    ground = canvas + bank * (_BANK - canvas)
    water = _SHALLOW + depth * (_WATER - _SHALLOW)
    canvas[:] = ground + wet[..., None] * (water - ground)
    return wet


def _textured(canvas: Canvas, window: GroundWindow, patches: FloatImage, seed: int) -> FloatImage:
    """Convert colours to DN and add noise."""
    rough = fractal(window, dict.fromkeys(range(-3, 6), _ROUGH), seed + 1)
    rough *= _ROUGHNESS[canvas[..., 3]]
    rough += patches
    hue = fractal(window, _COLOURS, seed + 2)
    hue *= np.minimum(canvas[..., 3] * np.float32(1 / 60), 1)
    squares = ((np.arange(256) / 255) ** 2 * _BRIGHTEST).astype(np.float32)
    dn = cv2.LUT(np.ascontiguousarray(canvas[..., :3]), squares)
    bright = np.exp(rough, out=rough)
    for band, turn in enumerate((1.0, 0.2, -1.2)):
        dn[..., band] *= bright * (1 + np.float32(turn) * hue)
    dn += np.array(_HAZE, np.float32)
    return np.asarray(dn, np.float32)


def _mark(dn: FloatImage, window: GroundWindow, marks: Array) -> None:
    """Paint the signalised points; a cell at an edge is mixed by the share that is covered."""
    cell = window.cell_m
    for east, north in marks:
        col, row = east / cell - 0.5 - window.col, north / cell - 0.5 - window.row
        reach = _ISLET_M / cell + 2
        cols = np.arange(max(int(col - reach), 0), min(int(col + reach) + 1, window.cols))
        rows = np.arange(max(int(row - reach), 0), min(int(row + reach) + 1, window.rows))
        if not (cols.size and rows.size):
            continue
        x, y = (cols - col) * cell, ((rows - row) * cell)[:, None]
        part = dn[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
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
    part += share[..., None] * (np.float32(dn) - part)


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
