"""Checks of the paper that agree; the audit lists these too."""

from __future__ import annotations

import numpy as np

from acx4book.paper import printed as paper
from acx4lib.geometry.frames import rotation_from_opk

Agreement = tuple[str, str, str]
"""Place in the paper, printed value, computed value."""


def images_of_blocks() -> Agreement:
    """Count the images of blocks 1 and 2 by their strips."""
    s = paper.statement
    counts = [
        sum(
            s(f"{block}_{level}_strips") * s(f"{block}_{level}_images") for level in ("high", "low")
        )
        for block in ("block_1", "block_2")
    ]
    return (
        "3.2",
        f"{s('block_1_images'):.0f} and {s('block_2_images'):.0f} images",
        f"strips times images: {counts[0]:.0f} and {counts[1]:.0f}",
    )


def megapixels() -> Agreement:
    """Multiply the sides of a head's image."""
    width, height = paper.statement("head_width_px"), paper.statement("head_height_px")
    return (
        "3.1",
        f"{paper.statement('head_megapixels'):.1f} megapixels",
        f"{width:.0f} × {height:.0f} = {width * height / 1e6:.1f} million",
    )


def synthetic_size() -> Agreement:
    """Multiply the pixels of the synthetic image by their size."""
    width, height = 2 * paper.corners("SYN")[0]
    printed = [paper.value(2, name, "SYN") for name in ("width_mm", "height_mm")]
    return (
        "Table 2",
        f"{printed[0]:.2f} × {printed[1]:.2f} mm",
        f"{width:.2f} × {height:.2f} mm from the pixels",
    )


def synthetic_ground_pixels() -> Agreement:
    """Compute the ground pixels of blocks 2 and 3."""
    s = paper.statement
    names = ("block_2_low", "block_2_high", "block_3")
    scale = paper.pixel_mm("SYN") / paper.value(3, "f_mm", "single_step")
    return (
        "3.2, 4.3",
        "ground pixels " + ", ".join(f"{100 * s(f'{name}_gsd_m'):.0f}" for name in names) + " cm",
        ", ".join(f"{100 * scale * s(f'{name}_m'):.1f}" for name in names) + " cm",
    )


def residuals() -> Agreement:
    """Express the synthetic image's residuals in its pixels."""
    um = paper.statement("synthetic_quality_um")
    return (
        "4.1",
        f"residuals of {um:.0f} µm, {paper.statement('synthetic_quality_px'):.1f} pixel",
        f"{1e-3 * um / paper.pixel_mm('SYN'):.2f} pixel of the synthetic image,"
        f" {1e-3 * um / paper.pixel_mm('CAM1'):.2f} of a head",
    )


def share_of_small_errors() -> Agreement:
    """Divide the counted discrepancies by the points."""
    count, n = (paper.value(4, name, "two_step") for name in ("n_within_3_gsd", "n_points"))
    return (
        "Table 4",
        f"{paper.value(4, 'within_3_gsd_percent', 'two_step'):.2f} %",
        f"{count:.0f} of {n:.0f} = {100 * count / n:.2f} %",
    )


def rotation() -> Agreement:
    """Test that eq. (6) is a rotation, at Table 1's angles."""
    rotations = rotation_from_opk(np.array([paper.opk(head) for head in paper.HEADS]))
    error = np.abs(rotations @ np.swapaxes(rotations, 1, 2) - np.eye(3)).max()
    proper = bool(np.all(np.linalg.det(rotations) > 0))
    kind = "a proper rotation" if proper and error < 1e-12 else "no proper rotation"
    return "eq. (6)", "rotation matrix of ω, φ, κ", f"{kind} at Table 1's angles"


CHECKS = (
    images_of_blocks,
    megapixels,
    synthetic_size,
    synthetic_ground_pixels,
    residuals,
    share_of_small_errors,
    rotation,
)
