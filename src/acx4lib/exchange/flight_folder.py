"""What was brought, written as a flight's folder, or into one that an import began.

A file that the user changed is not replaced: a table is an error, and flight.toml stays as it is.
"""

from __future__ import annotations

import csv
import io
import os
import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.errors import OutputError
from acx4lib.exchange import written_toml
from acx4lib.exchange.brought import Brought
from acx4lib.flight.text.in_memory import Columns
from acx4lib.results.own_folder import claims, marks

COMMAND = "acx4 import"
"""Whose the folders are."""

SETTINGS, STATEMENT = "flight.toml", "import.md"


def write(brought: Brought, folder: Path) -> tuple[str, ...]:
    """Write what was brought; all of it, or nothing.

    Parameters
    ----------
    brought : Brought
    folder : Path
        New, empty, or written by an import before: then tables are replaced, and settings are
        added to those of flight.toml.

    Returns
    -------
    tuple of str
        What the user has to know of the folder; a sentence each.

    Raises
    ------
    OutputError
        Where a file that would be replaced was changed, or is not of an import.
    """
    with claims.claim(folder, command=COMMAND, becomes_flight=True) as own:
        edited = _is_edited(own)
        texts = {name: table_text(table) for name, table in brought.tables.items()}
        texts[STATEMENT] = _read(folder / STATEMENT) + statement(brought, edited=edited)
        if brought.settings and not edited:
            texts[SETTINGS] = settings_text(_read(folder / SETTINGS), brought.settings)
        names = [*texts, *brought.pictures]
        if changed := marks.changes(folder, names):
            msg = f"{changed[0]}; move it away, or choose another folder"
            raise OutputError(msg)
        if edited:
            own.files.pop(SETTINGS, None)
        own.expect(names)
        for name, text in texts.items():
            _place(folder / name, text)
        for name, picture in brought.pictures.items():
            _link(picture, folder / name)
        own.seal()
    if edited and brought.settings:
        kept = f"{SETTINGS} was edited and stays as it is; what the source says is in {STATEMENT}"
        return (kept,)
    return ()


def table_text(table: Columns) -> str:
    """Return a table as the text of a CSV file; a number has the digits that it needs."""
    names = list(table) if isinstance(table, Mapping) else list(table.columns)
    columns = [np.asarray(table[name], dtype=object).tolist() for name in names]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*columns, strict=True))
    return buffer.getvalue()


def settings_text(before: str, brought: Mapping[str, Any]) -> str:
    """Return the text of flight.toml with settings added; of two values the new one is taken."""
    return written_toml.written(_merged(tomllib.loads(before), brought))


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


def _is_edited(own: claims.OwnFolder) -> bool:
    """Tell whether the settings that are there are the user's."""
    if not (own.path / SETTINGS).is_file():
        return False
    return SETTINGS not in own.files or bool(marks.changes(own.path, [SETTINGS]))


def _merged(before: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    both = dict(before)
    for key, value in new.items():
        old = before.get(key)
        if isinstance(value, Mapping) and isinstance(old, Mapping):
            both[key] = _merged(old, value)
        else:
            both[key] = value
    return both


def _read(path: Path) -> str:
    return path.read_text("utf-8") if path.is_file() else ""


def _place(path: Path, text: str) -> None:
    """Write a file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f"{marks.SCRATCH}{path.name}")
    new.write_text(text, encoding="utf-8", newline="\n")
    new.replace(path)


def _link(picture: Path, place: Path) -> None:
    """Put a picture in its place: a second name of the same file, or a copy on another disk."""
    place.parent.mkdir(parents=True, exist_ok=True)
    place.unlink(missing_ok=True)
    try:
        os.link(picture.resolve(), place)
    except OSError:
        shutil.copyfile(picture, place)
