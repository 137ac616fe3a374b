"""Folders that a command may write to: its own, one process at a time, every file listed.

A folder is claimed, what was written is listed with its checksum, a lock says who is writing, and
there are places where nobody may.
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

from acx4lib import system
from acx4lib.errors import FlightError, OutputError
from acx4lib.opening import opened, text_of
from acx4lib.results.whole_files import SCRATCH, naming, write

# --- Where commands write: into folders of their own, marked as such, one command at a time
#
# A command writes only into a folder that is new, empty, or bears its own mark, and removes only
# what that mark lists. Whatever else lies there is the user's.


OF_A_FILE = b'"made_by": "acx4 '
"""Stands in a JSON file that a command wrote beside a folder, as the truth of a flight."""


@dataclass(kw_only=True)
class OwnFolder:
    """A folder that a command may write into, for as long as it is claimed.

    Attributes
    ----------
    path : Path
    command : str
        Whose it is, such as ``acx4 run``.
    files : dict of str to Written
        What the command wrote or is about to write, by names below the folder.
    """

    path: Path
    command: str
    files: dict[str, Written] = field(default_factory=dict)
    _sealed: dict[str, tuple[tuple[int, int, int], Written]] = field(default_factory=dict)

    def expect(self, names: Iterable[str]) -> None:
        """Say which files will be written; they are listed before they are there.

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
        """Note the checksums of all files that are there; those that are not stay expected."""
        self.files = {name: self._written(name) for name in self.files}
        _write_mark(self.path, self.command, self.files)

    def remove(self, names: Iterable[str]) -> None:
        """Remove files that the command wrote, and folders that are then empty."""
        for name in [name for name in names if name in self.files]:
            self._check_links(name)
            (self.path / name).unlink(missing_ok=True)
            _prune((self.path / name).parent, self.path)
            self.files[name] = Written()

    def _written(self, name: str) -> Written:
        """Return size and checksum of a file; it is read anew only where it was replaced since."""
        path = self.path / name
        if not path.is_file():
            return Written()
        status = path.stat()
        version = (status.st_ino, status.st_mtime_ns, status.st_size)
        before, found = self._sealed.get(name, ((0, 0, 0), Written()))
        if before != version:
            found = written(path)
            self._sealed[name] = version, found
        return found

    def _check_links(self, name: str) -> None:
        """Refuse to write through a link."""
        for part in (PurePosixPath(name), *PurePosixPath(name).parents):
            if str(part) != "." and (self.path / part).is_symlink():
                msg = f"{self.path / part}: is a link; {self.command} writes through none"
                raise OutputError(msg)

    def _end(self) -> None:
        """List what is there, and what was and is gone."""
        listed = self.files
        self.files = {n: w for n, w in listed.items() if w.sha256 or (self.path / n).is_file()}
        for name in listed.keys() - self.files.keys():  # what was to hold it may be there, empty
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
    """Claim a folder for a command; while it lasts no other command writes there.

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
    made = _made(path)
    try:
        with _locked(path):
            own = OwnFolder(path=path, command=command, files=_listed(path, command))
            _tidy(path)
            try:
                yield own
            except BaseException:
                with contextlib.suppress(OSError, OutputError):  # the first error is told
                    _tidy(path)
                    own._end()
                raise
            own._end()
    finally:
        _remove_empty(made)


@contextlib.contextmanager
def placed(folder: str | Path, *, command: str) -> Iterator[Path]:
    """Yield the name of a folder to be made elsewhere; it takes its place whole, marked, or never.

    Parameters
    ----------
    folder : path
        New or empty. What is made beside the other folder comes to stand beside this one.
    command : str
        Whose it is.
    """
    path = Path(folder).resolve()
    made = _made(path.parent)
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=SCRATCH) as temporary:
            draft = Path(temporary) / path.name
            with naming(path, draft.parent):
                yield draft
            mark_all(draft, command)
            beside = [other for other in draft.parent.iterdir() if other != draft]
            if path.exists():
                path.rmdir()
            for one in (*beside, draft):
                one.replace(path.with_name(one.name))
    finally:
        _remove_empty(made)


def verify(folder: Path, names: Iterable[str] | None = None, *, cure: str) -> None:
    """Check that the files of a folder are what its command wrote.

    Parameters
    ----------
    folder : Path
        Of one without a mark nothing is known.
    names : iterable of str, optional
        Look at these only.
    cure : str
        What to do otherwise.

    Raises
    ------
    FlightError
        A line for each file that was changed, cut or removed, or for who is writing there.
    """
    busy = _writer(folder)
    lines = [busy] if busy else [f"{line}; {cure}" for line in changes(folder, names)]
    if lines:
        raise FlightError(lines)


def clear(path: Path) -> None:
    """Remove what commands wrote: the files that a folder's mark lists, or a truth beside it.

    Raises
    ------
    OutputError
        Where it bears no mark, somebody is writing there, or a file was changed since.
    """
    if path.is_file() and not path.is_symlink() and _bears(path, OF_A_FILE):
        path.unlink()
        return
    whose, files = read_mark(path)
    if not whose:
        raise OutputError(f"{path}: bears no mark of acx4; remove it yourself if it is not needed")
    with _locked(path):
        changed = changes(path, [name for name in files if (path / name).exists()])
        if changed:
            raise OutputError(f"{changed[0]}; move it away, or remove it yourself")
        own = OwnFolder(path=path, command=whose, files=_listed(path, whose))
        own.remove(list(own.files))
        _tidy(path)
        (path / MARK).unlink()
    with contextlib.suppress(OSError):
        path.rmdir()


def _made(path: Path) -> list[Path]:
    """Make a folder with those above it; return the ones that were not there."""
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
    """Return what a command wrote into a folder before; nothing into an empty one."""
    others = [p.name for p in path.iterdir() if p.name != LOCK and not p.name.startswith(SCRATCH)]
    whose, files = read_mark(path)
    if others and not whose:
        shown = ", ".join(sorted(others)[:3]) + (", …" if len(others) > 3 else "")
        msg = f"{path}: holds what {command} did not write ({shown}); choose a new or empty folder"
        raise OutputError(msg)
    if whose and whose != command:
        raise OutputError(f"{path}: is a folder of {whose}; choose another for {command}")
    return files


def _tidy(path: Path) -> None:
    """Remove unfinished files that a killed command left behind."""
    for stale in path.glob(f"{SCRATCH}*"):
        if stale.is_dir() and not stale.is_symlink():
            shutil.rmtree(stale)
        else:
            stale.unlink()


def _prune(folder: Path, top: Path) -> None:
    """Remove a folder and those above it, below another one, as far as they are empty."""
    while folder != top:
        try:
            folder.rmdir()
        except FileNotFoundError:
            pass
        except OSError:
            return
        folder = folder.parent


def main(paths: Sequence[str]) -> int:
    """Clear folders for make, and say which were left; returns an exit status."""
    left = []
    for path in map(Path, paths):
        try:
            if path.exists():
                clear(path)
        except OutputError as error:
            left.append(str(error))
    sys.stderr.write("".join(f"{line}\n" for line in left))
    return 2 if left else 0


# --- The mark of a folder: which command filled it, and with which files
#
# Every file is listed with its size and checksum, so that what was changed or cut later can be
# named.


MARK = ".acx4.json"
"""The file of the mark."""

FORMAT = 1
"""Of the mark, and so of what commands leave in a folder."""


@dataclass(frozen=True, kw_only=True)
class Written:
    """A file that a command wrote.

    Attributes
    ----------
    size : int or None
        Bytes.
    sha256 : str or None
        None where it may change, or is not looked at.
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
    """Return whose a folder is, empty where nobody's, and what was written there.

    Raises
    ------
    OutputError
        Where the mark is damaged, or of another version.
    """
    path = folder / MARK
    if path.is_symlink() or not path.is_file():
        return "", {}
    try:
        said = json.loads(text_of(path))
        files = {str(name): _entry(entry) for name, entry in dict(said["files"]).items()}
        whose, form = said["made_by"], said.get("format")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        whose, form, files = None, None, {}
    if not isinstance(whose, str) or not all(map(is_below, files)):
        msg = f"{path}: is damaged; remove it to read what is there, or choose another folder"
        raise OutputError(msg)
    if form != FORMAT:
        msg = f"{path}: has format {form!r}, not {FORMAT}; it is of another version of acx4"
        raise OutputError(msg)
    return whose, files


def _write_mark(folder: Path, command: str, files: Mapping[str, Written]) -> None:
    """Mark a folder, whole or not at all."""
    listed = {
        name: {"bytes": files[name].size, "sha256": files[name].sha256} for name in sorted(files)
    }
    said = {"made_by": command, "format": FORMAT, "files": listed}
    text = json.dumps(said, indent=1, ensure_ascii=False) + "\n"
    write(folder / MARK, text.encode("utf-8", "surrogateescape"))


def mark_all(folder: Path, command: str) -> None:
    """Mark a folder all of whose files were written by one command."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    listed = {path.relative_to(folder).as_posix(): written(path) for path in paths}
    _write_mark(folder, command, {name: one for name, one in listed.items() if name != MARK})


def changes(folder: Path, names: Iterable[str] | None = None) -> list[str]:
    """Return what differs from what a command wrote into a folder, a line for each file.

    Parameters
    ----------
    folder : Path
        Where it bears no mark nothing is known, and nothing said.
    names : iterable of str, optional
        Look at these only.
    """
    whose, files = read_mark(folder)
    looked_at = files.keys() if names is None else [name for name in names if name in files]
    said = ((folder / name, _difference(folder / name, files[name])) for name in looked_at)
    return [f"{path}: {says.format(whose)}" for path, says in said if says]


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
"""How a file is opened that must be no link."""

LOCK = ".acx4.lock"
"""Says which process on which machine is writing into a folder; gone when it is done."""


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder."""
    path = folder / LOCK
    with contextlib.closing(_taken(path)) as file:
        said = json.dumps({"process": os.getpid(), "host": socket.gethostname()}).encode()
        try:
            with naming(path, size=len(said)):
                os.ftruncate(file.fileno(), 0)
                os.lseek(file.fileno(), 0, os.SEEK_SET)
                os.write(file.fileno(), said)
            yield
        finally:
            _remove(path, file)


def _remove(path: Path, file: TextIO) -> None:
    """Remove a lock's file, which some systems do only when it is closed."""
    try:
        path.unlink(missing_ok=True)
    except PermissionError:
        file.close()
        path.unlink(missing_ok=True)


def _writer(folder: Path) -> str:
    """Return who is writing into a folder, as a sentence; empty where nobody is."""
    path = folder / LOCK
    if path.is_symlink() or not path.is_file():
        return ""
    with io.TextIOWrapper(opened(path), "utf-8", "replace") as file:
        return _busy(file, path)


def _taken(path: Path) -> TextIO:
    """Return the open and locked file of a lock."""
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
    """Try to take a lock; return who has it, as a sentence, and empty where nobody has."""
    owner = _owner(file.read())
    who = f"process {owner[0]} on {owner[1]}" if owner else "another process"
    says = f"{path.parent}: {who} is writing there; wait for it, or choose another folder"
    try:
        system.lock(file)
    except BlockingIOError:
        return says
    except OSError:  # a file system without locks: what the file says has to do
        if owner and owner[1] == socket.gethostname() and system.is_alive(owner[0]):
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


# --- Where a command may write: into no flight, not among the project's files, through no link


SOURCES = (".ci", ".git", "book", "data", "notebooks", "src", "tests")
"""Folders of a working copy that are not to be written into."""

PACKAGES = ("acx4lib", "acx4tools", "acx4sim", "acx4book")
"""Folders of an installed library that are not to be written into."""

FREE = ("data/flights", "data/reference/files")
"""Folders below which make puts what it makes."""


def check_new(folder: str | Path) -> None:
    """Check that a folder may be made: it is not there or empty, and in nobody's way.

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
    """Check that a folder may be written at a place, whatever is in it.

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
    """Check that a single file may be written: it is new, or bears the mark of its command.

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
    says = ""
    if path.is_symlink():
        says = "is a link; name the file itself"
    elif path.is_dir():
        says = "is a folder, not a file"
    elif path.exists() and not (path.is_file() and _bears(path, mark)):
        says = f"is there and is not {what}; choose another name"
    elif flight is not None:
        says = f"lies in the flight {flight}; choose a place outside"
    if says:
        raise OutputError(f"{path}: {says}")


def working_copy() -> Path | None:
    """Return the top of the working copy that this module lies in; None where it is installed."""
    root = Path(__file__).resolve().parents[3]
    return root if (root / "pyproject.toml").is_file() else None


def _flight_around(whole: Path) -> Path | None:
    """Return the flight that a place is or lies in."""
    return next((p for p in (whole, *whole.parents) if (p / "flight.toml").is_file()), None)


def _source(whole: Path) -> Path | None:
    """Return the part of the working copy or of the installed library that a place lies in."""
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
