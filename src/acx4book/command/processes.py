"""Worker processes that do not depend on each other.

`concurrent.futures.ProcessPoolExecutor` breaks as a whole when one of its processes is killed, and
nobody knows which call did it. Here every process has a pipe of its own: a call whose process
dies fails alone, with how it ended, and the next call gets a new process.
"""

from __future__ import annotations

import errno
import importlib
import multiprocessing
import pickle
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from acx4book.command.surroundings import shut_out
from acx4lib import system
from acx4lib.errors import FlightError
from acx4lib.flight.problems import quoted

P = ParamSpec("P")
T = TypeVar("T")

_SPAWN = multiprocessing.get_context("spawn")

GRACE_S = 10
"""Time for a process to clean up before it is killed, s."""


class ProcessDiedError(RuntimeError):
    """The process of a call ended before the call did."""


class Processes(Executor):
    """An executor with a fixed number of processes, started on demand.

    Raises
    ------
    FileNotFoundError
        Where the current folder, in which processes start, does not exist any more.
    """

    def __init__(self, n: int) -> None:
        Path.cwd()
        self._threads = ThreadPoolExecutor(n)
        self._of_thread = threading.local()
        self._lock = threading.Lock()
        self._started: list[_Process] = []
        self._is_ended = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function, importable by name, in the next free process."""
        return self._threads.submit(self._call, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes after their calls, or at once without `wait`."""
        if not wait:
            self._terminate()
        self._threads.shutdown(cancel_futures=cancel_futures)
        for process in self._started:
            process.close()

    def _terminate(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        with self._lock:
            self._is_ended = True
            for process in self._started:
                process.terminate()

    def _call(self, fn: Callable[..., T], args: Sequence[object], kwargs: Mapping[str, Any]) -> T:
        process: _Process | None = getattr(self._of_thread, "process", None)
        if process is None or process.is_dead:
            process = self._of_thread.process = self._start()
        result: T = process.call(fn, args, kwargs)
        return result

    def _start(self) -> _Process:
        with self._lock:
            if self._is_ended:
                msg = "ended before it began"
                raise ProcessDiedError(msg)
            self._started.append(_Process())
            return self._started[-1]


class _Process:
    """A process that serves calls one after another."""

    def __init__(self) -> None:
        self._pipe, child_pipe = _SPAWN.Pipe()
        self._process = _SPAWN.Process(target=_serve, args=(child_pipe,))
        resource_tracker.ensure_running()  # its start would unblock signals
        try:
            with system.uninterrupted():  # inherited by the process
                self._process.start()
        except FileNotFoundError:
            raise FileNotFoundError(errno.ENOENT, "the current folder is no more") from None
        child_pipe.close()  # so that the pipe ends when the process does

    @property
    def is_dead(self) -> bool:
        return not self._process.is_alive()

    def call(self, *call: object) -> Any:
        """Call a function in the process; return its value or raise its error.

        Raises
        ------
        ProcessDiedError
        """
        try:
            self._pipe.send_bytes(pickle.dumps(call))
            answer = self._pipe.recv_bytes()
        except (EOFError, OSError):
            self._process.join()
            raise ProcessDiedError(_ending(self._process.exitcode)) from None
        succeeded, result = pickle.loads(answer)
        if succeeded:
            return result
        raise result

    def terminate(self) -> None:
        self._process.terminate()

    def close(self) -> None:
        """End the process; kill it after `GRACE_S` seconds."""
        self._pipe.close()
        self._process.join(GRACE_S)
        self._process.kill()
        self._process.join()


def _serve(pipe: Connection) -> None:
    """Serve calls until the parent closes its end of the pipe or dies."""
    shut_out()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent gets it, too, and ends its processes
    system.hear_interruptions()
    signal.signal(signal.SIGTERM, _leave)
    while True:
        try:
            call = pipe.recv_bytes()
        except EOFError:
            signal.signal(signal.SIGTERM, signal.SIG_IGN)  # the process is ending
            return
        pipe.send_bytes(_answer(call))


def _leave(*_: object) -> None:
    """Leave tidily; a second signal, as from a signal to the whole group, is ignored."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(1)


def _answer(call: bytes) -> bytes:
    """Run a pickled call; return success and its value or error, pickled."""
    try:
        function, args, kwargs = pickle.loads(call)
        return pickle.dumps((True, function(*args, **kwargs)))
    except Exception as error:  # raised again in the caller
        return pickle.dumps((False, error))


def _ending(code: int | None) -> str:
    """Return how a process ended, in words."""
    if code is None or code >= 0:
        return f"its process ended with status {code}"
    return f"its process was ended by signal {signal.Signals(-code).name}"


# --- Where calls are computed: processes of this computer, or the workers of a Dask cluster


ANSWER_S = 10
"""Time in which a scheduler must answer, s."""

ADDRESS = re.compile(
    r"(?:(?:tcp|tls|ucx|ws|wss)://)?(?:[\w.-]+|\[[\da-f:.]+\]):(?P<port>\d{1,5})/?", re.ASCII | re.I
)
"""Address of a scheduler: protocol, name or number of the host, port."""


@contextmanager
def on_processes(n: int) -> Iterator[Executor]:
    """Yield an executor with local processes; an error in the context ends them at once.

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

    If a worker dies, the cluster repeats its call with another one, by default three times.

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
    """Refuse a text that is not the address of a scheduler."""
    match = ADDRESS.fullmatch(address)
    if match is None or not 0 < int(match["port"]) < 65536:
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
