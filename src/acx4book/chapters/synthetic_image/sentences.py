"""Sentences about the synthetic image, with the numbers of a run beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acx4book.chapters.synthetic_image.tables import rms_mm
from acx4book.paper import printed
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.flight.reader import Flight
from acx4lib.stages.pictures import FoundTies, Pictures
from acx4lib.stages.synthetic import SyntheticStage
from acx4lib.synthetic_image.response import ResponseFit, poor_overlaps
from acx4lib.tie_points.ties import overlaps


def pixels(flight: Flight, pictures: Pictures | None) -> str:
    """Say which pixels the flight has, and at what size they are used."""
    files = flight.image_files["heads"]
    if pictures is None:
        return (
            "heads/images.csv names no files: this page shows the geometry only, and nothing is "
            "rendered."
        )
    n = sum(file is not None for file in files)
    picture = pictures.middle.images[0]
    rows, cols, bands = picture.shape
    size = (
        "at full size"
        if pictures.reduction == 1
        else f"at 1/{pictures.reduction} of the full size, {cols} × {rows} px"
    )
    names = ", ".join(shown(one.exposure) for one in pictures.exposed)
    return (
        f"{n} of {len(files)} head images have files, which makes {pictures.n_complete} complete "
        f"exposures; this page uses {names}, {size}, {bands} bands of "
        f"{8 * picture.dtype.itemsize} bit. Pixels in what follows are those of the "
        "full-size synthetic image, where nothing else is said."
    )


def ties(found: FoundTies | None) -> str:
    """Say how many tie points there are, beside the paper's number, and where there are few."""
    if found is None:
        return "Without pixels, the tie points are those that came with the flight."
    least = min((one.n_ties for one in found.overlaps), default=0)
    text = (
        f"{len(found.ties)} tie points in {len(found.overlaps)} overlaps, at least {least} in "
        f"each; their predicted standard deviation has a median of "
        f"{np.median(found.ties.sigma_px) if len(found.ties) else np.nan:.3f} head pixels at full "
        f"size. The paper has about {printed.statement('tie_points_per_overlap'):.0f} an overlap."
    )
    return " ".join([text, *(f"{shown(one.sentence)}." for one in found.overlaps if one.sentence)])


def refinement(flight: Flight, stage: SyntheticStage) -> str:
    """Say how well the heads fit together, beside the paper's statement."""
    refined = stage.refinement
    if not len(refined.ties):
        return "No two heads share a tie point at an exposure, so nothing can be refined."
    pixel = stage.synthetic.pixel_mm
    left = overlaps(refined.kept, refined.orientation)
    rms = rms_mm(left)
    before, after = (
        np.abs([o.mean for o in part]).max() / pixel for part in (refined.overlaps("before"), left)
    )
    count, dropped = len(refined.kept), len(refined.ties) - len(refined.kept)
    every: dict[str, float] = {
        way: rms_mm(overlaps(refined.ties, refined.orientations[way])) / pixel
        for way in ("mean shift", "rotations")
        if way in refined.orientations
    }
    ours = (
        f"{count} tie points differ by "
        f"{rms / pixel:.3f} px RMS in one coordinate after the refinement by rotations; the "
        f"largest mean of an overlap falls from {before:.3f} to {after:.3f} px. A difference has "
        f"the errors of two heads; one head's share is {1000 * rms / np.sqrt(2):.2f} µm"
        + _left_out(dropped, len(refined.ties), every)
    )
    if not printed.applies(flight):
        return f"{ours}."
    said = printed.statement("synthetic_quality_um"), printed.statement("synthetic_quality_px")
    return (
        f"{ours}, and the paper says of the residuals of its synthetic image around "
        f"{said[0]:g} µm, {said[1]:g} px."
    )


def _left_out(dropped: int, n: int, every: Mapping[str, float]) -> str:
    """Say how many tie points the fit left out, and what every way leaves with them."""
    if not dropped:
        return ""
    names = {"mean shift": "mean differences", "rotations": "rotations"}
    each = " and ".join(f"{value:.3f} px after {names[way]}" for way, value in every.items())
    return (
        f". The fit by rotations left out {dropped} of {n} tie points ({100 * dropped / n:.0f} %), "
        f"which disagree with it, so that these numbers favour it; with them the RMS is {each}"
    )


def response(orientation: RelativeOrientation, fit: ResponseFit | None) -> str:
    """Say how well the heads agree after equalisation, and what could not be estimated."""
    if fit is None:
        return "Without pixels there is nothing to equalise."
    after = np.array([one.after for one in fit.overlaps])
    before = np.array([one.before for one in fit.overlaps])
    floor = np.array([one.floor for one in fit.overlaps])
    names = [head.name for head in orientation.heads]
    text = (
        f"In the overlaps grey values disagree by {100 * np.nanmedian(before):.1f} % as they were "
        f"taken, and by {100 * np.nanmedian(after):.2f} % after equalisation; noise alone would "
        f"leave {100 * np.nanmedian(floor):.2f} %."
    )
    return " ".join([text, *(f"{shown(line)}." for line in poor_overlaps(fit, names))])


# --- the answer ------------------------------------------------------------------------------


def answer(flight: Flight, stage: SyntheticStage, fit: ResponseFit | None) -> str:
    """Say how well the heads fit to one image: one sentence, then what does not show there.

    Parameters
    ----------
    flight : Flight
    stage : SyntheticStage
    fit : ResponseFit or None
        Of the heads' grey values.
    """
    refined = stage.refinement
    if not len(refined.ties):
        return "It cannot be said: no two heads share a tie point at an exposure."
    rms = rms_mm(overlaps(refined.kept, refined.orientation))
    first = (
        f"Where heads overlap, one head's share of the differences is {1e3 * rms / np.sqrt(2):.1f} "
        f"µm in one coordinate, {rms / np.sqrt(2) / stage.synthetic.pixel_mm:.2f} px, at "
        f"{len(refined.kept)} of {len(refined.ties)} tie points"
    )
    if printed.applies(flight):
        said = printed.statement("synthetic_quality_um"), printed.statement("synthetic_quality_px")
        first += f"; the paper has residuals of around {said[0]:g} µm, {said[1]:g} px"
    return f"{first}.\n\n{_not_shown(fit)}"


def _not_shown(fit: ResponseFit | None) -> str:
    beyond = (
        "An overlap shows only what two heads have wrong against each other. Errors that all heads "
        "share, and those of the first head, deform the image without a trace there."
    )
    if fit is None:
        return beyond
    before, after = (
        100 * np.nanmedian([getattr(one, when) for one in fit.overlaps])
        for when in ("before", "after")
    )
    return (
        f"Grey values of two heads differ by {before:.1f} % as they were taken, and by "
        f"{after:.2f} % once their responses are taken out. {beyond}"
    )
