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
from io import BytesIO
from pathlib import Path

from acx4book.pages.back import citation
from acx4lib.errors import Acx4Error
from acx4lib.flight.checks import settings
from acx4lib.results.own_folder import marks, whole_files


class ReleaseError(Acx4Error):
    """Something is missing for a release."""


def git(*arguments: str) -> bytes:
    """Return what git says in the current folder.

    Raises
    ------
    ReleaseError
        If it fails.
    """
    done = subprocess.run(["git", *arguments], capture_output=True, check=False)
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


def pack(content: Path, archive: Path, seconds: int, *, files: str = "*") -> None:
    """Pack a folder into an archive that has one folder, of the archive's name.

    Parameters
    ----------
    content : Path
        The folder.
    archive : Path
        The ZIP file to write.
    seconds : int
        The date of its files, since 1970.
    files : str
        Pattern of the names of those that are packed.
    """
    date = time.gmtime(seconds)[:6]
    with (
        whole_files.opened_new(archive) as new,
        zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as packed,
    ):
        for path in sorted(path for path in content.rglob(files) if path.is_file()):
            name = Path(archive.stem, path.relative_to(content)).as_posix()
            entry = zipfile.ZipInfo(name, date)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            packed.writestr(entry, path.read_bytes(), compresslevel=9)


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
