"""What commands open and import, overheard in their processes and in those that they start.

The folder of `listen` goes onto PYTHONPATH: Python loads its `sitecustomize` first.
"""

import os
from pathlib import Path

LOG = "ACX4_OVERHEARD"
"""Environment variable with the file in which every process writes what it does."""

_LISTENER = f"""
import os, sys

into = os.environ.get({LOG!r})
if into:
    number, busy = os.open(into, os.O_WRONLY | os.O_APPEND | os.O_CREAT), []

    def hear(event, args, write=os.write, cwd=os.getcwd, decoded=os.fsdecode):
        if busy or event not in ("open", "import", "os.listdir", "os.scandir", "ctypes.dlopen"):
            return
        busy.append(event)
        try:
            here = cwd()
            if event == "import":
                told = [decoded(path) for path in args[2] or () if isinstance(path, str | bytes)]
            elif isinstance(args[0], str | bytes | os.PathLike):
                told = [decoded(args[0])]
            else:
                told = []
            name = str(args[0]) if event == "import" else ""
            for path in told:
                where = os.path.abspath(os.path.join(here, path))
                line = "\\t".join((event, name, where)).encode(errors="replace")
                write(number, line.replace(b"\\n", b" ") + b"\\n")
        except FileNotFoundError:
            pass  # the folder in which the process stands is gone
        finally:
            busy.clear()

    sys.addaudithook(hear)
"""


def listen(folder: Path) -> Path:
    """Write what listens into a new folder, and return this."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(_LISTENER, encoding="utf-8")
    return folder


def heard(log: Path) -> set[tuple[str, str, Path]]:
    """Return event, module (of an import) and absolute path of everything that was looked up."""
    told = (line.split("\t", 2) for line in log.read_text("utf-8", "replace").splitlines())
    return {(event, name, Path(os.path.normpath(path))) for event, name, path in told}
