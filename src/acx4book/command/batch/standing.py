"""What of a run's results stands: which stages are those of the flight as it is now."""

from __future__ import annotations

import json
from pathlib import Path

from acx4book.command.batch.jobs import Settings
from acx4book.notebooks import runner
from acx4lib.errors import Acx4Error
from acx4lib.flight.reader import Flight
from acx4lib.flight.text.files import text_of
from acx4lib.results import earlier, folder, provenance, runs
from acx4lib.results.files.schemas import NOTEBOOKS, PART_OF
from acx4lib.results.own_folder import marks
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
        if marks.read_mark(results)[0] != runs.COMMAND or marks.changes(results):
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
