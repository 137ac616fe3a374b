"""Tables of the synthetic image: Table 2, tie points, refinements, transferred points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.myst import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4files.flight.reader import Flight
from acx4files.stages.synthetic import Refinement
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera
from acx4lib.synthetic_image.transferred_points import TransferredPoints
from acx4lib.tie_points.refinement import frame_differences
from acx4lib.tie_points.ties import Overlap, TiePoints, overlaps

WAYS = {
    "before": "as calibrated",
    "mean shift": "mean differences",
    "rotations": "three rotations",
    "six": "rotations and places",
}
"""Names of the refinements for readers."""

EACH = "three rotations, each exposure by itself"

RMS, EVERY = "RMS of the differences (px)", "with those left out (px)"
LARGEST = "largest mean of an overlap (px)"

FORMATS = {
    **dict.fromkeys((RMS, EVERY, LARGEST), ".3f"),
    **dict.fromkeys(("σ₀", "moves the frame by, RMS (px)", "at most (px)"), ".2f"),
}

# --- the frame -------------------------------------------------------------------------------


def table_2(flight: Flight, synthetic: Camera) -> pd.DataFrame:
    """Return the main parameters of the synthetic image, beside those of Table 2."""
    values = {
        "width_px": (synthetic.width_px, "px"),
        "height_px": (synthetic.height_px, "px"),
        "pixel_um": (1000 * synthetic.pixel_mm, "µm"),
        "width_mm": (synthetic.width_px * synthetic.pixel_mm, "mm"),
        "height_mm": (synthetic.height_px * synthetic.pixel_mm, "mm"),
        "f_mm": (synthetic.interior.f, "mm"),
    }
    index = [(LABELS[name], unit) for name, (_, unit) in values.items()]
    table = pd.DataFrame(
        {"value": [f"{value:.6g}" for value, _ in values.values()]},
        index=pd.MultiIndex.from_tuples(index, names=["parameter", "unit"]),
    )
    if printed.applies(flight):
        table["paper"] = [printed.printed(2, name, "SYN") for name in values]
    return table


def seen(shares: Mapping[str, Sequence[float]]) -> pd.DataFrame:
    """Return the shares of the synthetic image by the number of heads that see them, per cent.

    Parameters
    ----------
    shares : mapping of str to sequence of float
        Seen by none, one, two, ... of the heads, by the title of the column.
    """
    table = 100 * pd.DataFrame(shares)
    names = ["no head", "1 head", *(f"{n} heads" for n in table.index[2:])]
    table.index = pd.Index(names, name="seen by")
    table.attrs["formats"] = dict.fromkeys(table, ".2f")
    return table


def printed_heads(flight: Flight) -> dict[str, RelativeOrientation]:
    """Return the heads of Table 1 as printed, by a title; nothing for other cameras."""
    if not printed.applies(flight):
        return {}
    n = len(printed.HEADS)
    heads = RelativeOrientation(
        heads=tuple(
            flight.cameras[name].with_interior(printed.interior(1, name)) for name in printed.HEADS
        ),
        xyz_mm=np.stack([printed.centre_mm(name) for name in printed.HEADS]),
        opk=np.stack([printed.opk(name) for name in printed.HEADS]),
        cov_joint=np.zeros((16 * n, 16 * n)),
        n_exposures=int(printed.statement("block_1_images")),
    )
    return {"the paper's Table 1 as printed (%)": heads}


# --- points transferred from the heads -------------------------------------------------------


def transferred_points(
    flight: Flight, transferred: Mapping[str, TransferredPoints]
) -> pd.DataFrame:
    """Count the points measured in heads and transferred from them, a row for each block."""
    rows = {}
    for name, points in transferred.items():
        sigma = np.median(points.sigma_px, axis=0) if len(points) else np.full(2, np.nan)
        measured = len(flight.block(name).image_points)
        rows[name] = [
            *(measured, len(points) + points.n_left_out, points.n_left_out, len(points)),
            *sigma,
        ]
    columns = ["Measured in heads", "Points of exposures", "outside the frame", "Transferred"]
    table = pd.DataFrame.from_dict(
        rows, orient="index", columns=[*columns, "σ col (px)", "σ row (px)"]
    )
    table.index.name = "block"
    table.attrs["formats"] = dict.fromkeys(table.columns[4:], ".2f")
    return table


# --- tie points and refinements --------------------------------------------------------------


def ways(refinement: Refinement, synthetic: Camera) -> pd.DataFrame:
    """Return the differences in the overlaps after each refinement, and its moves of the frame.

    Parameters
    ----------
    refinement : Refinement
    synthetic : Camera
        Its pixels are the unit.

    Returns
    -------
    DataFrame
        A row for each available way of `WAYS`, and for `EACH`; none without tie points.
    """
    kept, rows = refinement.kept, {}
    for way in WAYS if len(refinement.ties) else ():
        if way in refinement.orientations:
            heads = refinement.orientations[way]
            row = _left([(heads, kept)], refinement.before, synthetic)
            row[EVERY] = _rms_mm(overlaps(refinement.ties, heads)) / synthetic.pixel_mm
            row |= {"σ₀": refinement.fits[way].sigma0} if way in refinement.fits else {}
            rows[WAYS[way]] = row
    each = refinement.each() if rows else []
    if each:
        rows[EACH] = _left(each, refinement.before, synthetic)
    table = pd.DataFrame.from_dict(rows, orient="index", columns=list(FORMATS), dtype=float)
    table.index.name = "refined by"
    table.attrs["formats"] = FORMATS
    return table


def _left(
    refined: Sequence[tuple[RelativeOrientation, TiePoints]],
    before: RelativeOrientation,
    synthetic: Camera,
) -> dict[str, float]:
    """Return the differences by pairs of heads and tie points, and the moves of the frame, px."""
    remaining = [overlap for heads, ties in refined for overlap in overlaps(ties, heads)]
    moved = [
        frame_differences(before, heads, synthetic) for heads, _ in refined if heads is not before
    ]
    return {
        RMS: _rms_mm(remaining) / synthetic.pixel_mm,
        LARGEST: float(np.abs([o.mean for o in remaining]).max()) / synthetic.pixel_mm,
        "moves the frame by, RMS (px)": float(np.mean([m.rms_px for m in moved] or [0.0])),
        "at most (px)": max((m.largest_px for m in moved), default=0.0),
    }


def _rms_mm(pairs: Sequence[Overlap]) -> float:
    """Return the root mean square of one coordinate's differences, mm."""
    return float(np.sqrt(np.mean(np.concatenate([o.d for o in pairs]) ** 2)))


def between_exposures(refinement: Refinement) -> float:
    """Return the ratio of the turns' σ by their scatter between exposures to the stated σ.

    Returns
    -------
    float
        Root mean square over the angles of all turned heads; NaN where the exposures have no
        refinement of their own.
    """
    each, fit = refinement.each(), refinement.fits.get("rotations")
    if not each or fit is None:
        return float("nan")
    turned = fit.turn_sigma > 0
    turn = np.stack([heads.opk - refinement.orientation.opk for heads, _ in each])
    off = ((turn + np.pi) % (2 * np.pi) - np.pi)[:, turned]
    sigma = off.std(axis=0, ddof=1) / np.sqrt(len(each))
    return float(np.sqrt(np.mean((sigma / fit.turn_sigma[turned]) ** 2)))


def turns(refinement: Refinement) -> pd.DataFrame:
    """Return the turns of every head by the refinement, with standard deviations, 0.001°.

    Returns
    -------
    DataFrame
        ``value`` and ``sigma`` of each angle; the sigma of a head that is not turned is NaN.
    """
    before, fit = refinement.before, refinement.fits.get("rotations")
    angles = refinement.orientation.opk - before.opk
    turned = np.degrees((angles + np.pi) % (2 * np.pi) - np.pi)  # also from 180° to -180°
    sigma = np.full_like(turned, np.nan) if fit is None else np.degrees(fit.turn_sigma)
    names, columns = [head.name for head in before.heads], {}
    if fit is not None:
        still = [names.index(name) for name in (fit.held, *fit.unreached)]
        turned[still], sigma[still] = 0.0, np.nan
    for j, name in enumerate(("\\omega", "\\varphi", "\\kappa")):
        title = Markup(f"${name}_c$ (0.001°)")
        columns[(title, "value")] = 1000 * turned[:, j]
        columns[(title, "sigma")] = 1000 * sigma[:, j]
    return pd.DataFrame(columns, index=pd.Index(names, name="head"))
