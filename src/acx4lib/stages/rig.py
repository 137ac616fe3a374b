"""The heads together: one adjustment of their block with its trajectory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acx4lib import expected
from acx4lib.calibration import rig
from acx4lib.calibration.estimates import RIGS
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import AdjustmentError
from acx4lib.flight.block import Block, select_cameras
from acx4lib.flight.reader import Flight
from acx4lib.results.adjustments import Record, of_left_out, of_mounting, write
from acx4lib.stages.explained import explained, solving


@dataclass(frozen=True, kw_only=True, eq=False)
class RigStage:
    """The heads of a flight, calibrated together.

    Attributes
    ----------
    block : Block
        Of the heads, in the order of flight.toml's [synthetic].
    rig : Mounting or None
    left_out : str
        Why there is no rig; empty where there is one.
    method : str
        One of `estimates.RIGS`.
    """

    block: Block
    rig: Mounting | None
    left_out: str = ""
    method: str = "rig"


def run(flight: Flight, results_path: str | Path) -> RigStage:
    """Calibrate all heads together, and write the results beside those of stage mounting.

    A calibration block that is measured in heads has a rig of its own in the results.

    Parameters
    ----------
    flight : Flight
        With a block heads.
    results_path : path

    Returns
    -------
    RigStage
        Of the block heads.
    """
    stages = []
    over_ground = "validation" not in flight.carried
    blocks = {"rig": "heads", "rig_calibration": "calibration"}
    for method in blocks if "calibration" in flight.carried else ("rig",):
        with solving(flight, blocks[method]):
            stage = calibrate(flight, method=method)
            said = records(stage, over_ground=over_ground)
            found = explained(said, flight, blocks[method])
        stages.append((stage, found))
    for stage, found in stages:
        write(results_path, f"mounting/{stage.method}", found, flight=flight)
    return stages[0][0]


def calibrate(flight: Flight, *, method: str = "rig") -> RigStage:
    """Adjust all heads of a block together; the interior parameters are those of stage heads.

    Parameters
    ----------
    flight : Flight
        With the block.
    method : str
        ``"rig"`` for the block heads, ``"rig_calibration"`` for the calibration block.
    """
    expected.one_of("method", method, RIGS)
    block = _of_heads(flight, "heads" if method == "rig" else "calibration")
    try:
        found = rig.calibrate(block, free=flight.estimate_heads, refraction=flight.refraction)
    except AdjustmentError as error:
        return RigStage(block=block, rig=None, left_out=str(error), method=method)
    return RigStage(block=block, rig=replace(found, method=method), method=method)


def _of_heads(flight: Flight, name: str) -> Block:
    """Return a block with its heads in the order of flight.toml's [synthetic]."""
    block = flight.block(name)
    present = [camera.name for camera in block.cameras]
    order = flight.synthetic.heads if flight.synthetic else present
    return select_cameras(block, [head for head in order if head in present])


def records(stage: RigStage, *, over_ground: bool = False) -> list[Record]:
    """Return what the rig leaves in a results folder, a failure included.

    Parameters
    ----------
    stage : RigStage
    over_ground : bool
        As `adjustments.of_bundle` takes it.
    """
    if stage.rig is None:
        return [of_left_out("mounting", stage.method, stage.left_out)]
    record = of_mounting(stage.rig, over_ground=over_ground)
    ((key, entry),) = record.summary.items()
    notes = [*_list(entry["notes"]), *(f"{key}: {note}" for note in _notes(stage))]
    return [replace(record, summary={key: {**entry, "notes": notes}})]


def _list(value: object) -> list[object]:
    return value if isinstance(value, list) else []


def _notes(stage: RigStage) -> list[str]:
    """Return what a user should know of a rig, in sentences."""
    notes = []
    if stage.rig is not None and np.all(stage.rig.calibration.layout.interior[:, 0] < 0):
        notes.append("the focal lengths are held; estimated, something would not be determined")
    if n := len(rig.one_exposure_points(stage.block)):
        notes.append(f"{n} points that heads share at one exposure only are as high as the nearest")
    return notes
