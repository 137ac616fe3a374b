"""No command looks up anything in the working folder, or above it, that was not named to it.

Users unpack a stranger's flight, go into its folder, and type commands there.
"""

import importlib.metadata
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from support import every_command, overheard
from support.helpers import repeats

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
    listening = overheard.listen(tmp_path / "listening")
    above = [path for path in sys.path if Path(path).is_absolute()]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(listening), *above]),
        overheard.LOG: str(tmp_path / "log"),
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
        for event, name, path in overheard.heard(log)
        if is_unnamed(event, path)
    )
