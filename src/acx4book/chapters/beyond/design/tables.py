"""Tables of planned flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4lib.planning.choosing.chosen import Chosen
from acx4lib.planning.choosing.target import BLOCK
from acx4lib.planning.design import sigmas
from acx4lib.planning.exposures import flying_time_s
from acx4lib.planning.plan import Plan

BRIEF = {"f_mm": "f, mm", "lever_z_m": "z, m", "lever_x_m": "x, m", "boresight_kappa_deg": "κ, °"}
"""What is shown after every strip, with its name there."""


def flights(plans: Mapping[str, Plan], names: Sequence[str]) -> pd.DataFrame:
    """Return strips, images, minutes and standard deviations, a column for every flight.

    Parameters
    ----------
    plans : mapping of str to Plan
        By what they are called.
    names : sequence of str
        Parameters whose standard deviations are shown, by their names in results.
    """
    return pd.DataFrame({name: _column(plan, names) for name, plan in plans.items()})


def _column(plan: Plan, names: Sequence[str]) -> pd.Series:
    strips = [*plan.blocks[BLOCK].strips.values()]
    of_flight = {
        "strips": len(strips),
        "images": sum(one.n_exposures for one in strips),
        "minutes": flying_time_s(tuple(strips)) / 60,
    }
    return pd.concat([pd.Series(of_flight), sigmas(plan)[[*names]]])


def written(numbers: pd.DataFrame) -> pd.DataFrame:
    """Return the table of `flights` as text, with names and units for readers."""
    counted = ["strips", "images", "minutes"]
    text = numbers.map("{:#.2g}".format)
    text.loc[counted] = numbers.loc[counted].map("{:.0f}".format)
    units = {name: name.rpartition("_")[2].replace("deg", "°") for name in numbers.index[3:]}
    names = {name: Markup(f"σ of {LABELS[name]}, {unit}") for name, unit in units.items()}
    return text.rename(index=names).reset_index(names="")


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
