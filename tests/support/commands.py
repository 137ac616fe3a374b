"""What commands say, overheard."""

from __future__ import annotations

import contextlib
import io
import re

from acx4book.command import acx4
from acx4lib.errors import UNSEEN

LINE = re.compile(r"(?s).+:[1-9]\d*: [^:]+.*: .+; .+")
"""What is said of a wrong file: file, line, column, what was found and what was expected."""


def said(*arguments: object) -> tuple[int, str, str]:
    """Return the exit status of `acx4`, standard output and standard error."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="strict")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace")
    status = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            acx4.main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = int(end.code or 0)
    out.flush()
    err.flush()
    return status, *(stream.buffer.getvalue().decode() for stream in (out, err))  # type: ignore[attr-defined]


def complaint(status: int, out: str, err: str) -> str:
    """Return what is wrong with what a command said, empty for nothing."""
    lines = err.splitlines()
    if UNSEEN.search((out + err).replace("\n", "")):
        return f"control characters: {out + err!r}"
    if status == 0:
        return "said on standard error: " + err if err else ""
    if status != 2 or not lines or out:
        return f"status {status}: {out + err}"
    wrong = [line for line in lines if not LINE.fullmatch(line)]
    return f"not a line of its own: {wrong[0]!r}" if wrong else ""
