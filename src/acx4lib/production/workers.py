"""Synthetic images made one after the other, by several processes, or by a cluster."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import queue
import signal
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from acx4lib.errors import FlightError
from acx4lib.production.exposure import Outcome, RenderJob, render_exposure
from acx4lib.production.stripes import TellRows

if TYPE_CHECKING:
    from multiprocessing.queues import Queue
    from multiprocessing.synchronize import Event

ANSWER_S = 10
"""Time in which a scheduler must answer, s."""

_OFTEN_S = 0.1
_Said = tuple[str, int, int]


class _Stopped(BaseException):
    """The command ends; an unfinished image is removed."""


@dataclass(frozen=True, kw_only=True)
class Workers:
    """The processes or the cluster that render.

    Attributes
    ----------
    processes : int
    cluster : str or None
        Address of a Dask scheduler; its cluster is used instead of processes.
    """

    processes: int = 1
    cluster: str | None = None


def run_jobs(jobs: Sequence[RenderJob], tell: TellRows, workers: Workers) -> Iterator[Outcome]:
    """Yield the outcomes of the images as they are finished.

    Parameters
    ----------
    jobs : sequence of RenderJob
    tell : callable
        First called for every image, with no finished rows.
    workers : Workers
    """
    for job in jobs:
        tell(job.exposure, 0, job.synthetic.height_px)
    if workers.cluster is not None:
        return render_on_cluster(jobs, tell, workers.cluster)
    if workers.processes > 1 and len(jobs) > 1:
        return render_in_processes(jobs, tell, min(workers.processes, len(jobs)))
    return render_here(jobs, tell)


def render_here(jobs: Sequence[RenderJob], tell: TellRows) -> Iterator[Outcome]:
    """Yield the outcomes of the images, rendered one after the other with all threads."""
    for job in jobs:
        yield render_exposure(job, tell)


# --- several processes -----------------------------------------------------------------------


def render_in_processes(
    jobs: Sequence[RenderJob], tell: TellRows, n_processes: int
) -> Iterator[Outcome]:
    """Yield the outcomes of the images as they are finished.

    Parameters
    ----------
    jobs : sequence of RenderJob
    tell : callable
    n_processes : int
        Number of processes, which share the cores.
    """
    context = multiprocessing.get_context("spawn")
    said: Queue[_Said] = context.Queue()
    stop = context.Event()
    threads = max((os.cpu_count() or 1) // n_processes, 1)
    with (
        _stopped_at_the_end(stop),
        ProcessPoolExecutor(
            n_processes, mp_context=context, initializer=_begin, initargs=(said, stop)
        ) as pool,
    ):
        open_jobs = {pool.submit(_work, replace(job, threads=threads)): job for job in jobs}
        try:
            while open_jobs:
                done, _ = wait(open_jobs, timeout=_OFTEN_S, return_when="FIRST_COMPLETED")
                _pass_on(said, tell)
                for future in done:
                    yield _outcome(future, open_jobs.pop(future))
        except BaseException:
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


@contextmanager
def _stopped_at_the_end(stop: Event) -> Iterator[None]:
    try:
        yield
    finally:
        stop.set()


def _outcome(future: Future[Outcome], job: RenderJob) -> Outcome:
    try:
        return future.result()
    except BrokenProcessPool:
        problem = "a process ended unexpectedly; short of memory? use fewer --jobs"
        return Outcome(exposure=job.exposure, problems=(problem,))


def _pass_on(said: Queue[_Said], tell: TellRows) -> None:
    """Pass the messages of the worker processes on to `tell`."""
    while True:
        try:
            tell(*said.get_nowait())
        except queue.Empty:
            return


_WORKER: dict[str, Any] = {}
"""State of a worker process: the queue of its messages, and whether it must stop."""


def _begin(said: Queue[_Said], stop: Event) -> None:
    """Prepare a worker process; its parent handles interrupts from the keyboard."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    _WORKER.update(said=said, stop=stop, at_work=False, ended=False)


def _end(*_: object) -> None:
    """End a worker process at the next stripe; an exception while it compiles could be lost."""
    _WORKER["ended"] = True
    if not _WORKER["at_work"]:
        sys.exit(1)


def _work(job: RenderJob) -> Outcome:
    _WORKER["at_work"] = True
    try:
        return render_exposure(job, _tell_parent)
    except _Stopped:
        return Outcome(exposure=job.exposure, problems=("stopped",))
    finally:
        _WORKER["at_work"] = False


def _tell_parent(exposure: str, done: int, total: int) -> None:
    if _WORKER["ended"] or _WORKER["stop"].is_set():
        raise _Stopped
    _WORKER["said"].put((exposure, done, total))


# --- a cluster -------------------------------------------------------------------------------


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """Yield a client of a Dask cluster.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as ``tcp://host:8786``.

    Raises
    ------
    FlightError
        Where Dask is not installed, or no scheduler answers.
    """
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


def render_on_cluster(jobs: Sequence[RenderJob], tell: TellRows, address: str) -> Iterator[Outcome]:
    """Yield the outcomes of the images as the workers of a Dask cluster finish them.

    Parameters
    ----------
    jobs : sequence of RenderJob
        The workers must be able to read their files.
    tell : callable
        Called once for every image.
    address : str
        As of `connected`, which raises what is wrong.
    """
    with connected(address) as client, client.as_current():
        distributed: Any = importlib.import_module("distributed")
        futures = {client.submit(_work_on_cluster, _absolute(job), pure=False): job for job in jobs}
        try:
            for future in distributed.as_completed(futures):
                outcome = _cluster_outcome(future, futures[future])
                rows = futures[future].synthetic.height_px
                if not outcome.problems:
                    tell(outcome.exposure, rows, rows)
                yield outcome
        finally:
            client.cancel(list(futures))


def _absolute(job: RenderJob) -> RenderJob:
    """Return a job for a worker that runs in another folder."""
    files = tuple(path.absolute() for path in job.files)
    path, preview = job.path.absolute(), job.preview.absolute()
    return replace(job, files=files, path=path, preview=preview)


def _cluster_outcome(future: Any, job: RenderJob) -> Outcome:
    error = future.exception()
    if error is None:
        outcome: Outcome = future.result()
        return outcome
    reason = " ".join(str(error).split())
    return Outcome(exposure=job.exposure, problems=(f"the cluster failed ({reason})",))


def _work_on_cluster(job: RenderJob) -> Outcome:
    distributed: Any = importlib.import_module("distributed")
    threads = distributed.get_worker().state.nthreads
    return render_exposure(replace(job, threads=threads), lambda *_: None)
