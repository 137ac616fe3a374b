"""The bytes of a flight's files: opened once, looked at, and read as far as memory allows."""

from __future__ import annotations

import hashlib
import os
import resource
import stat
from pathlib import Path

from acx4lib.flight.problems import Problem

SMALL = 10_000_000
"""A file of so many bytes is read without a look at the memory."""

DEEPEST = 10
"""Folders in the name of a file."""

EXPANSION = 25
"""A table takes at most so many times the bytes of its file while it is read and checked."""


def read_bytes(
    path: Path, file: str, *, needed_by: str = "a flight", most: int | None = None
) -> tuple[bytes, tuple[Problem, ...]]:
    """Return what a regular file holds, or what is wrong with it.

    Parameters
    ----------
    path : Path
    file : str
        What to call it.
    needed_by : str
        Said where it is not there.
    most : int, optional
        Bytes that such a file may have; what the memory allows where nothing is said.
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
    """Return a file's text without byte-order mark and its SHA-256, or what is wrong with it."""
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
    """Return a named file of a flight with links resolved, or None and what is wrong with it.

    Parameters
    ----------
    flight : Path
        Folder that the file must not leave, links resolved.
    folder : Path
        The name is relative to it; links resolved.
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
    # A pipe would wait for its other end, and a device may never end.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    with open(handle, "rb") as opened:  # noqa: PTH123 what is open already
        status = os.fstat(handle)
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(0, "Is a directory")
        if not stat.S_ISREG(status.st_mode):
            raise OSError(0, "no regular file")
        size = status.st_size
        if size > (SMALL if most is None else most) and (most or size * EXPANSION > free_memory()):
            return size, None
        return size, opened.read(size + 1) if size else b""  # those of /proc may never answer


def free_memory() -> int:
    """Return the bytes of memory that this process can still have, as far as the system says."""
    known = [_meminfo(), _group_limit(), _process_limit()]
    return min(free for free in known if free is not None)


def _meminfo() -> int:
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvail"))
    except (OSError, StopIteration):  # another system
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def _group_limit() -> int | None:
    """Return what is left of a container's memory."""
    group = Path("/sys/fs/cgroup")
    try:
        limit, used = ((group / f"memory.{name}").read_text("ascii") for name in ("max", "current"))
        return int(limit) - int(used)
    except (OSError, ValueError):  # no such group, or "max"
        return None


def _process_limit() -> int | None:
    """Return what is left of the address space that the process was allowed."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return None
    try:
        pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    except OSError:
        return limit
    return limit - pages * os.sysconf("SC_PAGE_SIZE")
