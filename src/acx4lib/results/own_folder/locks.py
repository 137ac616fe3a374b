"""The lock of a folder: one command at a time writes there."""

from __future__ import annotations

import contextlib
import fcntl
import io
import json
import os
import socket
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from acx4lib.errors import OutputError
from acx4lib.opening import opened
from acx4lib.results.own_folder.whole_files import naming

LOCK = ".acx4.lock"
"""Says which process on which machine is writing into a folder; gone when it is done."""


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder.

    The system releases it when its process ends, however it does, so that one that was left
    behind is taken over. Whether a process of another machine lives cannot be seen; its lock holds.

    Raises
    ------
    OutputError
        Where somebody else is writing, in one line with the process and the machine.
    """
    path = folder / LOCK
    with contextlib.closing(_taken(path)) as file:
        said = json.dumps({"process": os.getpid(), "host": socket.gethostname()}).encode()
        try:
            with naming(path, size=len(said)):
                os.ftruncate(file.fileno(), 0)
                os.pwrite(file.fileno(), said, 0)
            yield
        finally:
            path.unlink(missing_ok=True)


def writer(folder: Path) -> str:
    """Return who is writing into a folder, as a sentence; empty where nobody is."""
    path = folder / LOCK
    if path.is_symlink() or not path.is_file():
        return ""
    with io.TextIOWrapper(opened(path), "utf-8", "replace") as file:
        return _busy(file, path)


def _taken(path: Path) -> TextIO:
    """Return the open and locked file of a lock."""
    while True:
        number = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
        if not stat.S_ISREG(os.fstat(number).st_mode):
            os.close(number)
            msg = f"{path}: is no regular file; remove it, or choose another folder"
            raise OutputError(msg)
        file = os.fdopen(number, "r+", encoding="utf-8", errors="replace")
        busy = _busy(file, path)
        if busy:
            file.close()
            raise OutputError(busy)
        with contextlib.suppress(FileNotFoundError):
            if path.stat().st_ino == os.fstat(number).st_ino:
                return file
        file.close()  # the one before has just removed it


def _busy(file: TextIO, path: Path) -> str:
    """Try to take a lock; return who has it, as a sentence, and empty where nobody has."""
    owner = _owner(file.read())
    who = f"process {owner[0]} on {owner[1]}" if owner else "another process"
    says = f"{path.parent}: {who} is writing there; wait for it, or choose another folder"
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return says
    except OSError:  # a file system without locks: what the file says has to do
        if owner and owner[1] == socket.gethostname() and _is_alive(owner[0]):
            return says
    if owner and owner[1] != socket.gethostname():
        return f"{says}; if it is gone, remove {path}"
    return ""


def _owner(text: str) -> tuple[int, str] | None:
    try:
        said = json.loads(text)
        return int(said["process"]), str(said["host"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


def _is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True
