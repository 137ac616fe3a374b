"""Work in parts has the same results on any number of processors."""

import os
import platform
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from threadpoolctl import threadpool_info

from acx4lib.least_squares import processors


def test_results_come_in_the_order_of_the_parts():
    late, done = threading.Event(), []

    def work(part):
        if part == 0 and processors.cores() > 1:
            late.wait(10)  # the second part overtakes the first
        late.set()
        done.append(part)
        return part**2

    assert processors.in_order(work, range(8)) == [n**2 for n in range(8)]
    assert sorted(done) == list(range(8))


def test_an_error_of_a_part_is_raised():
    with pytest.raises(ZeroDivisionError):
        processors.in_order(lambda n: 1 / n, [2, 1, 0])


def test_linear_algebra_has_one_thread_meanwhile():
    def blas(_):
        return [lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"]

    (inside,) = processors.in_order(blas, [0])
    assert set(inside) <= {1}


@pytest.mark.parametrize("library", ["numpy", "scipy.linalg"])
def test_every_library_of_linear_algebra_is_found(library):
    """Also that of scipy, which may come after others have looked."""
    run = [
        "import numpy, sys, importlib",
        "from threadpoolctl import threadpool_info",
        "from acx4lib.least_squares import processors",
        "with processors.on_one_thread(): pass",
        f"importlib.import_module({library!r})",
        "with processors.on_one_thread():",
        "    inside = [x for x in threadpool_info() if x['user_api'] == 'blas']",
        "assert {x['num_threads'] for x in inside} == {1}, inside",
    ]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2", "MKL_NUM_THREADS": "2"}
    subprocess.run([sys.executable, "-c", "\n".join(run)], check=True, env=environment)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only the GNU C library keeps it")
def test_memory_that_is_kept_is_not_asked_of_the_system_again():
    run = [
        "import resource, numpy as np",
        "from acx4lib.least_squares import processors",
        "processors.keep_memory()",
        "def pages():",
        "    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt",
        "    np.ones(2**25)",
        "    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before",
        "first, again = pages(), pages()",
        "assert first > 100 and again < 10, (first, again)",
    ]
    subprocess.run([sys.executable, "-c", "\n".join(run)], check=True)


def test_elsewhere_memory_is_left_to_the_system(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    processors.keep_memory()


def sleep(seconds):
    time.sleep(seconds)
    return seconds


def test_calls_are_given_back_in_the_order_in_which_they_finish():
    with ThreadPoolExecutor(2) as pool:
        found = list(processors.as_finished(pool, sleep, [0.3, 0.05]))
    assert [(job, call.result()) for job, call in found] == [(0.05, 0.05), (0.3, 0.3)]
