"""Checks of the paper's second step: the synthetic image and Table 3."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import scientific
from acx4lib.calibration.determination import Absorption
from acx4lib.geometry.camera import Interior, distortion
from acx4lib.geometry.parameters import BORESIGHT_ANGLES
from acx4lib.least_squares.covariance import sigmas

LEVER_ARM = {"f_mm": "lever_z_m", "xp_mm": "lever_x_m", "yp_mm": "lever_y_m"}
"""The component of the lever arm that an interior parameter absorbs at one flying height."""

ARM = tuple(f"lever_{axis}_m" for axis in "xyz")

ROUNDING_MM = 0.00005
"""Half a unit of the last digit that Table 3 prints of f, x_p, y_p."""


def corner_radius() -> float:
    """Return the distance of the synthetic image's corners from its middle, mm."""
    return float(np.hypot(*printed.corners("SYN")[0]))


def radial_mm(interior: Interior, r: float) -> float:
    """Compute the radial distortion at a distance from the principal point, mm."""
    radial = replace(interior, xp=0.0, yp=0.0, p1=0.0, p2=0.0)
    return float(distortion(radial, np.array([r, 0.0]))[0])


def literal(as_printed: str) -> float:
    """Return a printed coefficient with the sign of its exponent as printed.

    Parameters
    ----------
    as_printed : str
        For example ``2.57^07 +/- 2.14^08``.
    """
    found = re.match(r"(-?[\d.]+)\^(-?\d+)", as_printed)
    if found is None:
        msg = f"not a printed power of ten: {as_printed!r}"
        raise ValueError(msg)
    return float(found[1]) * 10.0 ** int(found[2])


def exponents() -> tuple[str, str, str]:
    """Item 3: the exponents of Table 3 lost their minus signs."""
    cells = [printed.printed(3, name, "two_step") for name in ("k1", "k2", "k3")]
    k1, _, k3 = (literal(cell) for cell in cells)
    r = corner_radius()
    negative_um = 1e3 * radial_mm(printed.interior(3, "two_step"), r)
    return (
        "K1, K2, K3 = "
        + ", ".join(cell.split(" ")[0] for cell in cells)
        + f" in Table 3, but k1 = {printed.printed(1, 'k1', 'CAM1').split(' ')[0]} in Table 1",
        f"radial distortion at the corner of the synthetic image: {negative_um:.0f} µm with"
        f" negative exponents; with the printed ones {scientific(1e-3 * k1 * r**3)} m from K1"
        f" alone and {scientific(1e-3 * k3 * r**7)} m from K3 alone",
        "Misprint: all exponents are negative.",
    )


def decentring_px(interior: Interior) -> tuple[float, float]:
    """Compute the decentring distortion at the worst corner, px.

    Parameters
    ----------
    interior : Interior

    Returns
    -------
    component, length : float
        Largest component, and length of the vector.
    """
    only = Interior(f=interior.f, p1=interior.p1, p2=interior.p2)
    dxy = distortion(only, printed.corners("SYN")) / printed.pixel_mm("SYN")
    return float(np.abs(dxy).max()), float(np.hypot(*dxy.T).max())


def _significance(parameter: str, method: str) -> float:
    """Return a value of Table 3 divided by its standard deviation."""
    return abs(printed.value(3, parameter, method)) / printed.sigma(3, parameter, method)


def synthetic_distortion() -> tuple[str, str, str]:
    """Item 9: distortion that is left in the synthetic image."""
    interior = printed.interior(3, "two_step")
    edge, corner = float(printed.corners("SYN")[0, 1]), corner_radius()
    edge_px, corner_px = (radial_mm(interior, r) / printed.pixel_mm("SYN") for r in (edge, corner))
    component, length = decentring_px(interior)
    p1, p2 = (_significance(name, "two_step") for name in ("p1", "p2"))
    return (
        "decentring not significant, radial distortion at the border close to"
        f" {printed.statement('synthetic_border_distortion_px'):.0f} px (4.1)",
        f"Table 3: P1 and P2 are {p1:.0f} and {p2:.0f} standard deviations; decentring"
        f" {component:.1f} px in one coordinate, {length:.1f} px in all at the corner; radial"
        f" {edge_px:.2f} px at r = {edge:.1f} mm, {corner_px:.2f} px at the corner",
        "Contradiction, unless the border is the middle of the short sides and the decentring of"
        " 4.1 is another one than that of Table 3.",
    )


def scatter_ratios() -> tuple[float, float, float]:
    """Compute ratios of boresight standard deviations: two-step over single-step."""
    two, one = (
        [printed.sigma(3, name, method) for name in BORESIGHT_ANGLES] for method in printed.METHODS
    )
    omega, phi, kappa = (a / b for a, b in zip(two, one, strict=True))
    return omega, phi, kappa


def angle_sigmas() -> tuple[str, str, str]:
    """Item 12: two kinds of standard deviations of the boresight."""
    n = printed.statement("block_2_images")
    two, one = (
        [printed.sigma(3, name, method) for name in BORESIGHT_ANGLES] for method in printed.METHODS
    )
    return (
        "standard deviations of ω, φ, κ: "
        + ", ".join(f"{value:.4f}" for value in two)
        + "° two-step, "
        + ", ".join(f"{value:.4f}" for value in one)
        + "° single-step",
        "ratios "
        + ", ".join(f"{ratio:.1f}" for ratio in scatter_ratios())
        + f"; √{n:.0f} = {np.sqrt(n):.1f}",
        f"Like is hardly compared with like: the first has the size of the scatter of the {n:.0f}"
        " images, the second is the standard deviation of a parameter.",
    )


def variance_factors() -> tuple[str, str, str]:
    """Item 13: a posteriori variances in different units of weight."""
    two, one = (printed.value(3, "sigma0_squared", method) for method in printed.METHODS)
    heads = [printed.value(1, "sigma0_squared", head) for head in printed.HEADS]
    sigma_0 = np.sqrt(heads)
    return (
        f"a posteriori variance {two:.2f} and {one:.5f} (Table 3), {min(heads):.2f} to"
        f" {max(heads):.2f} (Table 1)",
        f"√{one:.5f} = {np.sqrt(one):.3f}: as mm in the image it would be"
        f" {np.sqrt(one) / printed.pixel_mm('SYN'):.0f} px; the heads' square roots are"
        f" {sigma_0.min():.2f} to {sigma_0.max():.2f}",
        "The unit of weight is not named and differs, so the two methods cannot be compared by it."
        " Where 1 was expected, the heads' a priori standard deviations were about"
        f" {1 / sigma_0.mean():.0f} times too large.",
    )


def _mean_height() -> float:
    """Return the mean of the two flying heights of block 2, m."""
    return (printed.statement("block_2_low_m") + printed.statement("block_2_high_m")) / 2


def lever_arm_in_interior(absorbed: Absorption | None = None) -> pd.DataFrame:
    """Compare the two methods' interior orientation with the lever arm.

    At one flying height H a lever arm (x, y, z) has the effect of (-x, -y) f/H in the principal
    point and of -z f/H in the focal length, because body and image axes are nearly parallel. Over
    two heights least squares says what the effect is.

    Parameters
    ----------
    absorbed : Absorption, optional
        From a run of the study's flight.

    Returns
    -------
    DataFrame
        By interior parameter: shift_mm (two-step minus single-step), shift_in_sigma (of the
        single-step), at_ground_m (shift at the mean flying height), lever (name), lever_m, sum_m
        (zero if the shift is the lever arm with opposite sign). With a run also expected_mm (the
        shift that the printed lever arm causes), height_m (from which this component alone would
        cause it), sum_effective_m (the sum at that height), sigma_mm (of shift less expected, as
        the methods share their measurements).
    """
    table = pd.DataFrame([_at_mean_height(*pair) for pair in LEVER_ARM.items()])
    table = table.set_index("parameter")
    if absorbed is None:
        return table
    f = printed.value(3, "f_mm", "single_step")
    printed_arm = [printed.value(3, name, "single_step") for name in ARM]
    table["expected_mm"] = absorbed.by_lever @ printed_arm
    table["height_m"] = -f * table["lever_m"] / table["expected_mm"]
    table["sum_effective_m"] = table["shift_mm"] * table["height_m"] / f + table["lever_m"]
    table["sigma_mm"] = sigmas(absorbed.cov_mm)
    return table


def _at_mean_height(name: str, lever: str) -> dict[str, object]:
    two, one = (printed.value(3, name, method) for method in printed.METHODS)
    at_ground = _mean_height() / printed.value(3, "f_mm", "single_step") * (two - one)
    lever_m = printed.value(3, lever, "single_step")
    return {
        "parameter": name,
        "shift_mm": two - one,
        "shift_in_sigma": abs(two - one) / printed.sigma(3, name, "single_step"),
        "at_ground_m": at_ground,
        "lever": lever,
        "lever_m": lever_m,
        "sum_m": at_ground + lever_m,
    }


def lever_arm_table(absorbed: Absorption | None = None) -> pd.DataFrame:
    """Return the comparison of `lever_arm_in_interior` as a table for readers."""
    found = lever_arm_in_interior(absorbed)
    columns = {
        "Difference (mm)": (found["shift_mm"], "+.4f"),
        "Lever arm (m)": (found["lever_m"], "+.3f"),
        "At the mean height (m)": (found["at_ground_m"], "+.3f"),
        "Sum (mm)": (1e3 * found["sum_m"], "+.0f"),
    }
    if absorbed is not None:
        columns |= {
            "Expected (mm)": (found["expected_mm"], "+.4f"),
            "Effective height (m)": (found["height_m"], ".0f"),
            "Sum at that height (mm)": (1e3 * found["sum_effective_m"], "+.0f"),
        }
    names = [(LABELS[name], LABELS[lever]) for name, lever in LEVER_ARM.items()]
    return pd.DataFrame(
        {
            "Parameter": [name for name, _ in names],
            "Component": [lever for _, lever in names],
            **{
                title: [f"{value:{spec}}".replace("-", "\N{MINUS SIGN}") for value in values]
                for title, (values, spec) in columns.items()
            },
        }
    )


def lever_arm(absorbed: Absorption | None = None) -> tuple[str, str, str]:
    """Item 14: the interior orientation has absorbed the lever arm."""
    table = lever_arm_in_interior(absorbed)
    shifts, in_sigma, lever = (
        _listed(table[column], spec)
        for column, spec in (("shift_mm", "+.4f"), ("shift_in_sigma", ".0f"), ("lever_m", "+.3f"))
    )
    computed = (
        f"the lever arm z, x, y is {lever} m; at the mean flying height of {_mean_height():.0f} m"
        f" the sums of the differences, {_listed(table['at_ground_m'], '+.3f')} m, and of the lever"
        f" arm are {_listed(1e3 * table['sum_m'], '+.0f')} mm"
    )
    verdict = (
        "The paper says that the interior orientation absorbed the relative position. The numbers"
        " say so too, and more exactly than their standard deviations: the differences are the"
        " lever arm with its sign changed."
    )
    if absorbed is not None:
        rounding_um = 1e3 * ROUNDING_MM * np.sqrt(2 / 3)
        off_um = 1e3 * (table["shift_mm"] - table["expected_mm"]).abs()
        computed += (
            f"; with the heights that least squares gives, {_listed(table['height_m'], '.0f')} m,"
            f" they are {_listed(1e3 * table['sum_effective_m'], '+.0f')} mm"
        )
        verdict += (
            f" What is left of them, up to {off_um.max():.1f} µm in the image, is more than the"
            f" rounding of the print, {rounding_um:.2f} µm, and what measurements that both methods"
            f" share can make, {1e3 * table['sigma_mm'].max():.2f} µm: the effective heights depend"
            " on weights and tie points that the paper does not tell."
        )
    return (
        f"f, x_p, y_p of the two methods differ by {shifts} mm, {in_sigma} standard"
        " deviations of the single-step",
        computed,
        verdict,
    )


def _listed(values: Iterable[float], spec: str) -> str:
    return ", ".join(f"{value:{spec}}" for value in values)


def phi_difference() -> tuple[str, str, str]:
    """Item 15: the boresight φ of the two methods."""
    two, one = (printed.value(3, "boresight_phi_deg", method) for method in printed.METHODS)
    sigma_two, sigma_one = (printed.sigma(3, "boresight_phi_deg", m) for m in printed.METHODS)
    combined = np.hypot(sigma_two / np.sqrt(printed.statement("block_2_images")), sigma_one)
    difference = abs(two - one)
    height, f = printed.statement("block_3_m"), printed.value(3, "f_mm", "single_step")
    shift = abs(float(lever_arm_in_interior()["shift_mm"]["xp_mm"]))
    tangent = np.tan(np.radians(difference))
    return (
        f"boresight φ {two:.5f}° and {one:.5f}°, called similar",
        f"they differ by {difference:.4f}°, {difference / sigma_one:.1f} standard deviations of the"
        f" single-step ({difference / combined:.1f} of both, where the two-step's scatter is"
        f" divided by √n): {100 * height * tangent:.1f} cm at {height:.0f} m,"
        f" {1e3 * f * tangent:.1f} µm in the image beside the {1e3 * shift:.1f} µm of x_p",
        "Similar only beside the two-step's scatter; in the image it is"
        f" {100 * f * tangent / shift:.0f} % of the difference in x_p, with which φ"
        " is correlated.",
    )
