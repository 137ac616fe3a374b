"""A ground of waves, whose pictures lose nothing by being sampled, and an exposure over it."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from acx4book.chapters.image_quality.deviations import known_exposure
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads
from acx4lib.synthetic_image.response import estimate_response
from acx4sim.drawing import cell_m

LEVEL, SWING = 30_000.0, 15_000.0
"""Mean of the grey values, and about how far they go to both sides."""

N_WAVES = 24


@dataclass(frozen=True, kw_only=True)
class Waves:
    """Crossed waves of random lengths, none shorter than some pixels of a picture.

    Attributes
    ----------
    shortest_m : float
    """

    shortest_m: float

    def paint(self, window):
        rng = np.random.default_rng(0)
        lengths = self.shortest_m * rng.uniform(1, 4, (2, N_WAVES))
        phases = rng.uniform(0, 2 * np.pi, (2, N_WAVES))
        size = cell_m(window.level)
        north = (window.row + np.arange(window.rows) + 0.5) * size
        east = (window.col + np.arange(window.cols) + 0.5) * size
        up, along = (
            np.sin(2 * np.pi * at[:, None] / length + phase)
            for at, length, phase in zip((north, east), lengths, phases, strict=True)
        )
        waves = up @ along.T / np.sqrt(N_WAVES)  # of variance 1/4
        return (
            np.clip(LEVEL + SWING * waves, 2000, 60_000).astype(np.uint16)[..., None].repeat(3, 2)
        )


@cache
def known(reduce=8):
    """Return an exposure over waves of at least six pixels; 0.12 m is a full-size pixel."""
    return known_exposure(reduce=reduce, ground=Waves(shortest_m=6 * 0.12 * reduce))


def response(exposure):
    """Return the response of the heads of an exposure."""
    return estimate_response(
        exposure.images,
        reduced_heads(exposure.orientation, exposure.reduce),
        reduced_camera(exposure.synthetic, exposure.reduce),
        rng=np.random.default_rng(1),
    ).response
