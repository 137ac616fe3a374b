"""The heads of a simulated flight as they truly are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from acx4lib.calibration import rig
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.flight.reader import Flight
from acx4lib.flight.text.files import text_of
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.stages.rig import RigStage
from acx4sim.files.writer import truth_path


def true_heads(flight: Flight, stage: RigStage) -> tuple[Camera, ...]:
    """Return the heads as they truly are; none where the flight was not simulated."""
    path = truth_path(flight.pictures.resolve())
    if not path.is_file():
        return ()
    told = json.loads(text_of(path))["cameras"]
    return tuple(true_head(camera, told[camera.name]) for camera in stage.block.cameras)


def true_head(camera: Camera, told: Mapping[str, Any]) -> Camera:
    """Return a camera with what the truth of a simulated flight says of it."""
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
    heads, synthetic = true_heads(flight, stage), flight.synthetic_camera
    if not heads or synthetic is None or stage.rig is None:
        return None
    exact = replace(stage.rig, calibration=replace(stage.rig.calibration, cameras=heads))
    try:
        return rig.relative_orientation(exact, synthetic)
    except AdjustmentError:
        return None
