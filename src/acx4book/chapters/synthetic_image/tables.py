"""Tables of the synthetic image: Table 2, tie points, refinements, parallax."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4book.chapters.synthetic_image.parallax import flight_parallax
from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.flight.reader import Flight
from acx4lib.stages.synthetic import Refinement, SyntheticStage
from acx4lib.synthetic_image.frame import coverage
from acx4lib.tie_points.differences import frame_differences
from acx4lib.tie_points.ties import Overlap, TiePoints, overlaps

NO_PIXELS = {"Heads": "heads/images.csv names no files with pixels"}
NO_TIES = {"Heads": "no two of them share a tie point"}

WAYS = {
    "before": "as calibrated",
    "mean shift": "mean differences",
    "rotations": "three rotations",
    "six": "rotations and places",
}
"""What the ways to refine are called."""

EACH = "three rotations, each exposure by itself"

# --- the frame -------------------------------------------------------------------------------


def table_2(flight: Flight, stage: SyntheticStage) -> pd.DataFrame:
    """Return the main parameters of the synthetic image, beside those of Table 2."""
    synthetic = stage.synthetic
    values = {
        "width_px": (synthetic.width_px, "px"),
        "height_px": (synthetic.height_px, "px"),
        "pixel_um": (1000 * synthetic.pixel_mm, "µm"),
        "width_mm": (synthetic.width_px * synthetic.pixel_mm, "mm"),
        "height_mm": (synthetic.height_px * synthetic.pixel_mm, "mm"),
        "f_mm": (synthetic.interior.f, "mm"),
    }
    rows = []
    for name, (value, unit) in values.items():
        row = {"Parameter": LABELS[name], "Unit": unit, "Value": f"{value:.6g}"}
        if printed.applies(flight):
            row["Printed"] = printed.printed(2, name, "SYN")
        rows.append(row)
    return pd.DataFrame(rows)


def seen(flight: Flight, stage: SyntheticStage) -> pd.DataFrame:
    """Return which share of the synthetic image how many heads see, beside Table 1's heads."""
    synthetic = stage.synthetic
    shares = {"Share (%)": coverage(stage.orientation, synthetic).share}
    if printed.applies(flight):
        shares["Table 1 as printed (%)"] = coverage(printed_heads(flight), synthetic).share
    cells = {name: [f"{100 * one:.2f}" for one in share] for name, share in shares.items()}
    table = pd.DataFrame(cells)
    table.insert(0, "Seen by", ["no head", "1 head", *(f"{n} heads" for n in table.index[2:])])
    return table


def printed_heads(flight: Flight) -> RelativeOrientation:
    """Return the heads of Table 1 as printed, for a flight with the paper's cameras."""
    n = len(printed.HEADS)
    return RelativeOrientation(
        heads=tuple(
            flight.cameras[name].with_interior(printed.interior(1, name)) for name in printed.HEADS
        ),
        xyz_mm=np.stack([printed.centre_mm(name) for name in printed.HEADS]),
        opk=np.stack([printed.opk(name) for name in printed.HEADS]),
        cov_joint=np.zeros((15 * n, 15 * n)),
        n_exposures=int(printed.statement("block_1_images")),
    )


# --- points carried from the heads -----------------------------------------------------------


def carried(flight: Flight, stage: SyntheticStage) -> pd.DataFrame:
    """Return what became of the points that were measured in heads, a row for each block."""
    rows = []
    for name, points in stage.carried.items():
        measured = flight.block(name).image_points
        sigma = np.median(points.sigma_px, axis=0) if len(points) else np.full(2, np.nan)
        rows.append(
            {
                "Block": name,
                "Measured in heads": f"{len(measured)}",
                "Points of exposures": f"{len(points) + points.n_left_out}",
                "outside the frame": f"{points.n_left_out}",
                "Carried": f"{len(points)}",
                "σ col, row (px)": f"{sigma[0]:.2f}, {sigma[1]:.2f}",
            }
        )
    return pd.DataFrame(rows or [{"Block": "none is measured in heads"}])


# --- tie points and refinements --------------------------------------------------------------


def found(stage: SyntheticStage) -> pd.DataFrame:
    """Return what became of the corners of every overlap."""
    if stage.found is None:
        return pd.DataFrame([NO_PIXELS])
    heads = [head.name for head in stage.orientation.heads]
    rows = []
    for exposure, one in zip(stage.found.exposures, stage.found.overlaps, strict=True):
        rows.append(
            {
                "Exposure": exposure,
                "Heads": f"{heads[one.head_a]} and {heads[one.head_b]}",
                "Cells": f"{one.n_cells}",
                "with texture": f"{one.n_textured}",
                "correlated": f"{one.n_correlated}",
                "matched": f"{one.n_matched}",
                "consistent": f"{one.n_ties}",
            }
        )
    return pd.DataFrame(rows)


def ways(stage: SyntheticStage) -> pd.DataFrame:
    """Return what every way to refine leaves in the overlaps, and what it moves in the frame."""
    refinement = stage.refinement
    if not len(refinement.ties):
        return pd.DataFrame([NO_TIES])
    rows = []
    for way in WAYS:
        if way in refinement.orientations:
            found = [(refinement.orientations[way], refinement.kept)]
            rows.append(_way_row(stage, way, found))
    each = refinement.each()
    if each:
        rows.append(_way_row(stage, EACH, each))
    return pd.DataFrame(rows)


def _way_row(
    stage: SyntheticStage, way: str, found: Sequence[tuple[RelativeOrientation, TiePoints]]
) -> dict[str, str]:
    """Return the row of a way to refine, whose heads may differ between exposures."""
    synthetic, refinement = stage.synthetic, stage.refinement
    pixel = synthetic.pixel_mm
    left = [overlap for heads, ties in found for overlap in overlaps(ties, heads)]
    moved = [frame_differences(refinement.before, heads, synthetic) for heads, _ in found]
    sigma0 = f"{refinement.fits[way].sigma0:.2f}" if way in refinement.fits else ""
    return {
        "Refined by": WAYS.get(way, way),
        "RMS of the differences (px)": f"{rms_mm(left) / pixel:.3f}",
        "with those left out (px)": _with_left_out(refinement, way, pixel),
        "largest mean of an overlap (px)": f"{np.abs([o.mean for o in left]).max() / pixel:.3f}",
        "σ₀": sigma0,
        "moves the frame by, RMS (px)": f"{np.mean([m.rms_px for m in moved]):.2f}",
        "at most (px)": f"{max(m.largest_px for m in moved):.2f}",
    }


def _with_left_out(refinement: Refinement, way: str, pixel_mm: float) -> str:
    """Return the RMS over all tie points, those among them that the fit left out."""
    if way not in refinement.orientations:
        return ""
    every = overlaps(refinement.ties, refinement.orientations[way])
    return f"{rms_mm(every) / pixel_mm:.3f}"


def rms_mm(found: Sequence[Overlap]) -> float:
    """Return the root mean square of one coordinate's differences, mm."""
    return float(np.sqrt(np.mean(np.concatenate([o.d for o in found]) ** 2)))


def turns(refinement: Refinement) -> pd.DataFrame:
    """Return how the refinement turns every head, with the standard deviations of the turns."""
    before, fit = refinement.before, refinement.fits.get("rotations")
    after = before if fit is None else fit.orientation
    sigma = np.zeros_like(before.opk) if fit is None else np.degrees(fit.turn_sigma)
    turned_by = np.degrees(after.opk - before.opk)
    names = ("\\omega", "\\varphi", "\\kappa")
    return pd.DataFrame(
        [
            {"Head": head.name}
            | {
                Markup(f"${name}_c$ (0.001°)"): Markup(
                    f"{1000 * turned_by[k, j]:+.2f} ± {1000 * sigma[k, j]:.2f}" if k else "held"
                )
                for j, name in enumerate(names)
            }
            for k, head in enumerate(before.heads)
        ]
    )


def parallax(flight: Flight) -> pd.DataFrame:
    """Return the shifts between heads by the distance of their lenses, for this flight."""
    synthetic = flight.synthetic_camera
    if flight.heads is None or flight.synthetic is None or synthetic is None:
        return pd.DataFrame([NO_PIXELS])
    heads = [flight.cameras[name] for name in flight.synthetic.heads]
    try:
        found = flight_parallax(flight.heads, heads, synthetic)
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
