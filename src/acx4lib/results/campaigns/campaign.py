"""What one flight says of its cameras: parameters with covariance, a date, a temperature."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acx4lib import expected
from acx4lib.calibration.estimates import RIGS, Calibration
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import FlightError
from acx4lib.flight.block import Block
from acx4lib.flight.design import flying_heights
from acx4lib.flight.reader import Flight
from acx4lib.flight.setup import Session
from acx4lib.flight.text.files import text_of
from acx4lib.results import folder as results
from acx4lib.results.provenance import KEPT, Run, check_kept, read_run
from acx4lib.results.read_back import read_calibration, refused

COMPARED = ("single_step", "rig", "rig_calibration", "two_step_gnss", "two_step")
"""Methods whose calibrations can be compared; without a wish, the first that a run has."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Campaign:
    """A calibration, and when and how it was made.

    Attributes
    ----------
    name : str
    method : str
        One of `COMPARED`.
    calibration : Calibration
    redundancy : int
        Of its adjustment.
    chi_square_p : float
        Probability of such a variance of unit weight, or a larger one; NaN where not known.
    session : Session
    height_m : float
        Median flying height above the surveyed points.
    frame_deg : tuple of float
        Angles that define the frame of the camera's synthetic images; empty where the camera is
        a real one.
    refraction : str
    control : frozenset of str
        Lines of control_points.csv, without its header.
    flight : str
        Checksum of the flight; empty where not known.
    """

    name: str
    method: str
    calibration: Calibration
    redundancy: int
    chi_square_p: float = np.nan
    session: Session = field(default_factory=Session)
    height_m: float
    frame_deg: tuple[float, ...] = ()
    refraction: str = "none"
    control: frozenset[str] = frozenset()
    flight: str = ""


def of_mounting(mounting: Mounting, *, name: str, session: Session | None = None) -> Campaign:
    """Return the campaign of a calibration that was just made.

    Parameters
    ----------
    mounting : Mounting
    name : str
    session : Session, optional
    """
    expected.instance("mounting", mounting, Mounting)
    solution = mounting.bundle.solution
    return Campaign(
        name=name,
        method=mounting.method,
        calibration=mounting.calibration,
        redundancy=solution.redundancy,
        chi_square_p=solution.chi_square_p,
        session=session or Session(),
        height_m=_height(mounting.bundle.network.block),
    )


def _height(block: Block) -> float:
    return float(np.median(flying_heights(block)))


def read(folder: str | Path, *, method: str = "", name: str = "") -> Campaign:
    """Read a campaign from the results of a run.

    Parameters
    ----------
    folder : path
    method : str
        One of `COMPARED`; by default the first of them that the results have.
    name : str
        By default that of the folder.

    Raises
    ------
    FlightError
        Where the folder has no such results, they were changed after the run, or the method did
        not end with a calibration.
    ValueError
        For an unknown method.
    """
    if method:
        expected.one_of("method", method, COMPARED)
    run = read_run(folder)
    check_kept(run, "mounting")
    at, found = run.folder, run.found
    chosen = method or next((m for m in COMPARED if f"mounting/{m}" in found.summary), "")
    key = f"mounting/{chosen}"
    if key not in found.summary:
        wanted = key if chosen else "the stage mounting"
        raise FlightError([f"{at}: no results of {wanted}; acx4 run makes them"])
    entry = found.summary[key]
    if not entry.get("converged") or entry.get("stopped"):
        said = [*results.messages(entry, "stopped"), *results.messages(entry, "left_out")]
        reason = said[0] if said else f"{key} did not converge"
        raise FlightError([f"{at}: no calibration to compare: {reason}"])
    return _campaign(run, chosen, name or at.resolve().name)


def _campaign(run: Run, method: str, name: str) -> Campaign:
    found, flight, key = run.found, run.flight, f"mounting/{method}"
    entry = found.summary[key]
    cameras = [flight.cameras[camera] for camera in results.cameras(found, key)]
    with refused(found):
        calibration = read_calibration(found, key, cameras)
    block = flight.block("heads" if method == "rig" else "calibration")
    return Campaign(
        name=name,
        method=method,
        calibration=calibration,
        redundancy=int(str(entry["redundancy"])),
        chi_square_p=_number(entry.get("chi_square_p")),
        session=flight.session,
        height_m=_height(block),
        frame_deg=_frame(flight, method),
        refraction=flight.refraction,
        control=_control(run.folder / KEPT / "control_points.csv"),
        flight=run.provenance.digest,
    )


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else np.nan


def _frame(flight: Flight, method: str) -> tuple[float, ...]:
    """Return the angles by which flight.toml defines the frame of synthetic images."""
    camera = flight.synthetic_camera
    if method in RIGS or camera is None:
        return ()
    return tuple(np.degrees(camera.T_b_c.opk).round(9).tolist())


def _control(path: Path) -> frozenset[str]:
    lines = text_of(path).splitlines() if path.is_file() else []
    return frozenset(lines[1:])


def sensors(campaign: Campaign) -> dict[str, tuple[int, int, float]]:
    """Return width and height in pixels and the pixel in mm, by camera."""
    listed = campaign.calibration.cameras
    return {c.name: (c.width_px, c.height_px, c.pixel_mm) for c in listed}
