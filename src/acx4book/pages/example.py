"""The code of the page about the library, run from top to bottom, and what it prints."""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
from collections.abc import Iterator

FENCE = re.compile(r"^```python\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)


def snippets(page: str) -> list[str]:
    """Return the Python code of a page, piece by piece."""
    return FENCE.findall(page)


def outputs(codes: list[str]) -> Iterator[str]:
    """Run pieces of code one after the other, in an empty folder; yield what each prints."""
    names: dict[str, object] = {"__name__": "example"}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for number, code in enumerate(codes, 1):
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                exec(compile(code, f"<piece {number} of the page>", "exec"), names)
            yield said.getvalue()
