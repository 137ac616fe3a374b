"""Tables of a comparison for readers, made from the tables for programs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.report.markdown import listed, plural
from acx4book.typesetting.myst import LABELS, TITLES, p_value, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.calibration.estimates import Parameter
from acx4lib.errors import FlightError
from acx4tools import campaigns as acx4tools_campaigns
from acx4tools.campaigns import (
    NOUN,
    Campaign,
    Comparison,
    Difference,
    Ground,
    compare,
    differences,
    ground_of,
    trends_of,
)


def campaigns(study: Study) -> pd.DataFrame:
    """Return the campaigns: when, how warm, how calibrated, how well the σ fit."""
    rows = []
    for row in rows_of(study.tables["campaigns"]):
        warm = row.temperature_c
        rows.append(
            {
                "Campaign": row.campaign,
                "Date": row.date or None,
                "Temperature (°C)": f"{warm:g}" if np.isfinite(warm) else None,
                "Method": TITLES[row.method],
                "Redundancy": f"{row.redundancy:,}",
                "σ₀²": f"{row.sigma0_squared:.3f}",
                "p of σ₀²": p_value(row.chi_square_p) if np.isfinite(row.chi_square_p) else None,
                "σ used": row.sigma,
            }
        )
    return pd.DataFrame(rows)


def tests(study: Study) -> pd.DataFrame:
    """Return the joint tests of all parameters: of stability, of every difference, of trends."""
    table = study.tables["tests"]
    whole = table[table["part"] == "all"]
    equal = {
        study.title(difference): " = ".join(study.names(difference)) for difference in study.found
    }
    rows = [
        {"Hypothesis": equal.get(row.test, row.test), **_tested(row, study.level)}
        for row in rows_of(whole)
    ]
    return pd.DataFrame(rows).rename(columns={"Significant": "Rejected"})


def parts(study: Study, one: Difference) -> pd.DataFrame:
    """Return the joint tests of the parts of a difference, with their effects on the ground."""
    table = study.tables["tests"]
    part_tests = table[(table["test"] == study.title(one)) & (table["part"] != "all")]
    several = _cameras_to_say(study.comparison.parameters)
    return pd.DataFrame(
        [
            {
                "Part": f"{row.camera} {row.part}" if several else row.part,
                **_tested(row, study.level),
                "Ground (m)": f"{row.ground_rms_m:.3f}",
                "by chance (m)": f"{row.ground_sigma_m:.3f}",
            }
            for row in rows_of(part_tests)
        ]
    )


def _tested(row: Any, level: float) -> dict[str, object]:
    return {
        "χ²": f"{row.chi_square:.1f}",
        "Degrees of freedom": row.dof,
        "p, joint": p_value(row.p_joint),
        "Significant": _answer(row.p_joint < level),
    }


def _answer(rejected: bool) -> str:
    return "yes" if rejected else "no"


def singles(study: Study, one: Difference) -> pd.DataFrame:
    """Return the changes of single parameters between two campaigns."""
    table, names = study.tables["differences"], study.names(one)
    single_tests = table[(table["later"] == names[0]) & (table["earlier"] == names[1])]
    several = _cameras_to_say(study.comparison.parameters)
    rows = []
    for row in rows_of(single_tests):
        factor, unit = _scale(row.unit)
        rows.append(
            {
                "Parameter": with_unit(_label(row, several), unit),
                "Difference": value_and_sigma(factor * row.difference, factor * row.sigma),
                "t": f"{row.t:+.1f}",
                "p, joint": p_value(row.p_joint),
                "Significant": _answer(row.p_joint < study.level),
                "Ground (m)": f"{row.ground_rms_m:.3f}",
            }
        )
    return pd.DataFrame(rows)


def pooled(study: Study) -> pd.DataFrame:
    """Return the pooled value of every parameter, and the test of its stability."""
    several = _cameras_to_say(study.comparison.parameters)
    return pd.DataFrame(
        [
            {
                "Parameter": with_unit(_label(row, several), row.unit),
                "Of all campaigns": value_and_sigma(row.value, row.sigma),
                "χ²": f"{row.chi_square:.1f}",
                "Degrees of freedom": row.dof,
                "p, joint": p_value(row.p_joint),
                "Significant": _answer(row.p_joint < study.level),
            }
            for row in rows_of(study.tables["pooled"])
        ]
    )


def trends(study: Study, what: str) -> pd.DataFrame:
    """Return the slopes over time or temperature.

    Parameters
    ----------
    study : Study
    what : str
        ``"temperature"`` or ``"year"``.
    """
    several = _cameras_to_say(study.comparison.parameters)
    table = study.tables["trends"]
    rows = []
    for row in rows_of(table[table["over"] == what]):
        unit, _, per = row.unit.partition(" per ")
        factor, sign = _scale(unit)
        rows.append(
            {
                "Parameter": with_unit(_label(row, several), sign),
                f"Slope per {per}": value_and_sigma(factor * row.slope, factor * row.sigma),
                "t": f"{row.t:+.1f}",
                "p, joint": p_value(row.p_joint),
                "Significant": _answer(row.p_joint < study.level),
            }
        )
    return pd.DataFrame(rows)


# --- A comparison with its tables, made once for page, figures and sentences


LEVEL = 0.05
"""Probability of any false alarm in a table."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """Comparison of campaigns with differences, ground effects and tables.

    Attributes
    ----------
    comparison : Comparison
    found : tuple of Difference
    ground : Ground
    level : float
    tables : dict of str to DataFrame
        As `acx4tools.campaigns.every` returns them.
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
        """Return the name of a difference in the tables."""
        return " - ".join(self.names(one))

    def changed(self, one: Difference) -> bool:
        """Tell whether any test of a difference is significant: joint, by part or by parameter."""
        tests, singles = self.tables["tests"], self.tables["differences"]
        later, earlier = self.names(one)
        rows = singles[(singles["later"] == later) & (singles["earlier"] == earlier)]
        p = [*tests.loc[tests["test"] == self.title(one), "p_joint"], *rows["p_joint"]]
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
    changes = differences(compared, against=against)
    ground = ground_of(compared, height_m=height_m)
    return Study(
        comparison=compared,
        found=changes,
        ground=ground,
        level=level,
        tables=acx4tools_campaigns.every(compared, changes, ground),
    )


def read(folders: Sequence[str | Path], *, methods: Sequence[str] = ()) -> list[Campaign]:
    """Read campaigns from the results of runs; report all problems at once.

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
    for name, folder, method in zip(_names_of(folders), folders, chosen, strict=True):
        try:
            out.append(acx4tools_campaigns.read(folder, method=method, name=name))
        except FlightError as error:
            problems += error.problems
    if problems:
        raise FlightError(problems)
    return out


def _names_of(folders: Sequence[str | Path]) -> list[str]:
    """Return the shortest ends of paths, in whole folder names, that are all different."""
    parts = [Path(folder).resolve().parts for folder in folders]
    ends = (["/".join(path[-n:]) for path in parts] for n in range(1, max(map(len, parts))))
    different = (names for names in ends if len(set(names)) == len(names))
    return next(different, [path[-1] for path in parts])


# --- Rows, labels and units for readers; small changes have small units


SMALL = {"mm": (1e3, "µm"), "m": (1e3, "mm"), "deg": (3600.0, "″")}
"""Factor and sign of the unit for changes, by the unit of results."""


def rows_of(table: pd.DataFrame) -> Iterator[Any]:
    """Yield the rows of a table with its columns as attributes."""
    yield from table.itertuples(index=False)


def _scale(unit: str) -> tuple[float, str]:
    """Return the factor to the unit for changes, and its sign."""
    return SMALL.get(unit, (1.0, unit))


def _label(row: Any, several: bool) -> Markup:
    """Return the label of a row's parameter, after the camera's name if there are several."""
    label = shown(LABELS.get(row.parameter, row.parameter))
    return Markup(f"{shown(row.camera)} {label}" if several else label)


def _cameras_to_say(parameters: tuple[Parameter, ...]) -> bool:
    """Tell whether parameters are of several cameras, so that each must be named."""
    return len({p.camera for p in parameters}) > 1


# --- What a comparison says in sentences: the verdict, and how to read it


NAMED = 6
"""Largest number of changes named in a sentence; the others are counted."""


def verdict(study: Study) -> str:
    """Say whether the campaigns have the same parameters, and what has changed, as Markdown."""
    parts = [_stability(study), _where(study), _together(study), *_on_the_ground(study)]
    return "\n\n".join(part for part in parts if part)


def _stability(study: Study) -> str:
    test = study.tables["tests"].iloc[0]
    n, same = len(study.comparison.campaigns), test["p"] >= study.level
    counted = plural(len(study.comparison.parameters), "parameter")
    outcome = "agree within their errors" if same else "are not the same"
    return (
        f"**The {n} campaigns {outcome}.** All {counted} together: χ² = {test['chi_square']:.1f} "
        f"with {test['dof']} degrees of freedom, p {_p(test['p'])}; the level is {study.level:g}."
    )


def _p(p: float) -> str:
    text = p_value(p)
    return text if text.startswith("<") else f"= {text}"


def _where(study: Study) -> str:
    table = study.tables["differences"]
    changed = table[table["p_joint"] < study.level]
    if changed.empty:
        return "No parameter by itself has changed at the joint level."
    several = _cameras_to_say(study.comparison.parameters)
    by_size = changed.reindex(changed["t"].abs().sort_values(ascending=False).index)
    changes = [_change(row, several) for row in rows_of(by_size.head(NAMED))]
    more = f", and {len(changed) - NAMED} more" if len(changed) > NAMED else ""
    return f"Significant at the joint level {_are(len(changed))}: {listed(changes)}{more}."


def _together(study: Study) -> str:
    """Say which campaigns differ although no parameter by itself does."""
    tests, singles = study.tables["tests"], study.tables["differences"]
    changed = {
        (row.later, row.earlier) for row in rows_of(singles[singles["p_joint"] < study.level])
    }
    whole = tests[tests["part"] == "all"]
    p = dict(zip(whole["test"], whole["p_joint"], strict=True))
    pairs = [
        " and ".join(map(shown, reversed(study.names(difference))))
        for difference in study.found
        if p[study.title(difference)] < study.level and study.names(difference) not in changed
    ]
    if not pairs:
        return ""
    return (
        f"{'; '.join(pairs)}: all parameters together differ, although none does by itself. "
        "Parameters that are strongly correlated hide a change from each other; the effect on the "
        "ground shows it."
    )


def _are(n: int) -> str:
    return "is one difference" if n == 1 else f"are {n} differences"


def _change(row: Any, several: bool) -> str:
    factor, unit = _scale(row.unit)
    amount = value_and_sigma(factor * row.difference, factor * row.sigma)
    name = _label(row, several)
    gap = "" if unit == "″" else " "
    return f"{name} by {amount}{gap}{unit} ({shown(row.earlier)} to {shown(row.later)})"


def _on_the_ground(study: Study) -> Iterator[str]:
    """State the ground displacement of the latest difference, camera by camera."""
    last, names = study.found[-1], [c.name for c in study.comparison.campaigns]
    for camera, effects in study.ground.of.items():
        columns = study.comparison.of_camera(camera)
        moved = effects.moved(last.d[columns])
        sigma = effects.sigma(last.cov[np.ix_(columns, columns)])
        far, chance = np.sqrt(np.sum(moved**2, axis=1).mean()), np.sqrt(np.mean(sigma**2))
        yield (
            f"From {study.ground.height_m:g} m above the ground a pixel of {shown(camera)} that is "
            f"georeferenced with {shown(names[last.later])} lies {far:.3f} m (RMS over the format) "
            f"from where it lies with {shown(names[last.earlier])}; errors of both calibrations "
            f"alone make {chance:.3f} m."
        )


def trend(study: Study) -> str:
    """Say which parameters follow time or temperature, or what a regression would need."""
    if not trends_of(study.comparison):
        return (
            "There is no regression: it needs three campaigns or more, and of all of them `date` "
            "or `temperature_c` in `[session]` of flight.toml, not all the same."
        )
    return "\n\n".join(_line(study, variable) for variable in trends_of(study.comparison))


def _line(study: Study, variable: str) -> str:
    """Say whether parameters follow time or temperature, and whether a line describes them."""
    line, noun = trends_of(study.comparison)[variable], NOUN[variable]
    sloping, straight = line.sloping.p < study.level, line.scatter.p >= study.level
    sentence = (
        f"Over {noun} the slopes of all parameters together are {'' if sloping else 'not '}"
        f"significant (χ² = {line.sloping.chi_square:.1f}, {line.sloping.dof} degrees of freedom, "
        f"p {_p(line.sloping.p)})."
    )
    if straight:
        return f"{sentence} The campaigns lie on the lines within their errors."
    return (
        f"{sentence} But the campaigns do not lie on the lines (χ² = "
        f"{line.scatter.chi_square:.1f}, {line.scatter.dof} degrees of freedom, p "
        f"{_p(line.scatter.p)}): {noun} alone does not "
        "explain what changed, and σ of the slopes do not hold."
    )


def for_terminal(study: Study) -> list[str]:
    """Return the verdict in lines without markup."""
    table = study.tables["differences"]
    changed = table[table["p_joint"] < study.level]
    test = study.tables["tests"].iloc[0]
    lines = [*study.comparison.notes]
    same = test["p"] >= study.level
    lines.append(
        f"{len(study.comparison.campaigns)} campaigns "
        f"{'agree within their errors' if same else 'are not the same'}: chi-square "
        f"{test['chi_square']:.1f}, {test['dof']} degrees of freedom, p {_p(test['p'])}"
    )
    return [
        *lines,
        *(
            f"{row.camera} {row.parameter}: {row.difference:+.4g} {row.unit}, sigma "
            f"{row.sigma:.2g}, from {row.earlier} to {row.later}; {row.ground_rms_m:.3f} m on the "
            "ground"
            for row in rows_of(changed)
        ),
    ]
