"""Stored comparisons, used if the measurements are missing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import pandas as pd
from pandas.api.types import is_numeric_dtype

from acx4book.reference import data
from acx4lib.results import whole_files
from acx4lib.results.own_folder import working_copy

PACKAGES = ("acx4lib", "numpy", "scipy", "pyproj")

FOLDER = data.FOLDER / "results"


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """A comparison and its origin.

    Attributes
    ----------
    table : DataFrame
    origin : str
        A sentence: computed now, or date and software of the stored comparison.
    """

    table: pd.DataFrame
    origin: str


def computed_or_stored(
    name: str, sets: Mapping[str, tuple[str, Callable[[], pd.DataFrame]]]
) -> Comparison:
    """Return a comparison, computed if its measurements are here, else the stored one.

    Parameters
    ----------
    name : str
    sets : mapping
        For every comparison, the set of files that it needs and the function that computes it.

    Raises
    ------
    ReferenceDataError
        Where a file is not the indexed one.
    """
    files, compute = sets[name]
    if data.is_here(files):
        return Comparison(table=compute(), origin="Computed from the measurements for this page.")
    known = pd.read_csv(FOLDER / "computed.csv", dtype=str).set_index("name").loc[name]
    versions = ", ".join(f"{package} {known[package]}" for package in PACKAGES)
    return Comparison(
        table=_read(FOLDER / f"{name}.csv"),
        origin=(
            f"The measurements are not on this machine ({data.HINT}); these are the results "
            f"computed on {known['date']} with {versions}."
        ),
    )


def _read(path: Path) -> pd.DataFrame:
    """Read a stored table; texts remain texts, also empty ones."""
    table = pd.read_csv(
        path, keep_default_na=False, na_values=[""], dtype={"printed": str, "point": str}
    )
    texts = table.columns[[not is_numeric_dtype(kind) for kind in table.dtypes]]
    table[texts] = table[texts].fillna("")
    return table


def store(sets: Mapping[str, tuple[str, Callable[[], pd.DataFrame]]]) -> None:
    """Compute all comparisons and store them with the date and the software versions.

    Raises
    ------
    ReferenceDataError
        Where a file is missing, or there is no working copy to store them in.
    """
    if working_copy() is None:
        msg = f"{FOLDER}: is part of the installed library; results are stored in a working copy"
        raise data.ReferenceDataError(msg)
    FOLDER.mkdir(exist_ok=True)
    today = datetime.now(UTC).date().isoformat()
    versions = {package: version(package) for package in PACKAGES}
    for name, (_, compute) in sets.items():
        _write(compute(), name)
    _write(pd.DataFrame([{"name": name, "date": today, **versions} for name in sets]), "computed")


def _write(table: pd.DataFrame, name: str) -> None:
    path = FOLDER / f"{name}.csv"
    text = table.to_csv(index=False, float_format="%.12g", lineterminator="\n")
    whole_files.write(path, text)
