"""The paper's calibration flight beside cheaper ones, one of them chosen by the search."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.design.curves import sigmas
from acx4book.chapters.beyond.design.plans import (
    COURSE_DEG,
    HIGH_M,
    LOW_M,
    OVERLAP,
    flown,
    pair,
    strip,
)
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4lib.planning.choosing import candidates, chosen, target
from acx4lib.planning.choosing.chosen import Chosen
from acx4lib.planning.choosing.target import BLOCK
from acx4lib.planning.exposures import flying_time_s
from acx4lib.planning.plan import Plan

WANTED = (
    "f_mm",
    "lever_x_m",
    "lever_y_m",
    "lever_z_m",
    "boresight_omega_deg",
    "boresight_phi_deg",
    "boresight_kappa_deg",
)
"""What the flights are compared by."""

BRIEF = {"f_mm": "f, mm", "lever_z_m": "z, m", "lever_x_m": "x, m", "boresight_kappa_deg": "κ, °"}
"""What is shown after every strip, with its name there."""

CANDIDATES = {
    "strip": {
        "flying_height_m": [LOW_M, HIGH_M],
        "course_deg": [COURSE_DEG, COURSE_DEG + 90.0, COURSE_DEG + 180.0, COURSE_DEG + 270.0],
        "length_m": [1100.0, 2200.0],
        "overlap": OVERLAP,
    }
}
"""Strips over the middle of the field that may be chosen, besides the paper's own."""


def choice(plan: Plan, allowed: float, minutes: float = np.inf) -> Chosen:
    """Return cheap strips that are nearly as good as those of a plan.

    Parameters
    ----------
    plan : Plan
    allowed : float
        What is wanted: so many times the plan's σ, of every parameter of `WANTED`.
    minutes : float
        Longest flying time.
    """
    sigma = allowed * sigmas(plan)[[*WANTED]]
    wanted = {"sigma": sigma.to_dict(), "candidates": CANDIDATES}
    return chosen.choose(candidates.of(target.from_values(wanted, plan)), minutes=minutes)


def left_out(plan: Plan) -> pd.DataFrame:
    """Return σ over the plan's where one strip is left out: a column for every strip."""
    strips = plan.blocks[BLOCK].strips
    fewer = {
        name: flown(plan, {other: one for other, one in strips.items() if other != name})
        for name in strips
    }
    return pd.DataFrame({n: sigmas(one) / sigmas(plan) for n, one in fewer.items()}).loc[[*WANTED]]


def left_out_by_search(plan: Plan) -> pd.DataFrame:
    """Return the same from the sums of what the strips tell, by a part of the tie points."""
    wanted = dict.fromkeys(WANTED, 1.0)
    found = candidates.of(target.from_values({"sigma": wanted}, plan))
    strips = [*plan.blocks[BLOCK].strips]
    every = range(len(strips))
    return pd.DataFrame(
        {
            name: found.given(tuple(k for k in every if strips[k] != name)) / found.given((*every,))
            for name in strips
        },
        index=[*WANTED],
    )


def flights(plan: Plan, cheap: Chosen) -> dict[str, Plan]:
    """Return the paper's flight and three cheaper ones, by what they are called.

    Parameters
    ----------
    plan : Plan
        The paper's.
    cheap : Chosen
        Of `choice`.
    """
    two = {
        "there": strip(plan, LOW_M, COURSE_DEG),
        "back": strip(plan, HIGH_M, COURSE_DEG + 180.0),
    }
    return {
        "the paper's": plan,
        "chosen": cheap.plan,
        "one height": flown(plan, pair(plan, LOW_M)),
        "there and back": flown(plan, two),
    }


def table(flights: Mapping[str, Plan]) -> pd.DataFrame:
    """Return strips, images, minutes and standard deviations: a column for every flight."""
    return pd.DataFrame({name: _column(plan) for name, plan in flights.items()})


def _column(plan: Plan) -> pd.Series:
    strips = [*plan.blocks[BLOCK].strips.values()]
    of_flight = {
        "strips": len(strips),
        "images": sum(one.n_exposures for one in strips),
        "minutes": flying_time_s(tuple(strips)) / 60,
    }
    return pd.concat([pd.Series(of_flight), sigmas(plan)[[*WANTED]]])


def written(numbers: pd.DataFrame) -> pd.DataFrame:
    """Return the table as text, with names and units for readers."""
    shown = numbers.map("{:#.2g}".format)
    counted = ["strips", "images", "minutes"]
    shown.loc[counted] = numbers.loc[counted].map("{:.0f}".format)
    units = {name: name.rpartition("_")[2].replace("deg", "°") for name in WANTED}
    names = {name: Markup(f"σ of {LABELS[name]}, {unit}") for name, unit in units.items()}
    return shown.rename(index=names).reset_index(names="")


def bought(found: Chosen) -> pd.DataFrame:
    """Return what each chosen strip buys, as text: σ after it, and what leaving it out costs.

    A row for every strip in the order of `Chosen`; the last column names the parameter that
    suffers most without the strip, and how many times its σ is then what is wanted.
    """
    limits = pd.Series({one.name: one.limit for one in found.wanted})
    rows = []
    for k, one in enumerate(found.plan.blocks[BLOCK].strips.values()):
        excess = pd.Series(found.without[k], index=limits.index) / limits
        after = dict(zip(limits.index, found.after[k], strict=True))
        rows.append(
            {
                "strip": f"{k + 1}",
                "height, m": f"{one.flying_height_m:.0f}",
                "course": f"{one.course_deg:.0f}°",
                "images": f"{one.n_exposures}",
                "minutes": f"{found.minutes_after[k]:.1f}",
                **{f"σ of {short}": f"{after[sigma]:.2g}" for sigma, short in BRIEF.items()},
                "left out": Markup(f"{LABELS[str(excess.idxmax())]}: {excess.max():.2g} times"),
            }
        )
    return pd.DataFrame(rows)
