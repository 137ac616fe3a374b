"""Findings of a report: each question with its tests and answer, and the verdict."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from acx4book.report import held
from acx4book.report.adjustment import CONTROLLED, decisive_qualities
from acx4book.report.markdown import Text, adjustment_title, begun, listed, plural, show, table
from acx4book.report.material import (
    Material,
    checked_points,
    earlier_calibrations,
    validated,
)
from acx4book.report.mounting import turns_of
from acx4book.report.parameters import STRONG, pair_texts, strong_pairs
from acx4book.typesetting.myst import p_value, sections
from acx4book.typesetting.plain_text import Markup
from acx4files.results import folder as results
from acx4files.results.folder import messages, rows
from acx4lib.bundle.rejections import CRITICAL, NAMES, too_many
from acx4lib.calibration.estimates import LIMIT_SCALE, SIGMAS_OF_SCALE
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing.accuracy import rms_p
from acx4lib.least_squares import statistics
from acx4lib.least_squares.verdict import (
    FAILS,
    HOLDS,
    LEVEL,
    MATTERS,
    MINOR,
    UNTESTED,
    Verdict,
    gravest,
    off_by,
    verdicts,
)

# --- The questions of the verdict: their answers, the tests behind them, and one level for all


NOTE = "note"
"""State of what is information; the others are those of a `verdict`."""


@dataclass(frozen=True, kw_only=True)
class ChanceTest:
    """One statistical test behind a finding.

    Attributes
    ----------
    name : str
        What is tested.
    p : float
        Probability of such a value, or a more extreme one, where everything is right.
    said : str
        What is said where it is significant.
    size, limit, unit : float, float, str
        Size of what is found, and that from which it matters. Of many observations, a σ that is
        wrong by a hundredth is significant. By default every size matters.
    p_joint : float
        Of the same among all tests of the report, by Holm; comparable with `LEVEL`. NaN before
        all tests are known.
    state : str
        Of its verdict among all tests.
    """

    name: str
    p: float
    said: str
    size: float = np.inf
    limit: float = 0.0
    unit: str = "%"
    p_joint: float = np.nan
    state: str = UNTESTED

    @property
    def measured(self) -> str:
        """The probability, the size and its limit, in words."""
        p = p_value(self.p)
        size = _measure(self.size, self.unit) if self.size else "less"
        limit = _measure(self.limit, self.unit)
        return f"p {p if p.startswith('<') else f'= {p}'}; {size}, limit {limit}"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One statement of the verdict.

    Attributes
    ----------
    question : str
        The question.
    state : str
        `HOLDS`, `MINOR`, `FAILS`, `UNTESTED`, where the answer has the reason, or `NOTE` for
        information. A finding with tests has the gravest state of these.
    answer : str
        One or two sentences, text or `Markup`.
    passed : str
        What is added where no test is significant.
    tests : tuple of ChanceTest
        Empty where nothing depends on chance.
    restriction : str
        What the results can be used for where the state is `MINOR`, as Markdown; by default for
        all.
    is_cause : bool
        Whether other questions fail by what this one found, so that it is named first.
    """

    question: str
    state: str
    answer: str
    passed: str = ""
    tests: tuple[ChanceTest, ...] = ()
    restriction: str = ""
    is_cause: bool = False

    @property
    def p(self) -> float:
        """Smallest probability of its tests; NaN without any."""
        return min((test.p for test in self.tests), default=np.nan)

    @property
    def p_joint(self) -> float:
        """Smallest probability of its tests among all tests of the report; NaN without any."""
        return min((test.p_joint for test in self.tests), default=np.nan)


def judged(findings: Iterable[Finding]) -> list[Finding]:
    """Judge the findings by all their tests jointly, at one level, by Holm.

    Parameters
    ----------
    findings : iterable of Finding
        Their tests are not judged; those without a probability are left out.
    """
    drafts = [replace(f, tests=tuple(t for t in f.tests if np.isfinite(t.p))) for f in findings]
    columns = np.array([(t.p, t.size, t.limit) for f in drafts for t in f.tests]).reshape(-1, 3)
    found = iter(verdicts(*columns.T))
    return [
        _answered(replace(f, tests=tuple(_judged(t, next(found)) for t in f.tests))) for f in drafts
    ]


def _judged(test: ChanceTest, verdict: Verdict) -> ChanceTest:
    return replace(test, p_joint=verdict.p_joint, state=verdict.state)


def _answered(finding: Finding) -> Finding:
    """Return a finding with state and answer from its tests."""
    if not finding.tests:
        return finding
    failures = [
        t.said if t.unit == "%" else f"{t.said} ({t.measured})"
        for t in finding.tests
        if t.state == FAILS
    ]
    minor = [f"{t.said} ({t.measured})" for t in finding.tests if t.state == MINOR]
    passed = "" if minor else finding.passed
    parts = (
        finding.answer,
        f"Significant: {'; '.join(failures)}." if failures else passed,
        f"Rejected, but below the size that matters: {'; '.join(minor)}." if minor else "",
    )
    answer = type(finding.answer)(" ".join(filter(None, parts)))
    state = gravest([finding.state, *(test.state for test in finding.tests)])
    return replace(finding, state=state, answer=answer)


def _measure(value: float, unit: str) -> str:
    """Return a size with its unit; a share in percent."""
    return f"{100 * value:.2g} %" if unit == "%" else f"{value:.2g} {unit}"


def _all_tests(findings: Sequence[Finding]) -> list[ChanceTest]:
    """Return all tests of a report."""
    return [test for finding in findings for test in finding.tests]


# --- What holds of the adjustments by themselves: solutions, residuals, gross errors, boresights


DECLARED = ("declared lever arm", "declared boresight")
"""Groups of observations tested by the question on the declared mounting."""


def _one_flight(material: Material) -> Iterator[Finding]:
    """Check that all stages were computed from the same files."""
    stages = material.provenance.stages
    stale = [name for name, run in stages.items() if run["flight"] != material.provenance.digest]
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


def _contradictions(material: Material) -> Iterator[Finding]:
    """Check for groups in which too many observations contradict the others."""
    lines = _stopped(material, _tested_on(material))
    for name in material.decisive:
        lines += [f"{name}: {sentence}" for sentence in _rejected_away(material, name)]
    question = "Observations agree with each other"
    if lines:
        yield Finding(question=question, state=FAILS, answer="; ".join(lines) + ".")
    elif material.adjustments:
        answer = "Of no group would data snooping reject more than single observations."
        yield Finding(question=question, state=HOLDS, answer=answer)


def _tested_on(material: Material) -> list[str]:
    """Return the names of the certified parts: the decisive adjustments and their validation."""
    names = (*material.decisive, validated(material))
    return [name for name in names if name in material.found.summary]


def _stopped(material: Material, names: Iterable[str]) -> list[str]:
    """Return which groups exceed the limits of data snooping."""
    summary = material.found.summary
    return [line for name in names for line in messages(summary[name], "stopped")]


def _rejected_away(material: Material, name: str) -> Iterator[str]:
    """Yield a sentence where too much of trajectory or control was rejected."""
    rejected = rows(material.found, "rejected", "/".join(name.split("/")[:2]))
    for kind, noun in NAMES.items():
        out = _names(rejected, kind)
        n = len(out | _names(material.residuals[name], kind))
        if too_many(len(out), n):
            yield f"{len(out)} of {n} {noun} were rejected"


def _names(table: pd.DataFrame, kind: str) -> set[tuple[str, str]]:
    of_kind = table[table["kind"] == kind]
    return set(
        zip(of_kind["image_or_exposure"].astype(str), of_kind["point"].astype(str), strict=True)
    )


def _determined(material: Material) -> Iterator[Finding]:
    """Tell whether every parameter of the certified adjustments is determined."""
    lines = [line for name in material.decisive for line in _open(material, name)]
    question = "All parameters determined"
    if lines:
        answer = "; ".join(dict.fromkeys(lines)) + "."
        yield Finding(question=question, state=FAILS, answer=answer)
    elif material.decisive and material.found.parameters.empty:
        answer = "No parameter of a camera was estimated."
        yield Finding(question=question, state=UNTESTED, answer=answer)
    elif material.decisive:
        answer = (
            "Every estimated parameter has a standard deviation below the limit of what counts "
            "as determined."
        )
        yield Finding(question=question, state=HOLDS, answer=answer)


def _open(material: Material, name: str) -> list[str]:
    """Return the run's messages on undetermined parameters of an adjustment."""
    return messages(material.found.summary[name], "not_determined")


def _weak(material: Material) -> Iterator[Finding]:
    """Name the weak parameters of the calibration: why, and what would determine them."""
    names = (*material.decisive, validated(material))
    sentences = [
        line.partition(": ")[2]
        for line in _sentences(material, "weak")
        if line.startswith(tuple(f"{name}: " for name in names))
    ]
    if sentences:
        answer = "; ".join(dict.fromkeys(sentences)) + "."
        yield Finding(question="Weak parameters", state=NOTE, answer=answer)


def _sentences(material: Material, key: str) -> Iterator[str]:
    """Yield the sentences of all methods under a key of the summary."""
    for entry in material.found.summary.values():
        yield from results.messages(entry, key)


def _other_methods(material: Material) -> Iterator[Finding]:
    """Report open problems of the methods without certificate."""
    tested = _tested_on(material)
    others = [name for name in material.found.summary if name not in tested]
    lines = [line for name in others for line in _open(material, name)]
    lines += _stopped(material, others)
    if lines:
        answer = "; ".join(dict.fromkeys(lines)) + ". This report does not certify these methods."
        yield Finding(question="Other methods", state=NOTE, answer=answer)


def _refined(material: Material) -> Iterator[Finding]:
    """Say why the fit of matched points between heads is not tested, and what takes its place."""
    refined = material.found.summary.get("synthetic/refined", {}).get("sigma0_squared")
    if refined is not None:
        sigma0_sq = float(str(refined))
        answer = (
            f"σ₀² = {sigma0_sq:.2f} is not tested against one: the σ of a matched point holds the "
            "noise of its pixels alone, and not what lenses, relief and shutters leave between two "
            f"heads. The results do not rest on it: σ₀ = {np.sqrt(sigma0_sq):.2f}, found from the "
            "differences, multiplies the σ of the refined heads, and what exposures say of a head "
            "beyond that is added."
        )
        yield Finding(question="Heads refined by tie points", state=UNTESTED, answer=answer)


def _global_test(material: Material) -> Iterator[Finding]:
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
                size=off_by(np.sqrt(_sigma0(entry))),
                limit=MATTERS,
            )
            for name, entry in entries.items()
        ),
    )


def _sigma0(entry: Mapping[str, object]) -> float:
    return float(str(entry["sigma0_squared"]))


def _weights(material: Material) -> Iterator[Finding]:
    """Test the a priori standard deviations of every group of observations."""
    groups = [g for g in decisive_qualities(material) if g.group not in DECLARED]
    tests = [
        ChanceTest(
            name=f"{g.group} of {adjustment_title(g.adjustment)}",
            p=g.p,
            said=f"{g.group} of {adjustment_title(g.adjustment)}: {_factor(g.ratio)} (stated "
            f"{g.sigma:.2g} {g.unit}, by the residuals {g.sigma * g.ratio:.2g} {g.unit})",
            size=off_by(g.ratio),
            limit=MATTERS,
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


def _estimated_weights(material: Material) -> Iterator[Finding]:
    """Tell whether σ that were estimated from the residuals are within their bounds."""
    entries = [material.found.summary[name] for name in material.decisive]
    factors = [factor for entry in entries for factor in _factors(entry).values()]
    if all(factor.get("applied") in (None, 1.0) for factor in factors):
        return
    lines = [*_sentences(material, "sigma_beyond")]
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
    factors = entry.get("sigma_factors")
    return factors if isinstance(factors, dict) else {}


def _factor(ratio: float) -> str:
    if ratio > 1:
        return f"σ is {ratio:.3g} times too small"
    return f"σ is {1 / max(ratio, 1e-9):.3g} times too large"


def _apart(material: Material) -> Iterator[Finding]:
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


def _gross_errors(material: Material) -> Iterator[Finding]:
    """Compare number and size of the rejected observations with what chance rejects."""
    question = "Gross errors"
    entries = [material.found.summary[name] for name in _tested_on(material)]
    entries = [entry for entry in entries if entry.get("n_rejected") is not None]
    if not entries:
        return
    n_rejected = sum(int(str(entry["n_rejected"])) for entry in entries)
    n = sum(int(str(entry["n_observations"])) for entry in entries)
    answer = begun(f"{plural(n_rejected, 'observation')} of {n:,} taken out as gross errors")
    mixed = dict.fromkeys(s.partition(": ")[2] for s in _sentences(material, "exchanged"))
    if mixed:
        answer = f"{begun('; '.join(mixed))}. Correct the names and run again. {answer}"
    elif any(messages(entry, "stopped") for entry in entries):
        answer = "Observations contradict each other, so rejections say nothing."
        yield Finding(question=question, state=UNTESTED, answer=answer)
        return
    where = "; they are listed below or in rejected.csv." if n_rejected else "."
    if any(entry.get("expected_rejections") is None for entry in entries):
        answer += f"{where} These results do not say how many chance takes out; run again."
        yield Finding(question=question, state=FAILS if mixed else UNTESTED, answer=answer)
        return
    chance = sum(float(str(entry["expected_rejections"])) for entry in entries)
    largest, n_apart = _rejected(material)
    many = f"{plural(n_rejected, 'observation')} rejected, where chance takes out {chance:.1f}"
    yield Finding(
        question=question,
        state=FAILS if mixed else HOLDS,
        answer=f"{answer}, where chance alone takes out {chance:.1f}{where}",
        tests=(
            ChanceTest(name="number of rejections", p=_poisson_sf(n_apart, chance), said=many),
            ChanceTest(
                name="largest rejected residual",
                p=_largest_p(largest, chance),
                said=f"the largest is w = {largest:.1f}",
            ),
        ),
    )


def _rejected(material: Material) -> tuple[float, int]:
    """Return the largest rejected statistic, and the number of affected points and exposures.

    One error may take out several rays of its point, which control each other.
    """
    methods = ["/".join(name.split("/")[:2]) for name in _tested_on(material)]
    tables = [rows(material.found, "rejected", method) for method in dict.fromkeys(methods)]
    rejected = pd.concat(tables) if tables else pd.DataFrame()
    if rejected.empty:
        return 0.0, 0
    place = rejected["point"].where(
        rejected["point"].astype(str) != "", rejected["image_or_exposure"]
    )
    affected = (
        rejected["stage"].astype(str) + "/" + rejected["kind"].astype(str) + "/" + place.astype(str)
    )
    return float(rejected["statistic"].abs().max()), int(affected.nunique())


def _poisson_sf(n: int, chance: float) -> float:
    """Return the probability of n rejections or more, given the number expected by chance."""
    return statistics.chi2_cdf(2 * chance, 2 * n) if n else 1.0


def _largest_p(w: float, chance: float) -> float:
    """Return the probability of a residual of w or more among all that were tested."""
    n = chance / (2 * statistics.norm_sf(CRITICAL))
    single_p = 2 * statistics.norm_sf(max(w, 0.0))
    return float(-np.expm1(n * np.log1p(-single_p))) if single_p < 1 else 1.0


def _controlled(material: Material) -> Iterator[Finding]:
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


def _stable(material: Material) -> Iterator[Finding]:
    """Test the boresight for a drift and for steps between strips."""
    if not material.certified:
        return
    question = "Boresight stable over time"
    stability = material.found.summary.get(material.certified, {}).get("boresight_stability")
    if not isinstance(stability, dict):
        answer = "These results have no test of the boresight over time; run again."
        yield Finding(question=question, state=UNTESTED, answer=answer)
        return
    turns = turns_of(material)
    if not turns:
        answer = (
            "Observations contradict each other."
            if _stopped(material, [material.certified])
            else "It needs attitudes of two strips or of exposures at several times, and more of "
            "them than turns."
        )
        yield Finding(question=question, state=UNTESTED, answer=answer)
        return
    yield Finding(
        question=question,
        state=HOLDS,
        answer="",
        passed="No significant drift and no significant differences between strips.",
        tests=tuple(ChanceTest(name=t.title, p=t.p, said=t.sentence) for t in turns),
    )


# --- What the results are held against: held values, declared mountings, heights, check points


HELD = "Held values"


def _held(material: Material) -> Iterator[Finding]:
    """Test the values at which adjustments hold parameters, and what they change."""
    stages = held.tested(material)
    if not stages:
        if material.decisive:
            answer = "These results have no test of what the adjustments hold; run again."
            yield Finding(question=HELD, state=UNTESTED, answer=answer)
        return
    told = {stage: held.values(material, names) for stage, names in stages.items()}
    out = {stage: held.rejected(material, names) for stage, names in stages.items()}
    parts = [
        f"{begun(held.in_words(told[stage], keys))}. To free "
        f"{'it' if len(keys) == 1 else 'them'}: {held.freeing(material, stage, keys)}."
        for stage, keys in out.items()
        if keys
    ]
    tests = tuple(_held_test(material, stage, names) for stage, names in stages.items())
    tests = tuple(test for test in tests if np.isfinite(test.p))
    yield Finding(
        question=HELD,
        state=HOLDS if tests else UNTESTED,
        answer=Markup(" ".join(parts) if tests else "The data cannot tell any of them."),
        passed="The data reject no value at which an adjustment holds a parameter."
        if not any(out.values())
        else "Among all tests of this report none of this is significant.",
        tests=tests,
        restriction=RESTRICTION if out.get("heads") else "",
        is_cause=any(held.explains(material, name) for names in stages.values() for name in names),
    )


RESTRICTION = (
    "The calibrations of the single heads can be used for their relative orientation and the "
    "synthetic image, where what they hold changes less than matters. Their $x_p$, $y_p$, "
    "$\\omega$ and $\\varphi$ are not those of the cameras: they take up the values that are held "
    f"(“{HELD}”)"
)


def _held_test(material: Material, stage: str, names: Sequence[str]) -> ChanceTest:
    size, limit, unit = held.effect(material, stage, names)
    of = f"held values of {'the heads' if stage == 'heads' else adjustment_title(names[0])}"
    known = np.isfinite(size)
    return ChanceTest(
        name=of,
        p=held.joint_p(held.values(material, names)),
        said=of if known else f"{of}, whose effect on a synthetic image is not known",
        size=size,
        limit=limit,
        unit=unit if known else "%",
    )


FEWEST = 2
"""Smallest number of check points for their statistics."""


def _mountings(material: Material) -> Iterator[Finding]:
    """Compare the estimated mountings with the declared ones."""
    question = "Declared mounting confirmed"
    parts = [part for name in material.decisive for part in _parts(material, name)]
    lines = [part.mistaken for part in parts if part.mistaken]
    approximate = "; ".join(part.approximate for part in parts if part.approximate)
    tests = tuple(part.test for part in parts if part.test)
    note = f"Without σ it is an approximation and not tested: {approximate}." if approximate else ""
    if lines or tests:
        answer = " ".join(filter(None, ("; ".join(lines) + "." if lines else "", note)))
        yield Finding(
            question=question,
            state=FAILS if lines else HOLDS,
            answer=answer,
            passed="What flight.toml declares with σ agrees with the estimates.",
            tests=tests,
        )
    elif material.calibration:
        yield Finding(question=question, state=UNTESTED, answer=note or _not_compared(material))


@dataclass(frozen=True, kw_only=True)
class _Part:
    """A declared part of a mounting: a recognised mistake, a test, or its deviation."""

    mistaken: str = ""
    test: ChanceTest | None = None
    approximate: str = ""


def _parts(material: Material, name: str) -> Iterator[_Part]:
    """Yield the declared parts compared in an adjustment."""
    entry = material.found.summary[name]
    declared = entry.get("declared")
    compared = declared if isinstance(declared, dict) else {}
    if any("told" not in comparison for comparison in compared.values()):  # of an earlier version
        yield from (_Part(mistaken=line) for line in results.messages(entry, "not_confirmed"))
    for place, comparison in compared.items():
        camera, _, part = place.rpartition("/")
        title, mistake = f"{part.replace('_', ' ')} of {camera}", comparison.get("mistake", "")
        sentence = f"{title} {comparison.get('told', 'differs from the declared one')}"
        if mistake:
            yield _Part(
                mistaken=f"{sentence}; {mistake}" if comparison["told"] else f"{title} {mistake}"
            )
        if comparison.get("p") is not None:
            yield _Part(test=ChanceTest(name=title, p=float(comparison["p"]), said=sentence))
        elif comparison["confirmed"]:
            yield _Part(approximate=sentence)


def _not_compared(material: Material) -> str:
    """Return why no declared mounting was compared."""
    cameras = material.flight.cameras.values()
    if not any(any(camera.prior.declared) for camera in cameras):
        return (
            "flight.toml declares no mounting. A delay, an undulation or another north would be "
            "absorbed by lever arm and boresight without a trace."
        )
    if results.messages(material.found.summary.get(material.calibration, {}), "stopped"):
        return (
            "Not compared: observations contradict each other, so that the estimated mounting "
            "says nothing of the one that flight.toml declares."
        )
    return "Not compared: what flight.toml declares is held, or not determined."


def _earlier(material: Material) -> Iterator[Finding]:
    """Name the earlier flight of the validated calibration, if it is not from this flight."""
    calibrations = earlier_calibrations(material)
    if not calibrations:
        return
    calibration = calibrations[validated(material)]
    flown = f", flown {calibration['flown']}" if calibration.get("flown") else ""
    answer = (
        f"Validated is the calibration {calibration['method']} of an earlier flight, "
        f"{calibration['flight']['name']} (SHA-256 "
        f"{calibration['flight']['sha256'][:12]}{flown}); computed {calibration['computed']}, "
        f"results {calibration['results']} with SHA-256 {calibration['sha256'][:12]}."
    )
    yield Finding(question="Calibration of an earlier flight", state=NOTE, answer=answer)


def _heights(material: Material) -> Iterator[Finding]:
    """Tell whether control, trajectory and check points have heights of one system."""
    question = "Heights of one system"
    offsets = {
        name: float(str(entry[key]))
        for name, entry in material.found.summary.items()
        for key in ("height_scale_error", "height_offset_share")
        if name in (*material.decisive, validated(material)) and entry.get(key) is not None
    }
    if not offsets:
        return
    worst = max(offsets, key=lambda name: abs(offsets[name]))
    sigma = float(str(material.found.summary[worst].get("height_scale_sigma") or 0.0))
    wrong = abs(offsets[worst]) > max(LIMIT_SCALE, SIGMAS_OF_SCALE * sigma)
    answer = (
        f"Heights of points differ from those of the trajectory by {100 * abs(offsets[worst]):.2g} "
        f"% of the flying height in {worst}; more than {100 * LIMIT_SCALE:g} % is another height "
        "system or a wrong focal length."
    )
    if not wrong and abs(offsets[worst]) > LIMIT_SCALE:
        answer += (
            f" That much is not significant here: the σ of the focal length is {100 * sigma:.2g} %."
        )
    yield Finding(question=question, state=FAILS if wrong else HOLDS, answer=answer)


def _predicted(entry: Mapping[str, Any]) -> str:
    """Return a sentence on the fit of exposures left out of the calibration."""
    rms = ", ".join(
        f"{v:.2f} m in {axis}" for v, axis in zip(entry["position_rms_m"], AXES, strict=True)
    )
    return (
        f"Of {plural(entry['n_exposures'], 'exposure')} that took no part in the calibration, rays "
        f"meet within {entry['rays_rms_px']:.2f} px, and positions are off by {rms} (RMS); the "
        f"variance of unit weight is {entry['sigma0_squared']:.3f}."
    )


def _check_points(material: Material) -> Iterator[Finding]:
    """Test the differences at check points, those of the validation with their full covariance."""
    entry: Mapping[str, Any] = material.found.summary.get(validated(material), {})
    single = _of_adjustment(material)
    few = (entry.get("n_points") or 0) < FEWEST
    if few:
        single = pd.concat([single, checked_points(material)])
    single = single.iloc[np.flatnonzero(np.isfinite(_ratios(single)).all(axis=1))]
    if few and single.empty:
        answer = "There are no check points, so the accuracy on the ground is not shown."
        if entry.get("rays_rms_px") is not None:
            answer += f" {_predicted(entry)}"
        yield Finding(question=CHECKED, state=UNTESTED, answer=answer)
        return
    parts, tests = [], [*_single_tests(single)]
    if len(single):
        n = begun(plural(len(single), "check point"))
        parts.append(f"{n}{'' if few else ' more'}, tested one by one: {_largest(single)}.")
    if not few:
        points = entry["points"]
        rms = ", ".join(f"{v:.2f} m in {axis}" for v, axis in zip(points["rms"], AXES, strict=True))
        parts.insert(0, f"RMS at {entry['n_points']} points: {rms}.")
        tests += [*_together(entry), *_means(points), *_spreads(points)]
        if entry.get("joint_chi_square_p") is None:
            parts.append("These results have no test of all differences together; run again.")
    yield Finding(
        question=CHECKED,
        state=HOLDS if tests else UNTESTED,
        answer=" ".join(parts),
        passed="No difference, no mean and no spread is significant.",
        tests=tuple(tests),
    )


CHECKED = "Independent check points"


def _of_adjustment(material: Material) -> pd.DataFrame:
    """Return the check points of the decisive adjustments, without blunders."""
    points = material.found.check_points
    methods = {"/".join(name.split("/")[:2]) for name in material.decisive}
    return points[(points["stage"] + "/" + points["method"]).isin(methods)]


def _ratios(points: pd.DataFrame) -> Array:
    """Return the differences of points over their sigma, shape (n, 3)."""
    d = points[[f"d_{axis}_m" for axis in AXES]].to_numpy(dtype=float)
    ratios: Array = d / points[[f"sigma_{axis}_m" for axis in AXES]].to_numpy(dtype=float)
    return ratios


def _largest(points: pd.DataFrame) -> str:
    """Return the largest difference in words."""
    ratios = np.abs(_ratios(points))
    i, axis = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    row, name = points.iloc[int(i)], AXES[axis]
    d, sigma = row[f"d_{name}_m"], row[f"sigma_{name}_m"]
    return f"the largest difference is {d:+.2f} ± {sigma:.2f} m in {name}, of {row['point']}"


def _single_tests(points: pd.DataFrame) -> Iterator[ChanceTest]:
    """Yield one test of the largest of many differences, by Bonferroni."""
    if len(points):
        ratios = np.abs(_ratios(points))
        p = 2 * statistics.norm_sf(float(ratios.max())) * ratios.size
        yield ChanceTest(
            name="largest difference at a single check point",
            p=min(1.0, p),
            said=f"a single check point: {_largest(points)}",
        )


def _together(entry: Mapping[str, Any]) -> Iterator[ChanceTest]:
    if entry.get("joint_chi_square_p") is not None:
        larger = entry["joint_chi_square"] > entry["joint_dof"]
        yield ChanceTest(
            name="all differences together",
            p=entry["joint_chi_square_p"],
            said=f"all differences together are {'larger' if larger else 'smaller'} than predicted",
        )
    if (entry.get("redundancy") or 0) > 0:
        closer = entry["sigma0_squared"] < 1
        yield ChanceTest(
            name="rays of the check points",
            p=entry["chi_square_p"],
            said=f"rays meet {'more' if closer else 'less'} closely than predicted "
            f"(σ₀² = {entry['sigma0_squared']:.2f})",
            size=off_by(np.sqrt(entry["sigma0_squared"])),
            limit=MATTERS,
        )


def _means(points: Mapping[str, Any]) -> Iterator[ChanceTest]:
    """Yield the tests of the means, each with its own sigma."""
    for mean, sigma, axis in zip(points["mean"], points["mean_sigma"], AXES, strict=True):
        yield ChanceTest(
            name=f"mean in {axis}",
            p=2 * statistics.norm_sf(abs(mean) / sigma),
            said=f"a mean of {mean:+.2f} ± {sigma:.2f} m in {axis}",
        )


def _spreads(points: Mapping[str, Any]) -> Iterator[ChanceTest]:
    """Yield the tests of the RMS of differences over their sigma, two-sided."""
    by_axis = zip(points["normalised_rms"], points["effective_number"], AXES, strict=True)
    for ratio, n, axis in by_axis:
        yield ChanceTest(
            name=f"spread in {axis}",
            p=rms_p(ratio, n),
            said=f"an RMS in {axis} that is {ratio:.3f} times the predicted one",
            size=off_by(ratio),
            limit=MATTERS,
        )


def _said(material: Material) -> Iterator[Finding]:
    """Repeat the run's messages: methods left out, notes of stages and of the flight."""
    lines = [*_sentences(material, "left_out"), *_sentences(material, "notes")]
    lines += list(material.flight.notes)
    if lines:
        answer = "; ".join(dict.fromkeys(lines))
        answer += "" if answer.endswith("…") else "."
        yield Finding(question="Said by the run", state=NOTE, answer=answer)


# --- What a finding that fails means for the user of a calibration, and what to do


class _Consequence(NamedTuple):
    """Meaning and cure of a failed question; both continue a sentence."""

    means: str
    cure: str


TEXT = Path(__file__).with_name("consequences.md")

CONSEQUENCES = {
    question: _Consequence(*text.split("\n\n")) for question, text in sections(TEXT).items()
}
"""By question, the gravest first; the first meaning covers the later ones, too."""

UNKNOWN = _Consequence("the results must not be used before the cause is known", "see below")


def _by_gravity(questions: Iterable[str]) -> list[str]:
    """Sort failed questions, the gravest first; unknown questions come before all others."""
    order = list(CONSEQUENCES)
    return sorted(questions, key=lambda q: order.index(q) if q in order else -1)


# --- The questions in their order; the statement in one sentence, and as a table


QUESTIONS = (
    *(_one_flight, _converged, _contradictions, _determined, _weak, _global_test, _weights),
    *(_estimated_weights, _apart, _gross_errors, _controlled, _stable, _earlier, _mountings),
    *(_heights, _held, _check_points, _refined, _other_methods, _said),
)

STATES = {
    HOLDS: "✓ holds",
    MINOR: "≈ rejected, below {}",
    FAILS: "✗ fails",
    UNTESTED: "– not tested",
    NOTE: "• note",
}


def _result(finding: Finding) -> str:
    """Return the state in words; of `MINOR` with the sizes from which it matters."""
    minor = [_measure(t.limit, t.unit) for t in finding.tests if t.state == MINOR]
    return STATES[finding.state].format(listed([*dict.fromkeys(minor)]))


def findings(material: Material) -> list[Finding]:
    """Return the findings on all applicable questions, their tests judged at one level."""
    return judged(finding for question in QUESTIONS for finding in question(material))


NOT_EXAMINED = (
    "sharpness and resolving power (MTF)",
    "radiometry: linearity, noise, vignetting, colour",
    "defective pixels, smear, and the readout of a rolling shutter",
    "the camera at temperatures, pressures and focus settings other than those of the flight",
    "the stability of the camera after the flight",
)
"""Properties in certificates of mapping cameras that a flight over control cannot show."""


def section(found: Sequence[Finding]) -> Text:
    """Return the section with the verdict and all answers."""
    answers = table(
        verdict_table(found), "What holds and what does not", name="tab-report-verdict",
        obtained=OBTAINED,
    )  # fmt: skip
    not_examined = "; ".join(NOT_EXAMINED)
    return show(
        statement(found),
        answers,
        "**What was not examined.** A flight over control points shows the geometry of the images "
        f"alone. This calibration says nothing of: {not_examined}.",
    )


OBTAINED = (
    "tests of the results, each as its explanation says; p is the smallest probability of a test "
    "by itself, p joint the same among all tests of this report, by Holm"
)


def statement(found: Sequence[Finding]) -> str:
    """Return the verdict as Markdown: failures, their meaning and their cure."""
    failed = [f.question for f in found if f.state == FAILS]
    if not failed and not _all_tests(found):
        return (
            "**Nothing was tested.** These results hold nothing that could be compared with what "
            "is expected of it, so this report neither confirms nor refutes them."
        )
    if not failed:
        limits = [f.restriction for f in found if f.state == MINOR and f.restriction]
        said = "The results hold, with a restriction" if limits else "The results hold"
        return "\n\n".join([f"**{said}.** {_level(found)}", *(f"**{limit}.**" for limit in limits)])
    causes = [f.question for f in found if f.state == FAILS and f.is_cause]
    gravest, *less_grave = dict.fromkeys([*causes, *_by_gravity(failed)])
    means, cure = CONSEQUENCES.get(gravest, UNKNOWN)
    whole = f"**Not everything holds. “{gravest}” fails: {means}; {cure}.**"
    others = "\n".join(
        f"- “{q}” fails, too: {CONSEQUENCES.get(q, UNKNOWN).cure}." for q in less_grave
    )
    return "\n\n".join(part for part in (whole, others, _level(found)) if part)


def _level(found: Sequence[Finding]) -> str:
    """State the number of tests, and the probability that right results fail any."""
    tests = _all_tests(found)
    n, minor = (sum(test.state == state for test in tests) for state in (FAILS, MINOR))
    if not tests:
        return "No statistical test was made."
    rejected = f"; {minor} rejected, but below the size that matters" if minor else ""
    return (
        f"{n or 'None'} of {plural(len(tests), 'test')} {'fails' if n < 2 else 'fail'}{rejected}. "
        f"The tests share an error probability of {100 * LEVEL:g} % (Holm): of right results with "
        f"right standard deviations, at most {100 * LEVEL:g} % fail any of them."
    )


def verdict_table(found: Sequence[Finding]) -> pd.DataFrame:
    """Return the table of findings, failures first."""
    order = sorted(found, key=lambda f: (f.state != FAILS, f.state != MINOR, not f.is_cause))
    rows = [(f.question, _result(f), _p(f.p), _p(f.p_joint), f.answer) for f in order]
    return pd.DataFrame(rows, columns=["Question", "Result", "p", "p joint", "Explanation"])


def _p(p: float) -> str:
    return "" if np.isnan(p) else p_value(p)
