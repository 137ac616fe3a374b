"""Where calls are computed: processes of this computer, or the workers of a Dask cluster."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import Any

from acx4book.command.batch.processes import Processes
from acx4lib.errors import FlightError
from acx4lib.flight.problems import quoted

ANSWER_S = 10
"""Time in which a scheduler must answer, s."""

ADDRESS = re.compile(
    r"(?:(?:tcp|tls|ucx|ws|wss)://)?(?:[\w.-]+|\[[\da-f:.]+\]):(?P<port>\d{1,5})/?", re.ASCII | re.I
)
"""Of a scheduler in another process: protocol, name or number of the host, port."""


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
    _check(address)
    client = object.__new__(distributed.Client)
    try:
        client.__init__(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError, TypeError, ImportError) as error:
        client.status = "closed"  # Dask would try to close for 20 s what was never open
        reason = " ".join(str(error).split())[:200]
        raise FlightError([f"{address}: no Dask scheduler answers ({reason})"]) from None
    with client:
        yield client


def _check(address: str) -> None:
    """Refuse an address that no scheduler can have."""
    found = ADDRESS.fullmatch(address)
    if found is None or not 0 < int(found["port"]) < 65536:
        expected = "must be that of a Dask scheduler, such as tcp://host:8786"
        raise FlightError([f"--cluster: {quoted(address)}; {expected}"])


@contextmanager
def _ended(pool: Executor) -> Iterator[Executor]:
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False)
        raise
    pool.shutdown()
