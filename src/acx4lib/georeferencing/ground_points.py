"""Ground points of single pixels on a known height: eqs (1)-(5) and (14), with their errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.collinearity import as_seen, directions, image_derivatives
from acx4lib.geometry.geodesy import MappingFrame
from acx4lib.georeferencing.direct import (
    Georeferenced,
    Rays,
    by_columns,
    error_sources,
    measured,
)
from acx4lib.georeferencing.error_sources import ErrorSources, turned

STEPS, CLOSE_M = 20, 1e-6
"""Most steps to the surface of a height, and the distance from it that ends them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPoints:
    """Where pixels lie on the ground.

    Attributes
    ----------
    x_m : ndarray, shape (n, 3)
        Mapping frame, m; NaN where a ray does not come down to the height.
    enh : ndarray, shape (n, 3)
        East, north, height, in the flight's system, m.
    sources : ErrorSources
        A priori errors along east, north and height, by what they come from, in metres on the
        ground.
    """

    x_m: Array
    enh: Array
    sources: ErrorSources

    def __len__(self) -> int:
        """Count the points."""
        return len(self.x_m)

    @property
    def cov(self) -> Array:
        """Covariance of every point along east, north and height, shape (n, 3, 3), m^2."""
        return self.sources.cov


def ground_points(
    block: Block,
    georeferenced: Georeferenced,
    pixels: Rays,
    *,
    height_m: Array,
    sigma_height_m: Array | None = None,
    refraction: str = "none",
) -> GroundPoints:
    """Return the points in which the rays of pixels meet surfaces of constant height.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
        The block's poses, as `direct.georeference` returns them.
    pixels : Rays
        A group for every pixel.
    height_m : ndarray, shape (n,)
        In the flight's height system, m.
    sigma_height_m : ndarray, shape (n,), optional
        Their standard deviations, by default zero; heights of two points err independently.
    refraction : str
        ``"none"`` or ``"standard"``.

    Returns
    -------
    GroundPoints
        With the errors of pixel, height, interior orientation, mounting and trajectory. Those of
        two points are correlated through what they share.

    Raises
    ------
    ValueError
        For other shapes, images that the block does not have, or pixels that share a group.

    Notes
    -----
    A point x fulfils v(x) = 0, the image residuals of eqs (1)-(11), and h(x) = h. So
    d(x) = [dv/dx; dh/dx]^-1 (-dv, dh), where dh/dx is the normal of the ellipsoid.
    """
    n = len(pixels.image_idx)
    expected.places("pixels.image_idx", pixels.image_idx, len(block.images))
    expected.different("pixels.group", pixels.group.tolist(), "groups")
    height = expected.numbers("height_m", height_m, (n,))
    given = np.zeros(n) if sigma_height_m is None else sigma_height_m
    sigma_h = expected.numbers("sigma_height_m", given, (n,))
    expected.not_negative("sigma_height_m", sigma_h)
    seen = measured(block, georeferenced, pixels)
    x_m, lifted, met = _on_surface(block.frame, seen.T_m_c.r, directions(seen), height, refraction)
    _, by_interior, by_pose, by_point = image_derivatives(seen, lifted)
    axes = block.frame.grid_axes(x_m)
    by_residuals = np.linalg.inv(np.concatenate([by_point, axes[:, 2:]], axis=1))
    sources = error_sources(
        block,
        georeferenced,
        pixels,
        -by_residuals[:, :, :2],
        by_parameters=by_columns(block, georeferenced, pixels, by_interior, by_pose),
        by_pose=by_pose,
    )
    along = by_residuals[:, :, 2:] * sigma_h[:, None, None]
    sources = turned(replace(sources, survey=along @ np.swapaxes(along, 1, 2)), axes)
    return GroundPoints(
        x_m=np.where(met[:, None], x_m, np.nan),
        enh=np.where(met[:, None], block.frame.to_grid(x_m), np.nan),
        sources=replace(sources, image=np.where(met[:, None, None], sources.image, np.nan)),
    )


def _on_surface(
    frame: MappingFrame, r_m: Array, towards: Array, height: Array, refraction: str
) -> tuple[Array, Array, Mask]:
    """Return where rays meet heights, where they seem to, and which do; others go straight down."""
    up = frame.grid_axes(r_m)[:, 2]
    down = np.einsum("ni,ni->n", up, towards) < 0
    towards = np.where(down[:, None], towards, -up)
    seen_at = r_m + (frame.to_grid(r_m)[:, 2] - height)[:, None] * towards
    x_m, left = seen_at, np.full(len(r_m), np.inf)
    for _ in range(STEPS):
        x_m = 2 * seen_at - as_seen(r_m, seen_at, refraction=refraction)
        left = frame.to_grid(x_m)[:, 2] - height
        if not np.any(np.abs(left) > CLOSE_M):
            break
        slope = np.einsum("ni,ni->n", frame.grid_axes(x_m)[:, 2], towards)
        seen_at = seen_at - (left / slope)[:, None] * towards
    ahead = np.einsum("ni,ni->n", seen_at - r_m, towards) > 0
    return x_m, seen_at, down & ahead & (np.abs(left) <= CLOSE_M)
