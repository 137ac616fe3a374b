"""Where calls are computed: processes of this computer, or the workers of a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, as_completed, wait
from contextlib import contextmanager
from typing import TypeVar

from acx4book.command.batch.processes import Processes
from acx4lib.production.workers import connected

J = TypeVar("J")
T = TypeVar("T")

GIVEN_UP = "KilledWorker"
"""Dask's error of a call that was with several workers when they died."""


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
    with connected(address) as client, _ended(client.get_executor(pure=False)) as pool:
        yield pool


def finished(
    executor: Executor, function: Callable[[J], T], jobs: Iterable[J]
) -> Iterator[tuple[J, Future[T]]]:
    """Yield every job with its finished call, in the order in which they finish.

    When a worker of a cluster dies, Dask blames what waited there as well. What it gives up is
    therefore called again at the end, one at a time.

    Parameters
    ----------
    executor : Executor
    function : callable
        Called with one job at a time.
    jobs : iterable
    """
    calls = {executor.submit(function, job): job for job in jobs}
    given_up: list[J] = []
    for call in as_completed(list(calls)):
        job = calls.pop(call)  # a cluster keeps a result only while somebody may want it
        if type(call.exception()).__name__ == GIVEN_UP:
            given_up.append(job)
        else:
            yield job, call
    for job in given_up:
        call = executor.submit(function, job)
        wait([call])
        yield job, call


@contextmanager
def _ended(pool: Executor) -> Iterator[Executor]:
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False)
        raise
    pool.shutdown()
