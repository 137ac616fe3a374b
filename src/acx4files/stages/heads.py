"""Calibration and relative orientation of the heads (sections 2.1 and 4.1, Table 1)."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.results import provenance, tables
from acx4files.stages import diagnosed
from acx4lib.attempts import Failed, attempt
from acx4lib.calibration import held
from acx4lib.calibration.heads import (
    Heads,
    RelativeOrientation,
    calibrate_heads,
    relative_orientation,
)
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.frame import displacements


class HeadsStage(NamedTuple):
    """The heads, calibrated each by itself and oriented to each other, or why they are not."""

    heads: Heads
    orientation: RelativeOrientation | Failed


def run(flight: Flight, results_path: str | Path) -> HeadsStage:
    """Calibrate the heads of the block heads, orient them to each other, and write the results."""
    stage = calibrate(flight)
    write(flight, results_path, *stage)
    return stage


def calibrate(flight: Flight) -> HeadsStage:
    """Adjust every head of the block heads separately, and orient the heads to each other."""
    heads = calibrate_heads(flight.block("heads"), flight.head_names, flight.heads_model)
    return HeadsStage(heads, attempt(relative_orientation, heads, flight.synthetic_camera))


def write(
    flight: Flight,
    results_path: str | Path,
    heads: Heads,
    orientation: RelativeOrientation | Failed,
) -> None:
    """Write the results of the heads, failures included."""
    records = [diagnosed.of_head(name, fit) for name, fit in heads.bundles.items()]
    for name, reason in heads.failures.items():
        records.append(tables.not_adjusted(f"heads/bundle/{name}", reason, of="not_determined"))
    key = "heads/relative_orientation"
    if isinstance(orientation, Failed):
        records.append(tables.not_adjusted(key, orientation.reason))
    else:
        synthetic = flight.synthetic_camera
        effect = {} if synthetic is None else _held_effect(heads, orientation, synthetic)
        records.append(tables.of_relative_orientation(key, orientation, **effect))
    provenance.write(results_path, "heads", records, flight=flight)


def _held_effect(
    heads: Heads, orientation: RelativeOrientation, synthetic: Camera
) -> dict[str, dict[str, float]]:
    """Return the RMS displacement of each head's pixels if rejected held values were free, px."""
    tested = {name: held.of_bundle(fit) for name, fit in heads.bundles.items()}
    if not any(of.rejected for of in tested.values()):
        return {}
    freed = {name: of.freed(heads.bundles[name]) for name, of in tested.items()}
    after = relative_orientation(Heads(bundles=freed, failures={}), synthetic, weak=True)
    px = [d / synthetic.pixel_mm for d in displacements(orientation, after)]
    rms = [float(np.sqrt(np.mean(np.sum(d**2, axis=1)))) for d in px]
    return {"held_effect_px": dict(zip(freed, rms, strict=True))}
