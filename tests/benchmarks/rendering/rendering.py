"""Time the rendering of a synthetic image beside others (``make bench``, after adjustment.py).

Every run is a process of its own that has what it needs before its clock starts; all take turns.
The pictures are simulated into a folder that is kept, which at full size takes minutes. The
results replace those in data/benchmarks when all are there.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks import machine, stored
from benchmarks.rendering import hugin, peers
from benchmarks.rendering.run import RUNS
from benchmarks.rendering.scene import EXPOSURE, read

HERE = Path(__file__).parent
RUN = HERE / "run.py"
COMMAND = machine.ROOT / "tests/benchmarks/commands/command.py"
OUT = machine.ROOT / "data" / "benchmarks"
FLIGHTS = machine.ROOT / "build" / "benchmarks"
ACX4 = str(Path(sys.executable).with_name("acx4"))

SMALLER = 4
"""Files are rendered at full size, and at such a part of it, where enblend ends in time."""

COMMANDS = ("acx4_render", "acx4_render_unequalised", "nona", "enblend")
ONCE, SMALLER_ONLY = ("nona", "enblend"), ("enblend",)
PACKAGES = (
    *("acx4lib", "numpy", "numba", "scipy", "opencv-python-headless", "scikit-image"),
    *("pyvips", "tifffile"),
)
COLUMNS = (
    *("what", "reduction", "width_px", "height_px", "pixels", "samples", "run"),
    *("wall_s", "cpu_s", "peak_mb", "rms_dn", "p999_dn", "max_dn", "position_px"),
)
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Material:
    """What has been made to measure on.

    Attributes
    ----------
    flight, smaller : Path
        Flights with pixels at the size asked for, and at a part of it.
    results : Path
        With the heads' orientation.
    response : Path
        Where the responses of the heads are kept.
    reduction : int
    """

    flight: Path
    smaller: Path
    results: Path
    response: Path
    reduction: int


def main() -> None:
    """Run what the command line asks for."""
    known = (*RUNS, *COMMANDS, "ties")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3, help="runs of each (3)")
    parser.add_argument("--reduce", type=int, default=1, help="pictures at 1/K of the size (1)")
    parser.add_argument("--only", nargs="*", choices=known, default=known, metavar="WHAT")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    parser.add_argument("--flights", type=Path, default=FLIGHTS, help="folder of the pictures")
    options = parser.parse_args()
    material = prepare(options.flights, options.reduce)
    paths = [str(p) for p in (material.flight, material.results, material.response)]
    truth = machine.reported(HERE / "truth.py", *paths)
    lacking = missing()
    names = [name for name in options.only if name not in lacking]
    rows = list(measure(material, names, options.repeat))
    ties = machine.reported(HERE / "tie_points.py", paths[0])["ties"] if "ties" in names else []
    about = {**described(), **truth, "exposure": EXPOSURE}
    about |= {"missing": lacking, "ties": ties}
    stored.write(options.out, "rendering", {"": with_errors(rows, truth)}, about)


# --- what is measured on -------------------------------------------------------------------------


def prepare(folder: Path, reduction: int) -> Material:
    """Simulate what is not there yet, orient the heads and refine them by their tie points."""
    folder.mkdir(parents=True, exist_ok=True)
    material = Material(
        flight=folder / f"flight-{reduction}",
        smaller=folder / f"flight-{SMALLER * reduction}",
        results=folder / f"heads-{reduction}",
        response=folder / f"response-{reduction}.npy",
        reduction=reduction,
    )
    for path, k in ((material.flight, reduction), (material.smaller, SMALLER * reduction)):
        if not (path / "flight.toml").is_file():
            sys.stderr.write(f"simulating {path}\n")
            images = ["--images", EXPOSURE, "--reduce", str(k)]
            machine.called([ACX4, "simulate", "acx4", "--out", str(path), *images])
    if not (material.results / "summary.json").is_file():
        sys.stderr.write(f"orienting the heads of {material.flight}\n")
        results = ["--results", str(material.results), "--stages", "heads,synthetic"]
        machine.called([ACX4, "run", str(material.flight), *results])
    return material


def missing() -> dict[str, str]:
    """Return which others are not installed, and what they need."""
    absent = {name: peers.MODULES[name] for name in RUNS if peers.missing(name)}
    there = hugin.installed()
    lacking = {name: name for name in hugin.PROGRAMS if name not in there}
    if "nona" in lacking:
        lacking["enblend"] = lacking.get("enblend", "nona")  # it blends what nona made
    return absent | lacking


def described() -> Row:
    """Return what the results hang on."""
    versions = {**machine.package_versions(PACKAGES), **hugin.installed()}
    python_version = ".".join(map(str, sys.version_info[:3]))
    return {
        **machine.computer(),
        "versions": {"python": python_version, **versions},
    }


# --- runs ----------------------------------------------------------------------------------------


def measure(material: Material, names: Sequence[str], repeat: int) -> Iterator[Row]:
    """Yield the runs of all that have names, in turns."""
    paths = [str(p) for p in (material.flight, material.results, material.response)]
    for number in range(1, repeat + 1):
        for name in names:
            if name in RUNS:
                sizes: Iterable[tuple[int, Callable[[], Row]]] = [
                    (
                        material.reduction,
                        lambda name=name: machine.reported(RUN, name, *paths),
                    )
                ]
            elif name in COMMANDS and (number == 1 or name not in ONCE):
                sizes = commands(name, material)
            else:
                continue
            for reduction, run in sizes:
                row = {"what": name, "reduction": reduction, "run": number, **run()}
                progress(row)
                yield row


def commands(name: str, material: Material) -> Iterator[tuple[int, Callable[[], Row]]]:
    """Yield what runs a command, from files to files, at both sizes or at the smaller one."""
    sizes = {material.reduction: material.flight, SMALLER * material.reduction: material.smaller}
    for reduction, flight in sizes.items():
        if name in SMALLER_ONLY and reduction == material.reduction:
            continue
        if name in hugin.PROGRAMS:
            yield reduction, lambda flight=flight: by_hugin(name, flight, material.results)
        else:
            yield reduction, lambda flight=flight: acx4_render(name, flight, material.results)


def acx4_render(name: str, flight: Path, results: Path) -> Row:
    """Render with the command line, from files to a file."""
    with tempfile.TemporaryDirectory(dir=flight.parent) as folder:
        how = ["--equalise", "none"] if name == "acx4_render_unequalised" else []
        where = ["--results", str(results), "--out", str(Path(folder) / "images")]
        what = ["--exposures", EXPOSURE]
        return machine.reported(COMMAND, ACX4, "render", str(flight), *where, *what, *how)


def by_hugin(name: str, flight: Path, results: Path) -> Row:
    """Make layers of the heads with nona; blend them with enblend, if it is that which is timed."""
    with tempfile.TemporaryDirectory(dir=flight.parent) as folder:
        project = Path(folder) / "project.pto"
        project.write_text(hugin.project(read(flight, results)), encoding="utf-8")
        own = {key: value for key, value in os.environ.items() if key != "OMP_NUM_THREADS"}
        found = machine.reported(COMMAND, *hugin.nona(project, Path(folder)), environment=own)
        if name == "enblend":
            command = hugin.enblend(Path(folder))
            found = machine.reported(COMMAND, *command, environment=own)
        return found


def progress(row: Row) -> None:
    """Write a line on what was measured."""
    sys.stderr.write(
        f"{row['run']:2d} 1/{row['reduction']:<2d} {row['what']:26s} {row['wall_s']:9.3f} s wall "
        f"{row['cpu_s']:9.3f} s CPU {row['peak_mb']:7.0f} MB\n"
    )


# --- results -------------------------------------------------------------------------------------


def with_errors(rows: Iterable[Row], truth: Mapping[str, Any]) -> pd.DataFrame:
    """Return the rows with the size of the image and with the errors of who made it."""
    out = []
    for row in rows:
        k = row["reduction"] // truth["reduction"]
        size = {key: truth[key] // k for key in ("width_px", "height_px")}
        pixels = row.get("pixels", size["width_px"] * size["height_px"])
        errors: Row = {}
        if row["reduction"] == truth["reduction"]:
            errors = dict(truth["grey"].get(row["what"], {}))
            if row["what"].startswith("ours"):
                errors["position_px"] = truth["position_px"]["max"]
        out.append({**row, **size, "pixels": pixels, **errors})
    return pd.DataFrame(out, columns=list(COLUMNS), dtype=object)  # integers stay integers


if __name__ == "__main__":
    main()
