"""Seeds from the name of a student, the sheet, and a key that only the lecturer has."""

from __future__ import annotations

import hmac
import unicodedata
from pathlib import Path

from acx4lib.errors import FlightError
from acx4lib.flight.problems import lines_of, quoted
from acx4lib.flight.table_files import read_bytes
from acx4lib.flight.tables import name_fault

SHORTEST_KEY = 32
"""Bytes. A short key could be found by trying: simulate, and compare with the flight."""

LONGEST_KEY = 4096
"""Bytes."""

LONGEST_FOLDER = 50
"""Characters of a name that go into the name of a folder."""

MAKE_A_KEY = "python3 -c 'import secrets; print(secrets.token_hex(32))' > FILE"


def read_key(path: Path) -> bytes:
    """Return the lecturer's key; white space around it does not count.

    Raises
    ------
    FlightError
        Where the file cannot be read, or the key is too short.
    """
    data, problems = read_bytes(path, str(path), needed_by="every flight's seed", most=LONGEST_KEY)
    if problems:
        raise FlightError([f"{lines_of(problems)[0]}; make a key by {MAKE_A_KEY}"])
    key = data.strip()
    if len(key) < SHORTEST_KEY:
        says = f"holds a key of {len(key)} bytes, which could be guessed; at least {SHORTEST_KEY}"
        raise FlightError([f"{path}: {says}: make one by {MAKE_A_KEY}"])
    return key


def shown_name(name: str) -> str:
    """Return a name as it is written: composed letters, single spaces.

    Raises
    ------
    ValueError
        Where it is empty or cannot be a name.
    """
    shown = " ".join(unicodedata.normalize("NFC", name).split())
    fault = name_fault(shown) if shown else ("is empty", "must be a name")
    if fault:
        msg = f"the student's name {fault[0]}; {fault[1]}"
        raise ValueError(msg)
    return shown


def same_name(name: str) -> str:
    """Return what all spellings of a name have in common: case and spaces do not count."""
    return unicodedata.normalize("NFC", shown_name(name).casefold())


def seed(key: bytes, *, sheet: str, student: str, purpose: str) -> int:
    """Return a seed of 256 bits: HMAC-SHA256 of purpose, sheet and name.

    Parameters
    ----------
    key : bytes
    sheet, student : str
    purpose : str
        Seeds of two purposes tell nothing of each other.
    """
    message = "\0".join((purpose, sheet, same_name(student))).encode()
    return int.from_bytes(hmac.digest(key, message, "sha256"), "big")


def folder_name(sheet: str, student: str) -> str:
    """Return a name for the folder of a student's flight: letters, digits, hyphens."""
    kept = "".join(c if c.isalnum() else "-" for c in same_name(student))
    parts = [part for part in kept.split("-") if part]
    return "-".join([sheet, *parts])[: len(sheet) + 1 + LONGEST_FOLDER].rstrip("-")


def title(sheet: str, student: str) -> str:
    """Return the name of a student's flight, which its results keep."""
    return f"{sheet}: {student}"


def of_title(name: str) -> tuple[str, str]:
    """Return sheet and student from the name of a flight; ValueError for any other name."""
    sheet, found, student = name.partition(": ")
    if not found or not sheet.startswith("lab-"):
        msg = f"{quoted(name)} is no flight of a lab sheet"
        raise ValueError(msg)
    return sheet, student
