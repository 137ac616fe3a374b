"""No command waits for a pipe, or looks up anything in the working folder; a full disk is named."""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from support import commands, every_command
from support.helpers import repeats

# --- no command waits for a file that is a pipe, whichever of its files that is --------------


@pytest.mark.parametrize(
    "typed",
    [
        one if name in every_command.OF_EACH_KIND and not n else repeats(one)
        for name, typed in every_command.ALL.items()
        for n, one in enumerate(typed)
        if "pictured" not in one[2:]
    ],
    ids=lambda typed: " ".join(typed[:4]),
)
def test_no_command_waits_for_a_pipe(material, command, tmp_path, typed):
    here = tmp_path / "here"
    shutil.copytree(material, here, copy_function=os.link)
    if typed[0] == "grade":
        command([*every_command.LAB[:-1], "handed_in"], here)
    typed = [one for one in typed if one != "--pdf"]
    command(typed, here)  # so that there is something in its output, too
    if typed[0] == "run":
        typed = [*typed, "--stages", "validation"]  # takes no time
    named = sorted({word.split("/")[0] for word in typed if (here / word).exists()})
    files = {path.name: path for name in named for path in files_of(here / name)}
    if typed[0] == "book":  # of its many pages one is tried
        flown = here / "flown"
        files = {n: p for n, p in files.items() if n == "index.html" or p.is_relative_to(flown)}
    if "--jobs" in typed and typed[0] == "run":  # what its processes read is tried above
        files = {name: here / "out" / name for name in files if (here / "out" / name).is_file()}
    assert files
    for file in files.values():  # one of each name
        status, said = with_pipe(file, typed, here, command)
        assert status >= 0, f"waits for {file}"
        assert "Traceback" not in said
        assert "mistake in acx4" not in said, f"{file}: {said}"
    shutil.rmtree(here)


def files_of(path: Path):
    """Return a file, or all files below a folder."""
    return [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())


def with_pipe(file, typed, here, run):
    """Run a command with a pipe in the place of a file."""
    aside = here.parent / "aside"
    file.rename(aside)
    os.mkfifo(file)
    try:
        return run(typed, here)
    finally:
        file.unlink(missing_ok=True)
        file.parent.mkdir(parents=True, exist_ok=True)
        aside.rename(file)


# --- full disk -------------------------------------------------------------------------------
#
# On a full disk a command says which file has no space, and leaves nothing cut or half written.


SIZE = 64_000_000
"""Bytes of the disk."""

FREE = (0, 4_096, 20_480, 102_400, 1_048_576)
"""Bytes that are free when a command begins."""

ONCE = ("simulate", "new", "lab", "import", "measure")
"""Commands that write into a new place, or add to what is there."""

WRITING = {name: typed[:1] for name, typed in every_command.TYPED.items() if name != "check"}
WRITING |= {
    "run": every_command.TYPED["run"][:1],
    "run --jobs": every_command.TYPED["run"][2:],
    "import opf": every_command.ALL["import opf"][:1],
}


@pytest.fixture
def disk(tmp_path):
    """A small disk of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(folder)]
    if os.getuid() or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("only an administrator can mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.parametrize(
    "name",
    [name if name == "import opf" else repeats(name) for name in WRITING],
)
def test_a_full_disk_is_named_and_what_was_there_stays(material, command, disk, name):
    for typed in WRITING[name]:
        check(typed, material, command, disk)


def check(typed, material, run, disk):
    """Run a command at first with all the space, and then with less and less."""
    if typed[0] == "grade":
        lab = [*every_command.LAB[:-1], str(disk / "handed_in")]
        assert run(lab, material) == (0, "")
        typed = [word.replace("handed_in", str(disk / "handed_in")) for word in typed]
    typed = [str(disk / word) if word.startswith("out") else word for word in typed]
    typed = [word for word in typed if word != "--pdf"]
    status, said = run(typed, material)
    assert status in (0, 1), said
    whole = content(disk)
    given = content(material / "pictured")  # which measure copies before it measures
    refused = 0
    for free in FREE:
        if typed[0] in ONCE:
            remove(disk)
        with_filler(disk, free)
        status, said = run(typed, material)
        (disk / "filler").unlink()
        assert status in (0, 1, 2), said
        if "No space left" in said:
            refused += 1
            assert status == 2, said
            assert len(said.splitlines()) == 1 or "--jobs" in typed, said
            assert f"{disk}/" in said
            assert "No space left on device; it needs" in said
        assert "mistake in acx4" not in said
        left = content(disk)
        changed = [
            path
            for path in left
            if left[path] not in (whole.get(path), given.get(path.partition("/")[2]))
        ]
        assert not changed, said
        assert typed[0] in ONCE or whole.keys() <= left.keys()
    assert refused
    remove(disk)


def content(disk):
    """Return the content of all files, but for marks and locks, and for what tells times."""
    return {
        str(path.relative_to(disk)): path.read_bytes()
        for path in disk.rglob("*")
        if path.is_file() and path.name != ".acx4.json"
    }


def remove(disk):
    for path in disk.iterdir():
        if path.name != "handed_in":
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def with_filler(disk, free):
    """Fill the disk up to the last bytes."""
    left = os.statvfs(disk)
    size = left.f_bavail * left.f_frsize - free
    with (disk / "filler").open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, size)


# --- working folder --------------------------------------------------------------------------
#
# No command looks up anything in the working folder, or above it, that was not named to it.
# Users unpack a stranger's flight, go into its folder, and type commands there.


MAIN = 'if __name__ == "__main__":\n    from acx4book.command.start import main\n    main()\n'

SPOILT = 'import os\nopen(os.path.join({folder!r}, "executed"), "a").write(__name__ + "\\n")\n'
"""Of every module in the working folder."""

SETTINGS = {
    "matplotlibrc": "text.usetex: True\nsavefig.dpi: 7\nfont.size: 31\n",
    ".numba_config.yaml": "cache_dir: ./kept\ndisable_jit: 1\n",
    **dict.fromkeys(("proj.ini", "proj.db", "proj.pth", "spoilt.pth"), "import multiprocessing\n"),
    **dict.fromkeys((".env", "pyproject.toml", "setup.cfg", "tox.ini", ".coveragerc"), "[a]\n"),
    **dict.fromkeys((".git", "pyvenv.cfg", "python311._pth", "python._pth"), "home = .\n"),
    **dict.fromkeys(("dask.yaml", "distributed.yaml", "jobqueue.yaml"), "temporary-directory: .\n"),
    **dict.fromkeys(("jupyter_config.json", "jupyter_papermill_config.json"), "{}\n"),
    **dict.fromkeys(("papermill.yaml", "numba.yaml", ".jupyter", ".ipython"), "a: 1\n"),
}
"""What libraries look for, by the name of the file."""

CONFIGURED = ("ipython", "ipython_kernel", "jupyter", "jupyter_papermill", "jupyter_notebook")
PROGRAMS = ("latex", "dvipng", "kpsewhich", "chromium", "gcc", "git", "ldconfig", "fc-list")


def spoil(folder):
    """Fill a folder with whatever Python, a library or a system may look for."""
    installed = {name for name in importlib.metadata.packages_distributions() if "." not in name}
    modules = {*sys.stdlib_module_names, *installed, "sitecustomize", "usercustomize"}
    modules |= {f"{name}_config" for name in CONFIGURED}
    for name in modules:
        (folder / f"{name}.py").write_text(SPOILT.format(folder=str(folder)), encoding="utf-8")
    for name, text in SETTINGS.items():
        (folder / name).write_text(text, encoding="utf-8")
    for name in PROGRAMS:
        (folder / name).write_text(f"#!/bin/sh\necho {name} >> '{folder}/executed'\n")
        (folder / name).chmod(0o755)


@pytest.fixture
def here(material, tmp_path):
    """A working folder with that, in which everything that may be looked for is spoilt."""
    folder = tmp_path / "above" / "here"
    shutil.copytree(material, folder, copy_function=os.link)
    for spoilt in (folder, folder.parent):
        spoil(spoilt)
    return folder


def test_every_command_is_tried():
    assert sorted(every_command.names()) == sorted(every_command.ALL)


@pytest.mark.parametrize(
    "typed",
    [
        one if name in every_command.OF_EACH_KIND and not n else repeats(one)
        for name, typed in every_command.ALL.items()
        for n, one in enumerate(typed)
    ],
    ids=lambda typed: " ".join(typed[:4]),
)
def test_nothing_is_looked_up_in_the_working_folder(here, tmp_path, typed):
    if typed[0] == "grade":
        assert run([*every_command.LAB[:-1], "handed_in"], here, tmp_path / "first").returncode == 0
    done = run(typed, here, tmp_path)
    assert b"Traceback" not in done.stderr
    assert done.returncode == 0 or typed[0] in ("new", "run"), done.stderr  # no grid is here
    for folder in (here, here.parent):
        assert not (folder / "executed").exists(), (folder / "executed").read_text()
    assert not looked_up(here, tmp_path / "log", typed)


def run(typed, here, tmp_path):
    """Run a command in the working folder, overheard."""
    tmp_path.mkdir(exist_ok=True)
    script = tmp_path / "bin" / "acx4"
    script.parent.mkdir()
    script.write_text(MAIN)
    listening = commands.listen(tmp_path / "listening")
    above = [path for path in sys.path if Path(path).is_absolute()]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(listening), *above]),
        commands.LOG: str(tmp_path / "log"),
        "PATH": f":.:{os.environ['PATH']}",  # as it should not be
        "MPLCONFIGDIR": str(tmp_path / "fonts"),  # not yet searched for
    }
    return subprocess.run(
        [sys.executable, script, *typed],
        cwd=here,
        env=environment,
        capture_output=True,
        check=False,
        timeout=300,
    )


def looked_up(here, log, typed):
    """Return what was looked up in the working folder, or above it, and was not named."""
    names = {word.split("/")[0] for word in typed if (here / word.split("/")[0]).exists()}
    named = {here / name for name in (*names, "out.truth.json")}
    outside = {here, here.parent}

    def is_unnamed(event, path):
        if event == "import":
            return path in outside
        if path in outside or path.parent not in outside or path in named:
            return False
        # the name of a file below an open folder is told without the folder
        return path.exists()

    return sorted(
        (event, name, str(path))
        for event, name, path in commands.heard(log)
        if is_unnamed(event, path)
    )
