"""What all benchmarks share: the machine, processes that are timed, and files of results."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pandas as pd

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "data" / "benchmarks"
FLIGHTS = ROOT / "build" / "benchmarks"
ACX4 = str(Path(sys.executable).with_name("acx4"))
COMMAND = Path(__file__).with_name("command.py")
"""The script that times a command."""

ENVIRONMENT = {
    **{f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS")},
    "PYTHONPATH": os.pathsep.join([str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")]),
}
"""Linear algebra on one thread: on two it costs everyone more."""
PACKAGES = ("acx4lib", "numpy", "scipy", "numba")


def about() -> dict[str, Any]:
    """Return what the results of a benchmark hang on: computer, commit, versions."""
    versions = {"python": platform.python_version(), **package_versions(PACKAGES)}
    return {**computer(), "versions": versions}


def computer() -> dict[str, Any]:
    """Return processor, memory, system, and the commit that was measured."""
    return {
        "processor": _first("/proc/cpuinfo", "model name"),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gb": round(int(_first("/proc/meminfo", "MemTotal").split()[0]) / 2**20, 1),
        "system": _first("/etc/os-release", "PRETTY_NAME", by="=").strip('"'),
        "commit": commit(),
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


def refuse_changes(out: Path) -> None:
    """End the program where numbers of the project would come from files that no commit has.

    What stands in `OUT` names one commit, at which anybody can compute it again. So this is called
    before the first flight.
    """
    if out.resolve() == OUT and "differ" in commit():
        sys.exit(f"{commit()}: commit them before, or write to another folder with --out")


@cache
def commit() -> str:
    """Return the commit at the start of this program, and count the changed files.

    Results in `OUT` do not count: a long run replaces them one by one.
    """

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(ROOT), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        own = (".", f":(exclude){OUT.relative_to(ROOT)}")
        changed = len(git("status", "--porcelain", "--untracked-files=no", "--", *own).splitlines())
        return git("rev-parse", "HEAD") + (f", {changed} files differ" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def called(command: Sequence[str]) -> str:
    """Run a command and return its standard output; end this program where it fails."""
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env=os.environ | ENVIRONMENT
    )
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["no message"]
        sys.exit(f"{' '.join(command[:4])} failed: {lines[-1]}")
    return done.stdout


def timed(*command: str) -> dict[str, Any]:
    """Run a command; return the seconds and the memory of all its processes."""
    done = called([sys.executable, str(COMMAND), *command])
    found: dict[str, Any] = json.loads(done.splitlines()[-1])
    return found


# --- results -----------------------------------------------------------------------------------


def write(
    folder: Path,
    name: str,
    tables: Mapping[str, pd.DataFrame],
    about: Mapping[str, Any],
    *,
    digits: int | None = None,
) -> None:
    """Write all files, and only then put them in the place of older ones.

    Parameters
    ----------
    folder : Path
    name : str
        ``NAME.json`` says what the tables hang on, and the date.
    tables : dict of str to DataFrame
        Each becomes ``NAME_KEY.csv``, or ``NAME.csv`` for an empty key.
    about : dict
    digits : int, optional
        Significant digits of the numbers in the tables; all by default.
    """
    folder.mkdir(parents=True, exist_ok=True)
    about = {"date": datetime.now(UTC).date().isoformat(), **about}
    form = None if digits is None else f"%.{digits}g"
    with tempfile.TemporaryDirectory(dir=folder) as fresh:
        for key, table in tables.items():
            path = Path(fresh, f"{name}_{key}.csv" if key else f"{name}.csv")
            table.to_csv(path, index=False, float_format=form)
        text = json.dumps(about, indent=2) + "\n"
        Path(fresh, f"{name}.json").write_text(text, encoding="utf-8")
        for made in sorted(Path(fresh).iterdir()):
            made.replace(folder / made.name)
    sys.stderr.write(f"{folder / name}.json\n")
