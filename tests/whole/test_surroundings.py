"""The command behind a pipe, on a full disk, in other encodings and on other systems."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import acx4sim

COMMAND = [sys.executable, "-c", "from acx4book.command.acx4 import main; main()"]


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("surroundings") / "flight"
    options = acx4sim.Options(blocks=("validation",))
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1, options=options), folder)
    toml = folder / "flight.toml"
    lines = toml.read_text(encoding="utf-8").splitlines()
    named = ['name = "Größe 相机"' if line.startswith("name =") else line for line in lines]
    toml.write_text("\n".join(named), encoding="utf-8")
    return folder


def run(*arguments, env=None, **kwargs):
    """Run the command with changes of the environment; None takes a variable out."""
    changed = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path)), **(env or {})}
    kept = {name: value for name, value in changed.items() if value is not None}
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "timeout": 120, **kwargs}
    done = subprocess.run([*COMMAND, *arguments], env=kept, check=False, **given)
    assert b"Traceback" not in (done.stderr or b"")
    return done


# --- standard streams ------------------------------------------------------------------------


def test_a_reader_who_goes_away_is_no_error_to_talk_about(flight):
    read, write = os.pipe()
    os.close(read)
    done = run("check", flight, stdout=write)
    os.close(write)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_behind_standard_output_is_a_line(flight):
    with Path("/dev/full").open("w") as full:
        done = run("check", flight, stdout=full)
    assert done.returncode == 2
    assert done.stderr == b"standard output: No space left on device\n"


@pytest.mark.parametrize(
    "env",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"LC_ALL": "POSIX", "PYTHONIOENCODING": "latin-1"},
    ],
    ids=["ascii", "C", "latin-1"],
)
def test_names_of_any_script_are_said_in_any_encoding(flight, env):
    done = run("check", flight, env=env)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"Gr" in done.stdout.splitlines()[0]


# --- other systems ---------------------------------------------------------------------------
#
# Without what only POSIX systems have, flights are simulated, checked, run and reported.


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
for typed in sys.argv[1:]:
    sys.argv[1:] = typed.split()
    try:
        main()
    except SystemExit as ended:
        if ended.code:
            raise
'''
"""Hides what Windows lacks from this interpreter, and starts one command after the other."""

COMMANDS = (
    "simulate single-head --out flight",
    "check flight",
    "run flight --results results --numbers-only",
    "report results --out report.html",
)


@pytest.mark.slow
def test_commands_need_nothing_of_posix(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", HIDE, *COMMANDS],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "report.html").stat().st_size > 10_000
