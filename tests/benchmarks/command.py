"""Run a command and say what it took: ``python command.py COMMAND ...``, JSON on stdout.

It imports next to nothing: the largest memory that the system tells of a command includes what
the process was before it became the command.
"""

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

LOOK_S = 0.25
"""Time between two looks at the memory of all processes."""


def main(command: list[str]) -> None:
    """Run it; report seconds and memory of the command and of all that it started.

    `peak_mb` is that of the largest process, `tree_mb` that of all together, shared memory counted
    once; what lasts shorter than `LOOK_S` may be missed in the latter.
    """
    start = time.perf_counter()
    quiet = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    # Python keeps what it compiles of modules, as it does for anybody who installed the package.
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    child = os.posix_spawnp(command[0], command, kept, file_actions=quiet)
    tree_mb, done = 0.0, 0
    while not done:
        tree_mb = max(tree_mb, sum(map(_memory_mb, _tree(child))))
        time.sleep(LOOK_S)
        done, status, used = os.wait4(child, os.WNOHANG)
    wall = time.perf_counter() - start
    if status:
        sys.exit(os.waitstatus_to_exitcode(status))
    peak_mb = used.ru_maxrss / 1024
    found = {
        "wall_s": wall,
        "cpu_s": used.ru_utime + used.ru_stime,
        "peak_mb": peak_mb,
        "tree_mb": max(tree_mb, peak_mb),
    }
    sys.stdout.write(json.dumps(found) + "\n")


def _tree(root: int) -> set[int]:
    """Return a process and all that descend from it."""
    parents = dict(_parents())
    tree, more = {root}, {root}
    while more:
        more = {child for child, parent in parents.items() if parent in more} - tree
        tree |= more
    return tree


def _parents() -> Iterator[tuple[int, int]]:
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            after_name = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2]
            yield int(stat.parent.name), int(after_name.split()[1])


def _memory_mb(process: int) -> float:
    """Return the memory of a process, its part of what is shared; 0 when it has ended."""
    with suppress(OSError):
        for line in Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii").splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) / 1024
    return 0.0


if __name__ == "__main__":
    main(sys.argv[1:])
