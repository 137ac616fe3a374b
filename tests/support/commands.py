"""What commands say: within limits, in copies of one process, and overheard."""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import multiprocessing
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from acx4book.command import acx4
from acx4lib.errors import UNSEEN

LINE = re.compile(r"(?s).+:[1-9]\d*: [^:]+.*: .+; .+")
"""What is said of a wrong file: file, line, column, what was found and what was expected."""


def said(*arguments: object) -> tuple[int, str, str]:
    """Return the exit status of `acx4`, standard output and standard error."""
    return said_by(lambda: acx4.main([str(argument) for argument in arguments]))


def said_by(command: Callable[[], object]) -> tuple[int, str, str]:
    """Return the exit status of a command that ends this process, standard output and error."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="strict")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace")
    status = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            command()
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


# --- commands in a process of their own, with their processor time and memory measured ---------


MEMORY = 2**30
"""Bytes of address space beyond that of the libraries."""

PRELOADED = ("support.commands", "acx4files.exchange.flight_folder", "acx4files.conventions")


@dataclass(frozen=True, kw_only=True)
class Told:
    """How a command ended.

    Attributes
    ----------
    status : int
    out, err : str
    seconds : float
        Processor time.
    memory : int
        Bytes of resident memory beyond that before it.
    """

    status: int
    out: str
    err: str
    seconds: float
    memory: int


def told(*arguments: object, memory: int = MEMORY) -> Told:
    """Return how `acx4` ends that has `memory` bytes more than its libraries take."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(_told, [str(one) for one in arguments], memory).result(timeout=300)


def _told(arguments: list[str], memory: int) -> Told:
    said("import", "--help")  # loads what is loaded once
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + memory
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
    Path("/proc/self/clear_refs").write_text("5", "ascii")
    before, start = _peak(), time.process_time()
    status, out, err = said(*arguments)
    seconds, peak = time.process_time() - start, _peak() - before
    return Told(status=status, out=out, err=err, seconds=seconds, memory=peak)


def _peak() -> int:
    status = Path("/proc/self/status").read_text("ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


# --- commands in copies of one process that has loaded the libraries: many in a short time -----


SECONDS = 60
"""A small command takes a few; one that takes longer waits for something, and is ended."""

LOADED = (
    *("acx4files.conventions", "acx4files.flight.summary", "acx4files.exchange.programs.opf"),
    *("acx4book.report.page", "acx4book.planning.design"),
    *("acx4book.command.runs", "acx4book.notebooks.runner", "acx4book.teaching.class_table"),
)


@contextmanager
def commands():
    """Yield a function that runs a command in a folder: its status, negative for a signal, and
    what it said on standard error."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    start = [sys.executable, "-m", "support.commands"]
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


# --- what commands open and import, overheard in their processes and in those that they start ---


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
