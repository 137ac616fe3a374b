"""Falloff of heads with similar bands against each other: seen, and as the factory states it."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pandas as pd

from acx4book.reference.heads.solved import Solved, solved
from acx4lib.exchange.pictures import radiometry
from acx4lib.expected import Array, Raster
from acx4lib.synthetic_image.response import estimate_response

PAIRS = (
    ("1 Blue", "6 Blue-444"),
    ("2 Green", "7 Green-531"),
    ("3 Red", "8 Red-650"),
    ("4 NIR", "10 Red edge-740"),
)
"""Heads of the two rigs whose bands are most alike."""

RINGS = np.arange(0.0, 801.0, 100.0)
"""Radii between which the ratios are averaged, px from the middle of the image."""

SEED = 4
_BLUR = 9


def vignetting(files: str) -> pd.DataFrame:
    """Return a row for every ring of every pair.

    Returns
    -------
    DataFrame
        Heads; radius, px; the first head's grey value over the second's, less that of the middle,
        in per cent: seen at the tie points, as the factory states it, and as the library's response
        of the heads has it.
    """
    found = solved(files)
    return pd.concat([_pair(found, *names) for names in PAIRS], ignore_index=True)


def _pair(found: Solved, name: str, other: str) -> pd.DataFrame:
    k, m = sorted((found.place(name), found.place(other)))
    ties = found.found.ties[~found.fits["rotations"].rejected]
    ties = ties[(ties.head_a == k) & (ties.head_b == m)]
    seen = np.log(_grey(found, k, ties.colrow_a) / _grey(found, m, ties.colrow_b))
    stated = np.log(_factory(found, k, ties.colrow_a) / _factory(found, m, ties.colrow_b))
    middle = 0.5 * (np.array([found.synthetic.width_px, found.synthetic.height_px]) - 1)
    radius = np.hypot(*(ties.colrow_a - middle).T)
    fitted = _response(found, k, m, radius / np.hypot(*(middle + 0.5)))
    ring = np.digitize(radius, RINGS)
    rows = [
        {
            "head": found.names[k],
            "other": found.names[m],
            "radius_px": float(np.median(radius[ring == i])),
            "seen": 100 * float(np.median(seen[ring == i])),
            "factory": 100 * float(np.median(stated[ring == i])),
            "library": 100 * float(np.median(fitted[ring == i])),
        }
        for i in range(1, len(RINGS))
        if (ring == i).sum() >= 20
    ]
    table = pd.DataFrame(rows)
    for column in ("seen", "factory", "library"):
        table[column] -= table[column].iloc[0]
    return table


def _light(found: Solved, k: int) -> Raster:
    """Return a head's image above its dark level."""
    dark = radiometry.dark_level(found.tags[k]) or 0.0
    return np.clip(found.images[k].astype(np.int32) - round(dark), 1, None).astype(np.uint16)


def _grey(found: Solved, k: int, colrow: Array) -> Array:
    """Return grey values above darkness, means over small windows."""
    blurred = cv2.blur(_light(found, k)[..., 0].astype(np.float32), (_BLUR, _BLUR))
    col, row = np.rint(colrow).astype(int).T
    return np.asarray(blurred[row, col], float)


def _factory(found: Solved, k: int, colrow: Array) -> Array:
    stated = radiometry.vignetting(found.tags[k])
    return np.ones(len(colrow)) if stated is None else stated.at(colrow)


def _response(found: Solved, k: int, m: int, radius: Array) -> Array:
    """Return the logarithm of the ratio by the library's response, from grey values alone."""
    fit, two = found.fits["rotations"].orientation, [k, m]
    pair = replace(
        fit,
        heads=tuple(fit.heads[i] for i in two),
        xyz_mm=fit.xyz_mm[two],
        opk=fit.opk[two],
        cov_joint=np.zeros((30, 30)),
    )
    images = [_light(found, i) for i in two]
    rng = np.random.default_rng(SEED)
    response = estimate_response(images, pair, found.synthetic, rng=rng).response
    (_, a_1, b_1), (_, a_2, b_2) = response.coefficients[:, 0]
    q = radius**2
    return np.asarray((a_1 - a_2) * q + (b_1 - b_2) * q**2)
