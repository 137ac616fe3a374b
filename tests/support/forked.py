"""Commands in copies of one process that has loaded the libraries: many in a short time."""

import importlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from contextlib import contextmanager, suppress

from acx4book.command import acx4

SECONDS = 60
"""A small command takes a few; one that takes longer waits for something, and is ended."""

LOADED = (
    *("acx4lib.conventions", "acx4lib.flight.summary", "acx4tools.exchange.programs.opf"),
    *("acx4book.report.page", "acx4book.report.campaigns.written", "acx4tools.planning.design"),
    *(
        "acx4book.command.runs",
        "acx4book.notebooks.functions",
        "acx4book.teaching.class_table",
    ),
)


@contextmanager
def commands():
    """Yield a function that runs a command in a folder: its status, negative for a signal, and
    what it said on standard error."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    start = [sys.executable, "-m", "support.forked"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(start, env=environment, **pipes) as process:

        def run(typed, folder):
            process.stdin.write(json.dumps([list(map(str, typed)), str(folder)]) + "\n")
            process.stdin.flush()
            return tuple(json.loads(process.stdout.readline()))

        yield run
        process.stdin.close()


def main():
    """Run what standard input says, a line of JSON each."""
    for name in LOADED:
        importlib.import_module(name)
    for line in sys.stdin:
        with tempfile.TemporaryFile() as said:
            status = run(*json.loads(line), said.fileno())
            said.seek(0)
            sys.stdout.write(json.dumps([status, said.read().decode()]) + "\n")
            sys.stdout.flush()


def run(typed, folder, said):
    """Run a command in a copy of this process, and return its status."""
    child = os.fork()
    if not child:
        os.setsid()
        signal.alarm(SECONDS)
        os.chdir(folder)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream, of in enumerate((nowhere, nowhere, said)):
            os.dup2(of, stream)
        try:
            acx4.main(typed)
        except SystemExit as end:
            os._exit(end.code or 0)
        os._exit(99)
    _, status = os.waitpid(child, 0)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what it started
    return os.waitstatus_to_exitcode(status)


if __name__ == "__main__":
    main()
