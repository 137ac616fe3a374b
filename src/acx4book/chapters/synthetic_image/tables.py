"""Tables and sentences on the pixels of the synthetic stage."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.synthetic_image.parallax import flight_parallax
from acx4book.chapters.synthetic_image.pixels import NO_PIXELS, FoundTies, Pictures, middle
from acx4book.chapters.synthetic_image.steps import synthetic_camera
from acx4book.paper import printed
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.flight import Flight
from acx4lib.synthetic_image.response import ResponseFit, poor_overlaps

BANDS = ("red", "green", "blue", "near infrared")


def rendering(flight: Flight, pictures: Pictures | None) -> str:
    """Say which pixels the flight has, and at what size they are used."""
    files = flight.image_files["heads"]
    if pictures is None:
        return (
            "heads/images.csv names no files: this page shows the geometry only, and nothing is "
            "rendered."
        )
    n = sum(file is not None for file in files)
    picture = middle(pictures).images[0]
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


def found_table(orientation: RelativeOrientation, found: FoundTies | None) -> pd.DataFrame:
    """Return what became of the corners of every overlap."""
    if found is None:
        return pd.DataFrame([NO_PIXELS])
    rows = []
    for exposure, one in zip(found.exposures, found.overlaps, strict=True):
        rows.append(
            {
                "Exposure": exposure,
                "Heads": " and ".join(orientation.heads[k].name for k in (one.head_a, one.head_b)),
                "Cells": f"{one.n_cells}",
                "with texture": f"{one.n_textured}",
                "correlated": f"{one.n_correlated}",
                "matched": f"{one.n_matched}",
                "consistent": f"{one.n_ties}",
            }
        )
    return pd.DataFrame(rows)


def found_sentence(found: FoundTies | None) -> str:
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


def parallax_table(flight: Flight) -> pd.DataFrame:
    """Return the shifts between heads by the distance of their lenses, for this flight."""
    if flight.heads is None or flight.synthetic is None:
        return pd.DataFrame([NO_PIXELS])
    heads = [flight.cameras[name] for name in flight.synthetic.heads]
    try:
        found = flight_parallax(flight.heads, heads, synthetic_camera(flight))
    except AdjustmentError as error:
        return pd.DataFrame([{"Heads": str(error)}])
    low, high = int(np.argmin(found.height_m)), int(np.argmax(found.height_m))
    return pd.DataFrame(
        [
            {
                "Lenses": label,
                "Base (m)": f"{found.base_m[i]:.2f}",
                f"Shift at {found.height_m[low]:.0f} m (px)": f"{found.shift_px[i, low]:.2f}",
                f"at {found.height_m[high]:.0f} m (px)": f"{found.shift_px[i, high]:.2f}",
                f"more on ground {found.relief_m:.0f} m higher (px)": (
                    f"{found.change_px[i, low]:.2f}"
                ),
            }
            for i, label in enumerate(found.labels)
        ]
    )


def response_table(orientation: RelativeOrientation, fit: ResponseFit | None) -> pd.DataFrame:
    """Return how far the grey values of heads disagree in the overlaps, before and after."""
    if fit is None:
        return pd.DataFrame([NO_PIXELS])
    rows = []
    for one in fit.overlaps:
        row = {"Heads": " and ".join(orientation.heads[k].name for k in (one.head_a, one.head_b))}
        for band, (before, after) in enumerate(zip(one.before, one.after, strict=True)):
            name = band_name(band, len(one.before))
            row[f"{name}, before (%)"] = f"{100 * before:.2f}"
            row["after (%)" if band == 0 else f"{name}, after (%)"] = f"{100 * after:.2f}"
        rows.append(row)
    return pd.DataFrame(rows)


def band_name(band: int, n_bands: int) -> str:
    """Return what a band is called."""
    return BANDS[band] if n_bands >= len(BANDS) - 1 else f"band {band + 1}"


def response_sentence(orientation: RelativeOrientation, fit: ResponseFit | None) -> str:
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
