"""The statement at the top of a report: what holds and what does not, in plain words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import stats

from acx4book.report.estimates import SIGNIFICANCE, STRONG, strong_pairs
from acx4book.report.groups import CONTROLLED, Quality, qualities, ratio_limits
from acx4book.report.material import Material, sentences
from acx4book.report.stability import boresights, drifts
from acx4book.report.words import adjustment_title, begun, listed, pair_text, plural
from acx4book.typesetting.plain_text import Markup
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy
from acx4lib.results.folder import messages

HOLDS, FAILS, NOTE = "holds", "fails", "note"

FACTOR = 1.2
"""Ratio of a posteriori and a priori sigma, or its inverse, up to which weights are good enough:
such a change of the weights hardly changes the parameters and their sigma."""

FEW = 0.01
"""Share of rejected observations above which these are not single gross errors."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One statement of the verdict.

    Attributes
    ----------
    question : str
        The question.
    state : str
        `HOLDS`, `FAILS`, or `NOTE` for information without a test.
    answer : str
        One or two sentences, text or `Markup`.
    """

    question: str
    state: str
    answer: str


def findings(material: Material) -> list[Finding]:
    """Return the answers to all questions that the results can answer."""
    return [
        *_one_flight(material),
        *_converged(material),
        *_determined(material),
        *_global_test(material),
        *_weights(material),
        *_apart(material),
        *_gross_errors(material),
        *_controlled(material),
        *_stable(material),
        *_checked(material),
        *_noted(material),
    ]


def statement(found: Sequence[Finding]) -> str:
    """Return the verdict in one sentence, as Markdown."""
    failed = [f.question for f in found if f.state == FAILS]
    tested = sum(f.state != NOTE for f in found)
    if not failed:
        return f"**The results hold.** All {tested} tests of this report are passed."
    which = listed([name[:1].lower() + name[1:] for name in failed])
    return (
        f"**Not everything holds.** {len(failed)} of {tested} tests "
        f"{'fails' if len(failed) == 1 else 'fail'}: {which}."
    )


def _one_flight(material: Material) -> Iterator[Finding]:
    stages = material.provenance.stages
    stale = [name for name, said in stages.items() if said["flight"] != material.provenance.digest]
    question = "One state of the data"
    if stale:
        answer = (
            f"The flight was changed after {listed(stale)} had run; these results are of other "
            "files than those listed below."
        )
        yield Finding(question=question, state=FAILS, answer=answer)
        return
    answer = "Every stage was computed from the files listed below, which are unchanged since."
    yield Finding(question=question, state=HOLDS, answer=answer)


def _converged(material: Material) -> Iterator[Finding]:
    failed = [
        name
        for name, entry in material.found.summary.items()
        if entry.get("converged") is False and not messages(entry, "left_out")
    ]
    n = len(material.adjustments)
    if failed:
        answer = f"No solution for {listed([adjustment_title(name) for name in failed])}."
        yield Finding(question="Convergence", state=FAILS, answer=answer)
    elif n:
        answer = f"{begun(plural(n, 'adjustment'))} computed, all converged."
        yield Finding(question="Convergence", state=HOLDS, answer=answer)


def _determined(material: Material) -> Iterator[Finding]:
    lines = list(dict.fromkeys([*sentences(material, "not_determined")]))
    question = "All parameters determined"
    if lines:
        yield Finding(question=question, state=FAILS, answer="; ".join(lines) + ".")
    elif material.adjustments:
        answer = (
            "Every estimated parameter has a standard deviation below the limit of what counts "
            "as determined."
        )
        yield Finding(question=question, state=HOLDS, answer=answer)


def _global_test(material: Material) -> Iterator[Finding]:
    p = {n: float(str(material.found.summary[n]["chi_square_p"])) for n in material.decisive}
    if not p:
        return
    limit = SIGNIFICANCE / len(p)
    failed = [n for n in p if p[n] < limit]
    question = "Global χ² test"
    if failed:
        said = [f"{adjustment_title(n)} (σ₀² = {_sigma0(material, n):.2f})" for n in failed]
        answer = (
            f"The residuals of {listed(said)} are not of the size that the a priori standard "
            "deviations promise. Standard deviations in this report are a posteriori, multiplied "
            "by σ₀; look at the groups below for the weight that is wrong."
        )
        yield Finding(question=question, state=FAILS, answer=answer)
        return
    values = [_sigma0(material, n) for n in p]
    span = f"{min(values):.3f}" + (f" to {max(values):.3f}" if len(values) > 1 else "")
    answer = (
        f"The variance of unit weight is {span}; residuals have the size that the a priori "
        f"standard deviations promise (smallest p = {min(p.values()):.2g}, "
        f"limit {limit:.2g})."
    )
    yield Finding(question=question, state=HOLDS, answer=answer)


def _sigma0(material: Material, name: str) -> float:
    return float(str(material.found.summary[name]["sigma0_squared"]))


def _weights(material: Material) -> Iterator[Finding]:
    groups = [group for name in material.decisive for group in qualities(material, name)]
    if not groups:
        return
    wrong = [g for g in groups if _wrong(g, 1 - SIGNIFICANCE / len(groups))]
    question = "A priori standard deviations"
    if wrong:
        said = [f"{g.group} of {adjustment_title(g.adjustment)}: {_factor(g.ratio)}" for g in wrong]
        yield Finding(question=question, state=FAILS, answer="; ".join(said) + ".")
        return
    answer = f"Those of all groups of observations are right within a factor of {FACTOR:g}."
    yield Finding(question=question, state=HOLDS, answer=answer)


def _wrong(group: Quality, level: float) -> bool:
    low, high = ratio_limits(group.redundancy, probability=level)
    return group.ratio > max(high, FACTOR) or group.ratio < min(low, 1 / FACTOR)


def _factor(ratio: float) -> str:
    if ratio > 1:
        return f"σ is {ratio:.1f} times too small"
    return f"σ is {1 / max(ratio, 1e-9):.1f} times too large"


def _apart(material: Material) -> Iterator[Finding]:
    if not material.calibration:
        return
    pairs = strong_pairs(material, material.calibration)
    question = "Parameters told apart"
    if not pairs:
        answer = f"No two parameters correlate by more than {STRONG:g}."
        yield Finding(question=question, state=HOLDS, answer=answer)
        return
    answer = Markup(
        f"Of the parameters, {listed([pair_text(pair) for pair in pairs])} "
        f"correlate by more than {STRONG:g}. They are determined together: use them together, "
        "with their covariance."
    )
    yield Finding(question=question, state=NOTE, answer=answer)


def _gross_errors(material: Material) -> Iterator[Finding]:
    entries = [material.found.summary[name] for name in material.decisive]
    if not entries:
        return
    n_rejected = sum(int(str(entry["n_rejected"])) for entry in entries)
    n = sum(int(str(entry["n_observations"])) for entry in entries)
    many = n_rejected > FEW * n
    answer = begun(
        f"{plural(n_rejected, 'observation')} of {n:,} taken out as gross errors, each of them "
        "listed below or in rejected.csv."
    )
    if many:
        answer += " So many are rather a wrong σ, exposure or camera than single gross errors."
    yield Finding(question="Gross errors", state=FAILS if many else HOLDS, answer=answer)


def _controlled(material: Material) -> Iterator[Finding]:
    if not material.decisive:
        return
    groups = [group for name in material.decisive for group in qualities(material, name)]
    weak: dict[str, int] = {}
    for group in groups:
        weak[group.group] = weak.get(group.group, 0) + group.weak
    n = sum(group.n for group in groups)
    where = "; ".join(f"{count:,} {group}" for group, count in weak.items() if count)
    answer = (
        f"{plural(sum(weak.values()), 'observation component')} of {n:,} with a redundancy number "
        f"below {CONTROLLED:g}"
        + (f" ({where}): a gross error there would hardly be seen." if where else ".")
    )
    state = NOTE if where else HOLDS
    yield Finding(question="Observations controlled", state=state, answer=begun(answer))


def _stable(material: Material) -> Iterator[Finding]:
    tested = drifts(boresights(material))
    if not tested:
        return
    level = SIGNIFICANCE / (2 * len(tested))
    moved = [f"drift about {d.axis} ({d.change_deg:+.4f}°)" for d in tested if d.p < level]
    moved += [f"differences between strips about {d.axis}" for d in tested if d.p_strips < level]
    question = "Boresight stable over time"
    if moved:
        answer = f"Significant: {listed(moved)}. The mean boresight is not that of every exposure."
        yield Finding(question=question, state=FAILS, answer=answer)
        return
    change = max(abs(d.change_deg) for d in tested)
    answer = (
        f"No significant drift and no significant differences between strips; the line through "
        f"all images changes by at most {change:.4f}°."
    )
    yield Finding(question=question, state=HOLDS, answer=answer)


def _checked(material: Material) -> Iterator[Finding]:
    rows = checked_points(material)
    question = "Independent check points"
    if len(rows) < 2:
        answer = "There are no check points, so the accuracy on the ground is not shown."
        yield Finding(question=question, state=NOTE, answer=answer)
        return
    d = rows[["d_east_m", "d_north_m", "d_height_m"]].to_numpy()
    sigma = rows[["sigma_east_m", "sigma_north_m", "sigma_height_m"]].to_numpy()
    said = accuracy.from_differences(d)
    state, odd = _judged(said, np.sqrt(np.mean(sigma**2, axis=0)))
    rms = ", ".join(f"{value:.2f} m in {axis}" for value, axis in zip(said.rms, AXES, strict=True))
    ending = {
        HOLDS: "No significant mean, and no worse than the predicted standard deviations.",
        NOTE: f"Significant: {listed(odd)}; errors of the parameters, which all points share and "
        "the predicted standard deviations hold, may explain it.",
        FAILS: f"Significant: {listed(odd)}. This is more than the predicted standard deviations.",
    }
    answer = f"RMS at {len(d)} points: {rms}. {ending[state]}"
    yield Finding(question=question, state=state, answer=answer)


def _judged(said: accuracy.Accuracy, predicted: Array) -> tuple[str, list[str]]:
    """Return the verdict on differences at check points, and sentences on significant axes.

    Means and sizes are tested as if the points were independent. A significant difference only
    fails if it would be significant, too, with one error that all points share.

    Parameters
    ----------
    said : Accuracy
    predicted : ndarray, shape (3,)
        RMS of the predicted standard deviations, m.
    """
    test = accuracy.mean_test(said, probability=1 - SIGNIFICANCE / 3)
    _, high = ratio_limits(said.n, probability=1 - 2 * SIGNIFICANCE / 3)
    ratio = np.array(said.rms) / predicted
    odd = [
        f"a mean of {said.mean[i]:+.2f} m in {AXES[i]}" for i in range(3) if not test.accepted[i]
    ]
    odd += [
        f"{AXES[i]} {ratio[i]:.1f} times the predicted RMS" for i in range(3) if ratio[i] > high
    ]
    shared = stats.norm.isf(SIGNIFICANCE / 6)  # three axes, two sides
    if odd and max(np.max(np.abs(said.mean) / predicted), np.max(ratio)) > shared:
        return FAILS, odd
    return (NOTE if odd else HOLDS), odd


def checked_points(material: Material) -> pd.DataFrame:
    """Return the check points of the validation with the calibration, or with given cameras."""
    rows = material.found.check_points
    method = material.calibration.partition("/")[2] or "given"
    return rows[(rows["stage"] == "validation") & (rows["method"] == method)]


def _noted(material: Material) -> Iterator[Finding]:
    lines = [*sentences(material, "left_out"), *sentences(material, "notes")]
    lines += list(material.flight.notes)
    if lines:
        answer = "; ".join(dict.fromkeys(lines))
        answer += "" if answer.endswith("…") else "."
        yield Finding(question="Said by the run", state=NOTE, answer=answer)
