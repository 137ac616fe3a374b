"""One response of a flight's heads from a few exposures, so that neighbouring images agree."""

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
"""Number of exposures, spread over the flight, from which the response is estimated."""

SEED = 4
"""Seed of the positions where grey values are compared."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightResponse:
    """The response of a flight's heads, and the exposures from which it was estimated.

    Attributes
    ----------
    fit : ResponseFit
    exposures : tuple of str
        Exposures with good files.
    """

    fit: ResponseFit
    exposures: tuple[str, ...]

    def __str__(self) -> str:
        """Return a sentence on its exposures, and on differences of heads before and after."""
        before, after = (
            100 * np.nanmax([0.0, *(v for o in self.fit.overlaps for v in getattr(o, name))])
            for name in ("before", "after")
        )  # NaN for an overlap that is completely dark or saturated
        return (
            f"response of the heads from {', '.join(self.exposures)}: overlaps disagree by at most "
            f"{before:.1f} % before and {after:.1f} % after"
        )


def spread(files: Sequence[HeadFiles]) -> list[HeadFiles]:
    """Return up to `EXPOSURES` of a flight's exposures, evenly spread from first to last."""
    at = np.linspace(0, len(files) - 1, min(len(files), EXPOSURES)).round().astype(int)
    return [files[i] for i in at]


def estimate_flight_response(
    files: Sequence[HeadFiles], orientation: RelativeOrientation, synthetic: Camera
) -> FlightResponse | None:
    """Estimate one response from several exposures.

    Parameters
    ----------
    files : sequence of HeadFiles
        Exposures with bad files, or with another number of bands than the first good one, are
        not used.
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
    """Return the samples of one exposure; empty where its files are not good."""
    try:
        heads = read_heads(files.paths, orientation.heads)
    except FlightError:
        return []  # the problem is reported when this exposure is rendered
    reduced = reduced_heads(orientation, heads.reduction)
    camera = reduced_camera(synthetic, heads.reduction)
    if check_overlaps(heads.images, reduced, camera):
        return []
    return overlap_samples(heads.images, reduced, camera, rng=rng)
