"""Accuracy of check points.

Size, bias, precision, and the classes of PEC-PCD, NSSDA, ASPRS 2014 and 2023.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Mask
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import correlation, sigmas
from acx4lib.least_squares.verdict import MATTERS, off_by, verdicts

if TYPE_CHECKING:
    import pandas as pd


# --- Statistics of errors at check points: size, bias, precision, and their uncertainty


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
            raise ValueError(f"number of check points must not be negative, got n={self.n}")
        for name in ("std", "rms", "error_90"):
            _sizes(name, getattr(self, name))

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
    """
    axis = np.sqrt(statistics.chi2_ppf(0.9, 1)) * np.asarray(rms)
    plan = np.sqrt(statistics.chi2_ppf(0.9, 2) / 2) * np.hypot(rms[0], rms[1])
    return Accuracy(n=n, mean=mean, std=std, rms=rms, error_90=triple(axis), plan_90=float(plan))


@dataclass(frozen=True, kw_only=True, eq=False)
class NormalisedTest:
    """Test of predicted standard deviations: the RMS of normalised errors, expected to be one.

    Attributes
    ----------
    rms : ndarray, shape (3,)
        East, north, height.
    effective : ndarray, shape (3,)
        Effective number of independent errors of an axis.
    limits : ndarray, shape (3, 2)
        Limits of the RMS by chance.
    """

    rms: Array
    effective: Array
    limits: Array

    def __repr__(self) -> str:
        listed = ", ".join(f"{value:.2f}" for value in self.rms)
        return f"RMS of d / sigma {listed}; {int(self.accepted.sum())} of 3 inside their limits"

    @property
    def accepted(self) -> Mask:
        """Which axes have an RMS inside the limits, shape (3,)."""
        return (self.limits[:, 0] <= self.rms) & (self.rms <= self.limits[:, 1])

    @property
    def p(self) -> Array:
        """Two-sided probability of such an RMS of an axis, or one farther from one, shape (3,)."""
        return np.array([rms_p(*axis) for axis in zip(self.rms, self.effective, strict=True)])

    def table(self) -> pd.DataFrame:
        """Return the test of every axis."""
        import pandas as pd  # noqa: PLC0415 few need a table, and it loads long

        wrong = np.where(self.rms > self.limits[:, 1], "above", "below")
        return pd.DataFrame(
            {
                "RMS of d / σ": self.rms,
                "counts as": self.effective,
                "lower limit": self.limits[:, 0],
                "upper limit": self.limits[:, 1],
                "limits": np.where(self.accepted, "inside", wrong),
                "p": self.p,
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


def spread_table(tests: Mapping[str, NormalisedTest]) -> pd.DataFrame:
    """Judge tests of predicted standard deviations jointly; return those of every axis.

    Parameters
    ----------
    tests : mapping of str to NormalisedTest
        By their titles.

    Returns
    -------
    DataFrame
        By title and coordinate: as `NormalisedTest.table`, ``p joint`` and the ``state`` of the
        verdict. What matters is the share by which errors differ from their sigma.
    """
    import pandas as pd  # noqa: PLC0415 few need a table, and it loads long

    parts = {title: test.table() for title, test in tests.items()}
    if not parts:
        return pd.DataFrame()
    table = pd.concat(parts, names=["method", "coordinate"])
    size = table["RMS of d / σ"].map(off_by).to_numpy()
    judged = verdicts(table["p"].to_numpy(), size, np.full(len(table), MATTERS))
    table["p joint"] = [v.p_joint for v in judged]
    table["state"] = [v.state for v in judged]
    return table


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
        statistic=triple(statistic), critical=statistics.norm_ppf(0.5 + probability / 2)
    )


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
    expected.positive("rms", rms, zero=True)
    expected.positive("n", n, zero=True)
    if n == 0:
        return np.nan, np.nan
    low, high = rms_limits(n, probability=probability)
    return rms / high, rms / low


def rms_limits(n: float, *, probability: float = 0.95) -> tuple[float, float]:
    """Return the limits of an RMS by chance, over its expectation.

    Parameters
    ----------
    n : float
        Number of independent errors; of correlated ones their `effective_number`.
    probability : float
        Probability of an RMS between them.
    """
    expected.positive("n", n)
    expected.probability("probability", probability)
    tail = (1 - probability) / 2
    least, most = statistics.chi2_ppf(tail, n), statistics.chi2_isf(tail, n)
    return float(np.sqrt(least / n)), float(np.sqrt(most / n))


def rms_p(rms: float, n: float) -> float:
    """Return the two-sided probability of such an RMS by chance, or one farther from one.

    Parameters
    ----------
    rms : float
        Over its expectation.
    n : float
        Number of independent errors; of correlated ones their `effective_number`.
    """
    square = n * rms**2
    return 2 * min(statistics.chi2_cdf(square, n), statistics.chi2_sf(square, n))


def effective_number(cov: Array) -> float:
    """Return the number of independent equal errors whose RMS has the same uncertainty.

    Parameters
    ----------
    cov : ndarray, shape (n, n)
        Of correlated errors, in any unit; zero for none.

    Notes
    -----
    Satterthwaite: (tr C)^2 / tr C^2, from the mean and the variance of the sum of squares.
    """
    squares = float(np.sum(cov**2))
    return float(np.trace(cov)) ** 2 / squares if squares > 0 else 0.0


def _error_90(size: Array) -> Array:
    """Return the smallest size that 90 % of the rows do not exceed."""
    rank = int(np.ceil(0.9 * len(size) - 1e-9))
    return np.sort(size, axis=0)[rank - 1]


def _sizes(name: str, values: Triple) -> None:
    """Raise where values are not three sizes of errors; NaN means unknown."""
    expected.positive(name, np.nan_to_num(np.asarray(values, dtype=float), nan=0.0), zero=True)


def triple(values: Iterable[float]) -> Triple:
    """Return three values of any kind as east, north, height."""
    east, north, height = map(float, values)
    return east, north, height


# --- Accuracy standards: PEC-PCD (Brazil), NSSDA, ASPRS 2014 and ASPRS 2023
#
# Every function takes an `Accuracy` (from differences at check points, or from published
# statistics) and states a class only where the standard's minimum number of points is reached.


MINIMUM_POINTS = {"pec_pcd": 20, "nssda": 20, "asprs_2014": 20, "asprs_2023": 30}
"""Smallest number of check points for which a class is stated."""

NSSDA_AXIS_RATIO = 0.6
"""Smaller over larger horizontal RMSE below which NSSDA gives no formula."""

NO_SURVEY_ERROR: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Limit:
    """Limits of one PEC-PCD class, m.

    Attributes
    ----------
    letter : str
        A (best) to D.
    pec : float
        Limit of 90 % of the errors.
    ep : float
        Limit of the RMS.
    """

    letter: str
    pec: float
    ep: float


@dataclass(frozen=True, kw_only=True)
class PecPcd:
    """Best PEC-PCD classes at one map scale.

    Attributes
    ----------
    scale : int
        Denominator.
    plan : str
        Class of the planimetric resultant: A to D, ``none``, or ``not stated, n = ...``.
    plan_by_axis : str
        The milder practice: the class that both east and north reach, each tested by itself.
    height : str
        Class for the standard contour interval of the scale.
    """

    scale: int
    plan: str
    plan_by_axis: str
    height: str


@dataclass(frozen=True, kw_only=True)
class Nssda:
    """NSSDA accuracies at 95 %, m.

    Attributes
    ----------
    horizontal, vertical : float
        `horizontal` is NaN where the axes differ too much for the standard's formula.
    statement : str
        The sentence that the standard asks for.
    """

    horizontal: float
    vertical: float
    statement: str


@dataclass(frozen=True, kw_only=True)
class Asprs2014:
    """ASPRS 2014 classes.

    Attributes
    ----------
    horizontal, vertical : str
        Smallest whole-centimetre class reached, or ``not stated, n = ...``.
    horizontal_95, vertical_95 : float
        Accuracies at 95 %, m (the vertical one in open terrain).
    mean_small : bool
        True where mean errors are at most a quarter of the RMSE.
    survey_sufficient : bool
        True where check points are at least three times better than the product.
    """

    horizontal: str
    vertical: str
    horizontal_95: float
    vertical_95: float
    mean_small: bool
    survey_sufficient: bool


@dataclass(frozen=True, kw_only=True)
class Asprs2023:
    """ASPRS 2023 classes; they include the error of the survey.

    Attributes
    ----------
    horizontal, vertical, three_d : str
        Smallest whole-centimetre class reached, or ``not stated, n = ...``.
    rmse_h, rmse_v, rmse_3d : float
        m; `rmse_h` is that of the planimetric resultant.
    survey_sufficient : bool
        True where check points are at least twice as good as the product.
    """

    horizontal: str
    vertical: str
    three_d: str
    rmse_h: float
    rmse_v: float
    rmse_3d: float
    survey_sufficient: bool


@cache
def _pec_pcd_rows() -> tuple[dict[str, str], ...]:
    table = resources.files("acx4lib.georeferencing").joinpath("limits", "pec_pcd.csv")
    return tuple(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))


def scales() -> tuple[int, ...]:
    """Return the denominators of the map scales that PEC-PCD tabulates."""
    return tuple(sorted({int(row["scale"]) for row in _pec_pcd_rows()}))


def plan_limits(scale: int) -> tuple[Limit, ...]:
    """Return the tabulated planimetric limits of a map scale, best class first."""
    return _limits(scale, "plan")


def height_limits(scale: int) -> tuple[Limit, ...]:
    """Return the tabulated height limits of a map scale with its standard contour interval."""
    return _limits(scale, "height")


def _limits(scale: int, kind: str) -> tuple[Limit, ...]:
    limits = tuple(
        Limit(letter=row["class"], pec=float(row["pec_m"]), ep=float(row["ep_m"]))
        for row in _pec_pcd_rows()
        if int(row["scale"]) == scale and row["kind"] == kind
    )
    if not limits:
        raise ValueError(f"PEC-PCD has no scale 1:{scale}; it has {', '.join(map(str, scales()))}")
    return limits


def best_class(rms: float, error_90: float, limits: tuple[Limit, ...]) -> str:
    """Return the best class whose limits are both met; ``none`` if no class is met.

    Parameters
    ----------
    rms, error_90 : float
        RMS, and the size that 90 % of the errors do not exceed, m.
    limits : tuple of Limit
        Best class first.
    """
    met = (limit.letter for limit in limits if rms <= limit.ep and error_90 <= limit.pec)
    return next(met, "none")


def pec_pcd(accuracy: Accuracy, scale: int) -> PecPcd:
    """Classify under PEC-PCD at one of the tabulated scales.

    Parameters
    ----------
    accuracy : Accuracy
    scale : int
        Denominator, one of `scales`.
    """
    plan, height = plan_limits(scale), height_limits(scale)
    east_north = max(accuracy.rms[:2]), max(accuracy.error_90[:2])
    return PecPcd(
        scale=scale,
        plan=_state("pec_pcd", accuracy, best_class(accuracy.plan_rms, accuracy.plan_90, plan)),
        plan_by_axis=_state("pec_pcd", accuracy, best_class(*east_north, plan)),
        height=_state(
            "pec_pcd", accuracy, best_class(accuracy.rms[2], accuracy.error_90[2], height)
        ),
    )


def largest_scale(accuracy: Accuracy, letter: str = "A") -> int | None:
    """Return the largest map scale at which plan and height reach a class of PEC-PCD.

    Parameters
    ----------
    accuracy : Accuracy
    letter : str
        The class, which is to be the best one of plan and of height.

    Returns
    -------
    int or None
        Denominator; None where no tabulated scale has it.
    """
    for scale in scales():
        reached = pec_pcd(accuracy, scale)
        if reached.plan == reached.height == letter:
            return scale
    return None


def nssda(accuracy: Accuracy) -> Nssda:
    """State the accuracy according to NSSDA (FGDC-STD-007.3-1998)."""
    east, north, height = accuracy.rms
    similar = min(east, north) >= NSSDA_AXIS_RATIO * max(east, north)
    radius = np.sqrt(statistics.chi2_ppf(0.95, 2))
    horizontal = float(radius * 0.5 * (east + north)) if similar else np.nan
    vertical = float(np.sqrt(statistics.chi2_ppf(0.95, 1)) * height)
    plan = f"{horizontal:.2f} m horizontal" if similar else "no horizontal (axes too unlike)"
    tested = f"tested {plan}, {vertical:.2f} m vertical accuracy at 95 % confidence level"
    return Nssda(
        horizontal=horizontal, vertical=vertical, statement=_state("nssda", accuracy, tested)
    )


def asprs_2014(accuracy: Accuracy, *, survey_sigma: Triple = NO_SURVEY_ERROR) -> Asprs2014:
    """Classify under ASPRS 2014 (edition 1).

    Parameters
    ----------
    accuracy : Accuracy
    survey_sigma : tuple of three floats
        Of the check points: east, north, height, m.
    """
    _sizes("survey_sigma", survey_sigma)
    rms, mean = np.array(accuracy.rms), np.array(accuracy.mean)
    radius = np.sqrt(statistics.chi2_ppf(0.95, 2) / 2)
    return Asprs2014(
        horizontal=_state("asprs_2014", accuracy, _centimetres(max(accuracy.rms[:2]))),
        vertical=_state("asprs_2014", accuracy, _centimetres(accuracy.rms[2])),
        horizontal_95=float(radius * accuracy.plan_rms),
        vertical_95=float(np.sqrt(statistics.chi2_ppf(0.95, 1)) * accuracy.rms[2]),
        mean_small=bool(np.all(np.abs(mean) <= 0.25 * rms)),
        survey_sufficient=bool(np.all(3 * np.array(survey_sigma) <= rms)),
    )


def asprs_2023(accuracy: Accuracy, *, survey_sigma: Triple = NO_SURVEY_ERROR) -> Asprs2023:
    """Classify under ASPRS 2023 (edition 2).

    Parameters
    ----------
    accuracy : Accuracy
    survey_sigma : tuple of three floats
        Of the check points: east, north, height, m; added to the RMSE in quadrature.
    """
    _sizes("survey_sigma", survey_sigma)
    survey_h = float(np.hypot(survey_sigma[0], survey_sigma[1]))
    rmse_h = float(np.hypot(accuracy.plan_rms, survey_h))
    rmse_v = float(np.hypot(accuracy.rms[2], survey_sigma[2]))
    rmse_3d = float(np.hypot(rmse_h, rmse_v))
    return Asprs2023(
        horizontal=_state("asprs_2023", accuracy, _centimetres(rmse_h)),
        vertical=_state("asprs_2023", accuracy, _centimetres(rmse_v)),
        three_d=_state("asprs_2023", accuracy, _centimetres(rmse_3d)),
        rmse_h=rmse_h,
        rmse_v=rmse_v,
        rmse_3d=rmse_3d,
        survey_sufficient=2 * survey_h <= rmse_h and 2 * survey_sigma[2] <= rmse_v,
    )


def classes(accuracy: Accuracy, *, survey_sigma: Triple = NO_SURVEY_ERROR) -> dict[str, object]:
    """Return the classes of all standards, as plain values for `summary.json`.

    Parameters
    ----------
    accuracy : Accuracy
    survey_sigma : tuple of three floats
        Of the check points: east, north, height, m.

    Returns
    -------
    dict
        Keys ``pec_pcd`` (by ``1:scale``), ``nssda``, ``asprs_2014``, ``asprs_2023``.
    """
    by_scale = {f"1:{scale}": asdict(pec_pcd(accuracy, scale)) for scale in scales()}
    return {
        "pec_pcd": by_scale,
        "nssda": asdict(nssda(accuracy)),
        "asprs_2014": asdict(asprs_2014(accuracy, survey_sigma=survey_sigma)),
        "asprs_2023": asdict(asprs_2023(accuracy, survey_sigma=survey_sigma)),
    }


def _state(standard: str, accuracy: Accuracy, reached: str) -> str:
    """Return the class reached, or "not stated" with too few points."""
    too_few = accuracy.n < MINIMUM_POINTS[standard]
    return f"not stated, n = {accuracy.n}" if too_few else reached


def _centimetres(rmse: float) -> str:
    """Return the name of the smallest whole-centimetre class for an RMSE in m."""
    return f"{np.ceil(round(100 * rmse, 6)):.0f} cm"
