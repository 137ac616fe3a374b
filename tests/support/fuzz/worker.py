"""One process that works through mutated flights, one after the other, within limits.

It says on standard output which case it begins, and how that ended, so that a process that
was killed has named its case.
`python -m support.fuzz.worker GOOD FIRST LAST SEED`.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path

from support.fuzz import flights

SECONDS = 10
"""A case that computes longer is ended, and this process with it."""

WAITING = 300
"""So is one that has not ended after so many seconds, whatever else the machine does."""

MEMORY = 2**30
"""Bytes of resident memory, all of this process; and of address space beyond its libraries'."""


def _peak() -> int:
    """Return the largest resident memory since `_forget_peak`, bytes."""
    status = Path("/proc/self/status").read_text("ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5", "ascii")


def main(arguments: list[str]) -> None:
    """Work through the cases FIRST to LAST of a seed."""
    good = Path(arguments[0])
    first, last, seed = map(int, arguments[1:])
    work = Path(os.path.realpath(good / ".." / f"work-{os.getpid()}"))
    work.mkdir()
    warnings.simplefilter("error")
    flights.warm(good, work)
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    own = pages * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY, resource.RLIM_INFINITY))
    for case in range(first, last):
        target, kind = flights.prepare(good, work, seed, case)
        tell({"case": case, "kind": kind})
        _forget_peak()
        start = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.alarm(WAITING)
        try:
            outcome, wrong = flights.run(target, case)
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
