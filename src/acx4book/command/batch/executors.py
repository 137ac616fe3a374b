"""Where calls are computed: processes of this computer, or the workers of a Dask cluster."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import Any

from acx4book.command.batch.processes import Processes
from acx4lib.errors import FlightError

ANSWER_S = 10
"""Time in which a scheduler must answer, s."""


@contextmanager
def on_processes(n: int) -> Iterator[Executor]:
    """Yield an executor with processes of this computer; where the context fails, they are ended.

    Parameters
    ----------
    n : int
        Number of processes.
    """
    with _ended(Processes(n)) as pool:
        yield pool


@contextmanager
def on_cluster(address: str) -> Iterator[Executor]:
    """Yield an executor with the workers of a Dask cluster.

    The cluster repeats a call whose worker dies, with another worker, three times by default.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``. Workers need this library, and the files
        that the calls name.

    Raises
    ------
    FlightError
        Where Dask is not installed, or no scheduler answers.
    """
    with _connected(address) as client, _ended(client.get_executor(pure=False)) as pool:
        yield pool


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    """Yield a client of a Dask cluster."""
    try:
        distributed: Any = importlib.import_module("distributed")  # it is optional
    except ImportError:
        problem = "--cluster needs Dask, which is not installed: pip install 'acx4lib[cluster]'"
        raise FlightError([problem]) from None
    try:
        client = distributed.Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError) as error:
        problem = f"{address}: no Dask scheduler answers ({str(error).splitlines()[0]})"
        raise FlightError([problem]) from None
    with client:
        yield client


@contextmanager
def _ended(pool: Executor) -> Iterator[Executor]:
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False)
        raise
    pool.shutdown()
