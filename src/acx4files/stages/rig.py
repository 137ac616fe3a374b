"""The heads together: one adjustment of their block with its trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.results import provenance, tables
from acx4files.results.folder import Record, messages
from acx4files.stages.diagnosed import of_mounting
from acx4files.stages.order import rig_leads
from acx4lib import expected, shown
from acx4lib.attempts import Failed, attempt
from acx4lib.block import Block, select_cameras
from acx4lib.calibration import rig
from acx4lib.calibration.estimates import RIGS, features
from acx4lib.calibration.mounting import Mounting

if TYPE_CHECKING:
    import pandas as pd


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

    def __repr__(self) -> str:
        """Summarize the rig in one line."""
        cameras = shown.names([camera.name for camera in self.block.cameras])
        return shown.line(
            "RigStage", cameras, *(self.rig.bundle.summary if self.rig else ["no rig"])
        )

    def table(self) -> pd.DataFrame:
        """Return the parameters of all heads; an empty table without a rig."""
        return shown.parameter_table(()) if self.rig is None else self.rig.table()


def run(flight: Flight, results_path: str | Path) -> RigStage:
    """Calibrate all heads together, and write the results beside those of stage mounting.

    A calibration block that is measured in heads has a rig of its own in the results, unless it is
    the block heads again.

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
    stages = [calibrate(flight, method=method) for method in methods(flight)]
    write(flight, results_path, stages)
    return stages[0]


def methods(flight: Flight) -> tuple[str, ...]:
    """Return the rigs of a flight, of `estimates.RIGS`: one per block with its own pictures.

    Parameters
    ----------
    flight : Flight
        With a block heads.
    """
    if "calibration" not in flight.transferred:
        return RIGS[:1]
    heads, calibration = (flight.block(name) for name in ("heads", "calibration"))
    same = heads.images.names == calibration.images.names and np.array_equal(
        heads.image_points.colrow, calibration.image_points.colrow
    )
    return RIGS[:1] if same else RIGS


def calibrate(flight: Flight, *, method: str = "rig") -> RigStage:
    """Adjust all heads of a block together; the interior parameters are those of stage heads.

    Of the errors of the trajectory that flight.toml names, those of attitudes are estimated.

    Parameters
    ----------
    flight : Flight
        With the block.
    method : str
        ``"rig"`` for the block heads, ``"rig_calibration"`` for the calibration block.
    """
    block = measured(flight, method)
    return gathered(block, attempt(rig.calibrate, block, flight.heads_model), method)


def measured(flight: Flight, method: str = "rig") -> Block:
    """Return the block of a rig, with its heads in the order of flight.toml's [synthetic].

    Parameters
    ----------
    flight : Flight
        With the block.
    method : str
        ``"rig"`` for the block heads, ``"rig_calibration"`` for the calibration block.
    """
    expected.one_of("method", method, RIGS)
    block = flight.block("heads" if method == "rig" else "calibration")
    present = [camera.name for camera in block.cameras]
    order = flight.synthetic.heads if flight.synthetic else present
    return select_cameras(block, [head for head in order if head in present])


def gathered(block: Block, found: Mounting | Failed, method: str = "rig") -> RigStage:
    """Collect a block and its calibrated rig, of one of `estimates.RIGS`, in one value."""
    if isinstance(found, Mounting):
        return RigStage(block=block, rig=replace(found, method=method), method=method)
    return RigStage(block=block, rig=None, left_out=found.reason, method=method)


def write(flight: Flight, results_path: str | Path, stages: Sequence[RigStage]) -> None:
    """Write the results of rigs beside those of stage mounting.

    Parameters
    ----------
    flight : Flight
    results_path : path
    stages : sequence of RigStage
        As `gathered` makes them.
    """
    over_ground = "validation" not in flight.transferred
    for stage in stages:
        records = _records(stage, over_ground=over_ground)
        provenance.write(results_path, "mounting", records, flight=flight, methods=[stage.method])
    if rig_leads(flight):
        oriented = _oriented(flight, stages[0])
        provenance.write(results_path, "heads", oriented, flight=flight)


def _oriented(flight: Flight, stage: RigStage) -> list[Record]:
    """Return the record of the rig's relative orientation, the first head as declared."""
    if stage.rig is None:
        return []
    camera, key = flight.synthetic_camera, "heads/relative_orientation"
    orientation = attempt(rig.relative_orientation, stage.rig, camera, as_declared=True)
    if isinstance(orientation, Failed):
        return [tables.not_adjusted(key, orientation.reason)]
    return [tables.of_relative_orientation(key, orientation)]


def _records(stage: RigStage, *, over_ground: bool) -> list[Record]:
    """Return the records of a rig for a results folder, a failure included."""
    if stage.rig is None:
        return [tables.not_adjusted(f"mounting/{stage.method}", stage.left_out)]
    record = of_mounting(stage.rig, over_ground=over_ground)
    ((key, entry),) = record.summary.items()
    notes = [*messages(entry, "notes"), *(f"{key}: {note}" for note in _notes(stage))]
    return [replace(record, summary={key: {**entry, "notes": notes}})]


def _notes(stage: RigStage) -> list[str]:
    """Return remarks on a rig for the user, one sentence each."""
    notes = []
    if stage.rig is not None:
        columns = stage.rig.calibration.layout
        held = {
            "focal lengths": np.all(columns.interior[:, 0] < 0),
            "lever arms": np.all(columns.mount[:, :3] < 0),
            "boresights": np.all(columns.mount[:, 3:] < 0),
        }
        if names := " and ".join(name for name, is_held in held.items() if is_held):
            notes.append(f"the {names} are held; estimated, something would not be determined")
    if n := len(rig.one_exposure_points(stage.block)):
        points = "point is" if n == 1 else "points are"
        how = "as high as the nearest"
        if "control" not in features(stage.block):
            how = "left out, since no control points tell how high the ground is"
        notes.append(f"{n} {points} shared by heads at one exposure only, {how}")
    return notes
