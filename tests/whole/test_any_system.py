"""Commands need no module that only POSIX has, so that they run on any system."""

import subprocess
import sys

import pytest

WITHOUT = """
import os, sys
for name in ("fcntl", "grp", "pwd", "resource", "syslog", "termios", "tty", "pty"):
    sys.modules[name] = None
for name in ("fchmod", "fork", "geteuid", "getuid", "killpg", "sched_getaffinity", "sysconf"):
    delattr(os, name)
from acx4book.command.acx4 import main
main(sys.argv[1:])
"""


def acx4(*arguments):
    """Run a command without them; return its last line."""
    command = [sys.executable, "-c", WITHOUT, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


@pytest.mark.slow
def test_a_flight_is_simulated_checked_run_and_reported_without_modules_of_posix(tmp_path):
    flight, results, report = (tmp_path / name for name in ("flight", "results", "report.html"))
    plan = tmp_path / "plan.toml"
    acx4("simulate", "single-head", "--plan", plan)
    assert str(flight) in acx4("simulate", plan, "--out", flight)
    acx4("check", flight)
    assert acx4("run", flight, "--results", results, "--numbers-only") == f"results in {results}"
    acx4("report", results, "--out", report)
    assert report.is_file()
