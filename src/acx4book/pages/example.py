"""The example on the page about the library: its code is run, and its output shown."""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
from pathlib import Path

from acx4lib.errors import Acx4Error


def code(page: str) -> str:
    """Return the first Python code of a page."""
    found = re.search(r"```python\n(.*?)```", page, flags=re.DOTALL)
    return found[1] if found else ""


def output(text: str, flight: Path, results: Path) -> str:
    """Run the code where the flight is called my_flight and its results my_results.

    Returns
    -------
    str
        What it prints; in the end why it stops, where the flight lacks what the code asks for.
    """
    said = io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "my_flight").symlink_to(flight.resolve())
        (Path(folder) / "my_results").symlink_to(results.resolve())
        with contextlib.chdir(folder), contextlib.redirect_stdout(said):
            try:
                exec(compile(text, "example", "exec"), {})
            except (Acx4Error, ValueError) as error:
                print(error, file=said)
    return said.getvalue()
