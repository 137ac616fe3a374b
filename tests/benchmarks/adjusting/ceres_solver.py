"""Ceres on a problem file: the comparator of ``ceres/``, compiled here."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

SOURCES = Path(__file__).parent / "ceres"
FLAGS = ("-O3", "-march=native", "-std=c++17", "-I/usr/include/eigen3")
TOLERANCE = "1e-10"
"""Relative change of cost at which Ceres stops where it is timed."""

EXACT = "1e-14"
"""The same where its result is compared with ours: Ceres discards the step that ends it."""


class NoCeres(Exception):
    """The comparator cannot be compiled here; the message says why, in one line."""


def build() -> Path:
    """Compile the comparator, unless a program of the same sources is there.

    Raises
    ------
    NoCeres
        Without a compiler or without Ceres.
    """
    compiler = shutil.which("g++")
    if compiler is None:
        msg = "no comparison with Ceres: g++ is missing (apt-get install g++ libceres-dev)"
        raise NoCeres(msg)
    text = "".join(path.read_text("utf-8") for path in sorted(SOURCES.iterdir()))
    digest = hashlib.sha256((text + " ".join(FLAGS)).encode()).hexdigest()[:16]
    program = Path(tempfile.gettempdir()) / f"acx4-ceres-{digest}"
    if not program.is_file():
        _compile(compiler, program)
    return program


def _compile(compiler: str, program: Path) -> None:
    with tempfile.TemporaryDirectory(dir=program.parent) as folder:
        made = Path(folder) / "solve"
        command = [compiler, *FLAGS, str(SOURCES / "solve.cc"), "-o", str(made)]
        done = subprocess.run(
            [*command, "-lceres", "-lglog"], capture_output=True, text=True, check=False
        )
        if done.returncode:
            errors = [line for line in done.stderr.splitlines() if "error" in line] or ["?"]
            msg = f"no comparison with Ceres: {errors[0]} (apt-get install libceres-dev)"
            raise NoCeres(msg)
        made.replace(program)


def command(program: Path, problem: Path, solver: str) -> list[str]:
    """Return the command line of a solver ``ceres_<derivatives>_<schur>_<threads>``.

    ``ceres_exact`` converges to rounding, ``ceres_covariance`` computes a covariance matrix too.
    """
    if solver in {"ceres_exact", "ceres_covariance"}:
        extra = ["covariance"] if solver == "ceres_covariance" else []
        how = ["analytic", "sparse", "2", EXACT, *extra]
    else:
        how = [*solver.split("_")[1:], TOLERANCE]
    return [str(program), str(problem), *how]


def versions(program: Path) -> dict[str, str]:
    """Return the versions of the compiler, of Ceres and the BLAS that it is linked with."""
    header = Path("/usr/include/ceres/version.h").read_text("utf-8")
    parts = [re.search(rf"CERES_VERSION_{name} (\d+)", header) for name in ("MAJOR", "MINOR")]
    linked = subprocess.run(["ldd", str(program)], capture_output=True, text=True, check=True)
    blas = re.search(r"=> (\S*libblas\S*)", linked.stdout)
    compiler = subprocess.run(["g++", "--version"], capture_output=True, text=True, check=True)
    return {
        "ceres": ".".join(part[1] for part in parts if part),
        "blas of ceres": str(Path(blas[1]).resolve()) if blas else "none",
        "compiler": compiler.stdout.splitlines()[0],
    }
