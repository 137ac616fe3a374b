"""Accuracy of check points.

Size, bias, precision, and the classes of PEC-PCD, NSSDA, ASPRS 2014 and 2023.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple

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


def triple(values: Iterable[float]) -> Triple:
    """Return three values of any kind as east, north, height."""
    east, north, height = map(float, values)
    return east, north, height


# --- Accuracy standards: PEC-PCD (Brazil), NSSDA, ASPRS 2014 and ASPRS 2023
#
# Every function takes an `Accuracy` (from differences at check points, or from published
# statistics) and returns a row of plain values; a class only from the standard's least number of
# points on.


MINIMUM_POINTS = {"pec_pcd": 20, "nssda": 20, "asprs_2014": 20, "asprs_2023": 30}
"""Smallest number of check points for which a class is stated."""

NO_SURVEY_ERROR: Triple = (0.0, 0.0, 0.0)

Row = dict[str, Any]
"""What a standard says of an accuracy, by its names."""


class Limit(NamedTuple):
    """Limits of one PEC-PCD class: letter, of 90 % of the errors, and of the RMS, m."""

    letter: str
    pec: float
    ep: float


@cache
def _pec_pcd_limits() -> dict[tuple[int, str], list[Limit]]:
    table = resources.files("acx4lib.georeferencing").joinpath("limits", "pec_pcd.csv")
    limits: dict[tuple[int, str], list[Limit]] = {}
    for row in csv.DictReader(table.read_text(encoding="utf-8").splitlines()):
        limit = Limit(row["class"], float(row["pec_m"]), float(row["ep_m"]))
        limits.setdefault((int(row["scale"]), row["kind"]), []).append(limit)
    return limits


def scales() -> tuple[int, ...]:
    """Return the denominators of the map scales that PEC-PCD tabulates."""
    return tuple(sorted({scale for scale, _ in _pec_pcd_limits()}))


def limits(scale: int, kind: str) -> list[Limit]:
    """Return the tabulated limits of a map scale, best class first.

    Parameters
    ----------
    scale : int
        Denominator, one of `scales`.
    kind : str
        ``"plan"``, or ``"height"`` for the standard contour interval of the scale.
    """
    if scale not in scales():
        raise ValueError(f"PEC-PCD has no scale 1:{scale}; it has {', '.join(map(str, scales()))}")
    return _pec_pcd_limits()[scale, kind]


def pec_pcd(accuracy: Accuracy, scale: int) -> Row:
    """Classify under PEC-PCD at one of the tabulated scales.

    Parameters
    ----------
    accuracy : Accuracy
    scale : int
        Denominator, one of `scales`.

    Returns
    -------
    dict
        ``plan``, ``plan_by_axis`` (the milder practice: the class that both east and north reach,
        each tested by itself), ``height``: A to D, ``none``, or ``not stated, n = ...``; ``scale``.
    """
    tested = {
        "plan": ("plan", accuracy.plan_rms, accuracy.plan_90),
        "plan_by_axis": ("plan", max(accuracy.rms[:2]), max(accuracy.error_90[:2])),
        "height": ("height", accuracy.rms[2], accuracy.error_90[2]),
    }
    row: Row = {"scale": scale}
    for name, (kind, rms, error_90) in tested.items():
        met = (of.letter for of in limits(scale, kind) if rms <= of.ep and error_90 <= of.pec)
        row[name] = _state("pec_pcd", accuracy, next(met, "none"))
    return row


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
    rows = (pec_pcd(accuracy, scale) for scale in scales())
    return next((row["scale"] for row in rows if row["plan"] == row["height"] == letter), None)


def nssda(accuracy: Accuracy) -> Row:
    """State the accuracy according to NSSDA (FGDC-STD-007.3-1998).

    Returns
    -------
    dict
        ``horizontal`` and ``vertical`` at 95 %, m, the first NaN where the axes differ too much for
        the standard's formula, and the ``statement`` that it asks for.
    """
    east, north, height = accuracy.rms
    similar = min(east, north) >= 0.6 * max(east, north)
    radius = np.sqrt(statistics.chi2_ppf(0.95, 2))
    horizontal = float(radius * 0.5 * (east + north)) if similar else np.nan
    vertical = float(np.sqrt(statistics.chi2_ppf(0.95, 1)) * height)
    plan = f"{horizontal:.2f} m horizontal" if similar else "no horizontal (axes too unlike)"
    tested = f"tested {plan}, {vertical:.2f} m vertical accuracy at 95 % confidence level"
    statement = _state("nssda", accuracy, tested)
    return {"horizontal": horizontal, "vertical": vertical, "statement": statement}


def asprs_2014(accuracy: Accuracy, *, survey_sigma: Triple = NO_SURVEY_ERROR) -> Row:
    """Classify under ASPRS 2014 (edition 1).

    Parameters
    ----------
    accuracy : Accuracy
    survey_sigma : tuple of three floats
        Of the check points: east, north, height, m.

    Returns
    -------
    dict
        ``horizontal`` and ``vertical``: the smallest whole-centimetre class reached;
        ``horizontal_95`` and ``vertical_95`` (in open terrain): accuracies at 95 %, m;
        ``mean_small``: mean errors of at most a quarter of the RMSE; ``survey_sufficient``: check
        points at least three times better than the product.
    """
    rms, mean = np.array(accuracy.rms), np.array(accuracy.mean)
    radius = np.sqrt(statistics.chi2_ppf(0.95, 2) / 2)
    return {
        "horizontal": _centimetres("asprs_2014", accuracy, max(accuracy.rms[:2])),
        "vertical": _centimetres("asprs_2014", accuracy, accuracy.rms[2]),
        "horizontal_95": float(radius * accuracy.plan_rms),
        "vertical_95": float(np.sqrt(statistics.chi2_ppf(0.95, 1)) * accuracy.rms[2]),
        "mean_small": bool(np.all(np.abs(mean) <= 0.25 * rms)),
        "survey_sufficient": bool(np.all(3 * np.array(survey_sigma) <= rms)),
    }


def asprs_2023(accuracy: Accuracy, *, survey_sigma: Triple = NO_SURVEY_ERROR) -> Row:
    """Classify under ASPRS 2023 (edition 2), which includes the error of the survey.

    Parameters
    ----------
    accuracy : Accuracy
    survey_sigma : tuple of three floats
        Of the check points: east, north, height, m; added to the RMSE in quadrature.

    Returns
    -------
    dict
        ``horizontal``, ``vertical``, ``three_d``: the smallest whole-centimetre class reached;
        ``rmse_h`` of the planimetric resultant, ``rmse_v``, ``rmse_3d``, m; ``survey_sufficient``:
        check points at least twice as good as the product.
    """
    survey_h = float(np.hypot(survey_sigma[0], survey_sigma[1]))
    rmse_h = float(np.hypot(accuracy.plan_rms, survey_h))
    rmse_v = float(np.hypot(accuracy.rms[2], survey_sigma[2]))
    rmse_3d = float(np.hypot(rmse_h, rmse_v))
    return {
        "horizontal": _centimetres("asprs_2023", accuracy, rmse_h),
        "vertical": _centimetres("asprs_2023", accuracy, rmse_v),
        "three_d": _centimetres("asprs_2023", accuracy, rmse_3d),
        "rmse_h": rmse_h,
        "rmse_v": rmse_v,
        "rmse_3d": rmse_3d,
        "survey_sufficient": 2 * survey_h <= rmse_h and 2 * survey_sigma[2] <= rmse_v,
    }


def classes(accuracy: Accuracy, *, survey_sigma: Triple = NO_SURVEY_ERROR) -> Row:
    """Return the rows of all standards: ``pec_pcd`` (by ``1:scale``), ``nssda``, ``asprs_...``.

    Parameters
    ----------
    accuracy : Accuracy
    survey_sigma : tuple of three floats
        Of the check points: east, north, height, m.
    """
    return {
        "pec_pcd": {f"1:{scale}": pec_pcd(accuracy, scale) for scale in scales()},
        "nssda": nssda(accuracy),
        "asprs_2014": asprs_2014(accuracy, survey_sigma=survey_sigma),
        "asprs_2023": asprs_2023(accuracy, survey_sigma=survey_sigma),
    }


def _state(standard: str, accuracy: Accuracy, reached: str) -> str:
    """Return the class reached, or "not stated" with too few points."""
    too_few = accuracy.n < MINIMUM_POINTS[standard]
    return f"not stated, n = {accuracy.n}" if too_few else reached


def _centimetres(standard: str, accuracy: Accuracy, rmse: float) -> str:
    """Return the name of the smallest whole-centimetre class for an RMSE in m."""
    return _state(standard, accuracy, f"{np.ceil(round(100 * rmse, 6)):.0f} cm")
