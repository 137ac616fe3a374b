"""What a book was made from: sources, machine, packages and files, as a page of the book."""

from __future__ import annotations

import hashlib
import platform
import re
import subprocess
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path

from acx4book.typesetting.plain_text import code
from acx4lib.results.provenance import KEPT


def commit() -> str:
    """Name the commit of the working copy in the current folder, and count its files that differ.

    Files that are new do not count: a flight or its results beside the sources change none of them.
    """

    def git(*arguments: str) -> str:
        command = ["git", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = len(git("status", "--porcelain", "--untracked-files=no").splitlines())
        return git("rev-parse", "HEAD") + (f", {changed} files differ" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "not a clone of the repository"


def short(commit: str) -> str:
    """Return what `commit` names with ten characters of the hash."""
    name, _, changed = commit.partition(",")
    return f"{name[:10]}{' with changes' if changed else ''}" if " " not in name else name


def table(name: str, caption: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Compose a numbered table in MyST."""
    lines = [header, ["---"] * len(header), *rows]
    body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"```{{table}} {caption}\n:name: {name}\n\n{body}\n```\n"


def packages() -> list[tuple[str, str]]:
    """List the packages that environment.txt names, with the versions installed."""
    text = Path("environment.txt").read_text(encoding="utf-8")
    names = re.findall(r"^([\w.-]+)==", text, flags=re.MULTILINE)
    return [(name, version(name)) for name in names]


def files(name: str, folder: Path) -> list[tuple[str, str, str]]:
    """List the data files under a folder with size and SHA-256."""
    names = (path.relative_to(folder) for path in folder.rglob("*"))
    kept = (name for name in names if name.parts[0] != KEPT)  # results keep the flight's tables
    paths = [folder / name for name in sorted(kept) if name.suffix in {".csv", ".toml", ".json"}]
    return [
        (
            code(f"{name}/{path.relative_to(folder).as_posix()}"),
            f"{path.stat().st_size:,}",
            f"`{hashlib.sha256(path.read_bytes()).hexdigest()}`",
        )
        for path in paths
    ]


def page(flight: Path, results: Path) -> str:
    """Return the statement as MyST text; the current folder is the working copy."""
    sources = [
        ("acx4lib", version("acx4lib")),
        ("commit", f"`{commit()}`"),
        ("Python", platform.python_version()),
        ("system", f"{platform.system()}, {platform.machine()}"),
    ]
    environment, of_files = "The packages that environment.txt names.", ("file", "bytes", "SHA-256")
    parts = [
        table("tab-sources", "The sources and the machine.", ("what", "value"), sources),
        table("tab-packages", environment, ("package", "version"), packages()),
        table("tab-flight-files", "The flight that was read.", of_files, files("flight", flight)),
        table("tab-result-files", "The results that it gave.", of_files, files("results", results)),
    ]
    return "\n".join(parts)
