"""Direct georeferencing tested on an independent block (section 4.3, Table 4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from acx4lib import shown
from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.trust.needs import features
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.georeferencing.validation import Validation, validate
from acx4lib.results import adjustments, earlier, folder, provenance, read_back
from acx4lib.results.carried import mounted_block
from acx4lib.results.validations import of_validations
from acx4lib.stages.explained import explained, solving

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationStage:
    """The validation block, georeferenced by every calibration.

    Attributes
    ----------
    block : Block
        Carried into the synthetic image where it is measured in heads.
    calibrations : dict of str to Calibration
        By method, those whose parameters are all determined.
    validations : list of Validation
        One for each of them.
    rigs : dict of str to Calibration
        By method, where the block is measured in heads.
    in_heads : list of Validation
        One for each of them, in the images of the heads.
    earlier : str
        Whose calibrations they are, in a sentence, where they are those of an earlier flight.
    """

    block: Block
    calibrations: dict[str, Calibration]
    validations: list[Validation]
    rigs: Mapping[str, Calibration]
    in_heads: list[Validation]
    earlier: str = ""

    def __repr__(self) -> str:
        """Say in a line what was validated."""
        methods = [one.method for one in (*self.validations, *self.in_heads)]
        points = shown.count(len(self.block.check), "check point")
        return shown.line("ValidationStage", points, *methods)

    def table(self) -> pd.DataFrame:
        """Return the differences of all methods."""
        found = {one.method: one.table() for one in (*self.validations, *self.in_heads)}
        return shown.below(*found.values(), method=list(found))


def run(
    flight: Flight, results_path: str | Path, calibration_path: str | Path = ""
) -> ValidationStage:
    """Validate the calibrations of stage mounting, and write the results.

    Parameters
    ----------
    flight : Flight
        With a block validation.
    results_path : path
        With the results of stage mounting of this flight, where it has a block calibration.
    calibration_path : path, optional
        Results of an earlier flight, whose calibrations are validated in their place.

    Raises
    ------
    FlightError
        Where the results of stage mounting are missing or of another flight, or the cameras of
        the earlier one are others.
    AdjustmentError
        Where nothing can be computed with the numbers of the block.
    """
    before = _earlier(flight, calibration_path)
    block = measured(flight, results_path, calibration_path)
    methods = calibrations(flight, results_path, calibration_path)
    rigs = calibrated_rigs(flight, results_path, calibration_path)
    with solving(flight, "validation"):
        stage = ValidationStage(
            block=block,
            calibrations=methods,
            validations=_validations(flight, block, methods),
            rigs=rigs,
            in_heads=_validations(flight, flight.block("validation"), rigs),
            earlier=before.sentence if before else "",
        )
    found = {one.method: one for one in (*stage.validations, *stage.in_heads)}
    write(flight, results_path, found, {**methods, **rigs}, calibration_path)
    return stage


def measured(flight: Flight, results_path: str | Path, calibration_path: str | Path = "") -> Block:
    """Return the validation block, its points carried where it is measured in heads.

    Parameters
    ----------
    flight, results_path, calibration_path
        As in `run`; raises as this does, here and below.
    """
    if before := _earlier(flight, calibration_path):
        return before.block(flight)
    return mounted_block(flight, "validation", _before(flight, results_path))


def calibrations(
    flight: Flight, results_path: str | Path, calibration_path: str | Path = ""
) -> shown.ByName[Calibration]:
    """Return the calibrations whose parameters are all determined, by method.

    Parameters
    ----------
    flight, results_path, calibration_path
        As in `run`.
    """
    if before := _earlier(flight, calibration_path):
        return shown.ByName(before.calibrations(before.block(flight)))
    found = _before(flight, results_path)
    block = mounted_block(flight, "validation", found)
    return shown.ByName(read_back.calibrations_for(flight, found, block.cameras))


def calibrated_rigs(
    flight: Flight, results_path: str | Path, calibration_path: str | Path = ""
) -> shown.ByName[Calibration]:
    """Return calibrations of the heads, by method, where the block is measured in these.

    Parameters
    ----------
    flight, results_path, calibration_path
        As in `run`.
    """
    if "validation" not in flight.carried:
        return shown.ByName()
    if before := _earlier(flight, calibration_path):
        return shown.ByName(before.rigs(flight.block("validation")))
    found = _before(flight, results_path)
    return shown.ByName(read_back.rigs_for(found, flight.block("validation").cameras))


def _earlier(flight: Flight, calibration_path: str | Path) -> earlier.Earlier | None:
    return earlier.read(calibration_path, flight) if str(calibration_path) else None


def _before(flight: Flight, results_path: str | Path) -> folder.Results:
    """Return the results of the stages before."""
    needed = {"synthetic": "validation" in flight.carried, "mounting": bool(flight.calibration)}
    stages = [stage for stage, is_needed in needed.items() if is_needed]
    return provenance.results_before(results_path, stages, flight)


def _validations(
    flight: Flight, block: Block, calibrations: Mapping[str, Calibration]
) -> list[Validation]:
    return [
        validate(block, calibration, method=method, refraction=flight.refraction)
        for method, calibration in calibrations.items()
    ]


def write(
    flight: Flight,
    results_path: str | Path,
    validations: Mapping[str, Validation],
    calibrations: Mapping[str, Calibration],
    calibration_path: str | Path = "",
) -> None:
    """Write the results of all validations.

    Parameters
    ----------
    flight : Flight
    results_path : path
    validations : mapping of str to Validation
        By method, those in the images of the heads among them.
    calibrations : mapping of str to Calibration
        By method, that of every validation.
    calibration_path : path, optional
        Results of the earlier flight whose calibrations they are.
    """
    flown, before = flight.blocks.get("calibration"), _earlier(flight, calibration_path)
    with solving(flight, "validation"):
        records = of_validations(
            list(validations.values()),
            calibrations,
            frozenset() if flown is None else features(flown),
            late="delay" in flight.gnss,
        )
        records = explained(records, flight, "validation")
    if before:
        notes = {0: [f"validation: {before.sentence}"]}
        records = [
            earlier.named(record, before, notes=notes.get(i, []))
            for i, record in enumerate(records)
        ]
    adjustments.write(results_path, "validation", records, flight=flight)
