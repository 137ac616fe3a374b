"""Campaigns of the same cameras side by side: differences, what they share, trends, and tests.

Campaigns count as independent, so that the covariance of a difference is the sum of both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from acx4lib import expected
from acx4lib.calibration.estimates import Parameter, is_determined, parameters, reported_covariance
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares.covariance import sigmas
from acx4lib.results.campaigns.campaign import Campaign, sensors
from acx4lib.results.campaigns.estimates import KNOWN, Fit, JointTest, fit, joint_test, same_values

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
                own = [
                    i for i, p in enumerate(self.parameters) if p.camera == camera and p.key in keys
                ]
                if own:
                    yield camera, part, np.array(own)


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
        own = np.arange(len(self.d)) if which is None else np.asarray(which, dtype=np.intp)
        return joint_test(self.d[own], self.cov[np.ix_(own, own)], redundancy=self.redundancy)


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
    values = np.array([[own[name][1].value for name in common] for own in listed])
    turned = np.array([p.unit == "deg" for p in shown])
    values -= np.where(turned, 360.0 * np.round((values - values[0]) / 360.0), 0.0)
    places = [np.array([own[name][0] for name in common]) for own in listed]
    return Comparison(
        campaigns=tuple(ordered),
        parameters=shown,
        values=values,
        covs=np.array([_cov(c, at, apriori) for c, at in zip(ordered, places, strict=True)]),
        apriori=apriori,
        notes=tuple(_notes(ordered, [set(own) for own in listed])),
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
    """Yield what readers must know of campaigns that can be compared."""
    for what, said in (
        ("method", [c.method for c in campaigns]),
        ("refraction", [c.refraction for c in campaigns]),
    ):
        if len(set(said)) > 1:
            pairs = zip(campaigns, said, strict=True)
            yield f"{what} is not the same: {', '.join(f'{v} in {c.name}' for c, v in pairs)}"
    everything = set[str]().union(*listed)
    for campaign, own in zip(campaigns, listed, strict=True):
        if lacking := sorted(everything - own):
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
    values, covs = comparison.values, comparison.covs
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
    """Return the parameters that fit all campaigns best; its test is that of their stability."""
    n = len(comparison.campaigns)
    return fit(comparison.values, comparison.covs, np.ones((n, 1)))


def stability(comparison: Comparison) -> JointTest:
    """Test whether all campaigns have the same parameters, all of them together."""
    found = pooled(comparison)
    return JointTest(chi_square=found.chi_square, dof=found.dof, redundancy=comparison.redundancy())


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
    at = np.array([c.session.temperature_c for c in comparison.campaigns])
    return at if np.isfinite(at).all() and np.ptp(at) > 0 else None


def years(comparison: Comparison) -> Array | None:
    """Return the times in years after the first; None where a date is missing, or all are one."""
    dates = [c.session.date for c in comparison.campaigns]
    known = [date.toordinal() for date in dates if date is not None]
    if len(known) < len(dates) or max(known) == min(known):
        return None
    return (np.array(known) - known[0]) / 365.25
