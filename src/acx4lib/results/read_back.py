"""Calibrations and orientations of heads, read back from results for later stages and flights."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

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
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.parameters import MOUNT, REPORTED
from acx4lib.least_squares.covariance import propagate
from acx4lib.results import folder, provenance
from acx4lib.results.own_folder import written
from acx4lib.results.provenance import Run
from acx4lib.results.table_files import RELATIVE
from acx4lib.synthetic_image.transferred_points import carry, synthetic_block


@contextmanager
def refused(found: folder.Results) -> Iterator[None]:
    """Say of tables that were changed by hand and hold no calibration that they do not.

    Raises
    ------
    FlightError
        In the place of KeyError and ValueError.
    """
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused
            yield
    except (KeyError, ValueError) as error:
        said = " ".join(str(error).split())
        problem = f"{found.folder}: parameters.csv and covariance.csv hold no calibration ({said})"
        raise FlightError([f"{problem}; run all stages again"]) from None


def read_relative_orientation(
    found: folder.Results, stage_method: str, cameras: Mapping[str, Camera]
) -> RelativeOrientation:
    """Return the relative orientation of the heads in a results folder.

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
    from acx4lib.calibration.heads import RelativeOrientation  # noqa: PLC0415
    from acx4lib.results.rows import joint_names  # noqa: PLC0415

    names = folder.cameras(found, stage_method)
    values = np.array(
        [folder.parameters(found, stage_method, n)["value"].loc[list(RELATIVE)] for n in names]
    )
    cov = folder.covariance(found, stage_method)
    labels, scale = joint_names(names, np.array([1.0, 1.0, 1.0, *np.radians(np.ones(3))]))
    joint = cov.reindex(index=labels, columns=labels, fill_value=0.0).to_numpy()
    entry = found.summary.get(stage_method, {})
    heads = [cameras[name] for name in names]
    if folder.has(found, "heads/bundle"):
        heads = [_estimated(found, "heads/bundle", head) for head in heads]
    return RelativeOrientation(
        heads=tuple(heads),
        xyz_mm=values[:, :3],
        opk=np.radians(values[:, 3:]),
        cov_joint=joint * scale[:, None] * scale,
        n_exposures=int(str(entry.get("n_exposures", 0))),
    )


def _estimated(found: folder.Results, stage_method: str, camera: Camera) -> Camera:
    """Return a declared camera with the parameters that a method estimated."""
    listed = folder.rows(found, "parameters", stage_method)
    mine = listed[listed["camera"] == camera.name]
    return with_reported(camera, dict(zip(mine["parameter"], mine["value"], strict=True)))


def read_calibration(
    found: folder.Results, stage_method: str, cameras: Sequence[Camera]
) -> Calibration:
    """Return a calibration from a results folder.

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
    sigma0_sq = float(str(found.summary[stage_method]["sigma0_squared"]))
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
    """Return the rigs with all these heads for a validation in the heads' images, by method.

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

    Not those of which too much would have been rejected: their data contradict each other.
    """
    said = {method: found.summary.get(f"mounting/{method}", {}) for method in methods}
    return tuple(
        method
        for method, entry in said.items()
        if entry.get("converged")
        and not folder.messages(entry, "not_determined")
        and not folder.messages(entry, "stopped")
    )


# --- The calibration of an earlier flight, asked for by name to be validated on a later one


TABLES = ("parameters.csv", "covariance.csv", "summary.json")
"""Files of the results that hold a calibration."""

ORIENTED = ("synthetic/refined", "heads/relative_orientation")
"""Results with the orientation of the heads; the first one that exists is used."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Earlier:
    """The results of an earlier flight, whose calibrations a later one validates.

    Attributes
    ----------
    run : Run
    """

    run: Run

    @property
    def told(self) -> dict[str, object]:
        """What results say of it: its flight, when this was flown and computed, its content."""
        flight, at = self.run.flight, self.run.folder
        computed = dt.datetime.fromtimestamp((at / "summary.json").stat().st_mtime, tz=dt.UTC)
        return {
            "flight": {"name": flight.name, "sha256": self.run.provenance.digest},
            "results": at.resolve().name,
            "sha256": provenance.digest({n: written(at / n).sha256 or "" for n in TABLES}),
            "flown": None if flight.session.date is None else flight.session.date.isoformat(),
            "computed": computed.date().isoformat(),
        }

    @property
    def sentence(self) -> str:
        """Whose calibration was validated."""
        flight, told = self.run.flight, self.told
        flown = f", flown {told['flown']}" if told["flown"] else ""
        return (
            f"the calibration is that of an earlier flight, {flight.name!r} "
            f"(SHA-256 {self.run.provenance.digest[:12]}{flown}, computed {told['computed']}, "
            f"results {told['results']!r} with SHA-256 {str(told['sha256'])[:12]})"
        )

    def block(self, flight: Flight) -> Block:
        """Return the validation block of a flight with the mounted camera of the earlier one.

        Where it is measured in heads, the earlier flight's heads carry its points.
        """
        block, synthetic = flight.block("validation"), self.run.flight.synthetic_camera
        if "validation" not in flight.carried or synthetic is None:
            return block
        oriented = self._heads()
        return synthetic_block(block, carry(block, oriented, synthetic), synthetic)

    def calibrations(self, block: Block) -> dict[str, Calibration]:
        """Return the calibrations of the cameras of a block, by method."""
        with refused(self.run.found):
            return {
                method: read_calibration(
                    self.run.found, f"mounting/{method}", self._declared(block)
                )
                for method in calibrated_methods(self.run.found)
            }

    def rigs(self, block: Block) -> dict[str, Calibration]:
        """Return the calibrated rigs with all heads of a block, by method."""
        with refused(self.run.found):
            return rigs_for(self.run.found, self._declared(block))

    def _declared(self, block: Block) -> list[Camera]:
        """Return the cameras of a block as the earlier flight declared them."""
        return [self.run.flight.cameras[camera.name] for camera in block.cameras]

    def _heads(self) -> RelativeOrientation:
        found = self.run.found
        source = next(s for s in ORIENTED if _is_oriented(found, s))
        with refused(found):
            return read_relative_orientation(found, source, self.run.flight.cameras)


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
    """Yield what stands against validating a flight with a calibration, a sentence each."""
    found, before = earlier.run.found, earlier.run.flight
    methods = calibrated_methods(found)
    if not methods:
        yield "no calibration whose parameters are all determined; acx4 run makes one"
    calibrated = {name for m in methods for name in folder.cameras(found, f"mounting/{m}")}
    for camera in flight.mounted("validation").cameras:
        if methods and camera.name not in calibrated:
            names = ", ".join(sorted(calibrated))
            yield f"camera {camera.name} of {flight.path} is not calibrated; {names} is"
        elif camera.name in before.cameras:
            yield from _other_camera(before.cameras[camera.name], camera)
    if before.refraction != flight.refraction:
        yield f"refraction is {before.refraction!r}, in {flight.path} {flight.refraction!r}"
    if "validation" in flight.carried:
        yield from _other_heads(earlier, flight)


def _other_camera(before: Camera, camera: Camera) -> Iterator[str]:
    """Yield in what two cameras of one name differ that no calibration estimates."""
    mine, theirs = _sensor(camera), _sensor(before)
    if mine != theirs:
        yield f"camera {camera.name} has {theirs}, in the flight to be validated {mine}"


def _sensor(camera: Camera) -> str:
    return f"{camera.width_px} x {camera.height_px} pixels of {1000 * camera.pixel_mm:g} µm"


def _other_heads(earlier: Earlier, flight: Flight) -> Iterator[str]:
    """Yield why the points of a flight's heads cannot be carried by an earlier one's heads."""
    before, found = earlier.run.flight, earlier.run.found
    source = next((s for s in ORIENTED if _is_oriented(found, s)), "")
    mine, theirs = flight.synthetic_camera, before.synthetic_camera
    if not source or mine is None or theirs is None:
        yield "no orientation of the heads, by which points measured in heads are carried"
        return
    frame, other = (np.degrees(camera.T_b_c.opk) for camera in (mine, theirs))
    if not np.allclose(frame, other, rtol=0, atol=1e-9):
        yield "the mount angles of the synthetic camera define another frame"
    oriented = folder.cameras(found, source)
    for camera in flight.block("validation").cameras:
        if camera.name not in oriented:
            yield f"camera {camera.name} of {flight.path} is no head; {', '.join(oriented)} are"
        else:
            yield from _other_camera(before.cameras[camera.name], camera)


def _is_oriented(found: folder.Results, source: str) -> bool:
    left_out = folder.messages(found.summary.get(source, {}), "left_out")
    return folder.has(found, source) and not left_out
