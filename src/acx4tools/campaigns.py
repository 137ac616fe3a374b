"""Results of several campaigns compared, to say whether a camera has changed.

A campaign is what one results folder says of the cameras: parameters with their joint covariance,
a date, a temperature; a constant or a line is fitted to several of them. A comparison has them,
their differences, what is common to all, joint tests, what a difference moves on the ground, and
all of this as tables for programs. Begin with `compare`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib import expected
from acx4lib.calibration.estimates import (
    RIGS,
    Calibration,
    Parameter,
    is_determined,
    parameters,
    reported_covariance,
    reported_values,
    with_reported,
)
from acx4lib.calibration.mounting import Mounting
from acx4lib.calibration.stability import Rigidity
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.flight.design import flying_heights
from acx4lib.flight.reader import Flight
from acx4lib.flight.settings import Session
from acx4lib.geometry.camera import INTERIOR, Camera
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import sigmas
from acx4lib.least_squares.statistics import holm
from acx4lib.opening import text_of
from acx4lib.results import folder as results
from acx4lib.results.provenance import KEPT, Run, check_kept, read_run
from acx4lib.results.read_back import read_calibration, refused

# --- The calibration by one flight: parameters with covariance, a date, a temperature


COMPARED = ("single_step", "rig", "rig_calibration", "two_step_gnss", "two_step")
"""Methods whose calibrations can be compared; the default is the first that a run has."""


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
    path, stored = run.folder, run.found
    chosen = method or next((m for m in COMPARED if f"mounting/{m}" in stored.summary), "")
    key = f"mounting/{chosen}"
    if key not in stored.summary:
        wanted = key if chosen else "the stage mounting"
        raise FlightError([f"{path}: no results of {wanted}; acx4 run makes them"])
    entry = stored.summary[key]
    if not entry.get("converged") or entry.get("stopped"):
        messages = [*results.messages(entry, "stopped"), *results.messages(entry, "left_out")]
        reason = messages[0] if messages else f"{key} did not converge"
        raise FlightError([f"{path}: no calibration to compare: {reason}"])
    return _campaign(run, chosen, name or path.resolve().name)


def _campaign(run: Run, method: str, name: str) -> Campaign:
    stored, flight, key = run.found, run.flight, f"mounting/{method}"
    entry = stored.summary[key]
    cameras = [flight.cameras[camera] for camera in results.cameras(stored, key)]
    with refused(stored):
        calibration = read_calibration(stored, key, cameras)
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


# --- Campaigns of the same cameras: differences, pooled parameters, trends, and their tests
#
# Campaigns count as independent, so that the covariance of a difference is the sum of both.


PARTS = {"interior orientation": INTERIOR, "lever arm": LEVER_ARM, "boresight": BORESIGHT}
"""Parameters that are tested together, by the name of the part."""

APART = 0.01
"""Degrees by which frames of synthetic images may differ and still count as the same."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Campaigns with the parameters that all of them determined, in the order of time.

    Attributes
    ----------
    campaigns : tuple of Campaign
        By date, where all have one; else as they were given.
    parameters : tuple of Parameter
        As the first campaign has them.
    values : ndarray, shape (n, k)
        In the units of results; angles without jumps of 360 degrees.
    covs : ndarray, shape (n, k, k)
    apriori : bool
        Whether the covariances are a priori, not multiplied by the variance of unit weight.
    notes : tuple of str
        What a reader must know, one sentence each.
    """

    campaigns: tuple[Campaign, ...]
    parameters: tuple[Parameter, ...]
    values: Array
    covs: Array
    apriori: bool
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, ``camera/parameter``."""
        return tuple(f"{p.camera}/{p.name}" for p in self.parameters)

    def redundancy(self, *which: int) -> float:
        """Return the smallest redundancy of some campaigns; infinite for covariances a priori."""
        chosen = [self.campaigns[i] for i in which] if which else self.campaigns
        return KNOWN if self.apriori else float(min(c.redundancy for c in chosen))

    def of_camera(self, camera: str) -> Index:
        """Return the places of a camera's parameters."""
        return np.flatnonzero([p.camera == camera for p in self.parameters])

    def parts(self) -> Iterator[tuple[str, str, Index]]:
        """Yield camera, part and the places of its parameters, for parts with any."""
        for camera in dict.fromkeys(p.camera for p in self.parameters):
            for part, keys in PARTS.items():
                places = [
                    i for i, p in enumerate(self.parameters) if p.camera == camera and p.key in keys
                ]
                if places:
                    yield camera, part, np.array(places)


@dataclass(frozen=True, kw_only=True, eq=False)
class Difference:
    """A campaign minus another one.

    Attributes
    ----------
    earlier, later : int
        Places of the campaigns.
    d : ndarray, shape (k,)
        Later minus earlier.
    cov : ndarray, shape (k, k)
        The sum of both covariances.
    redundancy : float
        As in `JointTest`.
    """

    earlier: int
    later: int
    d: Array
    cov: Array
    redundancy: float

    @property
    def sigma(self) -> Array:
        """Standard deviations, shape (k,)."""
        return sigmas(self.cov)

    def test(self, which: Sequence[int] | Index | None = None) -> JointTest:
        """Test some parameters, or all of them, for no difference."""
        places = np.arange(len(self.d)) if which is None else np.asarray(which, dtype=np.intp)
        return joint_test(
            self.d[places], self.cov[np.ix_(places, places)], redundancy=self.redundancy
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Trend:
    """Straight lines through the parameters of all campaigns, over time or temperature.

    Attributes
    ----------
    at : ndarray, shape (n,)
    at_mean : ndarray, shape (k,)
        Values of the lines at the mean of `at`.
    slope : ndarray, shape (k,)
    cov : ndarray, shape (k, k)
        Of the slopes.
    sloping : JointTest
        Whether all slopes are zero.
    scatter : JointTest
        Whether the campaigns lie on their lines.
    """

    at: Array
    at_mean: Array
    slope: Array
    cov: Array
    sloping: JointTest
    scatter: JointTest


def compare(campaigns: Sequence[Campaign], *, apriori: bool = False) -> Comparison:
    """Put campaigns side by side.

    Parameters
    ----------
    campaigns : sequence of Campaign
        Two or more.
    apriori : bool
        Whether to use covariances a priori; by default those of the results, which are multiplied
        by each campaign's variance of unit weight.

    Raises
    ------
    FlightError
        Where two are of the same flight, or their cameras are not the same.
    """
    expected.sequence("campaigns", campaigns, Campaign)
    if len(campaigns) < 2:
        raise FlightError(["one campaign alone has nothing to be compared with; name two or more"])
    dated = all(c.session.date for c in campaigns)
    ordered = sorted(campaigns, key=lambda c: str(c.session.date)) if dated else [*campaigns]
    problems = [line for a, b in combinations(ordered, 2) for line in _problems(a, b)]
    if problems:
        raise FlightError([*dict.fromkeys(problems)])
    listed = [_determined(c) for c in ordered]
    common = [name for name in listed[0] if all(name in other for other in listed)]
    if not common:
        raise FlightError(["no parameter was determined by all campaigns: nothing to compare"])
    shown = tuple(listed[0][name][1] for name in common)
    values = np.array([[determined[name][1].value for name in common] for determined in listed])
    turned = np.array([p.unit == "deg" for p in shown])
    values -= np.where(turned, 360.0 * np.round((values - values[0]) / 360.0), 0.0)
    places = [np.array([determined[name][0] for name in common]) for determined in listed]
    return Comparison(
        campaigns=tuple(ordered),
        parameters=shown,
        values=values,
        covs=np.array(
            [_cov(c, indices, apriori) for c, indices in zip(ordered, places, strict=True)]
        ),
        apriori=apriori,
        notes=tuple(_notes(ordered, [set(determined) for determined in listed])),
    )


def _determined(campaign: Campaign) -> dict[str, tuple[int, Parameter]]:
    """Return the parameters that a campaign determined, with their places, by name."""
    keep = is_determined(campaign.calibration)
    listed = enumerate(parameters(campaign.calibration))
    return {f"{p.camera}/{p.name}": (i, p) for i, p in listed if keep[i]}


def _cov(campaign: Campaign, places: Index, apriori: bool) -> Array:
    cov = reported_covariance(campaign.calibration)[np.ix_(places, places)]
    return cov / campaign.calibration.sigma0_sq if apriori else cov


def _problems(a: Campaign, b: Campaign) -> Iterator[str]:
    """Yield why two campaigns cannot be compared."""
    if a.flight and a.flight == b.flight:
        yield (
            f"{a.name} and {b.name} are results of the same flight: their errors are the same, "
            "not independent; name another campaign"
        )
    mine, other = sensors(a), sensors(b)
    both = [name for name in mine if name in other]
    if not both:
        yield (
            f"{a.name} has the cameras {', '.join(mine)}, {b.name} has {', '.join(other)}: none "
            "is the same; a camera keeps its name in flight.toml from campaign to campaign"
        )
    for name in both:
        if mine[name] != other[name]:
            yield (
                f"{name} is not the same camera: {_said(mine[name])} in {a.name}, "
                f"{_said(other[name])} in {b.name}"
            )
    if len(a.frame_deg) == len(b.frame_deg) and np.any(
        np.abs(np.subtract(a.frame_deg, b.frame_deg)) > APART
    ):
        yield (
            f"mount_* of the synthetic camera define another frame in {a.name} than in {b.name}: "
            "compare the heads instead, with --method rig"
        )


def _said(sensor: tuple[int, int, float]) -> str:
    width, height, pixel_mm = sensor
    return f"{width} x {height} pixels of {1000 * pixel_mm:g} µm"


def _notes(campaigns: Sequence[Campaign], listed: Sequence[set[str]]) -> Iterator[str]:
    """Yield notes on settings that differ, parameters not determined, and common control points."""
    for setting, values in (
        ("method", [c.method for c in campaigns]),
        ("refraction", [c.refraction for c in campaigns]),
    ):
        if len(set(values)) > 1:
            pairs = zip(campaigns, values, strict=True)
            yield f"{setting} is not the same: {', '.join(f'{v} in {c.name}' for c, v in pairs)}"
    everything = set[str]().union(*listed)
    for campaign, names in zip(campaigns, listed, strict=True):
        if lacking := sorted(everything - names):
            yield f"{campaign.name} does not determine {', '.join(lacking)}: not compared"
    for a, b in combinations(campaigns, 2):
        if n := len(a.control & b.control):
            yield (
                f"{a.name} and {b.name} have {n} control points with the same coordinates, whose "
                "errors are common: differences are smaller, pooled values worse than their σ say"
            )


# --- what is tested --------------------------------------------------------------------------


def difference(comparison: Comparison, earlier: int, later: int) -> Difference:
    """Return the difference of two campaigns.

    Parameters
    ----------
    comparison : Comparison
    earlier, later : int
        Places of the campaigns in it.
    """
    for name, place in (("earlier", earlier), ("later", later)):
        expected.place(name, place, len(comparison.campaigns))
    values, covs = comparison.values, comparison.covs  # noqa: PD011 of a comparison
    return Difference(
        earlier=earlier,
        later=later,
        d=values[later] - values[earlier],
        cov=covs[later] + covs[earlier],
        redundancy=comparison.redundancy(earlier, later),
    )


def differences(comparison: Comparison, *, against: str = "previous") -> tuple[Difference, ...]:
    """Return the difference of every campaign but the first.

    Parameters
    ----------
    comparison : Comparison
    against : str
        ``"previous"``: the campaign before it; ``"first"``: always the first.
    """
    expected.one_of("against", against, ("previous", "first"))
    return tuple(
        difference(comparison, i - 1 if against == "previous" else 0, i)
        for i in range(1, len(comparison.campaigns))
    )


def pooled(comparison: Comparison) -> Fit:
    """Fit one set of parameters to all campaigns; its test is that of their stability."""
    n = len(comparison.campaigns)
    return fit(comparison.values, comparison.covs, np.ones((n, 1)))


def stability(comparison: Comparison) -> JointTest:
    """Test whether all campaigns have the same parameters, all of them together."""
    pooled_fit = pooled(comparison)
    return JointTest(
        chi_square=pooled_fit.chi_square, dof=pooled_fit.dof, redundancy=comparison.redundancy()
    )


def stable(comparison: Comparison) -> Sequence[JointTest]:
    """Test every parameter by itself for being the same in all campaigns."""
    return same_values(comparison.values, comparison.covs, redundancy=comparison.redundancy())


def trend(comparison: Comparison, at: Array) -> Trend:
    """Fit straight lines to all parameters together.

    Parameters
    ----------
    comparison : Comparison
    at : ndarray, shape (n,)
        Time or temperature of the campaigns, not all the same.
    """
    n = len(comparison.campaigns)
    expected.shape("at", at, (n,))
    expected.finite("at", at)
    lines = fit(comparison.values, comparison.covs, np.column_stack([np.ones(n), at - at.mean()]))
    redundancy, cov = comparison.redundancy(), lines.cov[1, :, 1]
    return Trend(
        at=at,
        at_mean=lines.coefficients[0],
        slope=lines.coefficients[1],
        cov=cov,
        sloping=joint_test(lines.coefficients[1], cov, redundancy=redundancy),
        scatter=JointTest(chi_square=lines.chi_square, dof=lines.dof, redundancy=redundancy),
    )


def temperatures(comparison: Comparison) -> Array | None:
    """Return the temperatures, °C; None where one is not known, or all are the same."""
    celsius = np.array([c.session.temperature_c for c in comparison.campaigns])
    return celsius if np.isfinite(celsius).all() and np.ptp(celsius) > 0 else None


def years(comparison: Comparison) -> Array | None:
    """Return the times in years after the first; None if a date is missing or all are the same."""
    dates = [c.session.date for c in comparison.campaigns]
    known = [date.toordinal() for date in dates if date is not None]
    if len(known) < len(dates) or max(known) == min(known):
        return None
    return (np.array(known) - known[0]) / 365.25


# --- Effects of a camera's parameters on the ground, over its format


NODES = 15
"""Nodes along each side of the format."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundEffects:
    """Derivatives of points on level ground, seen by a camera of known pose and height.

    Attributes
    ----------
    colrow : ndarray, shape (n, 2)
        Nodes over the format, pixels; those that see the ground.
    xy : ndarray, shape (n, 2)
        Where they lie, forward and left of the body, m.
    J : ndarray, shape (n, 2, k)
        d(forward, left) / d(parameter), m per unit of the parameter.
    """

    colrow: Array
    xy: Array
    J: Array

    def of(self, which: Index) -> GroundEffects:
        """Return the effects of some of the parameters."""
        return replace(self, J=self.J[:, :, which])

    def moved(self, d: Array) -> Array:
        """Return the displacement by changes of all parameters together, m, shape (n, 2)."""
        return self.J @ d

    def rms(self, d: Array) -> Array:
        """Return the RMS displacement by a change of every parameter alone, m, shape (k,)."""
        each = np.sum((self.J * d) ** 2, axis=1)
        return np.sqrt(each.mean(axis=0))

    def sigma(self, cov: Array) -> Array:
        """Return the standard deviation of the plane vector at the nodes, m, shape (n,)."""
        variance = np.einsum("nia,ab,nib->n", self.J, cov, self.J, optimize=True)
        return np.sqrt(variance)


def ground_effects(
    camera: Camera, names: Sequence[str], steps: Array, *, height_m: float
) -> GroundEffects:
    """Return the derivatives of points on level ground by a camera's parameters, for one image.

    The body is level and its pose is right, as with direct georeferencing onto a known height. A
    change of the focal length changes the scale in the image, one of the lever arm's z the height.

    Parameters
    ----------
    camera : Camera
    names : sequence of str
        Parameters by their names in results, in any number.
    steps : ndarray, shape (k,)
        Steps of the central differences, such as standard deviations.
    height_m : float
        Of the body above the ground.
    """
    expected.shape("steps", steps, (len(names),))
    expected.positive("steps", steps)
    expected.positive_number("height_m", height_m)
    w, h = camera.width_px - 1, camera.height_px - 1
    col, row = np.meshgrid(np.linspace(0, w, NODES), np.linspace(0, h, NODES))
    colrow = np.column_stack([col.ravel(), row.ravel()])
    reported = reported_values(camera)
    J = np.empty((len(colrow), 2, len(names)))
    for k, (name, step) in enumerate(zip(names, steps.tolist(), strict=True)):
        ahead, behind = (
            _on_ground(with_reported(camera, {name: reported[name] + s}), colrow, height_m)
            for s in (step, -step)
        )
        J[:, :, k] = (ahead - behind) / (2 * step)
    xy = _on_ground(camera, colrow, height_m)
    seen = np.isfinite(xy).all(axis=1) & np.isfinite(J).all(axis=(1, 2))
    return GroundEffects(colrow=colrow[seen], xy=xy[seen], J=J[seen])


def _on_ground(camera: Camera, colrow: Array, height_m: float) -> Array:
    """Return where rays of a camera on a level body meet the ground, m, NaN for rays upwards."""
    r = camera.T_b_c.r + np.array([0.0, 0.0, height_m])
    n = len(colrow)
    ray = rays(camera, Pose(R=np.tile(camera.T_b_c.R, (n, 1, 1)), r=np.tile(r, (n, 1))), colrow)
    down = np.where(ray[:, 2] < 0, -ray[:, 2], np.nan)
    return r[:2] + ray[:, :2] * (r[2] / down)[:, None]


# --- of a comparison -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Effects on the ground of the parameters of a comparison, camera by camera.

    Attributes
    ----------
    height_m : float
    of : dict of str to GroundEffects
        By camera; the parameters are those of the camera, in their order.
    """

    height_m: float
    of: Mapping[str, GroundEffects]


def ground_of(comparison: Comparison, *, height_m: float | None = None) -> Ground:
    """Return the effects of a comparison's parameters on the ground.

    Parameters
    ----------
    comparison : Comparison
    height_m : float, optional
        By default the flying height of the first campaign, rounded to 10 m.
    """
    expected.instance("comparison", comparison, Comparison)
    first = comparison.campaigns[0]
    height = max(10.0, round(first.height_m, -1)) if height_m is None else height_m
    sigma = sigmas(comparison.covs[0])
    by_camera = {}
    for camera in first.calibration.cameras:
        places = comparison.of_camera(camera.name)
        if len(places):
            names = [comparison.parameters[i].name for i in places]
            by_camera[camera.name] = ground_effects(camera, names, sigma[places], height_m=height)
    return Ground(height_m=height, of=by_camera)


# --- Comparisons as tables for programs, in the units of results


def every(
    comparison: Comparison, found: Sequence[Difference], ground: Ground
) -> dict[str, pd.DataFrame]:
    """Return all tables of a comparison by the names of their files."""
    return {
        "campaigns": _campaigns(comparison),
        "tests": _tests(comparison, found, ground),
        "differences": _differences(comparison, found, ground),
        "pooled": _pooled(comparison),
        "trends": _trends(comparison),
        "covariance": _covariances(comparison, found),
    }


def _campaigns(comparison: Comparison) -> pd.DataFrame:
    """Return one row for each campaign, in the order of the comparison."""
    scaled = "a priori" if comparison.apriori else "a posteriori"
    return pd.DataFrame(
        [
            {
                "campaign": c.name,
                "date": str(c.session.date or ""),
                "temperature_c": c.session.temperature_c,
                "method": c.method,
                "flying_height_m": c.height_m,
                "redundancy": c.redundancy,
                "sigma0_squared": c.calibration.sigma0_sq,
                "chi_square_p": c.chi_square_p,
                "sigma": scaled,
            }
            for c in comparison.campaigns
        ]
    )


def _differences(
    comparison: Comparison, changes: Sequence[Difference], ground: Ground
) -> pd.DataFrame:
    """Return one row for each parameter of each difference."""
    rows = [row for change in changes for row in _difference_rows(comparison, change, ground)]
    table = pd.DataFrame(rows)
    return table.assign(p_joint=holm(table["p"].to_numpy()))[[*DIFFERENCES]]


DIFFERENCES = (
    *("earlier", "later", "camera", "parameter", "unit", "difference", "sigma", "t", "p"),
    *("p_joint", "ground_rms_m"),
)


def _difference_rows(
    comparison: Comparison, change: Difference, ground: Ground
) -> Iterator[dict[str, object]]:
    names = [c.name for c in comparison.campaigns]
    moved = np.full(len(change.d), np.nan)
    for camera, effects in ground.of.items():
        places = comparison.of_camera(camera)
        moved[places] = effects.rms(change.d[places])
    for i, parameter in enumerate(comparison.parameters):
        t = change.d[i] / change.sigma[i]
        yield {
            "earlier": names[change.earlier],
            "later": names[change.later],
            "camera": parameter.camera,
            "parameter": parameter.name,
            "unit": parameter.unit,
            "difference": change.d[i],
            "sigma": change.sigma[i],
            "t": t,
            "p": change.test([i]).p,
            "ground_rms_m": moved[i],
        }


def _tests(comparison: Comparison, changes: Sequence[Difference], ground: Ground) -> pd.DataFrame:
    """Return the joint tests: stability, every difference whole and by parts, and trends."""
    rows = [_row(SAME, "", "all", stability(comparison))]
    wholes, parts = [], []
    for change in changes:
        title = (
            f"{comparison.campaigns[change.later].name} - "
            f"{comparison.campaigns[change.earlier].name}"
        )
        wholes.append(_row(title, "", "all", change.test()))
        for camera, part, places in comparison.parts():
            joint = _joint_effect(comparison, change, ground.of[camera], camera, places)
            parts.append({**_row(title, camera, part, change.test(places)), **joint})
    rows += [*_at_joint_level(wholes), *_at_joint_level(parts)]
    for over, line in trends_of(comparison).items():
        rows.append(_row(f"no slope over {NOUN[over]}", "", "all", line.sloping))
        if line.scatter.dof:
            rows.append(_row(f"straight lines over {NOUN[over]}", "", "all", line.scatter))
    return pd.DataFrame(rows, columns=[*TESTS])


TESTS = (
    *("test", "camera", "part", "dof", "chi_square", "p", "p_joint"),
    *("ground_rms_m", "ground_sigma_m"),
)


def _row(test: str, camera: str, part: str, joint: JointTest) -> dict[str, object]:
    return {
        "test": test,
        "camera": camera,
        "part": part,
        "dof": joint.dof,
        "chi_square": joint.chi_square,
        "p": joint.p,
        "p_joint": joint.p,
    }


def _at_joint_level(rows: Sequence[dict[str, object]]) -> list[dict[str, object]]:
    p = holm(np.array([row["p"] for row in rows], dtype=float))
    return [{**row, "p_joint": float(joint)} for row, joint in zip(rows, p, strict=True)]


def _joint_effect(
    comparison: Comparison, change: Difference, effects: GroundEffects, camera: str, places: Index
) -> dict[str, float]:
    """Return the RMS displacement by a part's parameters together, and its sigma, m."""
    part = effects.of(np.flatnonzero(np.isin(comparison.of_camera(camera), places)))
    moved, sigma = part.moved(change.d[places]), part.sigma(change.cov[np.ix_(places, places)])
    return {
        "ground_rms_m": float(np.sqrt(np.sum(moved**2, axis=1).mean())),
        "ground_sigma_m": float(np.sqrt(np.mean(sigma**2))),
    }


def _pooled(comparison: Comparison) -> pd.DataFrame:
    """Return one row for each parameter: its pooled value, and the test of its stability."""
    pooled_fit = pooled(comparison)
    sigma = sigmas(pooled_fit.cov[0, :, 0])
    alone = stable(comparison)
    rows = [
        {
            "camera": p.camera,
            "parameter": p.name,
            "unit": p.unit,
            "value": pooled_fit.coefficients[0, i],
            "sigma": sigma[i],
            "dof": alone[i].dof,
            "chi_square": alone[i].chi_square,
            "p": alone[i].p,
        }
        for i, p in enumerate(comparison.parameters)
    ]
    table = pd.DataFrame(rows)
    return table.assign(p_joint=holm(table["p"].to_numpy()))


def trends_of(comparison: Comparison) -> dict[str, Trend]:
    """Return the trends over ``year`` and ``temperature``, where three campaigns or more have them.

    With two campaigns a line passes through both, and its slope is their difference; it is left
    out.
    """
    over = {
        "year": years(comparison),
        "temperature": temperatures(comparison),
    }
    enough = len(comparison.campaigns) > 2
    return {
        name: trend(comparison, abscissa)
        for name, abscissa in over.items()
        if abscissa is not None and enough
    }


NOUN = {"year": "time", "temperature": "temperature"}
SAME = "all campaigns the same"
"""Name of the test of all campaigns: its null hypothesis, rejected where p is small."""

PER = {"year": "year", "temperature": "°C"}
"""Unit of time or temperature in the unit of a slope."""


def _trends(comparison: Comparison) -> pd.DataFrame:
    """Return one row for each slope of each trend."""
    parts = [_slopes(comparison, over, line) for over, line in trends_of(comparison).items()]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*SLOPES])


SLOPES = ("over", "camera", "parameter", "unit", "slope", "sigma", "t", "p", "p_joint")


def _slopes(comparison: Comparison, over: str, line: Trend) -> pd.DataFrame:
    sigma = sigmas(line.cov)
    t = line.slope / sigma
    p = np.array([_two_sided(t_value, comparison.redundancy()) for t_value in t])
    return pd.DataFrame(
        {
            "over": over,
            "camera": [p.camera for p in comparison.parameters],
            "parameter": [p.name for p in comparison.parameters],
            "unit": [f"{p.unit} per {PER[over]}" for p in comparison.parameters],
            "slope": line.slope,
            "sigma": sigma,
            "t": t,
            "p": p,
            "p_joint": holm(p),
        }
    )


def _two_sided(t: float, redundancy: float) -> float:
    if np.isinf(redundancy):
        return 2 * statistics.norm_sf(abs(t))
    return 2 * statistics.t_sf(abs(t), redundancy)


def _covariances(comparison: Comparison, changes: Sequence[Difference]) -> pd.DataFrame:
    """Return the joint covariances of the pooled values and of every difference."""
    names = [c.name for c in comparison.campaigns]
    listed = {"pooled": pooled(comparison).cov[0, :, 0]}
    listed |= {f"{names[change.later]} - {names[change.earlier]}": change.cov for change in changes}
    return pd.concat(
        [_long(title, comparison.names, cov) for title, cov in listed.items()], ignore_index=True
    )


def _long(title: str, names: Sequence[str], cov: Array) -> pd.DataFrame:
    n = len(names)
    return pd.DataFrame(
        {"of": title, "row": np.repeat(names, n), "column": np.tile(names, n), "value": cov.ravel()}
    )


def rigidity(found: Rigidity) -> pd.DataFrame:
    """Return one row for each exposure of a rig, and one for all.

    Returns
    -------
    DataFrame
        exposure (empty: all at once), dof, redundancy, f, p, p_joint (Holm, over the exposures),
        head (that turned by most of its sigma), turn_arcsec, sigma_arcsec (about the axis of
        which this is so).
    """
    rows = []
    for i, (name, test) in enumerate(zip(found.exposures, found.tests, strict=True)):
        with np.errstate(invalid="ignore"):
            t = np.abs(found.turns[i] / found.sigma[i])
        head, axis = np.unravel_index(np.nanargmax(t), t.shape)
        arcsec = np.degrees([found.turns[i, head, axis], found.sigma[i, head, axis]]) * 3600
        rows.append((name, test, found.p_joint[i], found.heads[head], *arcsec))
    rows.append(("", found.whole, found.whole.p, "", np.nan, np.nan))
    return pd.DataFrame(
        [
            (name, test.dof, test.redundancy, test.f, test.p, joint, head, turn, sigma)
            for name, test, joint, head, turn, sigma in rows
        ],
        columns=[
            *("exposure", "dof", "redundancy", "f", "p", "p_joint"),
            *("head", "turn_arcsec", "sigma_arcsec"),
        ],
    )
