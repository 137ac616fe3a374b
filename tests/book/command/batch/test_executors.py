"""Where calls are computed."""

import multiprocessing
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


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense"])
def test_a_scheduler_that_does_not_answer_is_a_sentence(monkeypatch, address):
    monkeypatch.setattr(executors, "ANSWER_S", 0.5)
    with (
        pytest.raises(FlightError, match=f"{address}: no Dask scheduler answers"),
        executors.on_cluster(address),
    ):
        pass
