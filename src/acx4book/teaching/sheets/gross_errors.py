"""Lab 5: one bundle, its residuals, and the gross errors among its observations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Right, Rights, Sheet, computed
from acx4book.teaching.grading import scaled, swapped, wrong_sign
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.stages.mounting import calibrate
from acx4sim.files import SimulatedFlight
from acx4sim.plan import GrossErrors, Options

CONTROL, ERROR = "control_point", "control_error_m"
GNSS, ATTITUDE = "gnss_exposure", "attitude_exposure"

QUESTIONS = (
    Question(
        name=CONTROL, unit="", asks="number of the control point with an error: 7 for P07", digits=0
    ),
    Question(
        name=ERROR,
        unit="m",
        asks="its error, as surveyed less true, in the coordinate that is wrong",
        digits=1,
    ),
    Question(
        name=GNSS,
        unit="",
        asks="exposure with the largest error of position: 305 for C3-05",
        digits=0,
    ),
    Question(
        name=ATTITUDE,
        unit="",
        asks="exposure with the largest error of attitude: 305 for C3-05",
        digits=0,
    ),
    Question(name="rejected_points", unit="", asks="number of rejected image points", digits=0),
    Question(
        name="sigma0_squared",
        unit="",
        asks="σ0² of the single-step adjustment without the gross errors",
        digits=2,
    ),
    Question(
        name="smallest_error_px",
        unit="px",
        asks=f"smallest error of a measurement with σ = 0.4 px and redundancy 0.8 for which the "
        f"expected w is the critical value {CRITICAL}",
        digits=2,
    ),
)


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly the whole block, with one wrong target, one wrong position and one wrong heading."""
    rng = np.random.default_rng([truth, *b"gross errors"])
    planted = GrossErrors(
        image_points=0.01,
        image_px=(10.0, 200.0),
        control_m=round(float(rng.uniform(0.6, 1.6)), 2),
        gnss_m=round(float(rng.uniform(2.0, 4.0)), 2),
        heading_deg=round(float(rng.uniform(0.3, 0.6)), 2),
    )
    options = Options(gross_errors=planted)
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE, options=options)


def _given(case: Case) -> Sequence[str]:
    """Return number and kinds of the errors, in a sentence."""
    return [
        "One control point, the position of one exposure and the attitude of another are wrong, "
        f"and some of the {len(case.block.image_points)} image points."
    ]


def _planted(case: Case, kind: str) -> dict[str, Any]:
    return next(
        gross_error for gross_error in case.truth["gross_errors"] if gross_error["kind"] == kind
    )


def _solve(case: Case) -> Rights:
    """Look for gross errors as the command does."""
    bundle = calibrate(case.flight).mountings["single_step"].bundle
    count = sum(rejection.kind == "image_point" for rejection in bundle.rejected)
    planted = sum(
        gross_error["kind"] == "image_point" for gross_error in case.truth["gross_errors"]
    )
    control = _planted(case, "control_point")
    error = next(value for name, value in control.items() if name.endswith("_m"))
    return {
        CONTROL: computed(_number(control["point"]), 1),
        ERROR: Right(value=error, truth=error, bound=0.15),
        GNSS: computed(_number(_planted(case, "gnss")["image_or_exposure"]), 1),
        ATTITUDE: computed(_number(_planted(case, "attitude")["image_or_exposure"]), 1),
        "rejected_points": Right(
            value=count, truth=planted, bound=max(0.5, abs(count - planted) + 0.5)
        ),
        "sigma0_squared": computed(bundle.solution.sigma0_sq, 2, share=0.03),
        "smallest_error_px": computed(CRITICAL * 0.4 / 0.8**0.5, 2),
    }


def _number(name: str) -> float:
    """Return the digits of a name as a number: 7 of P07, 305 of C3-05."""
    return float("".join(c for c in name if c.isdigit()))


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with gross errors."""
    yield wrong_sign(right, [ERROR], "the sign is wrong: surveyed less true")
    yield scaled(right, [ERROR], 100.0, "given in cm; asked for in m")
    yield swapped(right, GNSS, ATTITUDE, "the exposures are swapped: position and attitude")
    spoiled = adjust(mounted_orientation(case.block, free=case.flight.estimate_mounting))
    yield Mistake(
        says="the gross errors are still among the observations",
        gives={"sigma0_squared": spoiled.solution.sigma0_sq},
    )
    bundle = calibrate(case.flight).mountings["single_step"].bundle
    yield Mistake(
        says="all rejections are counted; asked for those of image points",
        gives={"rejected_points": float(len(bundle.rejected))},
    )
    for says, wrong in (
        ("the redundancy is forgotten: a residual shows only this part of an error", 0.4),
        ("divided by the redundancy, not by its root", 0.4 / 0.8),
        ("multiplied by the root of the redundancy; divide", 0.4 * 0.8**0.5),
        ("given in σ; asked for in pixels", 1.0 / 0.8**0.5),
    ):
        yield Mistake(says=says, gives={"smallest_error_px": CRITICAL * wrong})


SHEET = Sheet(
    name="lab-5",
    title="Residuals and gross errors",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
