"""The heads together: one adjustment of their block with its trajectory."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acx4book.chapters.rig.deformations import Deformation, deformation
from acx4book.chapters.rig.one_by_one import oriented
from acx4lib.calibration import rig
from acx4lib.calibration.estimates import not_determined
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import AdjustmentError
from acx4lib.flight import Flight
from acx4lib.flight.block import Block, select_cameras
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.results.adjustments import Record, of_left_out, of_mounting
from acx4sim.files.writer import truth_path


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
    """

    block: Block
    rig: Mounting | None
    left_out: str = ""


# --- steps -----------------------------------------------------------------------------------


def calibrate(flight: Flight) -> RigStage:
    """Adjust all heads of a flight together; the interior parameters are those of stage heads.

    Parameters
    ----------
    flight : Flight
        With a block heads. Its [synthetic] says which cameras are heads; without it all of the
        block's are.
    """
    block = flight.blocks["heads"]
    names = tuple(camera.name for camera in block.cameras)
    if flight.synthetic:
        names = tuple(name for name in flight.synthetic.heads if name in names)
    block = select_cameras(block, names)
    try:
        found = rig.calibrate(block, free=flight.estimate_heads, refraction=flight.refraction)
    except AdjustmentError as error:
        return RigStage(block=block, rig=None, left_out=str(error))
    return RigStage(block=block, rig=found)


def records(stage: RigStage) -> list[Record]:
    """Return what the rig leaves in a results folder, a failure included."""
    if stage.rig is None:
        return [of_left_out("mounting", "rig", stage.left_out)]
    record = of_mounting(stage.rig)
    entry = record.summary["mounting/rig"]
    notes = [*_list(entry["notes"]), *(f"mounting/rig: {note}" for note in _notes(stage))]
    return [replace(record, summary={"mounting/rig": {**entry, "notes": notes}})]


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


def orient(flight: Flight, stage: RigStage) -> dict[str, RelativeOrientation]:
    """Orient the heads in every way of `experiments.oriented`; in none where there is no rig."""
    if flight.synthetic is None or stage.rig is None or not_determined(stage.rig.calibration):
        return {}
    try:
        return oriented(
            stage.block,
            stage.rig,
            flight.cameras[flight.synthetic.camera],
            free=flight.estimate_heads,
            refraction=flight.refraction,
        )
    except AdjustmentError:
        return {}


def deform(
    flight: Flight, ways: Mapping[str, RelativeOrientation], truth: RelativeOrientation | None
) -> dict[str, Deformation]:
    """Return what each orientation has wrong in the synthetic image."""
    if flight.synthetic is None:
        return {}
    synthetic = flight.cameras[flight.synthetic.camera]
    return {title: deformation(one, synthetic, truth=truth) for title, one in ways.items()}


# --- truth of a simulated flight -------------------------------------------------------------


def true_heads(flight: Flight, stage: RigStage) -> tuple[Camera, ...]:
    """Return the heads as they truly are; none where the flight was not simulated."""
    path = truth_path(flight.pictures.resolve())
    if not path.is_file():
        return ()
    told = json.loads(path.read_text("utf-8"))["cameras"]
    return tuple(_true_head(camera, told[camera.name]) for camera in stage.block.cameras)


def _true_head(camera: Camera, told: Mapping[str, Any]) -> Camera:
    angles = [told[f"boresight_{angle}_deg"] for angle in ("omega", "phi", "kappa")]
    lens = {name: told[name] for name in ("k1", "k2", "k3", "p1", "p2")}
    return replace(
        camera,
        interior=Interior(f=told["f_mm"], xp=told["xp_mm"], yp=told["yp_mm"], **lens),
        T_b_c=Pose(
            R=rotation_from_opk(np.radians(angles)),
            r=np.array([told[f"lever_{axis}_m"] for axis in "xyz"]),
        ),
    )


def true_orientation(flight: Flight, stage: RigStage) -> RelativeOrientation | None:
    """Return how the heads truly stand in the synthetic frame; None where nobody knows."""
    heads = true_heads(flight, stage)
    if not heads or flight.synthetic is None or stage.rig is None:
        return None
    exact = replace(stage.rig, calibration=replace(stage.rig.calibration, cameras=heads))
    try:
        return rig.relative_orientation(exact, flight.cameras[flight.synthetic.camera])
    except AdjustmentError:
        return None
