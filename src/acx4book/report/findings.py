"""The questions of a report: each with its tests, its answer, or the reason why there is none."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from acx4book.report import held
from acx4book.report.groups import DECLARED, qualities
from acx4book.report.material import Material, checked_points, earlier_calibrations, validated
from acx4book.report.verdict import NOTE, ChanceTest, Finding, judged
from acx4book.report.words import adjustment_title, begun, listed, parameter_title, plural
from acx4files.results.folder import messages, rows
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.calibration.estimates import LIMIT_SCALE, SIGMAS_OF_SCALE
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing.accuracy import rms_p
from acx4lib.least_squares import statistics
from acx4lib.least_squares.verdict import (
    FAILS,
    HOLDS,
    MATTERS,
    UNTESTED,
    off_by,
)

# --- what holds of the adjustments by themselves ---------------------------------------------

AGAIN = "These results of an earlier version have no such test; run again."
"""Reason of a question that is not tested."""


def _sure(question: str, wrong: Iterable[str], right: str) -> Finding:
    """Return the finding of a question that does not depend on chance."""
    lines = [*dict.fromkeys(wrong)]
    return Finding(
        question=question,
        state=FAILS if lines else HOLDS,
        answer=_joined(lines) if lines else right,
    )


def _joined(lines: Iterable[str]) -> str:
    text = "; ".join(lines)
    return text if text.endswith("…") else f"{text}."


def _messages(material: Material, names: Iterable[str], *keys: str) -> list[str]:
    """Return the run's messages on some of its parts."""
    return [line for key in keys for n in names for line in messages(material.entry(n), key)]


def _certified(material: Material) -> list[str]:
    """Return the names of the certified parts: the decisive adjustments and their validation."""
    names = (*material.decisive, validated(material))
    return [name for name in names if name in material.found.summary]


def _computed(material: Material) -> Iterator[Finding]:
    """Tell whether all stages read the same files and all adjustments have a solution."""
    digest, stages = material.provenance.digest, material.provenance.stages
    yield _sure(
        "One state of the data",
        [
            f"the flight was changed after {name} had run; its results are of other files"
            for name, run in stages.items()
            if run["flight"] != digest
        ],
        "Every stage was computed from the files listed below, which are unchanged since.",
    )
    failed = [
        f"no solution for {adjustment_title(name)}"
        for name, entry in material.found.summary.items()
        if entry.get("converged") is False and not messages(entry, "left_out")
    ]
    n = len(material.adjustments)
    if n or failed:
        yield _sure("Convergence", failed, f"{plural(n, 'adjustment')} computed, all converged.")
    stopped = _messages(material, _certified(material), "stopped")
    if n or stopped:
        none = "Of no group would data snooping reject more than single observations."
        yield _sure("Observations agree with each other", stopped, none)


def _determined(material: Material) -> Iterator[Finding]:
    """Tell whether every parameter of the certified adjustments is determined."""
    question = "All parameters determined"
    lines = _messages(material, material.decisive, "not_determined")
    if material.decisive and material.found.parameters.empty and not lines:
        answer = "No parameter of a camera was estimated."
        yield Finding(question=question, state=UNTESTED, answer=answer)
    elif material.decisive:
        right = "The σ of every estimated parameter is below the limit of determined."
        yield _sure(question, lines, right)


def _global_test(material: Material) -> Iterator[Finding]:
    """Test the variance of unit weight of the decisive adjustments."""
    tests, values = [], []
    for name in material.decisive:
        entry, title = material.entry(name), adjustment_title(name)
        if not int(entry["redundancy"]) > 0:
            continue
        values.append(sigma0_sq := float(entry["sigma0_squared"]))
        size = "larger" if sigma0_sq > 1 else "smaller"
        said = (
            f"{title} (σ₀² = {sigma0_sq:.2f}): residuals are {size} than their a priori σ promise"
        )
        p, ratio = float(entry["chi_square_p"]), float(np.sqrt(sigma0_sq))
        tests.append(_of_ratio(f"σ₀² of {title}", p, ratio, said))
    if tests:
        span = dict.fromkeys(f"{value:.3f}" for value in (min(values), max(values)))
        yield Finding(
            question="Global χ² test",
            answer=f"The variance of unit weight is {' to '.join(span)}.",
            passed="Residuals have the size that the a priori σ promise.",
            tests=tuple(tests),
        )


def _of_ratio(name: str, p: float, ratio: float, said: str) -> ChanceTest:
    """Return a test of errors over their σ, which matters where they differ by `MATTERS`."""
    return ChanceTest(name=name, p=p, said=said, size=off_by(ratio), limit=MATTERS)


def _weights(material: Material) -> Iterator[Finding]:
    """Test the a priori standard deviations of every group of observations."""
    tests = []
    for g in qualities(material):
        if g.group in DECLARED:
            continue
        times = g.ratio if g.ratio > 1 else 1 / max(g.ratio, 1e-9)
        name = f"{g.group} of {adjustment_title(g.adjustment)}"
        said = (
            f"{name}: σ is {times:.3g} times too {'small' if g.ratio > 1 else 'large'} (stated "
            f"{g.sigma:.2g} {g.unit}, by the residuals {g.sigma * g.ratio:.2g} {g.unit})"
        )
        tests.append(_of_ratio(name, g.p, g.ratio, said))
    if tests:
        yield Finding(
            question="A priori standard deviations",
            passed="Those of all groups of observations agree with the residuals.",
            tests=tuple(tests),
        )


def _estimated_weights(material: Material) -> Iterator[Finding]:
    """Tell whether σ that were estimated from the residuals are within their bounds."""
    factors = [
        factor.get("applied")
        for name in material.decisive
        for factor in (material.entry(name).get("sigma_factors") or {}).values()
    ]
    if any(applied not in (None, 1.0) for applied in factors):
        yield _sure(
            "Estimated weights within bounds",
            _messages(material, material.found.summary, "sigma_beyond"),
            "σ were multiplied by factors from the residuals, as flight.toml asks; none is outside "
            "its bounds by more than chance.",
        )


def _apart(material: Material) -> Iterator[Finding]:
    """Tell which parameters are only determined together."""
    if not material.calibration:
        return
    pairs = material.entry(material.calibration).get("correlated") or ()
    several = len({name.rpartition("/")[0] for pair in pairs for name in pair[:2]}) > 1
    told = [
        f"{parameter_title(one, several)} and {parameter_title(other, several)} ({rho:+.2f})"
        for one, other, rho in pairs
    ]
    said = f"{listed(told)} correlate strongly: use them together, with their covariance."
    yield Finding(
        question="Parameters told apart",
        state=NOTE if told else HOLDS,
        answer=said if told else "No two parameters correlate strongly.",
    )


def _gross_errors(material: Material) -> Iterator[Finding]:
    """Compare number and size of the rejected observations with what chance rejects."""
    names = [n for n in _certified(material) if material.entry(n).get("n_rejected") is not None]
    if not names:
        return
    question, entries = "Gross errors", [material.entry(name) for name in names]
    expected = [entry.get("expected_rejections") for entry in entries]
    answer = AGAIN if None in expected else ""
    if _messages(material, names, "stopped"):
        answer = "Observations contradict each other, so rejections say nothing."
    if answer:
        yield Finding(question=question, state=UNTESTED, answer=answer)
        return
    n = sum(int(entry["n_rejected"]) for entry in entries)
    of = sum(int(entry["n_observations"]) for entry in entries)
    chance = sum(float(number) for number in expected if number is not None)
    methods = dict.fromkeys("/".join(name.split("/")[:2]) for name in _certified(material))
    rejected = pd.concat([rows(material.found, "rejected", m) for m in methods], ignore_index=True)
    largest, where = 0.0, ""
    if len(rejected):
        worst = rejected.iloc[int(rejected["statistic"].abs().argmax())]
        largest, kind = abs(float(worst["statistic"])), str(worst["kind"]).replace("_", " ")
        where = f"{kind} {worst['image_or_exposure']} {worst['point']}".replace("  ", " ").strip()
    yield Finding(
        question=question,
        state=HOLDS,
        answer=f"{n:,} of {of:,} observations taken out as gross errors, "
        f"where chance alone takes out {chance:.1f}"
        + ("; they are listed in rejected.csv." if n else "."),
        tests=(
            ChanceTest(
                name="number of rejections",
                p=_poisson_sf(_n_affected(rejected), chance),
                said=f"{plural(n, 'observation')} rejected, where chance takes out {chance:.1f}",
            ),
            ChanceTest(
                name="largest rejected residual",
                p=_largest_p(largest, chance),
                said=f"the largest is w = {largest:.1f} ({where})",
            ),
        ),
    )


def _n_affected(rejected: pd.DataFrame) -> int:
    """Return the number of affected points and exposures of every stage.

    One error may take out several rays of its point, which control each other.
    """
    place = rejected["point"].where(
        rejected["point"].astype(str) != "", rejected["image_or_exposure"]
    )
    return len({*zip(rejected["stage"], rejected["kind"], place.astype(str), strict=True)})


def _poisson_sf(n: int, chance: float) -> float:
    """Return the probability of n rejections or more, given the number expected by chance."""
    return statistics.chi2_cdf(2 * chance, 2 * n) if n else 1.0


def _largest_p(w: float, chance: float) -> float:
    """Return the probability of a residual of w or more among all that were tested."""
    n = chance / (2 * statistics.norm_sf(CRITICAL))
    single_p = 2 * statistics.norm_sf(max(w, 0.0))
    return float(-np.expm1(n * np.log1p(-single_p))) if single_p < 1 else 1.0


TURNS = {"strips": "differences between strips", "drift": "drift"}


def _stable(material: Material) -> Iterator[Finding]:
    """Test the boresight for a drift and for steps between strips."""
    if not material.certified:
        return
    entry = material.entry(material.certified)
    told = entry.get("boresight_stability")
    tests = tuple(
        ChanceTest(name=name, p=float(told[key]["p"]), said=_turned(told[key]))
        for key, name in TURNS.items()
        if isinstance(told, dict) and told.get(key)
    )
    why = "It needs attitudes of two strips or of several times, and more of them than turns."
    if not isinstance(told, dict):
        why = AGAIN
    elif messages(entry, "stopped"):
        why = "Observations contradict each other."
    yield Finding(
        question="Boresight stable over time",
        state=HOLDS if tests else UNTESTED,
        answer="" if tests else why,
        passed="No significant drift and no significant differences between strips.",
        tests=tests,
    )


def _turned(test: Mapping[str, Any]) -> str:
    """Return a sentence on the largest turn relative to its sigma."""
    turns, sigma = (np.array(test[key], dtype=float) for key in ("turns_deg", "sigma_deg"))
    i, axis = np.unravel_index(int(np.argmax(np.nan_to_num(np.abs(turns / sigma)))), turns.shape)
    size = f"{turns[i, axis]:+.4f}° ± {sigma[i, axis]:.4f}° about {'xyz'[axis]}"
    if len(test["names"]) == 1:
        return f"a drift, most of all {size} from the first exposure to the last"
    return f"differences between strips, most of all {size} of strip {test['names'][i]}"


# --- what the results are held against -------------------------------------------------------

HELD = "Held values"

RESTRICTION = (
    "The calibrations of the single heads can be used for their relative orientation and the "
    "synthetic image, where what they hold changes less than matters. Their xₚ, yₚ, ω and φ are "
    f"not those of the cameras: they take up the values that are held (“{HELD}”)."
)


def _held(material: Material) -> Iterator[Finding]:
    """Test the values at which adjustments hold parameters, and what they change."""
    stages = held.tested(material)
    if not stages:
        if material.decisive:
            yield Finding(question=HELD, state=UNTESTED, answer=AGAIN)
        return
    parts, tests, rejected = [], [], {}
    for stage, names in stages.items():
        told = held.values(material, names)
        rejected[stage] = keys = held.rejected(material, names)
        if keys:
            lines = ", ".join(held.freeing(material, stage, keys))
            said = "; ".join(held.in_words(key, told[key]) for key in keys)
            parts.append(f"{said}. To free {'it' if len(keys) == 1 else 'them'}: {lines}.")
        size, limit, unit = held.effect(material, stage, names)
        of = f"held values of {'the heads' if stage == 'heads' else adjustment_title(names[0])}"
        known = np.isfinite(size)
        test = ChanceTest(
            name=of,
            p=held.joint_p(told),
            said=of if known else f"{of}, whose effect on a synthetic image is not known",
            size=size,
            limit=limit,
            unit=unit if known else "%",
        )
        tests += [test] if np.isfinite(test.p) else []
    none = "The data reject no value at which an adjustment holds a parameter."
    yield Finding(
        question=HELD,
        state=HOLDS if tests else UNTESTED,
        answer=" ".join(parts) if tests else "The data cannot tell any of them.",
        passed="Among all tests of this report none of this is significant." if parts else none,
        tests=tuple(tests),
        restriction=RESTRICTION if rejected.get("heads") else "",
        is_cause=any(held.explains(material, name) for names in stages.values() for name in names),
    )


def _mountings(material: Material) -> Iterator[Finding]:
    """Compare the estimated mountings with the declared ones."""
    mistakes, approximate, tests = [], [], []
    for title, told, compared in _declared(material):
        if mistake := compared.get("mistake"):
            mistakes.append(f"{title} {told}; {mistake}" if told else f"{title} {mistake}")
        if compared.get("p") is not None:
            test = ChanceTest(name=title, p=float(compared["p"]), said=f"{title} {told}")
            tests.append(test)
        elif compared["confirmed"]:
            approximate.append(f"{title} {told}")
    parts = [_joined(mistakes)] if mistakes else []
    if approximate:
        parts.append(f"Without σ it is an approximation and not tested: {_joined(approximate)}")
    if not (parts or tests):
        parts.append(_not_compared(material))
    if mistakes or tests or material.calibration:
        yield Finding(
            question="Declared mounting confirmed",
            state=FAILS if mistakes else HOLDS if tests else UNTESTED,
            answer=" ".join(parts),
            passed="What flight.toml declares with σ agrees with the estimates.",
            tests=tuple(tests),
        )


def _declared(material: Material) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Yield the declared parts, what the run told of them, and how they compare."""
    for name in material.decisive:
        for place, compared in (material.entry(name).get("declared") or {}).items():
            camera, _, part = place.rpartition("/")
            yield f"{part.replace('_', ' ')} of {camera}", compared.get("told", ""), compared


def _not_compared(material: Material) -> str:
    """Return why no declared mounting was compared."""
    if not any(any(camera.prior.declared) for camera in material.flight.cameras.values()):
        return (
            "flight.toml declares no mounting. A delay, an undulation or another north would be "
            "absorbed by lever arm and boresight without a trace."
        )
    if messages(material.entry(material.calibration), "stopped"):
        return "Not compared: observations contradict each other."
    return "Not compared: what flight.toml declares is held, or not determined."


def _earlier(material: Material) -> Iterator[Finding]:
    """Name the earlier flight of the validated calibration, if it is not from this flight."""
    if of := earlier_calibrations(material).get(validated(material)):
        flown = f", flown {of['flown']}" if of.get("flown") else ""
        answer = (
            f"Validated is the calibration {of['method']} of an earlier flight, "
            f"{of['flight']['name']} (SHA-256 {of['flight']['sha256'][:12]}{flown}); computed "
            f"{of['computed']}, results {of['results']} with SHA-256 {of['sha256'][:12]}."
        )
        yield Finding(question="Calibration of an earlier flight", state=NOTE, answer=answer)


def _heights(material: Material) -> Iterator[Finding]:
    """Tell whether control, trajectory and check points have heights of one system."""
    offsets = {
        name: float(material.entry(name)[key])
        for name in _certified(material)
        for key in ("height_scale_error", "height_offset_share")
        if material.entry(name).get(key) is not None
    }
    if not offsets:
        return
    worst = max(offsets, key=lambda name: abs(offsets[name]))
    off, sigma = abs(offsets[worst]), float(material.entry(worst).get("height_scale_sigma") or 0)
    wrong = off > max(LIMIT_SCALE, SIGMAS_OF_SCALE * sigma)
    answer = (
        f"Heights of points differ from those of the trajectory by {100 * off:.2g} % of the flying "
        f"height in {worst}; more than {100 * LIMIT_SCALE:g} % is another height system or a wrong "
        "focal length."
    )
    if off > LIMIT_SCALE and not wrong:
        answer += f" It is not significant here: the σ of the focal length is {100 * sigma:.2g} %."
    question = "Heights of one system"
    yield Finding(question=question, state=FAILS if wrong else HOLDS, answer=answer)


CHECKED = "Independent check points"

FEWEST = 2
"""Smallest number of check points for their statistics."""


def _check_points(material: Material) -> Iterator[Finding]:
    """Test the differences at check points, those of the validation with their full covariance."""
    entry = material.entry(validated(material))
    few = (entry.get("n_points") or 0) < FEWEST
    points = material.found.check_points
    methods = {"/".join(name.split("/")[:2]) for name in material.decisive}
    single = points[(points["stage"] + "/" + points["method"]).isin(methods)]
    if few:
        single = pd.concat([single, checked_points(material)])
    single = single.iloc[np.flatnonzero(np.isfinite(_ratios(single)).all(axis=1))]
    parts, tests = [], []
    if len(single):
        largest, p = _largest(single)
        said = f"a single check point: {largest}"
        tests.append(ChanceTest(name="largest difference at a single check point", p=p, said=said))
        number = begun(plural(len(single), "check point"))
        parts.append(f"{number}{'' if few else ' more'}, tested one by one: {largest}.")
    elif few:
        parts.append("There are no check points, so the accuracy on the ground is not shown.")
        if entry.get("rays_rms_px") is not None:
            parts.append(
                f"Of {plural(entry['n_exposures'], 'exposure')} that took no part in the "
                f"calibration, rays meet within {entry['rays_rms_px']:.2f} px, and positions are "
                f"off by {by_axis(entry['position_rms_m'])} (RMS); the variance of unit weight is "
                f"{entry['sigma0_squared']:.3f}."
            )
    if not few:
        rms = by_axis(entry["points"]["rms"])
        parts.insert(0, f"RMS at {entry['n_points']} points: {rms}.")
        tests += [*_together(entry), *_by_axis(entry["points"])]
        if entry.get("joint_chi_square_p") is None:
            parts.append(AGAIN)
    yield Finding(
        question=CHECKED,
        state=HOLDS if tests else UNTESTED,
        answer=" ".join(parts),
        passed="No difference, no mean and no spread is significant.",
        tests=tuple(tests),
    )


def by_axis(lengths: Sequence[float]) -> str:
    """Return three lengths in m with their axes."""
    return ", ".join(f"{m:.2f} m in {axis}" for m, axis in zip(lengths, AXES, strict=True))


def _ratios(points: pd.DataFrame) -> Array:
    """Return the differences of points over their sigma, shape (n, 3)."""
    d = points[[f"d_{axis}_m" for axis in AXES]].to_numpy(dtype=float)
    ratios: Array = d / points[[f"sigma_{axis}_m" for axis in AXES]].to_numpy(dtype=float)
    return ratios


def _largest(points: pd.DataFrame) -> tuple[str, float]:
    """Return the largest difference in words, and its probability among all, by Bonferroni."""
    ratios = np.abs(_ratios(points))
    i, k = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    row, axis = points.iloc[int(i)], AXES[k]
    size = f"{row[f'd_{axis}_m']:+.2f} ± {row[f'sigma_{axis}_m']:.2f} m in {axis}"
    p = 2 * statistics.norm_sf(float(ratios.max())) * ratios.size
    return f"the largest difference is {size}, of {row['point']}", min(1.0, p)


def _together(entry: Mapping[str, Any]) -> Iterator[ChanceTest]:
    if entry.get("joint_chi_square_p") is not None:
        larger = entry["joint_chi_square"] > entry["joint_dof"]
        yield ChanceTest(
            name="all differences together",
            p=entry["joint_chi_square_p"],
            said=f"all differences together are {'larger' if larger else 'smaller'} than predicted",
        )
    if (entry.get("redundancy") or 0) > 0:
        sigma0_sq = entry["sigma0_squared"]
        closely = f"{'more' if sigma0_sq < 1 else 'less'} closely than predicted"
        said = f"rays meet {closely} (σ₀² = {sigma0_sq:.2f})"
        ratio = float(np.sqrt(sigma0_sq))
        yield _of_ratio("rays of the check points", entry["chi_square_p"], ratio, said)


def _by_axis(points: Mapping[str, Any]) -> Iterator[ChanceTest]:
    """Yield the tests of the means, and of the RMS of differences over their sigma, two-sided."""
    for k, axis in enumerate(AXES):
        mean, sigma = points["mean"][k], points["mean_sigma"][k]
        p = 2 * statistics.norm_sf(abs(mean) / sigma)
        said = f"a mean of {mean:+.2f} ± {sigma:.2f} m in {axis}"
        yield ChanceTest(name=f"mean in {axis}", p=p, said=said)
    for k, axis in enumerate(AXES):
        ratio = points["normalised_rms"][k]
        p = rms_p(ratio, points["effective_number"][k])
        said = f"an RMS in {axis} that is {ratio:.3f} times the predicted one"
        yield _of_ratio(f"spread in {axis}", p, ratio, said)


# --- what is not tested, and what the run said -----------------------------------------------


def _refined(material: Material) -> Iterator[Finding]:
    """Say why the fit of matched points between heads is not tested, and what takes its place."""
    refined = material.entry("synthetic/refined").get("sigma0_squared")
    if refined is not None:
        answer = (
            f"σ₀² = {refined:.2f} is not tested against one: the σ of a matched point holds the "
            "noise of its pixels alone, not what lenses, relief and shutters leave between two "
            f"heads. Instead σ₀ = {np.sqrt(refined):.2f} multiplies the σ of the refined heads."
        )
        yield Finding(question="Heads refined by tie points", state=UNTESTED, answer=answer)


def _notes(material: Material) -> Iterator[Finding]:
    """Repeat the run's messages: weak parameters, methods without certificate, notes."""
    certified, summary = _certified(material), material.found.summary
    weak = [line.partition(": ")[2] for line in _messages(material, certified, "weak")]
    others = [name for name in summary if name not in certified]
    left_open = _messages(material, others, "not_determined", "stopped")
    left_open += ["this report does not certify these methods"] if left_open else []
    told = [*_messages(material, summary, "left_out", "notes"), *material.flight.notes]
    told = [line for line in told if line not in left_open]
    by_question = {"Weak parameters": weak, "Other methods": left_open, "Said by the run": told}
    for question, lines in by_question.items():
        if lines:
            yield Finding(question=question, state=NOTE, answer=_joined(dict.fromkeys(lines)))


QUESTIONS = (
    *(_computed, _determined, _global_test, _weights),
    *(_estimated_weights, _apart, _gross_errors, _stable, _earlier, _mountings),
    *(_heights, _held, _check_points, _refined, _notes),
)


def findings(material: Material) -> list[Finding]:
    """Return the findings on all applicable questions, their tests judged at one level."""
    return judged(finding for question in QUESTIONS for finding in question(material))
