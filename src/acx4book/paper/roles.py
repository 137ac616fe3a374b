"""What the agreement of a printed number means: given, chosen for, following, or independent."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import pandas as pd

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
"""Parameters whose two-step values, less the single-step ones, are the evidence."""

HARDLY = ("mean_east_m", "mean_north_m", "mean_height_m")
"""Independent numbers of the paper's Table 4 that can hardly disagree."""


def sentence(card: pd.DataFrame) -> str:
    """Say how many of the printed numbers have which role, and which of them are evidence.

    Parameters
    ----------
    card : DataFrame
        As `scorecard.scorecard` returns it.
    """
    n = card["role"].value_counts()
    independent = card[card["role"] == "independent"]
    agree = independent[independent["verdict"] == "agrees"]
    means = int(agree["quantity"].isin(HARDLY).sum())
    strong = int(agree["quantity"].isin(STRONG).sum())
    return (
        f"Of the {len(card)} numbers in the paper's tables, {n['given']} were *given* to the "
        f"simulation. {n['chosen']} were *chosen*: something that the paper does not tell was set "
        f"so that they come out. {n['follows']} *follow* from others. Only the remaining "
        f"{n['independent']} are *independent*, and {len(agree)} of these agree. Of these "
        f"{len(agree)}, {means} are means of differences at check points, which are small against "
        "their scatter and could hardly disagree, and "
        f"{len(agree) - means - strong} depend on the noise that was chosen. Evidence about the "
        f"study are the {strong} others: $f$, $x_p$ and $y_p$ of the two-step method."
    )


def table() -> str:
    """Return the roles and what they mean as a MyST table."""
    rows = pd.DataFrame(
        [{"Role": role, "What its agreement means": meaning} for role, meaning in ROLES.items()]
    )
    return myst_table(rows, "Roles of the printed numbers", name="tab-roles")
