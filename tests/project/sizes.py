"""How large each package is, beside the largest it may be and the size that is aimed at.

`make check` runs `python -m project.sizes`, which prints the numbers and fails where one is above
its ratchet. A package may only shrink: whoever lowers a number lowers its ratchet with it, and
raising a ratchet is a change that somebody has to defend.

Code is counted by the syntax tree, without docstrings, comments and blank lines, so that no
docstring is paid for with code.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import click
import typer

from acx4book.command import acx4
from support.helpers import ROOT

PACKAGES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "src").glob("acx4*/"))

WHAT = ("code", "lines", "names")

PAGES = ("book/_ext", "book/_moving", "book/_static")

RATCHET = {
    "src code": 49_016,
    "src names": 1_981,
    "src/acx4 code": 32,
    "src/acx4book code": 20_711,
    "src/acx4book names": 719,
    "src/acx4files code": 13_485,
    "src/acx4files names": 485,
    "src/acx4lib code": 12_203,
    "src/acx4lib names": 693,
    "src/acx4sim code": 2_585,
    "src/acx4sim names": 84,
    "tests lines": 50_623,
    "commands": 26,
    "options": 129,
    "pages lines": 1_846,
}
"""The largest that each number may be; a package that has none may have no code."""

CEILING = {
    "src/acx4lib code": 11_000,
    "src/acx4files code": 11_000,
    "src/acx4sim code": 2_400,
    "src/acx4book code": 13_600,
    "src code": 38_000,
    "src lines": 60_000,
    "src names": 1_300,
    "tests lines": 40_000,
    "commands": 26,
    "options": 130,
    "pages lines": 900,
}
"""What is aimed at."""

FUNCTION = (ast.FunctionDef, ast.AsyncFunctionDef)


def code_lines(text: str, tree: ast.Module) -> int:
    """Count the lines of a module that are neither docstring nor comment nor blank."""
    strings = (node for node in ast.walk(tree) if _is_docstring(node))
    said = {i for node in strings for i in range(node.lineno, node.end_lineno + 1)}
    lines = enumerate(map(str.strip, text.splitlines()), start=1)
    return sum(bool(line) and not line.startswith("#") and i not in said for i, line in lines)


def _is_docstring(node: ast.AST) -> bool:
    """Tell whether a node is a string alone, as below a function's head or an attribute."""
    alone = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return alone and isinstance(node.value.value, str)


def public_names(tree: ast.Module) -> int:
    """Count public functions of a module, and public methods of its public classes."""
    top = tree.body
    classes = [one for one in top if isinstance(one, ast.ClassDef) and _is_public(one)]
    places = [top, *(one.body for one in classes)]
    return sum(isinstance(one, FUNCTION) and _is_public(one) for body in places for one in body)


def _is_public(node: ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    return not node.name.startswith("_")


def of_package(folder: Path) -> dict[str, int]:
    """Return code, lines and public names of the modules below a folder."""
    texts = [path.read_text("utf-8") for path in folder.rglob("*.py")]
    trees = [ast.parse(text) for text in texts]
    return {
        "code": sum(map(code_lines, texts, trees)),
        "lines": sum(len(text.splitlines()) for text in texts),
        "names": sum(map(public_names, trees)),
    }


def of_command(command: click.Command) -> tuple[int, int]:
    """Count the commands below a command that do something, and their options."""
    below = getattr(command, "commands", {})
    found = [of_command(one) for one in below.values()]
    options = sum(one.param_type_name == "option" for one in command.params)
    return sum(n for n, _ in found) + (not below), sum(n for _, n in found) + options


def measured() -> dict[str, int]:
    """Return all numbers of the working copy, by what they count."""
    sizes = {name: of_package(ROOT / name) for name in PACKAGES}
    sizes["src"] = {what: sum(of[what] for of in sizes.values()) for what in WHAT}
    numbers = {f"{name} {what}": n for name, of in sizes.items() for what, n in of.items()}
    numbers["tests lines"] = _lines((ROOT / "tests").rglob("*.py"))
    numbers["commands"], numbers["options"] = of_command(typer.main.get_command(acx4.app))
    pages = (path for name in PAGES for path in (ROOT / name).iterdir() if path.is_file())
    return numbers | {"pages lines": _lines(pages)}


def _lines(paths: Iterable[Path]) -> int:
    return sum(len(path.read_text("utf-8").splitlines()) for path in paths)


def above(numbers: Mapping[str, int], ratchet: Mapping[str, int]) -> list[str]:
    """Return the names of the numbers above their ratchets; lines of src have none."""
    return [
        name
        for name, n in numbers.items()
        if name in ratchet or " lines" not in name
        if n > ratchet.get(name, 0)
    ]


def main() -> None:
    """Print every number beside what is aimed at, and end with status 1 where one is too large."""
    numbers = measured()
    too_large = above(numbers, RATCHET)
    for name, n in numbers.items():
        goal = f"{CEILING[name]:8d} in the end" if name in CEILING else ""
        fault = f"; must be at most {RATCHET.get(name, 0)}" if name in too_large else ""
        sys.stdout.write(f"{name:20s}{n:8d}{goal}{fault}\n")
    sys.exit(1 if too_large else 0)


if __name__ == "__main__":
    main()
