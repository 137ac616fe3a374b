"""What holds of the adjustments by themselves: solutions, residuals, gross errors, boresights."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from acx4book.report.adjustment.groups import CONTROLLED, Quality, decisive_qualities, ratio_limits
from acx4book.report.material import Material, sentences
from acx4book.report.mounting.stability import boresights, drifts
from acx4book.report.parameters.estimates import STRONG, strong_pairs
from acx4book.report.verdict.finding import FAILS, HOLDS, LIMIT_P, NOTE, Finding
from acx4book.report.words import adjustment_title, begun, listed, pair_text, plural
from acx4book.typesetting.plain_text import Markup
from acx4lib.bundle.gross_errors.limits import NAMES, too_many
from acx4lib.results.folder import messages, rows

FEW = 0.01
"""Share of rejected observations above which these are not single gross errors."""


def one_flight(material: Material) -> Iterator[Finding]:
    """Tell whether all stages saw the same files."""
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


def converged(material: Material) -> Iterator[Finding]:
    """Tell whether every adjustment has a solution."""
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


def contradictions(material: Material) -> Iterator[Finding]:
    """Tell whether a part of a group that is too large contradicts the others."""
    lines = [*sentences(material, "stopped")]
    for name in material.decisive:
        lines += [f"{name}: {said}" for said in _rejected_away(material, name)]
    question = "Observations agree with each other"
    if lines:
        yield Finding(question=question, state=FAILS, answer="; ".join(lines) + ".")
    elif material.adjustments:
        answer = "Of no group would data snooping reject more than single observations."
        yield Finding(question=question, state=HOLDS, answer=answer)


def _rejected_away(material: Material, name: str) -> Iterator[str]:
    """Yield what was rejected of trajectory and control, where that is too much of it."""
    rejected = rows(material.found, "rejected", "/".join(name.split("/")[:2]))
    for kind, noun in NAMES.items():
        out = _names(rejected, kind)
        n = len(out | _names(material.residuals[name], kind))
        if too_many(len(out), n):
            yield f"{len(out)} of {n} {noun} were rejected"


def _names(table: pd.DataFrame, kind: str) -> set[tuple[str, str]]:
    own = table[table["kind"] == kind]
    return set(zip(own["image_or_exposure"].astype(str), own["point"].astype(str), strict=True))


def determined(material: Material) -> Iterator[Finding]:
    """Tell whether every estimated parameter is determined."""
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


def global_test(material: Material) -> Iterator[Finding]:
    """Test the variance of unit weight of the decisive adjustments."""
    p = {n: float(str(material.found.summary[n]["chi_square_p"])) for n in material.decisive}
    if not p:
        return
    failed = [n for n in p if p[n] < LIMIT_P]
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
        f"limit {LIMIT_P:g})."
    )
    yield Finding(question=question, state=HOLDS, answer=answer)


def _sigma0(material: Material, name: str) -> float:
    return float(str(material.found.summary[name]["sigma0_squared"]))


def weights(material: Material) -> Iterator[Finding]:
    """Test the a priori standard deviations of every group of observations."""
    groups = decisive_qualities(material)
    if not groups:
        return
    wrong = [g for g in groups if _wrong(g)]
    question = "A priori standard deviations"
    if wrong:
        said = [f"{g.group} of {adjustment_title(g.adjustment)}: {_factor(g.ratio)}" for g in wrong]
        yield Finding(question=question, state=FAILS, answer="; ".join(said) + ".")
        return
    answer = "Those of all groups of observations agree with the residuals, within their limits."
    yield Finding(question=question, state=HOLDS, answer=answer)


def _wrong(group: Quality) -> bool:
    low, high = ratio_limits(group.redundancy)
    return group.ratio > high or group.ratio < low


def _factor(ratio: float) -> str:
    if ratio > 1:
        return f"σ is {ratio:.3g} times too small"
    return f"σ is {1 / max(ratio, 1e-9):.3g} times too large"


def apart(material: Material) -> Iterator[Finding]:
    """Tell which parameters are only determined together."""
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


def gross_errors(material: Material) -> Iterator[Finding]:
    """Compare the number of rejected observations with what chance rejects."""
    entries = [material.found.summary[name] for name in material.decisive]
    if not entries:
        return
    n_rejected = sum(int(str(entry["n_rejected"])) for entry in entries)
    n = sum(int(str(entry["n_observations"])) for entry in entries)
    many = n_rejected > FEW * n
    answer = begun(f"{plural(n_rejected, 'observation')} of {n:,} taken out as gross errors")
    if all("expected_rejections" in entry for entry in entries):
        chance = sum(float(str(entry["expected_rejections"])) for entry in entries)
        answer += f", where chance alone takes out {chance:.1f}"
    answer += "; they are listed below or in rejected.csv."
    if many:
        answer += " So many are rather a wrong σ, exposure or camera than single gross errors."
    yield Finding(question="Gross errors", state=FAILS if many else HOLDS, answer=answer)


def controlled(material: Material) -> Iterator[Finding]:
    """Count the observations that the others hardly control."""
    if not material.decisive:
        return
    groups = decisive_qualities(material)
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


def stable(material: Material) -> Iterator[Finding]:
    """Test the boresights of the images for a drift and for steps between strips."""
    tested = drifts(boresights(material))
    if not tested:
        return
    moved = [f"drift about {d.axis} ({d.change_deg:+.4f}°)" for d in tested if d.p < LIMIT_P]
    moved += [f"differences between strips about {d.axis}" for d in tested if d.p_strips < LIMIT_P]
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
