"""Work shared among all processors that a process may use."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

P = TypeVar("P")
R = TypeVar("R")


def cores() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def in_order(function: Callable[[P], R], parts: Iterable[P]) -> list[R]:
    """Return a function of each part, in the order of the parts; as many at a time as processors.

    For functions that spend their time where Python's lock is free. Meanwhile linear algebra has
    one thread, so that results do not depend on the number of processors.

    Parameters
    ----------
    function : callable
        It must not change what the parts share.
    parts : iterable
    """
    with _blas().limit(limits=1, user_api="blas"), ThreadPoolExecutor(cores()) as pool:
        return list(pool.map(function, parts))


@cache
def _blas() -> ThreadpoolController:
    """Return the libraries of linear algebra in this process; looking for them takes a while."""
    return ThreadpoolController()
