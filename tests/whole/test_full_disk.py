"""On a full disk a command says which file has no space, and leaves nothing cut or half written."""

import os
import shutil
import subprocess

import pytest

from support import every_command
from support.helpers import repeats

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
        if path.is_file() and path.name not in (".acx4.json", "times.csv")
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
