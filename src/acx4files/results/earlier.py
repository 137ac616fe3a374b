"""The calibration of an earlier flight, read for its validation on a later flight."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.results import folder, provenance
from acx4files.results.provenance import Run, sha256_of
from acx4files.results.read_back import (
    calibrated_methods,
    read_calibration,
    read_relative_orientation,
    rigs_for,
)
from acx4lib.block import Block
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.transferred_points import synthetic_block, transfer

TABLES = ("parameters.csv", "covariance.csv", "summary.json")
"""Files of the results that hold a calibration."""

ORIENTED = ("synthetic/refined", "heads/relative_orientation")
"""Results with the orientation of the heads; the first one that exists is used."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Earlier:
    """The results of an earlier flight, whose calibrations a later one validates."""

    run: Run

    @property
    def origin(self) -> dict[str, object]:
        """Origin of the calibration as results record it: flight, dates and checksums."""
        flight, results_path = self.run.flight, self.run.folder
        computed = dt.datetime.fromtimestamp(
            (results_path / "summary.json").stat().st_mtime, tz=dt.UTC
        )
        return {
            "flight": {"name": flight.name, "sha256": self.run.provenance.digest},
            "results": results_path.resolve().name,
            "sha256": provenance.digest({n: sha256_of(results_path / n) for n in TABLES}),
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

    def block(self, flight: Flight) -> Block:
        """Return the validation block of a flight with the mounted camera of the earlier one.

        If it is measured in heads, the earlier flight's heads transfer its points.
        """
        block, synthetic = flight.block("validation"), self.run.flight.synthetic_camera
        if "validation" not in flight.transferred or synthetic is None:
            return block
        oriented = self._heads()
        return synthetic_block(block, transfer(block, oriented, synthetic), synthetic)

    def calibrations(self, block: Block) -> dict[str, Calibration]:
        """Return the calibrations of the cameras of a block, by method."""
        found, cameras = self.run.found, self._declared(block)
        return {
            method: read_calibration(found, f"mounting/{method}", cameras)
            for method in calibrated_methods(found)
        }

    def rigs(self, block: Block) -> dict[str, Calibration]:
        """Return the calibrated rigs with all heads of a block, by method."""
        return rigs_for(self.run.found, self._declared(block))

    def _declared(self, block: Block) -> list[Camera]:
        """Return the cameras of a block as the earlier flight declared them."""
        return [self.run.flight.cameras[camera.name] for camera in block.cameras]

    def _heads(self) -> RelativeOrientation:
        run_results = self.run.found
        source = next(s for s in ORIENTED if _is_oriented(run_results, s))
        return read_relative_orientation(run_results, source, self.run.flight.cameras)


def read(results_path: str | Path, flight: Flight) -> Earlier:
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
    run = provenance.read_run(results_path)
    provenance.check_kept(run, "mounting")
    earlier = Earlier(run=run)
    problems = [f"{run.folder}: {line}" for line in _differences(earlier, flight)]
    if problems:
        raise FlightError(problems)
    return earlier


def _differences(earlier: Earlier, flight: Flight) -> Iterator[str]:
    """Yield reasons why a flight cannot validate a calibration, one sentence each."""
    run_results, before = earlier.run.found, earlier.run.flight
    methods = calibrated_methods(run_results)
    if not methods:
        yield "no calibration whose parameters are all determined; acx4 run makes one"
    calibrated = {name for m in methods for name in folder.cameras(run_results, f"mounting/{m}")}
    for camera in flight.mounted("validation").cameras:
        if methods and camera.name not in calibrated:
            names = ", ".join(sorted(calibrated))
            yield f"camera {camera.name} of {flight.path} is not calibrated; {names} is"
        elif camera.name in before.cameras:
            yield from _other_camera(before.cameras[camera.name], camera)
    if before.refraction != flight.refraction:
        yield f"refraction is {before.refraction!r}, in {flight.path} {flight.refraction!r}"
    if "validation" in flight.transferred:
        yield from _other_heads(earlier, flight)


def _other_camera(before: Camera, camera: Camera) -> Iterator[str]:
    """Yield the difference if two cameras of one name have other sensor or pixel sizes."""
    mine, theirs = _sensor(camera), _sensor(before)
    if mine != theirs:
        yield f"camera {camera.name} has {theirs}, in the flight to be validated {mine}"


def _sensor(camera: Camera) -> str:
    return f"{camera.width_px} x {camera.height_px} pixels of {1000 * camera.pixel_mm:g} µm"


def _other_heads(earlier: Earlier, flight: Flight) -> Iterator[str]:
    """Yield reasons why an earlier flight's heads cannot transfer a flight's points."""
    before, run_results = earlier.run.flight, earlier.run.found
    source = next((s for s in ORIENTED if _is_oriented(run_results, s)), "")
    mine, theirs = flight.synthetic_camera, before.synthetic_camera
    if not source or mine is None or theirs is None:
        yield "no orientation of the heads, by which points measured in heads are transferred"
        return
    frame, other = (np.degrees(camera.T_b_c.opk) for camera in (mine, theirs))
    if not np.allclose(frame, other, rtol=0, atol=1e-9):
        yield "the mount angles of the synthetic camera define another frame"
    oriented = folder.cameras(run_results, source)
    for camera in flight.block("validation").cameras:
        if camera.name not in oriented:
            yield f"camera {camera.name} of {flight.path} is no head; {', '.join(oriented)} are"
        else:
            yield from _other_camera(before.cameras[camera.name], camera)


def _is_oriented(run_results: folder.Results, source: str) -> bool:
    left_out = folder.messages(run_results.summary.get(source, {}), "left_out")
    return folder.has(run_results, source) and not left_out
