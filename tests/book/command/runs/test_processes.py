"""Calls in processes: what they return and raise, and that a process that dies takes no other."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from acx4book.command import processes
from acx4book.command.processes import ProcessDiedError, Processes
from acx4lib.errors import FlightError


@pytest.fixture
def pool():
    with Processes(2) as started:
        yield started


def test_calls_return_and_raise_as_they_would_here(pool):
    calls = [pool.submit(pow, 2, n) for n in range(20)]
    assert [call.result() for call in calls] == [2**n for n in range(20)]
    assert pool.submit(sorted, [1, 3, 2], reverse=True).result() == [3, 2, 1]
    assert pool.submit(os.getpid).result() != os.getpid()
    with pytest.raises(ValueError, match="invalid literal for int"):
        pool.submit(int, "as it is").result()
    with pytest.raises(TypeError, match="cannot pickle"):
        pool.submit(threading.Lock).result()


def test_a_process_that_dies_fails_its_own_call_alone(pool):
    calls = [pool.submit(time.sleep, 0.2) for _ in range(4)]
    killed, left = pool.submit(signal.raise_signal, 9), pool.submit(os._exit, 3)
    calls += [pool.submit(time.sleep, 0) for _ in range(8)]
    with pytest.raises(ProcessDiedError, match="its process was ended by signal SIGKILL"):
        killed.result()
    with pytest.raises(ProcessDiedError, match="its process ended with status 3"):
        left.result()
    assert [call.result() for call in calls] == [None] * 12


def test_what_waits_is_cancelled_and_what_runs_is_ended_when_told_so():
    pool = Processes(1)
    running, waiting = pool.submit(time.sleep, 300), pool.submit(time.sleep, 300)
    while not running.running():
        time.sleep(0.01)
    pool.shutdown(wait=False)
    assert waiting.cancelled()
    with pytest.raises(ProcessDiedError):
        running.result()
    assert not multiprocessing.active_children()


def test_nothing_is_left_behind(pool):
    pool.submit(os.getpid).result()
    pool.shutdown()
    assert not multiprocessing.active_children()


INTERRUPTED_AT_ONCE = """
import os, signal, sys
if "--multiprocessing-fork" in sys.orig_argv:
    os.kill(os.getpid(), signal.SIGINT)
"""

ONE_CALL = """
from acx4book.command.processes import Processes
if __name__ == "__main__":
    with Processes(1) as pool:
        print(pool.submit(pow, 2, 5).result())
"""


def test_an_interruption_of_a_process_that_just_starts_is_left_to_its_parent(tmp_path):
    (tmp_path / "sitecustomize.py").write_text(INTERRUPTED_AT_ONCE)
    (tmp_path / "one_call.py").write_text(ONE_CALL)
    done = subprocess.run(
        [sys.executable, tmp_path / "one_call.py"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "32\n", "")


# --- Where calls are computed


def test_processes_are_ended_where_the_context_fails():
    calls = []

    def fail():
        with processes.on_processes(2) as pool:
            calls.extend(pool.submit(time.sleep, 300) for _ in range(5))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert all(call.done() for call in calls)
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "tls://127.0.0.1:9"])
def test_a_scheduler_that_does_not_answer_is_a_sentence(monkeypatch, address):
    monkeypatch.setattr(processes, "ANSWER_S", 0.5)
    with (
        pytest.raises(FlightError, match=f"{address}: no Dask scheduler answers"),
        processes.on_cluster(address),
    ):
        pass


@pytest.mark.parametrize(
    "address", ["", "nonsense", "nonsense://x:1", "inproc://", "tcp://", "tcp://x:70000", "x:0"]
)
def test_what_is_no_address_is_refused_at_once(address):
    begin = time.monotonic()
    says = f"^--cluster: {address!r}; must be that of a Dask scheduler"
    with pytest.raises(FlightError, match=says), processes.on_cluster(address):
        pass
    assert time.monotonic() - begin < 5


def test_a_client_that_was_never_connected_says_nothing_later():
    """Dask closed it when Python ended, for 20 s, and showed a traceback."""
    script = (
        "from acx4book.command import processes as executors\n"
        "from acx4lib.errors import FlightError\n"
        "try:\n"
        "    with executors.on_cluster('tls://127.0.0.1:9'):\n"
        "        pass\n"
        "except FlightError as error:\n"
        "    print(error)\n"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=19)
    assert "no Dask scheduler answers" in done.stdout
    assert done.stderr == ""
