"""What of a run's results stands: which stages are those of the flight as it is now."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from acx4book.command.batch.jobs import Settings
from acx4book.notebooks import runner
from acx4lib.errors import Acx4Error
from acx4lib.flight.reader import Flight
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.opening import text_of
from acx4lib.results import earlier, folder, own_folder, provenance, runs, whole_files
from acx4lib.results.table_files import NOTEBOOKS, PART_OF
from acx4lib.stages import order


def stages_of(results: Path) -> list[str]:
    """Return the stages that were run with the flight that is kept beside their results."""
    if not (results / provenance.FILE).is_file():
        return []
    found = provenance.read(results)
    return [name for name, run in found.stages.items() if run["flight"] == found.digest]


def is_whole(flight: Flight, results: Path, settings: Settings) -> bool:
    """Tell whether a run would leave what is there.

    It would where all files are as a run wrote them, and every stage that the flight has data for
    was run to its end with this flight, by this software, and by these notebooks if any are wanted.
    Pictures are not compared.

    Parameters
    ----------
    flight : Flight
        As it is now.
    results : Path
    settings : Settings
    """
    try:
        if own_folder.read_mark(results)[0] != runs.COMMAND or own_folder.changes(results):
            return False
        found = provenance.read(results)
        told = earlier.read(settings.calibration, flight).told if settings.calibration else None
    except Acx4Error:  # a run says what is wrong, or puts it right
        return False
    run: dict[str, object] = {"flight": found.digest, "versions": provenance.versions()}
    run |= {"calibration": told} if told else {}
    parts = [s for s in runner.parts_of(settings.stages) if not order.missing(flight, s)]
    return (
        dict(found.files) == provenance.checksums(flight)
        and all(found.stages.get(PART_OF.get(part, part)) == run for part in parts)
        and ("rig" not in parts or "mounting/rig" in folder.entries(results))
        and all(_is_executed(settings.notebooks, results, part) for part in ("flight", *parts))
    )


def _is_executed(notebooks: Path | None, results: Path, part: str) -> bool:
    """Tell whether the results have a part's notebook with the cells that it has now."""
    if notebooks is None:
        return True
    name = f"{NOTEBOOKS[part]}.ipynb"
    executed = results / runs.EXECUTED / name
    return executed.is_file() and _cells(executed) == _cells(notebooks / name)


def _cells(notebook: Path) -> list[str]:
    """Return the text of all cells but those of parameters."""
    of_parameters = {"parameters", "injected-parameters"}
    return [
        "".join(cell["source"])
        for cell in json.loads(text_of(notebook))["cells"]
        if not of_parameters & set(cell["metadata"].get("tags", []))
    ]


# --- The table of many flights: a row for each, as text, so that equal results give equal bytes
#
# What differs from call to call, such as times, stands in a table of its own.


METHOD = "single_step"
"""The method whose parameters and check points are shown."""

VALIDATED = (f"validation/{METHOD}", "validation/given")
"""Where the check points are, the first that there is; the second of a flight that was not
calibrated."""

_PARAMETERS = tuple(name for name, _ in REPORTED.values())
_ADJUSTMENT = ("sigma0_squared", "redundancy", "n_rejected")
_CHECKED = {"mean": "_m", "rms": "_m", "normalised_rms": ""}

COLUMNS = (
    *("flight", "status", "reason", "camera"),
    *_ADJUSTMENT,
    *(column for name in _PARAMETERS for column in (name, f"sigma_{name}")),
    "n_check_points",
    *(f"{what}_{axis}{unit}" for what, unit in _CHECKED.items() for axis in AXES),
)
"""Columns of the table of all flights."""

TIME_COLUMNS = ("flight", "seconds", "cpu_s", "peak_mb", "worker")
"""Columns of the other table: time and processor time of a run, s; the most memory that its
process has had so far, MB; host and number of this process."""

Row = Mapping[str, str]


def row_of(results: Path, stages: Sequence[str]) -> dict[str, str]:
    """Return what some stages left, by the names of `COLUMNS`.

    Parameters
    ----------
    results : Path
    stages : sequence of str
        Of these alone, since others may be of an earlier run.
    """
    row: dict[str, str] = {}
    summary = folder.entries(results)
    if "mounting" in stages:
        entry = summary.get(f"mounting/{METHOD}", {})
        row |= {name: _text(entry[name]) for name in _ADJUSTMENT if name in entry}
        row |= _parameters(results / "parameters.csv")
    if "validation" in stages:
        row |= _checked(next((summary[name] for name in VALIDATED if name in summary), {}))
    return row


def read(path: Path) -> dict[str, dict[str, str]]:
    """Return the rows of a table by flight; none where it is not there."""
    if not path.exists():
        return {}
    lines = io.StringIO(text_of(path), newline="")
    return {row["flight"]: row for row in csv.DictReader(lines) if row.get("flight")}


def write(path: Path, columns: Sequence[str], rows: Iterable[Row]) -> None:
    """Replace a table by another, whole or not at all; what a row does not have is empty."""
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    whole_files.write(path, table.getvalue())


def _parameters(path: Path) -> Iterator[tuple[str, str]]:
    """Yield camera, values and sigmas of the method, exactly as they are written there."""
    for line in csv.DictReader(io.StringIO(text_of(path), newline="")):
        if (line["stage"], line["method"]) != ("mounting", METHOD):
            continue
        if line["camera"]:
            yield "camera", line["camera"]
        yield line["parameter"], line["value"]
        yield f"sigma_{line['parameter']}", line["sigma"]


def _checked(entry: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Yield the number of check points, and means and root mean squares of their differences."""
    if "n_points" in entry:
        yield "n_check_points", _text(entry["n_points"])
    points = entry.get("points")
    for what, unit in _CHECKED.items() if isinstance(points, dict) else ():
        for axis, value in zip(AXES, points.get(what) or (), strict=False):  # type: ignore[attr-defined]
            yield f"{what}_{axis}{unit}", _text(value)


def _text(value: object) -> str:
    return "" if value is None else json.dumps(value)
