"""Labs 8 and 9, on the design of flights: fewer strips, and strips planned for an accuracy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from acx4book.planning import design as designs
from acx4book.planning import plan as plans
from acx4book.planning.flown import flying_time_s, simulate
from acx4book.planning.plan import TURN_S, Plan
from acx4book.planning.tables import unknowns
from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Right, Rights, Sheet, computed
from acx4book.teaching.grading import named, scaled, values, variances, wrong_sign
from acx4book.teaching.sheets.calibrations import parameters
from acx4files.results import tables
from acx4lib.block import select_images
from acx4lib.calibration.mounting import single_step
from acx4lib.expected import Array
from acx4lib.model import Model
from acx4sim.files import SimulatedFlight
from acx4sim.plan import Options

# --- lab 8: a flight with all strips and with fewer strips -----------------------------------


DESIGNS = {
    "all": ("1", "2", "3", "4"),
    "one_height": ("1", "2"),
    "one_direction": ("1", "3"),
}
"""Strips by design: two heights and all directions, one height, no opposite strips."""

WORDS = {
    "all": "all strips",
    "one_height": "strips 1 and 2 alone, which have one height",
    "one_direction": "strips 1 and 3 alone, of which none has an opposite",
}
ASKED_DESIGN = {"f_mm": "mm", "lever_x_m": "m", "lever_z_m": "m"}
CORRELATION = "corr_f_lever_z_{}"
SHARE_DESIGN = 0.04
"""Part of a standard deviation by which an answer may differ."""

QUESTIONS_DESIGN = (
    *(
        Question(
            name=f"sigma_{design}_{name}", unit=unit, asks=f"σ of {name}, {WORDS[design]}", digits=4
        )
        for design in DESIGNS
        for name, unit in ASKED_DESIGN.items()
    ),
    *(
        Question(
            name=CORRELATION.format(design),
            unit="",
            asks=f"correlation of f_mm and lever_z_m, {WORDS[design]}",
            digits=2,
        )
        for design in ("all", "one_height")
    ),
)


def _fly_design(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly the whole block."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE)


def _given_design(case: Case) -> Sequence[str]:
    """Return the number of strips, in a sentence."""
    return [f"The block has {len({*case.block.images.strips})} strips; images.csv names them."]


def _covariance(case: Case, strips: Sequence[str]) -> Array:
    """Return the covariance of `ASKED` from given strips alone, shape (3, 3)."""
    is_flown = np.isin(case.block.images.strips, strips)
    block = select_images(case.block, is_flown)
    calibration = single_step(block, Model(free=case.flight.estimate_mounting)).calibration
    names = [f"CAM/{name}" for name in ASKED_DESIGN]
    return tables.covariance(calibration).loc[names, names].to_numpy()


def _solve_design(case: Case) -> Rights:
    """Adjust the block with the strips of each design."""
    covariances = {design: _covariance(case, strips) for design, strips in DESIGNS.items()}
    right = {
        f"sigma_{design}_{name}": computed(float(sigma), 4, share=SHARE_DESIGN)
        for design, cov in covariances.items()
        for name, sigma in zip(ASKED_DESIGN, np.sqrt(np.diagonal(cov)), strict=True)
    }
    for design in ("all", "one_height"):
        cov = covariances[design]
        correlation = cov[0, 2] / np.sqrt(cov[0, 0] * cov[2, 2])
        right[CORRELATION.format(design)] = computed(float(correlation), 2)
    return right


def _mistakes_design(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with designs."""
    names = [name for name in right if name.startswith("sigma_")]
    yield Mistake(
        says="these are variances: take the square root",
        gives=named(names, values(right, names) ** 2),
    )
    yield scaled(right, names, 1000.0, "given in µm or mm; asked for in mm or m")
    correlations = [name for name in right if name not in names]
    yield wrong_sign(right, correlations, "the correlation has the wrong sign")
    products = [
        right[f"sigma_{d}_f_mm"].value * right[f"sigma_{d}_lever_z_m"].value
        for d in ("all", "one_height")
    ]
    yield Mistake(
        says="these are covariances: divide by both standard deviations",
        gives=named(correlations, values(right, correlations) * np.array(products)),
    )
    for design, strips in DESIGNS.items():
        for other in [name for name in DESIGNS if name != design]:
            of_other = [f"sigma_{other}_{name}" for name in ASKED_DESIGN]
            yield Mistake(
                says=f"these are the numbers of {WORDS[other]}",
                gives=named([f"sigma_{design}_{n}" for n in ASKED_DESIGN], values(right, of_other)),
            )
        others = sorted({*DESIGNS["all"]} - {*strips})
        if others:
            sigma = np.sqrt(np.diagonal(_covariance(case, others)))
            yield Mistake(
                says="these are the strips that were to be left out",
                gives=named([f"sigma_{design}_{n}" for n in ASKED_DESIGN], sigma),
            )


LAB_8 = Sheet(
    name="lab-8",
    title="What the flight does not determine",
    fly=_fly_design,
    questions=QUESTIONS_DESIGN,
    given=_given_design,
    solve=_solve_design,
    mistakes=_mistakes_design,
)


# --- lab 9: a flight planned for an accuracy, simulated, compared with its plan -----------------


BLOCK = "calibration"
ASKED_PLANNING = {"f_mm": "mm", "lever_z_m": "m", "boresight_kappa_deg": "deg"}
PLANNED = tuple(f"planned_{name}" for name in ASKED_PLANNING)
FLOWN = ("f_mm", "lever_z_m")
DIGITS = {"f_mm": 4, "lever_z_m": 3, "boresight_kappa_deg": 4}
SHARE_PLANNING = 0.04
"""Part of a standard deviation by which an answer may differ."""

QUESTIONS_PLANNING = (
    Question(name="strips", unit="", asks="number of strips that you fly", digits=0),
    Question(name="minutes", unit="min", asks="flying time, first to last exposure", digits=1),
    *(
        Question(name=f"planned_{name}", unit=unit, asks=f"σ of {name} by the plan", digits=4)
        for name, unit in ASKED_PLANNING.items()
    ),
    *(
        Question(
            name=name,
            unit=ASKED_PLANNING[name],
            asks=f"{name} of your flight, single-step method",
            digits=DIGITS[name],
            with_sigma=True,
        )
        for name in FLOWN
    ),
)

SEED, PLAN, WANTED = "lab_seed", "lab_plan", "lab_wanted"
"""Entries of the truth of a flight of this sheet."""


def _fly_planning(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly the cheapest strips that give what the student wants, with the student's seed."""
    plan, seed = _plan(truth, title), errors % 1_000_000
    wanted = _wanted(truth, plan)
    flight = simulate(_cheapest(plan, wanted), seed=seed, options=Options())
    values = {**plan.values, "name": ""}  # noqa: PD011 no frame's
    origin = {SEED: seed, PLAN: values, WANTED: wanted.to_dict()}
    return replace(flight, truth={**flight.truth, "name": "lab", **origin})


def _plan(truth: int, title: str) -> Plan:
    """Return the plan of a student, with drawn focal length and lengths of six strips."""
    rng = np.random.default_rng([truth, *b"plan"])
    focal = round(float(rng.uniform(48.0, 52.0)), 2)
    strips = {
        f"{where}{course:03d}": {
            "flying_height_m": height,
            "course_deg": course,
            "length_m": float(rng.integers(200, 400)),
            "overlap": 0.8,
        }
        for where, height in (("low", 300.0), ("high", 500.0))
        for course in (0, 90, 180)
    }
    return plans.from_values(
        {
            "name": title,
            "crs": "EPSG:32633",
            "heights": "ellipsoidal",
            "apriori": {
                "image_point_px": 0.4,
                "gnss_horizontal_m": 0.02,
                "gnss_vertical_m": 0.03,
                "roll_pitch_deg": 0.006,
                "heading_deg": 0.015,
            },
            "cameras": {
                "CAM": {"width_px": 11608, "height_px": 8708, "pixel_um": 4.6, "focal_mm": focal}
            },
            "stages": {"mounting": {"estimate": ["f_mm", "xp_mm", "yp_mm", "k1", "p1", "p2"]}},
            "field": {
                "east_m": 385000.0,
                "north_m": 5518000.0,
                "height_m": 430.0,
                "relief_m": 10.0,
            },
            "control": {"layout": "corners", "number": 4, "area_m": [260.0, 260.0]},
            BLOCK: {"tie_points": 150, "tie_area_m": [440.0, 440.0], "strips": strips},
        }
    )


def _wanted(truth: int, plan: Plan) -> pd.Series:
    """Return drawn limits of the standard deviations, which all strips together fall below."""
    rng = np.random.default_rng([truth, *b"target"])
    with_all = designs.sigmas(plan)[[*ASKED_PLANNING]]
    return with_all.map(lambda sigma: float(f"{sigma * rng.uniform(1.25, 1.6):.2g}"))


def _cheapest(plan: Plan, wanted: pd.Series) -> Plan:
    """Return the flight of the shortest time within the limits: every choice of strips is tried."""
    strips = plan.blocks[BLOCK].strips
    choices = [
        plan.with_strips({name: strips[name] for name in chosen})
        for n in range(1, 1 + len(strips))
        for chosen in combinations(strips, n)
    ]
    by_time = sorted(choices, key=_minutes)
    return next(p for p in by_time if (designs.sigmas(p)[wanted.index] <= wanted).all())


def _given_planning(case: Case) -> Sequence[str]:
    """Return what is wanted, and the student's seed."""
    wanted = case.truth[WANTED]
    limits = ", ".join(f"{name} at most {wanted[name]:g} {ASKED_PLANNING[name]}" for name in wanted)
    return [
        "`plan.toml` has the strips that you may fly. The standard deviations that are wanted:",
        f"{limits}. Your seed is {case.truth[SEED]}:",
        f"`acx4 simulate my_plan.toml --out my_flight --seed {case.truth[SEED]}`.",
    ]


def _hand_out(case: Case) -> dict[str, str]:
    """Return the files handed out instead of a flight."""
    return {"plan.toml": plans.written(_values(case))}


def _values(case: Case) -> dict[str, Any]:
    return {**case.truth[PLAN], "name": case.flight.name}


def _solve_planning(case: Case) -> Rights:
    """Predict the flown strips, the cheapest ones, and adjust their flight."""
    plan = plans.from_values(_values(case))
    flown = {*case.block.images.strips}
    strips = plan.blocks[BLOCK].strips
    cheap = plan.with_strips({name: strips[name] for name in strips if name in flown})
    sigma = {p.name: p.sigma for p in unknowns(designs.of(cheap).mountings["single_step"].bundle)}
    calibration = single_step(case.block, Model(free=case.flight.estimate_mounting)).calibration
    estimates = parameters(calibration, case.true_camera)
    return {
        "strips": Right(value=len(flown), truth=len(flown), bound=0.5),
        "minutes": computed(_minutes(cheap), 1),
        **{
            planned: computed(sigma[name], 4, share=SHARE_PLANNING)
            for planned, name in zip(PLANNED, ASKED_PLANNING, strict=True)
        },
        **{name: estimates[name] for name in FLOWN},
    }


def _minutes(plan: Plan) -> float:
    return flying_time_s(tuple(plan.blocks[BLOCK].strips.values())) / 60


def _mistakes_planning(case: Case, right: Rights) -> Iterator[Mistake]:
    """Yield common mistakes with plans."""
    plan = plans.from_values(_values(case))
    with_all, wanted = designs.sigmas(plan)[[*ASKED_PLANNING]], case.truth[WANTED]
    yield Mistake(
        says="these are the numbers of all strips: leave out what is not needed",
        gives={
            "strips": len(plan.blocks[BLOCK].strips),
            "minutes": _minutes(plan),
            **named(PLANNED, with_all.to_numpy()),
        },
    )
    turns = right["strips"].value - 1
    yield Mistake(
        says="the turns between the strips are missing",
        gives={"minutes": right["minutes"].value - turns * TURN_S / 60},
    )
    yield Mistake(
        says="a turn after the last strip is counted",
        gives={"minutes": right["minutes"].value + TURN_S / 60},
    )
    yield scaled(right, ["minutes"], 60.0, "given in seconds; asked for in minutes")
    yield Mistake(
        says="these are what is wanted, not what the plan gives",
        gives=named(PLANNED, np.array([*wanted.values()])),
    )
    yield Mistake(
        says="these are variances: take the square root",
        gives=named(PLANNED, values(right, PLANNED) ** 2),
    )
    yield variances(right)


LAB_9 = Sheet(
    name="lab-9",
    title="Plan a flight, and fly it",
    fly=_fly_planning,
    questions=QUESTIONS_PLANNING,
    given=_given_planning,
    solve=_solve_planning,
    mistakes=_mistakes_planning,
    hand_out=_hand_out,
)
