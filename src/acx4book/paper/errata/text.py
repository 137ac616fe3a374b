"""Misprints of the paper: equations, exponents, units, wording.

In all modules of `errata`, a function that returns three strings (printed, computed, verdict) is
one item of `acx4book.paper.errata.audit`. The other functions compute the numbers of the items.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4book.paper import printed
from acx4lib.geometry.camera import distortion


def radial_mix_up_px() -> float:
    """Compute the largest shift of y at the heads' corners if eq. (2) is used as printed, px."""
    heads = [printed.interior(1, head) for head in printed.HEADS]
    radial = [replace(head, p1=0.0, p2=0.0) for head in heads]
    dxy = np.array([distortion(head, printed.corners("CAM1")) for head in radial])
    return float(np.abs(dxy[..., 0] - dxy[..., 1]).max() / printed.pixel_mm("CAM1"))


def y_equation() -> tuple[str, str, str]:
    """Item 1: eq. (2) adds the radial distortion of x."""
    return (
        "y_a − y_p = −f·Dy/Dz + Δk_x + Δp_y",
        f"as printed it would move y by up to {radial_mix_up_px():.0f} px at the corners of the"
        " heads (Table 1)",
        "Misprint: Δk_y is meant. Eq. (8) defines it and no other equation uses it.",
    )


def equation_number() -> tuple[str, str, str]:
    """Item 2: the single-step model is cited by a number that no equation has."""
    cited, last = printed.statement("equation_cited"), printed.statement("equation_last")
    return (
        f"the single-step model is called equation ({cited:.0f})",
        f"the last equation is ({last:.0f})",
        f"Misprint: eq. ({last:.0f}) is meant.",
    )


def units() -> tuple[str, str, str]:
    """Item 4: the decentring coefficients have another unit."""
    rows = [
        (number, row)
        for number in (1, 3)
        for row in printed.table(number).itertuples()
        if str(row.unit).startswith("mm") and str(row.unit) != str(row.unit_printed)
    ]
    names = sorted({str(row.parameter) for _, row in rows})
    tables = sorted({number for number, _ in rows})
    units_printed = sorted({str(row.unit_printed) for _, row in rows})
    return (
        f"{', '.join(names)} in {', '.join(units_printed)}"
        f" (Tables {' and '.join(map(str, tables))})",
        "in eqs (9)-(10) p is multiplied by a square of lengths and gives a length: mm⁻¹;"
        " k1 (mm⁻²), k2 (mm⁻⁴) and k3 (mm⁻⁶) are right",
        "Misprint: the unit is mm⁻¹.",
    )


def one_direction() -> tuple[str, str, str]:
    """Item 19: the first block lacks the opposite directions that section 2.2 asks for."""
    directions = printed.statement("block_1_low_directions")
    heads = [printed.sigma(1, name, c) for name in ("xp_mm", "yp_mm") for c in printed.HEADS]
    single = [printed.sigma(3, name, "single_step") for name in ("xp_mm", "yp_mm")]
    return (
        "strips in opposite directions are needed (2.2); the low strips of block 1 were flown in"
        f" {directions:.0f} direction (3.2)",
        f"standard deviations of x_p, y_p: {min(heads):.4f} to {max(heads):.4f} mm in block 1,"
        f" {min(single):.4f} to {max(single):.4f} mm in block 2 with opposite directions",
        "Admitted in the text (the mounting of the heads forced it). That one direction leaves x_p"
        " and y_p hard to tell from φ and ω is not discussed.",
    )


def images_per_point() -> float:
    """Compute the number of images per check point from the number of pairs."""
    pairs = printed.value(4, "n_pairs", "two_step") / printed.value(4, "n_points", "two_step")
    return float((1 + np.sqrt(1 + 8 * pairs)) / 2)


def wording() -> tuple[str, str, str]:
    """Item 22: headings, names, and pairs that are no sample."""
    n_pairs = printed.value(4, "n_pairs", "two_step")
    n_points = printed.value(4, "n_points", "two_step")
    first, last = printed.statement("first_heading"), printed.statement("last_heading")
    return (
        f"sections “II” to “V”, but headings {first:.0f} to {last:.0f}; “Table I” and “Table 1”;"
        f" “qui-square”; “Mitshita”; “Applinix”; {n_pairs:.0f} pairs for {n_points:.0f} points",
        f"{n_pairs / n_points:.1f} pairs per point are {images_per_point():.1f} images per point"
        " if every two of them were intersected",
        "Editorial, but for two things: pairs that share images and points are no independent"
        " sample, and the frame of the adjustment (map grid or local Cartesian) is never named.",
    )
