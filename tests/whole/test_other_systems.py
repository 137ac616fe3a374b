"""Without what only POSIX systems have, flights are simulated, checked, run and reported."""

import subprocess
import sys

import pytest

from acx4lib import system

HIDE = '''
import os, signal, sys
for name in ("fcntl", "grp", "pwd", "resource", "termios", "tty", "pty", "syslog", "readline"):
    sys.modules[name] = None
FUNCTIONS = """chown fchmod fchown fchdir fork forkpty getgid getuid geteuid getegid getloadavg kill
killpg lchown mkfifo nice openpty pread pwrite sched_getaffinity setpgid setsid statvfs sysconf
waitid O_CLOEXEC O_DIRECTORY O_NOCTTY O_NOFOLLOW O_NONBLOCK O_PATH"""
SIGNALS = "SIGHUP SIGKILL SIGPIPE SIGALRM SIGCHLD pthread_sigmask alarm setitimer"
for module, names in ((os, FUNCTIONS), (signal, SIGNALS)):
    for name in names.split():
        delattr(module, name)
from acx4book.command.start import main
main()
'''
"""Hides what Windows lacks from this interpreter, and starts the command."""


def other(*typed, folder):
    return subprocess.run(
        [sys.executable, "-c", HIDE, *map(str, typed)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


COMMANDS = (
    ("simulate", "single-head", "--out", "flight"),
    ("run", "flight", "--results", "results", "--numbers-only"),
    ("report", "results", "--out", "report.html"),
)


@pytest.mark.slow
def test_commands_need_nothing_of_posix(tmp_path):
    for typed in COMMANDS:
        done = other(*typed, folder=tmp_path)
        assert (done.returncode, done.stderr) == (0, ""), typed
    assert (tmp_path / "report.html").stat().st_size > 100_000
    assert not [*tmp_path.rglob(".acx4.lock")]


def test_a_process_that_cannot_be_asked_after_may_be_alive(monkeypatch):
    """On Windows to ask would end it."""
    monkeypatch.setattr(system.os, "name", "nt")
    monkeypatch.delattr(system.os, "kill")
    assert system.is_alive(1)


def test_flags_that_a_system_lacks_are_none_of_its_flags():
    assert system.flags("O_NO_SUCH") == 0
