"""Calibration and relative orientation of the heads (sections 2.1 and 4.1, Table 1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.results import adjustments
from acx4files.stages.order import explained, solving
from acx4lib import shown
from acx4lib.attempts import Failed, attempt
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration import held
from acx4lib.calibration.determination import interior_exterior, largest_pairs
from acx4lib.calibration.heads import (
    Heads,
    RelativeOrientation,
    calibrate_heads,
    relative_orientation,
)
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.frame import displacements

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadsStage:
    """The heads, calibrated each by itself and oriented to each other.

    Attributes
    ----------
    heads : Heads
    orientation : RelativeOrientation or None
    left_out : str
        Why there is no relative orientation; empty where there is one.
    """

    heads: Heads
    orientation: RelativeOrientation | None
    left_out: str = ""

    def __repr__(self) -> str:
        """Summarize the stage in one line."""
        oriented = "" if self.orientation is None else "oriented to each other"
        return shown.line("HeadsStage", shown.names(list(self.heads.bundles)), oriented)

    def table(self) -> pd.DataFrame:
        """Return the parameters of all heads with their units and sigma."""
        return self.heads.table()


def run(flight: Flight, results_path: str | Path) -> HeadsStage:
    """Calibrate the heads, orient them to each other, and write the results.

    Parameters
    ----------
    flight : Flight
        With a block heads.
    results_path : path
    """
    with solving(flight, "heads"):
        stage = calibrate(flight)
    _write(flight, results_path, stage)
    return stage


def calibrate(flight: Flight) -> HeadsStage:
    """Adjust every head separately, and orient the heads to each other if possible.

    Parameters
    ----------
    flight : Flight
        With a block heads.
    """
    heads = calibrate_heads(
        flight.block("heads"),
        flight.head_names,
        free=flight.estimate_heads,
        refraction=flight.refraction,
    )
    return _gathered(heads, attempt(relative_orientation, heads, flight.synthetic_camera))


def _gathered(heads: Heads, orientation: RelativeOrientation | Failed) -> HeadsStage:
    """Collect the heads and their orientation in one value."""
    if isinstance(orientation, Failed):
        return HeadsStage(heads=heads, orientation=None, left_out=orientation.reason)
    return HeadsStage(heads=heads, orientation=orientation)


def write(
    flight: Flight,
    results_path: str | Path,
    heads: Heads,
    orientation: RelativeOrientation | Failed,
) -> None:
    """Write the results of the heads, with explanations of failures."""
    _write(flight, results_path, _gathered(heads, orientation))


def _write(flight: Flight, results_path: str | Path, stage: HeadsStage) -> None:
    with solving(flight, "heads"):
        records = explained(_records(stage, flight.synthetic_camera), flight, "heads")
    adjustments.write(results_path, "heads", records, flight=flight)


def _records(stage: HeadsStage, synthetic: Camera | None) -> list[adjustments.Record]:
    """Return the records of the heads for a results folder, failures included."""
    out = [_record(name, fit) for name, fit in stage.heads.bundles.items()]
    for name, reason in stage.heads.failures.items():
        key = f"heads/bundle/{name}"
        out.append(adjustments.of_failure("heads", "bundle", f"{key}: {reason}", summary_key=key))
    if stage.orientation is None:
        out.append(adjustments.of_left_out("heads", "relative_orientation", stage.left_out))
    else:
        effect = {} if synthetic is None else _held_effect(stage, stage.orientation, synthetic)
        out.append(
            adjustments.of_relative_orientation(
                "heads", "relative_orientation", stage.orientation, **effect
            )
        )
    return out


def _held_effect(
    stage: HeadsStage, orientation: RelativeOrientation, synthetic: Camera
) -> dict[str, dict[str, float]]:
    """Return the RMS displacement of each head's pixels if rejected held values were free, px."""
    tested = {name: held.of_bundle(fit) for name, fit in stage.heads.bundles.items()}
    if not any(of.rejected for of in tested.values()):
        return {}
    freed = {name: of.freed(stage.heads.bundles[name]) for name, of in tested.items()}
    heads = Heads(bundles=freed, failures={})
    after = relative_orientation(heads, synthetic, weak=True)
    px = [d / synthetic.pixel_mm for d in displacements(orientation, after)]
    rms = [float(np.sqrt(np.mean(np.sum(d**2, axis=1)))) for d in px]
    return {"held_effect_px": dict(zip(freed, rms, strict=True))}


def _record(name: str, fit: Bundle) -> adjustments.Record:
    """Return the record of a head, with its largest correlations in the summary."""
    key = f"heads/bundle/{name}"
    record = adjustments.of_bundle("heads", "bundle", fit, summary_key=key)
    record = adjustments.with_held(record, held.of_bundle(fit))
    largest: dict[str, object] = {**largest_pairs(interior_exterior(fit))}
    return replace(record, summary={key: {**record.summary[key], "largest_correlations": largest}})
