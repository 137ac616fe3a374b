"""What the results are held against: declared mountings, heights, independent check points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from acx4book.report.adjustment.groups import PROBABILITY
from acx4book.report.material import Material, earlier_calibrations, sentences, validated
from acx4book.report.verdict.finding import FAILS, HOLDS, LIMIT_P, NOTE, Finding
from acx4book.report.words import listed
from acx4lib.calibration.estimates import LIMIT_SCALE
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing.accuracy import rms_limits
from acx4lib.least_squares.statistical import distributions

FEWEST = 2
"""Number of check points from which something can be said of them."""


def mountings(material: Material) -> Iterator[Finding]:
    """Tell whether the estimated mountings are those that were declared."""
    question = "Declared mounting confirmed"
    objections = list(dict.fromkeys(sentences(material, "not_confirmed")))
    compared = [
        part for entry in material.found.summary.values() for part in _parts(entry.get("declared"))
    ]
    if objections:
        yield Finding(question=question, state=FAILS, answer="; ".join(objections) + ".")
    elif compared:
        answer = (
            f"The estimates of {listed(list(dict.fromkeys(compared)))} agree with what flight.toml "
            "declares. Where it declares no σ, only a difference as large as a mistake counts."
        )
        yield Finding(question=question, state=HOLDS, answer=answer)
    elif material.calibration:
        answer = (
            "flight.toml declares no mounting. A delay, an undulation or another north would be "
            "absorbed by lever arm and boresight without a trace."
        )
        yield Finding(question=question, state=NOTE, answer=answer)


def _parts(declared: object) -> list[str]:
    """Return the parts of mountings that were compared, in words."""
    names = declared if isinstance(declared, dict) else {}
    split = (name.rpartition("/") for name in names)
    return [f"the {part.replace('_', ' ')} of {camera}" for camera, _, part in split]


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
    wrong = abs(offsets[worst]) > LIMIT_SCALE
    answer = (
        f"Heights of points differ from those of the trajectory by {100 * abs(offsets[worst]):.2g} "
        f"% of the flying height in {worst}; more than {100 * LIMIT_SCALE:g} % is another height "
        "system or a wrong focal length."
    )
    yield Finding(question=question, state=FAILS if wrong else HOLDS, answer=answer)


def check_points(material: Material) -> Iterator[Finding]:
    """Test the differences at check points with their full covariance."""
    question = "Independent check points"
    entry: Mapping[str, Any] = material.found.summary.get(validated(material), {})
    points = entry.get("points") or {}
    if (entry.get("n_points") or 0) < FEWEST:
        answer = "There are no check points, so the accuracy on the ground is not shown."
        yield Finding(question=question, state=NOTE, answer=answer)
        return
    rms = ", ".join(f"{v:.2f} m in {axis}" for v, axis in zip(points["rms"], AXES, strict=True))
    answer = f"RMS at {entry['n_points']} points: {rms}."
    if entry.get("joint_chi_square_p") is None:
        answer += " These results have no test of all differences together; run again."
        yield Finding(question=question, state=NOTE, answer=answer)
        return
    odd = [*_odd_together(entry), *_odd_means(points), *_odd_spreads(points)]
    p = f"{entry['joint_chi_square_p']:.2g}"
    answer += f" All differences together, with their full covariance: p = {p}."
    answer += f" Significant: {listed(odd)}." if odd else " No mean and no spread is significant."
    yield Finding(question=question, state=FAILS if odd else HOLDS, answer=answer)


def _odd_together(entry: Mapping[str, Any]) -> Iterator[str]:
    if entry["joint_chi_square_p"] < LIMIT_P:
        yield "the differences together are not of the size that is predicted"
    if entry["chi_square_p"] < LIMIT_P:
        yield "rays do not meet as closely as predicted"


def _odd_means(points: Mapping[str, Any]) -> Iterator[str]:
    """Yield the axes in which the mean is more than chance, tested with its own sigma."""
    critical = -distributions.norm_ppf(LIMIT_P / 2)
    for mean, sigma, axis in zip(points["mean"], points["mean_sigma"], AXES, strict=True):
        if abs(mean) > critical * sigma:
            yield f"a mean of {mean:+.2f} m in {axis}"


def _odd_spreads(points: Mapping[str, Any]) -> Iterator[str]:
    """Yield the axes in which differences over their sigma have a spread outside its limits."""
    found = zip(points["normalised_rms"], points["effective_number"], AXES, strict=True)
    for ratio, n, axis in found:
        low, high = rms_limits(n, probability=PROBABILITY)
        if not low < ratio < high:
            yield f"{axis} {ratio:.2f} times the predicted RMS ({low:.2f} to {high:.2f} by chance)"


def said(material: Material) -> Iterator[Finding]:
    """Repeat what the run said: methods left out, notes of stages and of the flight."""
    lines = [*sentences(material, "left_out"), *sentences(material, "notes")]
    lines += list(material.flight.notes)
    if lines:
        answer = "; ".join(dict.fromkeys(lines))
        answer += "" if answer.endswith("…") else "."
        yield Finding(question="Said by the run", state=NOTE, answer=answer)
