"""The summary of a flight that `acx4 check` prints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.flight.settings import Session
from acx4lib import shown
from acx4lib.block import Block
from acx4lib.design import flying_heights, forward_overlaps
from acx4lib.errors import visible
from acx4lib.expected import Array
from acx4lib.geometry.geodesy import SHOWN, GridSystem


def summary(flight: Flight) -> str:
    """Return the summary of a flight: blocks, cameras, counts, scale, notes."""
    lines = [
        f"{flight.name}{' (simulated)' if flight.simulated else ''}",
        _row("CRS", _system(flight.grid)),
        _row("heights", flight.grid.height_system),
        _row("refraction", flight.refraction),
        *(_row("session", conditions) for conditions in _session(flight.session)),
    ]
    for block in flight.blocks.values():
        lines += ["", f"block {block.name}", *(_row(*row) for row in _block_rows(block))]
        if block.name in flight.transferred:
            lines += [_row(*row) for row in _synthetic_rows(flight.mounted(block.name))]
        files = [file for file in flight.image_files[block.name] if file is not None]
        lines.append(_row("image files", f"{len(files)} of {len(block.images)}"))
    if flight.notes:
        lines += ["", "notes", *(f"  {note}" for note in flight.notes)]
    return "\n".join(lines)


def _session(session: Session) -> Iterator[str]:
    degrees = f"{session.temperature_c:g} °C" if np.isfinite(session.temperature_c) else ""
    if said := [str(one) for one in (session.date, degrees) if one]:
        yield ", ".join(said)


def _system(grid: GridSystem) -> str:
    """Return a CRS and its name in one line, although WKT may have many lines."""
    one_line = visible(" ".join(grid.crs.split()))
    shown = one_line if len(one_line) <= SHOWN else f"{one_line[:SHOWN]}…"
    return f"{shown}, {visible(grid.name)}"


def _row(name: str, value: str) -> str:
    return f"  {name:<14} {value}"


def _block_rows(block: Block) -> Iterator[tuple[str, str]]:
    names = ", ".join(camera.name for camera in block.cameras)
    yield "cameras", f"{len(block.cameras)}: {names}"
    strips = {strip for strip in block.images.strips if strip}
    in_strips = f" in {shown.count(len(strips), 'strip')}" if strips else ", strips not named"
    yield (
        "images",
        f"{len(block.images)} at {shown.count(len(block.trajectory), 'exposure')}{in_strips}",
    )
    rays = block.rays[block.rays > 0]
    per_point = f", {rays.mean():.1f} per point" if len(rays) else ""
    yield (
        "measurements",
        f"{len(block.image_points)} of {shown.count(len(rays), 'point')}{per_point}",
    )
    control = shown.count(len(block.control), "control point")
    yield "surveyed", f"{control}, {shown.count(len(block.check), 'check point')}"
    if not block.frame.grid.is_local:
        lon, lat = block.frame.origin
        yield (
            "origin",
            f"{abs(lat):.5f} {'S' if lat < 0 else 'N'}, {abs(lon):.5f} {'W' if lon < 0 else 'E'}",
        )
    yield "flying height", _span(_above(block), "m above the surveyed points", 0)
    yield from _image_rows(block)


def _synthetic_rows(block: Block) -> Iterator[tuple[str, str]]:
    images = shown.count(len(block.images), "image")
    yield "transferred to", f"{images} of {block.cameras[0].name}"
    yield from _image_rows(block)


def _image_rows(block: Block) -> Iterator[tuple[str, str]]:
    above = _above(block)
    for i, camera in enumerate(block.cameras):
        gsd = 100 * above[block.images.exposure_idx[block.images.camera_idx == i]]
        yield f"GSD {camera.name}", _span(gsd * camera.pixel_mm / camera.interior.f, "cm", 1)
    yield "overlap", _span(100 * forward_overlaps(block)[1], "% along the strips", 0)


def _above(block: Block) -> Array:
    """Return the heights above the surveyed points, m; NaN without surveyed points."""
    known = len(block.control) + len(block.check) > 0
    return flying_heights(block) if known else np.full(len(block.trajectory), np.nan)


def _span(values: Array, unit: str, digits: int) -> str:
    """Return the range and the median of values."""
    values = values[np.isfinite(values)]
    if not len(values):
        return "not known"
    low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
    return f"{low:.{digits}f} to {high:.{digits}f} {unit}, median {middle:.{digits}f}"
