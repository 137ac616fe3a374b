"""Villages: streets, houses with their roofs and shadows, gardens and halls."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acx4sim.earth import Array
from acx4sim.scenery.country import PITCH, Country
from acx4sim.scenery.drawing import Shapes, rectangles, ribbons, shapes
from acx4sim.scenery.trees import SHADE, SHADOW

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


def houses(
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
class Village:
    """The content of a cell of a village.

    Attributes
    ----------
    ground, shadows, roofs : list of Shapes
        In the order of drawing.
    trees : ndarray, shape (n, 2)
        Positions of the trees in the gardens.
    """

    ground: list[Shapes]
    shadows: list[Shapes]
    roofs: list[Shapes]
    trees: Array


def village(country: Country, a: int, b: int) -> Village:
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
    shadow, roof = houses(place, length, width, angle + turn, colour)
    shed = place + _offset(angle, rng.uniform(-6, 6, n), rng.uniform(-12, -10, n))
    long, wide = rng.uniform([3, 2.5], [5, 3.5], (n, 2)).T
    shed_shadow, shed_roof = houses(shed, long, wide, angle, _ROOFS[rng.integers(2, 5, n)])
    garden = place + _offset(angle, rng.choice([-7.5, 7.5], n), rng.uniform(-12, 8, n))
    behind = place + _offset(angle, rng.uniform(-8, 8, n), rng.uniform(-19, -13, n))
    return Village(
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
        *(shapes(ribbons(line, -3.9, 3.9), _PAVEMENT) for line in drawn),
        *(shapes(ribbons(line, -2.6, 2.6), _STREET) for line in drawn),
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


def farm(country: Country, a: int, b: int) -> tuple[Shapes, Shapes]:
    """Build the sheds of a single farm in the corner of a cell: shadows and roofs."""
    rng = country.rng(a, b, 6)
    uv = np.array([a, b]) * PITCH + [[30.0, 22.0], [58.0, 26.0], [34.0, 52.0]]
    place = country.map_from_net(uv)
    dry = country.water_m(place) < -30
    ahead = country.map_from_net(uv + _ALONG) - place
    angle = np.arctan2(ahead[:, 1], ahead[:, 0]) + np.array([0, np.pi / 2, 0])
    length, width = rng.uniform([20, 30, 12], [30, 45, 15]), rng.uniform([11, 13, 8], [15, 18, 10])
    colour = np.vstack([_HALLS[rng.integers(0, 4, 2)], _ROOFS[rng.integers(0, 6, 1)]])
    return houses(place[dry], length[dry], width[dry], angle[dry], colour[dry])
