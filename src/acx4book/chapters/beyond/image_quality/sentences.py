"""The answer of the chapter on the quality of the synthetic image."""

from __future__ import annotations

from collections.abc import Mapping

from acx4book.chapters.beyond.image_quality.examined import Examined, largest_radial
from acx4book.chapters.beyond.image_quality.known_exposure import KnownExposure
from acx4book.chapters.beyond.image_quality.tables import SMALL_P, common_px, left_px
from acx4book.paper import printed


def answer(known: KnownExposure, examined: Mapping[str, Examined]) -> str:
    """Say how good the image is by renderer, refinement and lens.

    Parameters
    ----------
    known : KnownExposure
    examined : mapping of str to Examined
        By the ways to refine, and ``true`` of the true orientation.
    """
    true, mean, turned = (
        left_px(examined[way], "oriented") for way in ("true", "mean shift", "rotations")
    )
    radial = [
        largest_radial(examined[way].fits["calibrated"]) for way in ("mean shift", "rotations")
    ]
    common, p = common_px(known, examined["true"])
    renderer = (
        f"about {common:.3f} px of it are common to parts of the frame, more than noise makes"
        if p < SMALL_P
        else "parts of the frame show no common error beyond noise"
    )
    return (
        f"With true heads {true:.2f} px are left in a coordinate, the noise of matching included; "
        f"{renderer}. Heads with errors as large as the standard deviations of the paper's Table 1 "
        f"leave {mean:.2f} px after the paper's mean differences, "
        f"and {turned:.2f} px after three rotations of each head; the paper has "
        f"{printed.statement('synthetic_quality_px'):g} px. A self-calibration finds "
        f"at most {radial[0]:.1f} px of radial distortion in the one image and {radial[1]:.1f} px "
        "in the other, since errors of heads change at their borders, where no lens does."
    )
