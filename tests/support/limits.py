"""Commands in a process of their own, with their processor time and memory measured."""

from __future__ import annotations

import multiprocessing
import os
import resource
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from support.fuzz.said import said

MEMORY = 2**30
"""Bytes of address space beyond that of the libraries."""

PRELOADED = ("support.limits", "acx4tools.exchange.flight_folder", "acx4lib.conventions")


@dataclass(frozen=True, kw_only=True)
class Told:
    """How a command ended.

    Attributes
    ----------
    status : int
    out, err : str
    seconds : float
        Processor time.
    memory : int
        Bytes of resident memory beyond that before it.
    """

    status: int
    out: str
    err: str
    seconds: float
    memory: int


def told(*arguments: object, memory: int = MEMORY) -> Told:
    """Return how `acx4` ends that has `memory` bytes more than its libraries take."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(_told, [str(one) for one in arguments], memory).result(timeout=300)


def _told(arguments: list[str], memory: int) -> Told:
    said("import", "--help")  # loads what is loaded once
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + memory
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
    Path("/proc/self/clear_refs").write_text("5", "ascii")
    before, start = _peak(), time.process_time()
    status, out, err = said(*arguments)
    seconds, peak = time.process_time() - start, _peak() - before
    return Told(status=status, out=out, err=err, seconds=seconds, memory=peak)


def _peak() -> int:
    status = Path("/proc/self/status").read_text("ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024
