"""What a long run leaves in data/benchmarks; `acx4book.pages.benchmarks.stored` reads it."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd


def write(
    folder: Path,
    name: str,
    tables: Mapping[str, pd.DataFrame],
    about: Mapping[str, Any],
    *,
    digits: int | None = None,
) -> None:
    """Write all files, and only then put them in the place of older ones.

    Parameters
    ----------
    folder : Path
    name : str
        ``NAME.json`` says what the tables hang on, and the date.
    tables : dict of str to DataFrame
        Each becomes ``NAME_KEY.csv``, or ``NAME.csv`` for an empty key.
    about : dict
    digits : int, optional
        Significant digits of the numbers in the tables; all by default.
    """
    folder.mkdir(parents=True, exist_ok=True)
    about = {"date": datetime.now(UTC).date().isoformat(), **about}
    form = None if digits is None else f"%.{digits}g"
    with tempfile.TemporaryDirectory(dir=folder) as fresh:
        for key, table in tables.items():
            path = Path(fresh, f"{name}_{key}.csv" if key else f"{name}.csv")
            table.to_csv(path, index=False, float_format=form)
        text = json.dumps(about, indent=2) + "\n"
        Path(fresh, f"{name}.json").write_text(text, encoding="utf-8")
        for made in sorted(Path(fresh).iterdir()):
            made.replace(folder / made.name)
    sys.stderr.write(f"{folder / name}.json\n")
