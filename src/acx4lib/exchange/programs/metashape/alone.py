"""Cameras without images: a calibration that Metashape saved, or the sensors of a chunk."""

from __future__ import annotations

from pathlib import Path

from acx4lib.exchange.brought import Brought
from acx4lib.exchange.programs.metashape.files import CALIBRATION, Chunk
from acx4lib.exchange.programs.metashape.oriented import told
from acx4lib.exchange.programs.metashape.sensors import calibration, sensors
from acx4lib.exchange.programs.shared.cameras import Lens, refitted
from acx4lib.exchange.safe.opened import checksums


def has_none_but_cameras(chunk: Chunk) -> bool:
    """Tell whether a file has no images."""
    listed = chunk.root.maybe("cameras")
    return listed is None or next(listed.everywhere("camera"), None) is None


def read(chunk: Chunk, *, wanted: str, pixel_um: float | None) -> Brought:
    """Return the cameras of a file without images; arguments as those of `reading.read`."""
    lenses = _of_file(chunk) if chunk.root.tag == CALIBRATION else _of_chunk(chunk, wanted)
    fitted = told(chunk, lambda: refitted(lenses, pixel_um=pixel_um))
    return Brought(
        source="Metashape's cameras",
        sha256=checksums(chunk.sources),
        settings=fitted.settings,
        assumed=fitted.assumed,
        found=fitted.found,
    )


def _of_file(chunk: Chunk) -> dict[str, Lens]:
    found = calibration(chunk.root)
    lens = Lens(
        width_px=found.width_px, height_px=found.height_px, hole=found.hole, ideal=found.ideal
    )
    return {Path(chunk.sources[0].file).stem: lens}


def _of_chunk(chunk: Chunk, wanted: str) -> dict[str, Lens]:
    return {one.name: one.lens for one in sensors(chunk.root, wanted=wanted).values()}
