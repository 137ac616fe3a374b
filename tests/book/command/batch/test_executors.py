"""Where calls are computed, and that they are given back as they finish."""

import multiprocessing
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from acx4book.command.batch import executors


def sleep(seconds):
    time.sleep(seconds)
    return seconds


def test_calls_are_given_back_in_the_order_in_which_they_finish():
    with ThreadPoolExecutor(2) as pool:
        found = list(executors.finished(pool, sleep, [0.3, 0.05]))
    assert [(job, call.result()) for job, call in found] == [(0.05, 0.05), (0.3, 0.3)]


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


class KilledWorker(Exception):
    """What a cluster says of a call that was with several workers when they died."""


class Giving(ThreadPoolExecutor):
    """An executor that gives some calls up, the first time or always."""

    def __init__(self, *, once, always):
        super().__init__(2)
        self._once, self._always, self.open = [*once], always, 0

    def submit(self, fn, job):
        self.open += 1
        given_up = job in self._once or job in self._always
        if job in self._once:
            self._once.remove(job)
        call = super().submit(self._give_up if given_up else fn, job)
        call.add_done_callback(self._close)
        return call

    def _close(self, _call):
        self.open -= 1

    def _give_up(self, job):
        raise KilledWorker(job)


def test_what_a_cluster_gives_up_is_called_again_alone():
    """Dask blames what waited with the worker that died, too."""
    with Giving(once=[1, 2], always=[3]) as pool:
        found = []
        for job, call in executors.finished(pool, abs, range(6)):
            found.append(job)
            assert job not in {1, 2, 3} or pool.open == 0
            if job == 3:
                with pytest.raises(KilledWorker):
                    call.result()
            else:
                assert call.result() == job
    assert sorted(found) == list(range(6))
