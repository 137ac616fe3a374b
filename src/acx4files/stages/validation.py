"""Direct georeferencing tested on an independent block (section 4.3, Table 4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from acx4files.flight.reader import Flight
from acx4files.results import folder, provenance, read_back, sentences, tables
from acx4files.results.folder import Record
from acx4files.results.read_back import Earlier, calibrated, mounted_block, rigs_for
from acx4files.stages.diagnosed import of_validations
from acx4lib.attempts import attempt
from acx4lib.block import Block
from acx4lib.calibration.estimates import Calibration, features
from acx4lib.georeferencing.validation import Prediction, Validation, predict, validate
from acx4lib.shown import ByName


class ValidationStage(NamedTuple):
    """The validation block, georeferenced by every calibration.

    Attributes
    ----------
    calibrations : dict of str to Calibration
        By method, those whose parameters are all determined.
    validations : list of Validation
        One for each of them.
    in_heads : list of Validation
        One for each rig, in the images of the heads, where the block is measured in them.
    """

    calibrations: Mapping[str, Calibration]
    validations: list[Validation]
    in_heads: list[Validation]


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
    before = _before(flight, results_path, calibration_path)
    found = _validations(flight, before.block, before.calibrations)
    in_heads = _validations(flight, flight.block("validation"), before.rigs)
    records = _records(flight, [*found, *in_heads], {**before.calibrations, **before.rigs})
    _write(flight, results_path, records, before.earlier)
    return ValidationStage(before.calibrations, found, in_heads)


# --- what is validated -----------------------------------------------------------------------


def measured(flight: Flight, results_path: str | Path, calibration_path: str | Path = "") -> Block:
    """Return the validation block; points measured in heads are transferred.

    Parameters
    ----------
    flight, results_path, calibration_path
        As in `run`; raises as this does, here and below.
    """
    return _before(flight, results_path, calibration_path).block


def calibrations(
    flight: Flight, results_path: str | Path, calibration_path: str | Path = ""
) -> ByName[Calibration]:
    """Return the calibrations whose parameters are all determined, by method.

    Parameters
    ----------
    flight, results_path, calibration_path
        As in `run`.
    """
    return ByName(_before(flight, results_path, calibration_path).calibrations)


def calibrated_rigs(
    flight: Flight, results_path: str | Path, calibration_path: str | Path = ""
) -> ByName[Calibration]:
    """Return the calibrations of the heads, by method, if the block is measured in them.

    Parameters
    ----------
    flight, results_path, calibration_path
        As in `run`.
    """
    return ByName(_before(flight, results_path, calibration_path).rigs)


def whose(flight: Flight, calibration_path: str | Path) -> str:
    """Return a sentence on the earlier flight whose calibrations are validated; empty without."""
    return (
        read_back.read_earlier(calibration_path, flight).sentence if str(calibration_path) else ""
    )


class _Before(NamedTuple):
    """What is validated: by this flight's own stages, or by an earlier flight's."""

    block: Block
    calibrations: Mapping[str, Calibration]
    rigs: Mapping[str, Calibration]
    earlier: Earlier | None = None


def _before(flight: Flight, results_path: str | Path, calibration_path: str | Path) -> _Before:
    """Read the results of the previous stages, or those of an earlier flight."""
    in_heads = "validation" in flight.transferred
    heads = flight.block("validation")
    if str(calibration_path):
        given = read_back.read_earlier(calibration_path, flight)
        block, found = given.block(flight), given.run.found
        rigs = rigs_for(found, given.declared(heads)) if in_heads else {}
        return _Before(block, calibrated(found, given.declared(block)), rigs, given)
    needed = {"synthetic": in_heads, "mounting": bool(flight.calibration)}
    stages = [stage for stage, is_needed in needed.items() if is_needed]
    found = provenance.results_before(results_path, stages, flight)
    block = mounted_block(flight, "validation", found)
    own = read_back.calibrations_for(flight, found, block.cameras)
    return _Before(block, own, read_back.rigs_for(found, heads.cameras) if in_heads else {})


# --- results ---------------------------------------------------------------------------------


def _validations(
    flight: Flight, block: Block, calibrations: Mapping[str, Calibration]
) -> list[Validation]:
    return [
        validate(block, calibration, flight.model, method=method)
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
    before = read_back.read_earlier(calibration_path, flight) if str(calibration_path) else None
    records = _records(flight, list(validations.values()), calibrations)
    _write(flight, results_path, records, before)


def _records(
    flight: Flight, validations: Sequence[Validation], calibrations: Mapping[str, Calibration]
) -> list[Record]:
    flown = flight.blocks.get("calibration")
    has = frozenset() if flown is None else features(flown)
    records = of_validations(validations, calibrations, has, late="delay" in flight.gnss)
    if not validations:
        return records
    return [
        _with_prediction(flight, record, validation, calibrations[validation.method])
        for record, validation in zip(records, validations, strict=True)
    ]


def _with_prediction(
    flight: Flight, record: Record, validation: Validation, calibration: Calibration
) -> Record:
    """Add to a record how well exposures are predicted, for a block without check points."""
    if len(validation.block.check) or not len(validation.block.image_points):
        return record
    prediction = attempt(
        predict,
        validation.block,
        calibration,
        flight.heads_model,
        method=validation.method,
    )
    entries, said = {}, f"exposures are not predicted: {getattr(prediction, 'reason', '')}"
    if isinstance(prediction, Prediction):
        entries, said = tables.prediction_entries(prediction), sentences.prediction(prediction)
    ((key, entry),) = record.summary.items()
    notes = [*folder.messages(entry, "notes"), f"{key}: {said}"]
    return replace(record, summary={key: {**entry, **entries, "notes": notes}})


def _write(
    flight: Flight,
    results_path: str | Path,
    records: Sequence[Record],
    before: Earlier | None,
) -> None:
    """Write the records; the first has a note on the origin of the calibrations."""
    origin = None
    if before is not None:
        origin = before.origin
        notes = [[f"validation: {before.sentence}"], *([] for _ in records[1:])]
        records = [
            _named(record, origin, note) for record, note in zip(records, notes, strict=True)
        ]
    provenance.write(results_path, "validation", records, flight=flight, calibration=origin)


def _named(record: Record, origin: Mapping[str, object], notes: Sequence[str]) -> Record:
    """Add the origin of an earlier flight's calibration to the record of a validation."""
    entries = {}
    for key, entry in record.summary.items():
        calibration = {**origin, "method": f"mounting/{key.rpartition('/')[2]}"}
        all_notes = [*folder.messages(entry, "notes"), *notes]
        entries[key] = {**entry, "calibration": calibration, "notes": all_notes}
    return replace(record, summary=entries)
