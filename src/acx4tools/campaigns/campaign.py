"""What a results folder says of the cameras; a constant or a line fitted to several of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acx4lib import expected
from acx4lib.calibration.estimates import RIGS, Calibration
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.design import flying_heights
from acx4lib.flight.reader import Flight
from acx4lib.flight.setup import Session
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import sigmas
from acx4lib.opening import text_of
from acx4lib.results import folder as results
from acx4lib.results.provenance import KEPT, Run, check_kept, read_run
from acx4lib.results.read_back import read_calibration, refused

# --- What one flight says of its cameras: parameters with covariance, a date, a temperature


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
    """Return the campaign of a calibration that was just made."""
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


# --- Vectors with known covariances: tests of one, and a line through several, by least squares


KNOWN = np.inf
"""Degrees of freedom of a variance factor that is known, not estimated."""


@dataclass(frozen=True, kw_only=True)
class JointTest:
    """A test whether a vector is zero, by its covariance.

    Attributes
    ----------
    chi_square : float
        d^T C^-1 d.
    dof : int
        Number of independent components of d.
    redundancy : float
        Of the adjustments that estimated the variance factor of C, the smallest; infinite where
        it is known.
    """

    chi_square: float
    dof: int
    redundancy: float = KNOWN

    @property
    def p(self) -> float:
        """Probability of such a chi-square, or a larger one, if the vector is zero.

        Where the variance factor was estimated, that of Fisher's F = chi_square / dof. NaN for an
        empty vector.
        """
        if self.dof == 0:
            return np.nan
        if np.isinf(self.redundancy):
            return statistics.chi2_sf(self.chi_square, self.dof)
        return statistics.f_sf(self.chi_square / self.dof, self.dof, self.redundancy)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Vectors fitted by X B, all together.

    Attributes
    ----------
    coefficients : ndarray, shape (m, k)
        B: one row for each column of X.
    cov : ndarray, shape (m, k, m, k)
    residuals : ndarray, shape (n, k)
        Fitted minus given.
    chi_square : float
        Weighted sum of squared residuals, with their joint covariances.
    dof : int
        (n - m) k.
    """

    coefficients: Array
    cov: Array
    residuals: Array
    chi_square: float
    dof: int


def joint_test(d: Array, cov: Array, *, redundancy: float = KNOWN) -> JointTest:
    """Test whether a vector is zero.

    Parameters
    ----------
    d : ndarray, shape (k,)
    cov : ndarray, shape (k, k)
        Positive definite.
    redundancy : float
        As in `JointTest`.
    """
    expected.shape("d", d, ("k",))
    expected.shape("cov", cov, (len(d), len(d)))
    sigma = sigmas(cov)  # units differ by many powers of ten
    z, related = d / sigma, cov / sigma[:, None] / sigma
    chi_square = float(z @ np.linalg.solve(related, z)) if len(d) else 0.0
    return JointTest(chi_square=chi_square, dof=len(d), redundancy=redundancy)


def fit(values: Array, covs: Array, X: Array) -> Fit:
    """Fit independent vectors by X B, by least squares with their covariances.

    Parameters
    ----------
    values : ndarray, shape (n, k)
    covs : ndarray, shape (n, k, k)
        Positive definite.
    X : ndarray, shape (n, m)
        Known factors, of full column rank; a column of ones gives the mean.

    Notes
    -----
    With W_i = C_i^-1, the normal equations are sum_i (x_i x_i^T) (x) W_i and sum_i x_i (x) W_i v_i.
    """
    expected.shape("values", values, ("n", "k"))
    n, k = values.shape
    expected.shape("covs", covs, (n, k, k))
    expected.shape("X", X, (n, "m"))
    scale = np.sqrt(np.mean(np.diagonal(covs, axis1=1, axis2=2), axis=0))
    z = values / scale
    W = np.linalg.inv(covs / scale[:, None] / scale)
    m = X.shape[1]
    N = np.einsum("ia,ijl,ib->ajbl", X, W, X).reshape(m * k, m * k)
    cov = np.linalg.inv(N)
    B = (cov @ np.einsum("ia,ijl,il->aj", X, W, z).ravel()).reshape(m, k)
    v = X @ B - z
    return Fit(
        coefficients=B * scale,
        cov=cov.reshape(m, k, m, k) * scale[:, None, None] * scale,
        residuals=v * scale,
        chi_square=float(np.einsum("ij,ijl,il->", v, W, v)),
        dof=(n - m) * k,
    )


def same_values(values: Array, covs: Array, *, redundancy: float = KNOWN) -> Sequence[JointTest]:
    """Test every component by itself for being the same in all vectors.

    Parameters
    ----------
    values : ndarray, shape (n, k)
    covs : ndarray, shape (n, k, k)
    redundancy : float
        As in `JointTest`.

    Returns
    -------
    sequence of JointTest
        k tests of n - 1 degrees of freedom, about the component's own weighted mean.
    """
    variance = np.diagonal(covs, axis1=1, axis2=2)
    weight = 1 / variance
    mean = np.sum(weight * values, axis=0) / weight.sum(axis=0)
    chi_square = np.sum((values - mean) ** 2 * weight, axis=0)
    return [
        JointTest(chi_square=float(c), dof=len(values) - 1, redundancy=redundancy)
        for c in chi_square
    ]
