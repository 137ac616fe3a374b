"""The pages of the programming interface: one for each house, and one for each of its rooms."""

from __future__ import annotations

import pkgutil
import re
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path

from acx4lib.results import whole_files

FOLDER = "_generated/api"
"""Where the pages are in the book."""

CELLAR = "compiled"
"""Name of the folders that no page shows."""

EXCHANGE = ("outward", "pictures", "programs", "safe", "trajectories")
BY_MODULE = tuple(f"acx4tools.exchange.{part}." for part in EXCHANGE)
"""Where modules are listed with what they are for: their functions serve one kind of files, and no
user's program calls them."""


def write(book: Path) -> None:
    """Write the pages that the contents of the book list, in their order."""
    folder = book / FOLDER
    contents = (book / "_generated" / "_toc.yml").read_text("utf-8")
    listed = re.findall(rf"{FOLDER}/([\w/]+)", contents)
    for file in listed:
        path = folder / f"{file}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        rooms = [other.replace("/", ".") for other in listed if other.startswith(f"{file}/")]
        whole_files.write(path, "\n".join(page(file.replace("/", "."), rooms)))


def page(name: str, rooms: Sequence[str] = ()) -> Iterator[str]:
    """Yield the parts of a page in MyST.

    Parameters
    ----------
    name : str
        Of a house or a room.
    rooms : sequence of str
        Those of the house: they have pages of their own.
    """
    yield f"# {name.rpartition('.')[2]}\n"
    yield _directive("automodule", name, ":no-members:")
    inside = [other for other in contents(name) if other not in rooms]
    yield _summary(name, [*rooms, *inside])
    for other in inside:
        yield from _section(other, 2)


def contents(package: str) -> list[str]:
    """Return the modules and rooms in a package, in the order in which its docstring names them."""
    about = import_module(package)
    named = re.findall(r"`([\w.]+)`", about.__doc__ or "")
    found = [m.name for m in pkgutil.iter_modules(about.__path__)]
    shown = [name for name in found if name != CELLAR and not name.startswith("_")]
    shown.sort(key=lambda name: named.index(name) if name in named else len(named))
    return [f"{package}.{name}" for name in shown]


def _section(name: str, level: int) -> Iterator[str]:
    yield f"{'#' * level} {name.rpartition('.')[2]}\n"
    if not hasattr(import_module(name), "__path__"):
        yield _directive("automodule", name, *[":no-members:"] * name.startswith(BY_MODULE))
        return
    yield _directive("automodule", name, ":no-members:")
    yield _summary(name, contents(name))
    for other in contents(name):
        yield from _section(other, level + 1)


def _summary(package: str, names: Sequence[str]) -> str:
    """Return a table of what is in a package, with the first sentences of docstrings."""
    inside = (name.removeprefix(f"{package}.") for name in names)
    return _directive("autosummary", "", "", *inside)


def _directive(directive: str, argument: str, *lines: str) -> str:
    body = "".join(f"   {line}\n" for line in lines)
    return f"```{{eval-rst}}\n.. {directive}:: {argument}\n{body}```\n"
