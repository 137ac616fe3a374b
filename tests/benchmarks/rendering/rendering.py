"""The rendering of a synthetic image beside others.

Every run is a process of its own that has what it needs before its clock starts; all take turns.
The pictures are simulated into a folder that is kept, which at full size takes minutes.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks import harness
from benchmarks.rendering import peers
from benchmarks.rendering.run import RUNS
from benchmarks.rendering.scene import EXPOSURE, read

HERE = Path(__file__).parent
RUN = HERE / "run.py"

SMALLER = 4
"""Files are rendered at full size, and at such a part of it, where enblend ends in time."""

COMMANDS = ("acx4_render", "acx4_render_unequalised", "nona", "enblend")
ONCE, SMALLER_ONLY = ("nona", "enblend"), ("enblend",)
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


def rows(_folder: Path, repeat: int, *, reduce: int = 1) -> tuple[list[Row], Row]:
    """Return the runs of all renderers and commands, and what belongs to all.

    The pictures, at 1/reduce of their size, are kept in `harness.FLIGHTS`.
    """
    material = prepare(harness.FLIGHTS, reduce)
    paths = [str(p) for p in (material.flight, material.results, material.response)]
    truth = harness.reported(HERE / "truth.py", *paths)
    lacking = missing()
    names = [name for name in (*RUNS, *COMMANDS) if name not in lacking]
    found = list(measure(material, names, repeat))
    ties = harness.reported(HERE / "matching.py", paths[0])["ties"]
    versions = {**harness.about()["versions"], **peers.installed()}
    about = {"versions": versions, **truth, "exposure": EXPOSURE, "missing": lacking, "ties": ties}
    return with_errors(found, truth), about


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
            harness.called([harness.ACX4, "simulate", "acx4", "--out", str(path), *images])
    if not (material.results / "summary.json").is_file():
        sys.stderr.write(f"orienting the heads of {material.flight}\n")
        results = ["--results", str(material.results), "--stages", "heads,synthetic"]
        harness.called([harness.ACX4, "run", str(material.flight), *results])
    return material


def missing() -> dict[str, str]:
    """Return which others are not installed, and what they need."""
    absent = {name: peers.MODULES[name] for name in RUNS if peers.missing(name)}
    there = peers.installed()
    lacking = {name: name for name in peers.PROGRAMS if name not in there}
    if "nona" in lacking:
        lacking["enblend"] = lacking.get("enblend", "nona")  # it blends what nona made
    return absent | lacking


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
                        lambda name=name: harness.reported(RUN, name, *paths),
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
        if name in peers.PROGRAMS:
            yield reduction, lambda flight=flight: by_hugin(name, flight, material.results)
        else:
            yield reduction, lambda flight=flight: acx4_render(name, flight, material.results)


def acx4_render(name: str, flight: Path, results: Path) -> Row:
    """Render with the command line, from files to a file."""
    with tempfile.TemporaryDirectory(dir=flight.parent) as folder:
        how = ["--equalise", "none"] if name == "acx4_render_unequalised" else []
        where = ["--results", str(results), "--out", str(Path(folder) / "images")]
        what = ["--exposures", EXPOSURE]
        return harness.timed(harness.ACX4, "render", str(flight), *where, *what, *how)


def by_hugin(name: str, flight: Path, results: Path) -> Row:
    """Make layers of the heads with nona; blend them with enblend, if it is that which is timed."""
    with tempfile.TemporaryDirectory(dir=flight.parent) as folder:
        project = Path(folder) / "project.pto"
        project.write_text(peers.project(read(flight, results)), encoding="utf-8")
        own = {key: value for key, value in os.environ.items() if key != "OMP_NUM_THREADS"}
        found = harness.timed(*peers.nona(project, Path(folder)), environment=own)
        if name == "enblend":
            command = peers.enblend(Path(folder))
            found = harness.timed(*command, environment=own)
        return found


def progress(row: Row) -> None:
    """Write a line on what was measured."""
    sys.stderr.write(
        f"{row['run']:2d} 1/{row['reduction']:<2d} {row['what']:26s} {row['wall_s']:9.3f} s wall "
        f"{row['cpu_s']:9.3f} s CPU {row['peak_mb']:7.0f} MB\n"
    )


# --- results -------------------------------------------------------------------------------------


def with_errors(rows: Iterable[Row], truth: Mapping[str, Any]) -> list[Row]:
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
        whole = {**row, **size, "pixels": pixels, **errors}
        out.append({key: whole.get(key) for key in COLUMNS})
    return out
