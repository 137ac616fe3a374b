"""Direct georeferencing tested on an independent block (section 4.3, Table 4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from acx4lib.calibration.estimates import Calibration
from acx4lib.calibration.trust.needs import features
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.georeferencing.validation import Validation, validate
from acx4lib.results import adjustments, earlier, provenance, read_back
from acx4lib.results.carried import mounted_block
from acx4lib.results.validations import of_validations
from acx4lib.stages.explained import explained, solving


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
    if str(calibration_path):
        return _of_earlier(flight, results_path, earlier.read(calibration_path, flight))
    needed = {"synthetic": "validation" in flight.carried, "mounting": bool(flight.calibration)}
    before = [stage for stage, is_needed in needed.items() if is_needed]
    found = provenance.results_before(results_path, before, flight)
    block = mounted_block(flight, "validation", found)
    calibrations = read_back.calibrations_for(flight, found, block.cameras)
    rigs = {}
    if "validation" in flight.carried:
        rigs = read_back.rigs_for(found, flight.block("validation").cameras)
    stage = _validated(flight, block, calibrations, rigs)
    adjustments.write(results_path, "validation", _records(flight, stage), flight=flight)
    return stage


def _of_earlier(
    flight: Flight, results_path: str | Path, before: earlier.Earlier
) -> ValidationStage:
    """Validate the calibrations of an earlier flight, and write the results."""
    block = before.block(flight)
    rigs = before.rigs(flight.block("validation")) if "validation" in flight.carried else {}
    stage = _validated(flight, block, before.calibrations(block), rigs)
    first, *others = _records(flight, stage)
    notes = [f"validation: {before.sentence}"]
    records = [earlier.named(first, before, notes=notes)]
    records += [earlier.named(record, before) for record in others]
    adjustments.write(results_path, "validation", records, flight=flight)
    return replace(stage, earlier=before.sentence)


def _records(flight: Flight, stage: ValidationStage) -> list[adjustments.Record]:
    flown = flight.blocks.get("calibration")
    with solving(flight, "validation"):
        records = of_validations(
            [*stage.validations, *stage.in_heads],
            {**stage.calibrations, **stage.rigs},
            frozenset() if flown is None else features(flown),
            late="delay" in flight.gnss,
        )
        return explained(records, flight, "validation")


def _validated(
    flight: Flight,
    block: Block,
    calibrations: dict[str, Calibration],
    rigs: Mapping[str, Calibration],
) -> ValidationStage:
    """Validate calibrations in a block, and rigs as it was measured in heads."""
    measured = flight.block("validation")
    with solving(flight, "validation"):
        return ValidationStage(
            block=block,
            calibrations=calibrations,
            validations=_validations(flight, block, calibrations),
            rigs=rigs,
            in_heads=_validations(flight, measured, rigs),
        )


def _validations(
    flight: Flight, block: Block, calibrations: Mapping[str, Calibration]
) -> list[Validation]:
    return [
        validate(block, calibration, method=method, refraction=flight.refraction)
        for method, calibration in calibrations.items()
    ]
