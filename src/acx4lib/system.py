"""What systems differ in: numbers of signals, of processors, and memory.

Only this module asks for what some system lacks, such as Windows, and imports nothing that is not
everywhere.
"""

from __future__ import annotations

import os
import signal

SIGPIPE = int(getattr(signal, "SIGPIPE", 13))
"""Number of the signal for a pipe without a reader."""

MEMORY = 2**31
"""Bytes of memory assumed where the system does not report them."""


def cores() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory() -> int:
    """Return the bytes of memory of the machine, or `MEMORY`."""
    if not hasattr(os, "sysconf"):
        return MEMORY
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
