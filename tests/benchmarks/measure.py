"""What a solver's process says of itself: seconds and memory, as JSON on standard output."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")


def memory_mb(key: str) -> float:
    """Return VmRSS (now) or VmHWM (at most so far) of this process, MB.

    Not `resource.getrusage`: its maximum includes what the process was before it was this program.
    """
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) / 1024 for line in status.splitlines() if key in line)


def timed(function: Callable[[], T]) -> tuple[T, dict[str, float]]:
    """Call a function; return what it returns, and wall and CPU seconds of all its threads."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = function()
    return result, {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}


def report(values: dict[str, Any]) -> None:
    """Write the measurements."""
    sys.stdout.write(json.dumps(values) + "\n")
