"""Start of ``acx4``: it imports nothing that takes time, so that an interruption is heard."""

from __future__ import annotations

import gc
import signal
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import NoReturn

COMMAND = ("click", "cv2", "imagecodecs", "rich", "tifffile", "typer")
"""Modules of the extra ``command``."""


def main() -> NoReturn:
    """Run the command of the command line and exit."""
    gc.set_threshold(100_000, 20, 20)  # most objects of an import stay: a tenth of a short command
    try:
        from acx4book.command import acx4  # noqa: PLC0415 takes longest
    except ModuleNotFoundError as error:
        if error.name not in COMMAND:
            raise
        cure = "pip install 'acx4lib[command]'"
        sys.exit(_said(f"acx4 needs {error.name}, not installed here: {cure}", 2))
    except KeyboardInterrupt:
        sys.exit(_said("interrupted", 128 + signal.SIGINT))
    acx4.main()


def _said(line: str, status: int) -> int:
    sys.stderr.write(f"{line}\n")
    return status
