"""Parallel calls, threads of linear algebra, and memory that a process keeps."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager
from functools import cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

P = TypeVar("P")
R = TypeVar("R")

TRIM_THRESHOLD, MMAP_MAX = -1, -4
"""Settings of the GNU C library that have these numbers: how much free memory at the end of the
heap goes back to the system, and how many arrays may have memory of their own, which goes back."""


def cores() -> int:
    """Return the number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def keep_memory() -> None:
    """Keep freed memory of arrays for later arrays of this process.

    Otherwise the system provides new memory for every large array. On a virtual machine this takes
    up to a quarter of the time of a large flight. Memory then stays at its peak until the process
    ends: this is for a process with a single task. It works with the GNU C library only;
    elsewhere nothing changes.
    """
    settle = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if settle is not None:
        settle(TRIM_THRESHOLD, 2**31 - 1)
        settle(MMAP_MAX, 0)


def in_order(function: Callable[[P], R], parts: Iterable[P]) -> list[R]:
    """Return the function's value for each part, in order; parts run in parallel on all processors.

    For functions that spend their time where Python's lock is free. Meanwhile linear algebra has
    one thread, so that results do not depend on the number of processors.

    Parameters
    ----------
    function : callable
        It must not change data that the parts share.
    parts : iterable
    """
    listed = list(parts)
    with on_one_thread(), ThreadPoolExecutor(cores()) as pool:
        return list((pool.map if len(listed) > 1 else map)(function, listed))


def as_finished(
    executor: Executor, function: Callable[[P], R], parts: Iterable[P]
) -> Iterator[tuple[P, Future[R]]]:
    """Yield every part with its finished call, in the order in which the calls finish.

    Parameters
    ----------
    executor : Executor
    function : callable
        Called with one part at a time.
    parts : iterable
    """
    calls = {executor.submit(function, part): part for part in parts}
    for call in as_completed(list(calls)):
        yield calls.pop(call), call  # a cluster keeps a result only as long as it is referenced


def on_one_thread() -> AbstractContextManager[object]:
    """Return a context that limits linear algebra to one thread."""
    return _blas("scipy.linalg" in sys.modules).limit(limits=1)


@cache
def _blas(scipys: bool) -> ThreadpoolController:  # noqa: ARG001 scipy may bring a library of its own
    """Return the libraries of linear algebra in this process; looking for them takes a while."""
    return ThreadpoolController()
