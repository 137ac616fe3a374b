"""Fields with furrows, and the lanes between them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from acx4sim.earth import Array
from acx4sim.scenery.country import PITCH, Country
from acx4sim.scenery.drawing import Shapes, rectangles, ribbons, shapes, thin
from acx4sim.scenery.trees import SHADOW

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


@dataclass(frozen=True, kw_only=True, eq=False)
class Fields:
    """The fields of a cell.

    Attributes
    ----------
    shapes : Shapes
        Their areas.
    across : ndarray, shape (n, 2)
        Unit vectors across their rows, east and north.
    rows : ndarray, shape (n, 3)
        Spacing of rows, m; contrast of rows and of wheel tracks.
    """

    shapes: Shapes
    across: Array
    rows: Array


def fields(country: Country, a: int, b: int) -> Fields:
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
    return Fields(shapes=shapes(outlines, colours), across=across, rows=crop[:, 4:7])


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


def lane(country: Country, a: int, b: int, axis: int) -> Array:
    """Return the line of a cell's first side along an axis of the net, shape (n, 2)."""
    way = np.linspace(0, PITCH[axis], 31)[:, None] * np.eye(2)[axis]
    return country.map_from_net(np.array([a, b]) * PITCH + way)


def is_paved(a: int, b: int, axis: int) -> bool:
    """Tell whether the lane along a cell's side has asphalt."""
    return (a % _PAVED_EVERY[0] == 1) if axis else (b % _PAVED_EVERY[1] == 2)


def lane_shapes(country: Country, a: int, b: int) -> tuple[list[Shapes], list[Shapes]]:
    """Build the tracks and the roads along the two first sides of a cell."""
    rng = country.rng(a, b, 3)
    tracks: list[Shapes] = []
    roads: list[Shapes] = []
    for axis in (0, 1):
        line = lane(country, a, b, axis)
        if is_paved(a, b, axis):
            roads += _paved(line)
        elif rng.random() < _TRACKS:
            tracks += _track(line)
    return tracks, roads


def _paved(line: Array) -> list[Shapes]:
    fine = np.column_stack(
        [np.interp(np.linspace(0, 30, 121), np.arange(31), line[:, i]) for i in range(2)]
    )
    dashes = ribbons(fine, -0.07, 0.07, overlap_m=0.0)[::4]
    return [
        shapes(ribbons(line, -5.2, 5.2), _VERGE),
        shapes(ribbons(line, -3.6, 3.6), _ASPHALT),
        thin(ribbons(line, -3.32, -3.18), _WHITE, 0.14, _ASPHALT),
        thin(ribbons(line, 3.18, 3.32), _WHITE, 0.14, _ASPHALT),
        thin(dashes, _WHITE, 0.14, _ASPHALT),
    ]


def bridge_shapes(country: Country, a: int, b: int) -> list[Shapes]:
    """Build the bridges of paved lanes over a river."""
    found: list[Shapes] = []
    for axis in (0, 1):
        line = lane(country, a, b, axis)
        over = (country.river_m(line) > -9) & (country.lake_m(line) < -30)
        if not (is_paved(a, b, axis) and over.any()):
            continue
        span = np.flatnonzero(over)
        part = line[max(span[0] - 1, 0) : span[-1] + 2]
        found.append(shapes(ribbons(part + 3.6 * SHADOW, -4.6, 4.6), (26, 34, 38, 8)))
        found.append(shapes(ribbons(part, -4.6, 4.6), _CONCRETE))
        found.append(shapes(ribbons(part, -3.6, 3.6), _ASPHALT))
        found.append(thin(ribbons(part, -3.32, -3.18), _WHITE, 0.14, _ASPHALT))
        found.append(thin(ribbons(part, 3.18, 3.32), _WHITE, 0.14, _ASPHALT))
    return found


def _track(line: Array) -> list[Shapes]:
    return [
        shapes(ribbons(line, -2.4, 2.4), _GRASS),
        shapes(ribbons(line, -1.35, -0.55), _EARTH),
        shapes(ribbons(line, 0.55, 1.35), _EARTH),
    ]


def car_shapes(country: Country, a: int, b: int) -> list[Shapes]:
    """Put cars on the asphalt of a cell."""
    rng = country.rng(a, b, 4)
    found: list[Shapes] = []
    for axis in (0, 1):
        if not is_paved(a, b, axis):
            continue
        line = lane(country, a, b, axis)
        at = rng.integers(2, 29, rng.poisson(1.6))
        along = line[at + 1] - line[at]
        angle = np.arctan2(along[:, 1], along[:, 0])
        side = rng.choice([-1.75, 1.75], len(at))
        place = line[at] + side[:, None] * np.column_stack([-np.sin(angle), np.cos(angle)])
        dry = country.lake_m(place) < -4
        place, angle = place[dry], angle[dry]
        found += cars(place, angle, rng)
    return found


def cars(place: Array, angle: Array, rng: np.random.Generator) -> list[Shapes]:
    """Build cars with their shadows and windows."""
    paint = np.array([[215, 215, 215], [60, 62, 66], [150, 40, 38], [50, 70, 120], [168, 170, 172]])
    colours = np.column_stack([paint[rng.integers(0, 5, len(place))], np.full(len(place), 15)])
    return [
        shapes(rectangles(place + 0.6 * SHADOW, 4.5, 1.9, angle), (40, 42, 44, 20)),
        shapes(rectangles(place, 4.4, 1.8, angle), colours),
        shapes(rectangles(place, 2.3, 1.5, angle), (52, 58, 64, 10)),
        shapes(rectangles(place, 1.3, 1.5, angle), colours),
    ]
