"""Time the single-step calibration of the 52-image block (`make bench`)."""

import platform
import resource
import sys
import tempfile
import time
from pathlib import Path

from acx4lib import flight, mounting, simulate

SIZES = (500, 5000)


def main() -> None:
    """Print a line per number of tie points: measurements, wall and CPU seconds, peak memory."""
    sys.stdout.write(f"{platform.machine()}, Python {platform.python_version()}\n")
    for n_ties in SIZES:
        options = simulate.Options(tie_points={"calibration": n_ties}, blocks=("calibration",))
        with tempfile.TemporaryDirectory() as folder:
            simulate.write(simulate.acx4(options=options), Path(folder) / "flight")
            read = flight.read(Path(folder) / "flight")
        block = read.calibration
        start, start_cpu = time.perf_counter(), time.process_time()
        found = mounting.single_step(block, free=read.estimate_mounting)
        wall, cpu = time.perf_counter() - start, time.process_time() - start_cpu
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        sys.stdout.write(
            f"{n_ties:6d} tie points, {len(block.image_points):7d} measurements: "
            f"{wall:6.2f} s wall, {cpu:6.2f} s CPU, {peak_mb:6.0f} MB, "
            f"{found.bundle.solution.iterations} iterations, "
            f"{len(found.bundle.rejected)} rejected\n"
        )


if __name__ == "__main__":
    main()
