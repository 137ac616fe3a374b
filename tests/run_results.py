"""A results folder as a run leaves it, made without notebooks."""

from pathlib import Path

from acx4lib import (
    flight,
    mounting,
    own_folder,
    provenance,
    records,
    restored,
    results,
    runner,
    simulate,
    validation,
    validation_records,
)


def leave_results(folder, *, design="single-head", seed=2):
    """Simulate a flight, calibrate and validate it; return the folders of flight and results."""
    at, kept = Path(folder) / "flight", Path(folder) / "results"
    simulate.write(simulate.DESIGNS[design](seed=seed), at)
    flown = flight.read(at)
    with own_folder.claim(kept, command=runner.COMMAND) as own:
        own.expect([*results.FILES, provenance.FILE])
        results.replace(kept, [], tables={}, summary={})
        provenance.keep(own, flown)
        _compute(flown, kept)
        own.seal()
    return at, kept


def _compute(flown, kept):
    found = mounting.calibrate(flown.calibration, free=flown.estimate_mounting)
    records.write(kept, "mounting", records.of_mountings(found))
    provenance.stamp(kept, "mounting")
    calibrations = restored.calibrations_for(flown, results.read(kept))
    validated = [
        validation.validate(flown.validation, one, method=method)
        for method, one in calibrations.items()
    ]
    records.write(kept, "validation", validation_records.of_validations(validated))
    provenance.stamp(kept, "validation")
