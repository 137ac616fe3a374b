"""What was brought, written as a flight's folder, or into one that an import began.

A file that the user changed is not replaced: a table is an error, and flight.toml stays as it is.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from acx4lib.errors import FlightError, OutputError
from acx4lib.flight.problems import lines_of
from acx4lib.flight.table_files import Columns, text_of
from acx4lib.flight.tables import name_fault
from acx4lib.flight.toml_file import read_toml
from acx4lib.results import own_folder, whole_files
from acx4tools.exchange import written_toml
from acx4tools.exchange.brought import Brought, number_of

COMMAND = "acx4 import"
"""Whose the folders are."""

SETTINGS, STATEMENT = "flight.toml", "import.md"

SYSTEMS = ("crs", "heights")
"""Settings of which a flight has one for all its numbers."""

SYNTHETIC = "SYN"
"""Name of the camera that a rig's heads make together, where the source has none."""

SEEN = ("width_px", "height_px", "pixel_um", "focal_mm")
SEEN_FROM = ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg")
"""What the synthetic camera has of the first head."""


def write(brought: Brought, folder: Path) -> tuple[str, ...]:
    """Write what was brought; all of it, or nothing.

    Parameters
    ----------
    brought : Brought
    folder : Path
        New, empty, or written by an import before: then tables of the same name are replaced,
        which is said, and settings are added to those of flight.toml.

    Returns
    -------
    tuple of str
        What the user has to know of the folder; a sentence each.

    Raises
    ------
    OutputError
        Where a file that would be replaced was changed, or is not of an import, or the flight
        has its numbers in another CRS or other heights.
    FlightError
        Where measurements lie outside the pictures.
    """
    _require_inside(brought)
    with own_folder.claim(folder, command=COMMAND, becomes_flight=True) as own:
        edited = _is_edited(own)
        texts = {name: table_text(table) for name, table in brought.tables.items()}
        texts[STATEMENT] = _read(folder / STATEMENT) + statement(brought, edited=edited)
        if brought.settings and not edited:
            texts[SETTINGS] = _settings(folder, brought.settings)
        pictures = {
            name: one
            for name, one in brought.pictures.items()
            if one.absolute() != (folder / name).absolute()
        }
        names = [*texts, *pictures]
        if changed := own_folder.changes(folder, names):
            msg = f"{changed[0]}; move it away, or choose another folder"
            raise OutputError(msg)
        if edited:
            own.files.pop(SETTINGS, None)
        remarks = _replaced(folder, {name: texts[name] for name in brought.tables})
        own.expect(names)
        _place(folder, texts, pictures)
        own.seal()
    if edited and brought.settings:
        kept = f"{SETTINGS} was edited and stays as it is; what the source says is in {STATEMENT}"
        return (kept, *remarks)
    return remarks


def _require_inside(brought: Brought) -> None:
    """Raise for the first measurement outside the picture that it is in, with their number."""
    sizes = {
        name: (one["width_px"], one["height_px"])
        for name, one in brought.settings.get("cameras", {}).items()
        if {"width_px", "height_px"} <= set(one)
    }
    for file, points in brought.tables.items():
        images = brought.tables.get(file.replace("image_points.csv", "images.csv"))
        if not file.endswith("/image_points.csv") or images is None or not len(points["image"]):
            continue
        of = dict(zip(images["image"], images["camera"], strict=True))
        size = np.array([sizes.get(of.get(n, ""), (np.inf, np.inf)) for n in points["image"]])
        colrow = np.stack([points["col_px"], points["row_px"]], axis=1).astype(float)
        rows = np.flatnonzero(((colrow < -0.5) | (colrow > size - 0.5)).any(axis=1))
        if not len(rows):
            continue
        k = int(rows[0])
        (col, row), (width, height) = colrow[k].tolist(), size[k].tolist()
        n, read = len(rows), min(brought.sha256, default=brought.source)
        raise FlightError(
            [
                f"{read}:1: point {points['point'][k]} in {points['image'][k]}: col {col:.1f}, "
                f"row {row:.1f}, and {n} of {len(colrow)} measurements lie outside their pictures; "
                f"must lie in {width:g} x {height:g} px, the size that was given or read"
            ]
        )


def _replaced(folder: Path, tables: Mapping[str, str]) -> tuple[str, ...]:
    """Return sentences on tables of an earlier import that others take the place of."""
    before = {name: _n_rows(_read(folder / name)) for name in tables}
    return tuple(
        f"{name}: {number_of(n, 'rows')} of an earlier import replaced by {_n_rows(tables[name])}"
        for name, n in before.items()
        if n and _read(folder / name) != tables[name]
    )


def _n_rows(text: str) -> int:
    """Return the number of rows of a table after its header."""
    return max(sum(1 for _ in csv.reader(io.StringIO(text))) - 1, 0)


def begin(
    folder: Path, texts: Mapping[str, str], files: Mapping[str, Path] = MappingProxyType({})
) -> None:
    """Write the files of a new flight, to which imports may add.

    Parameters
    ----------
    folder : Path
        New or empty.
    texts : mapping of str to str
        By file below the flight.
    files : mapping of str to Path
        Files that it gets as they are, such as a geoid grid.

    Raises
    ------
    OutputError
        Where the folder holds anything.
    """
    with own_folder.claim(folder, command=COMMAND, becomes_flight=True) as own:
        if own.files:
            msg = f"{folder}: an import began this flight already; choose another folder"
            raise OutputError(msg)
        own.expect([*texts, *files])
        _place(folder, texts, files)
        own.seal()


def table_text(table: Columns) -> str:
    """Return a table as the text of a CSV file; a number has the digits that it needs."""
    names = list(table) if isinstance(table, Mapping) else list(table.columns)
    columns = [np.asarray(table[name], dtype=object).tolist() for name in names]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*columns, strict=True))
    return buffer.getvalue()


def statement(brought: Brought, *, edited: bool = False) -> str:
    """Return the part of import.md on what was brought.

    Parameters
    ----------
    brought : Brought
    edited : bool
        Whether the settings have no other place.
    """
    files = [f"{name}, SHA-256 {sha256}" for name, sha256 in brought.sha256.items()]
    parts = {
        "Read": files,
        "Assumed": brought.assumed,
        "Found": brought.found,
        "Left out": brought.left_out,
    }
    lines = [f"# {brought.source}", ""]
    for title, sentences in parts.items():
        if sentences:
            lines += [f"## {title}", "", *(f"- {one}" for one in sentences), ""]
    if edited and brought.settings:
        text = written_toml.written(brought.settings).rstrip("\n")
        lines += ["## Settings", "", "```toml", *text.split("\n"), "```", ""]
    return "\n".join(lines) + "\n"


def _is_edited(own: own_folder.OwnFolder) -> bool:
    """Tell whether the settings that are there are the user's."""
    if not (own.path / SETTINGS).is_file():
        return False
    return SETTINGS not in own.files or bool(own_folder.changes(own.path, [SETTINGS]))


def _settings(folder: Path, brought: Mapping[str, Any]) -> str:
    """Return the text of flight.toml with settings added; a new one gets the folder's name."""
    before, known = _read(folder / SETTINGS), {}
    if before:
        toml = read_toml(folder / SETTINGS)
        if toml.problems:
            raise FlightError(lines_of(toml.problems))
        known = toml.values
    for key in SYSTEMS:
        if key in known and key in brought and known[key] != brought[key]:
            msg = (
                f"{folder / SETTINGS}: {key} is {known[key]!r}, and {brought[key]!r} in what is "
                f"brought: name the same by --{key}, or choose another folder"
            )
            raise OutputError(msg)
    name = folder.resolve().name
    named = {} if "name" in known or name_fault(name) else {"name": name}
    return written_toml.added(before, named | dict(brought))


def _read(path: Path) -> str:
    return text_of(path) if path.exists() else ""


def _place(folder: Path, texts: Mapping[str, str], files: Mapping[str, Path]) -> None:
    """Write files, and give others, as pictures, a second name, by their names in a folder."""
    for name in (*texts, *files):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    for name, file in files.items():
        whole_files.link(file, folder / name)
    whole_files.write_all({folder / name: text for name, text in texts.items()})


def with_synthetic(brought: Brought) -> Brought:
    """Return what was brought with the camera that heads make together, as a flight needs it.

    It has the size, the focal length and the direction of the first head: right for heads whose
    fields coincide, and to be enlarged where they look apart.
    """
    images = brought.tables.get("heads/images.csv")
    cameras = brought.settings.get("cameras", {})
    heads = [] if images is None else [*dict.fromkeys(images["camera"])]
    if len(heads) < 2 or "synthetic" in brought.settings or SYNTHETIC in cameras:
        return brought
    if heads[0] not in cameras:
        return brought
    first = cameras[heads[0]]
    virtual = {key: first[key] for key in (*SEEN, *SEEN_FROM) if key in first}
    settings = dict(brought.settings) | {
        "cameras": {**cameras, SYNTHETIC: virtual},
        "synthetic": {"camera": SYNTHETIC, "heads": heads},
    }
    said = f"The synthetic camera {SYNTHETIC} has size, focal length and direction of {heads[0]}"
    return replace(brought, settings=settings, assumed=(*brought.assumed, said))
