"""Accuracy standards: PEC-PCD (Brazil), NSSDA, ASPRS 2014 and ASPRS 2023.

Every function takes an `Accuracy` (from differences at check points, or from published
statistics) and states a class only where the standard's minimum number of points is reached.
"""

from __future__ import annotations

import csv
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources

import numpy as np

from acx4lib import expected
from acx4lib.georeferencing.accuracy import Accuracy, Triple, sizes
from acx4lib.least_squares.statistical import distributions

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
    found = tuple(
        Limit(letter=row["class"], pec=float(row["pec_m"]), ep=float(row["ep_m"]))
        for row in _pec_pcd_rows()
        if int(row["scale"]) == scale and row["kind"] == kind
    )
    if not found:
        msg = f"PEC-PCD has no scale 1:{scale}; it has {', '.join(map(str, scales()))}"
        raise ValueError(msg)
    return found


def best_class(rms: float, error_90: float, limits: tuple[Limit, ...]) -> str:
    """Return the best class of which both limits are kept; ``none`` where there is none.

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

    Returns
    -------
    PecPcd
    """
    expected.instance("accuracy", accuracy, Accuracy)
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
    """State the accuracy according to NSSDA (FGDC-STD-007.3-1998).

    Parameters
    ----------
    accuracy : Accuracy

    Returns
    -------
    Nssda
    """
    expected.instance("accuracy", accuracy, Accuracy)
    east, north, height = accuracy.rms
    similar = min(east, north) >= NSSDA_AXIS_RATIO * max(east, north)
    radius = np.sqrt(distributions.chi2_ppf(0.95, 2))
    horizontal = float(radius * 0.5 * (east + north)) if similar else np.nan
    vertical = float(np.sqrt(distributions.chi2_ppf(0.95, 1)) * height)
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

    Returns
    -------
    Asprs2014
    """
    sizes("survey_sigma", survey_sigma)
    rms, mean = np.array(accuracy.rms), np.array(accuracy.mean)
    radius = np.sqrt(distributions.chi2_ppf(0.95, 2) / 2)
    return Asprs2014(
        horizontal=_state("asprs_2014", accuracy, _centimetres(max(accuracy.rms[:2]))),
        vertical=_state("asprs_2014", accuracy, _centimetres(accuracy.rms[2])),
        horizontal_95=float(radius * accuracy.plan_rms),
        vertical_95=float(np.sqrt(distributions.chi2_ppf(0.95, 1)) * accuracy.rms[2]),
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

    Returns
    -------
    Asprs2023
    """
    sizes("survey_sigma", survey_sigma)
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
    """Return the class reached; with too few points, that it is not stated."""
    too_few = accuracy.n < MINIMUM_POINTS[standard]
    return f"not stated, n = {accuracy.n}" if too_few else reached


def _centimetres(rmse: float) -> str:
    """Return the name of the smallest whole-centimetre class for an RMSE in m."""
    return f"{np.ceil(round(100 * rmse, 6)):.0f} cm"
