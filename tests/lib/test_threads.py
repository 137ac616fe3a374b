"""Work shared among processors keeps its order, and its errors arrive."""

import threading

import pytest
from threadpoolctl import threadpool_info

from acx4lib import threads


def test_results_come_in_the_order_of_the_parts():
    late, done = threading.Event(), []

    def work(part):
        if part == 0 and threads.cores() > 1:
            late.wait(10)  # the second part overtakes the first
        late.set()
        done.append(part)
        return part**2

    assert threads.in_order(work, range(8)) == [n**2 for n in range(8)]
    assert sorted(done) == list(range(8))


def test_an_error_of_a_part_is_raised():
    with pytest.raises(ZeroDivisionError):
        threads.in_order(lambda n: 1 / n, [2, 1, 0])


def test_linear_algebra_has_one_thread_meanwhile():
    def blas(_):
        return [lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"]

    (inside,) = threads.in_order(blas, [0])
    assert set(inside) <= {1}
