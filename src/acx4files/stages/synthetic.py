"""The heads refined by tie points for the synthetic image (section 2.1, Table 2, Figure 1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acx4files.flight.reader import Flight
from acx4files.results import folder, provenance, tables
from acx4files.results.read_back import read_relative_orientation
from acx4files.stages.pictures import FoundTies, find, read_pictures
from acx4lib import shown
from acx4lib.attempts import Failed, attempt
from acx4lib.calibration.heads import RelativeOrientation, can_be_calibrated, declared_orientation
from acx4lib.errors import AdjustmentError
from acx4lib.synthetic_image.transferred_points import TransferredPoints, transfer
from acx4lib.tie_points.refinement import FREE, Refined, refine_by_rotations
from acx4lib.tie_points.ties import (
    Overlap,
    TiePoints,
    overlaps,
    refine_by_mean_differences,
    shared_points,
)

if TYPE_CHECKING:
    import pandas as pd

ORIENTED = "heads/relative_orientation"
"""Results with the orientation of the heads."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Refinement:
    """The heads before their refinement, and after it by every method.

    Attributes
    ----------
    ties : TiePoints
        All that were found; some may be rejected.
    from_pixels : bool
        Whether they were found in the pictures; otherwise the flight came with them.
    orientations : dict of str to RelativeOrientation
        ``before``, ``mean shift`` and the ways of `refinement.FREE`, those that the tie points
        determine.
    fits : dict of str to Refined
        By the ways of `refinement.FREE`.
    reasons : dict of str to str
        Why a way is missing.
    warnings : tuple of str
        Of overlaps without tie points, or with few.
    """

    ties: TiePoints
    from_pixels: bool
    orientations: dict[str, RelativeOrientation]
    fits: dict[str, Refined]
    reasons: dict[str, str]
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Summarize the refinement in one line."""
        ways = [way for way in self.orientations if way != "before"]
        return shown.line("Refinement", shown.count(len(self.ties), "tie point"), *ways)

    def table(self) -> pd.DataFrame:
        """Return the orientation of the heads before and after every refinement side by side."""
        return shown.side_by_side(self.orientations)

    @property
    def before(self) -> RelativeOrientation:
        """Orientation of the heads before the refinement."""
        return self.orientations["before"]

    @property
    def orientation(self) -> RelativeOrientation:
        """Orientation refined by rotations; unrefined if tie points do not determine them."""
        return self.orientations.get("rotations", self.before)

    @property
    def kept(self) -> TiePoints:
        """The tie points without the rejected ones."""
        fit = self.fits.get("rotations")
        return self.ties if fit is None else self.ties[~fit.rejected]

    def overlaps(self, way: str) -> list[Overlap]:
        """Return the remaining differences in all overlaps, after one of the methods."""
        return overlaps(self.kept, self.orientations[way])

    def each(self) -> list[tuple[RelativeOrientation, TiePoints]]:
        """Refine the heads by rotations at each exposure separately; return them with their ties.

        Parallax of another flying height is then no error. Empty where the tie points of an
        exposure do not determine them, and where there is one exposure only.
        """
        exposures = np.unique(self.kept.exposure_idx)
        parts = [self.kept[self.kept.exposure_idx == exposure] for exposure in exposures]
        if len(parts) < 2 or not self.from_pixels:
            return []
        try:
            return [(refine_by_rotations(self.before, part).orientation, part) for part in parts]
        except AdjustmentError:
            return []


def run(flight: Flight, results_path: str | Path, *, reduce: int = 1) -> Refinement:
    """Find the tie points of the heads, refine the heads by them, and write the results.

    Points measured in heads are transferred into the synthetic image by the refined heads.

    Parameters
    ----------
    flight : Flight
        With a block heads and a table [synthetic].
    results_path : path
        With the results of stage heads.
    reduce : int
        Number of pixels of the pictures, in each direction, that are averaged first.

    Raises
    ------
    FlightError
        Where the results of stage heads are missing, or a picture cannot be used.
    AdjustmentError
        Where stage heads could not orient the heads.
    ValueError
        Where flight.toml has no table [synthetic].
    """
    synthetic = flight.synthetic_camera
    if synthetic is None:
        raise ValueError("flight.toml has no table [synthetic]")
    orientation = read_heads(flight, results_path)
    pictures = read_pictures(flight, orientation, reduce=reduce)
    pixel_ties = find(pictures, orientation) if pictures else None
    refinement = refine(flight, orientation, pixel_ties)
    transferred = {
        name: transfer(flight.block(name), refinement.orientation, synthetic)
        for name in flight.transferred
    }
    write(flight, results_path, refinement, transferred)
    return refinement


def read_heads(flight: Flight, results_path: str | Path) -> RelativeOrientation:
    """Read the oriented heads: from stage heads, from the rig, or as declared.

    If no head can be calibrated separately, they are the rig's, if it has been adjusted.

    Raises
    ------
    FlightError
        Where that stage has not been run, or on another flight.
    AdjustmentError
        Where it could not orient the heads.
    """
    synthetic = flight.synthetic_camera
    calibrated = can_be_calibrated(flight.block("heads"))
    entry = folder.entries(Path(results_path)).get(ORIENTED, {})
    reasons = folder.messages(entry, "left_out")
    if synthetic is not None and not calibrated and (reasons or not entry):
        return declared_orientation([flight.cameras[n] for n in flight.head_names], synthetic)
    run_results = provenance.results_before(results_path, ["heads"], flight)
    if reasons:
        raise AdjustmentError("; ".join(reasons))
    return read_relative_orientation(run_results, ORIENTED, flight.cameras)


def refine(flight: Flight, orientation: RelativeOrientation, found: FoundTies | None) -> Refinement:
    """Refine the heads by their tie points.

    Parameters
    ----------
    flight : Flight
    orientation : RelativeOrientation
    found : FoundTies or None
        From pixels; None takes the points that two heads measured at one exposure.
    """
    ties = shared_points(flight.block("heads"), orientation) if found is None else found.ties
    fits = {way: attempt(refine_by_rotations, orientation, ties, free=way) for way in FREE}
    shifted = refine_by_mean_differences(orientation, kept(ties, fits["rotations"]))
    return gathered(orientation, ties, fits, shifted, found)


def kept(ties: TiePoints, fit: Refined | Failed) -> TiePoints:
    """Remove the tie points rejected by a refinement; keep all if it failed."""
    return ties[~fit.rejected] if isinstance(fit, Refined) else ties


def gathered(
    orientation: RelativeOrientation,
    ties: TiePoints,
    fits: Mapping[str, Refined | Failed],
    shifted: RelativeOrientation,
    found: FoundTies | None = None,
) -> Refinement:
    """Collect the refinements of the heads in one value.

    Parameters
    ----------
    orientation : RelativeOrientation
        Before the refinements.
    ties : TiePoints
    fits : mapping of str to Refined or Failed
        By rotations, by the ways of `refinement.FREE`.
    shifted : RelativeOrientation
        By mean differences; not used without tie points.
    found : FoundTies, optional
        Where the tie points are from pixels; problems of overlaps are added to a failure.
    """
    done = {way: fit for way, fit in fits.items() if isinstance(fit, Refined)}
    warnings = tuple(found.warnings) if found else ()
    orientations = {"before": orientation, **{way: fit.orientation for way, fit in done.items()}}
    return Refinement(
        ties=ties,
        from_pixels=found is not None,
        orientations={**orientations, **({"mean shift": shifted} if len(ties) else {})},
        fits=done,
        reasons={
            way: "; ".join([failure.reason, *warnings])
            for way, failure in fits.items()
            if isinstance(failure, Failed)
        },
        warnings=warnings,
    )


def write(
    flight: Flight,
    results_path: str | Path,
    refinement: Refinement,
    transferred: Mapping[str, TransferredPoints],
) -> None:
    """Write the refined heads, and the points transferred into the synthetic image.

    Parameters
    ----------
    flight : Flight
    results_path : path
    refinement : Refinement
    transferred : mapping of str to TransferredPoints
        By block; empty where the flight is measured in synthetic images.
    """
    key = "synthetic/refined"
    if "rotations" in refinement.fits:
        orientation, entries = refinement.orientation, _entries(key, refinement)
        records = [tables.of_relative_orientation(key, orientation, **entries)]
    else:
        records = [tables.not_adjusted(key, refinement.reasons["rotations"])]
    if transferred:
        records.append(tables.of_transferred(flight, transferred))
    provenance.write(results_path, "synthetic", records, flight=flight)


def _entries(key: str, refinement: Refinement) -> dict[str, object]:
    """Return the entries of summary.json on the refinement by rotations."""
    fit = refinement.fits["rotations"]
    n_turned = len(refinement.orientation.heads) - 1 - len(fit.unreached)
    n_observations, n_unknowns = 2 * len(refinement.kept), 3 * n_turned
    notes = list(filter(None, (fit.sentence, *refinement.warnings)))
    return {
        "n_observations": n_observations,
        "n_unknowns": n_unknowns,
        "redundancy": n_observations - n_unknowns,
        "sigma0_squared": fit.sigma0**2,
        "n_rejected": int(fit.rejected.sum()),
        **({"notes": [f"{key}: {note}" for note in notes]} if notes else {}),
    }
