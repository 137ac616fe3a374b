"""What `acx4 check` prints of a flight."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyproj

from acx4lib._typing import Array
from acx4lib.block import Block, Images
from acx4lib.flight.reader import Flight
from acx4lib.frames import transform


def summary(flight: Flight) -> str:
    """Return a flight in plain text: blocks, cameras, counts, scale, notes.

    Parameters
    ----------
    flight : Flight
    """
    lines = [
        flight.name,
        _row("CRS", f"{flight.grid.crs}, {pyproj.CRS.from_user_input(flight.grid.crs).name}"),
        _row("heights", Path(flight.grid.heights).name),
        _row("refraction", flight.refraction),
    ]
    for block in flight.blocks.values():
        lines += ["", f"block {block.name}", *(_row(*row) for row in _block_rows(block))]
        files = [file for file in flight.image_files[block.name] if file is not None]
        lines.append(_row("image files", f"{len(files)} of {len(block.images)}"))
    if flight.notes:
        lines += ["", "notes", *(f"  {note}" for note in flight.notes)]
    return "\n".join(lines)


def _row(name: str, value: str) -> str:
    return f"  {name:<14} {value}"


def _block_rows(block: Block) -> Iterator[tuple[str, str]]:
    names = ", ".join(camera.name for camera in block.cameras)
    yield "cameras", f"{len(block.cameras)}: {names}"
    strips = {strip for strip in block.images.strips if strip}
    in_strips = f" in {len(strips)} strips" if strips else ", strips not named"
    yield "images", f"{len(block.images)} at {len(block.trajectory)} exposures{in_strips}"
    rays = block.rays[block.rays > 0]
    per_point = f", {rays.mean():.1f} per point" if len(rays) else ""
    yield "measurements", f"{len(block.image_points)} of {len(rays)} points{per_point}"
    yield "surveyed", f"{len(block.control)} control points, {len(block.check)} check points"
    lon, lat = block.frame.origin
    yield (
        "origin",
        f"{abs(lat):.5f} {'S' if lat < 0 else 'N'}, {abs(lon):.5f} {'W' if lon < 0 else 'E'}",
    )
    above = flying_heights(block)
    yield "flying height", _span(above, "m above the surveyed points", 0)
    for i, camera in enumerate(block.cameras):
        gsd = 100 * above[block.images.exposure_idx[block.images.camera_idx == i]]
        yield f"GSD {camera.name}", _span(gsd * camera.pixel_mm / camera.interior.f, "cm", 1)
    yield "overlap", _span(100 * forward_overlaps(block), "% along the strips", 0)


def _span(values: Array, unit: str, digits: int) -> str:
    """Return the range and the median of values."""
    values = values[np.isfinite(values)]
    if not len(values):
        return "not known"
    low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
    return f"{low:.{digits}f} to {high:.{digits}f} {unit}, median {middle:.{digits}f}"


def flying_heights(block: Block) -> Array:
    """Return heights of the exposures above the mean of the surveyed points, m.

    Parameters
    ----------
    block : Block

    Returns
    -------
    ndarray, shape (n_exposures,)
        NaN where the block has no surveyed point.
    """
    surveyed = np.concatenate([block.control.x_m, block.check.x_m])
    if not len(surveyed):
        return np.full(len(block.trajectory), np.nan)
    ground = block.frame.to_geographic(surveyed)[:, 2].mean()
    above: Array = block.frame.to_geographic(block.trajectory.T_m_b.r)[:, 2] - ground
    return above


def forward_overlaps(block: Block) -> Array:
    """Return the overlap of each image with the one before it in its strip.

    Valid for images that look down, over flat ground.

    Parameters
    ----------
    block : Block

    Returns
    -------
    ndarray, shape (n_pairs,)
        0 to 1; NaN where the flying height is not known.
    """
    before, after = _neighbours(block.images)
    above = flying_heights(block)[block.images.exposure_idx[before]]
    T_m_b = block.T_m_b_images
    overlap = np.full(len(before), np.nan)
    for i, camera in enumerate(block.cameras):
        mine = block.images.camera_idx[before] == i
        T_m_c = T_m_b[before[mine]] @ camera.T_b_c
        base = transform(np.swapaxes(T_m_c.R, -1, -2), T_m_b.r[after[mine]] - T_m_b.r[before[mine]])
        size = camera.pixel_mm / camera.interior.f * np.array([camera.width_px, camera.height_px])
        shift = np.abs(base[:, :2]) / (above[mine, None] * size)
        overlap[mine] = np.prod(np.maximum(1 - shift, 0), axis=1)
    return overlap


def _neighbours(images: Images) -> tuple[Array, Array]:
    """Return consecutive images of one camera and strip, in the order of images.csv."""
    last: dict[tuple[int, str], int] = {}
    before, after = [], []
    for i, strip in enumerate(images.strips):
        key = (int(images.camera_idx[i]), strip)
        if strip and key in last:
            before.append(last[key])
            after.append(i)
        last[key] = i
    return np.array(before, dtype=np.intp), np.array(after, dtype=np.intp)
