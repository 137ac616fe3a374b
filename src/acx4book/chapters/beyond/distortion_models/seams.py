"""What of the pattern of the synthetic image every model can take up, by least squares.

Chapter 12 stored what a single step of measurements without noise leaves over the synthetic image,
at two flying heights. Here all that one camera can do is fitted to it: its interior orientation
and distortion, its boresight, and its lever arm, whose effect is in proportion to 1 / H.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.distortion_models.families import Model, by_coefficient
from acx4book.chapters.beyond.distortion_models.study import STORED
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, correct_jacobian, xy_from_colrow

HEADS = "four cameras"


@dataclass(frozen=True, kw_only=True, eq=False)
class Pattern:
    """Vectors over the synthetic image that one camera left, at two flying heights.

    Attributes
    ----------
    camera : Camera
    colrow, d_px : ndarray, shape (n, 2)
    head : ndarray of str, shape (n,)
        From which a pixel is taken.
    height_m : ndarray, shape (n,)
        Flying height above the ground.
    """

    camera: Camera
    colrow: Array
    d_px: Array
    head: np.ndarray
    height_m: Array


def read(camera: Camera) -> Pattern:
    """Return the pattern that chapter 12 stored.

    Parameters
    ----------
    camera : Camera
        The synthetic one, with an approximate focal length.
    """
    table = pd.read_csv(STORED / "closed_chain_pattern.csv")
    return Pattern(
        camera=camera,
        colrow=table[["col_px", "row_px"]].to_numpy(),
        d_px=table[["d_col_px", "d_row_px"]].to_numpy(),
        head=table["head"].to_numpy(),
        height_m=table["height_m"].to_numpy(dtype=float),
    )


def left(pattern: Pattern, model: Model) -> Array:
    """Return what a camera with a model leaves of the pattern, px, shape (n, 2)."""
    return _left(pattern.d_px, _of_camera(pattern, model))


def left_by_heads(pattern: Pattern, model: Model) -> Array:
    """Return what four cameras leave of it, each of them fitted to its own part."""
    out = np.empty_like(pattern.d_px)
    A = _of_camera(pattern, model)
    for name in np.unique(pattern.head):
        own = pattern.head == name
        out[own] = _left(pattern.d_px[own], A[own])
    return out


def _left(d: Array, A: Array) -> Array:
    rows = A.reshape(-1, A.shape[2])
    scale = np.linalg.norm(rows, axis=0)
    found = np.linalg.lstsq(rows / scale, d.ravel(), rcond=1e-9)[0]
    return d - (rows / scale @ found).reshape(d.shape)


def _of_camera(pattern: Pattern, model: Model) -> Array:
    """Return what every unknown of the camera moves, in px, shape (n, 2, k)."""
    camera = pattern.camera
    xy, f = xy_from_colrow(camera, pattern.colrow), camera.interior.f
    interior = correct_jacobian(camera.interior, xy)
    interior[:, :, 0] = xy / f
    own = interior[:, :, [INTERIOR.index(name) for name in model.free]]
    (x, y), one, zero = xy.T, np.ones(len(xy)), np.zeros(len(xy))
    boresight = [(f + x * x / f, x * y / f), (x * y / f, f + y * y / f), (-y, x)]
    lever = [(f * one, zero), (zero, f * one), (x, y)]
    turned = np.stack([np.stack(part, axis=1) for part in boresight], axis=2)
    moved = np.stack([np.stack(part, axis=1) for part in lever], axis=2)
    mm = np.concatenate([own, turned, moved / pattern.height_m[:, None, None]], axis=2)
    px = mm / np.array([camera.pixel_mm, -camera.pixel_mm])[:, None]
    return np.concatenate([px, by_coefficient(model, camera, pattern.colrow)], axis=2)
