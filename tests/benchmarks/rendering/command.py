"""Run a command and say what it took: ``python command.py COMMAND ...``, JSON on stdout.

It imports next to nothing: the largest memory that the system tells of a command includes what
the process was before it became the command.
"""

import json
import os
import sys
import time


def main(command: list[str]) -> None:
    """Run it; seconds and memory are those of the command and of all that it started."""
    start = time.perf_counter()
    quiet = [(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    child = os.posix_spawnp(command[0], command, os.environ, file_actions=quiet)
    _, status, used = os.wait4(child, 0)
    wall = time.perf_counter() - start
    if status:
        sys.exit(os.waitstatus_to_exitcode(status))
    found = {
        "wall_s": wall,
        "cpu_s": used.ru_utime + used.ru_stime,
        "peak_mb": used.ru_maxrss / 1024,
    }
    sys.stdout.write(json.dumps(found) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
