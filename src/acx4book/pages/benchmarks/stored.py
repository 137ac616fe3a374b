"""Results of long runs in ``data/benchmarks``: tables, and a file about the machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd


def read(
    folder: Path, name: str, *parts: str, make: str = "bench"
) -> tuple[dict[str, Any], list[pd.DataFrame]]:
    """Return the content of ``NAME.json``, and the tables.

    Parameters
    ----------
    folder : Path
    name : str
    parts : str
        The tables are ``NAME_PART.csv``; without parts the table is ``NAME.csv``.
    make : str
        The target of ``make`` that writes these files.

    Raises
    ------
    FileNotFoundError
        If a file is missing: the message says how to make it.
    """
    tables = [folder / f"{name}_{part}.csv" for part in parts] or [folder / f"{name}.csv"]
    about = folder / f"{name}.json"
    if not all(path.is_file() for path in (about, *tables)):
        msg = f"no benchmark of {name} in {folder}: make {make}"
        raise FileNotFoundError(msg)
    return json.loads(about.read_text(encoding="utf-8")), [pd.read_csv(path) for path in tables]
