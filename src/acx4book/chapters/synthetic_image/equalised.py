"""The response of the heads, and the synthetic image that is made with it (sections 2.1, 4.1)."""

from __future__ import annotations

import numpy as np

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Raster
from acx4lib.stages.pictures import Pictures
from acx4lib.synthetic_image.frame import reduced_heads
from acx4lib.synthetic_image.grey_samples import overlap_samples
from acx4lib.synthetic_image.rendering import FEATHER_PX, render, render_plan
from acx4lib.synthetic_image.response import ResponseFit, fit_response


def response(
    pictures: Pictures | None, orientation: RelativeOrientation, *, seed: int
) -> ResponseFit | None:
    """Estimate the response of the heads from the overlaps of all pictures.

    Parameters
    ----------
    pictures : Pictures or None
    orientation : RelativeOrientation
        Refined, of the full-size heads.
    seed : int
        Of the places that are compared.

    Returns
    -------
    ResponseFit or None
        None where there are no pictures.
    """
    if pictures is None:
        return None
    heads = reduced_heads(orientation, pictures.reduction)
    rng = np.random.default_rng(seed)
    samples = [
        part
        for one in pictures.exposed
        for part in overlap_samples(one.images, heads, pictures.synthetic, rng=rng)
    ]
    bands = pictures.exposed[0].images[0].shape[2]
    return fit_response(samples, n_heads=len(heads.heads), n_bands=bands)


def image(
    pictures: Pictures | None,
    orientation: RelativeOrientation,
    response: ResponseFit | None,
    *,
    feather_px: float = FEATHER_PX,
) -> Raster | None:
    """Render the synthetic image of the middle exposure.

    Parameters
    ----------
    pictures : Pictures or None
    orientation : RelativeOrientation
        Refined, of the full-size heads.
    response : ResponseFit or None
        None leaves grey values as the heads took them.
    feather_px : float
        At full size; 0 is a hard seam.

    Returns
    -------
    ndarray, shape (rows, cols, bands), or None
        None where there are no pictures.
    """
    if pictures is None:
        return None
    plan = render_plan(
        reduced_heads(orientation, pictures.reduction),
        pictures.synthetic,
        response=None if response is None else response.response,
        feather_px=feather_px / pictures.reduction,
    )
    return render(plan, pictures.middle.images)
