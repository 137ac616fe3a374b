"""The page on the speed of commands, and what was tried of reading files of other programs.

``make bench`` writes the numbers to ``data/benchmarks``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from acx4book.pages.benchmarks import sigma
from acx4book.typesetting.myst import at_commit, myst_table
from acx4book.typesetting.plain_text import Markup


def text(folder: Path) -> str:
    """Return date, machine and table of whole commands as MyST text.

    Parameters
    ----------
    folder : Path
        With ``commands.csv``, a row for each run, and ``commands.json``: date, machine, versions.
    """
    about, (runs,) = sigma.read_stored(folder, "commands")
    medians = runs.groupby(["flight", "command"], sort=False).median(numeric_only=True)
    commands = medians.reset_index()
    table = pd.DataFrame(
        {
            "Flight": commands["flight"],
            "Command": [Markup(f"`acx4 {name}`") for name in commands["command"]],
            "Images": commands["images"].astype(int),
            "Image points": commands["measurements"].astype(int),
            "Seconds": commands["wall_s"],
            "CPU seconds": commands["cpu_s"],
            "MB": commands["tree_mb"],
        }
    )
    formats = dict.fromkeys(("Images", "Image points"), ",d")
    formats |= {"Seconds": ".1f", "CPU seconds": ".1f", "MB": ",.0f"}
    caption = (
        "Whole commands: the time that passes, CPU time of all processes, and the largest memory "
        "of all processes together"
    )
    software = ", ".join(f"{name} {version}" for name, version in about["versions"].items())
    return (
        f"Measured on {about['date']} at {at_commit(about['commit'])}: {about['processor']}, "
        f"{about['cores']} cores, {about['memory_gb']:g} GB of memory; {software}.\n\n"
        f"{myst_table(table, caption, name='tab-speed-commands', formats=formats)}\n"
    )


# --- what was tried of reading files of other programs


WIDTH = 76
"""Longest line on the page, characters; longer lines are wrapped."""


def of_imports(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield name and text for each kind of import: the command and its output.

    Parameters
    ----------
    folder : Path
        With ``imports.csv``.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    """
    about, (table,) = sigma.read_stored(folder, "imports", make="reference-results")
    for kind, rows in table.groupby("kind", sort=False):
        lines = [f"$ {about['commands'][kind]}", *rows["line"]]
        yield f"imports-{kind}.txt", wrapped("\n".join(lines) + "\n")


def wrapped(text: str) -> str:
    """Wrap the long lines of a text; continued lines are indented."""
    return "".join(f"{_wrapped(line)}\n" for line in text.splitlines())


def _wrapped(line: str) -> str:
    indent = " " * (len(line) - len(line.lstrip()))
    return textwrap.fill(
        line,
        WIDTH,
        subsequent_indent=f"{indent}    ",
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
