"""What a command is said to have taken."""

import json
import subprocess
import sys
from pathlib import Path

from benchmarks import command


def test_a_command_tells_its_seconds_and_its_memory(tmp_path):
    script = Path(command.__file__)
    made = "import time; b = b'x' * 200_000_000; time.sleep(0.2)"
    done = subprocess.run(
        [sys.executable, str(script), sys.executable, "-c", made],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    assert found["wall_s"] > 0.2
    assert 0 < found["cpu_s"] < found["wall_s"]
    assert 200e6 / 2**20 < found["peak_mb"] < 260  # and Python itself


def test_a_command_that_fails_is_a_failure():
    script = Path(command.__file__)
    done = subprocess.run(
        [sys.executable, str(script), sys.executable, "-c", "raise SystemExit(3)"],
        capture_output=True,
        check=False,
    )
    assert done.returncode == 3
    assert done.stdout == b""


def test_memory_is_that_of_all_processes_together():
    child = "import time; b = b'x' * 100_000_000; time.sleep(1)"
    made = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    both = f"{made.replace('.run', '.Popen')}; b = b'y' * 100_000_000; import time; time.sleep(1.5)"
    done = subprocess.run(
        [sys.executable, command.__file__, sys.executable, "-c", both],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    assert found["peak_mb"] < 150 < 200e6 / 2**20 < found["tree_mb"] < 260
