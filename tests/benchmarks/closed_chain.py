"""Fly the closed chain 48 times, with a synthetic image and without one (``make chain``).

Every flight of the design `acx4` is measured in its heads. Once its measurements are transferred
into the synthetic image and adjusted in a single step; once the same measurements are adjusted as
a rig of four heads. Both are validated on the same check points. Exact flights beside them sweep
the focal length of head 1, and 64 flights are flown with noise and without. The results replace
those in data/benchmarks when all are there. Needs PYTHONPATH=tests.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.chapters.rig import true_head
from acx4book.paper import printed
from acx4files.flight.reader import Flight
from acx4files.stages.synthetic import refine
from acx4lib.calibration import rig
from acx4lib.calibration.determination import ABSORBING, absorption
from acx4lib.calibration.estimates import Calibration, parameters
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.geometry.camera import Camera, border_distance, xy_from_colrow
from acx4lib.geometry.collinearity import project, rays
from acx4lib.geometry.frames import Pose
from acx4lib.georeferencing import accuracy
from acx4lib.georeferencing.validation import Differences, Validation, validate
from acx4lib.model import Model
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.synthetic_image.transferred_points import (
    synthetic_block,
    transfer,
    with_heads,
)
from acx4sim import optics
from benchmarks import find_head_truth, harness
from support.flights import simulated

OUT = harness.OUT
DESIGN = "acx4"
SEEDS = range(1, 49)
NODES = (30, 40)
"""Columns and rows of the residual pattern."""

HEIGHTS_M = (1000.0, 1500.0)
"""Flying heights of the calibration block, and of the pattern."""

SIDES = (0.0, 0.5, 1.0)
"""Of the square of the lens centres, in parts of the side that it has."""

AXES = ("east_m", "north_m", "height_m")
SCALES = (1000, 2000, 5000)
"""Denominators of the scales whose classes are noted: the paper's, and one that is larger."""

NOISE_SEEDS = range(1, 65)
"""Of the flights that are flown with noise and without."""

SHARING = 16
"""Flights that are transferred through one calibration of the heads."""

DIGITS = 7
"""Of the numbers written down."""

Row = dict[str, Any]


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=len(SEEDS), help="use seeds 1 to this")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--only", choices=("noise",), help="the flights with noise and without")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options = parser.parse_args()
    harness.refuse_changes(options.out)
    about = harness.about()
    about["design"] = DESIGN
    with ProcessPoolExecutor(options.processes) as pool:
        each = pool.map(with_noise_and_without, NOISE_SEEDS)
        noise = pd.DataFrame([row for rows in each for row in rows])
    both = about | {"first_seed": NOISE_SEEDS[0], "last_seed": NOISE_SEEDS[-1]}
    harness.write(options.out, "closed_chain_noise", {"": noise}, both, digits=DIGITS)
    if options.only:
        return
    seeds = SEEDS[: options.seeds]
    rows: dict[str, list[Row]] = {"parameters": [], "points": [], "classes": []}
    with ProcessPoolExecutor(options.processes) as pool:
        shared = pool.map(through_heads_of_others, seeds)
        for seed, found in zip(seeds, pool.map(of_seed, seeds), strict=True):
            for name, part in zip(("parameters", "points", "classes"), found, strict=True):
                rows[name] += part
            sys.stderr.write(f"\r{seed} of {len(seeds)} flights")
        rows["shared"] = [row for part in shared for row in part]
        rows["pattern"] = pattern()
        rows["centres"] = centres()
    about |= {"first_seed": seeds[0], "last_seed": seeds[-1]}
    tables = {name: pd.DataFrame(table) for name, table in rows.items()}
    harness.write(options.out, "closed_chain", tables, about, digits=DIGITS)


# --- one flight --------------------------------------------------------------------------------


def of_seed(seed: int) -> tuple[list[Row], list[Row], list[Row]]:
    """Return what both ways make of a flight: parameters, differences at check points, classes."""
    flight = simulated.fly(DESIGN, seed=seed, blocks=("heads", *simulated.MOUNTED)).flight
    parts: dict[str, tuple[Mounting, Validation]] = {
        "synthetic": in_synthetic_images(flight),
        "rig": in_heads(flight),
    }
    named = {way: {"seed": seed, "way": way} for way in parts}
    estimates = [named[way] | row for way, (m, _) in parts.items() for row in of_mounting(m)]
    differences = [named[way] | row for way, (_, v) in parts.items() for row in of_validation(v)]
    classes = [named[way] | of_classes(v) for way, (_, v) in parts.items()]
    return estimates, differences, classes


def of_classes(found: Validation) -> Row:
    """Return the classes of PEC-PCD that the check points reach, by scale."""
    said = accuracy.from_differences(found.points.d)
    reached = {scale: accuracy.pec_pcd(said, scale) for scale in SCALES}
    plan = {f"plan_{scale}": each["plan"] for scale, each in reached.items()}
    return plan | {f"height_{scale}": each["height"] for scale, each in reached.items()}


def in_synthetic_images(flight: Flight) -> tuple[Mounting, Validation]:
    """Calibrate and validate in synthetic images: the paper's way."""
    orientation = find_head_truth.calibrated_heads(flight)
    refined, synthetic = refine(flight, orientation, None).orientation, flight.cameras["SYN"]

    found = find_head_truth.single_step(flight, refined)
    points = transfer(flight.validation, refined, synthetic)
    checked = synthetic_block(flight.validation, points, synthetic)
    return found, validate(checked, found.calibration, method="single_step")


def through_heads_of_others(seed: int) -> list[Row]:
    """Return the single step of a flight whose points are transferred through the heads of another.

    `SHARING` flights have the heads of one, as where a camera is calibrated once and flown often.
    """
    heads_of = seed - (seed - 1) % SHARING
    calibrated = simulated.fly(DESIGN, seed=heads_of, blocks=("heads",)).flight
    orientation = refine(calibrated, find_head_truth.calibrated_heads(calibrated), None).orientation
    flight = simulated.fly(DESIGN, seed=seed, blocks=("heads", "calibration")).flight
    step = find_head_truth.single_step(flight, orientation)
    return [{"seed": seed, "heads_of": heads_of} | row for row in of_mounting(step)]


def with_noise_and_without(seed: int) -> list[Row]:
    """Return the single step of a flight, beside that of exact data.

    The exact data are of the same geometry: the same wind, and the same points in the images.
    """
    noisy, exact = (
        simulated.fly(DESIGN, seed=seed, blocks=("heads", "calibration"), exact=exact).flight
        for exact in (False, True)
    )
    heads, exact_heads = (
        refine(flight, find_head_truth.calibrated_heads(flight), None).orientation
        for flight in (noisy, exact)
    )
    points = transfer(noisy.calibration, heads, noisy.cameras["SYN"])
    step = find_head_truth.single_step(noisy, heads)
    total = parameters(with_heads(step, noisy.calibration, points, heads).calibration)
    of_exact = of_calibration(find_head_truth.single_step(exact, exact_heads).calibration)
    return [
        {
            "seed": seed,
            "camera": p.camera,
            "parameter": p.name,
            "value": p.value,
            "sigma": p.sigma,
            "sigma_before": p.sigma_before,
            "exact": true["value"],
        }
        for p, true in zip(total, of_exact, strict=True)
    ]


def in_heads(flight: Flight) -> tuple[Mounting, Validation]:
    """Calibrate the rig of four heads on the same measurements, and validate in the heads."""
    found = rig.calibrate(flight.calibration, Model(free=flight.estimate_heads))
    return found, validate(flight.validation, found.calibration, method="rig")


def of_mounting(found: Mounting) -> list[Row]:
    """Return every parameter with its sigma, and the variance factor as a parameter."""
    solution = found.bundle.solution
    factor = {"camera": "", "parameter": "sigma0_squared", "value": solution.sigma0_sq}
    return [*of_calibration(found.calibration), factor | {"sigma": np.nan}]


def of_calibration(found: Calibration) -> list[Row]:
    """Return every parameter with its a posteriori sigma."""
    return [
        {"camera": p.camera, "parameter": p.name, "value": p.value, "sigma": p.sigma}
        for p in parameters(found)
    ]


def of_validation(found: Validation) -> list[Row]:
    """Return RMS, mean and predicted sigma by axis, over points and over pairs."""
    both: dict[str, Differences] = {"points": found.points, "pairs": found.pairs}
    return [row for over, differences in both.items() for row in of_differences(over, differences)]


def of_differences(over: str, found: Differences) -> list[Row]:
    """Return a row for every axis; the predicted sigma is the root mean square of all."""
    said = accuracy.from_differences(found.d)
    predicted = np.sqrt(np.mean(found.sigma**2, axis=0))
    return [
        {"over": over, "axis": axis, "n": len(found), "rms_m": rms, "mean_m": mean, "sigma_m": s}
        for axis, rms, mean, s in zip(AXES, said.rms, said.mean, predicted, strict=True)
    ]


# --- exact flights -----------------------------------------------------------------------------


def at_side(share: float, lowered_m: float = 0.0) -> list[Row]:
    """Return what the methods make of exact data, where the lens centres are in other places.

    Parameters
    ----------
    share : float
        Side of the square of the lens centres, in parts of the side that it has.
    lowered_m : float
        By how much all lens centres are lower than they are.
    """
    points = np.array([head.lever_m for head in optics.HEADS.values()])
    middle = points.mean(axis=0)
    places = middle + share * (points - middle) - [0.0, 0.0, lowered_m]
    heads = {
        name: replace(head, lever_m=tuple(map(float, place)))
        for (name, head), place in zip(optics.HEADS.items(), places, strict=True)
    }
    flight = find_head_truth.exact_flight(heads)
    oriented = refine(flight, find_head_truth.calibrated_heads(flight), None).orientation
    steps = find_head_truth.mountings(flight, oriented)
    named = {"side_m": float(np.ptp(places[:, 0])), "lowered_m": lowered_m}
    rows = [
        named | {"method": method} | row
        for method in ("single_step", "two_step_gnss")
        for row in of_mounting(steps[method])
    ]
    return [*rows, *(named | {"method": "expected"} | row for row in of_absorption(steps))]


def of_absorption(found: Mountings) -> list[Row]:
    """Return the shift of f, x_p, y_p that the single step's lever arm must cause."""
    absorbed = absorption(found)
    assert absorbed is not None
    expected = absorbed.by_lever @ absorbed.lever_m
    return [
        {"camera": absorbed.cameras[0], "parameter": f"{name}_mm", "value": mm, "sigma": np.nan}
        for name, mm in zip(ABSORBING, expected, strict=True)
    ]


def centres() -> list[Row]:
    """Return what exact data give for squares of several sides, and for one that is lowered.

    This is lowered until the single step finds the lever arm that the paper prints.
    """
    rows = [row for share in SIDES for row in at_side(share)]
    own = [row["value"] for row in rows if of_single_step(row, "lever_z_m")]
    return rows + at_side(1.0, own[-1] - printed.value(3, "lever_z_m", "single_step"))


def of_single_step(row: Row, parameter: str) -> bool:
    """Tell whether a row has a parameter of the single step."""
    return bool(row["method"] == "single_step" and row["parameter"] == parameter)


def pattern() -> list[Row]:
    """Return what the single step of exact data leaves over the synthetic image, by flying height.

    A pixel is followed through its head: as it is transferred, and as the head saw it from where it
    was, onto level ground, and from there into the camera that the single step found.
    """
    flight = find_head_truth.exact_flight(optics.HEADS)
    oriented = refine(flight, find_head_truth.calibrated_heads(flight), None).orientation
    found = find_head_truth.single_step(flight, oriented).calibration.cameras[0]
    cols, rows = (np.arange(0.5, n) / n for n in NODES)
    share = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)
    colrow = share * [found.width_px, found.height_px] - 0.5
    seen = np.stack([
        head_from_synthetic(oriented, k, xy_from_colrow(found, colrow))
        for k in range(len(oriented.heads))
    ])  # fmt: skip
    border = np.stack([border_distance(h, at) for h, at in zip(oriented.heads, seen, strict=True)])
    chosen = np.argmax(np.where(np.isfinite(border), border, -np.inf), axis=0)
    out: list[Row] = []
    for k, head in enumerate(true_heads()):
        mine = np.flatnonzero((chosen == k) & (border[k] >= 0))
        looked = rays(head, head.T_b_c, seen[k, mine])
        for height in HEIGHTS_M:
            ground = head.T_b_c.r - looked * (height + head.T_b_c.r[2:]) / looked[:, 2:]
            d = colrow[mine] - project(
                found, Pose(R=found.T_b_c.R[None], r=found.T_b_c.r[None]), ground
            )
            out += [
                {
                    "height_m": height,
                    "head": head.name,
                    "col_px": c,
                    "row_px": r,
                    "d_col_px": x,
                    "d_row_px": y,
                }
                for (c, r), (x, y) in zip(colrow[mine], d, strict=True)
            ]
    return out


def true_heads() -> list[Camera]:
    """Return the heads as they are, on the IMU of the design."""
    flown = simulated.fly(DESIGN, seed=1, blocks=("heads",), exact=True)
    told = flown.truth["cameras"]
    return [true_head(flown.flight.cameras[name], told[name]) for name in simulated.HEADS]


# --- written down ------------------------------------------------------------------------------


if __name__ == "__main__":
    main()
