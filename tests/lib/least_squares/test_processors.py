"""Work in parts has the same results on any number of processors."""

import os
import subprocess
import sys
import threading

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
