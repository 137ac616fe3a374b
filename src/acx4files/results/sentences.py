"""Sentences on an adjustment, from the numbers of its diagnosis: for results and notebooks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib import shown
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.variance_components import Component
from acx4lib.calibration import trajectory_errors
from acx4lib.calibration.determination import CARRIED
from acx4lib.calibration.diagnosis import MOST, RESTS, Confirmation, Weak
from acx4lib.calibration.estimates import (
    ENOUGH,
    LIMIT_BORESIGHT_DEG,
    LIMIT_SCALE,
    Calibration,
    Parameter,
    features,
    from_bundle,
    is_determined,
    needed,
    parameters,
    reported_covariance,
)
from acx4lib.calibration.trajectory_errors import ByCourse
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES, BORESIGHT, LEVER_ARM
from acx4lib.georeferencing.validation import Prediction, Validation
from acx4lib.least_squares.covariance import correlation

SPEEDS = "strips flown at different speeds at one height, or the lever arm held"
"""The geometry that separates a delay of the positions from what correlates with it."""


# --- what is not determined, or weak ---------------------------------------------------------


def not_determined(calibration: Calibration, has: frozenset[str] = frozenset()) -> list[str]:
    """Return a sentence per undetermined parameter, or per group of heads with correlated ones.

    It names the standard deviation, the largest correlations and the geometry that helps.

    Parameters
    ----------
    calibration : Calibration
    has : frozenset of str
        Geometry of the flight, as `estimates.features` returns it; no sentence asks for it.
    """
    listed = parameters(calibration)
    related = correlation(reported_covariance(calibration))
    groups: list[list[int]] = []
    for i in np.flatnonzero(~is_determined(calibration)).tolist():
        for group in groups:
            p, q = listed[group[0]], listed[i]
            if (p.name, _how_well(p)) == (q.name, _how_well(q)) and related[group[0], i] > 0.99:
                group.append(i)
                break
        else:
            groups.append([i])
    out = []
    for group in groups:
        i, p = group[0], listed[group[0]]
        labels = [q.name if q.camera == p.camera else f"{q.name} of {q.camera}" for q in listed]
        named, others = f"{p.camera} {p.name}", _strongest(related[i], i, labels)
        if len(group) > 1:
            named = f"{p.name} of {', '.join(listed[j].camera for j in group)}"
            others = f"{min(related[i, j] for j in group):+.2f} with each other"
        how = f"{_how_well(p)}; correlation {others}"
        out.append(f"{named} is not determined ({how}); it would need: {needed(p.key, has)}")
    return out


def _how_well(p: Parameter) -> str:
    if np.isinf(p.sigma):
        return "left open by the observations"
    return f"sigma {p.sigma:.3g} {p.unit}"


def _strongest(row: Array, own: int, labels: Sequence[str]) -> str:
    """Return the two largest correlations of a parameter, with the others' names."""
    size = np.abs(row)
    size[own] = 0.0
    largest = np.argsort(-size, kind="stable")[:2]
    return ", ".join(f"{row[j]:+.2f} with {labels[j]}" for j in largest if j != own)


def trajectory_not_determined(bundle: Bundle, cov: Array | None = None) -> list[str]:
    """Return a sentence per undetermined error of the trajectory.

    Parameters
    ----------
    bundle : Bundle
    cov : ndarray, shape (n, n), optional
        Another one than `trajectory_errors.reported_covariance`.
    """
    listed = trajectory_errors.parameters(bundle, cov)
    if not listed:
        return []
    cameras = parameters(from_bundle(bundle))
    labels = [f"{p.camera} {p.name}" for p in cameras] + [p.name for p in listed]
    joint = trajectory_errors.reported_covariance(bundle) if cov is None else cov
    related, present = correlation(joint), features(bundle.network.block)
    out = []
    for i in np.flatnonzero(~trajectory_errors.is_determined(bundle, cov)).tolist():
        p, row = listed[i], len(cameras) + i
        how = _how_well(p)
        if np.isfinite(p.sigma):  # an open parameter has no meaningful correlations
            how += f"; correlation {_strongest(related[row], row, labels)}"
        out.append(f"{p.name} is not determined ({how}); it would need: {needed(p.key, present)}")
    return out


def weak(found: Sequence[Weak], has: frozenset[str], *, late: bool = False) -> list[str]:
    """Return a sentence per weak parameter, heads alike together: reasons and remedies.

    Parameters
    ----------
    found : sequence of Weak
        All of one adjustment.
    has : frozenset of str
        Geometry of the flight, as `estimates.features` returns it.
    late : bool
        Whether a delay of the positions was estimated, too.
    """
    groups: dict[tuple[str, str, str], list[str]] = {}
    for w in found:
        p, cure = w.parameter, needed(w.parameter.key, has)
        if late and cure == ENOUGH and p.key in (*LEVER_ARM, "xp", "yp", "delay"):
            cure = SPEEDS
        reasons = [f"sigma {p.sigma:.3g} {p.unit}"]
        if w.share > MOST:
            reasons.append(f"{100 * w.share:.0f} % of the variance of {w.of} in {AXES[w.axis]}")
        if w.calm > RESTS:
            reasons.append("it rests on wind and hills, which nobody plans")
        groups.setdefault((p.name, "; ".join(reasons), cure), []).append(p.camera)
    out = []
    for (name, reason, cure), cameras in groups.items():
        named = f"{cameras[0]} {name}".strip()
        if len(cameras) > 1:
            named = f"{name} of {', '.join(cameras)}"
        out.append(f"{named} is weak ({reason}); it would need: {cure}")
    return out


def rough_boresights(calibration: Calibration) -> str:
    """Return a sentence on boresights that rough attitudes leave uncertain; empty without them."""
    listed = zip(parameters(calibration), is_determined(calibration), strict=True)
    sigma = [p.sigma for p, determined in listed if determined and p.key in BORESIGHT]
    if not max(sigma, default=0.0) > LIMIT_BORESIGHT_DEG:
        return ""
    return (
        f"boresights have sigma up to {max(sigma):.2g} degrees, more than {LIMIT_BORESIGHT_DEG:g}: "
        f"attitudes of {calibration.limit_boresight_deg:.2g} degrees (median) give no better"
    )


def beyond_precision(bundle: Bundle) -> str:
    """Return a sentence on a condition above `CARRIED`, and its images; empty below.

    Positions and attitudes of these images are not known. Unknowns that all images share are known
    as long as they have a standard deviation.
    """
    if not bundle.solution.condition > CARRIED:
        return ""
    network = bundle.network
    n_points = np.bincount(network.image_points.image_idx, minlength=len(bundle.oriented))
    names = [
        f"{network.block.images.names[k]} (measured points: {n_points[k]})"
        for k in np.flatnonzero(~bundle.oriented & (n_points > 0))
    ]
    more = f" and {len(names) - 3} more" * (len(names) > 3)
    of_images = f"the position and attitude of {', '.join(names[:3])}{more}"
    return (
        "the condition of the normal matrix is more than double precision can carry: the "
        f"observations do not determine {of_images if names else 'all unknowns'}"
    )


# --- errors that the points of an exposure share ---------------------------------------------


def turned(sigma: Array | None) -> str:
    """Return a sentence on the turns of an exposure's pictures, radians; empty for None."""
    if sigma is None:
        return ""
    about = ", ".join(f"{value:.4f}" for value in np.degrees(sigma).tolist())
    return (
        f"the pictures of an exposure do not share a pose: they are turned by {about}° about the "
        "body's axes (standard deviation, an unknown of every picture)"
    )


def enlarged(calibration: Calibration) -> str:
    """Return a sentence on the factors of enlarged sigma and their reason; empty if unchanged."""
    groups = ("interior orientations", "heads against each other")
    factors = zip(calibration.enlarged, groups, strict=True)
    phrases = [f"{factor:.1f} ({name})" for factor, name in factors if factor > 1]
    if not phrases:
        return ""
    return (
        f"sigma are enlarged by {' and '.join(phrases)}: exposures that are left out change the "
        "estimates by so much more than independent image points would; points of an exposure "
        "share errors"
    )


# --- declared mountings ----------------------------------------------------------------------


def difference(c: Confirmation) -> str:
    """Return how a part differs from the declared one; empty where it hardly does."""
    lever = c.part == "lever arm"
    differs = np.any(c.declared & (np.abs(c.difference) > 3 * c.sigma))
    if not c.declared.any() or (lever and np.isnan(c.p) and not differs):
        return ""
    digits, unit = ("+.2f", " m") if lever else ("+.3f", "° about the body's axes")
    pairs = zip(c.difference, c.declared, strict=True)
    listed = ", ".join(f"{value:{digits}}" if known else "-" for value, known in pairs)
    return f"differs from the declared one by ({listed}){unit}"


def mistake(c: Confirmation) -> str:
    """Return why a part cannot be right even without sigma; empty where it can."""
    if not c.declared.any():
        return (
            f"is {np.linalg.norm(c.difference):.1f} m long, and none is declared: are the heights "
            "of control and trajectory of one system?"
        )
    if np.isfinite(c.convergence_deg):
        return (
            f"kappa by about the meridian convergence, {c.convergence_deg:.2f}°: is the "
            "heading read against true or grid north?"
        )
    return ""


def not_confirmed(c: Confirmation) -> str:
    """Return a sentence on a part that is not confirmed."""
    why = "; ".join(filter(None, (difference(c), mistake(c))))
    return f"not confirmed: {c.part} of {c.camera} {why}"


def approximation(c: Confirmation) -> str:
    """Return a sentence on a declared approximation, without sigma, that is far off; else empty."""
    size = np.linalg.norm(np.where(c.declared, c.difference, 0.0))
    far = size > (0.05 if c.part == "lever arm" else 3.0)  # more than the errors of a survey
    if not (c.confirmed and difference(c) and np.isnan(c.p) and far):
        return ""
    return f"{c.part} of {c.camera} {difference(c)}"


# --- errors of the trajectory ----------------------------------------------------------------


def by_course(test: ByCourse) -> str:
    """Return a sentence with the mean heading error of each course, and its likely cause."""
    means = ", ".join(f"{c.off_deg:+.3g}° at {c.course_deg:.0f}°" for c in test.courses)
    return (
        f"recorded headings are off by another amount on another course: {means} (p "
        f"{test.p:.1g}); the deviation of a magnetometer would look like this, and "
        'attitude = ["deviation"] under [stages.mounting] estimates it'
    )


def on_trajectory(bundle: Bundle) -> list[str]:
    """Return sentences on the estimated and held errors of the trajectory."""
    everything = trajectory_errors.parameters(bundle)
    determined = trajectory_errors.is_determined(bundle)
    listed = [p for p, good in zip(everything, determined, strict=True) if good]
    by_key: dict[str, list[Parameter]] = {}
    for p in listed:
        by_key.setdefault(p.key, []).append(p)
    out = []
    if shifts := by_key.get("shift"):
        axes = [(p, p.name.removeprefix("gnss_shift_").removesuffix("_m")) for p in shifts]
        terms = ", ".join(f"{p.value:+.3f} ± {p.sigma:.3f} m ({axis})" for p, axis in axes)
        out.append(f"GNSS positions are off by {terms}")
    if drifts := by_key.get("drift"):
        top = max(drifts, key=lambda p: abs(p.value) / p.sigma)
        out.append(f"the plainest drift is {top.name}: {top.value:+.3f} ± {top.sigma:.3f}")
    for p in by_key.get("delay", []):
        late = "late" if p.value > 0 else "early"
        ms = f"{1000 * abs(p.value):.1f} ± {1000 * p.sigma:.1f} ms"
        out.append(f"GNSS positions are recorded {ms} {late}")
    if len(by_key.get("deviation", [])) == 2:
        sine, cosine = by_key["deviation"]
        course = np.degrees(np.arctan2(sine.value, cosine.value)) % 360
        out.append(
            f"recorded headings are off by {sine.value:+.3f} ± {sine.sigma:.3f}° times their "
            f"sine and {cosine.value:+.3f} ± {cosine.sigma:.3f}° times their cosine: by "
            f"{np.hypot(sine.value, cosine.value):.3f}° at {course:.0f}°, and by as much the other "
            "way on the opposite course"
        )
    network = bundle.network
    observed, trajectory, layout = network.observed, network.block.trajectory, network.layout
    out += [
        f"errors of {noun} are taken to be correlated: {process.share:g} of their sigma, with a "
        f"time constant of {process.time_constant_s:g} s"
        for noun, process, slow in (
            ("positions", trajectory.slow_positions, observed.slow_positions),
            ("attitudes", trajectory.slow_attitudes, observed.slow_attitudes),
        )
        if slow is not None
    ]
    if np.any(layout.shift >= 0):
        names = ("the lever arm's z", "the height of the GNSS shift")
        held, free = names if layout.shift[2] >= 0 else names[::-1]
        out.append(f"{held} is held, since it and {free} are one unknown")
    owners = {
        "shift": "the shift and drift of GNSS positions",
        "drift": "the shift and drift of GNSS positions",
        "delay": "the delay",
        "deviation": "the deviation of headings",
    }
    if own := " and ".join(dict.fromkeys(owners[p.key] for p in everything)):
        verb = "are" if " and " in own else "is"
        out.append(
            f"{own} {verb} this block's own: none is applied to another block, nor in the "
            "validation"
        )
    return out


# --- validations -----------------------------------------------------------------------------


def on_validation(found: Validation) -> list[str]:
    """Return warnings on many rejections and on a height offset of all check points."""
    out = []
    n_rejected = sum(r.kind == "image_point" for r in found.rejected)
    n_measured = n_rejected + found.n_observations // 2
    if n_rejected > 0.1 * n_measured:  # no single gross errors
        out.append(
            f"{n_rejected} of {n_measured} measurements of check points do not fit the others: "
            "rather a wrong calibration or trajectory than so many gross errors"
        )
    offset, share = found.height_offset
    if abs(share) > LIMIT_SCALE:
        out.append(
            f"the check points come out {abs(offset):.1f} m too {'high' if offset > 0 else 'low'}, "
            f"{100 * abs(share):.1f} % of the flying height: the height system of check "
            "points or trajectory, or the focal length, is wrong"
        )
    return out


def prediction(found: Prediction) -> str:
    """Return a sentence on the fit of exposures that a calibration predicts."""
    rms = ", ".join(f"{value:.2f}" for value in found.position_rms_m)
    return (
        f"there are no check points; {shown.count(found.n_exposures, 'exposure')} that took no "
        f"part in the calibration: rays meet within {found.rays_rms_px:.2f} px, positions are off "
        f"by {rms} m (east, north, height; RMS), variance of unit weight "
        f"{found.sigma0_sq:.3f} (p of chi-square {found.chi_square_p:.3f})"
    )


def sigmas(components: Sequence[Component]) -> list[str]:
    """Return a sentence on the multiplied sigma, and one for each wrong sigma."""
    multiplied = [
        f"{c.applied:.2f} ± {c.sigma:.2f} ({c.group})" for c in components if c.applied != 1.0
    ]
    out = [f"the sigma were multiplied by {', '.join(multiplied)}"] if multiplied else []
    for c in components:
        if c.is_significant and c.factor > c.applied:
            out.append(
                f"the sigma of {c.group} are {c.factor / c.applied:.1f} times too optimistic"
            )
        elif c.is_significant:
            times = c.applied / max(c.factor, 1e-3)
            out.append(f"the sigma of {c.group} are {times:.1f} times too pessimistic")
    return out
