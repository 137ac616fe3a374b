"""What the agreement of a printed number means: given, chosen for, following, or independent."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.myst import myst_table

ROLES: Mapping[str, str] = MappingProxyType(
    {
        "given": "It is an input of the simulation. That it comes back tests the software.",
        "chosen": "Something that the paper does not tell was set so that it comes out: for the "
        "standard deviations of the paper's Table 3 the tie points and the noise of GNSS, for the "
        "numbers of pairs the places of the targets.",
        "follows": "It is arithmetic from other printed numbers, or the same true value, estimated "
        "a second time.",
        "independent": "Nothing was set for it. Only its agreement says something about the study.",
    }
)
"""The roles of printed numbers, and what each means."""

STRONG = ("f_mm", "xp_mm", "yp_mm")
"""Parameters whose two-step values are the strong evidence."""


def sentence(card: pd.DataFrame) -> str:
    """Say how many of the printed numbers have which role, and what the strong evidence is.

    Parameters
    ----------
    card : DataFrame
        As `scorecard.scorecard` returns it.
    """
    n = card["role"].value_counts()
    independent = card[card["role"] == "independent"]
    agree = int((independent["verdict"] == "agrees").sum())
    strong = card[
        (card["table"] == 3) & (card["column"] == "two_step") & card["quantity"].isin(STRONG)
    ]
    held = int((strong["verdict"] == "agrees").sum())
    apart = [
        abs(printed.value(3, name, "two_step") - printed.value(3, name, "single_step"))
        / printed.sigma(3, name, "single_step")
        for name in STRONG
    ]
    return (
        f"Of the {len(card)} numbers in the paper's tables, {n['given']} were *given* to the "
        f"simulation. {n['chosen']} were *chosen*: something that the paper does not tell was set "
        f"so that they come out. {n['follows']} *follow* from others. Only the remaining "
        f"{n['independent']} are *independent*, and {agree} of these agree. The strong evidence is "
        f"{len(strong)} of them, $f$, $x_p$ and $y_p$ of the two-step method. They lie "
        f"{min(apart):.0f} to {max(apart):.0f} of the paper's standard deviations away from the "
        "values of the single step, which were given. Nothing was set for them, and "
        f"{held} of {len(strong)} agree."
    )


def table() -> str:
    """Return the roles and what they mean as a MyST table."""
    rows = pd.DataFrame(
        [{"Role": role, "What its agreement means": meaning} for role, meaning in ROLES.items()]
    )
    return myst_table(rows, "Roles of the printed numbers", name="tab-roles")
