"""Names of files made from any name."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import resource

import pytest

from acx4files.results import whole_files
from acx4files.results.whole_files import file_stem
from acx4lib.errors import OutputError
from support.flights import payloads


@contextlib.contextmanager
def largest(size):
    """Let no file grow beyond a size, in bytes, as if the disk were full then."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_it_is_complete(tmp_path):
    place = tmp_path / "table.csv"
    place.write_text("old")
    with whole_files.opened_new(place) as file:
        file.write(b"new")
        file.flush()
        assert place.read_text() == "old"
    assert place.read_text() == "new"
    assert names(tmp_path) == ["table.csv"]


def test_what_breaks_off_leaves_the_old_file(tmp_path):
    place = tmp_path / "table.csv"
    place.write_text("old")

    def breaks_off():
        with whole_files.opened_new(place) as file:
            file.write(b"new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        breaks_off()
    assert place.read_text() == "old"
    assert names(tmp_path) == ["table.csv"]


def test_files_appear_together_or_none_of_them(tmp_path):
    (tmp_path / "a").write_text("old")
    (tmp_path / "c").mkdir()
    for last in ("c", "missing/d"):
        with pytest.raises(OSError, match=re.escape(str(tmp_path / last))):
            whole_files.write_all({tmp_path / last: b"new", tmp_path / "a": "new"})
        assert (tmp_path / "a").read_text() == "old"
        assert names(tmp_path) == ["a", "c"]
    whole_files.write_all({tmp_path / "a": "new", tmp_path / "b": b"new"})
    assert [(tmp_path / name).read_text() for name in "ab"] == ["new", "new"]


def test_without_space_the_file_and_what_it_needs_are_named(tmp_path):
    place = tmp_path / "marks.csv"
    place.write_text("old")
    says = f"{place}: File too large; it needs 12 kB"
    with largest(4096), pytest.raises(OutputError, match=f"^{re.escape(says)}$"):
        whole_files.write(place, "x" * 12_000)

    def grows():
        with whole_files.opened_new(place) as file:
            file.writelines(b"x" * 1000 for _ in range(12))

    with largest(4096), pytest.raises(OutputError, match="it needs more than"):
        grows()
    assert place.read_text() == "old"
    assert names(tmp_path) == ["marks.csv"]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_told_however_it_shows(tmp_path, number):
    place = tmp_path / "x.tif"
    says = f"^{re.escape(f'{place}: {os.strerror(number)}; it needs more than 3 bytes')}"

    def fills_the_disk():
        with whole_files.appearing(place) as draft:
            draft.write_text("abc")
            raise OSError(number, os.strerror(number))

    with pytest.raises(OutputError, match=says) as told:
        fills_the_disk()
    assert ("are free" in str(told.value)) == (number == errno.ENOSPC)
    assert names(tmp_path) == []


def test_a_picture_gets_a_second_name(tmp_path):
    (tmp_path / "a.tif").write_text("picture")
    (tmp_path / "b.tif").write_text("old")
    whole_files.link(tmp_path / "a.tif", tmp_path / "b.tif")
    whole_files.link(tmp_path / "a.tif", tmp_path / "b.tif")
    assert (tmp_path / "b.tif").samefile(tmp_path / "a.tif")
    assert names(tmp_path) == ["a.tif", "b.tif"]


every_name = pytest.mark.parametrize("name", payloads.NAMES.values(), ids=payloads.NAMES)


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("H3-04", "H3-04"),
        ("a/b", "a%2Fb"),
        ("..", "%2E%2E"),
        ("Straße 1", "Straße 1"),
        ("a%", "a%25"),
        ("CON", "%43ON"),
        ("lpt1", "%6Cpt1"),
        ("Con 1", "Con 1"),
        ("Son", "Son"),
        ("a\nb", "a%0Ab"),
    ],
)
def test_any_name_makes_a_file_name(name, stem):
    assert file_stem(name) == stem


@every_name
def test_files_of_payloads_lie_in_their_folder(name, tmp_path):
    path = tmp_path / f"{file_stem(name)}_preview.jpg"
    path.write_text("x")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_long_names_have_files_of_their_own(tmp_path):
    names = [300 * "ß" + end for end in "ab"]
    stems = {file_stem(name) for name in names}
    assert len(stems) == 2
    assert all(len(stem.encode()) <= 200 for stem in stems)
