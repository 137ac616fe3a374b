"""One process that reads mutated flights, one after the other, within limits.

It says on standard output which case it begins, and how that ended, so that a process that
was killed has named its case. `python -m support.fuzz.worker GOOD FIRST LAST SEED`.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path

from acx4book.command import acx4
from acx4lib import flight
from acx4lib.calibration import mounting
from acx4lib.errors import UNSEEN, AdjustmentError, FlightError
from acx4lib.georeferencing import validation
from acx4lib.production.image_files import image_from_file
from acx4lib.stages import heads
from support.fuzz.mutations import spoil

SECONDS = 20
"""A case that computes longer is ended, and this process with it."""

WAITING = 120
"""So is one that has not ended after so many seconds, whatever else the machine does."""

MEMORY = 2**30
"""Bytes of resident memory, all of this process; and of address space beyond its libraries'."""

COMPUTED = 8
"""Of the accepted flights one of so many is adjusted."""

LINE = re.compile(r"(?s).+:[1-9]\d*: [^:]+.*: .+; .+")
"""What is said of a wrong flight: file, line, column, what was found and what was expected."""

OF_PICTURE = re.compile(r"(?s).+\.tif: .+|.+: .+")


def checked(folder: Path) -> tuple[int, str, str]:
    """Return the exit status of `acx4 check`, standard output and standard error."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="strict")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace")
    status = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            acx4.main(["check", str(folder)])
        except SystemExit as end:
            status = int(end.code or 0)
    out.flush()
    err.flush()
    return status, *(stream.buffer.getvalue().decode() for stream in (out, err))  # type: ignore[attr-defined]


def complaint(status: int, out: str, err: str) -> str:
    """Return what is wrong with what a command said, empty for nothing."""
    lines = err.splitlines()
    if UNSEEN.search((out + err).replace("\n", "")):
        return f"control characters: {out + err!r}"
    if status == 0:
        return "said on standard error: " + err if err else ""
    if status != 2 or not lines or out:
        return f"status {status}: {out + err}"
    wrong = [line for line in lines if not LINE.fullmatch(line)]
    return f"not a line of its own: {wrong[0]!r}" if wrong else ""


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
            heads.orient(read, heads.calibrate(read))
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


def run_case(folder: Path, *, computes: bool) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that."""
    status, out, err = checked(folder)
    wrong = complaint(status, out, err)
    if wrong or status:
        return "refused" if status else "accepted", wrong
    read = flight.read(folder)
    look_at_pictures(read)
    return (compute(read) if computes else "accepted"), ""


def case_folder(good: list[Path], work: Path, seed: int, case: int) -> tuple[Path, str]:
    """Write a mutated flight; the same seed and case give the same one."""
    rng = random.Random(f"{seed} {case}")
    folder = work / "flight"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(rng.choice(good), folder)
    return folder, spoil(folder, rng)


def _peak() -> int:
    """Return the largest resident memory since `_forget_peak`, bytes."""
    status = Path("/proc/self/status").read_text("ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5", "ascii")


def main(arguments: list[str]) -> None:
    """Read the cases FIRST to LAST of a seed."""
    good = sorted(path for path in Path(arguments[0]).iterdir() if path.is_dir())
    first, last, seed = map(int, arguments[1:])
    work = Path(arguments[0]) / ".." / f"work-{os.getpid()}"
    work = Path(os.path.realpath(work))
    work.mkdir()
    warnings.simplefilter("error")
    for path in good:  # so that all is imported and compiled before memory is measured
        run_case(path, computes=True)
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    own = pages * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY, resource.RLIM_INFINITY))
    for case in range(first, last):
        folder, kind = case_folder(good, work, seed, case)
        tell({"case": case, "kind": kind})
        _forget_peak()
        start = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(WAITING)
        try:
            outcome, wrong = run_case(folder, computes=case % COMPUTED == 0)
        except Exception:
            outcome, wrong = "crashed", traceback.format_exc()
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        seconds, peak = time.process_time() - start, _peak()
        if peak > MEMORY and not wrong:
            outcome, wrong = "too much memory", f"{peak} bytes"
        tell({"outcome": outcome, "wrong": wrong, "seconds": seconds, "peak": peak})
    shutil.rmtree(work, ignore_errors=True)


def tell(what: dict[str, object]) -> None:
    """Tell the parent."""
    sys.__stdout__.write(json.dumps(what) + "\n")
    sys.__stdout__.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
