"""A results folder as a run leaves it, made without notebooks."""

import json
from pathlib import Path

import pandas as pd

import acx4sim
from acx4book.notebooks import runner
from acx4book.report.material import Material, read
from acx4book.report.verdict.verdict import findings
from acx4lib import flight
from acx4lib.calibration import mounting
from acx4lib.georeferencing import validation
from acx4lib.results import adjustments, provenance, read_back, validations
from acx4lib.results import folder as results
from acx4lib.results.own_folder import claims

SINGLE = "mounting/single_step"


def leave_results(folder, *, design="single-head", seed=2):
    """Simulate a flight, calibrate and validate it; return the folders of flight and results."""
    at, kept = Path(folder) / "flight", Path(folder) / "results"
    acx4sim.write(acx4sim.DESIGNS[design](seed=seed), at)
    flown = flight.read(at)
    with claims.claim(kept, command=runner.COMMAND) as own:
        own.expect([*results.FILES, provenance.FILE])
        results.replace(kept, [], tables={}, summary={})
        provenance.keep(own, flown)
        _compute(flown, kept)
        own.seal()
    return at, kept


def _compute(flown, kept):
    found = mounting.calibrate(flown.calibration, free=flown.estimate_mounting)
    adjustments.write(kept, "mounting", adjustments.of_mountings(found))
    provenance.stamp(kept, "mounting")
    calibrations = read_back.calibrations_for(flown, results.read(kept), flown.validation.cameras)
    validated = [
        validation.validate(flown.validation, one, method=method)
        for method, one in calibrations.items()
    ]
    adjustments.write(kept, "validation", validations.of_validations(validated))
    provenance.stamp(kept, "validation")


def edit(folder, name, change):
    table = pd.read_csv(folder / f"{name}.csv", dtype={"point": str}, keep_default_na=False)
    change(table)
    table.to_csv(folder / f"{name}.csv", index=False)


def edit_summary(folder, key, **values):
    summary = json.loads((folder / "summary.json").read_text())
    summary[key].update(values)
    (folder / "summary.json").write_text(json.dumps(summary))


def state(folder_or_run, question):
    """Return what the verdict of a report says of one question: its state and the answer."""
    material = folder_or_run if isinstance(folder_or_run, Material) else read(folder_or_run)
    return next((f.state, f.answer) for f in findings(material) if f.question == question)
