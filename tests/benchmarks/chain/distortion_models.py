"""Fly lenses with and without asymmetry, and adjust them with every model (``make models``).

Every flight is adjusted with all models of chapter 17, whole and without each of its strips, and
validated. The measurements `dbat-camcal` of others, 21 images of a flat sheet, are adjusted whole
and without groups of images; they must be on this machine. The results replace those in
data/benchmarks when all are there. Needs PYTHONPATH=tests.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.distortion_models import trials
from acx4book.chapters.beyond.distortion_models.candidates import Fitted, fit
from acx4book.chapters.beyond.distortion_models.families import MODELS, Model
from acx4book.reference.dbat import blocks
from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.uses import free_orientation
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block, SurveyedPoints
from benchmarks import machine, stored

OUT = machine.ROOT / "data" / "benchmarks"
SEEDS = range(1, 11)
DIGITS = 7
"""Of the numbers written down."""

GROUPS = 7
"""The images of `dbat-camcal` are left out in so many groups: one, eight and fifteen, and so on."""


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=len(SEEDS), help="use seeds 1 to this (10)")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options = parser.parse_args()
    seeds = range(1, options.seeds + 1)
    rows: list[trials.Row] = []
    with ProcessPoolExecutor(options.processes) as pool:
        for seed, found in zip(seeds, pool.map(trials.of_seed, seeds), strict=True):
            rows += found
            sys.stderr.write(f"\r{seed} of {len(seeds)} flights")
        rows += pool.map(of_real, MODELS)
    about = {key: value for key, value in machine.described(None).items() if "ceres" not in key}
    about |= {"first_seed": seeds[0], "last_seed": seeds[-1]}
    stored.write(options.out, "distortion_models", {"": pd.DataFrame(rows)}, about, digits=DIGITS)


# --- measurements of others --------------------------------------------------------------------


def of_real(model: Model) -> trials.Row:
    """Return what a model makes of `dbat-camcal`, which has neither strips nor check points."""
    block = blocks.camcal().bundle.network.block
    own = np.arange(len(block.images)) % GROUPS
    residuals = np.vstack([left_out_images(block, model, own == k) for k in range(GROUPS)])
    return {
        "case": "camcal",
        "seed": 0,
        "model": model.name,
        **trials.of_fit(fit(free_orientation(block, free=model.free), model)),
        "strip_px": float(np.sqrt(np.mean(residuals**2))),
    }


def left_out_images(block: Block, model: Model, own: Mask) -> Array:
    """Return the residuals of images, px, that see points and use a camera that others found."""
    others = fit(free_orientation(trials.only(block, ~own), free=model.free), model)
    known = np.unique(others.bundle.network.image_points.point_idx)
    points = SurveyedPoints(
        point_idx=known,
        x_m=others.bundle.state.x_m[known],
        sigma_m=np.zeros((len(known), 3)),
    )
    held = with_control(others, trials.only(block, own), points)
    return adjust(free_orientation(held, free=())).solution.group("image_point").v


def with_control(found: Fitted, block: Block, points: SurveyedPoints) -> Block:
    """Return a block with the camera that was found, and with points as its control."""
    return replace(found.in_block(block), control=points)


if __name__ == "__main__":
    main()
