"""A results folder as a run leaves it, made without notebooks."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

import acx4sim
from acx4book.report.findings import findings
from acx4book.report.material import Material, read
from acx4files import flight
from acx4files.results import folder as results
from acx4files.results import provenance, read_back
from acx4files.results.tables import calibration_tables, orientation_tables, record
from acx4files.stages import diagnosed
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import Calibration
from acx4lib.geometry.camera import INTERIOR, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.georeferencing import validation
from acx4lib.model import Model
from support.flights import written

SINGLE = "mounting/single_step"
LENS = Interior(
    f=25.1, xp=0.03, yp=-0.02, k1=1.1e-5, k2=-2e-8, k3=1e-11, p1=4e-6, p2=-3e-6, b1=2e-4, b2=-1e-4
)

ADJUSTED = {
    **dict.fromkeys(("n_unknowns", "redundancy"), 1),
    **dict.fromkeys(("n_observations", "n_rejected"), 0),  # for it has no rows of them
    "sigma0_squared": 1.25,
    "chi_square_p": 0.3,
    "converged": True,
}
"""What summary.json says of an adjustment at least."""


def leave_results(folder, *, seed=2):
    """Simulate a flight, calibrate and validate it; return the folders of flight and results."""
    at, kept = Path(folder) / "flight", Path(folder) / "results"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=seed), at)
    flown = flight.read(at)
    found = mounting.calibrate(flown.calibration, Model(free=flown.estimate_mounting))
    provenance.write(kept, "mounting", diagnosed.of_mountings(found), flight=flown)
    calibrations = read_back.calibrations_for(flown, results.read(kept), flown.validation.cameras)
    validated = [
        validation.validate(flown.validation, one, method=method)
        for method, one in calibrations.items()
    ]
    provenance.write(kept, "validation", diagnosed.of_validations(validated), flight=flown)
    return at, kept


def put(folder, stage, records):
    """Write the records of a stage, of no flight."""
    records = list(records)
    names = {name for record in records for name in record.tables}
    tables = {name: [r.tables[name] for r in records if name in r.tables] for name in names}
    summary = {key: entry for record in records for key, entry in record.summary.items()}
    results.replace(folder, [stage], tables=tables, summary=summary)


def edit(folder, name, change):
    table = pd.read_csv(folder / f"{name}.csv", dtype={"point": str}, keep_default_na=False)
    change(table)
    table.to_csv(folder / f"{name}.csv", index=False)
    stamp(folder)


def stamp(folder):
    """Let summary.json have the digests of the tables as they are, as if the run had left them."""
    summary = json.loads((folder / "summary.json").read_text())
    for file in summary[results.RUN]["tables"]:
        summary[results.RUN]["tables"][file] = provenance.sha256_of(folder / file)
    (folder / "summary.json").write_text(json.dumps(summary))


def edit_summary(folder, key, **values):
    summary = json.loads((folder / "summary.json").read_text())
    summary[key].update(values)
    (folder / "summary.json").write_text(json.dumps(summary))
    stamp(folder)


def state(folder_or_run, question):
    """Return what the verdict of a report says of one question: its state and the answer."""
    material = folder_or_run if isinstance(folder_or_run, Material) else read(folder_or_run)
    return next((f.state, f.answer) for f in findings(material) if f.question == question)


def leave_calibration(folder, calibration, *, method="single_step", related=None):
    """Write a small flight, and results that have one calibration of its cameras.

    With `related`, that relative orientation of the heads instead, and their own calibrations.
    """
    kept = Path(folder) / "results"
    blocks = ("heads", "calibration") if len(calibration.cameras) > 1 else ("calibration",)
    flown = flight.read(written.write_flight(Path(folder) / "flight", blocks=blocks))
    if related is None:
        made = {f"mounting/{method}": calibration_tables(calibration)}
    else:
        made = {
            "heads/bundle": calibration_tables(calibration),
            "heads/relative_orientation": orientation_tables(related),
        }
    provenance.begin(kept, flown, [])
    for name, tables in made.items():
        entry = {name: ADJUSTED if name.startswith("mounting/") else {"converged": True}}
        made = record(name, tables, {})
        results.replace(kept, [name], tables=made.tables, summary=entry)
    return kept


def estimated(*names):
    """Return a calibration of small flights' cameras: every parameter, full covariance."""
    rng = np.random.default_rng(1)
    cameras = tuple(_camera(written.cameras()[name], k) for k, name in enumerate(names))
    n = len(INTERIOR) + 6
    sizes = np.tile(
        [1e-3, *[2e-3] * 2, 1e-7, 1e-9, 1e-12, *[1e-7] * 2, *[1e-5] * 2], (len(names), 1)
    )
    sigma = np.hstack([sizes, np.full((len(names), 3), 0.02), np.full((len(names), 3), 5e-5)])
    root = rng.normal(size=(n * len(names), 2 * n * len(names))) * sigma.ravel()[:, None]
    columns = np.arange(n * len(names)).reshape(len(names), n)
    return Calibration(
        cameras=cameras,
        layout=Layout(
            interior=columns[:, : len(INTERIOR)],
            mount=columns[:, len(INTERIOR) :],
            pose=np.zeros((0, 6), dtype=np.intp),
        ),
        cov=root @ root.T / (2 * n),
        sigma0_sq=1.25,
        open_columns=np.zeros(n * len(names), dtype=bool),
    )


def _camera(declared, k):
    opk = declared.T_b_c.opk + np.radians([0.3, -0.2, 0.1])
    lens = replace(LENS, f=LENS.f + 0.01 * k)
    return replace(
        declared,
        interior=lens,
        T_b_c=Pose(R=rotation_from_opk(opk), r=np.array([0.1, -0.2 + 0.3 * k, 0.25])),
    )
