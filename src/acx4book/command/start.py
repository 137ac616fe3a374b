"""Start of ``acx4``: an interruption while modules are loaded ends it without traceback.

It imports nothing that takes time.
"""

from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import NoReturn

INTERRUPTED = 128 + signal.SIGINT
"""Exit status of an interrupted command."""

SAYS = "interrupted"

COMMAND = ("click", "cv2", "imagecodecs", "rich", "tifffile", "typer")
"""Modules of the extra ``command``."""

CURE = "pip install 'acx4lib[command]'"


def main() -> NoReturn:
    """Run the command of the command line and exit."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else ignored, and stays so
        signal.signal(signal.SIGINT, stop)
    try:
        from acx4book.command import acx4  # noqa: PLC0415 takes longest
    except ModuleNotFoundError as error:
        if error.name not in COMMAND:
            raise
        os.write(2, f"acx4 needs {error.name}, not installed here: {CURE}\n".encode())
        sys.exit(2)
    acx4.main()


def stop(*_: object) -> NoReturn:
    """End this process at once: nothing is begun yet, or all is done."""
    os.write(2, f"{SAYS}\n".encode())
    os._exit(INTERRUPTED)
