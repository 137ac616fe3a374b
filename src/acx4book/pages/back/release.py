"""What is given away: ``python -m acx4book.pages.back.release HTML FOLDER``.

The wheel is built from the last commit, and the book is packed as it was built. The same commit and
the same book give the same bytes: all dates are those of the commit.
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from acx4book.pages.back import citation
from acx4lib.errors import Acx4Error
from acx4lib.flight.checks import settings
from acx4lib.results.own_folder import marks, whole_files

LIST = Path("FILES.txt")
"""What an archive of the project names its files in; a clone has none."""

FILE, LINK = 0o100644, 0o120777
"""Modes of what is packed."""


class ReleaseError(Acx4Error):
    """Something is missing for a release."""


def git(*arguments: str) -> bytes:
    """Return what git says in the current folder.

    Raises
    ------
    ReleaseError
        If it fails.
    """
    try:
        done = subprocess.run(["git", *arguments], capture_output=True, check=False)
    except OSError as error:
        msg = f"git: {error.strerror}"
        raise ReleaseError(msg) from None
    if done.returncode:
        msg = f"git {arguments[0]}: {done.stderr.decode().strip()}"
        raise ReleaseError(msg)
    return done.stdout


def problems(changelog: str, version: str) -> list[str]:
    """Return what the changelog does not say of a version, a sentence each.

    Parameters
    ----------
    changelog : str
        Text of CHANGELOG.md.
    version : str
        The version to be released.
    """
    _, _, newest = changelog.partition("\n## ")
    heading, _, said = newest.partition("\n")
    said = said.partition("\n## ")[0]
    found = []
    if heading.partition(",")[0] != version:
        found.append(f"CHANGELOG.md begins with {heading!r}; the version is {version}")
    elif "unreleased" in heading:
        found.append(f"CHANGELOG.md calls {version} unreleased: write the date of the release")
    for what, number in (("flights", settings.FORMAT), ("results", marks.FORMAT)):
        if not re.search(rf"[Ff]ormat\s+of\s+{what}\s+is\s+{number}\b", said):
            found.append(
                f'CHANGELOG.md does not say "The format of {what} is {number}" and what older '
                "ones are still read"
            )
    return found


def wheel(folder: Path, seconds: int) -> None:
    """Build the wheel of the last commit.

    Parameters
    ----------
    folder : Path
        Where it goes.
    seconds : int
        The date of its files, since 1970.

    Raises
    ------
    ReleaseError
        If pip fails.
    """
    with tempfile.TemporaryDirectory() as scratch:
        with tarfile.open(fileobj=BytesIO(git("archive", "HEAD"))) as sources:
            sources.extractall(scratch, filter="data")
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
        done = subprocess.run(
            [*command, "--no-build-isolation", "--wheel-dir", folder, scratch],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "SOURCE_DATE_EPOCH": str(seconds)},
        )
    if done.returncode:
        raise ReleaseError(done.stderr.strip())


def pack(content: Path, archive: Path, seconds: int) -> None:
    """Pack a folder into an archive that has one folder, of the archive's name.

    Parameters
    ----------
    content : Path
        The folder.
    archive : Path
        The ZIP file to write.
    seconds : int
        The date of its files, since 1970.
    """
    with _packed(archive, seconds) as add:
        for path in sorted(path for path in content.rglob("*") if path.is_file()):
            add(path.relative_to(content).as_posix(), path.read_bytes(), FILE)


def project(archive: Path, seconds: int) -> None:
    """Pack what belongs to the working copy in the current folder: what can be built again.

    These are the files that git tracks, as they are; in an unpacked archive those that its list
    names, so that it can be packed again.

    Parameters
    ----------
    archive : Path
        The ZIP file to write.
    seconds : int
        The date of its files, since 1970.

    Raises
    ------
    ReleaseError
        Where the folder is neither a clone nor an unpacked archive.
    """
    names = _listed()
    with _packed(archive, seconds) as add:
        for path in sorted(Path(name) for name in names if os.path.lexists(name)):
            if path.is_symlink():
                add(path.as_posix(), os.fsencode(path.readlink()), LINK)
            else:
                add(path.as_posix(), path.read_bytes(), FILE | path.stat().st_mode & 0o111)
        add(LIST.as_posix(), "\n".join([*names, ""]).encode(), FILE)


def offered(generated: Path, seconds: int) -> str:
    """Pack the project for readers of the book, and return what leads to it as MyST text."""
    archive = generated / "acx4lib.zip"
    try:
        project(archive, seconds)
    except ReleaseError:
        return "This copy of the book was not made from a clone, and has no program to download.\n"
    size = f"{archive.stat().st_size / 1e6:.0f} MB"
    return f"{{download}}`acx4lib.zip <acx4lib.zip>` ({size}) is the whole project of this book.\n"


def _listed() -> list[str]:
    """Name the files of the working copy."""
    if LIST.is_file():
        return LIST.read_text("utf-8").splitlines()
    return sorted(git("ls-files", "-z").decode().split("\0")[:-1])


@contextmanager
def _packed(archive: Path, seconds: int) -> Iterator[Callable[[str, bytes, int], None]]:
    """Open a new archive, and give what adds a file to its folder by name, content and mode."""
    date = time.gmtime(seconds)[:6]

    def add(name: str, content: bytes, mode: int) -> None:
        entry = zipfile.ZipInfo(f"{archive.stem}/{name}", date)
        entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, mode << 16
        packed.writestr(entry, content, compresslevel=9)

    with (
        whole_files.opened_new(archive) as new,
        zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as packed,
    ):
        yield add


def make(html: Path, folder: Path) -> list[str]:
    """Make a release of the working copy in the current folder, and return what there is to say.

    Parameters
    ----------
    html : Path
        The built book.
    folder : Path
        Where the files go.

    Raises
    ------
    ReleaseError
        Where files differ from the last commit, or the wheel cannot be built.
    """
    if changed := git("status", "--porcelain").decode().splitlines():
        msg = f"{len(changed)} files differ from the last commit; commit them, and release then"
        raise ReleaseError(msg)
    version = citation.footer(Path("CITATION.cff"))["version"]
    seconds = int(git("log", "-1", "--format=%ct"))
    folder.mkdir(parents=True, exist_ok=True)
    for old in [*folder.glob("acx4lib-*.whl"), *folder.glob("acx4lib-book-*.zip")]:
        old.unlink()
    wheel(folder, seconds)
    pack(html, folder / f"acx4lib-book-{version}.zip", seconds)
    sums = (f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p}" for p in sorted(folder.iterdir()))
    said = problems(Path("CHANGELOG.md").read_text(encoding="utf-8"), version)
    return [f"acx4lib {version}, commit {git('rev-parse', 'HEAD').decode().strip()}", *sums, *said]


if __name__ == "__main__":
    try:
        lines = make(*map(Path, sys.argv[1:3]))
    except ReleaseError as error:
        sys.exit(str(error))
    sys.stdout.write("\n".join([*lines, ""]))
