"""The bytes of a flight's files: opened once, checked, and read if they fit into memory."""

from __future__ import annotations

import hashlib
import os
import resource
import stat
from pathlib import Path

from acx4lib.flight.problems import Problem
from acx4lib.opening import opened, text_of

__all__ = ["fits", "free_memory", "named_file", "opened", "read_bytes", "read_text", "text_of"]

SMALL = 10_000_000
"""Largest file, bytes, that is read without a check of the free memory."""

DEEPEST = 10
"""Largest number of folders in the name of a file."""

EXPANSION = 25
"""Memory needed to read and check a table, as a multiple of the size of its file."""


def read_bytes(
    path: Path, file: str, *, needed_by: str = "a flight", most: int | None = None
) -> tuple[bytes, tuple[Problem, ...]]:
    """Return the content of a regular file, or what is wrong with the file.

    Parameters
    ----------
    path : Path
    file : str
        Its name in messages.
    needed_by : str
        For the message if the file is missing.
    most : int, optional
        Largest size in bytes; by default what the free memory allows.
    """

    def wrong(found: str, expected: str) -> tuple[bytes, tuple[Problem, ...]]:
        problem = Problem(file=file, line=1, column="file", found=found, expected=expected)
        return b"", (problem,)

    try:
        size, data = _content(path, most)
    except FileNotFoundError:
        if path.is_symlink():
            return wrong("is a link to nothing", "must be a readable file")
        return wrong("is not there", f"{needed_by} needs it")
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        reason = getattr(error, "strerror", None) or error
        return wrong(f"cannot be read ({reason})", "must be a readable file")
    if data is None:
        allowed = f"must have at most {most} bytes" if most else "must fit into free memory"
        needs = "" if most else f", reading it takes {EXPANSION} times as much memory"
        return wrong(f"has {size} bytes{needs}", allowed)
    if len(data) != size:
        return wrong("changed while it was read", "must be complete before it is read")
    return data, ()


def read_text(
    path: Path, file: str, *, needed_by: str = "a flight", most: int | None = None
) -> tuple[str, str, tuple[Problem, ...]]:
    """Return a file's text, without byte-order mark, its SHA-256, and what is wrong with it."""
    data, problems = read_bytes(path, file, needed_by=needed_by, most=most)
    if problems:
        return "", "", problems
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        at, found = error.start, f"byte 0x{data[error.start]:02x} is not UTF-8"
    else:
        at, found = data.find(b"\0"), "holds a null character"
        if at < 0:
            return text, hashlib.sha256(data).hexdigest(), ()
    line = data.count(b"\n", 0, at) + 1
    expected = "must be UTF-8 text"
    problem = Problem(file=file, line=line, column="file", found=found, expected=expected)
    return "", "", (problem,)


def named_file(flight: Path, folder: Path, name: str) -> tuple[Path | None, str]:
    """Return the resolved path of a flight's file, or None and what is wrong with its name.

    Parameters
    ----------
    flight : Path
        Folder in which the file must lie; without links.
    folder : Path
        Folder to which the name is relative; without links.
    name : str
    """
    if name.count("/") > DEEPEST:
        return None, f"has more than {DEEPEST} folders"
    path = f"{folder}/{name}" if name[:1] != "/" else name
    try:
        mode: int | None = os.stat(path).st_mode  # noqa: PTH116 a path of each of 100 000 names is slow
        path = os.path.realpath(path)
    except FileNotFoundError:
        mode, path = None, os.path.normpath(path)
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        return None, f"is no file name that can be used ({str(reason).splitlines()[0]})"
    if not path.startswith(f"{flight}/"):
        return None, "lies outside the flight"
    if mode is None:
        return None, "is not there"
    return (Path(path), "") if stat.S_ISREG(mode) else (None, "is no regular file")


def _content(path: Path, most: int | None) -> tuple[int, bytes | None]:
    """Return size and content of a regular file; no content where it is too large."""
    with opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size > most if most else not fits(size):
            return size, None
        return size, file.read(size + 1) if size else b""  # reading one of /proc may never end


def fits(size: int) -> bool:
    """Tell whether files of so many bytes together can be read and checked in the free memory."""
    return size <= SMALL or size * EXPANSION <= free_memory()


def free_memory() -> int:
    """Return the bytes of memory that this process can still get, according to the system."""
    known = [_meminfo(), _group_limit(), _process_limit()]
    return min(free for free in known if free is not None)


def _meminfo() -> int:
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvail"))
    except (OSError, StopIteration):  # another system
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _group_limit() -> int | None:
    """Return the free memory of the container, bytes; None outside a container."""
    group = Path("/sys/fs/cgroup")
    try:
        limit, used = ((group / f"memory.{name}").read_text("ascii") for name in ("max", "current"))
        return int(limit) - int(used)
    except (OSError, ValueError):  # no such group, or "max"
        return None


def _process_limit() -> int | None:
    """Return the free part of the process's address space, bytes; None if it has no limit."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return None
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    except OSError:
        return limit
    return limit - pages * os.sysconf("SC_PAGE_SIZE")
