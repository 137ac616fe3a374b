"""Sentences about the heads, with the numbers of a run beside the paper's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4book.chapters.heads.held_focal_length import HeldFocalLength, asked_by_gnss
from acx4book.chapters.heads.tables import SYMBOLS, apart, claim, oriented, printed_border_px
from acx4book.paper import printed as paper
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.correlations import interior_exterior, largest_pairs
from acx4lib.calibration.estimates import Parameter, from_bundle, parameters
from acx4lib.calibration.lens import radial_profile
from acx4lib.flight.design import levels
from acx4lib.flight.reader import Flight
from acx4lib.geometry.parameters import REPORTED
from acx4lib.stages.heads import HeadsStage


def agreement(flight: Flight, stage: HeadsStage) -> str:
    """Say how the interior orientation compares with the printed one."""
    if not paper.applies(flight):
        return "The paper's Table 1 belongs to other cameras; nothing is compared with it."
    listed = [p for p in _estimated(stage) if np.isfinite(apart(p))]
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
        f"{int(np.sum(far <= 2))} of {len(listed)} parameters lie within two combined standard "
        f"deviations of the printed value; the farthest is {LABELS[worst.name]} of "
        f"{shown(worst.camera)}, {far.max():.1f} off. Our standard deviations are those of the "
        f"paper times {ratios} (medians of the heads)."
    )


def orientation(flight: Flight, stage: HeadsStage) -> str:
    """Say how the relative orientation compares with the printed one."""
    listed = oriented(stage)
    if not listed:
        return f"There is no relative orientation: {shown(stage.left_out)}."
    metres = _ground_m_per_mm(stage)
    if not paper.applies(flight):
        return f"A tenth of a millimetre is {0.1 * metres:.1f} m at the lowest flying height."
    off = {
        name: max(
            abs(p.value - paper.value(1, p.name, p.camera)) for p in listed if p.name in names
        )
        for name, names in GROUPS.items()
    }
    return (
        f"$Z_c$ comes within {off['Zc']:.4f} mm of the printed values, the angles within "
        f"{off['angles']:.3f}°, and $X_c$, $Y_c$ within {off['Xc']:.3f} mm, which is "
        f"{off['Xc'] * metres:.1f} m on the ground from the lowest flying height. With the focal "
        "length held at a wrong value the angles cannot come nearer: tilt, principal point and "
        "position of an oblique head share what is wrong."
    )


GROUPS = {
    "Zc": ("Zc_mm",),
    "angles": ("omega_deg", "phi_deg", "kappa_deg"),
    "Xc": ("Xc_mm", "Yc_mm"),
}


def _ground_m_per_mm(stage: HeadsStage) -> float:
    """Return the ground under one mm of the first head's image from the lowest height, m."""
    fit = next(iter(stage.heads.bundles.values()))
    block = fit.network.block
    lowest = min(level.height_m for level in levels(block))
    return float(lowest / fit.cameras[0].interior.f)


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
    if not every.size:
        return "No image is oriented by control points, so that there are no correlations to show."
    head = max(found, key=lambda name: float(found[name].largest.max()))
    pair = next(iter(largest_pairs(found[head], n=1)))
    inner, outer = (SYMBOLS[name] for name in pair.split("/"))
    ours = (
        f"The largest correlation is {every.max():.2f}, between {inner} and {outer} of "
        f"{shown(head)}; the median of all is {np.median(every):.2f}"
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


def held(stage: HeadsStage, tried: Sequence[HeldFocalLength]) -> str:
    """Say by how much the adjustment minds a wrong focal length, and where it goes.

    Parameters
    ----------
    stage : HeadsStage
    tried : sequence of HeldFocalLength
        All heads changed by the same, and once not at all.
    """
    names = [name for name in stage.heads.bundles if all(name in one.bundles for one in tried)]
    if not names:
        return "No head could be adjusted."
    right = min(tried, key=lambda one: float(np.abs(one.change_mm).max()))
    wrong = [one for one in tried if one is not right]
    variance = max(one.sigma0_sq for one in wrong) / right.sigma0_sq - 1
    control = max(one.control_rms_m - right.control_rms_m for one in wrong)
    rise = max(abs(one.above_gnss_m[n] - right.above_gnss_m[n]) for one in wrong for n in names)
    f = np.array([[one.bundles[n].cameras[0].interior.to_array() for n in names] for one in wrong])
    start = [right.bundles[n].cameras[0].interior.to_array() for n in names]
    return (
        f"A focal length wrong by up to {np.abs(f - start)[..., 0].max():.1f} mm changes the "
        f"variance of unit weight by {100 * variance:+.0f} % at most and the residuals at the "
        f"control points by {1000 * control:+.1f} mm, but the principal point by up to "
        f"{np.abs(f - start)[..., 1:3].max():.2f} mm and the height of the cameras by up to "
        f"{rise:.0f} m."
    )


def gnss(tried: Sequence[HeldFocalLength]) -> str:
    """Say which focal lengths would put the cameras at the trajectory's heights."""
    asked = asked_by_gnss(tried)
    if not asked:
        return "No head could be adjusted."
    fits = min(tried, key=lambda one: float(np.abs(one.change_mm).max())).bundles
    each = ", ".join(f"{f:.3f} mm ({shown(name)})" for name, f in asked.items())
    declared = ", ".join(
        f"{f:g}" for f in sorted({fits[name].cameras[0].interior.f for name in asked})
    )
    slope = np.mean([_slope(tried, name) for name in asked])
    return (
        f"Each 0.1 mm of focal length lifts the cameras by {0.1 * slope:.1f} m. They would stand "
        f"where GNSS has them with focal lengths of {each} instead of {declared} mm."
    )


def _slope(tried: Sequence[HeldFocalLength], name: str) -> float:
    """Return by how many m a head rises with one mm of focal length."""
    f = [h.bundles[name].cameras[0].interior.f for h in tried]
    rise = [h.above_gnss_m[name] for h in tried]
    return float((rise[-1] - rise[0]) / (f[-1] - f[0]))


# --- the answer ------------------------------------------------------------------------------


def answer(flight: Flight, stage: HeadsStage) -> str:
    """Say how well images alone give the heads: one sentence, then what limits them.

    Parameters
    ----------
    flight : Flight
    stage : HeadsStage
    """
    listed = _estimated(stage)
    principal = [1e3 * p.sigma for p in listed if p.key in ("xp", "yp") and np.isfinite(p.sigma)]
    if not principal:
        return "Not from these images: no head has a principal point that they determine."
    held = all(p.key != "f" for p in listed)
    known = f"known to {min(principal):.1f} to {max(principal):.1f} µm"
    first = (
        f"{'Yes, but for the focal length' if held else 'Yes'}: from images over control points "
        f"the principal points of the heads are {known}{_beside_print(flight, listed)}."
    )
    every = [interior_exterior(fit).largest.max() for fit in stage.heads.bundles.values()]
    limits = f"{_focal_length(held=held)} {_tilts(flight, max(map(float, every)))}"
    return f"{first}\n\n{_of_print(flight, stage)}{limits}"


def _estimated(stage: HeadsStage) -> list[Parameter]:
    return [p for fit in stage.heads.bundles.values() for p in parameters(from_bundle(fit))]


def _beside_print(flight: Flight, listed: Sequence[Parameter]) -> str:
    if not paper.applies(flight):
        return ""
    far = np.array([apart(p) for p in listed])
    far = far[np.isfinite(far)]
    return (
        f", and {int(np.sum(far <= 2))} of {len(far)} parameters lie within two combined standard "
        "deviations of the paper's Table 1"
        + (", from which the simulated heads were made" if flight.simulated else "")
    )


def _of_print(flight: Flight, stage: HeadsStage) -> str:
    """Say how far X_c and Y_c are from print, which a simulated flight was not given."""
    if not (flight.simulated and paper.applies(flight)):
        return ""
    far = [apart(p) for p in oriented(stage) if p.name in ("Xc_mm", "Yc_mm")]
    if not far:
        return ""
    return (
        f"$X_c$ and $Y_c$, which the simulation was not given, are {min(far):.1f} to "
        f"{max(far):.1f} standard deviations away from print. "
    )


def _focal_length(*, held: bool) -> str:
    if not held:
        return "The focal length is estimated here, and with it the flying height."
    return (
        "The focal length is held at its nominal value, because nothing in these adjustments "
        "observes the flying height. Its error goes into $Z_c$, the tilts and the principal "
        "points: the relative orientation fits images together, but it does not say where a head "
        "stands."
    )


def _tilts(flight: Flight, largest: float) -> str:
    said = f"Interior and exterior orientation are correlated by up to {largest:.2f}"
    bound = claim(flight, "max_correlation")
    if bound is None:
        return f"{said}."
    return f"{said}, where the paper says that all correlations are below {100 * bound:.0f} %."
