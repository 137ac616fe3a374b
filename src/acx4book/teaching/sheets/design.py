"""Lab 8: parameters determined by a flight with all strips and with fewer strips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Rights, Sheet, computed
from acx4book.teaching.grading import named, scaled, values, wrong_sign
from acx4lib.calibration.mounting import single_step
from acx4lib.expected import Array
from acx4lib.flight.block import select_images
from acx4lib.results import tables
from acx4sim.files import SimulatedFlight

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
ASKED = {"f_mm": "mm", "lever_x_m": "m", "lever_z_m": "m"}
CORRELATION = "corr_f_lever_z_{}"
SHARE = 0.04
"""Part of a standard deviation by which an answer may differ."""

QUESTIONS = (
    *(
        Question(
            name=f"sigma_{design}_{name}", unit=unit, asks=f"σ of {name}, {WORDS[design]}", digits=4
        )
        for design in DESIGNS
        for name, unit in ASKED.items()
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


def _fly(truth: int, errors: int, title: str) -> SimulatedFlight:
    """Fly the whole block."""
    return flights.fly(errors, title, flights.drawn_camera(truth), flights.WHOLE)


def _given(case: Case) -> Sequence[str]:
    """Return the number of strips, in a sentence."""
    return [f"The block has {len({*case.block.images.strips})} strips; images.csv names them."]


def _covariance(case: Case, strips: Sequence[str]) -> Array:
    """Return the covariance of `ASKED` from given strips alone, shape (3, 3)."""
    is_flown = np.isin(case.block.images.strips, strips)
    block = select_images(case.block, is_flown)
    calibration = single_step(block, free=case.flight.estimate_mounting).calibration
    names = [f"CAM/{name}" for name in ASKED]
    return tables.covariance(calibration).loc[names, names].to_numpy()


def _solve(case: Case) -> Rights:
    """Adjust the block with the strips of each design."""
    covariances = {design: _covariance(case, strips) for design, strips in DESIGNS.items()}
    right = {
        f"sigma_{design}_{name}": computed(float(sigma), 4, share=SHARE)
        for design, cov in covariances.items()
        for name, sigma in zip(ASKED, np.sqrt(np.diagonal(cov)), strict=True)
    }
    for design in ("all", "one_height"):
        cov = covariances[design]
        correlation = cov[0, 2] / np.sqrt(cov[0, 0] * cov[2, 2])
        right[CORRELATION.format(design)] = computed(float(correlation), 2)
    return right


def _mistakes(case: Case, right: Rights) -> Iterator[Mistake]:
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
            of_other = [f"sigma_{other}_{name}" for name in ASKED]
            yield Mistake(
                says=f"these are the numbers of {WORDS[other]}",
                gives=named([f"sigma_{design}_{n}" for n in ASKED], values(right, of_other)),
            )
        others = sorted({*DESIGNS["all"]} - {*strips})
        if others:
            sigma = np.sqrt(np.diagonal(_covariance(case, others)))
            yield Mistake(
                says="these are the strips that were to be left out",
                gives=named([f"sigma_{design}_{n}" for n in ASKED], sigma),
            )


SHEET = Sheet(
    name="lab-8",
    title="What the flight does not determine",
    fly=_fly,
    questions=QUESTIONS,
    given=_given,
    solve=_solve,
    mistakes=_mistakes,
)
