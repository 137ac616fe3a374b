"""Labels for readers of methods, parameters and units, and values with their sigma."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.geometry.parameters import AXES, BORESIGHT, LEVER_ARM, REPORTED

TITLES = {
    "two_step": "Two-step",
    "two_step_gnss": "Two-step, GNSS positions",
    "single_step": "Single-step",
    "rig": "Rig",
    "rig_calibration": "Rig, calibration block",
    "relative_orientation": "Relative orientation",
    "given": "As given",
}
"""Names of the methods in headings."""

UNITS = {"deg": "°", "um": "µm"}
"""Signs of units that are spelt out in results files."""

UNIT = re.compile(r"[\w/^.-]{1,20}")
"""Form of a unit; any other text, from foreign results, is shown as it is."""

_LABELS = {
    "sigma0_squared": "variance of unit weight",
    "f_mm": "$f$",
    "xp_mm": "$x_p$",
    "yp_mm": "$y_p$",
    "k1": "$k_1$",
    "k2": "$k_2$",
    "k3": "$k_3$",
    "p1": "$p_1$",
    "p2": "$p_2$",
    "b1": "$b_1$",
    "b2": "$b_2$",
    "lever_x_m": "lever arm $x$",
    "lever_y_m": "lever arm $y$",
    "lever_z_m": "lever arm $z$",
    "boresight_omega_deg": "boresight $\\omega$",
    "boresight_phi_deg": "boresight $\\varphi$",
    "boresight_kappa_deg": "boresight $\\kappa$",
    **{f"gnss_shift_{axis}_m": f"GNSS shift, {axis}" for axis in AXES},
    "gnss_delay_s": "GNSS delay",
    "attitude_delay_s": "Delay of attitudes",
    "deviation_sin_deg": "Deviation of headings, by their sine",
    "deviation_cos_deg": "Deviation of headings, by their cosine",
    "Xc_mm": "$X_c$",
    "Yc_mm": "$Y_c$",
    "Zc_mm": "$Z_c$",
    "omega_deg": "$\\omega_c$",
    "phi_deg": "$\\varphi_c$",
    "kappa_deg": "$\\kappa_c$",
    "width_px": "width",
    "height_px": "height",
    "pixel_um": "pixel",
    "width_mm": "X dimension",
    "height_mm": "Y dimension",
    "n_pairs": "intersection pairs",
    "n_points": "check points",
    "n_success": "successful intersections",
    "success_percent": "successful intersections",
    "n_fail": "failed intersections",
    "fail_percent": "failed intersections",
    "n_within_3_gsd": "points within 3 GSD",
    "within_3_gsd_percent": "points within 3 GSD",
    "gsd_m": "ground pixel",
    **{
        f"{kind}_{axis}_{unit}": f"{title}, {axis}"
        for kind, title in (("mean", "mean"), ("rms", "RMS"))
        for axis in AXES
        for unit in ("m", "px")
    },
}

LABELS = {name: Markup(label) for name, label in _LABELS.items()}
"""Labels for readers of parameters and statistics, by name."""


def group_label(keys: Sequence[str]) -> Markup:
    """Return the label of parameters that are tested together, by the library's names."""
    for part, names in (("lever arm", LEVER_ARM), ("boresight", BORESIGHT)):
        if tuple(keys) == names:
            return Markup(part)
    return Markup(", ".join(LABELS[REPORTED[key][0]] for key in keys))


def p_value(p: float) -> str:
    """Return a probability for a table."""
    return f"{p:.3f}" if p >= 5e-4 else "<\N{NO-BREAK SPACE}0.0005"


def inside(title: str) -> str:
    """Return a title, such as that of a method, for use inside a sentence."""
    return title[:1].lower() + title[1:]


def value_and_sigma(value: float, sigma: float) -> Markup:
    """Return a value and its standard deviation, both to two digits of the standard deviation."""
    if not np.isfinite(value):
        return Markup("")
    if not (np.isfinite(sigma) and sigma > 0):
        return Markup(f"{value:.4g}")
    if abs(value) < 1e-3 and sigma < 1e-3:
        return Markup(f"{scientific(value, digits=2)} ± {scientific(sigma, digits=1)}")
    digits = max(0, 1 - int(np.floor(np.log10(sigma))))
    return Markup(f"{unsigned_zero(f'{value:.{digits}f}')} ± {sigma:.{digits}f}")


def unsigned_zero(text: str) -> str:
    """Return a number in text, without a sign where its digits are all zero."""
    return re.sub(r"^[+-](?=0(\.0*)?$)", "", text)


def with_unit(label: str, unit: str) -> Markup:
    """Return a label with its unit in brackets; without brackets if there is no unit."""
    text = shown(label)
    if unit in ("", "1"):
        return Markup(text)
    known = UNITS.get(unit, unit) if UNIT.fullmatch(unit) else shown(unit)
    return Markup(f"{text} ({known})")


def lacking(reason: str) -> str:
    """Return the text for a method without outcome, by the reason."""
    return "needs control points" if "control points" in reason else "no outcome"
