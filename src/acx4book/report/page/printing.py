"""Pages of HTML as PDF, printed by Chromium."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

from acx4lib.errors import Acx4Error

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
"""What Chromium is called on different systems."""

MISSING = (
    "a PDF is printed by Chromium, which is not here: install the package chromium "
    "(Debian, Ubuntu: apt-get install chromium)"
)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer"),
    *("--host-resolver-rules=MAP * ~NOTFOUND", "--virtual-time-budget=60000"),
)
END = b"%%EOF"
"""Of a whole PDF."""

SECONDS = 300
"""After which a page is given up."""


class PrintError(Acx4Error):
    """A page was not printed."""


def chromium() -> str:
    """Return the path of Chromium.

    Raises
    ------
    PrintError
        Where there is none.
    """
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise PrintError(MISSING)
    return found


def printed(browser: str, page: Path, pdf: Path) -> None:
    """Print a page.

    Raises
    ------
    PrintError
        If the browser does not.
    """
    with tempfile.TemporaryDirectory() as profile:
        command = [browser, *FLAGS, f"--user-data-dir={profile}", f"--print-to-pdf={pdf.resolve()}"]
        command.append(page.resolve().as_uri())
        try:
            subprocess.run(command, cwd=profile, capture_output=True, timeout=SECONDS, check=True)
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
            msg = f"{page.name}: Chromium did not print it ({error})"
            raise PrintError(msg) from error
    if not pdf.is_file() or END not in pdf.read_bytes()[-1024:]:
        msg = f"{page.name}: Chromium wrote no whole PDF"
        raise PrintError(msg)
