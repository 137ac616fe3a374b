"""Statistics of errors at check points: size, bias, precision, and how sure each of them is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Mask
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.least_squares.statistical import distributions

if TYPE_CHECKING:
    import pandas as pd

Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Accuracy:
    """Statistics of errors at check points; east, north, height in this order, m.

    Attributes
    ----------
    n : int
        Number of check points.
    mean, std, rms : tuple of three floats
        `std` is about the mean, with n - 1 degrees of freedom; `rms` is about zero.
    error_90 : tuple of three floats
        The size that 90 % of the absolute errors of an axis do not exceed.
    plan_90 : float
        The same for the planimetric resultant.
    """

    n: int
    mean: Triple
    std: Triple
    rms: Triple
    error_90: Triple
    plan_90: float

    def __post_init__(self) -> None:
        if self.n < 0:
            msg = f"number of check points must not be negative, got n={self.n}"
            raise ValueError(msg)
        expected.three("mean", self.mean)
        for name in ("std", "rms", "error_90"):
            sizes(name, getattr(self, name))

    @property
    def plan_rms(self) -> float:
        """RMS of the planimetric resultant, m."""
        return float(np.hypot(self.rms[0], self.rms[1]))


@dataclass(frozen=True, kw_only=True)
class AxisTest:
    """One statistical test per axis.

    Attributes
    ----------
    statistic : tuple of three floats
        East, north, height.
    critical : float
        Largest absolute value that is accepted.
    """

    statistic: Triple
    critical: float

    @property
    def accepted(self) -> tuple[bool, bool, bool]:
        """Which axes pass; False where the statistic is not a number."""
        east, north, height = (abs(value) <= self.critical for value in self.statistic)
        return east, north, height


def from_differences(differences: Array) -> Accuracy:
    """Compute the statistics of differences at check points.

    Valid for independent points: one difference per point, not per image pair.

    Parameters
    ----------
    differences : ndarray, shape (n, 3)
        Estimated minus surveyed, east, north, height, m; all finite.

    Returns
    -------
    Accuracy
        Its 90 % errors are observed ones. NaN where n is too small.
    """
    d = expected.numbers("differences", differences, ("n", 3))
    expected.finite("differences", d)
    n = len(d)
    nothing = np.full(3, np.nan)
    return Accuracy(
        n=n,
        mean=triple(d.mean(axis=0) if n else nothing),
        std=triple(d.std(axis=0, ddof=1) if n > 1 else nothing),
        rms=triple(np.sqrt((d**2).mean(axis=0)) if n else nothing),
        error_90=triple(_error_90(np.abs(d)) if n else nothing),
        plan_90=float(_error_90(np.hypot(d[:, 0], d[:, 1]))) if n else np.nan,
    )


def from_summary(n: int, *, mean: Triple, std: Triple, rms: Triple) -> Accuracy:
    """Return the accuracy from published statistics, where the differences are not known.

    The 90 % errors assume normally distributed errors: 1.6449 RMS of an axis; in planimetry, with
    equal axes, 2.1460 RMS / sqrt(2) of the resultant.

    Parameters
    ----------
    n : int
        Number of check points.
    mean, std, rms : tuple of three floats
        East, north, height, m.

    Returns
    -------
    Accuracy
    """
    expected.three("rms", rms)
    axis = np.sqrt(distributions.chi2_ppf(0.9, 1)) * np.asarray(rms)
    plan = np.sqrt(distributions.chi2_ppf(0.9, 2) / 2) * np.hypot(rms[0], rms[1])
    return Accuracy(n=n, mean=mean, std=std, rms=rms, error_90=triple(axis), plan_90=float(plan))


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalisedTest:
    """Test of predicted standard deviations: the RMS of errors over them, which should be one.

    Attributes
    ----------
    rms : ndarray, shape (3,)
        East, north, height.
    effective : ndarray, shape (3,)
        As how many independent errors those of an axis scatter.
    limits : ndarray, shape (3, 2)
        Between which chance leaves the RMS.
    """

    rms: Array
    effective: Array
    limits: Array

    def __repr__(self) -> str:
        said = ", ".join(f"{value:.2f}" for value in self.rms)
        return f"RMS of d / sigma {said}; {int(self.accepted.sum())} of 3 inside their limits"

    @property
    def accepted(self) -> Mask:
        """Which axes have an RMS inside the limits, shape (3,)."""
        inside: Mask = (self.limits[:, 0] <= self.rms) & (self.rms <= self.limits[:, 1])
        return inside

    def table(self) -> pd.DataFrame:
        """Return the test of every axis."""
        import pandas as pd  # noqa: PLC0415 few need a table, and it loads long

        wrong = np.where(self.rms > self.limits[:, 1], "too small", "too large")
        return pd.DataFrame(
            {
                "RMS of d / σ": self.rms,
                "counts as": self.effective,
                "lower limit": self.limits[:, 0],
                "upper limit": self.limits[:, 1],
                "prediction": np.where(self.accepted, "holds", wrong),
            },
            index=pd.Index(AXES, name="coordinate"),
        )


def normalised_test(
    d: Array, sigma: Array, axis_covariances: Array, *, probability: float = 0.95
) -> NormalisedTest:
    """Test whether errors are as large as their predicted standard deviations.

    Parameters
    ----------
    d, sigma : ndarray, shape (n, 3)
        Errors of at least one point and their standard deviations: east, north, height, m.
    axis_covariances : ndarray, shape (3, n, n)
        Between the points, as `error_sources.axis_covariances` returns them.
    probability : float
        Probability of an RMS inside the limits where the prediction is right.
    """
    d = expected.numbers("d", d, ("n", 3))
    expected.shape("sigma", sigma, d.shape)
    expected.shape("axis_covariances", axis_covariances, (3, len(d), len(d)))
    effective = np.array([effective_number(correlation(cov)) for cov in axis_covariances])
    return NormalisedTest(
        rms=np.sqrt(np.mean((d / sigma) ** 2, axis=0)),
        effective=effective,
        limits=np.array([rms_limits(n, probability=probability) for n in effective]),
    )


def mean_test(accuracy: Accuracy, *, probability: float = 0.9) -> AxisTest:
    """Test whether the mean errors are zero (Student).

    Valid for two or more points with independent, normally distributed errors. Where their
    covariance is known, `bias_test` takes it into account.

    Parameters
    ----------
    accuracy : Accuracy
    probability : float
        Probability of accepting errors without bias, two-sided.

    Returns
    -------
    AxisTest
        t = mean sqrt(n) / std with n - 1 degrees of freedom.
    """
    expected.instance("accuracy", accuracy, Accuracy)
    expected.probability("probability", probability)
    if accuracy.n < 2:
        return AxisTest(statistic=triple(np.full(3, np.nan)), critical=np.nan)
    mean, std = np.array(accuracy.mean), np.array(accuracy.std)
    t = np.divide(mean, std, out=np.copysign(np.inf, mean), where=std > 0)
    t = np.where(mean == 0.0, 0.0, t) * np.sqrt(accuracy.n)
    critical = distributions.t_ppf(0.5 + probability / 2, accuracy.n - 1)
    return AxisTest(statistic=triple(t), critical=float(critical))


def bias_test(mean: Array, mean_cov: Array, *, probability: float = 0.9) -> AxisTest:
    """Test whether the mean errors are zero, where the covariance of the mean is known.

    Valid for correlated points, too, if the covariance is (`error_sources.mean_covariance`).

    Parameters
    ----------
    mean : ndarray, shape (3,)
        East, north, height, m.
    mean_cov : ndarray, shape (3, 3)
        m^2.
    probability : float
        Probability of accepting errors without bias, two-sided.

    Returns
    -------
    AxisTest
        mean / sigma, normally distributed.
    """
    mean = expected.numbers("mean", mean, (3,))
    expected.shape("mean_cov", mean_cov, (3, 3))
    expected.probability("probability", probability)
    statistic = np.asarray(mean) / sigmas(mean_cov)
    return AxisTest(
        statistic=triple(statistic), critical=distributions.norm_ppf(0.5 + probability / 2)
    )


def precision_test(accuracy: Accuracy, sigma_0: Triple, *, probability: float = 0.9) -> AxisTest:
    """Test whether the scatter of the errors is no larger than a required one.

    A significant mean (`mean_test`) must be removed or declared first.

    Parameters
    ----------
    accuracy : Accuracy
    sigma_0 : tuple of three floats
        Required standard deviations, m.
    probability : float
        Probability of accepting errors that have exactly these deviations, one-sided.

    Returns
    -------
    AxisTest
        chi-square = (n - 1) std^2 / sigma_0^2 with n - 1 degrees of freedom.
    """
    expected.instance("accuracy", accuracy, Accuracy)
    expected.three("sigma_0", sigma_0)
    expected.positive("sigma_0", np.asarray(sigma_0))
    expected.probability("probability", probability)
    if accuracy.n < 2:
        return AxisTest(statistic=triple(np.full(3, np.nan)), critical=np.nan)
    dof = accuracy.n - 1
    statistic = dof * (np.array(accuracy.std) / np.array(sigma_0)) ** 2
    critical = distributions.chi2_ppf(probability, dof)
    return AxisTest(statistic=triple(statistic), critical=critical)


def rms_interval(rms: float, n: float, *, probability: float = 0.95) -> tuple[float, float]:
    """Compute the confidence interval of an RMS found at n points.

    Valid for normally distributed errors without bias.

    Parameters
    ----------
    rms : float
        In any unit.
    n : float
        Number of independent errors; of correlated ones their `effective_number`.
    probability : float
        Probability of the interval, two-sided.

    Returns
    -------
    lower, upper : float
        In the unit of `rms`; NaN for n = 0.
    """
    expected.size("rms", rms)
    expected.size("n", n)
    if n == 0:
        return np.nan, np.nan
    low, high = rms_limits(n, probability=probability)
    return rms / high, rms / low


def rms_limits(n: float, *, probability: float = 0.95) -> tuple[float, float]:
    """Return the limits between which chance leaves an RMS, over its expectation.

    Parameters
    ----------
    n : float
        Number of independent errors; of correlated ones their `effective_number`.
    probability : float
        Probability of an RMS between them.
    """
    expected.positive_number("n", n)
    expected.probability("probability", probability)
    tail = (1 - probability) / 2
    least, most = distributions.chi2_ppf(tail, n), distributions.chi2_isf(tail, n)
    return float(np.sqrt(least / n)), float(np.sqrt(most / n))


def effective_number(cov: Array) -> float:
    """Return how many independent errors of one size have an RMS that is known as well.

    Parameters
    ----------
    cov : ndarray, shape (n, n)
        Of correlated errors, in any unit; zero for none.

    Notes
    -----
    Satterthwaite: (tr C)^2 / tr C^2, from the mean and the variance of the sum of squares.
    """
    expected.square("cov", cov)
    squares = float(np.sum(cov**2))
    return float(np.trace(cov)) ** 2 / squares if squares > 0 else 0.0


def _error_90(size: Array) -> Array:
    """Return the smallest size that 90 % of the rows do not exceed."""
    rank = int(np.ceil(0.9 * len(size) - 1e-9))
    found: Array = np.sort(size, axis=0)[rank - 1]
    return found


def sizes(name: str, values: Triple) -> None:
    """Raise where values are not three sizes of errors; NaN means unknown."""
    expected.three(name, values)
    expected.not_negative(name, np.nan_to_num(np.asarray(values, dtype=float), nan=0.0))


def triple(values: Iterable[float]) -> Triple:
    """Return three values of any kind as east, north, height."""
    east, north, height = map(float, values)
    return east, north, height
