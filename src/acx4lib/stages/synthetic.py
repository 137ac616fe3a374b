"""The geometry of the synthetic image and its refinement (section 2.1, Table 2, Figure 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib import paper, results
from acx4lib.camera import Camera
from acx4lib.errors import AdjustmentError
from acx4lib.experiments import misfit, turned
from acx4lib.flight import Flight
from acx4lib.records import Record, of_left_out, of_relative_orientation
from acx4lib.relative_orientation import RelativeOrientation
from acx4lib.restored import read_relative_orientation
from acx4lib.synthetic_image import coverage
from acx4lib.tables import LABELS
from acx4lib.tie_points import Overlap, TiePoints, overlaps, refine_by_mean_differences
from acx4lib.tie_points import shared_points as shared

ORIENTED = "heads/relative_orientation"
NO_TIES = {"Heads": "no two of them share a tie point"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Refinement:
    """The heads before and after the refinement by mean differences.

    Attributes
    ----------
    ties : TiePoints
    before, after : list of Overlap
    orientation : RelativeOrientation
        Refined; as it was where there are no tie points.
    """

    ties: TiePoints
    before: list[Overlap]
    after: list[Overlap]
    orientation: RelativeOrientation


# --- steps -----------------------------------------------------------------------------------


def synthetic_camera(flight: Flight) -> Camera:
    """Return the camera whose image the heads are put together to."""
    if flight.synthetic is None:
        msg = "flight.toml has no table [synthetic]"
        raise ValueError(msg)
    return flight.cameras[flight.synthetic.camera]


def read_heads(flight: Flight, results_path: str | Path) -> RelativeOrientation:
    """Return the oriented heads as the stage before left them.

    Raises
    ------
    FlightError
        Where that stage has not been run.
    AdjustmentError
        Where it could not orient the heads.
    """
    found = results.read(results_path)
    reasons = results.messages(found.summary.get(ORIENTED, {}), "left_out")
    if reasons:
        raise AdjustmentError("; ".join(reasons))
    return read_relative_orientation(found, ORIENTED, flight.cameras)


def refine(flight: Flight, orientation: RelativeOrientation) -> Refinement:
    """Refine the heads by the points that two of them measured at one exposure."""
    ties = shared(flight.blocks["heads"], orientation)
    refined = refine_by_mean_differences(orientation, ties) if len(ties) else orientation
    return Refinement(
        ties=ties,
        before=overlaps(ties, orientation),
        after=overlaps(ties, refined),
        orientation=refined,
    )


def records(refinement: Refinement) -> list[Record]:
    """Return what the stage leaves in a results folder."""
    if not len(refinement.ties):
        reason = "no two heads share a tie point at an exposure"
        return [of_left_out("synthetic", "refined", reason)]
    return [of_relative_orientation("synthetic", "refined", refinement.orientation)]


# --- tables ----------------------------------------------------------------------------------


def table_2(flight: Flight) -> pd.DataFrame:
    """Return the main parameters of the synthetic image, beside those of Table 2."""
    camera = synthetic_camera(flight)
    values = {
        "width_px": (camera.width_px, "px"),
        "height_px": (camera.height_px, "px"),
        "pixel_um": (1000 * camera.pixel_mm, "µm"),
        "width_mm": (camera.width_px * camera.pixel_mm, "mm"),
        "height_mm": (camera.height_px * camera.pixel_mm, "mm"),
        "f_mm": (camera.interior.f, "mm"),
    }
    rows = []
    for name, (value, unit) in values.items():
        row = {"Parameter": LABELS[name], "Unit": unit, "Value": f"{value:.6g}"}
        if paper.applies(flight):
            row["Printed"] = paper.printed(2, name, "SYN")
        rows.append(row)
    return pd.DataFrame(rows)


def coverage_table(flight: Flight, orientation: RelativeOrientation) -> pd.DataFrame:
    """Return which share of the synthetic image how many heads see, beside Table 1's heads."""
    synthetic = synthetic_camera(flight)
    shares = {"Share (%)": coverage(orientation, synthetic).share}
    if paper.applies(flight):
        shares["Table 1 as printed (%)"] = coverage(printed_heads(flight), synthetic).share
    cells = {name: [f"{100 * one:.2f}" for one in share] for name, share in shares.items()}
    table = pd.DataFrame(cells)
    table.insert(0, "Seen by", ["no head", "1 head", *(f"{n} heads" for n in table.index[2:])])
    return table


def printed_heads(flight: Flight) -> RelativeOrientation:
    """Return the heads of Table 1 as printed, for a flight with the paper's cameras."""
    n = len(paper.HEADS)
    return RelativeOrientation(
        heads=tuple(
            flight.cameras[name].with_interior(paper.interior(1, name)) for name in paper.HEADS
        ),
        xyz_mm=np.stack([paper.centre_mm(name) for name in paper.HEADS]),
        opk=np.stack([paper.opk(name) for name in paper.HEADS]),
        cov_joint=np.zeros((15 * n, 15 * n)),
        n_exposures=int(paper.statement("block_1_images")),
    )


def overlap_table(
    flight: Flight, orientation: RelativeOrientation, refinement: Refinement
) -> pd.DataFrame:
    """Return the overlaps of the heads: area, tie points, differences before and after, px."""
    synthetic = synthetic_camera(flight)
    seen = coverage(orientation, synthetic).seen
    megapixels = 1e-6 * synthetic.width_px * synthetic.height_px
    rows = []
    for before, after in zip(refinement.before, refinement.after, strict=True):
        a, b = before.head_a, before.head_b
        share = float(np.mean(seen[a] & seen[b]))
        rows.append(
            {
                "Heads": " and ".join(orientation.heads[k].name for k in (a, b)),
                "Area (Mpx)": f"{share * megapixels:.1f}",
                "Tie points": f"{len(before.d)}",
                "Mean $x$, $y$ before (px)": _pair(before.mean / synthetic.pixel_mm),
                "after (px)": _pair(after.mean / synthetic.pixel_mm),
                "RMS before (px)": f"{_rms(before) / synthetic.pixel_mm:.2f}",
                "RMS after (px)": f"{_rms(after) / synthetic.pixel_mm:.2f}",
            }
        )
    return pd.DataFrame(rows or [NO_TIES])


def _pair(values: np.ndarray) -> str:
    return ", ".join(f"{value:+.2f}" for value in values)


def _rms(overlap: Overlap) -> float:
    """Return the root mean square of one coordinate's differences, mm."""
    return float(np.sqrt(np.mean(overlap.d**2)))


def shift_table(orientation: RelativeOrientation, refinement: Refinement) -> pd.DataFrame:
    """Return what the refinement moves in every head, with the standard deviation after it."""
    moved = 1000 * (refinement.orientation.xyz_mm - orientation.xyz_mm)
    sigma = 1000 * refinement.orientation.sigma
    return pd.DataFrame(
        [
            {
                "Head": head.name,
                "$X_c$ moved by (µm)": f"{moved[k, 0]:+.2f}",
                "$Y_c$ moved by (µm)": f"{moved[k, 1]:+.2f}",
                "σ of $X_c$ (µm)": f"{sigma[k, 0]:.2f}",
                "σ of $Y_c$ (µm)": f"{sigma[k, 1]:.2f}",
            }
            for k, head in enumerate(orientation.heads)
        ]
    )


def turned_table(
    flight: Flight, orientation: RelativeOrientation, refinement: Refinement, *, kappa_deg: float
) -> pd.DataFrame:
    """Return what a wrong kappa of one head at a time does to the overlaps, px."""
    pixel = synthetic_camera(flight).pixel_mm
    rows = []
    for k, head in enumerate(orientation.heads if len(refinement.ties) else ()):
        wrong = turned(orientation, k, angle=float(np.radians(kappa_deg)))
        found = misfit(orientation, wrong, refinement.ties)
        rows.append(
            {
                "Turned head": f"{head.name} by {kappa_deg:g}°",
                "Added to the differences, RMS (px)": f"{found.systematic_mm / pixel:.2f}",
                "left after the mean shift, RMS (px)": f"{found.refined_mm / pixel:.2f}",
                "left at most (px)": f"{found.largest_mm / pixel:.2f}",
            }
        )
    return pd.DataFrame(rows or [NO_TIES])


# --- sentences -------------------------------------------------------------------------------


def rendering(flight: Flight) -> str:
    """Say whether the flight has pixels to render."""
    files = flight.image_files["heads"]
    n = sum(file is not None for file in files)
    if n == 0:
        return (
            "heads/images.csv names no files: this page shows the geometry only, and nothing is "
            "rendered."
        )
    return f"{n} of {len(files)} head images have files; this page uses their geometry only."


def quality(flight: Flight, refinement: Refinement) -> str:
    """Say how well the heads fit together, beside the paper's statement."""
    if not len(refinement.ties):
        return "No two heads share a tie point at an exposure, so nothing can be refined."
    pixel = synthetic_camera(flight).pixel_mm
    d = np.concatenate([overlap.d for overlap in refinement.after])
    rms = float(np.sqrt(np.mean(d**2)))
    means = [np.abs([o.mean for o in part]).max() for part in (refinement.before, refinement.after)]
    ours = (
        f"{len(d)} differences have an RMS of {rms / pixel:.2f} px in one coordinate after the "
        f"refinement; the largest mean of an overlap falls from {means[0] / pixel:.2f} to "
        f"{means[1] / pixel:.2f} px. A difference has the errors of two heads; one head's share is "
        f"{1000 * rms / np.sqrt(2):.1f} µm"
    )
    if not paper.applies(flight):
        return f"{ours}."
    said = paper.statement("synthetic_quality_um"), paper.statement("synthetic_quality_px")
    return (
        f"{ours}, and the paper says of the residuals of its synthetic image around "
        f"{said[0]:g} µm, {said[1]:g} px."
    )


def uncovered(flight: Flight, orientations: Sequence[RelativeOrientation]) -> str:
    """Say how much of the synthetic image no head sees with each reading of the angles."""
    synthetic = synthetic_camera(flight)
    none = [100 * coverage(orientation, synthetic).share[0] for orientation in orientations]
    return (
        f"As equation (6) has it, {none[0]:.1f} % of the synthetic image is seen by no head; with "
        f"transposed rotations it is {none[1]:.1f} %."
    )
