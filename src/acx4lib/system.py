"""Functions of POSIX that other systems, such as Windows, lack, each with a plain substitute.

Only this module uses modules and functions that some system lacks, so that flights are checked,
simulated, run and reported on any system. Without locks of files, the owner named in a lock file
counts.
"""

from __future__ import annotations

import os
import signal
from importlib import import_module
from pathlib import Path
from typing import IO, Any


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        return None


_fcntl, _resource = map(_module, ("fcntl", "resource"))

SIGPIPE = int(getattr(signal, "SIGPIPE", 13))
"""Number of the signal for a pipe without a reader."""

MEMORY = 2**31
"""Bytes of memory assumed where the system does not report them."""


def flags(*names: str) -> int:
    """Return the sum of the flags of `os.open` that this system has, and ``O_BINARY``."""
    return sum(getattr(os, name, 0) for name in {*names, "O_BINARY"})


def cores() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# --- files and processes ----------------------------------------------------------------------


def lock(file: IO[str]) -> None:
    """Take the lock of an open file.

    Raises
    ------
    BlockingIOError
        Where another process has it.
    OSError
        Where the system or the file system has no locks.
    """
    if _fcntl is None:
        raise OSError("no locks")
    _fcntl.flock(file, _fcntl.LOCK_EX | _fcntl.LOCK_NB)


def set_mode(number: int, path: Path, mode: int) -> None:
    """Set the permissions of an open file, by its path where they cannot be set otherwise."""
    if hasattr(os, "fchmod"):
        os.fchmod(number, mode)
    else:
        path.chmod(mode)


def is_alive(process: int) -> bool:
    """Tell whether a process with this number exists, or may exist."""
    if os.name != "posix":  # elsewhere, this signal would end it
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


# --- memory ----------------------------------------------------------------------------------


def memory() -> int:
    """Return the bytes of memory of the machine, or `MEMORY`."""
    if not hasattr(os, "sysconf"):
        return MEMORY
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def free_addresses() -> int | None:
    """Return the free part of the process's address space, bytes; None if it has no limit."""
    if _resource is None:
        return None
    limit, _ = _resource.getrlimit(_resource.RLIMIT_AS)
    if limit == _resource.RLIM_INFINITY:
        return None
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    except OSError:
        return int(limit)
    return int(limit) - pages * os.sysconf("SC_PAGE_SIZE")
