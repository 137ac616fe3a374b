"""Sentences about the heads, with the numbers of a run beside the paper's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib import experiments, paper
from acx4lib.calibration import REPORTED, from_bundle, parameters
from acx4lib.correlations import interior_exterior, largest_pairs
from acx4lib.experiments import HeldFocalLength
from acx4lib.flight import Flight
from acx4lib.lens import radial_profile
from acx4lib.plot.heads import SYMBOLS
from acx4lib.stages.head_tables import apart, claim, printed_border_px
from acx4lib.stages.heads import HeadsStage
from acx4lib.tables import LABELS


def agreement(flight: Flight, stage: HeadsStage) -> str:
    """Say how the interior orientation compares with the printed one."""
    if not paper.applies(flight):
        return "The paper's Table 1 belongs to other cameras; nothing is compared with it."
    listed = [
        p
        for fit in stage.heads.bundles.values()
        for p in parameters(from_bundle(fit))
        if np.isfinite(apart(p))
    ]
    if not listed:
        return "There is nothing to compare with the paper's Table 1."
    far = np.array([apart(p) for p in listed])
    worst = listed[int(far.argmax())]
    ratio = {
        key: np.median([p.sigma / paper.sigma(1, p.name, p.camera) for p in listed if p.key == key])
        for key in dict.fromkeys(p.key for p in listed)
    }
    ratios = ", ".join(f"{value:.1f} for {LABELS[REPORTED[k][0]]}" for k, value in ratio.items())
    return (
        f"Of {len(listed)} parameters {int(np.sum(far <= 2))} lie within two combined standard "
        f"deviations of the printed value; the farthest is {LABELS[worst.name]} of "
        f"{worst.camera}, {far.max():.1f} off. Our standard deviations are those of the paper "
        f"times {ratios} (medians of the heads)."
    )


def border(flight: Flight, stage: HeadsStage) -> str:
    """Say how large the distortion at the border is, beside the paper's statement."""
    px = [radial_profile(fit)[1][-1] for fit in stage.heads.bundles.values()]
    if not px:
        return "No head could be adjusted."
    found = f"At the corner the radial distortion is {min(px):.1f} to {max(px):.1f} px"
    if not paper.applies(flight):
        return f"{found}."
    said = paper.statement("head_border_distortion_px")
    printed = printed_border_px(flight).values()
    return (
        f"{found}. The paper's text says approximately {said:.0f} pixels; $k_1$ of its Table 1 "
        f"gives {min(printed):.1f} to {max(printed):.1f} px."
    )


def correlation(flight: Flight, stage: HeadsStage) -> str:
    """Say how large the correlations are, beside the paper's statement."""
    found = {name: interior_exterior(fit) for name, fit in stage.heads.bundles.items()}
    if not found:
        return "No head could be adjusted."
    every = np.concatenate([np.abs(c.values).ravel() for c in found.values()])
    head = max(found, key=lambda name: float(found[name].largest.max()))
    pair = next(iter(largest_pairs(found[head], n=1)))
    inner, outer = (SYMBOLS[name] for name in pair.split("/"))
    ours = (
        f"The largest correlation is {every.max():.2f}, between {inner} and {outer} of {head}; the "
        f"median of all is {np.median(every):.2f}"
    )
    bound = claim(flight, "max_correlation")
    if bound is None:
        return f"{ours}."
    said = f"below {100 * bound:.0f} %"
    shares = f"{100 * np.mean(every < bound):.0f} % of all are {said}; the paper says that all were"
    if every.max() < bound:
        return f"{ours}, and {shares}."
    return (
        f"{ours}, and {shares}. With free exterior orientation that cannot hold for the maximum: a "
        "tilt of the camera and a shift of its principal point move the image in nearly the same "
        "way, and so do the decentring parameters."
    )


def gnss(held: Sequence[HeldFocalLength]) -> str:
    """Say which focal lengths would put the cameras at the trajectory's heights."""
    asked = experiments.asked_by_gnss(held)
    if not asked:
        return "No head could be adjusted."
    fits = held[int(np.argmin([np.abs(h.change_mm).max() for h in held]))].bundles
    each = ", ".join(f"{f:.3f} mm ({name})" for name, f in asked.items())
    declared = ", ".join(
        f"{f:g}" for f in sorted({fits[name].cameras[0].interior.f for name in asked})
    )
    slope = np.mean([_slope(held, name) for name in asked])
    return (
        f"Each 0.1 mm of focal length lifts the cameras by {0.1 * slope:.1f} m. They would stand "
        f"where GNSS has them with focal lengths of {each} instead of {declared} mm."
    )


def _slope(held: Sequence[HeldFocalLength], name: str) -> float:
    """Return by how many m a head rises with one mm of focal length."""
    f = [h.bundles[name].cameras[0].interior.f for h in held]
    rise = [h.above_gnss_m[name] for h in held]
    return float((rise[-1] - rise[0]) / (f[-1] - f[0]))
