"""The heads together: one adjustment of their block with its trajectory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.results import provenance, tables
from acx4files.results.folder import Record
from acx4files.stages.diagnosed import of_mounting
from acx4files.stages.order import rig_leads
from acx4lib import expected
from acx4lib.attempts import Failed, attempt
from acx4lib.block import Block, select_cameras
from acx4lib.calibration import rig
from acx4lib.calibration.estimates import RIGS, features
from acx4lib.calibration.mounting import Mounting


def run(flight: Flight, results_path: str | Path) -> dict[str, Mounting | Failed]:
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
    dict of str to Mounting or Failed
        By the names of `methods`.
    """
    rigs = {method: calibrate(flight, method=method) for method in methods(flight)}
    write(flight, results_path, rigs)
    return rigs


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


def calibrate(flight: Flight, *, method: str = "rig") -> Mounting | Failed:
    """Adjust all heads of a block together; the interior parameters are those of stage heads.

    Of the errors of the trajectory that flight.toml names, those of attitudes are estimated.

    Parameters
    ----------
    flight : Flight
        With the block.
    method : str
        ``"rig"`` for the block heads, ``"rig_calibration"`` for the calibration block.
    """
    return attempt(rig.calibrate, measured(flight, method), flight.heads_model)


def measured(flight: Flight, method: str = "rig") -> Block:
    """Return the block of a rig, with its heads in the order of flight.toml's [synthetic].

    Arguments are those of `calibrate`.
    """
    expected.one_of("method", method, RIGS)
    block = flight.block("heads" if method == "rig" else "calibration")
    present = [camera.name for camera in block.cameras]
    order = flight.synthetic.heads if flight.synthetic else present
    return select_cameras(block, [head for head in order if head in present])


def write(flight: Flight, results_path: str | Path, rigs: Mapping[str, Mounting | Failed]) -> None:
    """Write the results of rigs beside those of stage mounting.

    Parameters
    ----------
    flight : Flight
    results_path : path
    rigs : mapping of str to Mounting or Failed
        By the names of `methods`.
    """
    records = [_record(flight, method, outcome) for method, outcome in rigs.items()]
    provenance.write(results_path, "mounting", records, flight=flight, methods=[*rigs])
    if rig_leads(flight):
        oriented = [] if isinstance(rigs["rig"], Failed) else [_oriented(flight, rigs["rig"])]
        provenance.write(results_path, "heads", oriented, flight=flight)


def _oriented(flight: Flight, found: Mounting) -> Record:
    """Return the record of the rig's relative orientation, the first head as declared."""
    camera, key = flight.synthetic_camera, "heads/relative_orientation"
    orientation = attempt(rig.relative_orientation, found, camera, as_declared=True)
    if isinstance(orientation, Failed):
        return tables.not_adjusted(key, orientation.reason)
    return tables.of_relative_orientation(key, orientation)


def _record(flight: Flight, method: str, outcome: Mounting | Failed) -> Record:
    if isinstance(outcome, Failed):
        return tables.not_adjusted(f"mounting/{method}", outcome.reason)
    over_ground = "validation" not in flight.transferred
    record = of_mounting(replace(outcome, method=method), over_ground=over_ground)
    return tables.extended(record, {}, _notes(measured(flight, method), outcome))


def _notes(block: Block, found: Mounting) -> Iterator[str]:
    """Yield remarks on a rig for the user, one sentence each."""
    columns = found.calibration.layout
    held = {
        "focal lengths": np.all(columns.interior[:, 0] < 0),
        "lever arms": np.all(columns.mount[:, :3] < 0),
        "boresights": np.all(columns.mount[:, 3:] < 0),
    }
    if names := " and ".join(name for name, is_held in held.items() if is_held):
        yield f"the {names} are held; estimated, something would not be determined"
    if n := len(rig.one_exposure_points(block)):
        points = "point is" if n == 1 else "points are"
        how = "as high as the nearest"
        if "control" not in features(block):
            how = "left out, since no control points tell how high the ground is"
        yield f"{n} {points} shared by heads at one exposure only, {how}"
