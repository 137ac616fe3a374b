"""What a comparison says in sentences: the verdict, and how to read it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from acx4book.report.campaigns.study import Study
from acx4book.report.campaigns.units import cameras_to_say, label, rows_of, scale
from acx4book.report.words import listed, plural
from acx4book.typesetting.labels import p_value, value_and_sigma
from acx4book.typesetting.plain_text import shown
from acx4lib.results.campaigns.tables import NOUN, trends_of

NAMED = 6
"""Changes that a sentence names; the others are counted."""


def verdict(study: Study) -> str:
    """Say whether the campaigns have the same parameters, and what has changed, as Markdown."""
    parts = [_stability(study), _where(study), _together(study), *_on_the_ground(study)]
    return "\n\n".join(part for part in parts if part)


def _stability(study: Study) -> str:
    found = study.tables["tests"].iloc[0]
    n, same = len(study.comparison.campaigns), found["p"] >= study.level
    counted = plural(len(study.comparison.parameters), "parameter")
    what = "agree within their errors" if same else "are not the same"
    return (
        f"**The {n} campaigns {what}.** All {counted} together: χ² = {found['chi_square']:.1f} "
        f"with {found['dof']} degrees of freedom, p {_p(found['p'])}; the level is {study.level:g}."
    )


def _p(p: float) -> str:
    said = p_value(p)
    return said if said.startswith("<") else f"= {said}"


def _where(study: Study) -> str:
    table = study.tables["differences"]
    changed = table[table["p_joint"] < study.level]
    if changed.empty:
        return "No parameter by itself has changed at the joint level."
    several = cameras_to_say(study.comparison.parameters)
    most = changed.reindex(changed["t"].abs().sort_values(ascending=False).index)
    said = [_change(row, several) for row in rows_of(most.head(NAMED))]
    more = f", and {len(changed) - NAMED} more" if len(changed) > NAMED else ""
    return f"Significant at the joint level {_are(len(changed))}: {listed(said)}{more}."


def _together(study: Study) -> str:
    """Say which campaigns differ although no parameter by itself does."""
    tests, singles = study.tables["tests"], study.tables["differences"]
    changed = {
        (row.later, row.earlier) for row in rows_of(singles[singles["p_joint"] < study.level])
    }
    whole = tests[tests["part"] == "all"]
    p = dict(zip(whole["test"], whole["p_joint"], strict=True))
    pairs = [
        " and ".join(map(shown, reversed(study.names(one))))
        for one in study.found
        if p[study.title(one)] < study.level and study.names(one) not in changed
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
    factor, unit = scale(row.unit)
    said = value_and_sigma(factor * row.difference, factor * row.sigma)
    name = label(row.parameter, row.camera if several else "")
    gap = "" if unit == "″" else " "
    return f"{name} by {said}{gap}{unit} ({shown(row.earlier)} to {shown(row.later)})"


def _on_the_ground(study: Study) -> Iterator[str]:
    """Say what the latest difference moves on the ground, camera by camera."""
    one, names = study.found[-1], [c.name for c in study.comparison.campaigns]
    for camera, effects in study.ground.of.items():
        own = study.comparison.of_camera(camera)
        moved = effects.moved(one.d[own])
        sigma = effects.sigma(one.cov[np.ix_(own, own)])
        far, chance = np.sqrt(np.sum(moved**2, axis=1).mean()), np.sqrt(np.mean(sigma**2))
        yield (
            f"From {study.ground.height_m:g} m above the ground a pixel of {shown(camera)} that is "
            f"georeferenced with {shown(names[one.later])} lies {far:.3f} m (RMS over the format) "
            f"from where it lies with {shown(names[one.earlier])}; errors of both calibrations "
            f"alone make {chance:.3f} m."
        )


def notes(study: Study) -> str:
    """Return what readers must know of these campaigns, as a list; empty without any."""
    return "\n".join(f"- {shown(note)}." for note in study.comparison.notes)


def trend(study: Study) -> str:
    """Say which parameters follow time or temperature, or what a regression would need."""
    if not trends_of(study.comparison):
        return (
            "There is no regression: it needs three campaigns or more, and of all of them `date` "
            "or `temperature_c` in `[session]` of flight.toml, not all the same."
        )
    return "\n\n".join(_line(study, what) for what in trends_of(study.comparison))


def _line(study: Study, what: str) -> str:
    """Say whether parameters follow time or temperature, and whether a line describes them."""
    line, noun = trends_of(study.comparison)[what], NOUN[what]
    sloping, straight = line.sloping.p < study.level, line.scatter.p >= study.level
    said = (
        f"Over {noun} the slopes of all parameters together are {'' if sloping else 'not '}"
        f"significant (χ² = {line.sloping.chi_square:.1f}, {line.sloping.dof} degrees of freedom, "
        f"p {_p(line.sloping.p)})."
    )
    if straight:
        return f"{said} The campaigns lie on the lines within their errors."
    return (
        f"{said} But the campaigns do not lie on the lines (χ² = {line.scatter.chi_square:.1f}, "
        f"{line.scatter.dof} degrees of freedom, p {_p(line.scatter.p)}): {noun} alone does not "
        "explain what changed, and σ of the slopes do not hold."
    )


def how(study: Study) -> str:
    """Say how the numbers were obtained."""
    sigma = (
        "as they were stated before the adjustments"
        if study.comparison.apriori
        else "multiplied by the root of each campaign's own σ₀²"
    )
    p_of = "χ²" if study.comparison.apriori else "F, with the smallest redundancy of the campaigns"
    return (
        "Campaigns count as independent: the covariance of a difference is the sum of both, from "
        f"covariance.csv. Standard deviations are {sigma}. χ² is $d^T C^{{-1}} d$ of the "
        f"differences d with their joint covariance C; p is from {p_of}. *p, joint* is Holm's: "
        "among all parameters of all differences, or all their parts, or all differences as a "
        "whole, the probability of one false alarm or more is at most "
        f"{study.level:g}, however the tests depend on each other. Values *of all campaigns* are "
        "fitted by least squares with the full covariances; they hold where nothing has changed. "
        f"*Ground* is what a difference moves in a single image from {study.ground.height_m:g} m "
        "over level ground of known height, as RMS over the format; *by chance* is what it would "
        "be if only errors of both calibrations made it."
    )


def for_terminal(study: Study) -> list[str]:
    """Return the verdict in lines without markup."""
    table = study.tables["differences"]
    changed = table[table["p_joint"] < study.level]
    found = study.tables["tests"].iloc[0]
    lines = [*study.comparison.notes]
    same = found["p"] >= study.level
    lines.append(
        f"{len(study.comparison.campaigns)} campaigns "
        f"{'agree within their errors' if same else 'are not the same'}: chi-square "
        f"{found['chi_square']:.1f}, {found['dof']} degrees of freedom, p {_p(found['p'])}"
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
