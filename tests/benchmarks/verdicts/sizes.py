"""The size of a fault that a report finds in 80 % of the flights, from the theory of its tests.

A fault shifts what a test compares, or makes its noise larger. How far it does is told by three
flights of one seed, the pilots, that differ in nothing but the fault: a statistic that is a sum of
squares is a polynomial of second degree in the size, so its second difference is the noncentrality,
without the flight's noise. That grows with the square of the size. The rest is the distribution of
each test, noncentral, and the level that Holm leaves to the smallest of all probabilities.

Larger noise multiplies sums of squares of residuals, less what snooping rejects before. They are
taken for chi-square of the same mean and variance.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from scipy import optimize, special, stats

from acx4book.report.material import Material, validated
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares.verdict import LEVEL, MATTERS

FOUND = 0.8
"""Share of the flights with a fault that are to be found at the size that is predicted."""

VALUE, DOF, BESIDE = "x: ", "dof: ", "beside: "
"""Before the name of a test, in the headings of a pilot's statistics."""

SMALLEST, LARGEST = 0.02, 50.0
"""Sizes between which the right one is searched, over the size of the pilots."""

TWO_SIDED = ("variance of unit weight", "sigma of ", "all together", "rays", "spread")
"""Beginnings of the names of tests that fail where a statistic is too large or too small."""

MATTERING = ("variance of unit weight", "sigma of ", "rays")
"""Of those that fail only where errors over sigma are off by a tenth."""

SNOOPED = ("sigma of ", "rays")
"""Of those whose residuals have no large ones, since these were rejected before."""


@dataclass(frozen=True, kw_only=True)
class Statistic:
    """What a test compares with its critical value.

    Attributes
    ----------
    name : str
    value : float
        A sum of squares, of normal values with the variance one where there is no fault.
    dof : float
    beside : float
        Redundancy of the variance by which it was divided; infinite of a chi-square test. Of a
        test of sigma, the redundancy of the group.
    """

    name: str
    value: float
    dof: float
    beside: float = np.inf

    @property
    def two_sided(self) -> bool:
        """Whether a value that is too small fails, too."""
        return self.name.startswith(TWO_SIDED)

    @property
    def of_check_points(self) -> bool:
        """Whether it is of the validation."""
        return self.name == "rays" or self.family == "points"

    @property
    def family(self) -> str:
        """Name of the tests that share what they compare; those of others are independent of them.

        Estimates are independent of residuals, and so are the differences at check points, which
        depend on the estimates, of the residuals of the calibration and of how the rays meet. The
        residuals of different groups, and of different declared values, are nearly so: on clean
        flights the ranks of their p correlate by less than 0.2.
        """
        return _FAMILIES.get(self.name, self.name)

    def found(self, level: float, *, shift: float = 0.0, factor: float = 1.0) -> float:
        """Return the probability that the test fails.

        Parameters
        ----------
        level : float
            Of this test.
        shift : float
            Noncentrality, times the variance that it has without a fault.
        factor : float
            By which the fault makes the variance larger.
        """
        low, high = (limit / factor for limit in _limits(self, level))
        if self.family == "boresight":
            high, of = high / self.dof, (self.dof, self.beside)
            return float(stats.ncf.sf(high, *of, shift) if shift > 0 else stats.f.sf(high, *of))
        if shift > 0:
            return float(
                stats.ncx2.sf(high, self.dof, shift) + stats.ncx2.cdf(low, self.dof, shift)
            )
        dof, scale = _left(factor) if self.name.startswith(SNOOPED) else (1.0, 1.0)
        dof *= self.dof
        return float(special.chdtrc(dof, high / scale) + special.chdtr(dof, low / scale))


@cache
def _left(factor: float) -> tuple[float, float]:
    """Return what snooping leaves of a squared normal value: of chi-square that is like it.

    Its degrees of freedom and its scale, over those of the value itself. Normalised residuals
    whose variance is `factor` are rejected beyond the critical value.
    """
    a = CRITICAL / np.sqrt(factor)
    inside, density = 1 - 2 * stats.norm.sf(a), stats.norm.pdf(a)
    mean = inside - 2 * a * density
    variance = 3 * inside - 2 * (a**3 + 3 * a) * density - mean**2
    return 2 * mean**2 / variance, variance / (2 * mean)


@cache
def _limits(test: Statistic, level: float) -> tuple[float, float]:
    """Return below and above what a statistic fails a test of this level."""
    if test.family == "boresight":
        return 0.0, float(stats.f.isf(level, test.dof, test.beside) * test.dof)
    high = float(stats.chi2.isf(level / 2 if test.two_sided else level, test.dof))
    low = float(stats.chi2.ppf(level / 2, test.dof)) if test.two_sided else 0.0
    if test.name.startswith(MATTERING):
        factor = (1 + MATTERS) ** 2
        return min(low, test.dof / factor), max(high, factor * test.dof)
    return low, high


_FAMILIES: Mapping[str, str] = {
    "strips": "boresight",
    "drift": "boresight",
    "all together": "points",
    **{f"{what} {axis}": "points" for what in ("mean", "spread") for axis in AXES},
}


# --- pilots ----------------------------------------------------------------------------------


def statistics(material: Material) -> Iterator[Statistic]:
    """Yield the statistics behind the tests of a report, but those that count rejections."""
    summary = material.found.summary
    own: Mapping[str, Any] = summary[material.certified]
    check: Mapping[str, Any] = summary[validated(material)]
    r = own["redundancy"]
    yield Statistic(name="variance of unit weight", value=own["sigma0_squared"] * r, dof=r)
    for group, test in own["sigma_tests"].items():
        yield Statistic(
            name=f"sigma of {group}",
            value=test["ratio"] ** 2 * test["effective"],
            dof=test["effective"],
            beside=test["redundancy"],
        )
    for name, test in own["boresight_stability"].items():
        if test:
            value, beside = test["f"] * test["dof"], test["redundancy"]
            yield Statistic(name=name, value=value, dof=test["dof"], beside=beside)
    for place, one in own["declared"].items():
        camera, _, part = place.rpartition("/")
        if one["p"] is not None:
            value = float(stats.chi2.isf(max(one["p"], 1e-300), 3))
            yield Statistic(name=f"{part.replace('_', ' ')} of {camera}", value=value, dof=3)
    yield from _of_check_points(check)


def _of_check_points(check: Mapping[str, Any]) -> Iterator[Statistic]:
    points, r = check["points"], check["redundancy"]
    yield Statistic(name="all together", value=check["joint_chi_square"], dof=check["joint_dof"])
    yield Statistic(name="rays", value=check["sigma0_squared"] * r, dof=r)
    for k, axis in enumerate(AXES):
        value = (points["mean"][k] / points["mean_sigma"][k]) ** 2
        yield Statistic(name=f"mean {axis}", value=value, dof=1)
        n = points["effective_number"][k]
        yield Statistic(name=f"spread {axis}", value=n * points["normalised_rms"][k] ** 2, dof=n)


def as_row(found: Sequence[Statistic]) -> dict[str, float]:
    """Return statistics as a row of a table."""
    return {
        heading + one.name: value
        for one in found
        for heading, value in ((VALUE, one.value), (DOF, one.dof), (BESIDE, one.beside))
    }


def from_row(row: pd.Series) -> list[Statistic]:
    """Return the statistics of a row."""
    names = [str(key).removeprefix(VALUE) for key in row.index if str(key).startswith(VALUE)]
    return [
        Statistic(
            name=name, value=row[VALUE + name], dof=row[DOF + name], beside=row[BESIDE + name]
        )
        for name in names
        if np.isfinite(row[VALUE + name])
    ]


# --- predicted sizes -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Pilot:
    """What a fault does to the tests of a report, from three flights of one seed.

    Attributes
    ----------
    tests : tuple of (Statistic, float)
        Without the fault, and by how much a fault of the size one enlarges what is expected of
        it, in proportion to the square of the size.
    n_tests : float
        Of the report.
    scales : bool
        Whether the fault makes noise larger, in the place of a shift.
    """

    tests: tuple[tuple[Statistic, float], ...]
    n_tests: float
    scales: bool

    def found(self, size: float) -> float:
        """Return the probability that the report fails.

        The most powerful test of each family counts, the families are independent. More tests of
        one family find more, so that the probability is a little larger than this.
        """
        missed: dict[str, float] = {}
        for test, growth in self.tests:
            found = self._found(test, growth, size)
            missed[test.family] = min(missed.get(test.family, 1.0), 1 - found)
        return 1 - float(np.prod([*missed.values()]))

    def _found(self, test: Statistic, growth: float, size: float) -> float:
        level = LEVEL / self.n_tests
        if not self.scales:
            return test.found(level, shift=size**2 * max(growth, 0.0))
        larger = (size**2 - 1) * max(growth, 0.0) / test.dof
        return test.found(level, factor=1 + larger)


def shifted(without: pd.Series, ahead: pd.Series, behind: pd.Series, *, size: float) -> Pilot:
    """Return what a fault does that shifts something.

    Parameters
    ----------
    without, ahead, behind : Series
        Rows of a flight without the fault, with one of this size, and with its negative.
    size : float
    """
    found = [(test, _second(test, without, ahead, behind) / size**2) for test in from_row(without)]
    return Pilot(tests=tuple(found), n_tests=float(without["n_tests"]), scales=False)


def scaled(
    noisy: pd.Series, reversed_: pd.Series, quiet: pd.Series, groups: Sequence[str]
) -> Pilot:
    """Return what larger noise does.

    Parameters
    ----------
    noisy, reversed_, quiet : Series
        Rows of a flight with the noise that is stated, with its negative, and without it.
    groups : sequence of str
        Groups of observations that have this noise. A part v'Pv with the weights W of its
        residuals grows by tr(W^2) in the expectation, which is known without flights.
    """
    found = [
        (
            test,
            _second(test, quiet, noisy, reversed_)
            if test.of_check_points
            else _of_noise(test, groups),
        )
        for test in from_row(noisy)
    ]
    return Pilot(tests=tuple(found), n_tests=float(noisy["n_tests"]), scales=True)


def _second(test: Statistic, middle: pd.Series, one: pd.Series, other: pd.Series) -> float:
    """Return half the second difference of a statistic."""
    key = VALUE + test.name
    return float((one[key] + other[key]) / 2 - middle[key])


def _of_noise(test: Statistic, groups: Sequence[str]) -> float:
    """Return by how much larger noise of some groups enlarges a statistic of the calibration.

    Both parts of the ratio that tests a boresight have the noise; what declared values are compared
    with has hardly more of it, and what the residuals of other groups have of it is neglected.
    """
    return test.beside if test.name.removeprefix("sigma of ") in groups else 0.0


def predicted(pilots: Sequence[Pilot], begin: float) -> float:
    """Return the size at which the mean of what the pilots expect is `FOUND`; NaN where none is.

    Parameters
    ----------
    pilots : sequence of Pilot
    begin : float
        Size of the pilots, or one that is guessed.
    """

    def missing(log_size: float) -> float:
        return float(np.mean([p.found(float(np.exp(log_size))) for p in pilots])) - FOUND

    least = 0.0 if pilots[0].scales else np.log(begin * SMALLEST)
    most = np.log(begin * LARGEST)
    if not missing(least) < 0 < missing(most):
        return np.nan
    return float(np.exp(optimize.brentq(missing, least, most, xtol=1e-4)))
