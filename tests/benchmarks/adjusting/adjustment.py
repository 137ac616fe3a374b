"""The adjustment beside others that solve the same problem.

Every run is a process of its own, which reads the problem from a file before its clock starts;
the solvers take turns.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4lib.geometry.frames import log, rotation_from_opk
from benchmarks import harness
from benchmarks.adjusting import bench_blocks

HERE = Path(__file__).parent
CERES = tuple(
    f"ceres_{derivatives}_{schur}_{threads}"
    for derivatives in ("automatic", "analytic")
    for schur in ("dense", "sparse")
    for threads in (1, 2)
)
"""Ways to solve with Ceres; of those with the same derivatives the best counts."""

ALONE = ("e2m",)
"""Ceres would need four times the memory and minutes that the largest of the others takes it."""

SWEEP = (500, 1_000, 2_000, 4_000, 8_000, 16_000, 32_000, 64_000)
"""Numbers of tie points on 52 images."""

SLOWER = 1.2
"""A way to solve with Ceres that takes this many times as long as another is tried once only."""

COLUMNS = (
    *("problem", "images", "points", "image_points", "observations", "unknowns", "solver", "run"),
    *("wall_s", "cpu_s", "peak_mb", "growth_mb", "steps", "converged", "cost"),
)
Row = dict[str, Any]


def rows(repeat: int) -> tuple[list[Row], Row]:
    """Return the runs of all solvers on all problems; versions and agreement belong to all."""
    try:
        ceres: Path | None = build_ceres()
    except NoCeres as why:
        ceres = None
        sys.stderr.write(f"{why}\n")
    sweep = {f"sweep-{ties}": bench_blocks.Design(layout="52", ties=ties) for ties in SWEEP}
    return of_problems(bench_blocks.DESIGNS | sweep, ceres=ceres, repeat=repeat)


def of_problems(
    designs: Mapping[str, bench_blocks.Design], *, ceres: Path | None, repeat: int
) -> tuple[list[Row], Row]:
    """Return the runs on some problems, by their names, and what belongs to all."""
    found, agreement = [], []
    for name, design in designs.items():
        runs, agrees = measure(name, design, ceres=ceres, repeat=repeat)
        found += runs
        agreement += agrees
    of_ceres = {} if ceres is None else ceres_versions(ceres)
    about = harness.about()
    return found, {
        "versions": about["versions"] | of_ceres,
        "flags": " ".join(FLAGS),
        "ceres_exact_tolerance": float(EXACT),
        "agreement": agreement,
    }


def measure(
    name: str, design: bench_blocks.Design, *, ceres: Path | None, repeat: int
) -> tuple[list[Row], list[Row]]:
    """Return the runs of all solvers on one problem, and how their answers agree."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "problem"
        size = prepare(design, path)
        run = runner(path, ceres)
        run("ours")  # compiles what is not compiled yet
        rows, last = [], {}
        for number, solver in turns(solvers(name, ceres), repeat, rows):
            found = run(solver)
            last[solver] = found
            rows.append({"problem": name, **size, **found, "solver": solver, "run": number})
            progress(rows[-1])
        if "ceres_automatic_sparse_1" not in last:
            return fill(rows, last["ours"]), []
        exact = run("ceres_exact")
    return fill(rows, last["ours"]), [
        agreed(name, last["ours"], last["ceres_automatic_sparse_1"], exact)
    ]


def prepare(design: bench_blocks.Design, path: Path) -> Row:
    """Write a problem and return its size."""
    network = bench_blocks.network(bench_blocks.make(design))
    bench_blocks.write_problem(network, path)
    return {
        "images": len(network.block.images),
        "points": network.n_points,
        "image_points": len(network.image_points),
    }


def solvers(name: str, ceres: Path | None) -> tuple[str, ...]:
    """Return which solvers run on a problem, in the order of their turns."""
    if ceres is None or name in ALONE:
        return ("ours",)
    if name.startswith("sweep"):
        return ("ours", "ceres_automatic_dense_1")
    return ("ours", *CERES)


def turns(names: Sequence[str], repeat: int, rows: Sequence[Row]) -> Iterator[tuple[int, str]]:
    """Yield whose turn it is; `rows` holds the runs so far, and says who was too slow."""
    for number in range(1, repeat + 1):
        first = {row["solver"]: row for row in rows if row["run"] == 1}
        for solver in names:
            if number == 1 or not outrun(solver, first):
                yield number, solver


def outrun(solver: str, first: dict[str, Row]) -> bool:
    """Tell whether another way to solve with Ceres was clearly faster, in wall and CPU seconds."""
    if solver not in CERES:
        return False
    derivatives = solver.split("_")[1]
    rivals = [row for name, row in first.items() if name.startswith(f"ceres_{derivatives}_")]
    return all(
        first[solver][key] > SLOWER * min(row[key] for row in rivals) for key in ("wall_s", "cpu_s")
    )


def runner(problem: Path, ceres: Path | None) -> Callable[[str], Row]:
    """Return what runs a solver on a problem in a fresh process."""

    def run(solver: str) -> Row:
        ours = [sys.executable, str(HERE / "ours.py"), str(problem)]
        command = ours if solver == "ours" else ceres_command(ceres, problem, solver)
        found: Row = json.loads(harness.called(command))
        return found

    return run


def progress(row: Row) -> None:
    """Write a line on what was measured."""
    sys.stderr.write(
        f"{row['problem']:>12} {row['run']:2d} {row['solver']:26s} {row['wall_s']:9.3f} s wall "
        f"{row['cpu_s']:9.3f} s CPU {row['peak_mb']:7.0f} MB {row['steps']:4d} steps\n"
    )


def fill(rows: list[Row], ours: Row) -> list[Row]:
    """Return the rows as they are stored, with the numbers of observations and unknowns."""
    size = {key: ours[key] for key in ("observations", "unknowns")}
    return [{key: (row | size).get(key) for key in COLUMNS} for row in rows]


def agreed(name: str, ours: Row, timed: Row, exact: Row) -> Row:
    """Return how our answer agrees with that of Ceres: relative cost, parameters in sigma."""
    sigma = np.array(ours["sigma"])
    apart = np.concatenate([np.subtract(exact[k], ours[k]) for k in ("interior", "lever")])
    R_ours, R_exact = (rotation_from_opk(np.array(x["boresight_opk"])) for x in (ours, exact))
    largest = np.abs(np.append(apart, log(R_ours.T @ R_exact)) / sigma).max()
    out = {
        "problem": name,
        "cost_timed": timed["cost"] / ours["cost"] - 1,
        "cost": exact["cost"] / ours["cost"] - 1,
        "parameters_sigma": largest,
    }
    if "sigma" in exact:  # angles of the boresight are not its rotation vector
        straight = np.r_[0:8, 11:14]
        theirs = np.array(exact["sigma"])[straight]
        out["sigma"] = np.abs(theirs / sigma[:11] - 1).max()
    return out


# --- ceres on a problem file: the comparator of ``ceres/``, compiled here ----------------------


SOURCES = Path(__file__).parent / "ceres"
FLAGS = ("-O3", "-march=native", "-std=c++17", "-I/usr/include/eigen3")
TOLERANCE = "1e-10"
"""Relative change of cost at which Ceres stops where it is timed."""

EXACT = "1e-14"
"""The same where its result is compared with ours: Ceres discards the step that ends it."""


class NoCeres(Exception):
    """The comparator cannot be compiled here; the message says why, in one line."""


def build_ceres() -> Path:
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


def ceres_command(program: Path, problem: Path, solver: str) -> list[str]:
    """Return the command line of a solver ``ceres_<derivatives>_<schur>_<threads>``.

    ``ceres_exact`` converges to rounding, ``ceres_covariance`` computes a covariance matrix too.
    """
    if solver in {"ceres_exact", "ceres_covariance"}:
        extra = ["covariance"] if solver == "ceres_covariance" else []
        how = ["analytic", "sparse", "2", EXACT, *extra]
    else:
        how = [*solver.split("_")[1:], TOLERANCE]
    return [str(program), str(problem), *how]


def ceres_versions(program: Path) -> dict[str, str]:
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


def main() -> None:
    """Time the adjustment beside Ceres, for data/benchmarks."""
    harness.refuse_changes(harness.OUT)
    found, about = rows(3)
    table = pd.DataFrame(found).convert_dtypes()  # whole numbers stay whole
    harness.write(harness.OUT, "adjustment", {"": table}, harness.about() | about, digits=7)


if __name__ == "__main__":
    main()
