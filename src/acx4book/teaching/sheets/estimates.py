"""Estimated parameters as right answers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import (
    Case,
    Mistake,
    Question,
    Right,
    Rights,
    Sheet,
    computed,
    estimated,
)
from acx4book.teaching.grading import named, scaled, values, wrong_sign
from acx4lib.calibration import estimates
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.georeferencing.validation import Validation, validate
from acx4lib.stages.mounting import calibrate
from acx4sim.files import SimulatedFlight

TITLES = {
    "f_mm": "focal length",
    "xp_mm": "x of the principal point",
    "yp_mm": "y of the principal point",
    "lever_x_m": "x of the lever arm",
    "lever_y_m": "y of the lever arm",
    "lever_z_m": "z of the lever arm",
    "boresight_omega_deg": "ω of the boresight",
    "boresight_phi_deg": "φ of the boresight",
    "boresight_kappa_deg": "κ of the boresight",
}
"""Parameters in words."""


def parameters(calibration: Calibration, truth: Mapping[str, float]) -> dict[str, Right]:
    """Return calibrated parameters of one camera as answers, with their simulated values."""
    return {
        p.name: estimated(p.value, p.sigma, truth[p.name])
        for p in estimates.parameters(calibration)
        if p.name in truth
    }


# --- Lab 7: the calibration proved on an independent block: bias, precision, accuracy


AXES = ("east", "north", "height")
RMS = tuple(f"rms_{axis}_m" for axis in AXES)
ALLOWED_M = 0.15
"""Standard deviation of heights allowed in the accuracy class of the sheet, m."""

N, MEAN, STD, T, CHI = "n_points", "mean_height_m", "std_height_m", "t_height", "chi2_height"

QUESTIONS = (
    Question(name=N, unit="", asks="number of check points that were compared", digits=0),
    *(
        Question(name=name, unit="m", asks=f"RMS of the differences in {axis}", digits=3)
        for name, axis in zip(RMS, AXES, strict=True)
    ),
    Question(name=MEAN, unit="m", asks="mean of the differences in height", digits=3),
    Question(name=STD, unit="m", asks="standard deviation of the differences in height", digits=3),
    Question(name=T, unit="", asks="t of the mean in height: is there a bias?", digits=2),
    Question(
        name=CHI,
        unit="",
        asks=f"χ² of the standard deviation in height against σ = {ALLOWED_M} m",
        digits=1,
    ),
)


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly the whole block and an independent one."""
    camera = flights.drawn_camera(truth)
    return flights.fly(errors, title, camera, flights.WHOLE, proof=flights.PROOF)


def _given(case: Case) -> Sequence[str]:
    """Return the number of check points, in a sentence."""
    return [f"{len(case.flight.block('validation').check)} check points are in the images."]


def _validation(case: Case) -> Validation:
    single = calibrate(case.flight).mountings["single_step"].calibration
    return validate(case.flight.block("validation"), single, method="single_step")


def _statistics(d: Array, *, ddof: int = 1) -> dict[str, float]:
    """Return the statistics of differences, shape (n, 3), m, by question."""
    n, height = len(d), d[:, 2]
    mean, std = height.mean(), height.std(ddof=ddof)
    return {
        N: float(n),
        **named(RMS, np.sqrt((d**2).mean(axis=0))),
        MEAN: float(mean),
        STD: float(std),
        T: float(mean / (std / np.sqrt(n))),
        CHI: float((n - 1) * (std / ALLOWED_M) ** 2),
    }


def _solve(case: Case) -> Rights:
    """Calibrate, and compare the check points."""
    statistics = _statistics(_validation(case).points.d)
    digits = {question.name: question.digits for question in QUESTIONS}
    right = {name: computed(value, digits[name]) for name, value in statistics.items()}
    return {**right, N: computed(statistics[N], 1)}


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with differences."""
    checked = _validation(case)
    d, (n, mean, std, chi) = checked.points.d, values(right, (N, MEAN, STD, CHI))
    yield Mistake(
        says="pairs are counted: pairs of one point are not independent; one difference per point",
        gives=_statistics(checked.pairs.d),
    )
    yield wrong_sign(right, [MEAN, T], "the sign is wrong: estimated less surveyed")
    yield Mistake(
        says="the RMS divides by n − 1; it has no mean to be estimated, so by n",
        gives=named(RMS, values(right, RMS) * np.sqrt(n / (n - 1))),
    )
    yield Mistake(
        says="these are standard deviations: the RMS holds the mean, too",
        gives=named(RMS, d.std(axis=0, ddof=1)),
    )
    biased = _statistics(d, ddof=0)
    yield Mistake(
        says="divided by n; the mean was estimated, so by n − 1",
        gives={name: biased[name] for name in (STD, T, CHI)},
    )
    yield Mistake(says="this is the RMS: take the mean off first", gives={STD: right[RMS[2]].value})
    yield Mistake(
        says="the σ of the mean is the standard deviation divided by √n",
        gives={T: float(mean / std)},
    )
    yield Mistake(says="n in place of n − 1", gives={CHI: float(chi * n / (n - 1))})
    yield Mistake(says="the ratio is not squared", gives={CHI: float((n - 1) * std / ALLOWED_M)})
    yield Mistake(says="(n − 1) is forgotten", gives={CHI: float(chi / (n - 1))})
    yield scaled(right, [*RMS, MEAN, STD], 1000.0, "given in mm; asked for in m")
    yield scaled(right, [*RMS, MEAN, STD], 100.0, "given in cm; asked for in m")


SHEET = Sheet(
    name="lab-7",
    title="Proof on an independent block",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
