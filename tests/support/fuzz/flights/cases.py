"""Cases of flights: `acx4 check` reads them, and of the good ones some are adjusted."""

from __future__ import annotations

import contextlib
import random
import shutil
from pathlib import Path

from acx4lib import flight
from acx4lib.calibration import mounting
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.georeferencing import validation
from acx4lib.production.image_files import image_from_file
from acx4lib.stages import heads
from support.fuzz.flights.good import write_all
from support.fuzz.flights.mutations import spoil
from support.fuzz.said import complaint, said

COMPUTED = 8
"""Of the accepted flights one of so many is adjusted."""

PER = 1
"""Cases for each of those that are asked for."""

write_good = write_all


def warm(good: Path, work: Path) -> None:
    """Read all good ones, so that all is imported and compiled before memory is measured."""
    for path in _folders(good):
        run(path, 0)


def prepare(good: Path, work: Path, seed: int, case: int) -> tuple[Path, str]:
    """Write a mutated flight; the same seed and case give the same one."""
    rng = random.Random(f"{seed} {case}")
    folder = work / "flight"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(rng.choice(_folders(good)), folder)
    return folder, spoil(folder, rng)


def run(folder: Path, case: int) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that."""
    status, out, err = said("check", folder)
    wrong = complaint(status, out, err)
    if wrong or status:
        return "refused" if status else "accepted", wrong
    read = flight.read(folder)
    look_at_pictures(read)
    return (compute(read) if case % COMPUTED == 0 else "accepted"), ""


def _folders(good: Path) -> list[Path]:
    return sorted(path for path in good.iterdir() if path.is_dir())


def look_at_pictures(read: flight.Flight) -> None:
    """Read the pictures; what is wrong with one is a sentence that names it."""
    for block in read.blocks.values():
        for image, path in enumerate(read.image_files[block.name]):
            if path is None:
                continue
            try:
                image_from_file(path, block.cameras[block.images.camera_idx[image]]).image.max()
            except FlightError as error:
                (line,) = error.problems
                assert line.startswith(f"{path}: "), line


def compute(read: flight.Flight) -> str:
    """Adjust a flight as the stages do, and return how that ended."""
    with contextlib.suppress(AdjustmentError):
        if read.heads is not None:
            heads.calibrate(read)
    if read.calibration is None:
        return "computed"
    try:
        found = mounting.calibrate(
            read.calibration,
            free=read.estimate_mounting,
            fix=read.fix,
            refraction=read.refraction,
            gnss=read.gnss,
        )
        if read.validation is not None:
            for name, method in found.methods.items():
                validation.validate(
                    read.validation, method.calibration, method=name, refraction=read.refraction
                )
    except AdjustmentError:
        return "not determined"
    return "computed"
