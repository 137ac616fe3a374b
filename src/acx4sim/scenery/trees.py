"""Trees from above: shadow, crown, and its sunlit side and clumps."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acx4sim.earth import Array
from acx4sim.scenery.country import PITCH, Country
from acx4sim.scenery.drawing import Shapes, shapes

SHADOW = np.array([0.58, -0.60])  # of something one metre high, east and north, m
SHADE = (52, 58, 50, 140)
_FLOOR = (98, 110, 74, 190)
_CORNERS = 18
_CLUMPS = 14
_LEAST = 3.0  # cells; smaller clumps are not drawn
_ROUGH = 240
_SPACING = 5.3
_CROWNS = np.array([[70, 92, 52], [60, 84, 50], [84, 100, 56], [54, 74, 48], [92, 104, 60]])
_FROM_WATER = 4.0
_FROM_LANES = 6.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Trees:
    """Trees in layers.

    Attributes
    ----------
    floor, shadows, crowns : Shapes
        The ground around the trees, their shadows, and their crowns.
    """

    floor: Shapes
    shadows: Shapes
    crowns: Shapes


def trees(places: Array, radius: Array, rng: np.random.Generator) -> Trees:
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
        [dark[:, None] * tone[..., None], np.full((n, 2 + _CLUMPS, 1), _ROUGH)], axis=2
    )
    return Trees(
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


def wood_places(country: Country, a: int, b: int) -> tuple[Array, NDArray[np.float64]]:
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


def row_places(country: Country, line: Array, rng: np.random.Generator) -> tuple[Array, Array]:
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
