"""No command waits for a file that is a pipe, whichever of its files that is."""

import os
import shutil
from pathlib import Path

import pytest

from support import every_command
from support.helpers import repeats


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
