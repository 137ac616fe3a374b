"""Write what must stay equal while code is moved and removed, and compare with it.

``python -m benchmarks.frozen write FOLDER`` simulates flights and keeps what the command and the
notebooks make of them, and of the reference data; ``compare FOLDER`` makes all of it anew, from the
flights that were written then, and says of each thing whether it is equal. It calls nothing but the
command and papermill, so that no move of a module touches it. Needs PYTHONPATH=tests.

``--exact``, the default, compares the bytes of tables, the values of summaries and of flight.toml,
the numbers that notebooks show, and pixels. ``--fractions`` is for a change of the arithmetic:
keys, counts and rejections are equal, values within 1e-6 of their sigma, sigma within 1e-7 of its
size, covariances within 1e-6 of the root of both variances, residuals within 1e-6 of their sigma,
pixels within 2 of 65 535, and numbers in text within one of their last digit.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pandas as pd
import tifffile

from support.helpers import ROOT

ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT / "src")}
PATHS = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
PLANS = Path(__file__).parent / "verdicts" / "plans"
NOTEBOOKS = ROOT / "notebooks"
REAL = ROOT / "data" / "reference" / "four-heads"

DESIGNS = {"acx4": "--images H3-04 --reduce 4", "acx4-ideal": "", "single-head": ""}
"""Flights of the simulator, and the options they are flown with."""

STUDY = "acx4"
OF_FLIGHT = (
    "00-flight",
    "01-head-calibration",
    "02-synthetic-image",
    "03-mounting-calibration",
    "04-validation",
    "08-rig",
)
"""Notebooks of a flight; each takes the results of those before."""

OF_NONE = ("05-reference-data", "11-ten-heads", "13-four-real-heads")
"""Notebooks on measurements of other people, besides those of the foundations."""

SETS = (
    "applanix_pdal",
    "formats",
    "ign-uce-m3",
    "rededge-dual",
    "rededge3-flight",
    "sequoia-flight",
)
"""Of the reference data: what is imported."""

GRID = "--crs EPSG:2154 --heights ign-uce-m3/fr_ign_RAF20.tif"
SIZED = "--size 4000x3000 --pixel-um 1.5"
IMPORTS = {
    "sbet": "sbet applanix_pdal/2-points.sbet --events events.csv --time gps-sow",
    "orientations": f"orientations ign-uce-m3/images.OPK --of camera {GRID} --scaled-above 3",
    "opk": "orientations formats/orthority/io_ngi_xyz_opk.csv --of camera --crs EPSG:2056",
    "rpy": "orientations formats/orthority/io_odm_lla_rpy.csv --crs EPSG:32651"
    " --columns 'image lat lon height roll pitch heading skip skip'",
    "image-points": "image-points ign-uce-m3/tie_points.mes ign-uce-m3/control_points.mes"
    " --columns 'point image col row'",
    "control-points": "control-points ign-uce-m3/control_points.app --role check"
    f" --columns 'point skip east north height' {GRID}",
    "metashape": "metashape formats/metashape/markers_micasenses_rededge.xml",
    "metashape-adjusted": "metashape formats/metashape/markers_micasenses_rededge.xml"
    " --orientations adjusted",
    "colmap": "colmap formats/colmap/bin",
    "colmap-text": "colmap formats/colmap/txt --crs EPSG:32633 --orientations adjusted",
    "opensfm": "opensfm formats/opensfm/OpenSfM_example_meshed.json",
    "odm-control": "odm-control formats/odm/gcp_list.txt",
    "opf": "opf formats/opf/project.opf",
    "micmac": "micmac formats/micmac",
    "pix4d": "pix4d pix4d",
    "bingo": f"bingo bingo/image.dat {SIZED}",
    "patb": f"patb patb/a.im --unit um {SIZED}",
    "pictures": "pictures formats/dji",
    "pictures-of-five": "pictures rededge3-flight",
    "pictures-of-ten": "pictures rededge-dual",
    "pictures-of-a-strip": "pictures sequoia-flight --hold-out 2",
}
"""Arguments of ``acx4 import`` by the name of the flight that it writes."""

MADE = {
    "events.csv": "image,time\nfirst,151631.004\nsecond,151631.0075\n",
    "bingo/image.dat": "P1 C1\n1006 -1.90643 1.83493\n1020 0.0125 -0.00725\n-99\n"
    "P2 C1\n1006 -1.8005 1.75025\n1020 0.11075 -0.0905\n-99\n",
    "bingo/geoin.dat": "CONT 1006 669850.0 7187900.0 900.0\nCHCK 1020 669900.0 7187950.0 905.0\n",
    "patb/a.im": "101 153000\n1 -2000.0 1000.0\n2 300.5 -40.25\n-99\n102 153000\n"
    "1 -1800.0 990.0\n2 512.5 -60.75\n-99\n",
}
"""Files that no program wrote: what else an import needs."""

Work = Callable[[], None]


# --- what is made ----------------------------------------------------------------------------


def acx4(arguments: str, *more: Path | str, at: Path = ROOT) -> None:
    """Run the command; what it says goes to standard error where it fails."""
    done = called([shutil.which("acx4", path=PATHS), *shlex.split(arguments), *more], at)
    if done.returncode not in (0, 1):  # 1: a stage is not determined, and the results say so
        sys.stderr.write(f"acx4 {arguments}: {done.stderr}")


def called(command: Sequence[Path | str], at: Path) -> subprocess.CompletedProcess[str]:
    """Return what a command that uses the sources of this tree left."""
    return subprocess.run(
        command, cwd=at, env=ENVIRONMENT, capture_output=True, text=True, check=False
    )


def make(out: Path, flights: Path) -> None:
    """Make everything in a folder, of flights that are there or are made with it."""
    plans = out / "plans"
    plans.mkdir(parents=True)
    for path in PLANS.glob("*.toml"):
        (plans / path.name).write_text(with_levers(path.read_text("utf-8")), encoding="utf-8")
    names = [*DESIGNS, *sorted(path.stem for path in plans.glob("*.toml"))]
    together(lambda name=name: fly(name, out) for name in names)
    real = {REAL.name: REAL}
    runs = {name: flights / name for name in names} | real
    together(lambda name=name: run(name, runs[name], out) for name in runs)
    alone = [*OF_NONE, *sorted(f"foundations/{p.stem}" for p in NOTEBOOKS.glob("foundations/*"))]
    together(
        [
            lambda: of_flight(flights / STUDY, out),
            lambda: render(flights / STUDY, out),
            *(lambda name=name: execute(name, out) for name in alone),
            lambda: imports(out),
        ]
    )


def together(works: Iterator[Work] | Sequence[Work]) -> None:
    """Do some works, two at a time."""
    with ThreadPoolExecutor(2) as pool:
        for call in [pool.submit(work) for work in works]:
            call.result()


def with_levers(plan: str) -> str:
    """Return a plan that declares the lever arms of whose sigma it speaks, to the centimetre."""
    true = tomllib.loads(plan)["truth"]

    def declared(head: re.Match[str]) -> str:
        arm = (f"lever_{axis}_m = {true[head[1]][f'lever_{axis}_m']:.2f}\n" for axis in "xyz")
        return head[0] + "".join(arm)

    return re.sub(r"^\[cameras\.(\w+)\]\n", declared, plan, flags=re.MULTILINE)


def fly(name: str, out: Path) -> None:
    """Write a simulated flight."""
    plan = out / "plans" / f"{name}.toml"
    what = f"{name} {DESIGNS[name]}" if name in DESIGNS else shlex.quote(str(plan))
    acx4(f"simulate {what} --out", out / "flights" / name)


def run(name: str, flight: Path, out: Path) -> None:
    """Run all stages."""
    acx4("run --numbers-only", flight, "--results", out / "results" / name)


def render(flight: Path, out: Path) -> None:
    """Render the exposure that has pictures."""
    images = out / "rendered" / flight.name
    acx4("render --exposures H3-04", flight, "--results", out / "results" / STUDY, "--out", images)


def of_flight(flight: Path, out: Path) -> None:
    """Execute the notebooks of a flight, whose results are kept as well."""
    paths = {"flight_path": flight, "results_path": out / "results" / f"{STUDY}-notebooks"}
    for name in OF_FLIGHT:
        execute(name, out, **paths)


def execute(name: str, out: Path, **parameters: Path) -> None:
    """Execute a notebook, and keep the numbers that it shows."""
    source = NOTEBOOKS / f"{name}.ipynb"
    with tempfile.TemporaryDirectory() as folder:
        done = Path(folder, "done.ipynb")
        given = [word for key, path in parameters.items() for word in ("-r", key, str(path))]
        ended = called([sys.executable, "-m", "papermill", source, done, *given], source.parent)
        if ended.returncode:
            sys.stderr.write(f"{name}: {ended.stderr[-2000:]}")
            return
        cells = numbers_of(nbformat.read(done, nbformat.NO_CONVERT))
    path = out / "numbers" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256(json.dumps(cells).encode()).hexdigest()
    path.write_text(json.dumps({"sha256": digest, "cells": cells}, indent=1), encoding="utf-8")


def imports(out: Path) -> None:
    """Import files of other programs."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for one in SETS:
            (folder / one).symlink_to(Path(os.environ["ACX4_REFERENCE_DATA"], one))
        for file, text in MADE.items():
            (folder / file).parent.mkdir(exist_ok=True)
            (folder / file).write_text(text, encoding="utf-8")
        of_pix4d(folder)
        for flight, arguments in IMPORTS.items():
            acx4(f"import {arguments} --out", out / "imports" / flight, at=folder)


def of_pix4d(folder: Path) -> None:
    """Write a project of Pix4D."""
    from support.projects import pix4d  # noqa: PLC0415

    (folder / "pix4d").mkdir()
    pix4d.write(folder / "pix4d")


# --- numbers that a notebook shows -----------------------------------------------------------

NUMBER = re.compile(r"(?<![\w.])[-+−]?\d[\d\u202f]*(?:\.\d+)?(?:e[-+]?\d+)?", re.IGNORECASE)
SHOWN = ("text/plain", "text/markdown")


def numbers_of(notebook: nbformat.NotebookNode) -> dict[str, list[str]]:
    """Return the numbers that the cells of an executed notebook show, by the cells' names."""
    cells = {cell.id: _shown(cell) for cell in notebook.cells if cell.cell_type == "code"}
    found = {name: NUMBER.findall(text) for name, text in cells.items()}
    return {name: numbers for name, numbers in found.items() if numbers}


def _shown(cell: nbformat.NotebookNode) -> str:
    """Return the text of a cell's outputs, without that of figures."""
    texts = []
    for output in cell.outputs:
        data = output.get("data", {})
        if not any(kind.startswith("image/") for kind in data):
            texts += [output.get("text", ""), *(data.get(kind, "") for kind in SHOWN)]
    return re.sub(r"0x[0-9a-f]+", "", "\n".join(texts))


# --- how things are compared -----------------------------------------------------------------

VALUE, SIGMA, COVARIANCE, OTHER = 1e-6, 1e-7, 1e-6, 1e-5
"""Largest differences: of values and residuals over their sigma, of sigma over itself, of a
covariance over the root of both variances, of statistics over themselves, or over one."""

ZERO = 1e-12
"""Largest difference of what has no sigma, over itself."""

GREY = 2
"""Largest difference of grey values, of 65 535."""

NAMED = ("flight", "run", "sha256", "tables", "versions")
"""Keys of summary.json that say of which files it is."""


def compare_tables(before: Path, now: Path, *, exact: bool) -> list[str]:
    """Return how a table differs, a line for each column."""
    if before.read_bytes() == now.read_bytes():
        return []
    old, new = (pd.read_csv(path, dtype=str, keep_default_na=False) for path in (before, now))
    if [*old] != [*new]:
        return [f"columns {sorted({*old} ^ {*new}) or 'in another order'}"]
    if len(old) != len(new):
        return [f"{len(old)} rows, now {len(new)}"]
    if exact:
        wrong = {name: np.flatnonzero(old[name] != new[name]) for name in old}
        said = [_first(name, old[name], new[name], rows) for name, rows in wrong.items()]
        return [line for line in said if line] or ["other bytes, but equal cells"]
    return [line for name in old if (line := _off(name, old, new))]


def _first(name: str, old: pd.Series, new: pd.Series, rows: np.ndarray) -> str:
    if not len(rows):
        return ""
    i = rows[0]
    return f"{name}: {len(rows)} cells, the first in row {i + 2}: {old[i]!r}, now {new[i]!r}"


def _off(name: str, old: pd.DataFrame, new: pd.DataFrame) -> str:
    """Return how a column differs by more than a fraction of sigma; empty where it does not."""
    try:
        x, y = _floats(old[name]), _floats(new[name])
    except ValueError:
        return _first(name, old[name], new[name], np.flatnonzero(old[name] != new[name]))
    allowed = tolerance(name, old)
    wrong = ~((np.abs(y - x) <= allowed) | (np.isnan(x) & np.isnan(y)))
    return _first(name, old[name], new[name], np.flatnonzero(wrong))


def tolerance(name: str, table: pd.DataFrame) -> np.ndarray:
    """Return the largest allowed difference of every cell of a column of numbers."""
    x = _floats(table[name])
    if name.startswith("n_"):
        return np.zeros(len(x))
    if name.startswith("sigma"):
        return SIGMA * x
    if {"row", "column"} <= {*table}:
        return COVARIANCE * _roots(table)
    if name == "w":
        return VALUE / np.sqrt(np.maximum(_floats(table["redundancy"]), ZERO))
    own = {"value": "sigma", "v": "sigma"}.get(name, f"sigma_{name.removeprefix('d_')}")
    if own not in table:
        return OTHER * np.maximum(1.0, np.abs(x))
    sigma = _floats(table[own])
    return np.where(sigma > 0, VALUE * sigma, ZERO * np.abs(x))


def _floats(cells: pd.Series) -> np.ndarray:
    return np.array([float(cell or "nan") for cell in cells])


def _roots(table: pd.DataFrame) -> np.ndarray:
    """Return the root of both variances of every covariance."""
    of = table.assign(value=_floats(table["value"]))
    key = [name for name in ("stage", "method") if name in table]
    variance = of[of["row"] == of["column"]].set_index([*key, "row"])["value"]
    rows, columns = (
        variance.reindex(pd.MultiIndex.from_frame(of[[*key, name]])).to_numpy()
        for name in ("row", "column")
    )
    return np.sqrt(rows * columns)


def compare_values(before: Any, now: Any, *, exact: bool, at: str = "") -> list[str]:
    """Return how nested values differ, a line for each."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        keys = [key for key in (*before, *(k for k in now if k not in before)) if key not in NAMED]
        own = [(key, before.get(key, "nothing"), now.get(key, "nothing")) for key in keys]
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        own = [(str(i), *pair) for i, pair in enumerate(zip(before, now, strict=True))]
    else:
        return (
            []
            if _same(before, now, exact=exact)
            else [f"{at[1:]}: {before!r:.80}, now {now!r:.80}"]
        )
    return [s for key, *two in own for s in compare_values(*two, exact=exact, at=f"{at}/{key}")]


def _same(before: Any, now: Any, *, exact: bool) -> bool:
    if exact or type(before) is not type(now):
        return before == now and type(before) is type(now)
    if isinstance(before, float):
        return abs(now - before) <= OTHER * max(1.0, abs(before))
    if isinstance(before, str):
        words = [NUMBER.sub("", text) for text in (before, now)]
        return words[0] == words[1] and close(NUMBER.findall(before), NUMBER.findall(now))
    return before == now


def close(before: Sequence[str], now: Sequence[str]) -> bool:
    """Tell whether printed numbers differ by one of their last digit at most."""
    return len(before) == len(now) and all(map(_close, before, now))


def _close(before: str, now: str) -> bool:
    if before == now:
        return True
    x, y = (Decimal(one.replace("−", "-").replace("\u202f", "")) for one in (before, now))
    return abs(x - y) <= Decimal((0, (1,), max(x.as_tuple().exponent, y.as_tuple().exponent)))


def compare_json(before: Path, now: Path, *, exact: bool) -> list[str]:
    """Return how a summary, or the numbers of a notebook, differ."""
    old, new = (json.loads(path.read_text("utf-8")) for path in (before, now))
    if "cells" not in old:
        return compare_values(old, new, exact=exact)
    faults = []
    for name in {**old["cells"], **new["cells"]}:
        x, y = (of["cells"].get(name, []) for of in (old, new))
        if not (x == y if exact else close(x, y)):
            off = next((pair for pair in zip(x, y, strict=False) if pair[0] != pair[1]), ("", ""))
            faults.append(f"cell {name}: {len(x)} numbers, now {len(y)}; {off[0]}, now {off[1]}")
    return faults


def compare_toml(before: Path, now: Path, *, exact: bool) -> list[str]:
    """Return how the values of a flight.toml differ."""
    old, new = (tomllib.loads(path.read_text("utf-8")) for path in (before, now))
    return compare_values(old, new, exact=exact)


def compare_pixels(before: Path, now: Path, *, exact: bool) -> list[str]:
    """Return how the pixels of a TIFF differ."""
    old, new = (tifffile.imread(path) for path in (before, now))
    if old.shape != new.shape or old.dtype != new.dtype:
        return [f"{old.shape} {old.dtype}, now {new.shape} {new.dtype}"]
    apart = np.abs(old.astype(float) - new.astype(float))
    allowed = 0 if exact else GREY
    if apart.max() <= allowed:
        return []
    return [f"{np.mean(apart > allowed):.1e} of the pixels, by up to {apart.max()}"]


KINDS = {
    ".csv": compare_tables,
    ".json": compare_json,
    ".toml": compare_toml,
    ".tif": compare_pixels,
}
"""What is compared, by the ends of files."""

ORIGINS = ("provenance.json", ".acx4.json")
"""Files that say what others were made of."""


def compare(before: Path, now: Path, *, exact: bool) -> Iterator[tuple[str, list[str]]]:
    """Yield every thing that is compared, and how it differs."""
    things = sorted({*things_of(before), *things_of(now)})
    for thing in things:
        old, new = before / thing, now / thing
        if old.is_file() and new.is_file():
            same = old.read_bytes() == new.read_bytes()
            yield thing, [] if same else KINDS[old.suffix](old, new, exact=exact)
        else:
            yield thing, ["is gone" if old.is_file() else "is new"]


def things_of(folder: Path) -> Iterator[str]:
    """Yield the names of the files of a folder that are compared."""
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if path.suffix in KINDS and not left_out(name):
            yield name


def left_out(name: str) -> bool:
    """Tell whether a file is not compared: origins, pictures of an import, plans."""
    parts = Path(name).parts
    copied = parts[0] == "results" and "flight" in parts
    imported = parts[0] == "imports" and "images" in parts
    return copied or imported or parts[0] == "plans" or parts[-1] in ORIGINS


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=("write", "compare"))
    parser.add_argument("folder", type=Path)
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--exact", action="store_true", help="bytes and pixels; the default")
    how.add_argument("--fractions", action="store_true", help="within fractions of sigma")
    given = parser.parse_args(arguments)
    folder = given.folder.resolve()
    if given.task == "write":
        make(folder, folder / "flights")
        return
    with tempfile.TemporaryDirectory() as scratch:
        now = Path(scratch, "now")
        make(now, folder / "flights")
        differs = 0
        for thing, faults in compare(folder, now, exact=not given.fractions):
            sys.stdout.write(f"{'differs' if faults else 'equal':9s}{thing}\n")
            sys.stdout.writelines(f"         {line}\n" for line in faults[:5])
            differs += bool(faults)
    sys.stdout.write(f"{differs} differ\n" if differs else "all are equal\n")
    sys.exit(1 if differs else 0)


if __name__ == "__main__":
    main()
