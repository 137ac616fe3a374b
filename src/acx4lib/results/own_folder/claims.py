"""Where commands write: into folders of their own, marked as such, one command at a time.

A command writes only into a folder that is new, empty, or bears its own mark, and removes only
what that mark lists. Whatever else lies there is the user's.
"""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from acx4lib.errors import FlightError, OutputError
from acx4lib.results.own_folder import marks
from acx4lib.results.own_folder.locks import LOCK, locked, writer
from acx4lib.results.own_folder.places import check_place
from acx4lib.results.own_folder.whole_files import SCRATCH, naming

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
    files: dict[str, marks.Written] = field(default_factory=dict)
    _sealed: dict[str, tuple[tuple[int, int, int], marks.Written]] = field(default_factory=dict)

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
            self.files.setdefault(name, marks.Written())
        marks.write_mark(self.path, self.command, self.files)

    def seal(self) -> None:
        """Note the checksums of all files that are there; those that are not stay expected."""
        self.files = {name: self._written(name) for name in self.files}
        marks.write_mark(self.path, self.command, self.files)

    def remove(self, names: Iterable[str]) -> None:
        """Remove files that the command wrote, and folders that are then empty."""
        for name in [name for name in names if name in self.files]:
            self._check_links(name)
            (self.path / name).unlink(missing_ok=True)
            _prune((self.path / name).parent, self.path)
            self.files[name] = marks.Written()

    def _written(self, name: str) -> marks.Written:
        """Return size and checksum of a file; it is read anew only where it was replaced since."""
        path = self.path / name
        if not path.is_file():
            return marks.Written()
        status = path.stat()
        version = (status.st_ino, status.st_mtime_ns, status.st_size)
        before, found = self._sealed.get(name, ((0, 0, 0), marks.Written()))
        if before != version:
            found = marks.written(path)
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
        listed = self.files.items()
        self.files = {n: w for n, w in listed if w.sha256 or (self.path / n).is_file()}
        if self.files:
            marks.write_mark(self.path, self.command, self.files)
        else:
            (self.path / marks.MARK).unlink(missing_ok=True)


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
        with locked(path):
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
            marks.mark_all(draft, command)
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
    busy = writer(folder)
    lines = [busy] if busy else [f"{line}; {cure}" for line in marks.changes(folder, names)]
    if lines:
        raise FlightError(lines)


def clear(path: Path) -> None:
    """Remove what commands wrote: the files that a folder's mark lists, or a truth beside it.

    Raises
    ------
    OutputError
        Where it bears no mark, somebody is writing there, or a file was changed since.
    """
    if path.is_file() and not path.is_symlink() and marks.bears(path, OF_A_FILE):
        path.unlink()
        return
    whose, files = marks.read_mark(path)
    if not whose:
        msg = f"{path}: bears no mark of acx4; remove it yourself if it is not needed"
        raise OutputError(msg)
    with locked(path):
        changed = marks.changes(path, [name for name in files if (path / name).exists()])
        if changed:
            msg = f"{changed[0]}; move it away, or remove it yourself"
            raise OutputError(msg)
        own = OwnFolder(path=path, command=whose, files=_listed(path, whose))
        own.remove(list(own.files))
        _tidy(path)
        (path / marks.MARK).unlink()
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


def _listed(path: Path, command: str) -> dict[str, marks.Written]:
    """Return what a command wrote into a folder before; nothing into an empty one."""
    others = [p.name for p in path.iterdir() if p.name != LOCK and not p.name.startswith(SCRATCH)]
    whose, files = marks.read_mark(path)
    if others and not whose:
        shown = ", ".join(sorted(others)[:3]) + (", …" if len(others) > 3 else "")
        msg = f"{path}: holds what {command} did not write ({shown}); choose a new or empty folder"
        raise OutputError(msg)
    if whose and whose != command:
        msg = f"{path}: is a folder of {whose}; choose another for {command}"
        raise OutputError(msg)
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


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
