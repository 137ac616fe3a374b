"""Calibrations and orientations of heads, read back from a results folder for later stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.results import folder
from acx4files.results.table_files import RELATIVE
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.estimates import (
    METHODS,
    RIGS,
    Calibration,
    given,
    to_reported,
    with_reported,
)
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.parameters import MOUNT, REPORTED
from acx4lib.least_squares.covariance import propagate

if TYPE_CHECKING:
    from acx4lib.calibration.heads import RelativeOrientation


def read_relative_orientation(
    found: folder.Results, stage_method: str, cameras: Mapping[str, Camera]
) -> RelativeOrientation:
    """Read the relative orientation of the heads from a results folder.

    Heads that were not calibrated have the interior orientation that the flight declares.

    Parameters
    ----------
    found : Results
    stage_method : str
        ``heads/relative_orientation`` or ``synthetic/refined``.
    cameras : mapping of str to Camera
        The cameras declared by the flight.

    Raises
    ------
    FlightError
        Where the folder does not have the heads.
    """
    # a calibration alone is read without what adjusts heads
    from acx4files.results.rows import joint_names  # noqa: PLC0415
    from acx4lib.calibration.heads import RelativeOrientation  # noqa: PLC0415

    names = folder.cameras(found, stage_method)
    values = np.array(
        [folder.parameters(found, stage_method, n)["value"].loc[list(RELATIVE)] for n in names]
    )
    cov = folder.covariance(found, stage_method)
    labels, scale = joint_names(names, np.array([1.0, 1.0, 1.0, *np.radians(np.ones(3))]))
    joint = cov.reindex(index=labels, columns=labels, fill_value=0.0).to_numpy()
    entry = found.summary.get(stage_method, {})
    heads = [cameras[name] for name in names]
    calibrated = next(
        (source for source in ("heads/bundle", "mounting/rig") if folder.has(found, source)), ""
    )
    if calibrated == "heads/bundle" or folder.has(found, "heads"):  # a rig that left the heads
        heads = [_estimated(found, calibrated, head) for head in heads]
    return RelativeOrientation(
        heads=tuple(heads),
        xyz_mm=values[:, :3],
        opk=np.radians(values[:, 3:]),
        cov_joint=joint * scale[:, None] * scale,
        n_exposures=int(str(entry.get("n_exposures", 0))),
        turns=_turns(entry),
    )


def _turns(entry: Mapping[str, object]) -> Array | None:
    """Return the standard deviations of picture turns, radians; None without any."""
    turns = entry.get("picture_turns_deg")
    return np.radians(turns) if isinstance(turns, list) else None


def _estimated(run_results: folder.Results, stage_method: str, camera: Camera) -> Camera:
    """Return a declared camera with the parameters that a method estimated."""
    listed = folder.rows(run_results, "parameters", stage_method)
    mine = listed[listed["camera"] == camera.name]
    return with_reported(camera, dict(zip(mine["parameter"], mine["value"], strict=True)))


def read_calibration(
    found: folder.Results, stage_method: str, cameras: Sequence[Camera]
) -> Calibration:
    """Read a calibration from a results folder.

    The inverse of `rows.calibration_tables`.

    Parameters
    ----------
    found : Results
    stage_method : str
    cameras : sequence of Camera
        The cameras declared by the flight; parameters without a row keep the declared value.
        Other cameras of the method are left out.

    Raises
    ------
    FlightError
        Where the folder does not have the method.
    """
    estimated = tuple(_estimated(found, stage_method, camera) for camera in cameras)
    columns = np.full((len(cameras), len(INTERIOR) + len(MOUNT)), -1)
    whole = folder.covariance(found, stage_method)
    reported_names = [name for name, _ in REPORTED.values()]
    mine = {f"{camera.name}/{name}" for camera in cameras for name in reported_names}
    names = [label for label in whole.index if label in mine]
    row_of = {label: i for i, label in enumerate(names)}
    for k, camera in enumerate(cameras):
        for j, key in enumerate((*INTERIOR, *MOUNT)):
            label = f"{camera.name}/{REPORTED[key][0]}"
            columns[k, j] = row_of.get(label, -1)
    entry = found.summary[stage_method]
    sigma0_sq = float(str(entry["sigma0_squared"]))
    reported = Calibration(
        cameras=estimated,
        layout=Layout(
            interior=columns[:, : len(INTERIOR)],
            mount=columns[:, len(INTERIOR) :],
            pose=np.zeros((0, 6), dtype=np.intp),
        ),
        cov=np.zeros((len(names), len(names))),
        sigma0_sq=sigma0_sq,
        open_columns=np.zeros(len(names), dtype=bool),
        turns=_turns(entry),
    )
    back = np.linalg.inv(to_reported(reported))
    cov = whole.loc[names, names].to_numpy() / sigma0_sq
    return replace(reported, cov=propagate(back, cov))


def calibrations_for(
    flight: Flight, found: folder.Results, cameras: Sequence[Camera]
) -> dict[str, Calibration]:
    """Return the calibrations for the validation of a flight, by method.

    A method with a parameter that is not determined is left out. For a flight without a
    calibration block, the method is ``given``: the declared cameras.

    Parameters
    ----------
    flight : Flight
    found : Results
    cameras : sequence of Camera
        As declared.

    Raises
    ------
    FlightError
        Where the flight has a calibration block whose results are not in the folder.
    """
    if flight.calibration is None:
        return {"given": given(cameras)}
    folder.rows(found, "parameters", "mounting")  # raises where the stage has not been run
    return {
        method: read_calibration(found, f"mounting/{method}", cameras)
        for method in calibrated_methods(found)
    }


def rigs_for(found: folder.Results, cameras: Sequence[Camera]) -> dict[str, Calibration]:
    """Return the rigs with all these heads, for a validation in head images, by method.

    Parameters
    ----------
    found : Results
    cameras : sequence of Camera
        Heads, as declared.
    """
    names = {camera.name for camera in cameras}
    return {
        method: read_calibration(found, f"mounting/{method}", cameras)
        for method in calibrated_methods(found, RIGS)
        if names <= set(folder.cameras(found, f"mounting/{method}"))
    }


def calibrated_methods(found: folder.Results, methods: Sequence[str] = METHODS) -> tuple[str, ...]:
    """Return the methods of the mounting stage that determined all their parameters.

    A method with too many rejections is left out: its data contradict each other.
    """
    entries = {method: found.summary.get(f"mounting/{method}", {}) for method in methods}
    return tuple(
        method
        for method, entry in entries.items()
        if entry.get("converged")
        and not folder.messages(entry, "not_determined")
        and not folder.messages(entry, "stopped")
    )
