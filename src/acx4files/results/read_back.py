"""Calibrations, oriented heads and transferred points, read back from a results folder.

They are for later stages, for other programs, and for the validation of a later flight.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4files.flight.block_from_tables import index_of
from acx4files.flight.reader import Flight
from acx4files.results import folder, provenance
from acx4files.results.folder import RELATIVE
from acx4files.results.provenance import Run, sha256_of
from acx4files.results.tables import TRANSFERRED, joint_names, measured
from acx4lib.block import Block
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.estimates import (
    METHODS,
    RIGS,
    Calibration,
    given,
    to_reported,
    with_reported,
)
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.parameters import MOUNT, REPORTED
from acx4lib.least_squares.covariance import propagate
from acx4lib.synthetic_image.transferred_points import TransferredPoints, synthetic_block, transfer

ORIENTED = ("synthetic/refined", "heads/relative_orientation")
"""Results with the orientation of the heads; the first one that exists is used."""


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
    names = folder.cameras(found, stage_method)
    listed = folder.rows(found, "parameters", stage_method).set_index(["camera", "parameter"])
    values = np.array([[listed["value"][name, key] for key in RELATIVE] for name in names])
    cov = folder.covariance(found, stage_method)
    labels, scale = joint_names(names, np.radians(1.0))
    joint = cov.reindex(index=labels, columns=labels, fill_value=0.0).to_numpy()
    entry = found.summary.get(stage_method, {})
    heads = [cameras[name] for name in names]
    if folder.has(found, "heads"):
        source = "heads/bundle" if folder.has(found, "heads/bundle") else "mounting/rig"
        heads = [_estimated(found, source, head) for head in heads]
    return RelativeOrientation(
        heads=tuple(heads),
        xyz_mm=values[:, :3],
        opk=np.radians(values[:, 3:]),
        cov_joint=joint * scale[:, None] * scale,
        n_exposures=entry.get("n_exposures", 0),
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

    The inverse of `tables.calibration_tables`.

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
    whole = folder.covariance(found, stage_method)
    keys = [REPORTED[key][0] for key in (*INTERIOR, *MOUNT)]
    labels = [f"{camera.name}/{key}" for camera in cameras for key in keys]
    names = whole.index[whole.index.isin(labels)]
    columns = names.get_indexer(pd.Index(labels)).reshape(len(cameras), len(keys))
    entry = found.summary[stage_method]
    sigma0_sq = float(entry["sigma0_squared"])
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
    """
    return {"given": given(cameras)} if flight.calibration is None else calibrated(found, cameras)


def calibrated(found: folder.Results, cameras: Sequence[Camera]) -> dict[str, Calibration]:
    """Return the calibrations whose parameters are all determined, by method."""
    return {
        method: read_calibration(found, f"mounting/{method}", cameras)
        for method in calibrated_methods(found)
    }


def rigs_for(found: folder.Results, cameras: Sequence[Camera]) -> dict[str, Calibration]:
    """Return the rigs with all these heads, as declared, by method."""
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
        if entry.get("converged") and not entry.get("not_determined") and not entry.get("stopped")
    )


# --- points transferred into synthetic images ------------------------------------------------


def mounted_block(flight: Flight, name: str, found: folder.Results) -> Block:
    """Return a block of the mounted camera: synthetic images, if it is measured in heads.

    Parameters
    ----------
    flight : Flight
    name : str
        ``calibration`` or ``validation``.
    found : Results
        Only used if the block is measured in heads.

    Raises
    ------
    FlightError
        Where the block is not in the flight, stage synthetic has not transferred its points, or
        they were measured again later.
    """
    block, synthetic = flight.block(name), flight.synthetic_camera
    if name not in flight.transferred or synthetic is None:
        return block
    return synthetic_block(block, read_carried(flight, block, found), synthetic)


def read_carried(flight: Flight, block: Block, found: folder.Results) -> TransferredPoints:
    """Read the transferred points of a block from the results of stage synthetic.

    Parameters
    ----------
    flight : Flight
    block : Block
        One of its blocks that are measured in heads.
    found : Results

    Raises
    ------
    FlightError
        As `mounted_block`.
    """
    table = folder.rows(found, "synthetic_points", TRANSFERRED)
    table = table[table["block"] == block.name]
    checksums = found.summary.get(TRANSFERRED, {}).get("measured", {})
    transferred = TransferredPoints(
        exposure_idx=index_of(table["image"], block.trajectory.exposures),
        point_idx=index_of(table["point"], block.points),
        camera_idx=index_of(table["head"], [camera.name for camera in block.cameras]),
        colrow=table[["col_px", "row_px"]].to_numpy(),
        sigma_px=table[["sigma_col_px", "sigma_row_px"]].to_numpy(),
    )
    known = np.stack([transferred.exposure_idx, transferred.point_idx, transferred.camera_idx])
    now = measured(flight, block.name)
    if not isinstance(checksums, dict) or not now.items() <= checksums.items() or np.any(known < 0):
        problem = (
            f"{found.folder}: block {block.name} is not the one whose points were transferred into "
            "the synthetic image; run stage synthetic again"
        )
        raise FlightError([problem])
    return transferred


# --- the calibration of an earlier flight ----------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Earlier:
    """The results of an earlier flight, whose calibrations a later one validates."""

    run: Run

    @property
    def origin(self) -> dict[str, object]:
        """Origin of the calibration as results record it: flight, dates and checksums."""
        flight, path = self.run.flight, self.run.folder
        computed = dt.datetime.fromtimestamp((path / "summary.json").stat().st_mtime, tz=dt.UTC)
        tables = ("parameters.csv", "covariance.csv", "summary.json")
        return {
            "flight": {"name": flight.name, "sha256": self.run.provenance.digest},
            "results": path.resolve().name,
            "sha256": provenance.digest({name: sha256_of(path / name) for name in tables}),
            "flown": None if flight.session.date is None else flight.session.date.isoformat(),
            "computed": computed.date().isoformat(),
        }

    @property
    def sentence(self) -> str:
        """Sentence on the origin of the validated calibration."""
        flight, origin = self.run.flight, self.origin
        flown = f", flown {origin['flown']}" if origin["flown"] else ""
        return (
            f"the calibration is that of an earlier flight, {flight.name!r} "
            f"(SHA-256 {self.run.provenance.digest[:12]}{flown}, computed {origin['computed']}, "
            f"results {origin['results']!r} with SHA-256 {str(origin['sha256'])[:12]})"
        )

    @property
    def oriented(self) -> str:
        """The results with the orientation of the heads, of `ORIENTED`; empty without any."""
        found = self.run.found
        left = {source: found.summary.get(source, {}).get("left_out") for source in ORIENTED}
        return next((s for s in ORIENTED if folder.has(found, s) and not left[s]), "")

    def block(self, flight: Flight) -> Block:
        """Return the validation block of a flight with the mounted camera of the earlier one.

        If it is measured in heads, the earlier flight's heads transfer its points.
        """
        block, synthetic = flight.block("validation"), self.run.flight.synthetic_camera
        if "validation" not in flight.transferred or synthetic is None:
            return block
        heads = read_relative_orientation(self.run.found, self.oriented, self.run.flight.cameras)
        return synthetic_block(block, transfer(block, heads, synthetic), synthetic)

    def declared(self, block: Block) -> list[Camera]:
        """Return the cameras of a block as the earlier flight declared them."""
        return [self.run.flight.cameras[camera.name] for camera in block.cameras]


def read_earlier(results_path: str | Path, flight: Flight) -> Earlier:
    """Read the calibration of an earlier flight for the validation of another.

    Parameters
    ----------
    results_path : path
        The results of a run of the earlier flight.
    flight : Flight
        With a block validation.

    Raises
    ------
    FlightError
        Where they were changed after the run, have no calibration whose parameters are all
        determined, or are of other cameras: a line for each.
    """
    earlier = Earlier(run=provenance.read_run(results_path))
    problems = [f"{earlier.run.folder}: {line}" for line in _differences(earlier, flight)]
    if problems:
        raise FlightError(problems)
    return earlier


def _differences(earlier: Earlier, flight: Flight) -> Iterator[str]:
    """Yield reasons why a flight cannot validate a calibration, one sentence each."""
    found, before = earlier.run.found, earlier.run.flight
    methods = calibrated_methods(found)
    if not methods:
        yield "no calibration whose parameters are all determined; acx4 run makes one"
        return
    calibrated = {name: None for m in methods for name in folder.cameras(found, f"mounting/{m}")}
    yield from _other_cameras(before, calibrated, flight.mounted("validation").cameras, flight)
    if before.refraction != flight.refraction:
        yield f"refraction is {before.refraction!r}, in {flight.path} {flight.refraction!r}"
    if "validation" not in flight.transferred:
        return
    mine, theirs = flight.synthetic_camera, before.synthetic_camera
    if not earlier.oriented or mine is None or theirs is None:
        yield "no orientation of the heads, by which points measured in heads are transferred"
        return
    if not np.allclose(mine.T_b_c.opk, theirs.T_b_c.opk, rtol=0, atol=1e-11):
        yield "the mount angles of the synthetic camera define another frame"
    heads = folder.cameras(found, earlier.oriented)
    yield from _other_cameras(before, heads, flight.block("validation").cameras, flight)


def _other_cameras(
    before: Flight, known: Collection[str], cameras: Sequence[Camera], flight: Flight
) -> Iterator[str]:
    """Yield the cameras that an earlier flight did not calibrate, or had with another sensor."""
    for camera in cameras:
        if camera.name not in known:
            yield f"camera {camera.name} of {flight.path} is not calibrated; {', '.join(known)} is"
        elif _sensor(before.cameras[camera.name]) != (mine := _sensor(camera)):
            theirs = _sensor(before.cameras[camera.name])
            yield f"camera {camera.name} has {theirs}, in the flight to be validated {mine}"


def _sensor(camera: Camera) -> str:
    return f"{camera.width_px} x {camera.height_px} pixels of {1000 * camera.pixel_mm:g} µm"
