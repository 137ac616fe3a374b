"""Direct georeferencing tested on an independent block (section 4.3, Table 4)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from acx4files.flight.reader import Flight
from acx4files.results import provenance, sentences, tables
from acx4files.results.folder import Record
from acx4files.results.read_back import (
    Earlier,
    calibrated,
    calibrations_for,
    mounted_block,
    read_earlier,
    rigs_for,
)
from acx4files.stages.diagnosed import of_validations
from acx4lib.attempts import attempt
from acx4lib.block import Block
from acx4lib.calibration.estimates import Calibration, features
from acx4lib.georeferencing.validation import Prediction, Validation, predict, validate
from acx4lib.shown import ByName


class Before(NamedTuple):
    """What is validated: by this flight's own stages, or by an earlier flight's.

    Attributes
    ----------
    block : Block
        Points measured in heads are transferred.
    calibrations : dict of str to Calibration
        By method, those whose parameters are all determined.
    rigs : dict of str to Calibration
        Of the heads, by method, where the block is measured in them.
    earlier : Earlier or None
        The earlier flight.
    """

    block: Block
    calibrations: ByName[Calibration]
    rigs: ByName[Calibration]
    earlier: Earlier | None = None


def run(
    flight: Flight, results_path: str | Path, calibration_path: str | Path = ""
) -> dict[str, Validation]:
    """Validate the calibrations of stage mounting, and write the results.

    Parameters
    ----------
    flight : Flight
        With a block validation.
    results_path : path
        With the results of stage mounting of this flight, where it has a block calibration.
    calibration_path : path, optional
        Results of an earlier flight, whose calibrations are validated in their place.

    Returns
    -------
    dict of str to Validation
        By method; those of rigs are in the images of the heads.

    Raises
    ------
    FlightError
        Where the results of stage mounting are missing or of another flight, or the cameras of
        the earlier one are others.
    AdjustmentError
        Where nothing can be computed with the numbers of the block.
    """
    before, found = read(flight, results_path, calibration_path), {}
    for method, calibration in before.calibrations.items():
        found[method] = validate(before.block, calibration, method=method)
    for method, calibration in before.rigs.items():
        found[method] = validate(flight.block("validation"), calibration, method=method)
    known = {**before.calibrations, **before.rigs}
    write(flight, results_path, found, known, before.earlier)
    return found


def read(flight: Flight, results_path: str | Path, calibration_path: str | Path = "") -> Before:
    """Read what is validated; arguments and errors are those of `run`."""
    in_heads, heads = "validation" in flight.transferred, flight.block("validation")
    rigs: Mapping[str, Calibration] = {}
    if str(calibration_path):
        earlier = read_earlier(calibration_path, flight)
        block, found = earlier.block(flight), earlier.run.found
        if in_heads:
            rigs = rigs_for(found, earlier.declared(heads))
        known = calibrated(found, earlier.declared(block))
        return Before(block, ByName(known), ByName(rigs), earlier)
    needed = {"synthetic": in_heads, "mounting": bool(flight.calibration)}
    stages = [stage for stage, is_needed in needed.items() if is_needed]
    found = provenance.results_before(results_path, stages, flight)
    block = mounted_block(flight, "validation", found)
    if in_heads:
        rigs = rigs_for(found, heads.cameras)
    return Before(block, ByName(calibrations_for(flight, found, block.cameras)), ByName(rigs))


def write(
    flight: Flight,
    results_path: str | Path,
    validations: Mapping[str, Validation],
    calibrations: Mapping[str, Calibration],
    earlier: Earlier | None = None,
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
    earlier : Earlier, optional
        The earlier flight whose calibrations they are; the first record has a note on it.
    """
    flown = flight.blocks.get("calibration")
    has = frozenset() if flown is None else features(flown)
    records = of_validations(
        [*validations.values()], calibrations, has, late="delay" in flight.gnss
    )
    for i, (method, validation) in enumerate(validations.items()):
        records[i] = _with_prediction(flight, records[i], validation, calibrations[method])
    origin = earlier.origin if earlier else None
    if earlier:
        for i, record in enumerate(records):
            method = next(iter(record.summary)).rpartition("/")[2]
            entries = {"calibration": {**earlier.origin, "method": f"mounting/{method}"}}
            records[i] = tables.extended(record, entries, [])
        records[0] = tables.extended(records[0], {}, [earlier.sentence], of="validation")
    provenance.write(results_path, "validation", records, flight=flight, calibration=origin)


def _with_prediction(
    flight: Flight, record: Record, validation: Validation, calibration: Calibration
) -> Record:
    """Add to a record how well exposures are predicted, for a block without check points."""
    block = validation.block
    if len(block.check) or not len(block.image_points):
        return record
    found = attempt(predict, block, calibration, flight.heads_model, method=validation.method)
    if isinstance(found, Prediction):
        return tables.extended(
            record, tables.prediction_entries(found), [sentences.prediction(found)]
        )
    return tables.extended(record, {}, [f"exposures are not predicted: {found.reason}"])
