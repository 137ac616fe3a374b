"""What the results of a benchmark hang on: processor, memory, compilers, versions, commit.

And how a script is run whose results they are.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from benchmarks.adjusting import ceres_solver

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = {
    **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS")},
    "PYTHONPATH": os.pathsep.join([str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]),
}
"""Linear algebra on one thread: on two it costs everyone more. Solvers and renderers have their
own; Hugin's programs take as many as they like."""
PACKAGES = ("acx4lib", "numpy", "scipy", "numba", "pycolmap")


def described(ceres: Path | None) -> dict[str, Any]:
    """Return the description.

    Parameters
    ----------
    ceres : Path or None
        The compiled comparator.
    """
    versions = {"python": platform.python_version(), **package_versions(PACKAGES)}
    if ceres is not None:
        versions |= ceres_solver.versions(ceres)
    return {
        **computer(),
        "flags": " ".join(ceres_solver.FLAGS),
        "ceres_tolerance": float(ceres_solver.TOLERANCE),
        "ceres_exact_tolerance": float(ceres_solver.EXACT),
        "versions": versions,
    }


def computer() -> dict[str, Any]:
    """Return processor, memory, system, and the commit that was measured."""
    return {
        "processor": _first("/proc/cpuinfo", "model name"),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gb": round(int(_first("/proc/meminfo", "MemTotal").split()[0]) / 2**20, 1),
        "system": _first("/etc/os-release", "PRETTY_NAME", by="=").strip('"'),
        "commit": _commit(),
    }


def _first(path: str, key: str, by: str = ":") -> str:
    """Return the value of the first line of a file that begins with a key."""
    lines = Path(path).read_text("utf-8").splitlines()
    found = (line.partition(by)[2].strip() for line in lines if line.startswith(key))
    return next(found, "unknown")


def package_versions(names: Iterable[str]) -> dict[str, str]:
    """Return the versions of Python packages."""
    out = {}
    for name in names:
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "not installed"
    return out


def _commit() -> str:
    def git(*arguments: str) -> str:
        command = ["git", "-C", str(ROOT), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = len(git("status", "--porcelain", "--untracked-files=no").splitlines())
        return git("rev-parse", "HEAD") + (f", {changed} files differ" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


# --- processes ---------------------------------------------------------------------------------


def reported(
    script: Path, *arguments: str, environment: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Run a script in a fresh process; return what it reports."""
    command = [sys.executable, str(script), *arguments]
    found: dict[str, Any] = json.loads(called(command, environment).splitlines()[-1])
    return found


def called(command: Sequence[str], environment: Mapping[str, str] | None = None) -> str:
    """Run a command and return its standard output; end this program where it fails."""
    own = os.environ | ENVIRONMENT if environment is None else environment
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=own)
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["no message"]
        sys.exit(f"{' '.join(command[:4])} failed: {lines[-1]}")
    return done.stdout
