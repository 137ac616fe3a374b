import signal
import subprocess
import sys

import pytest

INTERRUPTED = """
import os, signal, sys

def hear(event, args, begun=[]):
    if event == "import" and args[0] == {module!r} and not begun:
        begun.append(args[0])
        os.kill(os.getpid(), signal.SIGINT)

sys.addaudithook(hear)
from acx4book.command.start import main
main()
"""


def run(module, *, heard=True):
    """Run a command that is interrupted when it begins to load a module."""
    signals = signal.default_int_handler if heard else signal.SIG_IGN
    return subprocess.run(
        [sys.executable, "-c", INTERRUPTED.format(module=module), "check", "no-flight"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signals),
    )


@pytest.mark.parametrize(
    "module",
    ["typer", "acx4book.command.acx4", "importlib.metadata", "numpy", "acx4lib.flight.reader"],
)
def test_an_interruption_while_modules_are_loaded_shows_no_traceback(module):
    done = run(module)
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


LOST = """
import os, signal

class Removed:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)

from acx4book.command.endings import status_of

def command():
    Removed()
    while True:
        pass

raise SystemExit(status_of(command, []))
"""


def test_an_interruption_that_python_loses_is_heard():
    command = [sys.executable, "-c", LOST]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


def test_what_ignores_interruptions_goes_on():
    """As behind ``nohup``, or in the background of a script."""
    done = run("typer", heard=False)
    assert done.returncode == 2
    assert "no-flight" in done.stderr
