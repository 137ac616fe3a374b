"""The response of a flight's heads from a few of its exposures, so that neighbours agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera
from acx4lib.production.head_images import HeadFiles, read_heads
from acx4lib.synthetic_image.frame import reduced_camera, reduced_heads
from acx4lib.synthetic_image.grey_samples import Samples, overlap_samples
from acx4lib.synthetic_image.response import ResponseFit, fit_response
from acx4lib.tie_points.overlap_check import check_overlaps

EXPOSURES = 3
"""The response is estimated from so many exposures, spread over the flight."""

SEED = 4
"""Of the places where grey values are compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightResponse:
    """What a flight's response was estimated from.

    Attributes
    ----------
    fit : ResponseFit
    exposures : tuple of str
        Those whose files are good.
    """

    fit: ResponseFit
    exposures: tuple[str, ...]

    def __str__(self) -> str:
        """Say from what, and how far heads disagree before and after."""
        before, after = (
            100 * np.nanmax([0.0, *(v for o in self.fit.overlaps for v in getattr(o, name))])
            for name in ("before", "after")
        )  # NaN where an overlap is all dark or saturated
        return (
            f"response of the heads from {', '.join(self.exposures)}: overlaps disagree by at most "
            f"{before:.1f} % before and {after:.1f} % after"
        )


def spread(files: Sequence[HeadFiles]) -> list[HeadFiles]:
    """Return up to `EXPOSURES` of a flight's exposures, evenly from first to last."""
    at = np.linspace(0, len(files) - 1, min(len(files), EXPOSURES)).round().astype(int)
    return [files[i] for i in at]


def estimate_flight_response(
    files: Sequence[HeadFiles], orientation: RelativeOrientation, synthetic: Camera
) -> FlightResponse | None:
    """Estimate one response from several exposures.

    Parameters
    ----------
    files : sequence of HeadFiles
        An exposure whose files are not good, or that has other bands than the first good one, has
        no part in it.
    orientation : RelativeOrientation
        At full size.
    synthetic : Camera

    Returns
    -------
    FlightResponse or None
        None where no exposure is good, or no two heads overlap.
    """
    rng = np.random.default_rng(SEED)
    samples: list[Samples] = []
    used: list[str] = []
    n_bands = 0
    for one in files:
        found = _samples(one, orientation, synthetic, rng)
        bands = found[0].log_ratio.shape[1] if found else 0
        if found and bands == (n_bands or bands):
            samples += found
            used.append(one.exposure)
            n_bands = bands
    if not samples:
        return None
    fit = fit_response(samples, n_heads=len(orientation.heads), n_bands=n_bands)
    return FlightResponse(fit=fit, exposures=tuple(used))


def _samples(
    files: HeadFiles,
    orientation: RelativeOrientation,
    synthetic: Camera,
    rng: np.random.Generator,
) -> list[Samples]:
    """Return the samples of one exposure; none where its files are not good."""
    try:
        heads = read_heads(files.paths, orientation.heads)
    except FlightError:
        return []  # said when this exposure is rendered
    reduced = reduced_heads(orientation, heads.reduction)
    camera = reduced_camera(synthetic, heads.reduction)
    if check_overlaps(heads.images, reduced, camera):
        return []
    return overlap_samples(heads.images, reduced, camera, rng=rng)
