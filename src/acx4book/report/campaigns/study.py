"""A comparison with its tables, made once for page, figures and sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from acx4lib.errors import FlightError
from acx4lib.results.campaigns import campaign, tables
from acx4lib.results.campaigns.campaign import Campaign
from acx4lib.results.campaigns.comparison import Comparison, Difference, compare, differences
from acx4lib.results.campaigns.ground import Ground, ground_of

LEVEL = 0.05
"""Probability of one false alarm or more, of each table."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """What was compared, and how.

    Attributes
    ----------
    comparison : Comparison
    found : tuple of Difference
    ground : Ground
    level : float
    tables : dict of str to DataFrame
        As `acx4lib.results.campaigns.tables.every` returns them.
    """

    comparison: Comparison
    found: tuple[Difference, ...]
    ground: Ground
    level: float
    tables: dict[str, pd.DataFrame]

    def names(self, one: Difference) -> tuple[str, str]:
        """Return the names of the later and the earlier campaign of a difference."""
        listed = self.comparison.campaigns
        return listed[one.later].name, listed[one.earlier].name

    def title(self, one: Difference) -> str:
        """Return a difference as the tables name it."""
        return " - ".join(self.names(one))

    def changed(self, one: Difference) -> bool:
        """Tell whether any test of a difference, whole, of a part or single, is significant."""
        tests, singles = self.tables["tests"], self.tables["differences"]
        later, earlier = self.names(one)
        own = singles[(singles["later"] == later) & (singles["earlier"] == earlier)]
        p = [*tests.loc[tests["test"] == self.title(one), "p_joint"], *own["p_joint"]]
        return min(p) < self.level


def study(
    campaigns: Sequence[Campaign],
    *,
    against: str = "previous",
    height_m: float | None = None,
    level: float = LEVEL,
    apriori: bool = False,
) -> Study:
    """Compare campaigns.

    Parameters
    ----------
    campaigns : sequence of Campaign
    against : str
        ``"previous"`` or ``"first"``.
    height_m : float, optional
        For effects on the ground; by default the flying height of the first campaign.
    level : float
    apriori : bool
        As in `compare`.

    Raises
    ------
    FlightError
        Where they cannot be compared.
    """
    compared = compare(campaigns, apriori=apriori)
    found = differences(compared, against=against)
    ground = ground_of(compared, height_m=height_m)
    return Study(
        comparison=compared,
        found=found,
        ground=ground,
        level=level,
        tables=tables.every(compared, found, ground),
    )


def read(folders: Sequence[str | Path], *, methods: Sequence[str] = ()) -> list[Campaign]:
    """Read campaigns from the results of runs; all that is wrong is told at once.

    Parameters
    ----------
    folders : sequence of path
    methods : sequence of str
        One for every folder, one for all, or none.

    Raises
    ------
    FlightError
        Where a folder has no results to compare.
    """
    chosen = [*methods] if len(methods) == len(folders) else [*methods, ""][:1] * len(folders)
    out: list[Campaign] = []
    problems: list[str] = []
    for name, folder, method in zip(names_of(folders), folders, chosen, strict=True):
        try:
            out.append(campaign.read(folder, method=method, name=name))
        except FlightError as error:
            problems += error.problems
    if problems:
        raise FlightError(problems)
    return out


def names_of(folders: Sequence[str | Path]) -> list[str]:
    """Return the shortest ends of paths, of whole names, that differ; of one path its name."""
    parts = [Path(folder).resolve().parts for folder in folders]
    ends = (["/".join(own[-n:]) for own in parts] for n in range(1, max(map(len, parts))))
    different = (names for names in ends if len(set(names)) == len(names))
    return next(different, [own[-1] for own in parts])
