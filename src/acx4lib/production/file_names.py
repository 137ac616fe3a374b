"""Names of files for names that may hold anything."""

from __future__ import annotations

import hashlib
import re

FORBIDDEN = re.compile(
    r"[^\w .+=@,()-]|^[. ]|[. ]$|^(?=(?:con|prn|aux|nul|com\d|lpt\d)$).", re.IGNORECASE
)
"""What some system does not take in a file's name: signs, and CON, PRN, AUX, NUL, COM1, LPT1."""

LONGEST_FILE = 200
"""Bytes of a file's name; what is made of it adds some, and systems take 255."""


def file_stem(name: str) -> str:
    """Return a file name without its ending for a name; different names have different ones."""

    def quoted(found: re.Match[str]) -> str:
        return "".join(f"%{byte:02X}" for byte in found[0].encode())

    stem = FORBIDDEN.sub(quoted, name)
    if len(stem.encode()) <= LONGEST_FILE:
        return stem
    digest = hashlib.sha256(name.encode()).hexdigest()
    return f"{stem.encode()[: LONGEST_FILE - 17].decode(errors='ignore')}~{digest[:16]}"
