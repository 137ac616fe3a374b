"""What ``acx4 import`` says of files that other programs wrote (``make reference-results``).

The files are those of the reference data; what is printed is stored in data/benchmarks and shown by
the page on where files come from.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import shlex
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from acx4book.command.acx4 import main as acx4
from acx4book.reference import data
from benchmarks import harness
from benchmarks.harness import OUT

SETS = ("applanix_pdal", "formats", "ign-uce-m3")
EVENTS = "image,time\nfirst,151631.004\nsecond,151631.0075\n"
"""Between the two records of PDAL's sample."""

ON_GRID = "--crs EPSG:2154 --heights ign-uce-m3/fr_ign_RAF20.tif --scaled-above 3"
RUNS = {
    "sbet": "sbet applanix_pdal/2-points.sbet --events events.csv --time gps-sow",
    "orientations": f"orientations ign-uce-m3/images.OPK --of camera {ON_GRID}",
    "metashape": "metashape formats/metashape/markers_micasenses_rededge.xml",
    "colmap": "colmap formats/colmap/bin",
    "opensfm": "opensfm formats/opensfm/OpenSfM_example_meshed.json",
    "odm-control": "odm-control formats/odm/gcp_list.txt",
    "opf": "opf formats/opf/project.opf",
    "micmac": "micmac formats/micmac",
    "pictures": "pictures formats/dji",
}
"""Arguments by the name of the kind."""

COMMANDS = {name: f"acx4 import {arguments} --out {name}" for name, arguments in RUNS.items()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run all imports and store what they say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    given = parser.parse_args(arguments)
    harness.refuse_changes(given.out)
    if missing := [name for name in SETS if not data.is_here(name)]:
        sys.exit(f"{', '.join(missing)}: {data.HINT}")
    table = pd.DataFrame(list(said()))
    versions = harness.package_versions(["acx4lib"])
    about = {"commands": COMMANDS, "commit": harness.commit(), "versions": versions}
    harness.write(given.out, "imports", {"": table}, about)


def said(names: Sequence[str] = tuple(RUNS)) -> Iterator[dict[str, str]]:
    """Yield the lines of commands, a row each: kind and line."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for name in SETS:
            Path(name).symlink_to(data.folder() / name)
        Path("events.csv").write_text(EVENTS, encoding="utf-8")
        for name in names:
            for line in printed(COMMANDS[name]):
                yield {"kind": name, "line": line}


def printed(command: str) -> list[str]:
    """Return the lines that a command prints.

    Raises
    ------
    RuntimeError
        Where it fails.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            acx4(shlex.split(command)[1:])
        except SystemExit as end:
            if end.code:
                msg = f"{command}: {err.getvalue()}"
                raise RuntimeError(msg) from None
    return out.getvalue().splitlines()


if __name__ == "__main__":
    main()
