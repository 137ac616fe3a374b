"""What the results are held against: declared mountings, heights, independent check points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from acx4book.report.material import (
    Material,
    checked_points,
    earlier_calibrations,
    sentences,
    validated,
)
from acx4book.report.verdict.finding import FAILS, HOLDS, NOTE, ChanceTest, Finding, matters
from acx4book.report.words import begun, plural
from acx4lib.calibration.estimates import LIMIT_SCALE, SIGMAS_OF_SCALE
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares.statistical import distributions
from acx4lib.results import folder as results

FEWEST = 2
"""Number of check points from which something can be said of them."""


def mountings(material: Material) -> Iterator[Finding]:
    """Tell whether the estimated mountings are those that were declared.

    A value with sigma is tested; one without is an approximation, of which only a known mistake
    fails.
    """
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
        yield Finding(question=question, state=NOTE, answer=note or _not_compared(material))


@dataclass(frozen=True, kw_only=True)
class _Part:
    """A declared part of a mounting: its known mistake, its test, or how far off it is."""

    mistaken: str = ""
    test: ChanceTest | None = None
    approximate: str = ""


def _parts(material: Material, name: str) -> Iterator[_Part]:
    """Yield the declared parts that an adjustment compared."""
    entry = material.found.summary[name]
    declared = entry.get("declared")
    compared = declared if isinstance(declared, dict) else {}
    if any("told" not in one for one in compared.values()):  # of an earlier version
        yield from (_Part(mistaken=line) for line in results.messages(entry, "not_confirmed"))
    for place, one in compared.items():
        camera, _, part = place.rpartition("/")
        title, mistake = f"{part.replace('_', ' ')} of {camera}", one.get("mistake", "")
        said = f"{title} {one.get('told', 'differs from the declared one')}"
        if mistake:
            yield _Part(mistaken=f"{said}; {mistake}" if one["told"] else f"{title} {mistake}")
        if one.get("p") is not None:
            yield _Part(test=ChanceTest(name=title, p=float(one["p"]), said=said))
        elif one["confirmed"]:
            yield _Part(approximate=said)


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


def earlier(material: Material) -> Iterator[Finding]:
    """Tell of which earlier flight the calibration is that was validated, if it was asked for."""
    told = earlier_calibrations(material)
    if not told:
        return
    said = told[validated(material)]
    flown = f", flown {said['flown']}" if said.get("flown") else ""
    answer = (
        f"Validated is the calibration {said['method']} of an earlier flight, "
        f"{said['flight']['name']} (SHA-256 {said['flight']['sha256'][:12]}{flown}); computed "
        f"{said['computed']}, results {said['results']} with SHA-256 {said['sha256'][:12]}."
    )
    yield Finding(question="Calibration of an earlier flight", state=NOTE, answer=answer)


def heights(material: Material) -> Iterator[Finding]:
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


def check_points(material: Material) -> Iterator[Finding]:
    """Test the differences at check points, those of the validation with their full covariance."""
    entry: Mapping[str, Any] = material.found.summary.get(validated(material), {})
    single = _of_adjustment(material)
    few = (entry.get("n_points") or 0) < FEWEST
    if few:
        single = pd.concat([single, checked_points(material)])
    single = single.iloc[np.flatnonzero(np.isfinite(_ratios(single)).all(axis=1))]
    if few and single.empty:
        answer = "There are no check points, so the accuracy on the ground is not shown."
        yield Finding(question=CHECKED, state=NOTE, answer=answer)
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
        state=HOLDS if tests else NOTE,
        answer=" ".join(parts),
        passed="No difference, no mean and no spread is significant.",
        tests=tuple(tests),
    )


CHECKED = "Independent check points"


def _of_adjustment(material: Material) -> pd.DataFrame:
    """Return the check points that take no part in the decisive adjustments, all but blunders."""
    found = material.found.check_points
    own = {"/".join(name.split("/")[:2]) for name in material.decisive}
    return found[(found["stage"] + "/" + found["method"]).isin(own)]


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
        p = 2 * distributions.norm_sf(float(ratios.max())) * ratios.size
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
            relevant=matters(np.sqrt(entry["sigma0_squared"])),
        )


def _means(points: Mapping[str, Any]) -> Iterator[ChanceTest]:
    """Yield the tests of the means, each with its own sigma."""
    for mean, sigma, axis in zip(points["mean"], points["mean_sigma"], AXES, strict=True):
        yield ChanceTest(
            name=f"mean in {axis}",
            p=2 * distributions.norm_sf(abs(mean) / sigma),
            said=f"a mean of {mean:+.2f} ± {sigma:.2f} m in {axis}",
        )


def _spreads(points: Mapping[str, Any]) -> Iterator[ChanceTest]:
    """Yield the tests of the RMS of differences over their sigma, two-sided."""
    found = zip(points["normalised_rms"], points["effective_number"], AXES, strict=True)
    for ratio, n, axis in found:
        square = n * ratio**2
        below, above = distributions.chi2_cdf(square, n), distributions.chi2_sf(square, n)
        yield ChanceTest(
            name=f"spread in {axis}",
            p=2 * min(below, above),
            said=f"an RMS in {axis} that is {ratio:.2f} times the predicted one",
        )


def said(material: Material) -> Iterator[Finding]:
    """Repeat what the run said: methods left out, notes of stages and of the flight."""
    lines = [*sentences(material, "left_out"), *sentences(material, "notes")]
    lines += list(material.flight.notes)
    if lines:
        answer = "; ".join(dict.fromkeys(lines))
        answer += "" if answer.endswith("…") else "."
        yield Finding(question="Said by the run", state=NOTE, answer=answer)
