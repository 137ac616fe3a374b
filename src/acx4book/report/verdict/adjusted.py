"""What holds of the adjustments by themselves: solutions, residuals, gross errors, boresights."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import pandas as pd

from acx4book.report.adjustment.groups import CONTROLLED, decisive_qualities
from acx4book.report.material import Material, sentences, validated
from acx4book.report.mounting.stability import turns_of
from acx4book.report.parameters.estimates import STRONG, strong_pairs
from acx4book.report.verdict.finding import FAILS, HOLDS, NOTE, ChanceTest, Finding, matters
from acx4book.report.words import adjustment_title, begun, listed, pair_texts, plural
from acx4book.typesetting.plain_text import Markup
from acx4lib.bundle.gross_errors.limits import NAMES, too_many
from acx4lib.bundle.gross_errors.rejections import CRITICAL
from acx4lib.least_squares.statistical import distributions
from acx4lib.results.folder import messages, rows

DECLARED = ("declared lever arm", "declared boresight")
"""Groups of observations that the question on the declared mounting tests."""


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
    lines = _stopped(material, tested_on(material))
    for name in material.decisive:
        lines += [f"{name}: {said}" for said in _rejected_away(material, name)]
    question = "Observations agree with each other"
    if lines:
        yield Finding(question=question, state=FAILS, answer="; ".join(lines) + ".")
    elif material.adjustments:
        answer = "Of no group would data snooping reject more than single observations."
        yield Finding(question=question, state=HOLDS, answer=answer)


def tested_on(material: Material) -> list[str]:
    """Return the names of what is certified: the decisive adjustments and their validation."""
    names = (*material.decisive, validated(material))
    return [name for name in names if name in material.found.summary]


def _stopped(material: Material, names: Iterable[str]) -> list[str]:
    """Return which groups exceed the limits of data snooping."""
    summary = material.found.summary
    return [line for name in names for line in messages(summary[name], "stopped")]


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
    """Tell whether every parameter of the certified adjustments is determined."""
    lines = [line for name in material.decisive for line in _open(material, name)]
    question = "All parameters determined"
    if lines:
        answer = "; ".join(dict.fromkeys(lines)) + "."
        yield Finding(question=question, state=FAILS, answer=answer)
    elif material.decisive and material.found.parameters.empty:
        answer = "No parameter of a camera was estimated."
        yield Finding(question=question, state=NOTE, answer=answer)
    elif material.decisive:
        answer = (
            "Every estimated parameter has a standard deviation below the limit of what counts "
            "as determined."
        )
        yield Finding(question=question, state=HOLDS, answer=answer)


def _open(material: Material, name: str) -> list[str]:
    """Return what an adjustment does not determine."""
    return messages(material.found.summary[name], "not_determined")


def other_methods(material: Material) -> Iterator[Finding]:
    """Say what methods leave open that are not certified."""
    own = tested_on(material)
    others = [name for name in material.found.summary if name not in own]
    lines = [line for name in others for line in _open(material, name)]
    lines += _stopped(material, others)
    refined = material.found.summary.get("synthetic/refined", {}).get("sigma0_squared")
    if refined is not None:
        sigma0_sq = float(str(refined))
        lines.append(f"heads refined in the synthetic image: σ₀² = {sigma0_sq:.2f}, not tested")
    if lines:
        answer = "; ".join(dict.fromkeys(lines)) + ". This report does not certify these methods."
        yield Finding(question="Other methods", state=NOTE, answer=answer)


def global_test(material: Material) -> Iterator[Finding]:
    """Test the variance of unit weight of the decisive adjustments."""
    entries = {name: material.found.summary[name] for name in material.decisive}
    entries = {name: e for name, e in entries.items() if int(str(e["redundancy"])) > 0}
    if not entries:
        return
    values = [_sigma0(entry) for entry in entries.values()]
    span = f"{min(values):.3f}" + (f" to {max(values):.3f}" if len(values) > 1 else "")
    yield Finding(
        question="Global χ² test",
        state=HOLDS,
        answer=f"The variance of unit weight is {span}.",
        passed="Residuals have the size that the a priori standard deviations promise.",
        tests=tuple(
            ChanceTest(
                name=f"σ₀² of {adjustment_title(name)}",
                p=float(str(entry["chi_square_p"])),
                said=f"{adjustment_title(name)} (σ₀² = {_sigma0(entry):.2f}): residuals are "
                f"{'larger' if _sigma0(entry) > 1 else 'smaller'} than the a priori standard "
                "deviations promise",
                relevant=matters(np.sqrt(_sigma0(entry))),
            )
            for name, entry in entries.items()
        ),
    )


def _sigma0(entry: Mapping[str, object]) -> float:
    return float(str(entry["sigma0_squared"]))


def weights(material: Material) -> Iterator[Finding]:
    """Test the a priori standard deviations of every group of observations."""
    groups = [g for g in decisive_qualities(material) if g.group not in DECLARED]
    tests = [
        ChanceTest(
            name=f"{g.group} of {adjustment_title(g.adjustment)}",
            p=g.p,
            said=f"{g.group} of {adjustment_title(g.adjustment)}: {_factor(g.ratio)}",
            relevant=matters(g.ratio),
        )
        for g in groups
    ]
    if tests:
        yield Finding(
            question="A priori standard deviations",
            state=HOLDS,
            answer="",
            passed="Those of all groups of observations agree with the residuals.",
            tests=tuple(tests),
        )


def estimated_weights(material: Material) -> Iterator[Finding]:
    """Tell whether σ that were estimated from the residuals are within their bounds."""
    entries = [material.found.summary[name] for name in material.decisive]
    factors = [said for entry in entries for said in _factors(entry).values()]
    if all(said.get("applied") in (None, 1.0) for said in factors):
        return
    lines = [*sentences(material, "sigma_beyond")]
    if lines:
        answer = f"{begun('; '.join(lines))}. No result holds that rests on such weights."
        yield Finding(question="Estimated weights within bounds", state=FAILS, answer=answer)
        return
    from acx4lib.bundle.variance_components import BOUNDS  # noqa: PLC0415 loads what adjusts

    answer = (
        "σ were multiplied by factors from the residuals, as flight.toml asks; none is outside "
        f"{BOUNDS[0]:.2g} to {BOUNDS[1]:g} by more than chance."
    )
    yield Finding(question="Estimated weights within bounds", state=HOLDS, answer=answer)


def _factors(entry: Mapping[str, object]) -> dict[str, dict[str, object]]:
    said = entry.get("sigma_factors")
    return said if isinstance(said, dict) else {}


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
        f"Of the parameters, {listed(pair_texts(pairs))} "
        f"correlate by more than {STRONG:g}. They are determined together: use them together, "
        "with their covariance."
    )
    yield Finding(question=question, state=NOTE, answer=answer)


def gross_errors(material: Material) -> Iterator[Finding]:
    """Compare number and size of the rejected observations with what chance rejects."""
    question = "Gross errors"
    entries = [material.found.summary[name] for name in tested_on(material)]
    entries = [entry for entry in entries if entry.get("n_rejected") is not None]
    if not entries:
        return
    n_rejected = sum(int(str(entry["n_rejected"])) for entry in entries)
    n = sum(int(str(entry["n_observations"])) for entry in entries)
    answer = begun(f"{plural(n_rejected, 'observation')} of {n:,} taken out as gross errors")
    mixed = dict.fromkeys(s.partition(": ")[2] for s in sentences(material, "exchanged"))
    if mixed:
        answer = f"{begun('; '.join(mixed))}. Correct the names and run again. {answer}"
    elif any(messages(entry, "stopped") for entry in entries):
        answer = "Not tested: observations contradict each other, so rejections say nothing."
        yield Finding(question=question, state=NOTE, answer=answer)
        return
    where = "; they are listed below or in rejected.csv." if n_rejected else "."
    if any(entry.get("expected_rejections") is None for entry in entries):
        answer += f"{where} These results do not say how many chance takes out; run again."
        yield Finding(question=question, state=FAILS if mixed else NOTE, answer=answer)
        return
    chance = sum(float(str(entry["expected_rejections"])) for entry in entries)
    largest, n_apart = _rejected(material)
    many = f"{plural(n_rejected, 'observation')} rejected, where chance takes out {chance:.1f}"
    yield Finding(
        question=question,
        state=FAILS if mixed else HOLDS,
        answer=f"{answer}, where chance alone takes out {chance:.1f}{where}",
        tests=(
            ChanceTest(name="number of rejections", p=poisson_sf(n_apart, chance), said=many),
            ChanceTest(
                name="largest rejected residual",
                p=largest_p(largest, chance),
                said=f"the largest is w = {largest:.1f}",
            ),
        ),
    )


def _rejected(material: Material) -> tuple[float, int]:
    """Return the largest statistic that was rejected, and how many points and exposures it hit.

    One error may take out several rays of its point, which control each other.
    """
    methods = ["/".join(name.split("/")[:2]) for name in tested_on(material)]
    found = [rows(material.found, "rejected", method) for method in dict.fromkeys(methods)]
    out = pd.concat(found) if found else pd.DataFrame()
    if out.empty:
        return 0.0, 0
    place = out["point"].where(out["point"].astype(str) != "", out["image_or_exposure"])
    hit = out["stage"].astype(str) + "/" + out["kind"].astype(str) + "/" + place.astype(str)
    return float(out["statistic"].abs().max()), int(hit.nunique())


def poisson_sf(n: int, chance: float) -> float:
    """Return the probability of n rejections or more, where chance makes so many on average."""
    return distributions.chi2_cdf(2 * chance, 2 * n) if n else 1.0


def largest_p(w: float, chance: float) -> float:
    """Return the probability of a residual of w or more among all that were tested.

    Parameters
    ----------
    w : float
        The largest that was rejected; below the critical value where nothing was.
    chance : float
        How many of those tested exceed the critical value by chance.
    """
    n = chance / (2 * distributions.norm_sf(CRITICAL))
    each = 2 * distributions.norm_sf(max(w, 0.0))
    return float(-np.expm1(n * np.log1p(-each))) if each < 1 else 1.0


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
    """Test the boresight for a drift and for steps between strips."""
    if not material.certified:
        return
    question = "Boresight stable over time"
    told = material.found.summary.get(material.certified, {}).get("boresight_stability")
    if not isinstance(told, dict):
        answer = "These results have no test of the boresight over time; run again."
        yield Finding(question=question, state=NOTE, answer=answer)
        return
    turns = turns_of(material)
    if not turns:
        answer = (
            "Not tested: observations contradict each other."
            if _stopped(material, [material.certified])
            else "Not tested: it needs attitudes of two strips or of exposures at several times, "
            "and more of them than turns."
        )
        yield Finding(question=question, state=NOTE, answer=answer)
        return
    yield Finding(
        question=question,
        state=HOLDS,
        answer="",
        passed="No significant drift and no significant differences between strips.",
        tests=tuple(ChanceTest(name=t.title, p=t.p, said=t.sentence) for t in turns),
    )
