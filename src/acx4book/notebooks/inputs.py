"""What the outcome of a notebook depends on, where it depends on no flight: a digest of it all."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

import nbformat

HOUSES = ("acx4lib", "acx4sim", "acx4book")
"""Packages whose modules are followed; all others have their version in environment.lock."""

SHOWS = "acx4book.typesetting.drawing.svg"
"""The module by which figures are shown, which no notebook imports."""


def digest(notebook: Path, sources: Path, data: Iterable[Path]) -> str:
    """Return the SHA-256 of a notebook, of all modules that it reaches, and of its data.

    Parameters
    ----------
    notebook : Path
    sources : Path
        Folder of the houses.
    data : iterable of Path
        Files; their contents and names count, and not where they lie.
    """
    total = hashlib.sha256()
    for path in (notebook, *sorted(modules(notebook, sources)), *sorted(data)):
        total.update(f"{path.name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()


def modules(notebook: Path, sources: Path) -> set[Path]:
    """Return the files of all modules of the houses that a notebook imports, and those they do.

    A package that is only on the way to a module is read; what it loads on demand is not followed.
    """
    read = nbformat.read(notebook, as_version=4)  # type: ignore[no-untyped-call] # untyped
    cells = [cell.source for cell in read.cells if cell.cell_type == "code"]
    waiting = [SHOWS, *_imported("\n".join(cells))]
    found: set[Path] = set()
    while waiting:
        name = waiting.pop()
        path = _file(name, sources)
        if path is None or path in found:
            continue
        found.add(path)
        above = name.split(".")[:-1]
        waiting += [".".join(above[:n]) for n in range(2, len(above) + 1)]
        if above:
            found.add(sources / above[0] / "__init__.py")
        waiting += _imported(path.read_text("utf-8"))
    return found


def _file(name: str, sources: Path) -> Path | None:
    """Return the file of a module, or None for a name that is none."""
    base = sources.joinpath(*name.split("."))
    return next((p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()), None)


def _imported(source: str) -> Iterator[str]:
    """Yield what may be names of modules of the houses in the imports of a source."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        yield from (name for name in names if name.partition(".")[0] in HOUSES)
