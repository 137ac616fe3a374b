"""Where calls are computed."""

import multiprocessing
import subprocess
import sys
import time

import pytest

from acx4book.command.batch import executors
from acx4lib.errors import FlightError


def test_processes_are_ended_where_the_context_fails():
    calls = []

    def fail():
        with executors.on_processes(2) as pool:
            calls.extend(pool.submit(time.sleep, 300) for _ in range(5))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert all(call.done() for call in calls)
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "tls://127.0.0.1:9"])
def test_a_scheduler_that_does_not_answer_is_a_sentence(monkeypatch, address):
    monkeypatch.setattr(executors, "ANSWER_S", 0.5)
    with (
        pytest.raises(FlightError, match=f"{address}: no Dask scheduler answers"),
        executors.on_cluster(address),
    ):
        pass


@pytest.mark.parametrize(
    "address", ["", "nonsense", "nonsense://x:1", "inproc://", "tcp://", "tcp://x:70000", "x:0"]
)
def test_what_is_no_address_is_refused_at_once(address):
    begin = time.monotonic()
    says = f"^--cluster: {address!r}; must be that of a Dask scheduler"
    with pytest.raises(FlightError, match=says), executors.on_cluster(address):
        pass
    assert time.monotonic() - begin < 5


def test_a_client_that_was_never_connected_says_nothing_later():
    """Dask closed it when Python ended, for 20 s, and showed a traceback."""
    script = (
        "from acx4book.command.batch import executors\n"
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
