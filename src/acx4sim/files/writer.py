"""A simulated flight on disk."""

import json
import tempfile
from pathlib import Path

from acx4sim.files.flights import SimulatedFlight
from acx4sim.files.toml_files import MADE_BY
from acx4sim.pictures.photography import Tell, take

TRUTH_MARK = f'"made_by": "{MADE_BY}"'.encode()
"""Text at the beginning of every truth."""


def truth_path(folder: str | Path) -> Path:
    """Return the path of a flight's truth: beside its folder, never inside."""
    folder = Path(folder)
    return folder.with_name(f"{folder.name}.truth.json")


def write(flight: SimulatedFlight, folder: str | Path, *, tell: Tell = lambda *_: None) -> None:
    """Write a flight folder with its pictures and, beside it, its truth.

    The folder appears complete or not at all.

    Parameters
    ----------
    flight : SimulatedFlight
        The flight.
    folder : str or Path
        Folder to write; it must not exist, or be empty.
    tell : callable
        Called with the name of a picture, its number of finished rows, and of all rows.

    Raises
    ------
    FileExistsError
        Where the folder or the truth exists already.
    """
    folder = Path(folder).resolve()
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        msg = f"{folder} exists already and is not an empty folder; choose another name"
        raise FileExistsError(msg)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".simulate-") as scratch:
        draft = Path(scratch) / "flight"
        write_files(flight, draft)
        if flight.photography is not None:
            take(flight.photography, draft, tell)
        truth_draft = Path(scratch) / "truth.json"
        _write_text(truth_draft, json.dumps(flight.truth, indent=1) + "\n")
        if folder.exists():
            folder.rmdir()
        truth_draft.replace(truth_path(folder))
        draft.replace(folder)


def write_files(flight: SimulatedFlight, folder: Path) -> None:
    """Write the tables and flight.toml into a new folder: neither pictures nor truth."""
    folder.mkdir()
    _write_text(folder / "flight.toml", flight.toml)
    for name, table in flight.tables.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        _write_text(path, table.to_csv(index=False, lineterminator="\n"))


def _write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
