"""The map of an invented country: its net of lanes, its water, woods and villages."""

from dataclasses import dataclass

import numpy as np

from acx4sim.earth import Array
from acx4sim.scenery.noise import scattered

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


def _around(en: Array, first: Array, pitch: float, seed: int) -> Array:
    """Return positions relative to the nearest of many spread centres, of which one is `first`."""
    x = en - first
    index = np.rint(x / pitch).astype(np.int64)
    here = x - index * pitch
    h = scattered(index[..., 1], index[..., 0], seed)
    play = np.stack([h & np.uint32(1023), (h >> np.uint32(10)) & np.uint32(1023)], axis=-1) / 1023
    moved = np.any(index != 0, axis=-1, keepdims=True)
    return np.asarray(here - moved * (play - 0.5) * 0.3 * pitch)
