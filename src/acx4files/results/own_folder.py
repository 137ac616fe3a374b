"""Folders owned by a command: one process writes at a time, and every file is listed.

A command claims a folder, lists the checksum of every written file, and holds a lock meanwhile. In
some places no command may write.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import shutil
import socket
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TextIO

from acx4files.opening import opened, text_of
from acx4files.results.whole_files import SCRATCH, naming, write
from acx4lib import system
from acx4lib.errors import FlightError, OutputError

# --- Where commands write: into folders of their own, marked as such, one command at a time
#
# A command writes only into a folder that is new, empty, or bears its own mark, and removes only
# what that mark lists. Whatever else lies there is the user's.


OF_A_FILE = b'"made_by": "acx4 '
"""Stands in a JSON file that a command wrote beside a folder, as the truth of a flight."""


@dataclass(kw_only=True)
class OwnFolder:
    """A folder that a command may write into while it is claimed.

    Attributes
    ----------
    path : Path
    command : str
        Owner of the folder, such as ``acx4 run``.
    files : dict of str to Written
        Files that the command wrote or will write, by their names below the folder.
    """

    path: Path
    command: str
    files: dict[str, Written] = field(default_factory=dict)
    _sealed: dict[str, tuple[tuple[int, int, int], Written]] = field(default_factory=dict)

    def expect(self, names: Iterable[str]) -> None:
        """List files that will be written, before they exist.

        Raises
        ------
        OutputError
            Where one of them is there and not the command's, or a link is in its way.
        """
        for name in sorted(set(names)):
            self._check_links(name)
            if name not in self.files and (self.path / name).exists():
                msg = f"{self.path / name}: was not written by {self.command}; move it away"
                raise OutputError(msg)
            self.files.setdefault(name, Written())
        _write_mark(self.path, self.command, self.files)

    def seal(self) -> None:
        """Record the checksums of all existing files; missing files stay expected."""
        self.files = {name: self._written(name) for name in self.files}
        _write_mark(self.path, self.command, self.files)

    def remove(self, names: Iterable[str]) -> None:
        """Remove files that the command wrote, and folders left empty."""
        for name in [name for name in names if name in self.files]:
            self._check_links(name)
            (self.path / name).unlink(missing_ok=True)
            _prune((self.path / name).parent, self.path)
            self.files[name] = Written()

    def _written(self, name: str) -> Written:
        """Return size and checksum of a file; a file not replaced since is not read again."""
        path = self.path / name
        if not path.is_file():
            return Written()
        status = path.stat()
        version = (status.st_ino, status.st_mtime_ns, status.st_size)
        before, entry = self._sealed.get(name, ((0, 0, 0), Written()))
        if before != version:
            entry = written(path)
            self._sealed[name] = version, entry
        return entry

    def _check_links(self, name: str) -> None:
        """Refuse to write through a link."""
        for part in (PurePosixPath(name), *PurePosixPath(name).parents):
            if str(part) != "." and (self.path / part).is_symlink():
                msg = f"{self.path / part}: is a link; {self.command} writes through none"
                raise OutputError(msg)

    def _end(self) -> None:
        """List existing files, and sealed files that are gone; forget all others."""
        listed = self.files
        self.files = {n: w for n, w in listed.items() if w.sha256 or (self.path / n).is_file()}
        for name in listed.keys() - self.files.keys():  # its folder may be there, empty
            with contextlib.suppress(OutputError):  # through a link nothing is removed
                self._check_links(name)
                _prune((self.path / name).parent, self.path)
        if self.files:
            _write_mark(self.path, self.command, self.files)
        else:
            (self.path / MARK).unlink(missing_ok=True)


@contextlib.contextmanager
def claim(
    folder: str | Path,
    *,
    command: str,
    away_from: Sequence[Path] = (),
    becomes_flight: bool = False,
) -> Iterator[OwnFolder]:
    """Claim a folder for a command; no other command can write there meanwhile.

    Parameters
    ----------
    folder : path
        New, empty, or with the mark of the same command. A new one that stays empty is removed.
    command : str
    away_from : sequence of Path
        Flights; the folder must not lie in, above or at one.
    becomes_flight : bool
        Whether the command writes a flight, so that the folder may be one with its mark.

    Raises
    ------
    OutputError
        Where the command must not write there, or another process is writing.
    OSError
        Where the folder cannot be made.
    """
    path = Path(folder)
    check_place(path, away_from=away_from, becomes_flight=becomes_flight)
    new_folders = _made(path)
    try:
        with _locked(path):
            claimed = OwnFolder(path=path, command=command, files=_listed(path, command))
            _tidy(path)
            try:
                yield claimed
            except BaseException:
                with contextlib.suppress(OSError, OutputError):  # the first error is reported
                    _tidy(path)
                    claimed._end()
                raise
            claimed._end()
    finally:
        _remove_empty(new_folders)


@contextlib.contextmanager
def placed(folder: str | Path, *, command: str) -> Iterator[Path]:
    """Yield a temporary path for a new folder, which takes its place complete and marked, or never.

    Parameters
    ----------
    folder : path
        New or empty. Files made beside the temporary folder are moved beside this one.
    command : str
        Owner of the folder.
    """
    path = Path(folder).resolve()
    new_folders = _made(path.parent)
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=SCRATCH) as temporary:
            draft = Path(temporary) / path.name
            with naming(path, draft.parent):
                yield draft
            mark_all(draft, command)
            beside = [other for other in draft.parent.iterdir() if other != draft]
            if path.exists():
                path.rmdir()
            for child in (*beside, draft):
                child.replace(path.with_name(child.name))
    finally:
        _remove_empty(new_folders)


def verify(folder: Path, names: Iterable[str] | None = None, *, cure: str) -> None:
    """Check that the files of a folder are as its command wrote them.

    Parameters
    ----------
    folder : Path
        Without a mark it is not checked.
    names : iterable of str, optional
        Check these only.
    cure : str
        Cure for the messages.

    Raises
    ------
    FlightError
        A line for each file that was changed, cut or removed, or for the process writing there.
    """
    busy = _writer(folder)
    lines = [busy] if busy else [f"{line}; {cure}" for line in changes(folder, names)]
    if lines:
        raise FlightError(lines)


def clear(path: Path) -> None:
    """Remove the files listed in a folder's mark and then the folder, or one marked file.

    Raises
    ------
    OutputError
        Where it bears no mark, somebody is writing there, or a file was changed since.
    """
    if path.is_file() and not path.is_symlink() and _bears(path, OF_A_FILE):
        path.unlink()
        return
    owner, files = read_mark(path)
    if not owner:
        raise OutputError(f"{path}: bears no mark of acx4; remove it yourself if it is not needed")
    with _locked(path):
        changed = changes(path, [name for name in files if (path / name).exists()])
        if changed:
            raise OutputError(f"{changed[0]}; move it away, or remove it yourself")
        claimed = OwnFolder(path=path, command=owner, files=_listed(path, owner))
        claimed.remove(list(claimed.files))
        _tidy(path)
        (path / MARK).unlink()
    with contextlib.suppress(OSError):
        path.rmdir()


def _made(path: Path) -> list[Path]:
    """Make a folder and its parents; return the new ones."""
    missing: list[Path] = []
    for folder in (path, *path.parents):
        if folder.exists():
            break
        missing.insert(0, folder)
    path.mkdir(parents=True, exist_ok=True)
    return missing


def _remove_empty(folders: Sequence[Path]) -> None:
    for folder in reversed(folders):
        with contextlib.suppress(OSError):
            folder.rmdir()


def _listed(path: Path, command: str) -> dict[str, Written]:
    """Return the files that a command wrote into a folder before; OutputError if not its own."""
    others = [p.name for p in path.iterdir() if p.name != LOCK and not p.name.startswith(SCRATCH)]
    owner, files = read_mark(path)
    if others and not owner:
        shown = ", ".join(sorted(others)[:3]) + (", …" if len(others) > 3 else "")
        msg = f"{path}: holds what {command} did not write ({shown}); choose a new or empty folder"
        raise OutputError(msg)
    if owner and owner != command:
        raise OutputError(f"{path}: is a folder of {owner}; choose another for {command}")
    return files


def _tidy(path: Path) -> None:
    """Remove unfinished files that a killed command left behind."""
    for stale in path.glob(f"{SCRATCH}*"):
        if stale.is_dir() and not stale.is_symlink():
            shutil.rmtree(stale)
        else:
            stale.unlink()


def _prune(folder: Path, top: Path) -> None:
    """Remove a folder and its parents below `top`, as far as they are empty."""
    while folder != top:
        try:
            folder.rmdir()
        except FileNotFoundError:
            pass
        except OSError:
            return
        folder = folder.parent


def main(paths: Sequence[str]) -> int:
    """Clear folders for make, report the folders not cleared, and return an exit status."""
    messages = []
    for path in map(Path, paths):
        try:
            if path.exists():
                clear(path)
        except OutputError as error:
            messages.append(str(error))
    sys.stderr.write("".join(f"{line}\n" for line in messages))
    return 2 if messages else 0


# --- The mark of a folder: which command filled it, and with which files
#
# Every file is listed with its size and checksum, so that a file changed or cut later can be named.


MARK = ".acx4.json"
"""The file of the mark."""

FORMAT = 1
"""Version of the mark, and so of the files that commands leave in a folder."""


@dataclass(frozen=True, kw_only=True)
class Written:
    """A file that a command wrote.

    Attributes
    ----------
    size : int or None
        Bytes.
    sha256 : str or None
        None for a file that may change or is not checked.
    """

    size: int | None = None
    sha256: str | None = None


def written(path: Path) -> Written:
    """Return size and checksum of a file."""
    with opened(path) as file:
        try:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:  # of a damaged disk; the system does not name the file
            raise OSError(error.errno, error.strerror, str(path)) from None
        return Written(size=os.fstat(file.fileno()).st_size, sha256=sha256)


def read_mark(folder: Path) -> tuple[str, dict[str, Written]]:
    """Return the owner of a folder and its listed files; both empty without a mark.

    Raises
    ------
    OutputError
        Where the mark is damaged, or of another version.
    """
    path = folder / MARK
    if path.is_symlink() or not path.is_file():
        return "", {}
    try:
        mark = json.loads(text_of(path))
        files = {str(name): _entry(entry) for name, entry in dict(mark["files"]).items()}
        owner, mark_format = mark["made_by"], mark.get("format")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        owner, mark_format, files = None, None, {}
    if not isinstance(owner, str) or not all(map(is_below, files)):
        msg = f"{path}: is damaged; remove it to read what is there, or choose another folder"
        raise OutputError(msg)
    if mark_format != FORMAT:
        msg = f"{path}: has format {mark_format!r}, not {FORMAT}; it is of another version of acx4"
        raise OutputError(msg)
    return owner, files


def _write_mark(folder: Path, command: str, files: Mapping[str, Written]) -> None:
    """Write the mark of a folder, whole or not at all."""
    listed = {
        name: {"bytes": files[name].size, "sha256": files[name].sha256} for name in sorted(files)
    }
    mark = {"made_by": command, "format": FORMAT, "files": listed}
    text = json.dumps(mark, indent=1, ensure_ascii=False) + "\n"
    write(folder / MARK, text.encode("utf-8", "surrogateescape"))


def mark_all(folder: Path, command: str) -> None:
    """Mark a folder whose files were all written by a single command."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    listed = {path.relative_to(folder).as_posix(): written(path) for path in paths}
    _write_mark(folder, command, {name: entry for name, entry in listed.items() if name != MARK})


def changes(folder: Path, names: Iterable[str] | None = None) -> list[str]:
    """Return a line for each file that was changed since its command wrote it.

    Parameters
    ----------
    folder : Path
        Without a mark there are no lines.
    names : iterable of str, optional
        Check these only.
    """
    owner, files = read_mark(folder)
    checked = files.keys() if names is None else [name for name in names if name in files]
    differences = ((folder / name, _difference(folder / name, files[name])) for name in checked)
    return [f"{path}: {difference.format(owner)}" for path, difference in differences if difference]


def _bears(path: Path, mark: bytes) -> bool:
    """Tell whether a mark stands in the first 4096 bytes of a file."""
    with opened(path) as file:
        return mark in file.read(4096)


def _difference(path: Path, before: Written) -> str:
    if before.sha256 is None:
        return ""
    if not path.is_file():
        return "is gone since {} wrote it"
    now = written(path)
    if now.sha256 == before.sha256:
        return ""
    if before.size is not None and now.size is not None and now.size < before.size:
        return f"was cut or changed since {{}} wrote it, {now.size} of {before.size} bytes"
    return "was changed since {} wrote it"


def _entry(entry: Mapping[str, object]) -> Written:
    size, sha256 = entry["bytes"], entry["sha256"]
    if not isinstance(size, int | None) or not isinstance(sha256, str | None):
        raise TypeError
    return Written(size=size, sha256=sha256)


def is_below(name: str) -> bool:
    """Tell whether the name of a file stays inside its folder."""
    parts = PurePosixPath(name).parts
    return bool(parts) and not name.startswith("/") and ".." not in parts and "\0" not in name


# --- The lock of a folder: one command at a time writes there


_UNLINKED = system.flags("O_NOFOLLOW", "O_CLOEXEC")
"""Flags to open a file that must not be a link."""

LOCK = ".acx4.lock"
"""Names the process and the machine writing into a folder; removed at the end."""


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder."""
    path = folder / LOCK
    with contextlib.closing(_taken(path)) as file:
        owner = json.dumps({"process": os.getpid(), "host": socket.gethostname()}).encode()
        try:
            with naming(path, size=len(owner)):
                os.ftruncate(file.fileno(), 0)
                os.lseek(file.fileno(), 0, os.SEEK_SET)
                os.write(file.fileno(), owner)
            yield
        finally:
            _remove(path, file)


def _remove(path: Path, file: TextIO) -> None:
    """Remove a lock's file; some systems require it to be closed first."""
    try:
        path.unlink(missing_ok=True)
    except PermissionError:
        file.close()
        path.unlink(missing_ok=True)


def _writer(folder: Path) -> str:
    """Return the message on the process writing into a folder; empty without any."""
    path = folder / LOCK
    if path.is_symlink() or not path.is_file():
        return ""
    with io.TextIOWrapper(opened(path), "utf-8", "replace") as file:
        return _busy(file, path)


def _taken(path: Path) -> TextIO:
    """Open and lock the file of a lock; OutputError if another process holds it."""
    while True:
        number = os.open(path, os.O_RDWR | os.O_CREAT | _UNLINKED, 0o644)
        if not stat.S_ISREG(os.fstat(number).st_mode):
            os.close(number)
            raise OutputError(f"{path}: is no regular file; remove it, or choose another folder")
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
    """Try to take a lock; return the message on its holder, empty on success."""
    owner = _owner(file.read())
    holder = f"process {owner[0]} on {owner[1]}" if owner else "another process"
    message = f"{path.parent}: {holder} is writing there; wait for it, or choose another folder"
    try:
        system.lock(file)
    except BlockingIOError:
        return message
    except OSError:  # a file system without locks: the content of the file decides
        if owner and owner[1] == socket.gethostname() and system.is_alive(owner[0]):
            return message
    if owner and owner[1] != socket.gethostname():
        return f"{message}; if it is gone, remove {path}"
    return ""


def _owner(text: str) -> tuple[int, str] | None:
    try:
        owner = json.loads(text)
        return int(owner["process"]), str(owner["host"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return None


# --- Where a command may write: into no flight, not among the project's files, through no link


SOURCES = (".ci", ".git", "book", "data", "notebooks", "src", "tests")
"""Folders of a working copy that are not to be written into."""

PACKAGES = ("acx4", "acx4lib", "acx4files", "acx4sim", "acx4book")
"""Folders of an installed library that are not to be written into."""

FREE = ("data/flights", "data/reference/files")
"""Folders for the output of make."""


def check_new(folder: str | Path) -> None:
    """Check that a new folder may be made: its path is free or empty, and allowed.

    Raises
    ------
    OutputError
    """
    path = Path(folder)
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise OutputError(f"{path}: exists already; choose another name")
    check_place(path)


def check_place(
    path: Path, *, away_from: Sequence[Path] = (), becomes_flight: bool = False
) -> None:
    """Check that a folder may be written at a path, whatever its content.

    Parameters
    ----------
    path : Path
    away_from : sequence of Path
        Flights, which must not lie in it.
    becomes_flight : bool
        Whether it may itself be a flight.

    Raises
    ------
    OutputError
        Where it is a link or no folder, in the way of a flight, or among the project's sources.
    """
    if path.is_symlink():
        raise OutputError(f"{path}: is a link; name the folder itself")
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path}: is no folder; choose another name")
    whole = path.resolve()
    flight = _flight_around(whole.parent if becomes_flight else whole)
    if flight is not None:
        raise OutputError(f"{path}: lies in the flight {flight}; choose a folder outside")
    for flight in away_from:
        if flight.resolve().is_relative_to(whole):
            raise OutputError(f"{path}: holds the flight {flight}; choose a folder beside it")
    source = _source(whole)
    if source is not None:
        msg = f"{path}: is among the project's own files, {source}; choose a folder outside"
        raise OutputError(msg)


def check_file(file: str | Path, *, mark: bytes, what: str) -> None:
    """Check that a single file may be written: it is new, or marked by its command.

    Parameters
    ----------
    file : path
    mark : bytes
        Stands in the first 4096 bytes of every such file.
    what : str
        What the file is, such as "a report of acx4".

    Raises
    ------
    OutputError
    """
    path = Path(file)
    flight = _flight_around(path.resolve())
    fault = ""
    if path.is_symlink():
        fault = "is a link; name the file itself"
    elif path.is_dir():
        fault = "is a folder, not a file"
    elif path.exists() and not (path.is_file() and _bears(path, mark)):
        fault = f"is there and is not {what}; choose another name"
    elif flight is not None:
        fault = f"lies in the flight {flight}; choose a place outside"
    if fault:
        raise OutputError(f"{path}: {fault}")


def working_copy() -> Path | None:
    """Return the root of the working copy with this module; None if it is installed."""
    root = Path(__file__).resolve().parents[3]
    return root if (root / "pyproject.toml").is_file() else None


def _flight_around(whole: Path) -> Path | None:
    """Return the folder of the flight at or above a path; None outside of flights."""
    return next((p for p in (whole, *whole.parents) if (p / "flight.toml").is_file()), None)


def _source(whole: Path) -> Path | None:
    """Return the part of the working copy or the installed library around a path, or None."""
    root = working_copy()
    if root is None:
        installed = [Path(__file__).resolve().parents[2] / name for name in PACKAGES]
        return next((package for package in installed if whole.is_relative_to(package)), None)
    if root.is_relative_to(whole):
        return root
    if any(whole.is_relative_to(root / name) and whole != root / name for name in FREE):
        return None
    return next((root / n for n in SOURCES if whole.is_relative_to(root / n)), None)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
