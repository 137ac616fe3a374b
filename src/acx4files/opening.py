"""Safe opening of files from strangers; it needs only Python."""

from __future__ import annotations

import errno
import io
import os
import stat
from pathlib import Path

from acx4lib import system


def opened(path: Path) -> io.BufferedReader:
    """Open a regular file to be read. Every file that may be a stranger's is opened here.

    Raises
    ------
    OSError
        Where there is none, with its name; opening a pipe would wait for its other end, and a
        device may never end.
    """
    return open(path, "rb", opener=_regular)


def text_of(path: Path) -> str:
    """Return the text of a regular file, UTF-8 with or without a byte-order mark.

    Raises
    ------
    OSError
        As `opened`.
    UnicodeDecodeError
    """
    with opened(path) as file:
        return file.read().decode("utf-8-sig")


def _regular(path: str, flags: int) -> int:
    handle = os.open(path, flags | system.flags("O_NONBLOCK", "O_NOCTTY"))
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode):
        return handle
    os.close(handle)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
    raise OSError(errno.EINVAL, "no regular file", path)
