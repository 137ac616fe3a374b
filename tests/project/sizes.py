"""Files, lines and public names of each house, beside those of the last release.

`make check` prints them: a house that grows must say why. Run by `python -m project.sizes`.
"""

from __future__ import annotations

import ast
import io
import subprocess
import sys
import tarfile
from collections.abc import Mapping

from support.helpers import ROOT

HOUSES = ("src/acx4lib", "src/acx4tools", "src/acx4sim", "src/acx4book", "tests")

NAMED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def sizes(sources: Mapping[str, str]) -> dict[str, tuple[int, int, int]]:
    """Return files, lines and public names by house, from the text of every module."""
    made = {}
    for house in HOUSES:
        texts = [text for path, text in sources.items() if path.startswith(f"{house}/")]
        lines = sum(len(text.splitlines()) for text in texts)
        made[house] = (len(texts), lines, sum(map(public_names, texts)))
    return made


def public_names(text: str) -> int:
    """Count functions and classes at the top of a module whose names have no underscore before."""
    top = ast.parse(text).body
    return sum(isinstance(one, NAMED) and not one.name.startswith("_") for one in top)


def here() -> dict[str, str]:
    """Return the modules of the working copy."""
    paths = [path for house in HOUSES for path in (ROOT / house).rglob("*.py")]
    return {path.relative_to(ROOT).as_posix(): path.read_text("utf-8") for path in paths}


def released() -> tuple[str, dict[str, str]]:
    """Return the name of the last release, empty where there is none, and its modules."""
    name = _git("describe", "--tags", "--abbrev=0").decode().strip()
    if not name:
        return "", {}
    with tarfile.open(fileobj=io.BytesIO(_git("archive", name, *HOUSES))) as archive:
        members = [one for one in archive.getmembers() if one.name.endswith(".py")]
        opened = {one.name: archive.extractfile(one) for one in members}
        return name, {path: file.read().decode() for path, file in opened.items() if file}


def _git(*arguments: str) -> bytes:
    done = subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, check=False)
    return done.stdout


def main() -> None:
    """Print a line for each house."""
    name, modules = released()
    before, now = sizes(modules), sizes(here())
    for house in HOUSES:
        counts = "  ".join(
            f"{n:6d} {what}" + (f" ({n - before[house][k]:+d})" if name else "")
            for k, (n, what) in enumerate(zip(now[house], ("files", "lines", "names"), strict=True))
        )
        sys.stdout.write(f"{house:14s}{counts}\n")
    sys.stdout.write(f"since {name}\n" if name else "")


if __name__ == "__main__":
    main()
