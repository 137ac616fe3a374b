"""The heads of a simulated flight as they truly are."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from acx4lib.attempts import Failed, attempt
from acx4lib.calibration import rig
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.calibration.mounting import Mounting
from acx4lib.flight.reader import Flight
from acx4lib.flight.text.files import text_of
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4sim.files.writer import truth_path


def true_heads(flight: Flight, cameras: Sequence[Camera]) -> tuple[Camera, ...]:
    """Return heads as they truly are; none where the flight was not simulated.

    Parameters
    ----------
    flight : Flight
    cameras : sequence of Camera
        Of the flight.
    """
    path = truth_path(flight.pictures.resolve())
    if not path.is_file():
        return ()
    told = json.loads(text_of(path))["cameras"]
    return tuple(true_head(camera, told[camera.name]) for camera in cameras)


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


def off_truth(flight: Flight, together: Mounting) -> pd.Series:
    """Return how far estimates are from the truth, in standard deviations.

    Parameters
    ----------
    flight : Flight
    together : Mounting
        Of several cameras.

    Returns
    -------
    Series
        By the rows of the mounting's table; empty where the flight was not simulated.
    """
    true, table = true_heads(flight, together.calibration.cameras), together.table()
    if not true:
        return pd.Series(index=table.index[:0], dtype=float)
    exact = replace(together.calibration, cameras=true).table()["value"]
    return (table["value"] - exact).abs() / table["sigma"]


def true_orientation(flight: Flight, together: Mounting) -> RelativeOrientation | None:
    """Return how the heads truly stand in the synthetic frame; None where nobody knows.

    Parameters
    ----------
    flight : Flight
    together : Mounting
        Their rig.
    """
    heads = true_heads(flight, together.calibration.cameras)
    if not heads:
        return None
    exact = replace(together, calibration=replace(together.calibration, cameras=heads))
    found = attempt(rig.relative_orientation, exact, flight.synthetic_camera)
    return None if isinstance(found, Failed) else found
