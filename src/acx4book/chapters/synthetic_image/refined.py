"""The heads fitted to each other by tie points, in every way (section 2.1, Figure 1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from acx4book.chapters.synthetic_image.figures import WAYS
from acx4book.chapters.synthetic_image.pixels import FoundTies
from acx4book.chapters.synthetic_image.steps import synthetic_camera
from acx4book.chapters.synthetic_image.wrong_heads import (
    FrameErrors,
    refinements,
    simulated_ties,
    with_turned_heads,
    with_wrong_interiors,
)
from acx4book.paper import printed
from acx4book.typesetting.plain_text import Markup
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.flight import Flight
from acx4lib.results.adjustments import Record, of_left_out, of_relative_orientation
from acx4lib.synthetic_image.frame import coverage
from acx4lib.tie_points.differences import frame_differences
from acx4lib.tie_points.refinement import Refined, refine_by_rotations
from acx4lib.tie_points.ties import (
    Overlap,
    TiePoints,
    overlaps,
    refine_by_mean_differences,
    shared_points,
)

NO_TIES = {"Heads": "no two of them share a tie point"}

BEFORE, MEAN, ROTATIONS = WAYS
EACH = "three rotations, each exposure by itself"
BY: Mapping[str, str] = {"rotations": ROTATIONS, "six": "rotations and places"}
"""What the ways to refine are called; those of `refinement.FREE`."""

WORDS = {"before": "nothing", "mean shift": MEAN, **BY}
"""The same for `experiments.refinements`."""

TURNED_DEG, TIE_PX, TRIALS = 0.01, 0.1, 4
"""Of `repaired_table`: errors of the heads' angles, noise of tie points, number of draws."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Refinement:
    """The heads before the refinement, and after it in every way.

    Attributes
    ----------
    ties : TiePoints
        All that were found; some may be rejected.
    from_pixels : bool
        Whether they were found in the pictures; otherwise the flight came with them.
    orientations : dict of str to RelativeOrientation
        `BEFORE`, `MEAN` and the names of `BY`, those that the tie points determine.
    fits : dict of str to Refined
        By the names of `BY`.
    reasons : dict of str to str
        Why a way is missing.
    """

    ties: TiePoints
    from_pixels: bool
    orientations: dict[str, RelativeOrientation]
    fits: dict[str, Refined]
    reasons: dict[str, str]

    @property
    def orientation(self) -> RelativeOrientation:
        """Refined by rotations, or as it was where tie points do not determine them."""
        return self.orientations.get(ROTATIONS, self.orientations[BEFORE])

    @property
    def kept(self) -> TiePoints:
        """The tie points without the rejected ones."""
        fit = self.fits.get(ROTATIONS)
        return self.ties if fit is None else self.ties[~fit.rejected]

    def overlaps(self, way: str) -> list[Overlap]:
        """Return the differences that are left in all overlaps."""
        return overlaps(self.kept, self.orientations[way])

    def each(self) -> list[tuple[RelativeOrientation, TiePoints]]:
        """Return the heads refined by rotations at every exposure by itself, and its tie points.

        Parallax of another flying height is then no error. Empty where the tie points of an
        exposure do not determine them, and where there is one exposure only.
        """
        exposures = np.unique(self.kept.exposure_idx)
        parts = [self.kept[self.kept.exposure_idx == exposure] for exposure in exposures]
        if len(parts) < 2 or not self.from_pixels:
            return []
        try:
            return [
                (refine_by_rotations(self.orientations[BEFORE], part).orientation, part)
                for part in parts
            ]
        except AdjustmentError:
            return []


# --- steps -----------------------------------------------------------------------------------


def refine(flight: Flight, orientation: RelativeOrientation, found: FoundTies | None) -> Refinement:
    """Refine the heads by their tie points.

    Parameters
    ----------
    flight : Flight
    orientation : RelativeOrientation
    found : FoundTies or None
        From pixels; None takes the points that two heads measured at one exposure.
    """
    ties = shared_points(flight.blocks["heads"], orientation) if found is None else found.ties
    orientations, fits, reasons = {BEFORE: orientation}, {}, {}
    for free, way in BY.items():
        try:
            fits[way] = refine_by_rotations(orientation, ties, free=free)
            orientations[way] = fits[way].orientation
        except AdjustmentError as error:
            reasons[way] = str(error)
    if len(ties):
        rejected = fits[ROTATIONS].rejected if fits else np.zeros(len(ties), dtype=bool)
        orientations[MEAN] = refine_by_mean_differences(orientation, ties[~rejected])
    return Refinement(
        ties=ties,
        from_pixels=found is not None,
        orientations=orientations,
        fits=fits,
        reasons=reasons,
    )


def records(refinement: Refinement) -> list[Record]:
    """Return what the stage leaves in a results folder."""
    reason = refinement.reasons.get(ROTATIONS)
    if reason is not None:
        return [of_left_out("synthetic", "refined", reason)]
    fit = refinement.fits[ROTATIONS]
    n_turned = len(refinement.orientation.heads) - 1 - len(fit.unreached)
    n_observations, n_unknowns = 2 * len(refinement.kept), 3 * n_turned
    said = {
        "n_observations": n_observations,
        "n_unknowns": n_unknowns,
        "redundancy": n_observations - n_unknowns,
        "sigma0_squared": fit.sigma0**2,
        "n_rejected": int(fit.rejected.sum()),
    }
    return [of_relative_orientation("synthetic", "refined", refinement.orientation, **said)]


# --- tables ----------------------------------------------------------------------------------


def overlap_table(flight: Flight, refinement: Refinement) -> pd.DataFrame:
    """Return the overlaps of the heads: area, tie points, differences before and after, px."""
    synthetic = synthetic_camera(flight)
    before = refinement.orientations[BEFORE]
    seen = coverage(before, synthetic).seen
    megapixels = 1e-6 * synthetic.width_px * synthetic.height_px
    after = overlaps(refinement.kept, refinement.orientation)
    rows = []
    for old, new in zip(refinement.overlaps(BEFORE), after, strict=True):
        a, b = old.head_a, old.head_b
        share = float(np.mean(seen[a] & seen[b]))
        rows.append(
            {
                "Heads": " and ".join(before.heads[k].name for k in (a, b)),
                "Area (Mpx)": f"{share * megapixels:.1f}",
                "Tie points": f"{len(old.d)}",
                Markup("Mean $x$, $y$ before (px)"): _pair(old.mean / synthetic.pixel_mm),
                "after (px)": _pair(new.mean / synthetic.pixel_mm),
                "RMS before (px)": f"{_rms([old]) / synthetic.pixel_mm:.3f}",
                "RMS after (px)": f"{_rms([new]) / synthetic.pixel_mm:.3f}",
            }
        )
    return pd.DataFrame(rows or [NO_TIES])


def _pair(values: np.ndarray) -> str:
    return ", ".join(f"{value:+.2f}" for value in values)


def _rms(found: Sequence[Overlap]) -> float:
    """Return the root mean square of one coordinate's differences, mm."""
    return float(np.sqrt(np.mean(np.concatenate([o.d for o in found]) ** 2)))


def ways_table(flight: Flight, refinement: Refinement) -> pd.DataFrame:
    """Return what every way to refine leaves in the overlaps, and what it moves in the frame."""
    if not len(refinement.ties):
        return pd.DataFrame([NO_TIES])
    rows = []
    for way in (BEFORE, MEAN, *BY.values()):
        if way in refinement.orientations:
            found = [(refinement.orientations[way], refinement.kept)]
            rows.append(_way_row(flight, refinement, way, found))
    each = refinement.each()
    if each:
        rows.append(_way_row(flight, refinement, EACH, each))
    return pd.DataFrame(rows)


def _way_row(
    flight: Flight,
    refinement: Refinement,
    way: str,
    found: Sequence[tuple[RelativeOrientation, TiePoints]],
) -> dict[str, str]:
    """Return the row of a way to refine, whose heads may differ between exposures."""
    synthetic = synthetic_camera(flight)
    pixel = synthetic.pixel_mm
    left = [overlap for heads, ties in found for overlap in overlaps(ties, heads)]
    moved = [
        frame_differences(refinement.orientations[BEFORE], heads, synthetic) for heads, _ in found
    ]
    sigma0 = f"{refinement.fits[way].sigma0:.2f}" if way in refinement.fits else ""
    return {
        "Refined by": way,
        "RMS of the differences (px)": f"{_rms(left) / pixel:.3f}",
        "largest mean of an overlap (px)": f"{np.abs([o.mean for o in left]).max() / pixel:.3f}",
        "σ₀": sigma0,
        "moves the frame by, RMS (px)": f"{np.mean([m.rms_px for m in moved]):.2f}",
        "at most (px)": f"{max(m.largest_px for m in moved):.2f}",
    }


def turns_table(refinement: Refinement) -> pd.DataFrame:
    """Return how the refinement turns every head, with the standard deviations after it."""
    before, after = refinement.orientations[BEFORE], refinement.orientation
    turned_by = np.degrees(after.opk - before.opk)
    sigma = np.degrees(after.sigma[:, 3:])
    names = ("\\omega", "\\varphi", "\\kappa")
    return pd.DataFrame(
        [
            {"Head": head.name}
            | {
                Markup(f"${name}_c$ (0.001°)"): Markup(
                    f"{1000 * turned_by[k, j]:+.2f} ± {1000 * sigma[k, j]:.2f}"
                )
                for j, name in enumerate(names)
            }
            for k, head in enumerate(before.heads)
        ]
    )


def repaired_table(flight: Flight, orientation: RelativeOrientation, *, seed: int) -> pd.DataFrame:
    """Return what the ways to refine make of heads that are wrong by known amounts.

    Parameters
    ----------
    flight : Flight
    orientation : RelativeOrientation
        Taken for the truth.
    seed : int
    """
    synthetic = synthetic_camera(flight)
    rng = np.random.default_rng(seed)
    wrong = {
        f"heads turned by {TURNED_DEG:g}°": [
            with_turned_heads(orientation, rng=rng, sigma_deg=TURNED_DEG) for _ in range(TRIALS)
        ]
    }
    if printed.applies(flight):
        wrong["interiors wrong by Table 1's σ"] = [
            with_wrong_interiors(orientation, rng=rng) for _ in range(TRIALS)
        ]
    ties, exact = (
        simulated_ties(orientation, synthetic, rng=rng, sigma_px=sigma) for sigma in (TIE_PX, 0.0)
    )
    return pd.DataFrame(
        [
            {"Errors": errors, "Refined by": WORDS[way], **_in_pixels(found)}
            for errors, draws in wrong.items()
            for way, found in refinements(orientation, draws, synthetic, ties, exact=exact).items()
        ]
    )


def _in_pixels(found: FrameErrors) -> dict[str, str]:
    return {
        "Overlaps, RMS (px)": f"{np.median(found.overlap_rms_px):.3f}",
        "at most (px)": f"{np.median(found.overlap_largest_px):.3f}",
        "Frame, RMS (px)": f"{np.median(found.frame_rms_px):.3f}",
        "at most in the frame (px)": f"{np.median(found.frame_largest_px):.3f}",
    }


# --- sentences -------------------------------------------------------------------------------


def quality(flight: Flight, refinement: Refinement) -> str:
    """Say how well the heads fit together, beside the paper's statement."""
    if not len(refinement.ties):
        return "No two heads share a tie point at an exposure, so nothing can be refined."
    pixel = synthetic_camera(flight).pixel_mm
    left = overlaps(refinement.kept, refinement.orientation)
    rms = _rms(left)
    before, after = (
        np.abs([o.mean for o in part]).max() / pixel for part in (refinement.overlaps(BEFORE), left)
    )
    count, dropped = len(refinement.kept), len(refinement.ties) - len(refinement.kept)
    ours = (
        f"{count} tie points ({dropped} more contradict them and are left out) differ by "
        f"{rms / pixel:.3f} px RMS in one coordinate after the refinement by rotations; the "
        f"largest mean of an overlap falls from {before:.2f} to {after:.3f} px. A difference has "
        f"the errors of two heads; one head's share is {1000 * rms / np.sqrt(2):.2f} µm"
    )
    if not printed.applies(flight):
        return f"{ours}."
    said = printed.statement("synthetic_quality_um"), printed.statement("synthetic_quality_px")
    return (
        f"{ours}, and the paper says of the residuals of its synthetic image around "
        f"{said[0]:g} µm, {said[1]:g} px."
    )
